//! The result of a search: text, tables, figures, page and record.

use std::fmt::Write as _;

use serde_json::json;

use super::host::Host;
use super::html::{Page, PageFigure, Section};
use super::plot::{Figure, Look, Mark, Plot, PlotAxis, Series, Symbol, Value};
use super::records::{self, PROGRAM, publish};
use super::study_figures::modes;
use super::tables::paragraph;
use crate::Result;
use crate::model::profile::Profile;
use crate::run::search::{Candidate, Evaluated, Front, FrontPoint, Judged, Scope, Scored, SearchResult};
use crate::scenario::parameterization::ModeShape;
use crate::support::readable::{count, counted};
use crate::support::run_folder::{ResultFiles, Results};
use crate::support::table::{NamedValue, Table, WIDTH};

/// Approximate number of candidates of a figure, in even steps of their scores; the paper's are all drawn.
const MAX_DRAWN: usize = 400;
const PAPER: &str = "#777777";
const FRONT: &str = "#0072b2";
const HELD_OUT: &str = "#d55e00";

/// The scores of a description, by their columns.
const SCORES: [NamedValue<Judged, Option<Scored>>; 3] = [
    ("cross_validated", |judged| Some(judged.cross_validated)),
    ("in_sample", |judged| Some(judged.in_sample)),
    ("held_out", |judged| judged.held_out),
];

/// A search as it is reported.
pub struct SearchReport<'a> {
    /// The result.
    pub result: &'a SearchResult,
    /// Shapes of the winner's directions.
    pub modes: Vec<ModeShape>,
    /// The data in one line.
    pub data: String,
    /// The data that the search did not read.
    pub held_out: Option<String>,
    /// SHA-256 of the scenarios, and of the held-out ones, as scenario files.
    pub scenarios_sha256: Vec<String>,
    /// The data are synthetic.
    pub synthetic: bool,
    /// Profile.
    pub profile: &'a Profile,
    /// The command.
    pub command: String,
    /// The machine.
    pub host: Host,
}

/// `0.812 [0.743, 0.866]`.
fn with_interval(scored: &Scored) -> String {
    let Some(value) = scored.value else { return "undefined".to_owned() };
    let interval = scored.interval.map_or(String::new(), |i| format!(" [{:.2}, {:.2}]", i.low, i.high));
    format!("{value:.3}{interval}")
}

/// The key of the paper, or `found 4`.
fn name_of(candidate: &Candidate, parameters: usize) -> String {
    match candidate {
        Candidate::Paper(key) => key.clone(),
        Candidate::Linear(_) => format!("found {parameters}"),
    }
}

impl SearchReport<'_> {
    fn describe(&self, candidate: &Candidate) -> String {
        candidate.describe(self.result.category)
    }

    fn goal(&self) -> String {
        let options = &self.result.options;
        format!("{} of {}", options.objective.name(), options.criterion.label())
    }

    /// The rows of a front, the paper's first.
    fn table(&self, front: &Front) -> Table {
        let paper = front.paper.iter().enumerate();
        let paper =
            paper.map(|(at, point)| (point, if front.best_paper == Some(at) { "paper's best" } else { "paper" }));
        let found = front.points.iter().enumerate();
        let found = found.map(|(at, point)| (point, if front.winner == Some(at) { "winner" } else { "found" }));
        let has_held_out = self.held_out.is_some();
        let shown = SCORES.into_iter().filter(|(name, _)| has_held_out || *name != "held_out");
        Table::of(paper.chain(found))
            .column("description", |(point, _)| name_of(&point.candidate, point.parameters))
            .column("parameters", |(point, _)| point.parameters)
            .column("", |(_, kind)| kind)
            .columns(
                shown,
                |(name, _)| name.replace('_', " "),
                |(point, _), (_, of)| of(&point.judged).map_or(String::new(), |scored| with_interval(&scored)),
            )
            .column(
                "against the paper's best",
                |(point, kind)| if kind.starts_with("paper") { "" } else { point.verdict() },
            )
            .build()
            .captioned(format!("{}, {}", self.goal(), front.scope.name()))
    }

    /// The answer for the terminal.
    pub fn text(&self) -> String {
        self.words(true)
    }

    /// The answer, with the table of the first front or without it.
    fn words(&self, with_table: bool) -> String {
        let result = self.result;
        let models: Vec<&str> = result.options.models.iter().map(|model| model.name()).collect();
        let mut text = paragraph(&self.data);
        if let Some(held_out) = &self.held_out {
            text += &paragraph(&format!("held out: {held_out}, {} scenarios", self.result.scenarios[1]));
        }
        text.push('\n');
        text += &paragraph(&format!(
            "{} studies of {} {}s ({} lanes each); goal: {} for {}; {} folds {}",
            count(result.studies as u64),
            result.scenarios[0],
            result.category.label(),
            count(result.lanes),
            self.goal(),
            models.join(", "),
            result.options.limits.folds,
            match result.is_by_recording {
                true => "by recording",
                false => "by stretches of time, because there are fewer recordings",
            }
        ));
        if result.options.shuffled {
            text += "SHUFFLED OUTCOMES: every scenario has those of another one; no number below says anything of a description\n";
        }
        if let Some(front) = result.fronts.first() {
            if with_table {
                let _ = writeln!(text, "\n{}", self.table(front).fitted(1, WIDTH));
            }
            for point in &front.points {
                text += &paragraph(&format!("found {}: {}", point.parameters, self.describe(&point.candidate)));
            }
            text.push('\n');
            if let Some(winner) = front.winner.map(|at| &front.points[at]) {
                let margin = result.options.limits.margin;
                let rule = match winner.below_best {
                    Some((_, interval)) if interval.low >= -margin => {
                        format!("fewest parameters whose score is shown to be at most {margin} below the best")
                    }
                    // The best itself cannot be sampled, and nothing smaller is shown to be close to it.
                    Some(_) => {
                        "most parameters of those that can be sampled; not shown to be close to the best".to_owned()
                    }
                    None => {
                        format!("fewest parameters whose score is at most {margin} below the best, without interval")
                    }
                };
                text += &paragraph(&format!(
                    "winner ({rule}): {} parameters, {}, {} cross-validated{}",
                    winner.parameters,
                    self.describe(&winner.candidate),
                    with_interval(&winner.judged.cross_validated),
                    winner.judged.held_out.map_or(String::new(), |of| format!(", {} held out", with_interval(&of)))
                ));
                let gains = if winner.held_out_gains.is_empty() { &winner.gains } else { &winner.held_out_gains };
                let gains = gains.iter().map(|(model, gain)| {
                    gain.map_or(format!("{} undefined", model.name()), |(by, i)| {
                        format!("{} {by:+.3} [{:+.2}, {:+.2}]", model.name(), i.low, i.high)
                    })
                });
                let gains: Vec<String> = gains.collect();
                let on = if winner.held_out_gains.is_empty() { "cross-validated" } else { "held out" };
                text += &paragraph(&format!("against the paper's best, {on}: {}", gains.join("; ")));
            }
        }
        if let Some([Some(baseline), held_out]) = result.fronts.first().map(|front| front.headway_only) {
            let held_out = held_out.map_or(String::new(), |held_out| format!(", {held_out:.3} held out"));
            let _ = writeln!(text, "for comparison: an S' that knows the headway only has {baseline:.3}{held_out}");
        }
        if let Some(correlation) = result.rmse.correlation {
            let by_size: Vec<String> =
                result.rmse.by_size.iter().map(|(size, rho)| format!("{size}: {rho:+.2}")).collect();
            text += &paragraph(&format!(
                "rank correlation of RMSE and {} over {} candidates: {correlation:+.2} (-1: the error of the motions \
                 orders them as the outcomes do); among those of equal size {}",
                result.options.objective.name(),
                count(result.evaluated.len() as u64),
                by_size.join(", ")
            ));
        }
        if let Some([close, far]) = &result.rmse.disagreement {
            let of = |of: &Evaluated| {
                let score = of.score(Scope::All, &result.options).unwrap_or(f64::NAN);
                format!("{} (RMSE {:.2}, {score:.3})", self.describe(&of.candidate), of.rmse)
            };
            text += &paragraph(&format!("worst pair: {} against {}", of(close), of(far)));
        }
        let largest = result.options.limits.max_parameters;
        let lost = result.unkept.iter().filter(|of| of.parameters == largest).count();
        let _ = writeln!(
            text,
            "{} of {} scenarios are wrong in some lane under every description of the front (unkept.csv)",
            lost, result.scenarios[0]
        );
        if self.synthetic {
            text += "SYNTHETIC DATA: no number above is a statement about real traffic\n";
        }
        text
    }

    fn front_figure(&self) -> Figure {
        let value = |parameters: usize, scored: &Scored, tip: String| {
            scored.value.map(|y| Value {
                x: parameters as f64,
                y,
                interval: scored.interval.map(|i| (i.low, i.high)),
                tip,
                ..Value::default()
            })
        };
        let look = |colour, symbol| Look { colour, symbol, ..Look::of(0, 1) };
        let points = |front: &Front| front.paper.iter().chain(&front.points).map(|point| point.parameters).max();
        let most = self.result.fronts.iter().filter_map(points).max().unwrap_or(1);
        let plot = |front: &Front| {
            let paper = front.paper.iter().filter_map(|point| {
                let scored = point.judged.held_out.as_ref().unwrap_or(&point.judged.cross_validated);
                let value = value(point.parameters, scored, self.describe(&point.candidate))?;
                Some(Value { label: name_of(&point.candidate, point.parameters), interval: None, ..value })
            });
            let found = |of: &dyn Fn(&Judged) -> Option<Scored>| -> Vec<Value> {
                let values = front
                    .points
                    .iter()
                    .filter_map(|point| value(point.parameters, &of(&point.judged)?, self.describe(&point.candidate)));
                values.collect()
            };
            let marks = &[Mark::Line, Mark::Points, Mark::Intervals];
            let cross_validated = found(&|judged| Some(judged.cross_validated));
            let mut series = vec![
                Series::new("paper", &[Mark::Points], paper).with_look(look(PAPER, Symbol::Disc)),
                Series::new("found, cross-validated", marks, cross_validated).with_look(look(FRONT, Symbol::Disc)),
            ];
            if self.held_out.is_some() {
                let values = found(&|judged| judged.held_out).into_iter().map(|v| Value { x: v.x + 0.12, ..v });
                let look = look(HELD_OUT, Symbol::Polygon(3, 0.0));
                series.push(Series::new("found, held-out data", marks, values).with_look(look));
            }
            Plot {
                heading: front.scope.name(),
                x: PlotAxis { is_count: true, ..PlotAxis::exactly("parameters", 0.0, most as f64 + 1.0) },
                y: PlotAxis::exactly(self.result.options.objective.name(), 0.0, 1.0),
                series,
                ..Plot::default()
            }
        };
        let paper = if self.held_out.is_some() { "on held-out data" } else { "cross-validated" };
        Figure {
            title: format!("{}: {} against parameters", self.result.category.label(), self.goal()),
            subtitle: Some(self.data.clone()),
            plots: self.result.fronts.iter().map(plot).collect(),
            caption: format!(
                "Each point: the best description of its size that this search found by cross-validation, with its interval over scenarios if it is known. \
                 Grey: the paper's parameterizations by their keys, {paper}. The duration counts as a parameter."
            ),
            ..Figure::default()
        }
    }

    /// Error against score: the paper's parameterizations, and others in even steps of their scores.
    fn error_figure(&self) -> Figure {
        let options = &self.result.options;
        let score = |of: &Evaluated| of.score(Scope::All, options);
        let all = self.result.evaluated.iter();
        let mut drawn: Vec<(String, f64, &Evaluated)> =
            all.filter_map(|of| Some((of.candidate.family(), score(of)?, of))).collect();
        // Evenly over all, in the order of the score.
        drawn.sort_by(|a, b| b.1.total_cmp(&a.1));
        let stride = drawn.len().div_ceil(MAX_DRAWN).max(1);
        let drawn = drawn.into_iter().enumerate().filter(|(at, (family, ..))| family == "paper" || at % stride == 0);
        let drawn: Vec<_> = drawn.map(|(_, of)| of).collect();
        let mut families: Vec<String> = drawn.iter().map(|of| of.0.clone()).collect();
        families.sort();
        families.dedup();
        let series = families.iter().map(|family| {
            let values = drawn.iter().filter(|of| of.0 == *family).map(|(_, value, of)| Value {
                x: of.rmse,
                y: *value,
                tip: self.describe(&of.candidate),
                ..Value::default()
            });
            Series::new(family.clone(), &[Mark::Points], values)
        });
        let all = count(self.result.evaluated.len() as u64);
        let plot = Plot {
            x: PlotAxis::new("root mean square error of the motions, standard deviations"),
            y: PlotAxis::exactly(format!("{}, {}", self.goal(), Scope::All.name()), 0.0, 1.0),
            series: series.collect(),
            ..Plot::default()
        };
        Figure {
            title: format!("{}: the error of the motions and the outcomes", self.result.category.label()),
            subtitle: Some(self.data.clone()),
            plots: vec![plot],
            caption: match stride {
                1 => format!("{all} candidates, cross-validated."),
                _ => format!(
                    "{all} candidates, cross-validated; one in {stride} is drawn, evenly by score, and the paper's."
                ),
            },
            ..Figure::default()
        }
    }

    fn candidates(&self) -> Table {
        let options = &self.result.options;
        let scopes: Vec<Scope> = self.result.fronts.iter().map(|front| front.scope).collect();
        let mut rows: Vec<&Evaluated> = self.result.evaluated.iter().collect();
        let score = |of: &Evaluated| of.score(Scope::All, options).unwrap_or(-1.0);
        rows.sort_by(|a, b| a.parameters.cmp(&b.parameters).then_with(|| score(b).total_cmp(&score(a))));
        Table::of(rows)
            .column("family", |of| of.candidate.family())
            .column("parameters", |of| of.parameters)
            .column("rmse", |of| of.rmse)
            .columns(
                scopes,
                |scope| format!("score_{}", scope.name().replace(' ', "_")),
                |of, scope| of.score(scope, options),
            )
            .column("candidate", |of| serde_json::to_string(&of.candidate).unwrap_or_default())
            .build()
    }

    fn front_csv(&self) -> Table {
        let category = self.result.category;
        let rows = self.result.fronts.iter().flat_map(|front| {
            let paper = front.paper.iter().map(move |point| (front.scope, "paper", point));
            paper.chain(front.points.iter().map(move |point| (front.scope, "found", point)))
        });
        let ends: [NamedValue<Scored, Option<f64>>; 3] = [
            ("", |scored| scored.value),
            ("_low", |scored| scored.interval.map(|i| i.low)),
            ("_high", |scored| scored.interval.map(|i| i.high)),
        ];
        let columns = SCORES.into_iter().flat_map(|score| ends.map(|end| (score, end)));
        Table::of(rows)
            .column("models", |(scope, ..)| scope.name())
            .column("origin", |(_, origin, _)| origin)
            .column("parameters", |(.., point)| point.parameters)
            .column("rmse", |(.., point)| point.rmse)
            .columns(
                columns,
                |((score, _), (end, _))| format!("{score}{end}"),
                |(.., point), ((_, of), (_, end))| of(&point.judged).and_then(|scored| end(&scored)),
            )
            .column("description", |(.., point)| point.candidate.describe(category))
            .column("data", |_| self.data.as_str())
            .build()
    }

    fn unkept(&self) -> Table {
        Table::of(self.result.unkept.iter())
            .column("max_parameters", |of| of.parameters)
            .column("scenario", |of| of.scenario.as_str())
            .column("wrong_lanes", |of| of.lanes)
            .build()
    }

    /// The record as JSON; `files` are in the same folder.
    ///
    /// # Errors
    /// None for a record of this program.
    pub fn json(&self, files: &ResultFiles) -> Result<String> {
        let result = self.result;
        let winner = result.fronts.first().and_then(|front| Some(&front.points[front.winner?]));
        records::document(&json!({
            "program": PROGRAM,
            "search_sha256": result.sha256,
            "command": self.command,
            "data": self.data,
            "scenarios_sha256": self.scenarios_sha256[0],
            "held_out": self.held_out,
            "held_out_sha256": self.scenarios_sha256.get(1),
            "synthetic": self.synthetic,
            "profile": self.profile,
            "category": result.category.key(),
            "models": result.options.models.iter().map(|model| model.name()).collect::<Vec<_>>(),
            "criterion": result.options.criterion.key(),
            "objective": result.options.objective.name(),
            "shuffled": result.options.shuffled,
            "headways": result.options.headways.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "limits": result.options.limits,
            "scenarios": result.scenarios[0],
            "held_out_scenarios": result.scenarios[1],
            "studies": result.studies,
            "lanes_per_study": result.lanes,
            "rank_correlation_rmse_score": result.rmse.correlation,
            "rank_correlation_by_parameters": result.rmse.by_size,
            "winner": winner.map(|point| json!({
                "parameters": point.parameters,
                "description": self.describe(&point.candidate),
                "cross_validated": point.judged.cross_validated.value,
                "in_sample": point.judged.in_sample.value,
                "held_out": point.judged.held_out.and_then(|of| of.value),
                "against_the_papers_best": point.verdict(),
            })),
            "folds_are_recordings": result.is_by_recording,
            "fronts": self.front_csv().records(),
            "settings": self.host.settings,
            "files": files.files,
            "files_sha256": files.files_sha256,
            "host": self.host,
        }))
    }

    fn page(&self, figures: &[(&str, PageFigure)]) -> String {
        let of = |name| figures.iter().find(|(of, _)| *of == name).map(|(_, figure)| figure.clone());
        let answer = Section::new("answer", "Answer")
            .text(self.words(false))
            .tables(self.result.fronts.iter().take(1).map(|front| self.table(front)))
            .figures(of("front"));
        let kept = (!self.modes.is_empty()).then(|| {
            let intro = "What the winner keeps, as scenarios one standard deviation of a parameter away from the mean.";
            Section::new("winner", "The winner").intro(intro).figures(of("winner"))
        });
        let described = |front: &Front| -> String {
            let line =
                |point: &FrontPoint| format!("  found {}: {}\n", point.parameters, self.describe(&point.candidate));
            format!("{}\n{}", front.scope.name(), front.points.iter().map(line).collect::<String>())
        };
        let tables = Section::new("fronts", "Fronts")
            .text(self.result.fronts.iter().map(described).collect::<Vec<_>>().join("\n"))
            .tables(self.result.fronts.iter().map(|front| self.table(front)));
        let error = Section::new("error", "Error and outcomes").figures(of("error"));
        let lost = self.result.unkept.iter().filter(|of| of.parameters == self.result.options.limits.max_parameters);
        let lost: String =
            lost.take(50).map(|of| format!("{}: {}\n", of.scenario, counted(of.lanes as usize, "lane"))).collect();
        let unkept = Section::new("unkept", "What no description keeps")
            .intro(
                "Scenarios with a wrong verdict under every description of the front, and the lanes of the best; at \
                 most 50 are listed.",
            )
            .text(lost);
        let reproduction = Section::new("reproduction", "Reproduction")
            .fact("program", PROGRAM)
            .fact("command", &self.command)
            .fact("profile", &self.profile.name)
            .host([self.host.computed_by()]);
        Page {
            title: format!("Search for a parameterization: {}", self.result.category.label()),
            lead: format!("{} studies. {}", count(self.result.studies as u64), self.data),
            synthetic: self.synthetic,
            warnings: Vec::new(),
            sections: std::iter::once(answer).chain(kept).chain([tables, error, unkept, reproduction]).collect(),
        }
        .html()
    }

    /// Writes all files, the record last; returns the names of the others.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write(&self, mut results: Results) -> Result<ResultFiles> {
        let mut figures = vec![("front", self.front_figure()), ("error", self.error_figure())];
        if !self.modes.is_empty() {
            let figure = Figure {
                title: format!("{}: what the winner keeps", self.result.category.label()),
                caption: "Lines: the mean of the scenarios, and the scenario one standard deviation of a parameter \
                          away from it, for the first three."
                    .to_owned(),
                ..modes(self.result.category, &self.modes, &[], &self.data)
            };
            figures.push(("winner", figure));
        }
        let mut drawn = Vec::new();
        for (name, figure) in figures {
            let (file, svg) = (format!("{name}.svg"), figure.svg());
            results.add(&file, svg.as_bytes())?;
            results.add(&format!("{name}.csv"), figure.csv().as_bytes())?;
            drawn.push((name, PageFigure::new(&svg, &[&file])));
        }
        results.add("fronts.csv", self.front_csv().csv().as_bytes())?;
        results.add("candidates.csv", self.candidates().csv().as_bytes())?;
        results.add("unkept.csv", self.unkept().csv().as_bytes())?;
        if let Some(winner) = &self.result.winner {
            results.add("winner.json", &winner.to_json(&self.data)?)?;
        }
        results.add("report.txt", self.text().as_bytes())?;
        results.add("report.html", self.page(&drawn).as_bytes())?;
        publish(results, |files| self.json(files))
    }
}
