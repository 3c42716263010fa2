//! One case step by step: the figure of all that its driver models see and do, over one time axis, and every number as
//! CSV.
//!
//! Series differ in colour, dashes and line width; marks differ in shape.

mod lanes;
mod panels;
mod positions;

use super::plot::{Figure, Look, Plot, Rule};
pub use lanes::TraceReport;
use lanesweep_engine::{StepMark, Trace, TracedStep};
use lanesweep_support::readable::plain;
use lanesweep_support::table::Table;
use panels::Shown;
pub use panels::TraceSeries;

/// Lanes of one case, or of variants of a case, on one sheet.
#[derive(Debug, Clone)]
pub struct TraceFigure<'a> {
    /// Heading; wrapped when long.
    pub title: String,
    /// Line below the heading; wrapped when long.
    pub subtitle: Option<String>,
    /// The lanes.
    pub series: Vec<TraceSeries<'a>>,
    /// Last time shown, s; `None`: 2 s after the last decisive event, or the end if that is near.
    pub until_s: Option<f64>,
}

impl TraceFigure<'_> {
    /// Width of the lanes, m.
    fn lane_width_m(&self) -> f64 {
        self.series.first().map_or(0.0, |series| series.trace.lane_width_m)
    }

    /// The figure as a complete SVG document, as wide as a column of a paper (as two for a cut-out).
    ///
    /// A note says if lanes continue after the last time shown. TTC is shown up to ten times its threshold, BTN up to
    /// 2.5 times. The same figure gives the same bytes. It never fails: without lanes only the texts remain.
    pub fn svg(&self) -> String {
        let (title, subtitle) = (self.title.clone(), self.subtitle.clone());
        if self.series.iter().all(|s| s.trace.steps.is_empty()) {
            let caption = "There is no lane to draw.".to_owned();
            return Figure { title, subtitle, caption, ..Figure::default() }.svg();
        }
        let shown = Shown::of(&self.series, self.until_s);
        let (columns, mut plots) = shown.panels();
        let caption = self.notes(&shown, &plots).join(" ");
        plots.iter_mut().take(1).for_each(|plot| plot.rules.extend(self.legend(&shown.looks)));
        Figure { title, subtitle, plots, columns, is_wide: columns > 1, caption, ..Figure::default() }.svg()
    }

    /// Names, marks and worst values of the series, for the legend.
    fn legend(&self, looks: &[Look]) -> impl Iterator<Item = Rule> {
        self.series.iter().zip(looks).map(|(TraceSeries { name, trace }, look)| {
            let mark = |mark: StepMark| match trace.step_of(mark) {
                Some(step) => format!("{}\u{a0}{}\u{a0}s", mark.label(), thousandths(trace.time_s(step))),
                None => format!("{}\u{a0}never", mark.label()),
            };
            let ttc = trace.outcome.approach_ttc().map_or("–".to_owned(), |ttc_s| format!("{} s", plain(ttc_s, 3)));
            let marks = StepMark::ALL.map(mark).join(", ");
            Rule {
                name: format!("{name}: {marks}, min TTC {ttc}, max BTN {}", plain(trace.outcome.max_btn, 3)),
                colour: look.colour,
                width_px: look.line_px,
                dash: look.dash,
                ..Rule::default()
            }
        })
    }

    fn notes(&self, shown: &Shown, plots: &[Plot]) -> Vec<String> {
        let mut notes = vec!["Ring: reaction; triangle: braking; cross: contact.".to_owned()];
        if shown.has_unjudged() {
            notes.push("Thin gap, TTC, BTN: the criteria ignore the vehicle there.".to_owned());
        }
        if self.series.iter().any(|s| s.trace.outcome.approach_ttc().is_none()) {
            notes.push("Min TTC –: the vehicles met beside each other, without an approach along one path.".to_owned());
        }
        if self.series.iter().any(|s| s.trace.coasting_mps2 > 0.0) {
            notes.push("CCHDM's coasting after its reaction is no braking.".to_owned());
        }
        let is_cut =
            |plot: &Plot| plot.series.iter().flat_map(|series| &series.values).any(|value| value.y >= plot.y.ends.1);
        if plots.iter().any(is_cut) {
            notes.push("A curve along the top edge is above it.".to_owned());
        }
        notes.push(format!("Long dashes: edges of a lane {} m wide.", thousandths(self.lane_width_m())));
        let end_s = self.series.iter().filter_map(|s| Some(s.trace.steps.last()?.time_s)).fold(0.0, f64::max);
        if end_s > shown.until_s {
            let (until, end) = (thousandths(shown.until_s), thousandths(end_s));
            notes.push(format!("The lanes go on after {until} s, the longest to {end} s."));
            if self.until_s.is_none() {
                notes.push(
                    "Before it are: every mark, every change of an ego's speed by more than 1 km/h, and the worst gap, TTC and \
                     BTN (to 5 %, a gap to 1 cm). A TTC or BTN that stays ten times from its threshold is left out. Readings \
                     of clauses may be later."
                        .to_owned(),
                );
            }
        }
        notes
    }
}

fn thousandths(value: f64) -> String {
    ((value * 1e3).round() / 1e3).to_string()
}

const VEHICLES: [&str; 2] = ["other", "ahead"];

/// The traces, one row per step. Several traces follow one another, named by a first column `lane`; a single trace has
/// no such column. The last column names the marks of a step (`reaction`, `braking`, `contact`, joined by `+`).
/// Infinity is `inf`; the columns of an absent vehicle are empty.
pub(crate) fn table(traces: &[(String, &Trace)]) -> Table {
    let vehicles = traces.iter().map(|(_, trace)| trace.vehicles).max().unwrap_or(1);
    let rows = traces.iter().flat_map(|(name, trace)| trace.steps.iter().map(move |step| (name, *trace, step)));
    let mut table = Table::of(rows)
        .columns((traces.len() > 1).then_some("lane"), |lane| lane, |(name, ..), _| name.as_str())
        .column("t_s", |(.., step)| step.time_s)
        .column("x_ego_m", |(.., step)| step.x_ego_m)
        .column("v_ego_mps", |(.., step)| step.v_ego_mps)
        .column("a_ego_mps2", |(.., step)| step.a_ego_mps2)
        .column("unsafe", |(.., step)| u8::from(step.is_unsafe))
        .column("demand_mps2", |(.., step)| step.demand_mps2);
    for (k, vehicle) in VEHICLES[..vehicles].iter().enumerate() {
        let name = |name: &str| format!("{vehicle}_{name}");
        let other = |(_, trace, step): Row| (k < trace.vehicles).then(|| step.others[k]);
        table = table
            .column(name("x_m"), |row| other(row).map(|of| of.x_m))
            .column(name("y_m"), |row| other(row).map(|of| of.y_m))
            .column(name("v_mps"), |row| other(row).map(|of| of.v_mps))
            .column(name("gap_m"), |row| other(row).map(|of| of.gap_m))
            .column(name("lateral_gap_m"), |row| other(row).map(|of| of.lateral_gap_m))
            .column(name("ttc_s"), |row| other(row).map(|of| of.ttc_s))
            .column(name("btn"), |row| other(row).map(|of| of.btn))
            .column(name("pfs"), |row| other(row).map(|of| of.pfs))
            .column(name("cfs"), |row| other(row).map(|of| of.cfs))
            .column(name("present"), |row| other(row).map(|of| u8::from(of.is_present)))
            .column(name("judged"), |row| other(row).map(|of| u8::from(of.is_judged)));
    }
    let mark = |(_, trace, step): Row| {
        let here = StepMark::ALL.into_iter().filter(|mark| trace.step_of(*mark) == Some(step.step));
        here.map(StepMark::label).collect::<Vec<_>>().join("+")
    };
    table.column("mark", mark).build()
}

/// A step of a named trace.
type Row<'a> = (&'a String, &'a Trace, &'a TracedStep);
