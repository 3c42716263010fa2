//! A study as one page.

use super::host::Timings;
use super::html::{Page, PageFigure, Section};
use super::study::StudyReport;
use super::study_figures::validation;
use super::tables;
use lanesweep_model::scenario::parameterization::Parameterization;
use lanesweep_run::score::{CategoryScores, ClaimVerdict, Misfit};
use lanesweep_support::readable::{count, value};
use lanesweep_support::table::Table;
use lanesweep_traffic::mining::RecordingSummary;

/// Maximum number of recordings listed; the rest are in `run.json`.
const MAX_RECORDINGS: usize = 200;

impl StudyReport<'_> {
    /// `report.html`, with the figures of each category.
    pub(super) fn html(&self, figures: Vec<Vec<PageFigure>>) -> String {
        let facts = self.facts();
        let mut warnings = Vec::new();
        if !facts.left_out.is_empty() {
            warnings.push(format!("{} parts of the input were left out; see Data.", facts.left_out.len()));
        }
        if facts.published {
            warnings.push("Published numbers are those of highD: other data agrees in shape at best.".to_owned());
        }
        let mut answer = self.answer_section();
        let mut sections = Vec::new();
        for (scores, mut figures) in self.evaluation.scores.categories.iter().zip(figures) {
            // The figure that tells the ranking.
            answer = answer.figures((!figures.is_empty()).then(|| figures.remove(0)));
            sections.push(self.category(scores, figures));
        }
        sections.extend(self.claims());
        sections.push(self.failures());
        sections.extend(self.comparison.as_ref().map(|comparison| {
            Section::new("reference", "Lane arithmetic against double precision")
                .text(tables::reference_text(comparison))
        }));
        sections.extend([self.data(), self.reproduction()]);
        let (answer_sentence, data, runs) = (self.sentence(), sentence(&facts.data), count(self.lanes()));
        let (headways, drivers, profile) = (self.headways_in_words(), self.drivers(), &self.study.plan().profile.name);
        Page {
            title: "Parameterized against recorded scenarios".to_owned(),
            lead: format!(
                "{answer_sentence} {data} {runs} runs: every scenario as recorded (S) and parameterized (S'), from {headways}, \
                 against {drivers} driver models, judged by collision, TTC and BTN under profile {profile}."
            ),
            synthetic: facts.synthetic,
            warnings,
            app: None,
            sections: std::iter::once(answer).chain(sections.into_iter().map(Section::folded)).collect(),
        }
        .html()
    }

    fn data(&self) -> Section {
        let facts = self.facts();
        let counts = Table::of(&self.categories())
            .column("scenario", |category| category.category.label())
            .column("found", |category| category.found)
            .column("simulated", |category| category.kept)
            .column("runs", |category| category.lanes)
            .column("ended at the time cap", |category| category.capped_lanes)
            .column("F1 undefined (0/0)", |category| category.undefined_f1)
            .build()
            .captioned("Mined scenarios, and what became of them");
        let shown = facts.recordings.iter().take(MAX_RECORDINGS);
        let line = |recording: &RecordingSummary| {
            let files = recording.files.iter().map(|file| format!("\n  {} {}", file.sha256, file.file));
            let (hours, kilometres) = (recording.driven_s / 3600.0, recording.driven_m / 1000.0);
            let (vehicles, hours, kilometres) = (count(recording.vehicles), value(hours), value(kilometres));
            let counts = format!("{vehicles} vehicles, {hours} h and {kilometres} km driven");
            let preset = recording.preset.iter().map(|preset| format!("\n  preset {preset}"));
            format!("{}: {counts}{}", recording.id, preset.chain(files).collect::<String>())
        };
        let mut recordings: Vec<String> = shown.map(line).collect();
        if facts.recordings.len() > MAX_RECORDINGS {
            recordings.push(format!("… and {} more in run.json", facts.recordings.len() - MAX_RECORDINGS));
        }
        let lists = [
            ("Thresholds and filters of the mining".to_owned(), toml::to_string(&facts.mining).unwrap_or_default()),
            (format!("{} recordings with their checksums", facts.recordings.len()), recordings.join("\n")),
            ("Notes on the data".to_owned(), facts.notes.join("\n")),
            (format!("{} parts left out", facts.left_out.len()), facts.left_out.join("\n")),
        ];
        let lists = lists.into_iter().filter(|(_, text)| !text.is_empty());
        let parts = lists.map(|(title, text)| Section::new("", title).text(text));
        Section::new("data", "Data").intro(sentence(&facts.data)).tables([counts]).parts(parts)
    }

    fn failures(&self) -> Section {
        let (scores, published) = (&self.evaluation.scores, self.facts().published);
        let intro = "How often each driver model fails each criterion when the recorded motions of the others are \
                     replayed (S); the ego starts from the study's headways.";
        let misfit = Misfit::of(scores).filter(|_| published).map(|misfit| misfit.sentence());
        Section::new("failures", "Failures of the recorded scenarios")
            .intro([intro.to_owned()].into_iter().chain(misfit).collect::<Vec<_>>().join(" "))
            .tables([tables::failure_table(scores, published).captioned("Failed simulations of S")])
    }

    fn category(&self, scores: &CategoryScores, figures: Vec<PageFigure>) -> Section {
        let level = value(100.0 * self.evaluation.scores.options.confidence);
        let title = format!("{}: agreement of S' with S", scores.category.label());
        Section::new(&scores.category.key().replace('_', "-"), title)
            .intro(format!(
                "{} scenarios, {} simulations per model and parameterization. F1 joins recall (share of the recorded \
                 failures that S' shows) and precision (share of the failures of S' that were recorded); - is \
                 undefined, because neither side fails.",
                scores.scenarios, scores.simulations
            ))
            .tables([
                tables::f1_scores(scores)
                    .captioned(format!("F1 with its {level} % interval over scenarios{}", validation(scores))),
                tables::share_table(scores).captioned("Recall / precision"),
            ])
            .tables(tables::f1_beside_published(scores).filter(|_| self.facts().published).map(|table| {
                table.captioned("F1 beside the paper's: in sample, decompositions fitted on the scenarios they replay")
            }))
            .tables([variants_table(scores)])
            .figures(figures)
    }

    /// `None` if no claim could be computed, for instance with a single model.
    fn claims(&self) -> Option<Section> {
        let table = tables::claim_table(&self.evaluation.claims);
        let level = value(100.0 * self.evaluation.scores.options.confidence);
        let section = Section::new("claims", "The paper's claims on this data").intro(format!(
            "What de Gelder and Op den Camp found on highD, tested here. A cell holds or contradicts a claim where \
             the {level} % interval of its difference over scenarios excludes 0. {} Mean difference: over the \
             cells that are judged. File: tables/claims.csv.",
            ClaimVerdict::RULE
        ));
        (!table.rows.is_empty()).then(|| section.tables([table.captioned("Claims")]))
    }

    fn reproduction(&self) -> Section {
        let (facts, plan) = (self.facts(), self.study.plan());
        let Timings { mine_s, plan_s, sweep_s, score_s } = self.timings;
        // Merged parts have their own times, which are not added up.
        let seconds = (sweep_s > 0.0).then(|| {
            let text = format!("mining {mine_s:.2}, planning {plan_s:.2}, lanes {sweep_s:.2}, scores {score_s:.2}");
            ("seconds", text)
        });
        let plan_sha256 = plan.hash();
        self.host.section(&plan.profile).fact("SHA-256 of the plan", plan_sha256).host(seconds).parts([
            Section::options("Options of the parameterizations", &facts.parameterization),
            Section::options("Options of the scores", &facts.score),
        ])
    }
}

fn variants_table(scores: &CategoryScores) -> Table {
    let known = scores.variants.iter().skip(1).filter_map(|key| Parameterization::find(scores.category, key));
    Table::of(&known.collect::<Vec<_>>())
        .column("parameterization", |id| id.key)
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
