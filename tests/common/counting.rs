//! A number that counts the operations of a step.

use std::cell::Cell;
use std::ops::{Add, Mul, Neg, Sub};

use lanesweep::model::scalar::{Flag, Real};

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct OperationCount {
    pub additions: u64,
    pub multiplications: u64,
    /// Correctly rounded divisions.
    pub divisions: u64,
    pub comparisons: u64,
    /// Comparisons of a number that is infinite or none.
    pub unbounded: u64,
}

impl OperationCount {
    pub fn total(&self) -> u64 {
        self.additions + self.multiplications + self.divisions + self.comparisons
    }
}

thread_local! {
    static COUNT: Cell<OperationCount> = const { Cell::new(OperationCount { additions: 0, multiplications: 0, divisions: 0, comparisons: 0, unbounded: 0 }) };
    static FLIPS_ZEROS: Cell<bool> = const { Cell::new(false) };
}

fn count(counter: impl FnOnce(&mut OperationCount) -> &mut u64) {
    COUNT.with(|cell| {
        let mut now = cell.get();
        *counter(&mut now) += 1;
        cell.set(now);
    });
}

/// A result, or if it is zero and signs of zeros are flipped, −0 after every second operation.
fn result(value: f64) -> Counting {
    let is_odd = COUNT.with(|cell| (cell.get().additions + cell.get().multiplications) % 2 == 1);
    let flips = value == 0.0 && FLIPS_ZEROS.with(Cell::get) && is_odd;
    Counting(if flips { -0.0 } else { value })
}

fn compare(a: Counting, b: Counting) {
    count(|now| &mut now.comparisons);
    if !(a.0.is_finite() && b.0.is_finite()) {
        count(|now| &mut now.unbounded);
    }
}

/// An f64 that counts what is done with it, per thread.
#[derive(Default, Debug, Clone, Copy)]
pub struct Counting(f64);

impl Counting {
    /// Runs `work` and returns its result with the operations it took on this thread.
    pub fn measure<T>(work: impl FnOnce() -> T) -> (T, OperationCount) {
        COUNT.with(|cell| cell.set(OperationCount::default()));
        let result = work();
        (result, COUNT.with(Cell::get))
    }

    /// The same where zeros have any sign.
    #[allow(dead_code)] // not in benchmarks
    pub fn measure_with_any_zeros<T>(work: impl FnOnce() -> T) -> (T, OperationCount) {
        FLIPS_ZEROS.with(|cell| cell.set(true));
        let measured = Counting::measure(work);
        FLIPS_ZEROS.with(|cell| cell.set(false));
        measured
    }
}

impl Add for Counting {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        count(|now| &mut now.additions);
        result(self.0 + other.0)
    }
}
impl Sub for Counting {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        count(|now| &mut now.additions);
        result(self.0 - other.0)
    }
}
impl Mul for Counting {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        count(|now| &mut now.multiplications);
        result(self.0 * other.0)
    }
}
impl Neg for Counting {
    type Output = Self;
    fn neg(self) -> Self {
        Counting(-self.0)
    }
}
impl PartialEq for Counting {
    fn eq(&self, other: &Self) -> bool {
        compare(*self, *other);
        self.0 == other.0
    }
}
impl PartialOrd for Counting {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        compare(*self, *other);
        self.0.partial_cmp(&other.0)
    }
}
impl Real for Counting {
    const ZERO: Self = Counting(0.0);
    const ONE: Self = Counting(1.0);
    const HALF: Self = Counting(0.5);
    /// As in the shaders, which have no infinite number.
    const INFINITY: Self = Counting(f64::MAX);

    fn from_f64(value: f64) -> Self {
        Counting(value)
    }
    fn to_f64(self) -> f64 {
        self.0
    }
    fn from_step(step: u32) -> Self {
        Counting(f64::from(step))
    }
    fn exact_div(self, divisor: Self) -> Self {
        count(|now| &mut now.divisions);
        Counting(self.0 / divisor.0)
    }
    fn floor_to_step(self) -> u32 {
        self.0 as u32
    }
    fn is_negative(self) -> Flag {
        Flag::of(self < Self::ZERO)
    }
    fn is_positive(self) -> Flag {
        Flag::of(self > Self::ZERO)
    }
    fn is_below(self, other: Self) -> Flag {
        Flag::of(self < other)
    }
}

#[test]
fn the_counting_type_sees_every_operation() {
    let (value, count) = Counting::measure(|| {
        let a = Counting::from_f64(3.0);
        let b = Counting::from_f64(2.0);
        (a * b + a).exact_div(b).larger(b)
    });
    assert_eq!(value.to_f64(), 4.5);
    assert_eq!(count, OperationCount { additions: 1, multiplications: 1, divisions: 1, comparisons: 1, unbounded: 0 });
}
