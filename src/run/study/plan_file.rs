//! A study as a file: a head, then the records of its scenarios in pages, each with a checksum in the head. A process
//! that computes some of the scenarios reads their pages alone. The hash of the plan is that of head and checksums.

use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::engine::lane_case::LaneCase;
use crate::engine::plan::{Block, CaseSource, Headway, LanePlan};
use crate::engine::units::Units;
use crate::engine::version::Canonical;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::study::cases::{Records, StudyCases, parameterizations};
use crate::run::study::unit_record;
use crate::scenario::parameterization::{ParameterizationId, ParameterizationOptions, Reduction, SvdBasis};
use crate::scenario::{Category, Tables, problem_of};
use crate::support::hex::hex;
use crate::{Error, Place, Result};

/// Scenarios of a page.
const PAGE: u64 = 64;

/// What a study is beside its scenarios, and the checksums of those.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyHead {
    plan_sha256: String,
    profile: Profile,
    models: Vec<ModelId>,
    headways: Vec<Headway>,
    pub(crate) parameterization: ParameterizationOptions,
    blocks: Vec<BlockHead>,
    /// Bytes and SHA-256 of every page of records.
    pages: Vec<(u64, String)>,
}

/// One category's part of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BlockHead {
    category: Category,
    units: u64,
    /// None where there were too few scenarios for a decomposition.
    basis: Option<SvdBasis>,
}

impl BlockHead {
    /// Of the decomposition, what cases are made with.
    pub fn new(category: Category, units: u64, reduction: Option<&Reduction>) -> BlockHead {
        let used = ParameterizationId::max_coefficients(category);
        let basis = reduction.map(|reduction| {
            let SvdBasis { weights, mean, directions, rows, .. } = reduction.basis.clone();
            let directions = directions.into_iter().take(used).collect();
            SvdBasis { weights, mean, directions, rows, singular_values: Vec::new() }
        });
        BlockHead { category, units, basis }
    }
}

/// The source of a plan without cases.
struct NoCases;

impl CaseSource for NoCases {
    fn case(&self, _block: usize, _unit: u64, _variant: usize) -> LaneCase<f64> {
        unreachable!("an outline is asked for counts and keys; lanes are run on its windows")
    }

    fn tables(&self) -> &Tables<f64> {
        static NONE: Tables<f64> = Tables { speed: Vec::new(), lateral: Vec::new() };
        &NONE
    }
}

impl StudyHead {
    /// Of scenarios that are all held.
    pub(crate) fn new(
        profile: Profile,
        models: Vec<ModelId>,
        headways: Vec<Headway>,
        parameterization: ParameterizationOptions,
        blocks: Vec<BlockHead>,
        held: &Records,
    ) -> Result<StudyHead> {
        let mut pages = Vec::new();
        let mut begin = 0;
        for ends in held.ends.chunks(PAGE as usize) {
            let end = ends.last().copied().unwrap_or(begin);
            pages.push(((end - begin) as u64, hex(&Sha256::digest(&held.bytes[begin..end]))));
            begin = end;
        }
        let plan_sha256 = String::new();
        let mut head = StudyHead { plan_sha256, profile, models, headways, parameterization, blocks, pages };
        head.plan_sha256 = head.hash()?;
        Ok(head)
    }

    /// Hash of the plan: everything that decides the outcomes.
    fn hash(&self) -> Result<String> {
        let StudyHead { plan_sha256: _, profile, models, headways, parameterization, blocks, pages } = self;
        let mut canonical = Canonical::new("study");
        canonical.value(&(profile, models, headways, parameterization, blocks))?;
        for (bytes, sha256) in pages {
            canonical.word(*bytes);
            canonical.text(sha256);
        }
        Ok(canonical.finish())
    }

    /// Scenarios of the study.
    fn unit_count(&self) -> u64 {
        self.blocks.iter().map(|block| block.units).fold(0, u64::saturating_add)
    }

    /// The study with these of its scenarios.
    pub(crate) fn with_records(self, held: Records) -> Result<StudyCases> {
        let mut records = unit_ids(&held).into_iter();
        let (mut first, mut blocks, mut reductions) = (0, Vec::new(), Vec::new());
        for block in &self.blocks {
            let (from, end) = (held.first.clamp(first, first + block.units), first + block.units);
            let names: Vec<String> =
                records.by_ref().take((held.units().end.clamp(from, end) - from) as usize).collect();
            let variants = parameterizations(block.category, block.basis.is_some()).map(|id| id.key.into_owned());
            blocks.push(Block {
                category: block.category,
                units: Units::Held(block.units, from - first, names.into()),
                variants: std::iter::once("S".to_owned()).chain(variants).collect(),
                first_unit: 0,
                first_lane: 0,
            });
            let basis = block.basis.clone();
            let of_basis = |basis| Reduction::from_parts(block.category, basis, &self.parameterization);
            reductions.push(basis.map(of_basis).transpose()?);
            first = end;
        }
        let (profile, models, headways) = (self.profile.clone(), self.models.clone(), self.headways.clone());
        let hash = self.plan_sha256.clone();
        let outline = LanePlan::with_hash(hash, profile, models, headways, blocks, Box::new(NoCases))?;
        Ok(StudyCases { head: self, outline, reductions, held })
    }

    /// The study with some of its scenarios, whose records begin where the file stands. `wanted` says which, of so many.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] at `place` where head or records contradict themselves or the hash, or where a
    /// page that is read is damaged.
    pub fn read(
        self,
        file: &mut (impl Read + Seek),
        place: &Place,
        wanted: impl FnOnce(u64) -> Range<u64>,
    ) -> Result<StudyCases> {
        let wrong = |problem: String| Error::input(place.clone(), problem, "make the plan again with --plan-only");
        let io = |e| Error::io(place.file.clone().unwrap_or_default(), "read", e);
        self.check(place)?;
        let count = self.unit_count();
        let wanted = wanted(count);
        let begin = file.stream_position().map_err(io)?;
        let end = file.seek(SeekFrom::End(0)).map_err(io)?;
        let told = self.pages.iter().map(|(bytes, _)| *bytes).fold(0, u64::saturating_add);
        if end - begin != told {
            let problem = format!("it holds {} bytes of scenarios, where its head tells of {told}", end - begin);
            return Err(wrong(format!("{problem}: it was cut off or added to")));
        }
        let mut held = Records { first: wanted.start.min(count), ..Records::default() };
        let mut at = begin;
        for (page, (bytes, sha256)) in self.pages.iter().enumerate() {
            let units = page as u64 * PAGE..count.min((page as u64 + 1) * PAGE);
            let from = at;
            at += bytes;
            if units.end <= wanted.start || wanted.end <= units.start {
                continue;
            }
            file.seek(SeekFrom::Start(from)).map_err(io)?;
            let mut content = vec![0; *bytes as usize];
            file.read_exact(&mut content).map_err(io)?;
            if hex(&Sha256::digest(&content)) != *sha256 {
                let problem = format!("scenarios {} to {} are damaged", units.start, units.end - 1);
                return Err(wrong(format!("{problem}: their checksum does not match")));
            }
            let mut rest = &content[..];
            for unit in units.clone() {
                let whole = unit_record::length(rest).map(|length| rest.split_at(length));
                let (record, after) = whole.ok_or_else(|| wrong(format!("scenario {unit} is not whole")))?;
                rest = after;
                if wanted.contains(&unit) {
                    self.check_record(unit, record).map_err(wrong)?;
                    held.push(record);
                }
            }
            if !rest.is_empty() {
                return Err(wrong(format!(
                    "there is more than scenarios {} to {} in a page",
                    units.start,
                    units.end - 1
                )));
            }
        }
        self.with_records(held)
    }

    /// Whether a study can be so.
    fn check(&self, place: &Place) -> Result<()> {
        let wrong = |problem: &str| Err(Error::input(place.clone(), problem, "make the plan again with --plan-only"));
        self.profile.check(place)?;
        self.parameterization.validate()?;
        if self.blocks.is_empty() || self.blocks.iter().any(|block| block.units == 0) {
            return wrong("a category has no scenario");
        }
        let is_twice = |at: usize| self.blocks[..at].iter().any(|block| block.category == self.blocks[at].category);
        if (0..self.blocks.len()).any(is_twice) {
            return wrong("a category is there twice");
        }
        if (0..self.models.len()).any(|at| self.models[..at].contains(&self.models[at])) {
            return wrong("a driver model is there twice");
        }
        let number = |headway: &Headway| match *headway {
            Headway::ThwS(number) | Headway::GapM(number) => number,
        };
        if !self.headways.iter().all(|headway| (0.0..1e6).contains(&number(headway))) {
            return wrong("a headway is out of range (0 to 1e6)");
        }
        for block in &self.blocks {
            let used = ParameterizationId::max_coefficients(block.category);
            if block.basis.as_ref().is_some_and(|basis| basis.directions.len() != used) {
                return wrong("a decomposition does not have the directions of its parameterizations");
            }
        }
        if self.pages.len() as u64 != self.unit_count().div_ceil(PAGE) {
            return wrong("it does not have the checksums of all scenarios");
        }
        if self.hash()? != self.plan_sha256 {
            return wrong(
                "its content is not that of its hash: it was changed, or another version of lanesweep made it",
            );
        }
        Ok(())
    }

    /// Whether a record is of a scenario that can be simulated.
    fn check_record(&self, unit: u64, record: &[u8]) -> std::result::Result<(), String> {
        let mut first = 0;
        let block = self.blocks.iter().find(|block| {
            first += block.units;
            unit < first
        });
        let scenario = block.and_then(|block| unit_record::read(record, block.category));
        let scenario = scenario.ok_or_else(|| format!("scenario {unit} is not whole"))?;
        problem_of(&scenario).map_or(Ok(()), |problem| Err(format!("scenario {}: {problem}", scenario.id)))
    }
}

impl StudyCases {
    /// What stands before the records in a file.
    pub fn head(&self) -> &StudyHead {
        &self.head
    }

    /// A plan of its own over some of the scenarios held, evenly taken from all of them, at most about so many: for
    /// what may be concluded from them on the whole.
    ///
    /// # Errors
    /// None for what this program makes.
    pub(crate) fn thinned(&self, most: u64) -> Result<LanePlan> {
        let step = (self.held.ends.len() as u64).div_ceil(most.max(1)).max(1);
        let (mut held, mut blocks) = (Records::default(), Vec::new());
        for (head, block) in self.head.blocks.iter().zip(&self.outline.blocks) {
            let units = block.units.held().map(|unit| block.first_unit + unit).step_by(step as usize);
            let before = held.ends.len();
            units.filter_map(|unit| self.held.get(unit)).for_each(|record| held.push(record));
            blocks.push(BlockHead { units: (held.ends.len() - before) as u64, ..head.clone() });
        }
        let head = StudyHead { blocks, ..self.head.clone() };
        let study = head.with_records(held)?;
        study.window(0..study.outline.unit_count())
    }

    /// The records of the file.
    ///
    /// # Errors
    /// [`Error::Internal`] where an interval of the study is held.
    pub fn records(&self) -> Result<&[u8]> {
        if self.held.units() == (0..self.outline.unit_count()) {
            Ok(&self.held.bytes)
        } else {
            Err(Error::Internal("a part of a study cannot be written as the study".to_owned()))
        }
    }
}

/// The ids of the scenarios held.
fn unit_ids(held: &Records) -> Vec<String> {
    let ids = held.units().map(|unit| held.get(unit).and_then(unit_record::id).unwrap_or_default().to_owned());
    ids.collect()
}
