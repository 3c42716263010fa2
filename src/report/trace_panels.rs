//! What the figure of a case shows: its panels as curves, bands and marks in the units of their axes. Where they stand
//! on the sheet is the figure's business.

use super::axis::plain_end;
use crate::engine::{Mark, Trace, TracedStep, TracedVehicle};

/// One lane on the sheet.
#[derive(Debug, Clone)]
pub struct TraceSeries<'a> {
    /// What tells it from the others: driver model, variant.
    pub name: String,
    /// The lane.
    pub trace: &'a Trace,
}

/// Half the width of the lane that is drawn, m: that of the paper's cut-ins and cut-outs, which start or end 3.5 m off.
const HALF_LANE_M: f64 = 1.75;
/// Seconds that are shown after the last change.
const REST_S: f64 = 2.0;
/// TTC and BTN are shown up to so many times their thresholds.
const TTC_SHOWN: f64 = 10.0;
const BTN_SHOWN: f64 = 2.5;

/// Ends of a vertical axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Reach {
    /// Around these values, with a little room.
    Around(Vec<f64>),
    /// Exactly from the first to the second; curves end where they leave.
    Exactly(f64, f64),
}

impl Reach {
    /// Lower and upper end, different and finite.
    pub fn ends(&self) -> (f64, f64) {
        let (low, high) = match self {
            Reach::Exactly(low, high) => (*low, *high),
            Reach::Around(values) => {
                let shown = || values.iter().copied().filter(|v| v.abs() <= 1e300);
                let (low, high) = (shown().fold(f64::INFINITY, f64::min), shown().fold(f64::NEG_INFINITY, f64::max));
                // Equal but for rounding counts as equal.
                let room = (0.06 * (high - low)).max(1e-3 * low.abs().max(high.abs())).max(0.05);
                (low - room, high + room)
            }
        };
        if low < high && low.is_finite() && high.is_finite() { (low, high) } else { (0.0, 1.0) }
    }
}

/// A line through a panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    Zero,
    /// Of a criterion.
    Threshold,
    LaneEdge,
    EgoSide,
}

/// Whose a curve is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Owner {
    /// That series'.
    Series(usize),
    /// All series' alike.
    All,
}

/// A run of points, (time in s, value), without a gap.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Curve {
    pub owner: Owner,
    /// Of another vehicle in a panel of the ego, or not looked at by the criteria.
    pub is_thin: bool,
    pub points: Vec<(f64, f64)>,
}

/// An area between two runs of points of the same times: (time in s, lower, upper).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Band {
    pub owner: Owner,
    pub points: Vec<(f64, f64, f64)>,
}

/// A mark on a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PanelMark {
    pub series: usize,
    pub mark: Mark,
    /// Time, s, and value.
    pub at: (f64, f64),
}

/// One panel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Panel {
    /// What it shows, with unit.
    pub title: &'static str,
    /// How to read it, in a few words.
    pub hint: String,
    pub height_px: f64,
    pub reach: Reach,
    pub curves: Vec<Curve>,
    pub bands: Vec<Band>,
    /// Lines that run through the panel, and their values.
    pub levels: Vec<(Level, f64)>,
    pub marks: Vec<PanelMark>,
}

/// The panels of one other vehicle or of the ego, from top to bottom.
pub(super) type Column = Vec<Panel>;

/// What all panels show: the series up to a time.
pub(super) struct Shown<'a> {
    pub series: &'a [TraceSeries<'a>],
    /// Last time that is shown, s.
    pub until_s: f64,
}

impl<'a> Shown<'a> {
    /// Up to a time, or all that changes: lanes may go on for long after their last event.
    pub fn of(series: &'a [TraceSeries<'a>], until_s: Option<f64>) -> Self {
        let end_s = series.iter().filter_map(|s| Some(s.trace.steps.last()?.time_s)).fold(0.0, f64::max);
        let last_s = series.iter().map(|s| last_change_s(s.trace)).fold(0.0, f64::max) + REST_S;
        let until_s = until_s.unwrap_or(if last_s < 0.8 * end_s { last_s } else { end_s });
        Shown { series, until_s: until_s.clamp(0.0, end_s) }
    }

    /// The columns of the sheet: one, or one per other vehicle where there are two.
    pub fn columns(&self) -> Vec<Column> {
        let vehicles = self.series.iter().map(|s| s.trace.vehicles).max().unwrap_or(1);
        let speed = self.speed(vehicles);
        let acceleration = self.acceleration();
        let of = |vehicle: usize| {
            let name = match (vehicles, vehicle) {
                (1, _) => "",
                (_, 0) => "to the vehicle that cuts out",
                _ => "to the vehicle ahead of it",
            };
            [self.gap(vehicle, name), self.ttc(vehicle), self.btn(vehicle), self.pfs(vehicle), self.cfs(vehicle)]
                .into_iter()
                .chain([self.lateral(vehicle)])
        };
        if vehicles == 1 {
            return vec![[speed, acceleration].into_iter().chain(of(0)).collect()];
        }
        vec![std::iter::once(speed).chain(of(0)).collect(), std::iter::once(acceleration).chain(of(1)).collect()]
    }

    /// Some step at which the criteria do not look at a vehicle that is there is shown.
    pub fn has_unjudged(&self) -> bool {
        let unjudged = |trace: &Trace, step: &TracedStep| {
            step.others[..trace.vehicles].iter().any(|other| other.is_present && !other.is_judged)
        };
        self.series.iter().any(|s| self.steps(s.trace).iter().any(|step| unjudged(s.trace, step)))
    }

    fn steps(&self, trace: &'a Trace) -> &'a [TracedStep] {
        &trace.steps[..trace.steps.partition_point(|step| step.time_s <= self.until_s)]
    }

    fn speed(&self, vehicles: usize) -> Panel {
        let mut curves = Vec::new();
        let mut is_shared = true;
        for vehicle in 0..vehicles {
            for (owner, trace) in self.courses(vehicle, &|other| other.v_mps) {
                is_shared &= owner == Owner::All;
                let speed = |other: &TracedVehicle| other.is_present.then_some((other.v_mps, true));
                curves.extend(runs(owner, self.steps(trace), &|step| speed(&step.others[vehicle])));
            }
        }
        curves.extend(self.curves(&|step| Some((step.v_ego_mps, false))));
        Panel {
            title: "Speed (m/s)",
            hint: match (vehicles, is_shared) {
                (1, true) => "grey: the other vehicle".to_owned(),
                (_, true) => "grey: the other vehicles".to_owned(),
                (1, _) => "thin: the other vehicle".to_owned(),
                _ => "thin: the other vehicles".to_owned(),
            },
            height_px: 92.0,
            reach: around(&curves, &[]),
            curves,
            bands: Vec::new(),
            levels: Vec::new(),
            marks: self.marks(&Mark::ALL, &|step| Some(step.v_ego_mps)),
        }
    }

    fn acceleration(&self) -> Panel {
        let curves = self.curves(&|step| Some((step.a_ego_mps2, false)));
        Panel {
            title: "Acceleration (m/s²)",
            hint: "of the ego".to_owned(),
            height_px: 92.0,
            reach: around(&curves, &[0.0, -1.0]),
            curves,
            bands: Vec::new(),
            levels: vec![(Level::Zero, 0.0)],
            marks: self.marks(&Mark::ALL, &|step| Some(step.a_ego_mps2)),
        }
    }

    fn gap(&self, vehicle: usize, name: &str) -> Panel {
        let gap = |step: &TracedStep| Some(step.others[vehicle]).filter(|o| o.is_present).map(|o| o.gap_m);
        let curves = self.judged_curves(vehicle, &|other| other.gap_m);
        let mut marks = self.marks(&[Mark::Reaction, Mark::Braking], &gap);
        marks.extend(self.contacts(vehicle, &gap));
        Panel {
            title: "Gap (m)",
            hint: name.to_owned(),
            height_px: 92.0,
            reach: around(&curves, &[0.0]),
            curves,
            bands: Vec::new(),
            levels: vec![(Level::Zero, 0.0)],
            marks,
        }
    }

    fn ttc(&self, vehicle: usize) -> Panel {
        let threshold = self.first(|trace| trace.ttc_threshold_s);
        let curves = self.judged_curves(vehicle, &|other| other.ttc_s);
        let largest = curves.iter().flat_map(|c| &c.points).map(|p| p.1).filter(|v| v.is_finite()).fold(0.0, f64::max);
        let top = plain_end(largest.clamp(2.0 * threshold, TTC_SHOWN * threshold));
        self.measure("TTC (s)", format!("dots: fails below {threshold} s"), top, threshold, curves)
    }

    fn btn(&self, vehicle: usize) -> Panel {
        let threshold = self.first(|trace| trace.btn_threshold);
        let curves = self.judged_curves(vehicle, &|other| other.btn);
        let largest = curves.iter().flat_map(|c| &c.points).map(|p| p.1).fold(0.0, f64::max);
        let top = plain_end(largest.clamp(1.25 * threshold, BTN_SHOWN * threshold));
        self.measure("BTN (–)", format!("dots: fails above {threshold}"), top, threshold, curves)
    }

    fn pfs(&self, vehicle: usize) -> Panel {
        self.surrogate("PFS (–)", "proactive fuzzy surrogate", vehicle, &|other| other.pfs)
    }

    fn cfs(&self, vehicle: usize) -> Panel {
        self.surrogate("CFS (–)", "critical fuzzy surrogate", vehicle, &|other| other.cfs)
    }

    fn surrogate(
        &self,
        title: &'static str,
        hint: &str,
        vehicle: usize,
        value: &dyn Fn(&TracedVehicle) -> f64,
    ) -> Panel {
        let present = |step: &TracedStep| {
            let other = &step.others[vehicle];
            other.is_present.then(|| (value(other), false))
        };
        // A little beyond 0 and 1, where most of the curves are.
        let reach = Reach::Exactly(-0.1, 1.1);
        let curves = self.curves(&present);
        Panel {
            title,
            hint: hint.to_owned(),
            height_px: 58.0,
            reach,
            curves,
            bands: Vec::new(),
            levels: Vec::new(),
            marks: Vec::new(),
        }
    }

    fn measure(&self, title: &'static str, hint: String, top: f64, threshold: f64, curves: Vec<Curve>) -> Panel {
        let bottom = -0.04 * top;
        Panel {
            title,
            hint,
            height_px: 84.0,
            reach: Reach::Exactly(bottom, top),
            curves: curves.into_iter().flat_map(|curve| below(curve, top)).collect(),
            bands: Vec::new(),
            levels: vec![(Level::Threshold, threshold)],
            marks: Vec::new(),
        }
    }

    fn lateral(&self, vehicle: usize) -> Panel {
        let (mut curves, mut bands) = (Vec::new(), Vec::new());
        let ego_half_m = self.first(|trace| trace.ego_width_m) / 2.0;
        for (owner, trace) in self.courses(vehicle, &|other| other.y_m) {
            let half_m = trace.widths_m[vehicle] / 2.0;
            let centre = |step: &TracedStep| {
                let other = &step.others[vehicle];
                other.is_present.then_some((other.y_m, false))
            };
            let runs = runs(owner, self.steps(trace), &centre);
            let band = |run: &Curve| Band {
                owner,
                points: run.points.iter().map(|&(t, y)| (t, y - half_m, y + half_m)).collect(),
            };
            bands.extend(runs.iter().map(band));
            curves.extend(runs);
        }
        let edges = bands.iter().flat_map(|b| &b.points).flat_map(|&(_, low, high)| [low, high]);
        let lane = [(Level::LaneEdge, HALF_LANE_M), (Level::EgoSide, ego_half_m)];
        let levels: Vec<_> = lane.iter().flat_map(|&(level, y)| [(level, -y), (level, y)]).collect();
        let reach = Reach::Around(edges.chain(levels.iter().map(|level| level.1)).collect());
        Panel {
            title: "Lateral position (m)",
            hint: "grey lines: sides of the ego".to_owned(),
            height_px: 110.0,
            reach,
            curves,
            bands,
            levels,
            marks: self.contacts(vehicle, &|step| Some(step.others[vehicle].y_m)),
        }
    }

    /// A value of the first series; the same for all of one sheet.
    fn first(&self, value: impl Fn(&Trace) -> f64) -> f64 {
        self.series.first().map_or(1.0, |s| value(s.trace))
    }

    /// The different courses of a value of a vehicle and whose they are; where lanes share one, that of the longest.
    fn courses(&self, vehicle: usize, value: &dyn Fn(&TracedVehicle) -> f64) -> Vec<(Owner, &'a Trace)> {
        let at = |step: &TracedStep| {
            let other = &step.others[vehicle];
            (value(other), other.is_present)
        };
        let is_one = |a: &Trace, b: &Trace| {
            a.widths_m[vehicle] == b.widths_m[vehicle] && a.steps.iter().zip(&b.steps).all(|(a, b)| at(a) == at(b))
        };
        let mut found: Vec<(Owner, &Trace)> = Vec::new();
        for (k, series) in self.series.iter().enumerate().filter(|(_, s)| s.trace.vehicles > vehicle) {
            match found.iter_mut().find(|(_, other)| is_one(other, series.trace)) {
                Some((_, longest)) if longest.steps.len() < series.trace.steps.len() => *longest = series.trace,
                Some(_) => {}
                None => found.push((Owner::Series(k), series.trace)),
            }
        }
        if let [(owner, _)] = &mut found[..] {
            *owner = Owner::All;
        }
        found
    }

    fn curves(&self, value: &dyn Fn(&TracedStep) -> Option<(f64, bool)>) -> Vec<Curve> {
        let all = self.series.iter().enumerate();
        all.flat_map(|(k, s)| runs(Owner::Series(k), self.steps(s.trace), value)).collect()
    }

    fn judged_curves(&self, vehicle: usize, value: &dyn Fn(&TracedVehicle) -> f64) -> Vec<Curve> {
        self.curves(&|step| {
            let other = &step.others[vehicle];
            other.is_present.then(|| (value(other), !other.is_judged))
        })
    }

    fn marks(&self, which: &[Mark], value: &dyn Fn(&TracedStep) -> Option<f64>) -> Vec<PanelMark> {
        let mut marks = Vec::new();
        for (series, of) in self.series.iter().enumerate() {
            for &mark in which {
                let step = of.trace.step_of(mark).and_then(|step| self.steps(of.trace).get(step as usize));
                if let Some((step, value)) = step.and_then(|step| Some((step, value(step)?))) {
                    marks.push(PanelMark { series, mark, at: (step.time_s, value) });
                }
            }
        }
        marks
    }

    /// The contacts with one vehicle.
    fn contacts(&self, vehicle: usize, value: &dyn Fn(&TracedStep) -> Option<f64>) -> Vec<PanelMark> {
        let mut marks = self.marks(&[Mark::Contact], value);
        marks.retain(|mark| usize::from(self.series[mark.series].trace.outcome.contact_with) == vehicle);
        marks
    }
}

/// The last time at which anything but positions changes or the worst value is seen, s.
fn last_change_s(trace: &Trace) -> f64 {
    let state = |step: &TracedStep| {
        let of = |other: &TracedVehicle| (other.v_mps, other.y_m, other.is_present, other.is_judged);
        (step.v_ego_mps, step.is_unsafe, step.others.each_ref().map(of))
    };
    let mut changes =
        trace.steps.windows(2).filter(|pair| state(&pair[0]) != state(&pair[1])).map(|pair| pair[1].time_s);
    let worst = |value: &dyn Fn(&TracedVehicle) -> f64| {
        let of = |step: &TracedStep| {
            let judged = step.others[..trace.vehicles].iter().filter(|other| other.is_judged);
            judged.map(value).fold(f64::INFINITY, f64::min)
        };
        let worst = trace.steps.iter().min_by(|a, b| of(a).total_cmp(&of(b)))?;
        of(worst).is_finite().then_some(worst.time_s)
    };
    let worst = [worst(&|other| other.ttc_s), worst(&|other| -other.btn)];
    let marks = Mark::ALL.map(|mark| trace.step_of(mark).map(|step| trace.time_s(step)));
    changes.next_back().into_iter().chain(worst.into_iter().chain(marks).flatten()).fold(0.0, f64::max)
}

/// A value over time as runs without a gap, cut also where thin begins or ends; such neighbours share a point.
fn runs(owner: Owner, steps: &[TracedStep], value: &dyn Fn(&TracedStep) -> Option<(f64, bool)>) -> Vec<Curve> {
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
                runs.push(Curve { owner, is_thin, points: shared.into_iter().chain([point]).collect() });
            }
            None => runs.push(Curve { owner, is_thin, points: vec![point] }),
        }
        open = true;
    }
    runs
}

fn around(curves: &[Curve], including: &[f64]) -> Reach {
    Reach::Around(curves.iter().flat_map(|c| &c.points).map(|p| p.1).chain(including.iter().copied()).collect())
}

/// The pieces of a curve that are not above `top`, with the points where it crosses it. Infinite values are above.
fn below(curve: Curve, top: f64) -> Vec<Curve> {
    let Curve { owner, is_thin, points } = curve;
    let mut pieces: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
    let crossing = |(t1, v1): (f64, f64), (t2, v2): (f64, f64)| {
        // Towards infinity it is the step's end that crosses.
        let share =
            if v2.is_finite() && v1.is_finite() { (top - v1) / (v2 - v1) } else { f64::from(u8::from(v1 <= top)) };
        (t1 + share * (t2 - t1), top)
    };
    let mut before: Option<(f64, f64)> = None;
    for point in points {
        match (before.map(|b| b.1 <= top), point.1 <= top) {
            (Some(false), true) => pieces.push(vec![crossing(before.unwrap_or(point), point), point]),
            (Some(true), false) => {
                let end = crossing(before.unwrap_or(point), point);
                pieces.last_mut().into_iter().for_each(|piece| piece.push(end));
            }
            (_, true) => pieces.last_mut().into_iter().for_each(|piece| piece.push(point)),
            (_, false) => {}
        }
        before = Some(point);
    }
    pieces.retain(|piece| !piece.is_empty());
    pieces.into_iter().map(|points| Curve { owner, is_thin, points }).collect()
}
