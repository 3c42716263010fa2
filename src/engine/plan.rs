//! The lane plan: the lanes of a sweep and their order, the f64 input that the host computes before the lanes, and the
//! hash.
//!
//! A lane's index is its identity: category block, unit (scenario), variant (0 is S), headway, model, by mixed radix
//! from the plan's counts. Ranges are intervals of units, so a shard boundary never separates S from its S'.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use super::frame::Start;
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::{Category, Tables};
use lanesweep_support::ranges::refuse_repeats;
use lanesweep_support::{Error, Place, Result};

use super::generated::Generator;
use super::lane_case::{LaneCase, check_time_step};
use super::version::Canonical;

/// Text of [`Headway::MinFollowing`].
const R157: &str = "r157";
/// Text of [`Headway::Observed`].
const OBSERVED: &str = "observed";

/// Headway of a lane.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Headway {
    /// Time headway, s: the initial gap is this times the ego's initial speed, bumper to bumper.
    ThwS(f64),
    /// Initial gap, m, bumper to bumper.
    GapM(f64),
    /// Minimum following distance of UN R157, 5.2.3.3, at the ego's initial speed: `r157`.
    #[serde(rename = "r157")]
    MinFollowing,
    /// The recorded gap of each scenario: `observed`. The gap offsets of the case contain it, so it cannot be combined
    /// with another headway.
    Observed,
}

impl Headway {
    /// The time headway, s, or the gap, m; `None` where it differs between scenarios.
    pub fn value(&self) -> Option<f64> {
        match self {
            Headway::ThwS(value) | Headway::GapM(value) => Some(*value),
            Headway::MinFollowing | Headway::Observed => None,
        }
    }

    /// The paper's ten: 2.0, 1.8, … 0.2 s.
    pub fn paper() -> Vec<Headway> {
        (1..=10).rev().map(|k| Headway::ThwS(f64::from(k) / 5.0)).collect()
    }

    /// A time headway, s, to 15 significant digits: 0.6000000000000001, which a computation leaves, is 0.6, so that keys
    /// and tables of two runs join.
    pub fn thw(s: f64) -> Headway {
        Headway::ThwS(shortest(s))
    }

    /// Parses `1.2s`, `30m`, `r157` or `observed`; also `2.0s`, as in tables, for `2s`. Numbers are those of [`Headway::thw`].
    pub fn parse(text: &str) -> Option<Headway> {
        match text {
            R157 => return Some(Headway::MinFollowing),
            OBSERVED => return Some(Headway::Observed),
            _ => {}
        }
        let number = |text: &str| text.parse::<f64>().ok().filter(|value| value.is_finite() && *value >= 0.0);
        match text.strip_suffix('s') {
            Some(seconds) => number(seconds).map(Headway::thw),
            None => number(text.strip_suffix('m')?).map(|gap_m| Headway::GapM(shortest(gap_m))),
        }
    }

    /// Identity of a headway: two that start every lane alike are equal.
    pub fn identity(self) -> (u8, u32) {
        match (self, self.start::<f32>()) {
            (Headway::Observed, _) => (3, 0),
            (_, Start::Headway(s)) => (0, s.to_bits()),
            (_, Start::Gap(m)) => (1, m.to_bits()),
            (_, Start::MinFollowing) => (2, 0),
        }
    }

    /// Whether the list consists of the recorded gap.
    pub fn is_observed(list: &[Headway]) -> bool {
        list.contains(&Headway::Observed)
    }

    /// Refuses the recorded gap together with another headway: the gap is part of the case, which all headways share.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub(crate) fn refuse_mixture(list: &[Headway]) -> Result<()> {
        if list.len() > 1 && Headway::is_observed(list) {
            let problem = format!(
                "`{OBSERVED}` starts each scenario from its recorded gap and cannot be combined with other headways"
            );
            return Err(Error::usage(Place::option("thw"), problem, "run the other headways by themselves"));
        }
        Ok(())
    }

    /// The start of a lane, rounded once.
    pub fn start<R: lanesweep_model::scalar::Real>(self) -> Start<R> {
        match self {
            Headway::ThwS(s) => Start::Headway(R::from_f64(s)),
            Headway::GapM(m) => Start::Gap(R::from_f64(m)),
            Headway::MinFollowing => Start::MinFollowing,
            Headway::Observed => Start::Gap(R::ZERO),
        }
    }
}

fn shortest(value: f64) -> f64 {
    format!("{value:.14e}").parse().unwrap_or(value)
}

impl std::fmt::Display for Headway {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Headway::ThwS(s) => write!(f, "{s}s"),
            Headway::GapM(m) => write!(f, "{m}m"),
            Headway::MinFollowing => f.write_str(R157),
            Headway::Observed => f.write_str(OBSERVED),
        }
    }
}

/// Returns the case of (unit, variant) as a pure function: from a table for studies; from generators and grids for
/// sampling and maps.
pub trait CaseSource: Send + Sync {
    /// The case; `block` and `unit` count from 0 (unit within its block), variant 0 is S.
    fn case(&self, block: usize, unit: u64, variant: usize) -> LaneCase<f64>;
    /// The series that motions index.
    fn tables(&self) -> &Tables<f64>;
    /// The generator, if cases are made where the lanes run. Then unit `i` is sample `i` of the first variant, and
    /// [`CaseSource::case`] and [`CaseSource::tables`] are not called.
    fn generator(&self) -> Option<&Generator> {
        None
    }
}

impl CaseSource for Generator {
    fn case(&self, _block: usize, unit: u64, _variant: usize) -> LaneCase<f64> {
        // Only for callers that need no series: the tables are discarded.
        Generator::case(self, unit, &mut Tables::default())
    }

    fn tables(&self) -> &Tables<f64> {
        static NONE: Tables<f64> = Tables { speed: Vec::new(), lateral: Vec::new() };
        &NONE
    }

    fn generator(&self) -> Option<&Generator> {
        Some(self)
    }
}

/// One category's part of the plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Kind of scenario.
    pub category: Category,
    /// The units (scenarios or samples), in order.
    pub units: Units,
    /// Names of the variants; the first is `S`.
    pub variants: Vec<String>,
    /// Number of units before this block.
    pub first_unit: u64,
    /// Number of lanes before this block.
    pub first_lane: u64,
}

impl Block {
    /// A block whose plan will set its position.
    pub fn new(category: Category, units: Units, variants: Vec<String>) -> Block {
        Block { category, units, variants, first_unit: 0, first_lane: 0 }
    }
}

/// The lanes of a sweep.
#[derive(Clone)]
pub struct LanePlan {
    /// Profile, with the time step.
    pub profile: Profile,
    /// Models, in order.
    pub models: Vec<ModelId>,
    /// Headways, in order.
    pub headways: Vec<Headway>,
    /// Categories, in order.
    pub blocks: Vec<Block>,
    source: Arc<dyn CaseSource>,
    hash: String,
}

/// Position of a lane in its plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct LaneKey {
    /// Index into [`LanePlan::blocks`].
    pub block: usize,
    /// Unit within the block.
    pub unit: u64,
    /// Variant within the block; 0 is S.
    pub variant: usize,
    /// Index into [`LanePlan::headways`].
    pub headway: usize,
    /// Index into [`LanePlan::models`].
    pub model: usize,
}

impl LanePlan {
    /// Makes and hashes a plan. Only categories, units and variants of `blocks` are read; the first units and lanes are
    /// set here.
    pub fn new(
        profile: Profile,
        models: Vec<ModelId>,
        headways: Vec<Headway>,
        blocks: Vec<Block>,
        source: Arc<dyn CaseSource>,
    ) -> Result<LanePlan> {
        let mut plan = LanePlan::with_hash(String::new(), profile, models, headways, blocks, source)?;
        check_cases(&plan.profile, &plan.blocks, plan.source.as_ref(), plan.segments(0..plan.unit_count()))?;
        plan.hash = plan.content_hash()?;
        Ok(plan)
    }

    /// A plan whose hash is that of the input from which its cases follow.
    ///
    /// # Errors
    /// [`Error::Usage`] without models or headways, for a duplicate one, and for too many lanes.
    pub fn with_hash(
        hash: String,
        profile: Profile,
        models: Vec<ModelId>,
        headways: Vec<Headway>,
        mut blocks: Vec<Block>,
        source: Arc<dyn CaseSource>,
    ) -> Result<LanePlan> {
        let empty = [("driver models", models.is_empty()), ("headways", headways.is_empty())];
        if let Some((what, _)) = empty.iter().find(|(_, empty)| *empty) {
            return Err(Error::usage(Place::default(), format!("the sweep has no {what}"), "give at least one"));
        }
        refuse_repeats(|| Place::option("models"), models.iter().map(|model| (*model, model.name())))?;
        refuse_repeats(|| Place::option("thw"), headways.iter().map(|headway| (headway.identity(), headway)))?;
        Headway::refuse_mixture(&headways)?;
        for block in &blocks {
            refuse_repeats(|| Place::item("variants"), block.variants.iter().map(|variant| (variant, variant)))?;
        }
        profile.check_time_step(&models)?;
        let (mut unit, mut lane) = (0_u64, 0_u64);
        for block in &mut blocks {
            block.first_unit = unit;
            block.first_lane = lane;
            unit = unit.saturating_add(block.units.len());
            let per_unit = (block.variants.len() * headways.len() * models.len()) as u64;
            let lanes = block.units.len().checked_mul(per_unit).and_then(|lanes| lane.checked_add(lanes));
            lane = lanes.filter(|&lanes| lanes < 1 << 63).ok_or_else(|| {
                let problem = format!("{} units of {per_unit} lanes are more than can be counted", block.units.len());
                Error::usage(Place::default(), problem, "sweep fewer at once: 2^63 lanes at most")
            })?;
        }
        let points = source.generator().and_then(|generator| generator.points.count());
        if let Some(points) = points.filter(|points| unit > *points) {
            let problem = format!("{unit} samples are asked for, {points} points there are");
            return Err(Error::usage(Place::default(), problem, "ask for fewer, or use independent random points"));
        }
        Ok(LanePlan { profile, models, headways, blocks, source, hash })
    }

    /// The same plan that holds the cases of some units only: the units held of each block, and the source of their
    /// cases.
    pub fn holding(&self, units: Vec<Units>, source: Arc<dyn CaseSource>) -> LanePlan {
        let blocks = self.blocks.iter().zip(units).map(|(block, units)| Block { units, ..block.clone() });
        LanePlan { blocks: blocks.collect(), source, ..self.clone() }
    }

    /// The case of a unit's variant.
    pub fn case(&self, block: usize, unit: u64, variant: usize) -> LaneCase<f64> {
        self.source.case(block, unit, variant)
    }

    /// The series that motions index.
    pub fn tables(&self) -> &Tables<f64> {
        self.source.tables()
    }

    /// The generator, if cases are made where the lanes run; replaces [`LanePlan::case`] and [`LanePlan::tables`].
    pub fn generator(&self) -> Option<&Generator> {
        self.source.generator()
    }

    /// SHA-256 over everything that determines the outcomes, in hexadecimal.
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// Number of units of all blocks.
    pub fn unit_count(&self) -> u64 {
        self.blocks.last().map_or(0, |b| b.first_unit + b.units.len())
    }

    /// Number of lanes of all blocks.
    pub fn lane_count(&self) -> u64 {
        self.blocks.last().map_or(0, |b| b.first_lane + b.units.len() * self.lanes_per_unit(b))
    }

    /// Lanes of one unit of a block.
    pub fn lanes_per_unit(&self, block: &Block) -> u64 {
        (block.variants.len() * self.headways.len() * self.models.len()) as u64
    }

    /// Number of a block's counts by headway: variants × headways × models × criteria.
    pub(crate) fn headway_cells(&self, block: &Block) -> usize {
        self.lanes_per_unit(block) as usize * Criterion::ALL.len()
    }

    /// Index of the first lane of a unit (counted over all blocks), or the number of lanes at the end.
    pub fn first_lane_of(&self, unit: u64) -> u64 {
        let found = self.blocks.iter().rev().find(|b| b.first_unit <= unit && !b.units.is_empty());
        found.map_or(0, |b| b.first_lane + (unit - b.first_unit).min(b.units.len()) * self.lanes_per_unit(b))
    }

    /// Splits an interval of units (over all blocks) at the block boundaries: (block, units within it).
    pub fn segments(&self, units: Range<u64>) -> Vec<(usize, Range<u64>)> {
        let mut segments = Vec::new();
        for (index, block) in self.blocks.iter().enumerate() {
            let end = block.first_unit + block.units.len();
            let (from, to) = (units.start.max(block.first_unit), units.end.min(end));
            if from < to {
                segments.push((index, from - block.first_unit..to - block.first_unit));
            }
        }
        segments
    }

    /// Lane index of a key.
    pub fn lane(&self, key: &LaneKey) -> u64 {
        let block = &self.blocks[key.block];
        let inner = (key.variant * self.headways.len() + key.headway) * self.models.len() + key.model;
        block.first_lane + key.unit * self.lanes_per_unit(block) + inner as u64
    }

    /// Key of a lane index; `None` if out of range.
    pub fn key(&self, lane: u64) -> Option<LaneKey> {
        if lane >= self.lane_count() {
            return None;
        }
        let block = self.blocks.iter().rposition(|b| b.first_lane <= lane && !b.units.is_empty())?;
        let inside = lane - self.blocks[block].first_lane;
        let per_unit = self.lanes_per_unit(&self.blocks[block]);
        let rest = (inside % per_unit) as usize;
        let (models, headways) = (self.models.len(), self.headways.len());
        Some(LaneKey {
            block,
            unit: inside / per_unit,
            variant: rest / (models * headways),
            headway: rest / models % headways,
            model: rest % models,
        })
    }

    /// A lane's key as text: `01_cut_in_81_74_836/2/1.8s/FSM`. Errors and tables print it.
    pub fn key_text(&self, key: &LaneKey) -> String {
        let block = &self.blocks[key.block];
        format!(
            "{}/{}/{}/{}",
            block.units.name(key.unit),
            block.variants[key.variant],
            self.headways[key.headway],
            self.models[key.model].name()
        )
    }

    /// Parses a lane key.
    pub fn parse_key(&self, text: &str) -> Option<LaneKey> {
        let parts: Vec<&str> = text.rsplitn(4, '/').collect();
        let [model, headway, variant, unit] = parts[..] else { return None };
        let model = ModelId::parse(model)?;
        let model = self.models.iter().position(|m| *m == model)?;
        // Compares with the written form first: the gap of a random plan may be negative, which the parser refuses.
        let written = self.headways.iter().position(|h| h.to_string() == headway);
        let meant = || Headway::parse(headway).and_then(|meant| self.headways.iter().position(|h| *h == meant));
        let headway = written.or_else(meant)?;
        self.blocks.iter().enumerate().find_map(|(at, block)| {
            let unit = block.units.find(unit)?;
            let variant = block.variants.iter().position(|v| v == variant)?;
            Some(LaneKey { block: at, unit, variant, headway, model })
        })
    }

    fn content_hash(&self) -> Result<String> {
        let mut canonical = Canonical::new("plan");
        canonical.value(&(&self.profile, &self.models, &self.headways))?;
        for block in &self.blocks {
            canonical.value(&(block.category, &block.variants))?;
            canonical.word(block.units.len());
            if !matches!(block.units, Units::Numbered(_)) {
                (0..block.units.len()).for_each(|unit| canonical.text(&block.units.name(unit)));
            }
        }
        if let Some(generator) = self.generator() {
            canonical.generator(generator);
            return Ok(canonical.finish());
        }
        canonical.tables(self.tables());
        for (at, block) in self.blocks.iter().enumerate() {
            for unit in 0..block.units.len() {
                (0..block.variants.len()).for_each(|variant| canonical.case(&self.case(at, unit, variant)));
            }
        }
        Ok(canonical.finish())
    }
}

/// Checks the cases of these units of blocks if they are known before their lanes run. Vehicles of a
/// [generated](crate::generated) case start or end in the ego's lane and never pass across it.
///
/// # Errors
/// As [`check_time_step`].
pub fn check_cases(
    profile: &Profile,
    blocks: &[Block],
    source: &dyn CaseSource,
    segments: Vec<(usize, Range<u64>)>,
) -> Result<()> {
    if source.generator().is_some() {
        return Ok(());
    }
    let (tables, dt_s) = (source.tables(), profile.frame.dt_s);
    for (at, units) in segments {
        let block = &blocks[at];
        for unit in units {
            for (variant, name) in block.variants.iter().enumerate() {
                let place = || Place::item(format!("{}/{name}", block.units.name(unit)));
                check_time_step(&source.case(at, unit, variant), tables, dt_s, place)?;
            }
        }
    }
    Ok(())
}

/// Units of one block, in order.
#[derive(Debug, Clone, PartialEq)]
pub enum Units {
    /// Scenarios or cells, of which this process holds an interval: total number, index of the first held, keys of
    /// those held.
    Held(u64, u64, Arc<[String]>),
    /// Samples `#0`, `#1`, … below this count: a run over 10¹⁰ samples stores no names.
    Numbered(u64),
}

impl Units {
    /// Number of units.
    pub fn len(&self) -> u64 {
        match self {
            Units::Held(count, ..) | Units::Numbered(count) => *count,
        }
    }

    /// Units whose cases are available: all, unless a study is read or made in part.
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

    /// The unit with this name.
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
    use super::{Headway, Units};

    #[test]
    fn a_headway_that_was_computed_has_the_key_of_the_one_that_was_written() {
        for (computed, written) in [("0.6000000000000001s", "0.6s"), ("1.9000000000000006s", "1.9s"), ("2.0s", "2s")] {
            assert_eq!(Headway::parse(computed), Headway::parse(written));
            assert_eq!(Headway::parse(computed).unwrap().to_string(), written);
        }
        assert_eq!(Headway::parse("29.999999999999996m").unwrap().to_string(), "30m");
        assert_eq!(Headway::parse("0.123456789012345s").unwrap().to_string(), "0.123456789012345s");
        assert_eq!((1..=10).map(|k| Headway::thw(f64::from(k) * 0.2)).rev().collect::<Vec<_>>(), Headway::paper());
    }

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
