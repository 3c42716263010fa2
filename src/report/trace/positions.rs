//! A case from above: the vehicles at the instants that decide it.
//!
//! All positions are relative to the ego. Each pair of vehicles is drawn with the mean of its lengths, which is all that
//! a lane knows; their gap is exact.

use super::{TraceFigure, thousandths};
use crate::plot::{Cells, Figure, FilledCell, GREY, Height, Plot, PlotAxis, Rule};
use lanesweep_engine::{StepMark, Trace, TracedStep};
use lanesweep_support::readable::plain;

/// Names and colours of the vehicles.
const VEHICLES: [(&str, &str); 3] =
    [("ego", "#1a1a1a"), ("other vehicle", "#8c8c8c"), ("vehicle ahead of it", "#cfcfcf")];
/// How far ahead of the ego is shown, m.
const VIEW_M: f64 = 120.0;

/// A vehicle: opposite corners, m ahead of the ego's middle and beside it.
type Corners = [(f64, f64); 2];

/// The ego and the others; `None` where one is not in view.
fn vehicles(trace: &Trace, step: &TracedStep) -> [Option<Corners>; 3] {
    let around = |(x, y): (f64, f64), length_m: f64, width_m: f64| {
        [(x - length_m / 2.0, y - width_m / 2.0), (x + length_m / 2.0, y + width_m / 2.0)]
    };
    let other = |at: usize| {
        let other = &step.others[at];
        let place = (other.x_m - step.x_ego_m, other.y_m);
        let is_there = at < trace.vehicles && other.is_present;
        is_there.then(|| around(place, trace.mean_lengths_m[at], trace.widths_m[at]))
    };
    [Some(around((0.0, 0.0), trace.mean_lengths_m[0], trace.ego_width_m)), other(0), other(1)]
}

/// The step of the contact, else that of the smallest gap, and what it is.
fn decisive(trace: &Trace) -> Option<(&TracedStep, String)> {
    if let Some(step) = trace.step_of(StepMark::Contact).and_then(|step| trace.steps.get(step as usize)) {
        return Some((step, format!("contact at {} s", thousandths(step.time_s))));
    }
    let gap = |step: &TracedStep| {
        let judged = step.others[..trace.vehicles].iter().filter(|other| other.is_present && other.is_judged);
        judged.map(|other| other.gap_m).fold(f64::INFINITY, f64::min)
    };
    let step = trace.steps.iter().min_by(|a, b| gap(a).total_cmp(&gap(b))).filter(|step| gap(step).is_finite())?;
    Some((step, format!("smallest gap {} m, at {} s", plain(gap(step), 3), thousandths(step.time_s))))
}

/// A plot's heading, and its vehicles.
type Row = (String, [Option<Corners>; 3]);

impl TraceFigure<'_> {
    /// The vehicles at the start and, for every lane, at its contact or smallest gap; a row each.
    pub(crate) fn positions(&self) -> Figure {
        let start = self.series.first().and_then(|s| {
            let name = format!("start: gap {} m", plain(s.trace.initial_gap_m, 3));
            Some((s.trace, s.trace.steps.first()?, name))
        });
        let later = self.series.iter().filter_map(|s| {
            let (step, what) = decisive(s.trace)?;
            Some((s.trace, step, format!("{}: {what}", s.name)))
        });
        let row = |(trace, step, heading): (&Trace, _, _)| (heading, vehicles(trace, step));
        self.seen_from_above(start.into_iter().chain(later).map(row).collect())
    }

    fn seen_from_above(&self, rows: Vec<Row>) -> Figure {
        let half_lane_m = self.lane_width_m() / 2.0;
        let seen = rows.iter().flat_map(|row| row.1).flatten();
        let wider = |(low, high): (f64, f64), a: f64, b: f64| (low.min(a), high.max(b));
        let (x, y) = seen.fold(((-8.0, 12.0), (-half_lane_m - 0.3, half_lane_m + 0.3)), |(x, y), [from, to]| {
            (wider(x, from.0 - 2.0, to.0 + 2.0), wider(y, from.1 - 0.3, to.1 + 0.3))
        });
        let cut = if x.1 > VIEW_M { "What is farther than 120 m ahead is not shown. " } else { "" };
        let (x, lane_m) = ((x.0, x.1.min(VIEW_M)), plain(2.0 * half_lane_m, 3));
        let plot = |(heading, vehicles): Row| {
            let cell = |(corners, (tip, colour)): (Option<Corners>, (&'static str, &'static str))| {
                Some(FilledCell { corners: corners?, colour, tip })
            };
            let cells: Vec<FilledCell> = vehicles.into_iter().zip(VEHICLES).filter_map(cell).collect();
            let key = cells.iter().map(|cell| (cell.tip.to_owned(), cell.colour)).collect();
            let lane = [-half_lane_m, half_lane_m].map(|edge| vec![(x.0, edge), (x.1, edge)]).to_vec();
            let edges = Rule { runs: lane, colour: GREY, width_px: 1.0, dash: "14,6", ..Rule::default() };
            Plot {
                heading,
                x: PlotAxis::new("m ahead of the ego's middle", x.0, x.1),
                y: PlotAxis::new("", y.0, y.1),
                cells: Some(Cells { cells, key }),
                rules: vec![edges],
                height: Height::OfWidth(((y.1 - y.0) / (x.1 - x.0)).clamp(0.07, 0.2)),
                ..Plot::default()
            }
        };
        Figure {
            title: format!("{}, from above", self.title),
            subtitle: self.subtitle.clone(),
            plots: rows.into_iter().map(plot).collect(),
            columns: 1,
            caption: format!(
                "{cut}Lateral positions in m, positive on the other vehicle's side. Long dashes: edges of a lane {lane_m} m wide."
            ),
            ..Figure::default()
        }
    }
}
