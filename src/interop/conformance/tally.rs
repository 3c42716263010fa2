//! Counts of a comparison: rows, agreements and the largest deviations, per model.

use crate::model::driver::ModelId;

/// Largest deviation of one quantity, with its row.
#[derive(Debug, Clone, PartialEq)]
pub struct Deviation {
    /// Quantity, with its unit.
    pub quantity: &'static str,
    /// Number of values compared on robust rows.
    pub compared: u64,
    /// Largest |ours − theirs| on robust rows.
    pub largest: f64,
    /// File and line of the largest.
    pub place: String,
}

/// Agreement of one model (and table) with a golden table.
#[derive(Debug, Clone, PartialEq)]
pub struct Tally {
    /// Table or category, for output.
    pub label: String,
    /// Model; `None` for functions.
    pub model: Option<ModelId>,
    /// Rows.
    pub rows: u64,
    /// Rows whose outcome does not depend on rounding.
    pub robust: u64,
    /// Rows in which our model reacted.
    pub reacted: u64,
    /// Rows in which our model collided.
    pub collided: u64,
    /// Rows with the same collision label.
    pub labels_equal: u64,
    /// Robust rows with the same crash type.
    pub types_equal: u64,
    /// Non-robust rows whose type or values differ: information only.
    pub fragile_different: u64,
    /// Largest deviations, by quantity.
    pub deviations: Vec<Deviation>,
    /// The first disagreements in words.
    pub complaints: Vec<String>,
}

/// Maximum difference of values on robust rows.
pub const TOLERANCE: f64 = 1e-6;

impl Tally {
    /// Starts an empty tally.
    pub fn new(label: impl Into<String>, model: Option<ModelId>) -> Self {
        Tally {
            label: label.into(),
            model,
            rows: 0,
            robust: 0,
            reacted: 0,
            collided: 0,
            labels_equal: 0,
            types_equal: 0,
            fragile_different: 0,
            deviations: Vec::new(),
            complaints: Vec::new(),
        }
    }

    /// Whether every label agrees, and on robust rows every type and value.
    pub fn passes(&self) -> bool {
        self.labels_equal == self.rows
            && self.types_equal == self.robust
            && self.deviations.iter().all(|d| d.largest <= TOLERANCE)
    }

    /// Adds one compared value: equal, both absent, or different by some amount (infinite if one is absent). Returns
    /// whether it agrees within the tolerance.
    pub fn value(
        &mut self,
        quantity: &'static str,
        robust: bool,
        ours: Option<f64>,
        theirs: Option<f64>,
        place: &dyn Fn() -> String,
    ) -> bool {
        let deviation = match (ours, theirs) {
            (None, None) => return true,
            (Some(a), Some(b)) if a == b => 0.0,
            (Some(a), Some(b)) => {
                let d = (a - b).abs();
                if d.is_nan() { f64::INFINITY } else { d }
            }
            _ => f64::INFINITY,
        };
        if robust {
            let at = match self.deviations.iter().position(|d| d.quantity == quantity) {
                Some(at) => at,
                None => {
                    self.deviations.push(Deviation { quantity, compared: 0, largest: 0.0, place: String::new() });
                    self.deviations.len() - 1
                }
            };
            let entry = &mut self.deviations[at];
            entry.compared += 1;
            if deviation > entry.largest {
                entry.largest = deviation;
                entry.place = place();
            }
            if deviation > TOLERANCE {
                let shown = |v: Option<f64>| v.map_or("nothing".to_owned(), |v| v.to_string());
                self.complain(format!("{}: {quantity} is {}, the table has {}", place(), shown(ours), shown(theirs)));
            }
        }
        deviation <= TOLERANCE
    }

    /// Keeps the first disagreements in words.
    pub fn complain(&mut self, text: String) {
        if self.complaints.len() < 10 {
            self.complaints.push(text);
        }
    }
}
