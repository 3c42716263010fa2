//! A study as one page.

use super::html::{Page, PageFigure, PageTable, Section};
use super::reference::ReferenceComparison;
use super::run_record::Timings;
use super::study::{StudyReport, file_name};
use super::tables;
use crate::model::criterion::Criterion;
use crate::run::score::{CategoryScores, ClaimVerdict, Misfit, precision, recall};
use crate::scenario::Category;
use crate::scenario::parameterization::Parameterization;
use crate::support::readable::{count, value};
use crate::traffic::mining::RecordingSummary;
use crate::{Error, Result};

/// Recordings that are listed; the rest are in `run.json`.
const MAX_RECORDINGS: usize = 200;

impl StudyReport {
    /// `report.html`.
    ///
    /// # Errors
    /// None for what this program makes.
    pub fn html(&self) -> Result<String> {
        let run = &self.run;
        let mut warnings = Vec::new();
        if run.synthetic {
            warnings.push("Synthetic data: no number on this page is a statement about real traffic.".to_owned());
        }
        if !run.left_out.is_empty() {
            warnings.push(format!("{} parts of the input were left out; see Data.", run.left_out.len()));
        }
        if self.published {
            warnings.push("Published numbers are those of highD: other data agrees in shape at best.".to_owned());
        }
        let mut sections = vec![self.data(), self.failures()];
        for at in 0..self.scores.categories.len() {
            sections.push(self.category(at));
        }
        sections.extend(self.claims());
        sections.extend(self.comparison.as_ref().map(compared));
        sections.push(self.reproduction()?);
        let page = Page {
            title: "Parameterized against recorded scenarios".to_owned(),
            program: run.program.clone(),
            lead: format!(
                "{} {} lanes: every scenario as recorded (S) and parameterized (S'), from {}, against {} \
                 driver models, judged by collision, TTC and BTN under profile {}.",
                sentence(&run.data),
                count(run.lanes),
                self.headways_in_words(),
                self.scores.categories.first().map_or(0, |c| c.models.len()),
                run.profile.name
            ),
            warnings,
            sections,
        };
        page.html()
    }

    fn data(&self) -> Section {
        let run = &self.run;
        let header = ["scenario", "found", "simulated", "lanes", "ended at the time cap", "F1 undefined (0/0)"];
        let rows = run.categories.iter().map(|category| {
            let numbers = [category.found, category.kept, category.lanes, category.capped_lanes, category.undefined_f1];
            let key = category.category;
            let label = Category::ALL.into_iter().find(|c| c.key() == key).map_or(key, Category::label);
            [label.to_owned()].into_iter().chain(numbers.map(count)).collect()
        });
        let counts = table("Mined scenarios, and what became of them", &header, 1, rows.collect());
        let shown = run.recordings.iter().take(MAX_RECORDINGS);
        let line = |recording: &RecordingSummary| {
            let files = recording.files.iter().map(|file| format!("\n  {} {}", file.sha256, file.file));
            let (hours, kilometres) = (recording.driven_s / 3600.0, recording.driven_m / 1000.0);
            let (vehicles, hours, kilometres) = (count(recording.vehicles), value(hours), value(kilometres));
            let counts = format!("{vehicles} vehicles, {hours} h and {kilometres} km driven");
            format!("{}: {counts}{}", recording.id, files.collect::<String>())
        };
        let mut recordings: Vec<String> = shown.map(line).collect();
        if run.recordings.len() > MAX_RECORDINGS {
            recordings.push(format!("… and {} more in run.json", run.recordings.len() - MAX_RECORDINGS));
        }
        let mut details = vec![("Thresholds and filters of the mining".to_owned(), toml_text(&run.mining))];
        if !recordings.is_empty() {
            details.push((format!("{} recordings with their checksums", run.recordings.len()), recordings.join("\n")));
        }
        if !run.notes.is_empty() {
            details.push(("Notes on the data".to_owned(), run.notes.join("\n")));
        }
        if !run.left_out.is_empty() {
            details.push((format!("{} parts left out", run.left_out.len()), run.left_out.join("\n")));
        }
        Section { intro: sentence(&run.data), tables: vec![counts], details, ..Section::new("data", "Data") }
    }

    fn failures(&self) -> Section {
        let mut header = vec!["scenario", "model", "collision", "TTC", "BTN", "simulations", "at the time cap"];
        if self.published {
            header.extend(tables::PUBLISHED_COLUMNS);
        }
        let rows = tables::failure_rows(&self.scores, self.published);
        Section {
            intro: [
                "How often each driver model fails each criterion when the recorded motions of the others are replayed \
                 (S); the ego starts from the study's headways.",
            ]
            .into_iter()
            .map(str::to_owned)
            .chain(Misfit::of(&self.scores).filter(|_| self.published).map(|misfit| misfit.sentence()))
            .collect::<Vec<_>>()
            .join(" "),
            tables: vec![table("Failed simulations of S", &header, 2, rows)],
            ..Section::new("failures", "Failures of the recorded scenarios")
        }
    }

    fn category(&self, at: usize) -> Section {
        let scores = &self.scores.categories[at];
        let name = |figure: &str, end: &str| file_name(figure, scores.category, end);
        let mut figures = vec![PageFigure::new(&self.radar(scores), &[&name("radar", "svg"), "f1.csv"])];
        for (figure, drawn) in self.figures(at) {
            figures.push(PageFigure::new(&drawn.svg(), &[&name(figure, "svg"), &name(figure, "csv")]));
        }
        let key = scores.category.key().replace('_', "-");
        Section {
            id: key,
            title: format!("{}: agreement of S' with S", scores.category.label()),
            intro: format!(
                "{} scenarios, {} simulations per model and parameterization. F1 joins recall (share of the recorded \
                 failures that S' shows) and precision (share of the failures of S' that were recorded); - is \
                 undefined, because neither side fails.",
                scores.scenarios, scores.simulations
            ),
            tables: vec![self.f1_table(scores), shares_table(scores), variants_table(scores)],
            figures,
            ..Section::default()
        }
    }

    fn f1_table(&self, scores: &CategoryScores) -> PageTable {
        let mut header = vec!["model".to_owned(), "criterion".to_owned(), "S fails".to_owned()];
        header.extend(scores.variants.iter().skip(1).cloned());
        let rows = tables::f1_rows(scores, self.published);
        let level = value(100.0 * self.scores.options.confidence);
        PageTable { caption: format!("F1 with its {level} % interval over scenarios"), header, texts: 2, rows }
    }

    /// `None` where no claim could be computed: of a single model, say.
    fn claims(&self) -> Option<Section> {
        let rows = tables::claim_rows(&self.claims);
        let level = value(100.0 * self.scores.options.confidence);
        (!rows.is_empty()).then(|| Section {
            intro: format!(
                "What de Gelder and Op den Camp found on highD, tested here. A cell holds or contradicts a claim where \
                 the {level} % interval of its difference over scenarios excludes 0. {} Mean difference: over the \
                 cells that are judged. File: claims.csv.",
                ClaimVerdict::RULE
            ),
            tables: vec![table("Claims", &tables::CLAIM_COLUMNS, 2, rows)],
            ..Section::new("claims", "The paper's claims on this data")
        })
    }

    fn reproduction(&self) -> Result<Section> {
        let run = &self.run;
        let mut facts = vec![
            ("program".to_owned(), run.program.clone()),
            ("profile".to_owned(), run.profile.name.clone()),
            ("time step".to_owned(), format!("{} s", value(run.profile.frame.dt_s))),
            ("seed of the lanes computed again".to_owned(), run.score.seed.to_string()),
            ("SHA-256 of the plan".to_owned(), run.plan_sha256.clone()),
        ];
        facts.extend(
            run.scenario_file_sha256.iter().map(|sha| ("SHA-256 of the scenario file".to_owned(), sha.clone())),
        );
        let mut host = vec![("computed by".to_owned(), run.backend.clone())];
        host.extend(run.device.iter().map(|device| ("device".to_owned(), device.line())));
        host.push((
            "checked".to_owned(),
            match run.sweep.rechecked_lanes {
                0 => "no lane: every one made every step by itself".to_owned(),
                lanes => format!("{} lanes computed again on the CPU with every step made, all equal", count(lanes)),
            },
        ));
        let seconds = &run.timings;
        // Parts that were merged have times of their own, which nobody has added up.
        if seconds.sweep_s > 0.0 {
            let Timings { mine_s, plan_s, sweep_s, score_s } = seconds;
            let text = format!("mining {mine_s:.2}, planning {plan_s:.2}, lanes {sweep_s:.2}, scores {score_s:.2}");
            host.push(("seconds".to_owned(), text));
        }
        let record =
            String::from_utf8(run.to_json()?).map_err(|e| Error::Internal(format!("run.json is no text: {e}")))?;
        let value: serde_json::Value =
            serde_json::from_str(&record).map_err(|e| Error::Internal(format!("run.json cannot be read: {e}")))?;
        let part = |key: &str| serde_json::to_string_pretty(&value[key]).unwrap_or_default();
        Ok(Section {
            intro: "The same input, profile and seed give the same numbers, on any machine. run.json holds all of it; \
                    `lanesweep verify` compares a device with the CPU word by word."
                .to_owned(),
            facts,
            host,
            details: vec![
                ("Profile".to_owned(), part("profile")),
                ("Options of the parameterizations".to_owned(), part("parameterization")),
                ("Options of the scores".to_owned(), part("score")),
            ],
            ..Section::new("reproduction", "Reproduction")
        })
    }
}

fn shares_table(scores: &CategoryScores) -> PageTable {
    let mut header = vec!["model".to_owned(), "criterion".to_owned()];
    header.extend(scores.variants.iter().skip(1).cloned());
    let share = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.3}"));
    let mut rows = Vec::new();
    for &model in &scores.models {
        for criterion in Criterion::ALL {
            let mut row = vec![model.name().to_owned(), criterion.label().to_owned()];
            for variant in 1..scores.variants.len() {
                let counts = scores.index(variant, model, criterion).map(|i| scores.cells[i].counts);
                let both = |c| format!("{} / {}", share(recall(&c)), share(precision(&c)));
                row.push(counts.map_or("-".to_owned(), both));
            }
            rows.push(row);
        }
    }
    PageTable { caption: "Recall / precision".to_owned(), header, texts: 2, rows }
}

fn variants_table(scores: &CategoryScores) -> PageTable {
    let known = scores.variants.iter().skip(1).filter_map(|key| Parameterization::find(scores.category, key));
    let rows = known.map(|id| {
        vec![id.key.to_string(), id.description(), id.family.name().to_owned(), id.parameter_count().to_string()]
    });
    let header = ["parameterization", "what is kept", "kind", "parameters beside the headway"];
    table("Parameterizations", &header, 3, rows.collect())
}

fn compared(comparison: &ReferenceComparison) -> Section {
    Section {
        details: vec![("Every lane in f32 and in f64".to_owned(), comparison.text())],
        ..Section::new("reference", "Lane arithmetic against double precision")
    }
}

fn table(caption: &str, header: &[&str], texts: usize, rows: Vec<Vec<String>>) -> PageTable {
    PageTable {
        caption: caption.to_owned(),
        header: header.iter().map(|name| (*name).to_owned()).collect(),
        texts,
        rows,
    }
}

/// With a full stop at its end.
fn sentence(text: &str) -> String {
    if text.ends_with('.') { text.to_owned() } else { format!("{text}.") }
}

fn toml_text<T: serde::Serialize>(value: &T) -> String {
    toml::to_string(value).unwrap_or_default()
}
