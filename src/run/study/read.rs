//! Reads a study from its file: head and checksums first, then the pages of the requested scenarios.

use std::io::{Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::sync::Arc;

use sha2::{Digest, Sha256};

use super::cases::{StudyCases, parameterizations};
use super::plan_file::{PAGE, StudyHead, lines, stripped};
use lanesweep_engine::{Block, CaseTable, LanePlan, Units};
use lanesweep_model::scenario::Scenario;
use lanesweep_model::scenario::parameterization::Reduction;
use lanesweep_support::plain_text::hex;
use lanesweep_support::{Error, Place, Result, option};

impl StudyHead {
    /// The study with some of its scenarios; `first_held` is the unit of the first one.
    pub(crate) fn with_scenarios(self, first_held: u64, held: Vec<Scenario>) -> Result<StudyCases> {
        let (mut ids, end_held) = (held.iter().map(|scenario| scenario.id.clone()), first_held + held.len() as u64);
        let (mut first, mut blocks, mut reductions, mut folds) = (0, Vec::new(), Vec::new(), Vec::new());
        for block in &self.blocks {
            let (from, end) = (first_held.clamp(first, first + block.units), first + block.units);
            let names: Vec<String> = ids.by_ref().take((end_held.clamp(from, end) - from) as usize).collect();
            let variants = parameterizations(block.category, block.basis.is_some()).map(|id| id.key.to_owned());
            let variants = variants.chain(block.others());
            let variants = std::iter::once("S".to_owned()).chain(variants).collect();
            blocks.push(Block::new(block.category, Units::Held(block.units, from - first, names.into()), variants));
            let of_basis = |basis| Reduction::from_parts(block.category, basis, &self.parameterization);
            reductions.push(block.basis.clone().map(of_basis).transpose()?);
            folds.push(block.folds.iter().cloned().map(of_basis).collect::<Result<_>>()?);
            first = end;
        }
        let (profile, models, headways) = (self.profile.clone(), self.models.clone(), self.headways.clone());
        let hash = self.plan_sha256.clone();
        // Counts and keys; lanes are run on its windows.
        let outline = LanePlan::with_hash(hash, profile, models, headways, blocks, Arc::new(CaseTable::new([])))?;
        Ok(StudyCases { head: self, outline, reductions, folds, first_held, held, left_out: Vec::new() })
    }

    /// Reads the study with some of its scenarios, whose lines begin at the file's present position. `wanted` selects
    /// them by their number.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] at `place` if a page is damaged.
    pub fn read(
        self,
        file: &mut (impl Read + Seek),
        place: &Place,
        wanted: impl FnOnce(u64) -> Range<u64>,
    ) -> Result<StudyCases> {
        let wrong = |problem: String| {
            Error::input(place.clone(), problem, format!("make the plan again with {}", option("plan_only")))
        };
        let io = |e| Error::io(place.file.clone().unwrap_or_default(), "read", e);
        let count = self.unit_count();
        let wanted = wanted(count);
        let begin = file.stream_position().map_err(io)?;
        let end = file.seek(SeekFrom::End(0)).map_err(io)?;
        let expected = self.scenario_bytes();
        if end - begin != expected {
            let problem = format!("it holds {} bytes of scenarios, where its head tells of {expected}", end - begin);
            return Err(wrong(format!("{problem}: it was cut off or added to")));
        }
        let (mut held, mut at) = (Vec::new(), begin);
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
            let lines: Vec<&[u8]> = content.split_inclusive(|byte| *byte == b'\n').collect();
            for (unit, line) in units.zip(lines).filter(|(unit, _)| wanted.contains(unit)) {
                let scenario: Scenario = serde_json::from_slice(line)
                    .map_err(|e| wrong(format!("scenario {unit} is of another version: {e}")))?;
                // Without the series that no lane reads.
                held.push(stripped(&scenario, scenario.gap0));
            }
        }
        self.with_scenarios(wanted.start.min(count), held)
    }
}

impl StudyCases {
    /// The data before the scenarios in a file.
    pub fn head(&self) -> &StudyHead {
        &self.head
    }

    /// Writes the plan file: its first line, then the scenarios.
    ///
    /// # Errors
    /// Those of the file; also if only an interval of the study is held.
    pub fn write_file(&self, line: &[u8], file: &mut dyn Write) -> std::io::Result<()> {
        if self.held_units() != (0..self.outline.unit_count()) {
            return Err(std::io::Error::other("a part of a study cannot be written as the study"));
        }
        file.write_all(line)?;
        self.held.chunks(PAGE as usize).try_for_each(|page| file.write_all(&lines(page)?))
    }
}
