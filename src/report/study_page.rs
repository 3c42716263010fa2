//! A study as one page.

use super::html::{Page, PageFigure, Section};
use super::plot::Figure;
use super::reference;
use super::run_record::Timings;
use super::study::{StudyReport, file_name};
use super::tables;
use crate::run::score::{CategoryScores, ClaimVerdict, Misfit};
use crate::scenario::Category;
use crate::scenario::parameterization::Parameterization;
use crate::support::readable::{count, value};
use crate::support::table::Table;
use crate::traffic::mining::RecordingSummary;

/// Maximum number of recordings listed; the rest are in `run.json`.
const MAX_RECORDINGS: usize = 200;

impl StudyReport {
    /// `report.html`.
    pub fn html(&self) -> String {
        let run = &self.run;
        let mut warnings = Vec::new();
        if !run.left_out.is_empty() {
            warnings.push(format!("{} parts of the input were left out; see Data.", run.left_out.len()));
        }
        if self.published {
            warnings.push("Published numbers are those of highD: other data agrees in shape at best.".to_owned());
        }
        let mut answer = self.answer_section();
        let mut sections = Vec::new();
        for at in 0..self.evaluation.scores.categories.len() {
            let mut section = self.category(at);
            // The figure that tells the ranking.
            answer.figures.extend((!section.figures.is_empty()).then(|| section.figures.remove(0)));
            sections.push(section);
        }
        sections.extend(self.claims());
        sections.push(self.failures());
        sections.extend(self.given_table().map(|table| Section {
            intro: "-cv: each scenario is replayed by a basis that was fitted on the other folds (folds.csv): whole recordings, or stretches of time if there are fewer recordings than folds.".to_owned(),
            tables: vec![table],
            ..Section::new("given", "Cross-validation and given S'")
        }));
        sections.extend(self.comparison.as_ref().map(|comparison| Section {
            text: reference::text(comparison),
            ..Section::new("reference", "Lane arithmetic against double precision")
        }));
        sections.extend([self.data(), self.reproduction()]);
        sections.iter_mut().for_each(|section| section.is_folded = true);
        sections.insert(0, answer);
        let page = Page {
            title: "Parameterized against recorded scenarios".to_owned(),
            lead: format!(
                "{} {} lanes: every scenario as recorded (S) and parameterized (S'), from {}, against {} \
                 driver models, judged by collision, TTC and BTN under profile {}.",
                sentence(&run.data),
                count(run.lanes),
                self.headways_in_words(),
                self.evaluation.scores.categories.first().map_or(0, |c| c.models.len()),
                run.profile.name
            ),
            synthetic: run.synthetic,
            warnings,
            sections,
        };
        page.html()
    }

    fn data(&self) -> Section {
        let run = &self.run;
        let label = |key| Category::ALL.into_iter().find(|c| c.key() == key).map_or(key, Category::label);
        let counts = Table::of(&run.categories)
            .column("scenario", |category| label(category.category))
            .column("found", |category| category.found)
            .column("simulated", |category| category.kept)
            .column("lanes", |category| category.lanes)
            .column("ended at the time cap", |category| category.capped_lanes)
            .column("F1 undefined (0/0)", |category| category.undefined_f1)
            .build()
            .captioned("Mined scenarios, and what became of them");
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
        let lists = [
            ("Thresholds and filters of the mining".to_owned(), toml_text(&run.mining)),
            (format!("{} recordings with their checksums", run.recordings.len()), recordings.join("\n")),
            ("Notes on the data".to_owned(), run.notes.join("\n")),
            (format!("{} parts left out", run.left_out.len()), run.left_out.join("\n")),
        ];
        let lists = lists.into_iter().filter(|(_, text)| !text.is_empty());
        let parts = lists.map(|(title, text)| Section::folded(title, text)).collect();
        Section { intro: sentence(&run.data), tables: vec![counts], parts, ..Section::new("data", "Data") }
    }

    fn failures(&self) -> Section {
        let table = tables::failure_table(&self.evaluation.scores, self.published, "at the time cap");
        Section {
            intro: [
                "How often each driver model fails each criterion when the recorded motions of the others are replayed \
                 (S); the ego starts from the study's headways.",
            ]
            .into_iter()
            .map(str::to_owned)
            .chain(Misfit::of(&self.evaluation.scores).filter(|_| self.published).map(|misfit| misfit.sentence()))
            .collect::<Vec<_>>()
            .join(" "),
            tables: vec![table.captioned("Failed simulations of S")],
            ..Section::new("failures", "Failures of the recorded scenarios")
        }
    }

    fn category(&self, at: usize) -> Section {
        let scores = &self.evaluation.scores.categories[at];
        let name = |figure: &str, end: &str| file_name(figure, scores.category, end);
        let page_figure = |(figure, drawn): (&'static str, Figure)| {
            PageFigure::new(&drawn.svg(), &[&name(figure, "svg"), &name(figure, "csv")])
        };
        let figures = self.figures(at).into_iter().map(page_figure).collect();
        let key = scores.category.key().replace('_', "-");
        let level = value(100.0 * self.evaluation.scores.options.confidence);
        Section {
            id: key,
            title: format!("{}: agreement of S' with S", scores.category.label()),
            intro: format!(
                "{} scenarios, {} simulations per model and parameterization. F1 joins recall (share of the recorded \
                 failures that S' shows) and precision (share of the failures of S' that were recorded); - is \
                 undefined, because neither side fails.",
                scores.scenarios, scores.simulations
            ),
            tables: vec![
                tables::f1_scores(scores, self.published, "S fails")
                    .captioned(format!("F1 with its {level} % interval over scenarios")),
                tables::share_table(scores).captioned("Recall / precision"),
                variants_table(scores),
            ],
            figures,
            ..Section::default()
        }
    }

    /// `None` if no claim could be computed, for instance with a single model.
    fn claims(&self) -> Option<Section> {
        let table = tables::claim_table(&self.evaluation.claims, usize::MAX);
        let level = value(100.0 * self.evaluation.scores.options.confidence);
        (!table.rows.is_empty()).then(|| Section {
            intro: format!(
                "What de Gelder and Op den Camp found on highD, tested here. A cell holds or contradicts a claim where \
                 the {level} % interval of its difference over scenarios excludes 0. {} Mean difference: over the \
                 cells that are judged. File: claims.csv.",
                ClaimVerdict::RULE
            ),
            tables: vec![table.captioned("Claims")],
            ..Section::new("claims", "The paper's claims on this data")
        })
    }

    fn reproduction(&self) -> Section {
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
        // Merged parts have their own times, which are not added up.
        if seconds.sweep_s > 0.0 {
            let Timings { mine_s, plan_s, sweep_s, score_s } = seconds;
            let text = format!("mining {mine_s:.2}, planning {plan_s:.2}, lanes {sweep_s:.2}, scores {score_s:.2}");
            host.push(("seconds".to_owned(), text));
        }
        Section {
            intro: "The same input, profile and seed give the same numbers, on any machine. run.json holds all of it; \
                    `lanesweep verify` compares a device with the CPU word by word."
                .to_owned(),
            facts,
            host,
            parts: vec![
                Section::options("Profile", &run.profile),
                Section::options("Options of the parameterizations", &run.parameterization),
                Section::options("Options of the scores", &run.score),
            ],
            ..Section::new("reproduction", "Reproduction")
        }
    }
}

fn variants_table(scores: &CategoryScores) -> Table {
    let known = scores.variants.iter().skip(1).filter_map(|key| Parameterization::find(scores.category, key));
    Table::of(&known.collect::<Vec<_>>())
        .column("parameterization", |id| id.key.to_string())
        .column("what is kept", |id| id.description())
        .column("kind", |id| id.family.name())
        .column("parameters beside the headway", |id| id.parameter_count())
        .build()
        .captioned("Parameterizations")
}

/// The text with a full stop.
fn sentence(text: &str) -> String {
    if text.ends_with('.') { text.to_owned() } else { format!("{text}.") }
}

fn toml_text<T: serde::Serialize>(value: &T) -> String {
    toml::to_string(value).unwrap_or_default()
}
