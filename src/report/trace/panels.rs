//! The panels of a case's figure as plots. The figure arranges them on the sheet.

use super::super::plot::{GREY, Height, INK, Look, Mark, Plot, PlotAxis, Rule, Series, Symbol, Value, plain_end};
use super::thousandths;
use lanesweep_engine::{StepMark, Trace, TracedStep, TracedVehicle};
use lanesweep_model::scenario::{GAP_ERROR_M, KMH};

/// One lane on the sheet.
#[derive(Debug, Clone)]
pub struct TraceSeries<'a> {
    /// Its distinguishing name: driver model, variant.
    pub name: String,
    /// The lane.
    pub trace: &'a Trace,
}

/// Time shown after the last decisive event, s.
const REST_S: f64 = 2.0;
/// A value this near to its worst counts as the worst, relative: near a steady state the last digits take a minute.
const NEAR: f64 = 0.05;
/// Smaller changes of an ego's speed decide nothing, m/s.
const SPEED_CHANGE_MPS: f64 = 1.0 / KMH;
/// TTC and BTN are shown up to these multiples of their thresholds.
const TTC_SHOWN: f64 = 10.0;
const BTN_SHOWN: f64 = 2.5;

/// A run of points, (time in s, value), without a gap.
#[derive(Debug, Clone, PartialEq)]
struct Curve {
    /// Whether it is drawn thin: of another vehicle in a panel of the ego, or ignored by the criteria.
    is_thin: bool,
    look: Look,
    points: Vec<(f64, f64)>,
}

impl From<Curve> for Series {
    fn from(curve: Curve) -> Self {
        let line_px = if curve.is_thin && curve.look.colour != GREY { 0.8 } else { curve.look.line_px };
        Series::new("", &[Mark::Line], curve.points).with_look(Look { line_px, ..curve.look })
    }
}

/// A mark in the colour of its series; shapes distinguish marks.
fn mark_look(mark: StepMark, look: &Look) -> Look {
    let symbol = match mark {
        StepMark::Reaction => Symbol::Ring,
        StepMark::Braking => Symbol::Polygon(3, 0.5),
        StepMark::Contact => Symbol::Cross,
    };
    Look { symbol, marker_px: 5.0, ..*look }
}

/// A line through a panel.
fn rule(ends: [(f64, f64); 2], colour: &'static str, width_px: f64, dash: &'static str) -> Rule {
    Rule { runs: vec![ends.to_vec()], colour, width_px, dash, ..Rule::default() }
}

/// Data common to all panels: the series up to a time.
pub(super) struct Shown<'a> {
    pub series: &'a [TraceSeries<'a>],
    /// Looks of the series.
    pub looks: Vec<Look>,
    /// Last time shown, s.
    pub until_s: f64,
}

impl<'a> Shown<'a> {
    /// Up to a given time, or to the last event that decides: lanes may continue long after it.
    pub(super) fn of(series: &'a [TraceSeries<'a>], until_s: Option<f64>) -> Self {
        let end_s = series.iter().filter_map(|s| Some(s.trace.steps.last()?.time_s)).fold(0.0, f64::max);
        let last_s = series.iter().map(|s| decisive_s(s.trace)).fold(0.0, f64::max) + REST_S;
        let until_s = until_s.unwrap_or(if last_s < 0.8 * end_s { last_s } else { end_s });
        let looks = (0..series.len()).map(|k| Look::of(k, series.len())).collect();
        Shown { series, looks, until_s: until_s.clamp(0.0, end_s) }
    }

    /// The panels row by row, and how many are in a row: one, or one per other vehicle where there are two.
    pub(super) fn panels(&self) -> (usize, Vec<Plot>) {
        let vehicles = self.series.iter().map(|s| s.trace.vehicles).max().unwrap_or(1);
        let of = |vehicle: usize| {
            let name = match (vehicles, vehicle) {
                (1, _) => "",
                (_, 0) => "to the vehicle that cuts out",
                _ => "to the vehicle ahead of it",
            };
            [
                self.gap(vehicle, name),
                self.ttc(vehicle),
                self.btn(vehicle),
                self.surrogate("PFS (–)", "proactive fuzzy surrogate", vehicle, &|other| other.pfs),
                self.surrogate("CFS (–)", "critical fuzzy surrogate", vehicle, &|other| other.cfs),
                self.lateral(vehicle),
            ]
        };
        let mut shown = vec![self.speed(vehicles), self.acceleration()];
        let others: Vec<[Plot; 6]> = (0..vehicles).map(of).collect();
        shown.extend((0..6).flat_map(|at| others.iter().map(move |plots| plots[at].clone())));
        // The lines through all panels have their names in the first.
        let named =
            self.mark_lines().into_iter().map(|(mark, time_s)| format!("{} {} s", mark.label(), thousandths(time_s)));
        let rules = shown.first_mut().into_iter().flat_map(|plot| &mut plot.rules);
        rules.zip(named).for_each(|(rule, name)| rule.label = name);
        (vehicles, shown)
    }

    /// Whether a step is shown at which the criteria ignore a vehicle that is present.
    pub(super) fn has_unjudged(&self) -> bool {
        let unjudged = |trace: &Trace, step: &TracedStep| {
            step.others[..trace.vehicles].iter().any(|other| other.is_present && !other.is_judged)
        };
        self.series.iter().any(|s| self.steps(s.trace).iter().any(|step| unjudged(s.trace, step)))
    }

    fn steps(&self, trace: &'a Trace) -> &'a [TracedStep] {
        &trace.steps[..trace.steps.partition_point(|step| step.time_s <= self.until_s)]
    }

    /// A panel with its levels and series; the marks of a single lane become lines through all panels.
    fn panel(
        &self,
        title: &str,
        hint: impl Into<String>,
        height_px: f64,
        ends: (f64, f64),
        levels: Vec<Rule>,
        series: Vec<Series>,
    ) -> Plot {
        // A lane of one step needs an axis too.
        let end_s = if self.until_s > 0.0 { self.until_s } else { 1.0 };
        let through = self
            .mark_lines()
            .into_iter()
            .map(|(_, time_s)| rule([(time_s, ends.0), (time_s, ends.1)], INK, 1.0, "2,3"));
        Plot {
            heading: title.to_owned(),
            hint: hint.into(),
            x: PlotAxis::new("Time (s)", 0.0, end_s),
            y: PlotAxis::new("", ends.0, ends.1),
            rules: through.chain(levels).collect(),
            series,
            height: Height::Px(height_px),
            ..Plot::default()
        }
    }

    fn level(&self, value: f64, colour: &'static str, width_px: f64, dash: &'static str) -> Rule {
        rule([(0.0, value), (self.until_s.max(1.0), value)], colour, width_px, dash)
    }

    /// Times of the lines through all panels; only for a single lane, because more would be confusing.
    fn mark_lines(&self) -> Vec<(StepMark, f64)> {
        let [series] = self.series else { return Vec::new() };
        let time = |mark: StepMark| Some((mark, series.trace.time_s(series.trace.step_of(mark)?)));
        StepMark::ALL.into_iter().filter_map(time).filter(|mark| mark.1 <= self.until_s).collect()
    }

    fn speed(&self, vehicles: usize) -> Plot {
        let mut curves = Vec::new();
        let mut is_shared = true;
        for vehicle in 0..vehicles {
            for (look, trace) in self.courses(vehicle, &|other| other.v_mps) {
                is_shared &= look.colour == GREY;
                curves.extend(runs(look, self.steps(trace), &of_other(vehicle, &|other| other.v_mps, true)));
            }
        }
        curves.extend(self.curves(&|step| Some((step.v_ego_mps, false))));
        let (look, plural) = (if is_shared { "grey" } else { "thin" }, if vehicles == 1 { "" } else { "s" });
        let hint = format!("{look}: the other vehicle{plural}");
        let ends = around(values(&curves));
        let marks = self.marks(&StepMark::ALL, None, &|step| Some(step.v_ego_mps));
        self.panel("Speed (m/s)", hint, 92.0, ends, Vec::new(), with_marks(curves, marks))
    }

    fn acceleration(&self) -> Plot {
        let curves = self.curves(&|step| Some((step.a_ego_mps2, false)));
        let ends = around(values(&curves).chain([0.0, -1.0]));
        let series = with_marks(curves, self.marks(&StepMark::ALL, None, &|step| Some(step.a_ego_mps2)));
        let zero = self.level(0.0, GREY, 1.1, "");
        self.panel("Acceleration (m/s²)", "of the ego", 92.0, ends, vec![zero], series)
    }

    fn gap(&self, vehicle: usize, name: &str) -> Plot {
        let gap = |step: &TracedStep| Some(step.others[vehicle]).filter(|o| o.is_present).map(|o| o.gap_m);
        let curves = self.judged_curves(vehicle, &|other| other.gap_m);
        let ends = around(values(&curves).chain([0.0]));
        let mut marks = self.marks(&[StepMark::Reaction, StepMark::Braking], None, &gap);
        marks.extend(self.marks(&[StepMark::Contact], Some(vehicle), &gap));
        let zero = self.level(0.0, GREY, 1.1, "");
        self.panel("Gap (m)", name, 92.0, ends, vec![zero], with_marks(curves, marks))
    }

    fn ttc(&self, vehicle: usize) -> Plot {
        let threshold = self.first(|trace| trace.ttc_threshold_s);
        let curves = self.judged_curves(vehicle, &|other| other.ttc_s);
        let largest = values(&curves).filter(|v| v.is_finite()).fold(0.0, f64::max);
        let top = plain_end(largest.clamp(2.0 * threshold, TTC_SHOWN * threshold));
        self.measure("TTC (s)", format!("fails below {threshold} s"), top, threshold, curves)
    }

    fn btn(&self, vehicle: usize) -> Plot {
        let threshold = self.first(|trace| trace.btn_threshold);
        let curves = self.judged_curves(vehicle, &|other| other.btn);
        let largest = values(&curves).fold(0.0, f64::max);
        let top = plain_end(largest.clamp(1.25 * threshold, BTN_SHOWN * threshold));
        self.measure("BTN (–)", format!("fails above {threshold}"), top, threshold, curves)
    }

    fn measure(&self, title: &str, label: String, top: f64, threshold: f64, curves: Vec<Curve>) -> Plot {
        let below = |curve: Curve| {
            let points = curve.points.into_iter().map(|(time_s, value)| (time_s, value.min(top)));
            Curve { points: points.collect(), ..curve }
        };
        let series = curves.into_iter().map(below).map(Series::from).collect();
        let level = Rule { label, ..self.level(threshold, INK, 1.4, "2,3") };
        self.panel(title, "", 84.0, (-0.04 * top, top), vec![level], series)
    }

    fn surrogate(&self, title: &str, hint: &str, vehicle: usize, value: &dyn Fn(&TracedVehicle) -> f64) -> Plot {
        let curves = self.curves(&of_other(vehicle, value, false));
        // The axis extends a little beyond 0 and 1, where most of the curves are.
        self.panel(title, hint, 58.0, (-0.1, 1.1), Vec::new(), with_marks(curves, Vec::new()))
    }

    fn lateral(&self, vehicle: usize) -> Plot {
        let (mut curves, mut bands) = (Vec::new(), Vec::new());
        let ego_half_m = self.first(|trace| trace.ego_width_m) / 2.0;
        let half_lane_m = self.first(|trace| trace.lane_width_m) / 2.0;
        let mut edges = vec![half_lane_m, -half_lane_m, ego_half_m, -ego_half_m];
        for (look, trace) in self.courses(vehicle, &|other| other.y_m) {
            let half_m = trace.widths_m[vehicle] / 2.0;
            for run in runs(look, self.steps(trace), &of_other(vehicle, &|other| other.y_m, false)) {
                let side = |&(x, y): &(f64, f64)| Value { interval: Some((y - half_m, y + half_m)), ..(x, y).into() };
                edges.extend(run.points.iter().flat_map(|point| [point.1 - half_m, point.1 + half_m]));
                bands.push(Series::new("", &[Mark::Band], run.points.iter().map(side)).with_look(look));
                curves.push(run);
            }
        }
        let contacts = self.marks(&[StepMark::Contact], Some(vehicle), &|step| Some(step.others[vehicle].y_m));
        let lane = [-half_lane_m, half_lane_m].map(|y| self.level(y, GREY, 1.1, "14,6"));
        let sides = [-ego_half_m, ego_half_m].map(|y| self.level(y, GREY, 2.4, ""));
        let levels = lane.into_iter().chain(sides).collect();
        bands.extend(with_marks(curves, contacts));
        let ends = around(edges.into_iter());
        self.panel("Lateral position (m)", "grey lines: sides of the ego", 110.0, ends, levels, bands)
    }

    /// A value of the first series; equal for all of a sheet.
    fn first(&self, value: impl Fn(&Trace) -> f64) -> f64 {
        self.series.first().map_or(1.0, |s| value(s.trace))
    }

    /// The distinct courses of a vehicle's value, grey if all lanes have the same one; the longest stands for equal
    /// ones.
    fn courses(&self, vehicle: usize, value: &dyn Fn(&TracedVehicle) -> f64) -> Vec<(Look, &'a Trace)> {
        let at = |step: &TracedStep| {
            let other = &step.others[vehicle];
            (value(other), other.is_present)
        };
        let is_one = |a: &Trace, b: &Trace| {
            a.widths_m[vehicle] == b.widths_m[vehicle] && a.steps.iter().zip(&b.steps).all(|(a, b)| at(a) == at(b))
        };
        let mut found: Vec<(Look, &Trace)> = Vec::new();
        for (k, series) in self.series.iter().enumerate().filter(|(_, s)| s.trace.vehicles > vehicle) {
            match found.iter_mut().find(|(_, other)| is_one(other, series.trace)) {
                Some((_, longest)) if longest.steps.len() < series.trace.steps.len() => *longest = series.trace,
                Some(_) => {}
                None => found.push((self.looks[k], series.trace)),
            }
        }
        if let [(look, _)] = &mut found[..] {
            *look = Look { colour: GREY, dash: "", line_px: 2.0, ..*look };
        }
        found
    }

    fn curves(&self, value: &dyn Fn(&TracedStep) -> Option<(f64, bool)>) -> Vec<Curve> {
        let all = self.series.iter().enumerate();
        all.flat_map(|(k, s)| runs(self.looks[k], self.steps(s.trace), value)).collect()
    }

    fn judged_curves(&self, vehicle: usize, value: &dyn Fn(&TracedVehicle) -> f64) -> Vec<Curve> {
        self.curves(&|step| {
            let other = &step.others[vehicle];
            other.is_present.then(|| (value(other), !other.is_judged))
        })
    }

    /// Marks of the lanes as series; with a vehicle, only contacts with it.
    fn marks(
        &self,
        which: &[StepMark],
        vehicle: Option<usize>,
        value: &dyn Fn(&TracedStep) -> Option<f64>,
    ) -> Vec<Series> {
        let mut marks = Vec::new();
        for (of, look) in self.series.iter().zip(&self.looks) {
            if vehicle.is_some_and(|vehicle| usize::from(of.trace.outcome.contact_with) != vehicle) {
                continue;
            }
            for &mark in which {
                let step = of.trace.step_of(mark).and_then(|step| self.steps(of.trace).get(step as usize));
                let Some((step, value)) = step.and_then(|step| Some((step, value(step)?))) else { continue };
                let series = Series::new("", &[Mark::Points], [(step.time_s, value)]);
                marks.push(series.with_look(mark_look(mark, look)));
            }
        }
        marks
    }
}

/// The last time at which a driver decides or is decided, s: marks, changes of its speed, and where gap, TTC and BTN come
/// near their worst. A TTC above ten times its threshold, or a BTN below a tenth of it, decides nothing.
fn decisive_s(trace: &Trace) -> f64 {
    let marks = StepMark::ALL.into_iter().filter_map(|mark| trace.step_of(mark)).map(|step| trace.time_s(step));
    let last_mps = trace.steps.last().map_or(0.0, |step| step.v_ego_mps);
    let changes = |step: &&TracedStep| (step.v_ego_mps - last_mps).abs() > SPEED_CHANGE_MPS;
    let braked = trace.steps.iter().rfind(changes).map(|step| step.time_s);
    let smallest = |step: &TracedStep, of: fn(&TracedVehicle) -> f64| {
        let judged = step.others[..trace.vehicles].iter().filter(|other| other.is_judged);
        judged.map(of).fold(f64::INFINITY, f64::min)
    };
    // The first time at which a value is as near to its worst as this; none if the worst is above a limit.
    let first = |of: fn(&TracedVehicle) -> f64, limit: f64, near: &dyn Fn(f64) -> f64| {
        let worst = trace.steps.iter().map(|step| smallest(step, of)).fold(f64::INFINITY, f64::min);
        let is_near = |step: &&TracedStep| worst.is_finite() && worst <= limit && smallest(step, of) <= near(worst);
        trace.steps.iter().find(is_near).map(|step| step.time_s)
    };
    let worst = [
        first(|other| other.gap_m, f64::MAX, &|worst| worst + GAP_ERROR_M.max(worst * NEAR)),
        first(|other| other.ttc_s, TTC_SHOWN * trace.ttc_threshold_s, &|worst| worst * (1.0 + NEAR)),
        first(|other| -other.btn, -trace.btn_threshold / TTC_SHOWN, &|worst| worst * (1.0 - NEAR)),
    ];
    marks.chain(braked).chain(worst.into_iter().flatten()).fold(0.0, f64::max)
}

/// A value of another vehicle while it is present, as a thin curve or not.
fn of_other(
    vehicle: usize,
    value: &dyn Fn(&TracedVehicle) -> f64,
    is_thin: bool,
) -> impl Fn(&TracedStep) -> Option<(f64, bool)> {
    move |step| Some(&step.others[vehicle]).filter(|other| other.is_present).map(|other| (value(other), is_thin))
}

/// A value over time as runs without a gap, also split where thin drawing begins or ends; such neighbours have a common
/// point.
fn runs(look: Look, steps: &[TracedStep], value: &dyn Fn(&TracedStep) -> Option<(f64, bool)>) -> Vec<Curve> {
    let mut runs: Vec<Curve> = Vec::new();
    let mut open = false;
    for step in steps {
        let Some((value, is_thin)) = value(step) else {
            open = false;
            continue;
        };
        let point = (step.time_s, value);
        match runs.last_mut().filter(|_| open) {
            Some(run) if run.is_thin == is_thin => run.points.push(point),
            Some(run) => {
                let shared = run.points.last().copied();
                runs.push(Curve { look, is_thin, points: shared.into_iter().chain([point]).collect() });
            }
            None => runs.push(Curve { look, is_thin, points: vec![point] }),
        }
        open = true;
    }
    runs
}

fn values(curves: &[Curve]) -> impl Iterator<Item = f64> {
    curves.iter().flat_map(|curve| &curve.points).map(|point| point.1)
}

fn with_marks(curves: Vec<Curve>, marks: Vec<Series>) -> Vec<Series> {
    curves.into_iter().map(Series::from).chain(marks).collect()
}

/// Distinct, finite ends around values, with a little room.
fn around(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let shown = values.filter(|v| v.abs() <= 1e300);
    let (low, high) = shown.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    // Values equal except for rounding count as equal.
    let room = (0.06 * (high - low)).max(1e-3 * low.abs().max(high.abs())).max(0.05);
    let (low, high) = (low - room, high + room);
    if low < high && low.is_finite() && high.is_finite() { (low, high) } else { (0.0, 1.0) }
}
