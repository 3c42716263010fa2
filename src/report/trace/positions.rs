//! A case from above: the vehicles at the instants that decide it, and the same moving.
//!
//! All positions are relative to the ego. Each pair of vehicles is drawn with the mean of its lengths, which is all that
//! a lane knows; their gap is exact.

use super::panels::Shown;
use super::{CELL, MARGIN_PX, TraceFigure, thousandths};
use crate::engine::{StepMark, Trace, TracedStep};
use crate::report::plot::{
    Anchor, Canvas, Cells, Figure, Fill, FilledCell, GREY, Height, Plot, PlotAxis, Rule, number,
};

const EGO: &str = "#0072b2";
const OTHERS: [(&str, &str); 2] = [("other vehicle", "#d55e00"), ("vehicle ahead of it", "#8c8c8c")];
/// Half the width of a lane, m.
const HALF_LANE_M: f64 = 1.75;
/// Frames per second of the moving figure.
const RATE_HZ: f64 = 12.5;

/// A vehicle: opposite corners, m ahead of the ego's middle and beside it.
type Corners = [(f64, f64); 2];
/// Names, colours and places of vehicles.
type Vehicles = Vec<(&'static str, &'static str, Corners)>;

fn around((x, y): (f64, f64), length_m: f64, width_m: f64) -> Corners {
    [(x - length_m / 2.0, y - width_m / 2.0), (x + length_m / 2.0, y + width_m / 2.0)]
}

fn ego(trace: &Trace) -> Corners {
    around((0.0, 0.0), trace.mean_lengths_m[0], trace.ego_width_m)
}

/// The vehicles in view.
fn others(trace: &Trace, step: &TracedStep) -> Vec<(usize, Corners)> {
    let here = step.others[..trace.vehicles].iter().enumerate().filter(|(_, other)| other.is_present);
    here.map(|(at, other)| {
        let place = (other.x_m - step.x_ego_m, other.y_m);
        (at, around(place, trace.mean_lengths_m[at], trace.widths_m[at]))
    })
    .collect()
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
    Some((step, format!("smallest gap {} m, at {} s", number(gap(step)), thousandths(step.time_s))))
}

/// Ends of both axes around rectangles and the ego's lane.
fn view(rectangles: impl Iterator<Item = Corners>) -> ((f64, f64), (f64, f64)) {
    let wider = |(low, high): (f64, f64), a: f64, b: f64| (low.min(a), high.max(b));
    rectangles.fold(((-8.0, 12.0), (-HALF_LANE_M - 0.3, HALF_LANE_M + 0.3)), |(x, y), [from, to]| {
        (wider(x, from.0 - 2.0, to.0 + 2.0), wider(y, from.1 - 0.3, to.1 + 0.3))
    })
}

impl TraceFigure<'_> {
    /// The vehicles at the start and, for every lane, at its contact or smallest gap; a row each.
    pub fn positions(&self) -> Figure {
        let of = |trace: &'_ Trace, step: &TracedStep| {
            let vehicles = others(trace, step).into_iter().map(|(at, corners)| (OTHERS[at].0, OTHERS[at].1, corners));
            std::iter::once(("ego", EGO, ego(trace))).chain(vehicles).collect::<Vehicles>()
        };
        let start = self.series.first().and_then(|s| Some(("start".to_owned(), of(s.trace, s.trace.steps.first()?))));
        let later = self.series.iter().filter_map(|s| {
            let (step, what) = decisive(s.trace)?;
            Some((format!("{}: {what}", s.name), of(s.trace, step)))
        });
        let rows: Vec<(String, Vehicles)> = start.into_iter().chain(later).collect();
        let (x, y) = view(rows.iter().flat_map(|(_, vehicles)| vehicles).map(|vehicle| vehicle.2));
        let plot = |(heading, vehicles): (String, Vehicles)| {
            let fill = |colour: &str| Fill { colour: colour.to_owned(), ..Fill::default() };
            let key = vehicles.iter().map(|(name, colour, _)| ((*name).to_owned(), fill(colour))).collect();
            let cell = |(name, colour, corners): &(&str, &str, Corners)| FilledCell {
                corners: *corners,
                fill: fill(colour),
                tip: (*name).to_owned(),
            };
            let lane = [-HALF_LANE_M, HALF_LANE_M].map(|edge| vec![(x.0, edge), (x.1, edge)]).to_vec();
            let edges = Rule { runs: lane, colour: GREY, width_px: 1.0, dash: "14,6", ..Rule::default() };
            Plot {
                heading,
                x: PlotAxis::exactly("m ahead of the ego's middle", x.0, x.1),
                y: PlotAxis::exactly("", y.0, y.1),
                layers: vec![Cells { cells: vehicles.iter().map(cell).collect(), key }.into(), edges.into()],
                height: Height::OfWidth(((y.1 - y.0) / (x.1 - x.0)).clamp(0.07, 0.2)),
                ..Plot::default()
            }
        };
        Figure {
            title: format!("{}, from above", self.title),
            subtitle: self.subtitle.clone(),
            plots: rows.into_iter().map(plot).collect(),
            columns: 1,
            caption:
                "Lateral positions in m, positive on the other vehicle's side. Long dashes: edges of a lane 3.5 m wide."
                    .to_owned(),
            ..Figure::default()
        }
    }

    /// The vehicles in motion, a row per lane, in real time and over again, as an SVG document.
    pub fn animation(&self) -> String {
        let until_s = Shown::of(&self.series, self.until_s).until_s.max(0.1);
        let frames: Vec<f64> = (0..=(until_s * RATE_HZ) as usize).map(|k| k as f64 / RATE_HZ).collect();
        let at = |trace: &'_ Trace, time_s: f64| trace.steps.partition_point(|step| step.time_s <= time_s).max(1) - 1;
        let seen = self.series.iter().flat_map(|s| {
            frames
                .iter()
                .filter_map(|time_s| s.trace.steps.get(at(s.trace, *time_s)))
                .flat_map(|step| others(s.trace, step))
        });
        let (x, y) = view(seen.map(|(_, corners)| corners));
        let frame = Figure { title: self.title.clone(), subtitle: self.subtitle.clone(), ..Figure::default() };
        let width_px = 512.0;
        let scale = width_px / (x.1 - x.0);
        let down = |v: f64| (y.1 - v) * scale.max(6.0);
        let row_px = down(y.0) + 34.0;
        let draw = |canvas: &mut Canvas, top: f64| {
            for (row, series) in self.series.iter().enumerate() {
                let top = top + row as f64 * row_px + 20.0;
                let place = |(px, py): (f64, f64)| (MARGIN_PX + (px - x.0) * scale, top + down(py));
                let what = decisive(series.trace).map_or(String::new(), |(_, what)| format!(": {what}"));
                canvas.text((MARGIN_PX, top - 5.0), &format!("{}{what}", series.name), CELL, Anchor::Start);
                for edge in [-HALF_LANE_M, HALF_LANE_M] {
                    canvas.line(place((x.0, edge)), place((x.1, edge)), GREY, 1.0);
                }
                canvas.fill_rect(ego(series.trace).map(place), EGO);
                for (vehicle, (_, colour)) in OTHERS.iter().enumerate().take(series.trace.vehicles) {
                    let course: Vec<Option<Corners>> = frames
                        .iter()
                        .map(|time_s| {
                            let step = series.trace.steps.get(at(series.trace, *time_s))?;
                            others(series.trace, step)
                                .into_iter()
                                .find(|(k, _)| *k == vehicle)
                                .map(|(_, corners)| corners)
                        })
                        .collect();
                    let Some(first) = course.iter().flatten().next().copied() else { continue };
                    let moves: Vec<String> = course
                        .iter()
                        .map(|corners| {
                            let ((x0, y0), (x1, y1)) = (place(first[0]), place(corners.unwrap_or(first)[0]));
                            format!("{:.1},{:.1}", x1 - x0, y1 - y0)
                        })
                        .collect();
                    let shown: Vec<&str> = course.iter().map(|c| if c.is_some() { "1" } else { "0" }).collect();
                    let motion = format!(
                        "<animateTransform attributeName=\"transform\" type=\"translate\" dur=\"{until_s:.2}s\" \
                         repeatCount=\"indefinite\" values=\"{}\" /><animate attributeName=\"opacity\" \
                         dur=\"{until_s:.2}s\" repeatCount=\"indefinite\" calcMode=\"discrete\" values=\"{}\" />",
                        moves.join(";"),
                        shown.join(";")
                    );
                    canvas.group("class=\"moving\"", "", |canvas| {
                        canvas.element(&motion);
                        canvas.fill_rect(first.map(place), colour);
                    });
                }
            }
            top + self.series.len() as f64 * row_px
        };
        Figure {
            caption: format!(
                "In real time, {} s, relative to the ego (blue). A lane that has ended stays as it is.",
                thousandths(until_s)
            ),
            ..frame
        }
        .svg_with(draw)
    }
}
