//! The units of a block: named scenarios, or samples, which are identified by their index.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// Units of one block, in order.
#[derive(Debug, Clone, PartialEq)]
pub enum Units {
    /// Scenarios or cells, of which this process holds an interval: total number, index of the first held, keys of those
    /// held.
    Held(u64, u64, Arc<[String]>),
    /// Samples `#0`, `#1`, … below this count: a run over 10¹⁰ of them keeps no names.
    Numbered(u64),
}

impl Units {
    /// Number of units.
    pub fn len(&self) -> u64 {
        match self {
            Units::Held(count, ..) | Units::Numbered(count) => *count,
        }
    }

    /// Those whose cases are there: all, but of a study that is read or made in part.
    pub fn held(&self) -> Range<u64> {
        match self {
            Units::Held(_, first, names) => *first..first + names.len() as u64,
            Units::Numbered(count) => 0..*count,
        }
    }

    /// Whether there are no units.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Name of a unit below [`Units::len`].
    pub fn name(&self, unit: u64) -> Cow<'_, str> {
        match self {
            Units::Held(_, first, names) => match unit.checked_sub(*first).and_then(|at| names.get(at as usize)) {
                Some(name) => Cow::Borrowed(name.as_str()),
                None => Cow::Owned(format!("#{unit}")),
            },
            Units::Numbered(_) => Cow::Owned(format!("#{unit}")),
        }
    }

    /// The unit that a name stands for.
    pub fn find(&self, name: &str) -> Option<u64> {
        match self {
            Units::Held(_, first, names) => names.iter().position(|n| n == name).map(|at| first + at as u64),
            Units::Numbered(count) => name.strip_prefix('#')?.parse().ok().filter(|unit| unit < count),
        }
    }
}

impl FromIterator<String> for Units {
    fn from_iter<I: IntoIterator<Item = String>>(names: I) -> Self {
        let names: Arc<[String]> = names.into_iter().collect();
        Units::Held(names.len() as u64, 0, names)
    }
}

#[cfg(test)]
mod tests {
    use super::Units;

    #[test]
    fn names_lead_back_to_their_units() {
        let named: Units = ["a".to_owned(), "b".to_owned()].into_iter().collect();
        let numbered = Units::Numbered(10_000_000_000);
        for (units, unit) in [(&named, 1), (&numbered, 9_999_999_999)] {
            assert_eq!(units.find(&units.name(unit)), Some(unit));
        }
        assert_eq!(numbered.find("#10000000000"), None);
        assert_eq!(named.find("#1"), None);
    }
}
