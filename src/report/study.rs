//! A study as text for the terminal and as files in the output folder.

use std::path::{Path, PathBuf};

use super::files::{make_folder, write_atomically};
use super::radar::{RadarChart, RadarSeries, radar_svg};
use super::reference::ReferenceComparison;
use super::run_record::RunRecord;
use super::{csv, tables};
use crate::criterion::Criterion;
use crate::parameterization::ParameterizationId;
use crate::scenario::Category;
use crate::score::{CategoryScores, ClaimResult, ScoreTable, f1};
use crate::{Error, Result};

/// Everything a study says.
pub struct StudyReport {
    /// Scores.
    pub scores: ScoreTable,
    /// Claims with their verdicts.
    pub claims: Vec<ClaimResult>,
    /// What was run.
    pub run: RunRecord,
    /// Set the paper's published numbers beside.
    pub published: bool,
    /// f32 against f64, where it was asked for.
    pub comparison: Option<ReferenceComparison>,
}

impl StudyReport {
    /// The tables for the terminal, 120 columns wide at most; only an unbroken word of the data's description
    /// (a path) can be longer.
    pub fn text(&self) -> String {
        let data = tables::wrap(&self.run.data, tables::WIDTH);
        let mut parts = vec![format!("{data}\n")];
        if self.published {
            parts.push("Published numbers are those of highD: other data agrees in shape at best.\n".to_owned());
        }
        parts.push(tables::failures(&self.scores, self.published));
        parts.extend(self.scores.categories.iter().map(|c| tables::f1_table(c, self.published)));
        parts.push(tables::claims(&self.claims));
        parts.extend(self.comparison.iter().map(ReferenceComparison::text));
        if self.run.synthetic {
            parts.push(format!("{data}\nNo number above is a statement about real traffic.\n"));
        }
        parts.join("\n")
    }

    /// Writes CSV tables, figures and `run.json` into a folder; the record comes last, so a folder that has
    /// one is whole. Returns what was written.
    pub fn write(&self, dir: &Path) -> Result<Vec<PathBuf>> {
        make_folder(dir)?;
        let data = if self.run.synthetic { "synthetic" } else { "recorded" };
        let mut files: Vec<(PathBuf, Vec<u8>)> = vec![
            (dir.join("failures.csv"), csv::failures(&self.scores, data)?),
            (dir.join("f1.csv"), csv::f1_scores(&self.scores, data)?),
            (dir.join("claims.csv"), csv::claims(&self.claims, data)?),
            (dir.join("report.txt"), self.text().into_bytes()),
        ];
        for category in &self.scores.categories {
            let name = format!("radar-{}.svg", category.category.key().replace('_', "-"));
            files.push((dir.join(name), radar_svg(&self.radar(category)).into_bytes()));
        }
        files.push((dir.join("run.json"), self.run.to_json()?));
        if let Some(comparison) = &self.comparison {
            files.insert(0, (dir.join("reference.csv"), comparison.csv().into_bytes()));
        }
        remove_earlier(dir, &files)?;
        for (path, content) in &files {
            write_atomically(path, content)?;
        }
        Ok(files.into_iter().map(|(path, _)| path).collect())
    }

    /// F1 per model and criterion (spokes), one polygon per parameterization, as in the paper.
    fn radar(&self, scores: &CategoryScores) -> RadarChart {
        let spokes: Vec<_> =
            scores.models.iter().flat_map(|&m| Criterion::ALL.into_iter().map(move |c| (m, c))).collect();
        let series = (1..scores.variants.len()).map(|variant| {
            let key = &scores.variants[variant];
            let name = ParameterizationId::find(scores.category, key)
                .map_or(key.clone(), |id| format!("{key}: {}", id.description));
            let value = |&(model, criterion): &(_, _)| {
                scores.index(variant, model, criterion).and_then(|at| f1(&scores.cells[at].counts))
            };
            RadarSeries { name, values: spokes.iter().map(value).collect() }
        });
        RadarChart {
            title: format!("{}: F1 of parameterized against recorded scenarios", scores.category.label()),
            subtitle: Some(format!("{} scenarios. {}", scores.scenarios, self.run.data)),
            spokes: spokes.iter().map(|(m, c)| format!("{} {}", m.name(), c.label())).collect(),
            series: series.collect(),
        }
    }
}

/// Takes away what an earlier run left in the folder and this one does not write: the record first, so that a
/// folder with a record is whole, then figures and comparisons of other categories.
fn remove_earlier(dir: &Path, files: &[(PathBuf, Vec<u8>)]) -> Result<()> {
    let figures = Category::ALL.map(|c| format!("radar-{}.svg", c.key().replace('_', "-")));
    let ours = figures.into_iter().chain(["reference.csv".to_owned()]).map(|name| dir.join(name));
    let stale = ours.filter(|path| files.iter().all(|(written, _)| written != path));
    for path in std::iter::once(dir.join("run.json")).chain(stale) {
        match std::fs::remove_file(&path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::io(&path, "remove", e)),
            _ => {}
        }
    }
    Ok(())
}
