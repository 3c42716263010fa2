//! A comparison of failure rates as text and files.

use std::fmt::Write;

use super::dots::{DotRow, Dots, dots};
use super::host::Host;
use super::html::{Page, PageFigure, Section};
use super::plot::{AxisScale, Figure, INK, Look, PlotAxis, Series, Symbol, Value, logarithmic_reach};
use super::records::{PROGRAM, document, publish, record};
use super::tables::{CloseRow, WIDTH, close_following, paragraph};
use crate::Result;
use crate::engine::Headway;
use crate::model::criterion::Criterion;
use crate::run::compare::Compare;
use crate::run::sampling::{
    CategoryComparison, ComparedCell, ComparedParameterization, RateRecord, RecordedCell, RiskRate, Uncertainty,
};
use crate::run::score::f1;
use crate::scenario::DataProvenance;
use crate::stats::density::{DensityKind, Representativeness, normal_quantile};
use crate::stats::estimate::{Enough, Ratio, RatioVerdict};
use crate::support::readable;
use crate::support::run_folder::{ResultFiles, Results};
use crate::support::table::{Column, Digits, NamedValue, NumberText, Table};

/// A comparison with the facts that its files state.
pub struct CompareReport<'a> {
    /// What was compared.
    pub compare: &'a Compare<'a>,
    /// The rates, category by category.
    pub categories: Vec<CategoryComparison>,
    /// Skipped recordings and parameterizations, with reasons.
    pub left_out: Vec<String>,
    /// The machine.
    pub host: Host,
}

impl CompareReport<'_> {
    fn headways(&self) -> &[Headway] {
        &self.compare.lane_plan().headways
    }

    /// Writes tables, figures and page to their folder, the record last; returns the names of the other files.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write(&self, mut results: Results) -> Result<ResultFiles> {
        results.add("compare.csv", self.csv().as_bytes())?;
        results.add("compare.txt", self.text().as_bytes())?;
        let mut figures = Vec::new();
        for comparison in &self.categories {
            for criterion in Criterion::ALL {
                for (kind, figure) in [
                    ("ratios", ratios(self.compare, comparison, criterion)),
                    ("rates", rates(self.compare, comparison, criterion)),
                ] {
                    let name = format!("{kind}-{}-{}", comparison.category.key(), criterion.key());
                    figures.push(PageFigure::add_svg(&mut results, &name, &figure.svg(), "compare.csv")?);
                }
            }
        }
        results.add("report.html", self.html(figures).as_bytes())?;
        publish(results, |files| self.json(files))
    }

    /// `compare.json`; `files` are in the same folder.
    ///
    /// # Errors
    /// None for a record of this program.
    pub fn json(&self, files: &ResultFiles) -> Result<String> {
        let (plan, options) = (self.compare.lane_plan(), self.compare.options());
        let DataProvenance { data, synthetic, scenarios_sha256, driven } = self.compare.provenance();
        document(&record! {
            lanesweep_comparison: 1,
            program: PROGRAM,
            data: &data,
            synthetic: *synthetic,
            scenarios_sha256: &scenarios_sha256,
            driven: &driven,
            profile: &plan.profile,
            models: &plan.models,
            headways: plan.headways.iter().map(Headway::to_string).collect::<Vec<_>>(),
            samples: options.samples,
            seed: options.seed,
            level: Compare::LEVEL,
            enough: options.enough,
            study_plan_sha256: plan.hash(),
            left_out: &self.left_out,
            categories: &self.categories,
            settings: &self.host.settings,
            #[serde(flatten)]
            files: files,
            host: &self.host,
        })
    }

    /// `compare.csv`: one row per category, parameterization, model and criterion.
    fn csv(&self) -> String {
        let rows = self.categories.iter().flat_map(|category| {
            category.parameterizations.iter().flat_map(move |of| {
                let cells = category.recorded.iter().zip(&of.cells);
                cells.map(move |(s, cell)| (category.category, of, s, &cell.replayed, &cell.sampled))
            })
        });
        let risks: [NamedValue<RiskRate, f64>; 2] =
            [("", |risk| risk.estimate), ("_sd", |risk| risk.standard_deviation)];
        let ends: [NamedValue<RateRecord, f64>; 3] = [("rate", |r| r.rate), ("low", |r| r.low), ("high", |r| r.high)];
        let ratios: [NamedValue<Ratio, Option<f64>>; 3] =
            [("ratio", |r| r.ratio), ("ratio_low", |r| r.low), ("ratio_high", |r| r.high)];
        let first =
            self.categories.iter().flat_map(|category| &category.parameterizations).find(|of| !of.forms.is_empty());
        let forms: Vec<DensityKind> = first.map_or(Vec::new(), |of| of.forms.iter().map(|other| other.form).collect());
        Table::of(rows)
            .column("category", |(category, ..)| category.key())
            .column("parameterization", |(_, of, ..)| of.key.as_str())
            .column("parameters", |(_, of, ..)| of.parameters)
            .column("model", |(_, _, s, ..)| s.model.name())
            .column("criterion", |(_, _, s, ..)| s.criterion.key())
            .columns(ends, |(name, _)| format!("s_{name}"), |(_, _, s, ..), (_, end)| end(&s.rate))
            .column("s_failures", |(_, _, s, ..)| s.rate.failures)
            .column("s_lanes", |(_, _, s, ..)| s.rate.lanes)
            .column("s_failing_scenarios", |(_, _, s, ..)| s.failing_scenarios)
            .columns(ends, |(name, _)| format!("s_prime_{name}"), |(.., of, _), (_, end)| end(&of.rate))
            .columns(ratios, |(name, _)| format!("s_prime_{name}"), |(.., of, _), (_, end)| end(&of.ratio))
            .column("s_prime_verdict", |(.., replayed, _)| replayed.ratio.verdict.text())
            .column("f1", |(.., replayed, _)| f1(&replayed.labels))
            .columns(ends, |(name, _)| format!("density_{name}"), |(.., of), (_, end)| end(&of.rate))
            .column("density_low_with_data", |(.., sampled)| sampled.with_data[0])
            .column("density_high_with_data", |(.., sampled)| sampled.with_data[1])
            .column("density_failures", |(.., sampled)| sampled.rate.failures)
            .column("density_lanes", |(.., sampled)| sampled.rate.lanes)
            .columns(ratios, |(name, _)| name, |(.., of), (_, end)| end(&of.ratio))
            .column("verdict", |(.., sampled)| sampled.ratio.verdict.text())
            .columns(
                forms.iter().flat_map(|form| ends.map(|end| (*form, end))),
                |(form, (name, _))| format!("{}_{name}", form.key()),
                |(_, of, s, ..), (form, (_, end))| {
                    let at = of.cells.iter().position(|cell| (cell.model, cell.criterion) == (s.model, s.criterion))?;
                    of.forms.iter().find(|other| other.form == form).map(|other| end(&other.rates[at]))
                },
            )
            .columns(risks, |of| format!("s_per_hour{}", of.0), |(_, _, s, ..), of| s.risk.per_hour.as_ref().map(of.1))
            .columns(
                risks,
                |of| format!("s_per_1000_km{}", of.0),
                |(_, _, s, ..), of| s.risk.per_1000_km.as_ref().map(of.1),
            )
            .columns(risks, |of| format!("density_per_hour{}", of.0), |(.., s), of| s.risk.per_hour.as_ref().map(of.1))
            .columns(
                risks,
                |of| format!("density_per_1000_km{}", of.0),
                |(.., s), of| s.risk.per_1000_km.as_ref().map(of.1),
            )
            .column("data", |_| self.compare.provenance().data.as_str())
            .build()
            .csv()
    }

    /// The tables for the terminal, at most 120 columns wide; only a long word in the data's description (a path) can
    /// exceed this.
    pub fn text(&self) -> String {
        let provenance = self.compare.provenance();
        let mut text = format!("{}\n{}", paragraph(&provenance.data), paragraph(&self.rule()));
        for category in &self.categories {
            let _ = writeln!(
                text,
                "\n{}: {} scenarios from {} (S); {} samples of each density from {}",
                category.category.label(),
                readable::count(category.scenarios),
                if self.is_observed() {
                    "their recorded gaps".to_owned()
                } else {
                    format!("{} headways", self.headways().len())
                },
                readable::count(self.compare.options().samples),
                if self.is_observed() { "drawn headways" } else { "the same" }
            );
            for criterion in Criterion::ALL {
                text.push_str(&self.block(category, criterion));
            }
            text.push_str(&summary(category));
            text.push_str(&goodness(category));
            text.push_str(&uncertainty(category));
        }
        let close = self.categories.iter().filter_map(|comparison| {
            let close = comparison.close_following.as_ref()?;
            Some(CloseRow { category: comparison.category, models: &self.compare.lane_plan().models, close })
        });
        let close = close_following(&close.collect::<Vec<_>>(), "S", self.headways(), WIDTH);
        text.extend((!close.is_empty()).then(|| format!("\n{close}")));
        for reason in &self.left_out {
            let _ = write!(text, "\n{}", paragraph(&format!("left out: {reason}")));
        }
        if provenance.synthetic {
            text.push_str("\nSYNTHETIC DATA: no number above is a statement about real traffic\n");
        }
        text
    }

    /// The comparison as one page with these figures.
    fn html(&self, figures: Vec<PageFigure>) -> String {
        let (plan, options, provenance) = (self.compare.lane_plan(), self.compare.options(), self.compare.provenance());
        let left_out = format!("{} parts were left out; see the end of Rates.", self.left_out.len());
        let mut figures = figures.into_iter();
        let per_category = 2 * Criterion::ALL.len();
        let shown = self.categories.iter().map(|category| {
            let title = format!("{}: failures of S' and of densities beside S", category.category.label());
            Section::new(category.category.key(), title)
                .figures(figures.by_ref().take(per_category))
                .parts([Section::new("", "Every ratio").tables([ratio_table(category)])])
        });
        let rates = Section::new("rates", "Rates and their ratios").text(self.text()).folded();
        let reproduction = Section::new("reproduction", "Reproduction")
            .intro(
                "The same scenarios, flags and seed give the same numbers, on any machine. compare.json holds all of \
                 it.",
            )
            .fact("program", PROGRAM)
            .fact("profile", &plan.profile.name)
            .fact("seed", options.seed.to_string())
            .fact("samples of each density", readable::count(options.samples))
            .fact("SHA-256 of the scenarios", &provenance.scenarios_sha256)
            .fact("SHA-256 of the plan of S and S'", plan.hash())
            .host([self.host.computed_by(), self.host.wall_clock()]);
        Page {
            title: "Rates of failure: recorded, replayed, drawn".to_owned(),
            lead: provenance.data.clone(),
            synthetic: provenance.synthetic,
            warnings: if self.left_out.is_empty() { Vec::new() } else { vec![left_out] },
            sections: shown.chain([rates, reproduction]).collect(),
        }
        .html()
    }

    /// Whether scenarios start from their recorded gaps.
    fn is_observed(&self) -> bool {
        Headway::is_observed(self.headways())
    }

    /// How to read a cell.
    fn rule(&self) -> String {
        let Enough { clusters, margin } = self.compare.options().enough;
        format!(
            "A cell is: failed share of the lanes, its ratio to S, the ratio's {:.0} % interval, verdict. = agrees: the \
             interval lies within {:.2} … {margin}. > too high, < too low: it lies on one side of 1 and reaches \
             beyond. ? undecided: it contains 1 and is wider. Also undecided: one side has fewer than {clusters} \
             failing scenarios, and the intervals of both rates overlap. S' is replayed, density is drawn{}. \
             S /h and S /1000 km are its failures per hour and distance driven ± one standard deviation, {}. Scenarios are the clusters of every interval; S, S' and the densities rest on the same scenarios, \
             so the ratio is taken scenario by scenario, and what hard or easy scenarios do to both sides cancels. It \
             says whether these scenarios are represented, not whether they are enough. Of cells whose ratio is 1, at \
             most 1 in 20 is marked too high or too low by chance. Risks \
             have the ratios of the rates: S and densities have the same exposure.",
            100.0 * Compare::LEVEL,
            1.0 / margin,
            match self.categories.iter().flat_map(|of| &of.parameterizations).any(|of| !of.forms.is_empty()) {
                true =>
                    " (Gaussian kernels), mixture and copula are other forms of it: n of it is their rate over the density's",
                false => "",
            },
            if self.is_observed() { "from the recorded gaps" } else { "from headways that are imposed, not observed" }
        )
    }

    /// The table of one criterion: a row for S, its risk, and two rows per parameterization; a column per model.
    fn block(&self, category: &CategoryComparison, criterion: Criterion) -> String {
        let recorded: Vec<&RecordedCell> = category.recorded.iter().filter(|c| c.criterion == criterion).collect();
        let rate = |r: &RateRecord| {
            let range = if r.failures == 0 { format!("≤ {}", short(r.high)) } else { range(r.low, r.high) };
            format!("{} {range}", short(r.rate))
        };
        let mut rows: Vec<(String, Vec<String>)> =
            vec![("S".to_owned(), recorded.iter().map(|c| rate(&c.rate)).collect())];
        let risk = |r: RiskRate| match r.estimate {
            // Without an observed failure the rate may still be above 0.
            e if e > 0.0 => format!("{} ± {}", short(e), short(r.standard_deviation)),
            _ => format!("≤ {}", short(r.high)),
        };
        let risks: [NamedValue<RecordedCell, Option<RiskRate>>; 2] =
            [("S /h", |c| c.risk.per_hour), ("S /1000 km", |c| c.risk.per_1000_km)];
        for (name, pick) in risks {
            let values: Option<Vec<String>> = recorded.iter().map(|c| pick(c).map(risk)).collect();
            rows.extend(values.map(|values| (name.to_owned(), values)));
        }
        for of in &category.parameterizations {
            let cells = || of.cells.iter().filter(|c| c.criterion == criterion);
            let replayed = cells().map(|c| cell(&c.replayed.rate, &c.replayed.ratio)).collect();
            let sampled = cells().map(|c| cell(&c.sampled.rate, &c.sampled.ratio)).collect();
            rows.extend([(format!("{} S'", of.key), replayed), (format!("{} density", of.key), sampled)]);
            for other in &of.forms {
                let cells = of.cells.iter().zip(&other.rates).filter(|(c, _)| c.criterion == criterion);
                let cells = cells.map(|(c, rate)| match rate.rate / c.sampled.rate.rate {
                    of_kernel if of_kernel.is_finite() => format!("{} {} of it", short(rate.rate), factor(of_kernel)),
                    _ => short(rate.rate),
                });
                rows.push((format!("{} {}", of.key, other.form.key()), cells.collect()));
            }
        }
        let models = self.compare.lane_plan().models.iter().enumerate();
        let table = Table::of(&rows).column(criterion.label(), |(name, _)| name.as_str()).columns(
            models,
            |(_, model)| model.name(),
            |(_, cells), (at, _)| cells.get(at).cloned().map(NumberText),
        );
        table.build().text() + "\n"
    }
}

/// Every cell of a category.
fn ratio_table(category: &CategoryComparison) -> Table {
    let rows = category
        .parameterizations
        .iter()
        .flat_map(|of| category.recorded.iter().zip(&of.cells).map(move |(s, cell)| (of, s, cell)));
    let ratio = |ratio: &Ratio| ratio.ratio.map(|value| NumberText(format!("{} {}", factor(value), ends(ratio))));
    Table::of(rows)
        .column("criterion", |(_, s, _)| s.criterion.label())
        .column("model", |(_, s, _)| s.model.name())
        .column("parameterization", |(of, ..)| of.key.as_str())
        .column("share of S", |(_, s, _)| NumberText(short(s.rate.rate)))
        .column("n", |(_, s, _)| s.failing_scenarios)
        .column(Column::from("S' / S").null("–"), |(.., cell)| ratio(&cell.replayed.ratio))
        .column("S'", |(.., cell)| cell.replayed.ratio.verdict.text())
        .column(Column::from("density / S").null("–"), |(.., cell)| ratio(&cell.sampled.ratio))
        .column("density", |(.., cell)| cell.sampled.ratio.verdict.text())
        .build()
        .captioned(format!("Ratios to S with their {} % intervals; n: failing scenarios of S", 100.0 * Compare::LEVEL))
}

/// What the risk of a category is uncertain by, over all its parameterizations and forms.
fn uncertainty(category: &CategoryComparison) -> String {
    let rows: Vec<(&RecordedCell, Option<&Uncertainty>)> =
        category.recorded.iter().zip(&category.uncertainty).map(|(s, of)| (s, of.as_ref())).collect();
    if rows.iter().all(|(_, of)| of.is_none()) {
        return String::new();
    }
    let parts: [NamedValue<Uncertainty, Option<f64>>; 5] = [
        ("draws", |u| Some(u.draws)),
        ("scenarios", |u| Some(u.scenarios)),
        ("frequency", |u| Some(u.exposure)),
        ("form", |u| u.form),
        ("parameterization", |u| u.parameterization),
    ];
    let z = normal_quantile(0.5 + 0.5 * Compare::LEVEL);
    let table = Table::of(rows)
        .column("risk uncertain by", |(s, _)| s.model.name())
        .column("criterion", |(s, _)| s.criterion.key())
        .column(Column::from("factor").digits(Digits::Significant(3)).null("-"), |(_, of)| {
            of.map(|of| libm::exp(z * of.deviation))
        })
        .columns(
            parts,
            |(name, _)| Column::from(format!("{name} %")).digits(Digits::Fixed(0)).null("-"),
            |(_, of), (_, pick)| of.and_then(pick).map(|part| 100.0 * part),
        );
    let rule = format!(
        "Factor: the {:.0} % interval of the risk, whichever of the densities above it comes from, is about from 1/factor \
         to factor times their geometric mean. The parts are those of the variance of its logarithm; form and \
         parameterization (- where only one was sampled) are the spread of the densities' rates, less the draws: rough \
         figures, because they rest on a few choices. A rate without failures counts as its upper bound, so it \
         understates the spread; - in a whole row: no density fails.",
        100.0 * Compare::LEVEL
    );
    format!("\n{}{}", table.build().text(), paragraph(&rule))
}

/// Per parameterization and form: how well the density represents unseen scenarios. Empty unless forms were compared.
fn goodness(category: &CategoryComparison) -> String {
    type Row<'a> = (&'a str, DensityKind, usize, Option<&'a Representativeness>);
    let rows = category.parameterizations.iter().filter(|of| !of.forms.is_empty()).flat_map(|of| {
        let kernel = (of.key.as_str(), DensityKind::Kernel, of.kernels, of.goodness.as_ref());
        let others = of.forms.iter().map(|form| (of.key.as_str(), form.form, form.components, form.goodness.as_ref()));
        std::iter::once(kernel).chain(others)
    });
    let rows: Vec<Row> = rows.collect();
    if rows.is_empty() {
        return String::new();
    }
    let figures: [NamedValue<Representativeness, Option<f64>>; 3] = [
        ("log-likelihood", |r| r.log_likelihood),
        ("W(gen, test)", |r| Some(r.generated_test)),
        ("Sinkhorn", |r| r.sinkhorn),
    ];
    let table = Table::of(&rows)
        .column("unseen scenarios", |(key, ..)| *key)
        .column("form", |(_, form, ..)| form.key())
        .column("components", |(_, _, components, _)| *components)
        .columns(
            figures,
            |(name, _)| Column::from(name).digits(Digits::Significant(4)).null("-"),
            |(.., of), (_, pick)| of.and_then(pick),
        );
    format!("\n{}", table.build().text())
}

fn cell(rate: &RateRecord, ratio: &Ratio) -> String {
    let mark = ratio.verdict.mark();
    let Some(value) = ratio.ratio else {
        // S never fails: only the lower end is finite.
        let low = ratio.low.filter(|low| *low > 0.0).map_or(String::new(), |low| format!("{}… ", factor(low)));
        return format!("{} {low}{mark}", short(rate.rate));
    };
    format!("{} {} {} {mark}", short(rate.rate), factor(value), ends(ratio))
}

fn ends(ratio: &Ratio) -> String {
    match (ratio.low, ratio.high) {
        (Some(low), Some(high)) => format!("{}…{}", factor(low), factor(high)),
        (Some(low), None) => format!("{}…", factor(low)),
        _ => String::new(),
    }
}

/// Per parameterization: F1 label and verdict on the rate.
fn summary(category: &CategoryComparison) -> String {
    let marks: String = RatioVerdict::ALL.iter().map(|v| format!(" {}", v.mark())).collect();
    type Pick = fn(&ComparedCell) -> &Ratio;
    let verdicts = |of: &ComparedParameterization, pick: Pick| {
        let count = |v| of.cells.iter().filter(|c| pick(c).verdict == v).count();
        NumberText(RatioVerdict::ALL.map(|v| format!("{:2}", count(v))).join(" "))
    };
    let ends = |of: &ComparedParameterization| {
        let decided = of.cells.iter().map(|c| &c.sampled.ratio).filter(|r| r.verdict != RatioVerdict::Undecided);
        let mut ratios: Vec<f64> = decided.filter_map(|r| r.ratio).collect();
        ratios.sort_by(f64::total_cmp);
        let (low, high) = ratios.first().zip(ratios.last())?;
        Some(NumberText(range(*low, *high)))
    };
    Table::of(&category.parameterizations)
        .column("cells of each verdict", |of| of.key.as_str())
        .column("parameters", |of| of.parameters)
        .column(Column::from("mean F1 of its defined cells").digits(Digits::Fixed(3)).null("-"), |of| {
            let scores: Vec<f64> = of.cells.iter().filter_map(|c| f1(&c.replayed.labels)).collect();
            (!scores.is_empty()).then(|| scores.iter().sum::<f64>() / scores.len() as f64)
        })
        .column(format!("S'{marks}"), |of| verdicts(of, |c| &c.replayed.ratio))
        .column(format!("density{marks}"), |of| verdicts(of, |c| &c.sampled.ratio))
        .column(Column::from("ratios of its decided cells").null("-"), ends)
        .build()
        .text()
}

fn range(low: f64, high: f64) -> String {
    format!("{}…{}", short(low), short(high))
}

/// A rate in about six characters.
fn short(value: f64) -> String {
    readable::significant(value, if value.abs() < 1e-3 { 2 } else { 3 })
}

/// A factor in four characters.
fn factor(value: f64) -> String {
    match value {
        v if v >= 99.5 => ">99".to_owned(),
        v if v >= 9.95 => format!("{v:.1}"),
        v => format!("{v:.2}"),
    }
}

/// Rows of the figures: the driver models, with the failing scenarios of S.
fn rows(comparison: &CategoryComparison, criterion: Criterion) -> (Vec<&RecordedCell>, Vec<DotRow>) {
    let recorded: Vec<&RecordedCell> = comparison.recorded.iter().filter(|cell| cell.criterion == criterion).collect();
    let row =
        |cell: &&RecordedCell| DotRow { name: cell.model.name().to_owned(), failing_scenarios: cell.failing_scenarios };
    let rows = recorded.iter().map(row).collect();
    (recorded, rows)
}

/// The cell of a model and criterion of every row.
fn values(
    of: &ComparedParameterization,
    recorded: &[&RecordedCell],
    value: impl Fn(&ComparedCell) -> Option<Value>,
) -> Vec<Value> {
    let at = |(row, s): (usize, &&RecordedCell)| {
        let cell = of.cells.iter().find(|cell| (cell.model, cell.criterion) == (s.model, s.criterion))?;
        Some(Value { y: row as f64, ..value(cell)? })
    };
    recorded.iter().enumerate().filter_map(at).collect()
}

fn legend_name(of: &ComparedParameterization) -> String {
    format!("{} ({} parameters)", of.key, of.parameters)
}

/// Shares of failed lanes for one criterion of one category: a row per driver model; the recorded scenarios, then every
/// density.
fn rates(compare: &Compare, comparison: &CategoryComparison, criterion: Criterion) -> Figure {
    let (recorded, rows) = rows(comparison, criterion);
    // A logarithmic axis cannot show a rate of 0, but it can show the bound above it.
    let value = |rate: &RateRecord| {
        rate.rate.is_finite().then(|| Value { x: rate.rate, interval: Some((rate.low, rate.high)), ..Value::default() })
    };
    let own = recorded.iter().enumerate().filter_map(|(row, s)| Some(Value { y: row as f64, ..value(&s.rate)? }));
    let look = Look { colour: INK, symbol: Symbol::Polygon(4, 0.0), ..Look::of(0, 1) };
    let mut series = vec![Series::new("S, as recorded", &[], own).with_look(look)];
    for (at, of) in comparison.parameterizations.iter().enumerate() {
        let drawn = |cell: &ComparedCell| {
            let [low, high] = cell.sampled.with_data;
            Some(Value { outer: Some((low, high)), ..value(&cell.sampled.rate)? })
        };
        let look = Look::of(at, comparison.parameterizations.len());
        series.push(Series::new(legend_name(of), &[], values(of, &recorded, drawn)).with_look(look));
    }
    let all = series.iter().flat_map(|series| &series.values);
    let reach: Vec<(f64, f64, f64)> = all
        .filter_map(|value| {
            let (low, high) = value.outer.or(value.interval)?;
            Some((value.x, low, high))
        })
        .collect();
    let x = PlotAxis::around("share of failed lanes", AxisScale::Logarithmic, logarithmic_reach(&reach));
    let panel = Dots { x, series, ..Dots::default() };
    let samples = readable::count(compare.options().samples);
    Figure {
        title: format!("{}: share of lanes that fail {}", comparison.category.label(), criterion.label()),
        subtitle: Some(format!("{} · densities of {samples} samples each", compare.provenance().data)),
        caption: format!(
            "Line: {0} % interval, of S over the scenarios, of a density over the draws alone; thin line: the density's \
             over draws and scenarios, at fixed bandwidth and scale. A line at the left edge goes on beyond it; an arrow \
             is a share of zero below its bound. n: scenarios in which S fails. S and the densities rest on the same \
             scenarios: the figure of the ratios compares them.",
            100.0 * Compare::LEVEL
        ),
        plots: dots(&rows, vec![panel]),
        ..Figure::default()
    }
}

/// Ratios of the shares of failed lanes to those of S: of S', replayed, and of the density, drawn.
fn ratios(compare: &Compare, comparison: &CategoryComparison, criterion: Criterion) -> Figure {
    type Pick = fn(&ComparedCell) -> &Ratio;
    let sides: [(&str, Pick); 2] =
        [("S', replayed", |cell| &cell.replayed.ratio), ("density, drawn", |cell| &cell.sampled.ratio)];
    let (recorded, rows) = rows(comparison, criterion);
    let value = |ratio: &Ratio| {
        let (low, high) = (ratio.low.unwrap_or(0.0), ratio.high.unwrap_or(f64::MAX));
        Some(Value { x: ratio.ratio?, interval: Some((low, high)), ..Value::default() })
    };
    let margin = compare.options().enough.margin;
    let all = sides.iter().flat_map(|(_, pick)| {
        let cells = comparison.parameterizations.iter().flat_map(|of| &of.cells).filter(|c| c.criterion == criterion);
        cells.filter_map(|cell| value(pick(cell)))
    });
    // Where an interval has no upper end, the axis ends a decade above the ratio.
    let reach: Vec<(f64, f64, f64)> = all
        .filter_map(|value| {
            value.interval.filter(|_| value.x > 0.0).map(|(low, high)| (value.x, low, high.min(10.0 * value.x)))
        })
        .chain([(1.0, 1.0 / margin, margin)])
        .collect();
    let panel = |(heading, pick): (&str, Pick)| Dots {
        heading: heading.to_owned(),
        x: PlotAxis::around("ratio to S", AxisScale::Logarithmic, logarithmic_reach(&reach)),
        marked: vec![(1.0 / margin, "3,3"), (1.0, ""), (margin, "3,3")],
        series: comparison
            .parameterizations
            .iter()
            .map(|of| Series::new(legend_name(of), &[], values(of, &recorded, |cell| value(pick(cell)))))
            .collect(),
    };
    Figure {
        title: format!(
            "{}, {}: failure rates as multiples of that of S",
            comparison.category.label(),
            criterion.label()
        ),
        subtitle: Some(compare.provenance().data.clone()),
        caption: format!(
            "Share of the lanes that fail, as a multiple of that of S, scenario by scenario, with its {} % interval; 1: as \
             many failures, though perhaps of other scenarios (see F1). A ratio agrees where its interval lies between \
             the dashed lines ({:.2} and {margin}). Where S never fails there is no ratio. A \
             line at an edge goes on beyond it; an arrow is a ratio of zero below its bound. n: scenarios in which S fails.",
            100.0 * Compare::LEVEL,
            1.0 / margin
        ),
        plots: dots(&rows, sides.map(panel).into_iter().collect()),
        columns: 2,
        ..Figure::default()
    }
}
