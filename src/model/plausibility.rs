//! Plausible ranges, physical ranges and commonly mistaken units: one table for every reader and every flag.
//! `docs/src/tables.md` shows it to users; a test compares the two.
//!
//! A value outside the plausible range is used and reported. One outside the physical range is refused, unless the user
//! accepts implausible input; then it is reported too. Readers themselves refuse values that no arithmetic can hold.

use std::sync::LazyLock;

use lanesweep_support::{option, readable};

/// Quantity of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // the table below
pub enum Quantity {
    Speed,
    LateralSpeed,
    LaneChangeSpeed,
    Acceleration,
    Gap,
    Headway,
    LateralPosition,
    Length,
    Width,
    LaneWidth,
    Rate,
}

/// A row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// The quantity.
    pub quantity: Quantity,
    /// Its name in messages.
    pub name: &'static str,
    /// Unit of the ranges.
    pub unit: &'static str,
    /// Minimum and maximum plausible value.
    pub plausible: (f64, f64),
    /// Minimum and maximum physical value of a vehicle or a road.
    pub physical: (f64, f64),
    /// Units that are often used by mistake, and their number per own unit.
    pub mistaken: &'static [(&'static str, f64)],
}

const LENGTHS: &[(&str, f64)] = &[("feet", 3.280_839_895), ("cm", 100.0), ("mm", 1000.0)];

type Range = (f64, f64);

const fn of(
    quantity: Quantity,
    name: &'static str,
    unit: &'static str,
    plausible: Range,
    physical: Range,
    mistaken: &'static [(&'static str, f64)],
) -> Limits {
    Limits { quantity, name, unit, plausible, physical, mistaken }
}

#[rustfmt::skip] // a table: one line per quantity
/// The table, in the order of [`Quantity`].
pub const LIMITS: [Limits; 11] = [
    of(Quantity::Speed, "speed", "m/s", (0.0, 70.0), (0.0, 100.0), &[("km/h", 3.6)]),
    of(Quantity::LateralSpeed, "lateral speed", "m/s", (-5.0, 5.0), (-10.0, 10.0), &[]),
    of(Quantity::LaneChangeSpeed, "lateral speed of a lane change", "m/s", (0.0, 3.0), (0.0, 10.0), &[("km/h", 3.6)]),
    of(Quantity::Acceleration, "acceleration", "m/s²", (-12.0, 8.0), (-30.0, 30.0), &[]),
    of(Quantity::Gap, "gap", "m", (-50.0, 1000.0), (-1e4, 1e4), &[("cm", 100.0), ("mm", 1000.0)]),
    of(Quantity::Headway, "time headway", "s", (-10.0, 10.0), (-1e5, 1e5), &[]),
    of(Quantity::LateralPosition, "lateral position", "m", (-15.0, 15.0), (-100.0, 100.0), LENGTHS),
    of(Quantity::Length, "vehicle length", "m", (1.0, 30.0), (0.1, 100.0), LENGTHS),
    of(Quantity::Width, "vehicle width", "m", (0.4, 3.2), (0.1, 10.0), LENGTHS),
    of(Quantity::LaneWidth, "lane width", "m", (2.0, 6.0), (0.5, 50.0), LENGTHS),
    of(Quantity::Rate, "sample rate", "Hz", (2.0, 200.0), (1.0, 1e4), &[]),
];

/// An initial distance up to which every headway is plausible, m: a slow ego is many seconds behind a vehicle that is near.
pub(crate) const NEAR_M: f64 = 100.0;

/// Length and width of which a usual car exceeds one, m.
const SMALL_CAR_M: (f64, f64) = (3.3, 1.4);

/// Speeds between this value and 0 are noise of a standing vehicle, m/s.
pub const NOISE_MPS: f64 = -0.5;

/// What a user can do about a refused value.
pub static HELP: LazyLock<String> =
    LazyLock::new(|| format!("correct the value or its unit; {} uses it as it is", option("accept_implausible")));

/// Policy for values outside the physical range.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Implausible {
    /// They are errors.
    #[default]
    Refused,
    /// They are used and reported.
    Accepted,
}

impl Quantity {
    /// The row of the table.
    #[inline]
    pub(crate) fn limits(self) -> &'static Limits {
        &LIMITS[self as usize]
    }

    /// Whether the value is plausible.
    #[inline]
    pub fn is_plausible(self, value: f64) -> bool {
        contains(self.limits().plausible, value)
    }

    /// A value that is not plausible, in words.
    pub fn describe(self, value: f64) -> String {
        let of = self.limits();
        let ((min, max), words) = match contains(of.physical, value) {
            true => (of.plausible, "is not plausible"),
            false => (of.physical, "is beyond what is physical"),
        };
        let article = if of.name.starts_with('a') { "an" } else { "a" };
        // A wrong unit makes a number too large; a lorry that is overtaken is far behind.
        let is_large =
            |(_, per_own): &&(&str, f64)| value.abs() > of.plausible.1 && contains(of.plausible, value / per_own);
        let (unit, text) = (of.unit, readable::value(value));
        let hint = match of.mistaken.iter().find(is_large) {
            // In feet it would be that of a motorcycle.
            _ if self == Quantity::Width && (3.2..=5.2).contains(&value) => {
                "; is it the lane's, or a length?".to_owned()
            }
            Some((other, per_own)) => {
                format!("; {text} looks like {other}: {} {unit}", readable::value(value / per_own))
            }
            None if self == Quantity::Headway => "; is it in ms, or a gap in m?".to_owned(),
            None => String::new(),
        };
        format!("{text} {unit} {words} for {article} {} ({min} to {max} {unit}){hint}", of.name)
    }
}

#[inline]
fn contains((min, max): (f64, f64), value: f64) -> bool {
    min <= value && value <= max
}

/// How often a problem occurred, and its first place.
#[derive(Debug, Clone, Default)]
struct Finding {
    count: u64,
    first: String,
}

impl Finding {
    fn add(&mut self, other: Finding) {
        if self.count == 0 {
            self.first = other.first;
        }
        self.count += other.count;
    }
}

/// Counts of implausible values in an input.
#[derive(Debug, Clone, Default)]
pub struct Doubts {
    policy: Implausible,
    found: [Finding; LIMITS.len()],
    still: Finding,
    /// Leaders that brake, and their largest deceleration, m/s².
    leaders: (u64, f64),
    /// Vehicles, and those of them that are smaller than the smallest usual car.
    boxes: [u64; 2],
    /// Vehicles that cut in, and those of them that are faster than the ego.
    cutters: [u64; 2],
}

impl Doubts {
    /// No doubts yet.
    pub fn new(policy: Implausible) -> Doubts {
        Doubts { policy, ..Doubts::default() }
    }

    /// No doubts yet, with the same policy.
    pub(crate) fn another(&self) -> Doubts {
        Doubts::new(self.policy)
    }

    /// Checks a value; `place` returns its place.
    ///
    /// # Errors
    /// The problem of a value outside the physical range, unless such values are accepted.
    #[inline]
    pub fn check(&mut self, quantity: Quantity, value: f64, place: impl FnOnce() -> String) -> Result<(), String> {
        if quantity.is_plausible(value) { Ok(()) } else { self.doubt(quantity, value, place()) }
    }

    #[cold]
    fn doubt(&mut self, quantity: Quantity, value: f64, place: String) -> Result<(), String> {
        let text = quantity.describe(value);
        if self.policy == Implausible::Refused && !contains(quantity.limits().physical, value) {
            return Err(text);
        }
        self.contradict(quantity, format!("{place}: {text}"));
        Ok(())
    }

    /// Counts a value that another value contradicts; `text` has its place.
    pub(crate) fn contradict(&mut self, quantity: Quantity, text: String) {
        self.found[quantity as usize].add(Finding { count: 1, first: text });
    }

    /// Checks that a vehicle is at least as long as wide, and notes whether it is as large as a car; `place` returns the place of its length.
    #[inline]
    pub fn check_shape(&mut self, length_m: f64, width_m: f64, place: impl FnOnce() -> String) {
        let is_small = length_m < SMALL_CAR_M.0 && width_m < SMALL_CAR_M.1;
        self.boxes = [self.boxes[0] + 1, self.boxes[1] + u64::from(is_small)];
        // An implausible length or width has its own sentence, but for exchanged ones.
        let fits = |length, width| Quantity::Length.is_plausible(length) && Quantity::Width.is_plausible(width);
        if length_m < width_m && (fits(length_m, width_m) || fits(width_m, length_m)) {
            let [length, width] = [length_m, width_m].map(readable::value);
            self.contradict(Quantity::Length, format!("{}: {length} m, but the width is {width} m", place()));
        }
    }

    /// Notes a leader's acceleration. If no leader of many brakes by more than 1.2 m/s², it may be in g.
    #[inline]
    pub(crate) fn note_leader(&mut self, acceleration_mps2: f64) {
        if acceleration_mps2 < 0.0 {
            self.leaders = (self.leaders.0 + 1, self.leaders.1.max(-acceleration_mps2));
        }
    }

    /// Notes whether a vehicle that cuts in is faster than the ego. If all are, the two speeds may be exchanged.
    #[inline]
    pub(crate) fn note_cutter(&mut self, is_faster: bool) {
        self.cutters = [self.cutters[0] + 1, self.cutters[1] + u64::from(is_faster)];
    }

    /// Returns a speed with the noise of a standing vehicle set to 0 and counted.
    #[inline]
    pub fn speed(&mut self, value_mps: f64, place: impl FnOnce() -> String) -> f64 {
        if value_mps >= 0.0 || value_mps <= NOISE_MPS || value_mps.is_nan() {
            return value_mps;
        }
        self.still.add(Finding { count: 1, first: place() });
        0.0
    }

    /// Adds the doubts of another input.
    pub(crate) fn add(&mut self, other: Doubts) {
        self.still.add(other.still);
        self.leaders = (self.leaders.0 + other.leaders.0, self.leaders.1.max(other.leaders.1));
        let counts = self.boxes.iter_mut().chain(&mut self.cutters);
        counts.zip(other.boxes.into_iter().chain(other.cutters)).for_each(|(own, theirs)| *own += theirs);
        for (own, theirs) in self.found.iter_mut().zip(other.found) {
            own.add(theirs);
        }
    }

    /// The doubts for users, one sentence per kind.
    pub fn sentences(&self) -> Vec<String> {
        let mut list = Vec::new();
        let times = |count: u64| if count == 1 { "once".to_owned() } else { format!("{count} times, first") };
        if self.still.count > 0 {
            let Finding { count, first } = &self.still;
            list.push(format!("a speed between {NOISE_MPS} and 0 m/s is taken as 0, {}: {first}", times(*count)));
        }
        if let (5.., largest @ ..=1.2) = self.leaders {
            let (count, largest) = (readable::count(self.leaders.0), readable::value(largest));
            list.push(format!(
                "none of {count} leaders brakes by more than {largest} m/s²: check whether decelerations are in g"
            ));
        }
        let [all, small] = self.boxes;
        if all > 1 && 2 * small >= all {
            let ((long_m, wide_m), of) = (SMALL_CAR_M, readable::count(all));
            list.push(format!(
                "at least half of {of} vehicles are shorter than {long_m} m and narrower than {wide_m} m: are these half extents?"
            ));
        }
        let [all, faster] = self.cutters;
        if all > 1 && faster == all {
            let all = readable::count(all);
            list.push(format!(
                "the vehicle that cuts in is faster than the ego in all {all} cases: check whose speed is whose"
            ));
        }
        for (of, Finding { count, first }) in LIMITS.iter().zip(&self.found).filter(|(_, found)| found.count > 0) {
            list.push(format!("an implausible {} is used as it is, {}: {first}", of.name, times(*count)));
        }
        list
    }
}
