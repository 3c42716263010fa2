//! A case whose inputs have errors: how often each answer is, over draws of the errors, and which input matters most.
//!
//! Draws run as lanes in binary32, in batches. The numbers of a draw follow from the seed, its index and the quantity.

use super::{Answer, CaseVerdicts, RunEnd, Subject, nominal_verdicts};
use crate::engine::Executor;
use crate::model::driver::MODELS;
use crate::model::profile::Profile;
use crate::random::{Stream, standard_normal, unit_uniform};
use crate::run::grid::Point;
use crate::scenario::{CaseQuantity, GAP_ERROR_M, NUMBERS, PlainCase};
use crate::stats::estimate::{FirstOrder, first_order};
use crate::{Error, Place, Result};

/// Default number of draws.
pub const UNCERTAIN_DRAWS: u64 = 100_000;
/// Level of all intervals.
pub const UNCERTAIN_LEVEL: f64 = 0.95;
/// Maximum number of pairs of draws per first-order index.
const PAIRS: u64 = 1 << 14;
/// Fewer pairs than this with another answer, or with this one, give no index: its interval would be a guess.
const MIN_PAIRS: usize = 30;
/// [`Stream::purpose`] of the draws, and of those beside them in the pairs.
const PURPOSES: [u32; 2] = [0x554E_4341, 0x554E_4342];
/// Draws that are in memory together.
const BATCH: u64 = 1 << 14;
/// A reason why a draw is no case.
const CONTRADICTION: &str = "contradictory numbers";

/// An input of the case with its error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertainInput {
    /// The input.
    pub quantity: CaseQuantity,
    /// Its error in SI units, positive.
    pub error: f64,
    /// The error is uniform in ± `error`; else it is normal, and this is its standard deviation.
    pub is_bound: bool,
}

/// The errors of a case's inputs, which are independent of one another, and how they are drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertain {
    /// At least one input, each once.
    pub inputs: Vec<UncertainInput>,
    /// Number of draws, at least 1.
    pub draws: u64,
    /// Seed.
    pub seed: u64,
}

/// What the draws say, under one profile.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertainty {
    /// The errors.
    pub uncertain: Uncertain,
    /// Draws that are no case, by the reason: the input whose value has no meaning. They have no answer.
    pub invalid: Vec<(&'static str, u64)>,
    /// Draws that Annex 3 does not describe. Their answers count as computed.
    pub outside_annex: u64,
    /// Draws by answer, in the order of [`Answer::ALL`].
    pub answers: [u64; Answer::ALL.len()],
    /// Per model, in the order of [`ModelId::ALL`](crate::model::driver::ModelId::ALL): draws with a conflict in which it does not collide.
    pub avoids: [u64; MODELS],
    /// Pairs of draws per index.
    pub pairs: u64,
    /// Per input, its first-order index for "the answer is that of the case without errors"; `None` where too few draws
    /// have another answer.
    pub indices: Vec<Option<FirstOrder>>,
}

impl UncertainInput {
    /// The usual standard error of an input; `None` for a quantity that has none. That of a headway is that of the gap.
    pub fn usual(subject: &Subject, quantity: CaseQuantity) -> Option<UncertainInput> {
        let of_gap = || {
            let ego_mps = subject.point().get(CaseQuantity::EgoSpeed).filter(|_| quantity == CaseQuantity::Thw)?;
            (ego_mps > 0.0).then(|| GAP_ERROR_M / ego_mps)
        };
        let error = quantity.number().error.map(|error| error.si).or_else(of_gap)?;
        Some(UncertainInput { quantity, error, is_bound: false })
    }

    /// Every input of a case with its usual standard error, except those that are 0, such as the speed of a stationary
    /// vehicle: half of the values around 0 would have no meaning.
    pub fn all(subject: &Subject) -> Vec<UncertainInput> {
        let is_input = |quantity: &CaseQuantity| subject.point().get(*quantity).is_some_and(|si| si != 0.0);
        NUMBERS
            .iter()
            .map(|number| number.quantity)
            .filter(is_input)
            .filter_map(|of| Self::usual(subject, of))
            .collect()
    }
}

impl Uncertainty {
    /// Draws that are a case.
    pub fn valid(&self) -> u64 {
        self.answers.iter().sum()
    }

    /// Draws in which an ego that never reacts collides.
    pub fn conflicts(&self) -> u64 {
        self.answers[0] + self.answers[1]
    }
}

impl Uncertain {
    /// Runs the draws under a profile; `is` is the answer of the case without errors.
    ///
    /// # Errors
    /// [`Error::Usage`] for a profile without reference drivers and for a case that follows recorded series; those of the
    /// executor.
    pub fn run(&self, subject: &Subject, profile: &Profile, is: Answer, executor: &Executor) -> Result<Uncertainty> {
        let refused = |problem: String, help| Err(Error::usage(Place::option("uncertain"), problem, help));
        if profile.reference_drivers.is_empty() {
            let problem = format!("profile `{}` has no reference drivers, so a draw has no answer", profile.name);
            return refused(problem, "name another profile first, by option `profiles`");
        }
        let Subject::Plain(case, point) = subject else {
            let problem = "a recorded scenario follows its series, whose errors are not known".to_owned();
            return refused(problem, "give the case in numbers");
        };
        let draws = Draws { uncertain: self, case, point, profile, executor };
        let same = |drawn: &Drawn| drawn.as_ref().ok().map(|of| f64::from(of.answer() == is));
        let mut all = Uncertainty {
            uncertain: self.clone(),
            invalid: Vec::new(),
            outside_annex: 0,
            answers: [0; Answer::ALL.len()],
            avoids: [0; MODELS],
            pairs: self.draws.min(PAIRS),
            indices: Vec::new(),
        };
        let mut firsts: Vec<Option<f64>> = Vec::new();
        draws.each(
            self.draws,
            |_| PURPOSES[0],
            |drawn| {
                if (firsts.len() as u64) < all.pairs {
                    firsts.push(same(drawn));
                }
                match drawn {
                    Ok(verdicts) => {
                        let answer = verdicts.answer();
                        all.answers[answer as usize] += 1;
                        all.outside_annex += u64::from(verdicts.is_outside_annex && answer != Answer::NoConflict);
                        if verdicts.unreacting == RunEnd::Contact {
                            let avoided = all.avoids.iter_mut().zip(verdicts.collide);
                            avoided.for_each(|(avoids, collides)| *avoids += u64::from(!collides));
                        }
                    }
                    Err(reason) => match all.invalid.iter_mut().find(|(of, _)| of == reason) {
                        Some((_, count)) => *count += 1,
                        None => all.invalid.push((reason, 1)),
                    },
                }
            },
        )?;
        for input in &self.inputs {
            // The input is that of the draws; all others are new.
            let purpose = |of| PURPOSES[usize::from(of != input.quantity)];
            let (mut pairs, mut first) = (Vec::new(), firsts.iter());
            draws.each(all.pairs, purpose, |drawn| {
                let pair = first.next().copied().flatten().zip(same(drawn));
                pairs.extend(pair.map(|(first, second)| [first, second]));
            })?;
            let other = pairs.iter().filter(|[first, _]| *first == 0.0).count();
            let is_enough = other.min(pairs.len() - other) >= MIN_PAIRS;
            all.indices.push(first_order(&pairs, UNCERTAIN_LEVEL).filter(|_| is_enough));
        }
        Ok(all)
    }
}

/// The verdicts of a draw, or why it is no case.
type Drawn = std::result::Result<CaseVerdicts, &'static str>;

/// What all draws have in common.
struct Draws<'a> {
    uncertain: &'a Uncertain,
    case: &'a PlainCase,
    point: &'a Point,
    profile: &'a Profile,
    executor: &'a Executor<'a>,
}

impl Draws<'_> {
    /// Runs draws 0 to `count` in order. `purpose` says of which stream a quantity's errors are.
    fn each(&self, count: u64, purpose: impl Fn(CaseQuantity) -> u32, mut take: impl FnMut(&Drawn)) -> Result<()> {
        for from in (0..count).step_by(BATCH as usize) {
            let drawn = (from..count.min(from + BATCH)).map(|draw| self.subject(draw, &purpose));
            let drawn: Vec<std::result::Result<Subject, &'static str>> = drawn.collect();
            let subjects: Vec<Subject> = drawn.iter().filter_map(|of| of.as_ref().ok().cloned()).collect();
            let mut verdicts = nominal_verdicts(&subjects, self.profile, self.executor)?.into_iter();
            for subject in drawn {
                take(&subject.and_then(|_| verdicts.next().and_then(Result::ok).ok_or(CONTRADICTION)));
            }
        }
        Ok(())
    }

    /// The case of a draw, or the quantity whose value has no meaning.
    fn subject(&self, draw: u64, purpose: &impl Fn(CaseQuantity) -> u32) -> std::result::Result<Subject, &'static str> {
        let mut point = *self.point;
        for UncertainInput { quantity, error, is_bound } in &self.uncertain.inputs {
            let Some(from) = self.point.get(*quantity) else { continue };
            let place = *quantity as u32;
            let stream = Stream { seed: self.uncertain.seed, purpose: purpose(*quantity) };
            let word = stream.words(draw, place / 4)[place as usize % 4];
            let unit = if *is_bound { 2.0 * unit_uniform(word) - 1.0 } else { standard_normal(word) };
            let to = from + error * f64::from(unit);
            // A deceleration keeps its sign; no other quantity can be negative.
            let is_possible = if *quantity == CaseQuantity::Deceleration { from * to > 0.0 } else { to > 0.0 };
            if !is_possible {
                return Err(quantity.number().label);
            }
            point = point.with(*quantity, to);
        }
        Ok(Subject::Plain(*self.case, point))
    }
}
