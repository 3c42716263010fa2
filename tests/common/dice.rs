//! Random values of tests, the same in every run.

use super::plans::mixed;

pub struct Dice(pub u64);

impl Dice {
    pub fn next(&mut self) -> u64 {
        let word = mixed(self.0, 0);
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        word
    }

    /// Below `n`; 0 for an `n` of 0.
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    pub fn between(&mut self, min: f64, max: f64) -> f64 {
        min + (max - min) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn one_of<T: Clone>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())].clone()
    }

    pub fn list<T>(&mut self, [min, max]: [usize; 2], value: impl Fn(&mut Dice) -> T) -> Vec<T> {
        (0..min + self.below(max + 1 - min)).map(|_| value(self)).collect()
    }
}

/// A claim about so many random cases; `LANESWEEP_CASES=n` tries n times as many. The number of a case that fails is printed.
pub fn cases(count: u64, claim: impl Fn(&mut Dice)) {
    struct Case(u64);
    impl Drop for Case {
        fn drop(&mut self) {
            if std::thread::panicking() {
                eprintln!("in case {}", self.0);
            }
        }
    }
    let times: u64 = std::env::var("LANESWEEP_CASES").map_or(1, |text| text.parse().expect("a whole number"));
    for case in (0..count * times).map(Case) {
        claim(&mut Dice(mixed(157, case.0)));
    }
}
