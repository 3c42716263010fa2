//! What a reader of tracks understood: a line per fact, and a figure of the tracks across the road.

use std::collections::BTreeMap;

use serde::Serialize;

use super::plot::{Figure, Plot, PlotAxis, Rule};
use super::tables::wrap;
use lanesweep_support::readable::count;
use lanesweep_support::table::WIDTH;
use lanesweep_traffic::mining::{CategoryCount, counts_text};
use lanesweep_traffic::trajectory::tracks::Understanding;
use lanesweep_traffic::trajectory::{Recording, Track, VehicleClass};

/// Maximum number of tracks of a carriageway that are drawn; beyond it, every n-th is.
const MAX_TRACKS: usize = 400;
/// Maximum number of points of a drawn track.
const MAX_POINTS: usize = 60;
const CAR: &str = "#0072b2";
const TRUCK: &str = "#d55e00";
const LINE: &str = "#000000";

/// What is told of one recording.
#[derive(Debug, Serialize)]
pub struct TrackReport {
    /// The track file.
    pub file: String,
    /// The preset.
    pub preset: String,
    /// The preset was found by the names of the columns.
    pub is_detected: bool,
    /// What was understood.
    pub understanding: Understanding,
    /// Names in the file of the vehicles that have another number.
    pub vehicle_names: BTreeMap<u32, String>,
    /// Found and kept scenarios: cut-ins, cut-outs, leader decelerations.
    pub mined: Vec<CategoryCount>,
}

impl TrackReport {
    /// The report as text: a line per fact, then what is strange.
    pub fn text(&self) -> String {
        let Understanding { recording, facts, findings, .. } = &self.understanding;
        let how = if self.is_detected { "detected by its columns" } else { "as named" };
        let first = [("recording", recording.clone()), ("preset", format!("{} ({how})", self.preset))];
        let last = [("scenarios", counts_text(&self.mined))];
        let mut text = format!("{}\n", self.file);
        for (name, words) in first.iter().chain(facts).chain(&last) {
            text += &hanging(&format!("  {name:<10} "), words);
        }
        for (is_grave, name) in [(true, "  WRONG      "), (false, "  note       ")] {
            let of = findings.iter().filter(|finding| finding.is_grave == is_grave);
            text.extend(of.map(|finding| hanging(name, &finding.text)));
        }
        text + if findings.is_empty() { "  nothing contradicts itself\n" } else { "" }
    }
}

/// Words after a name, wrapped below one another.
fn hanging(name: &str, words: &str) -> String {
    let indent = name.chars().count();
    let wrapped = wrap(words, WIDTH.saturating_sub(indent).max(20));
    format!("{name}{}\n", wrapped.replace('\n', &format!("\n{}", " ".repeat(indent))))
}

/// Positions across the road over positions along it, with the lane lines, from the edge where they begin.
pub fn across(recording: &Recording) -> Figure {
    let range = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    let mut plots = Vec::new();
    for (index, carriageway) in recording.carriageways.iter().enumerate() {
        let tracks: Vec<&Track> = recording.tracks.iter().filter(|track| track.carriageway == index).collect();
        let (begin, end) = range(&mut tracks.iter().flat_map(|track| track.s_m.iter().copied()));
        let left = carriageway.lane_lines_m[0];
        let lines = carriageway.lane_lines_m.iter().map(|line| vec![(0.0, line - left), (end - begin, line - left)]);
        let points = |track: &&Track| -> Vec<(f64, f64)> {
            let step = track.len().div_ceil(MAX_POINTS).max(1);
            let samples = (0..track.len()).step_by(step).chain([track.len() - 1]);
            samples.map(|k| (track.s_m[k] - begin, track.d_m[k] - left)).collect()
        };
        let every = tracks.len().div_ceil(MAX_TRACKS).max(1);
        let of_class = |class: VehicleClass| tracks.iter().step_by(every).filter(move |track| track.class == class);
        let drawn = |class: VehicleClass| of_class(class).map(points).collect::<Vec<_>>();
        let rules = [
            (drawn(VehicleClass::Car), "cars", CAR, 0.7, ""),
            (drawn(VehicleClass::Truck), "lorries", TRUCK, 0.7, ""),
            (lines.collect(), "lane lines", LINE, 1.6, "8,5"),
        ];
        let rules = rules.into_iter().filter(|(runs, ..)| !runs.is_empty());
        let rules = rules.map(|(runs, name, colour, width_px, dash)| Rule {
            runs,
            name: name.to_owned(),
            colour,
            width_px,
            dash,
            ..Rule::default()
        });
        let rules: Vec<Rule> = rules.collect();
        let (low, high) = range(&mut rules.iter().flat_map(|rule| rule.runs.iter().flatten().map(|point| point.1)));
        plots.push(Plot {
            heading: format!("carriageway {}, {} tracks", carriageway.name, count(tracks.len())),
            x: PlotAxis::new("position along the road, m", 0.0, (end - begin).max(1.0)),
            y: PlotAxis::new("position from the left edge of the leftmost lane, m", low, high),
            rules,
            ..Plot::default()
        });
    }
    let of_all = if recording.tracks.len() > MAX_TRACKS { " Of many tracks, every n-th is drawn." } else { "" };
    Figure {
        title: "Positions across the road".to_owned(),
        subtitle: Some(format!("recording {}", recording.id)),
        plots,
        caption: format!("One line is one vehicle.{of_all}"),
        ..Figure::default()
    }
}
