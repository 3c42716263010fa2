//! What a reader of tracks understood: its text, and figures of the tracks in time and across the road.

use std::collections::BTreeMap;

use serde::Serialize;

use super::plot::{Figure, Plot, PlotAxis, Rule};
use super::tables::wrap;
use crate::support::readable::{count, count_of, significant};
use crate::support::table::WIDTH;
use crate::traffic::mining::{CategoryCount, counts_text};
use crate::traffic::trajectory::tracks::{Understanding, UnderstoodCarriageway};
use crate::traffic::trajectory::{Recording, Track, VehicleClass};

/// Maximum number of tracks of a figure; beyond it, every n-th is drawn.
const MAX_TRACKS: usize = 400;
/// Tracks that begin within this time are drawn over time, s.
const SHOWN_S: f64 = 120.0;
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
    /// Found and kept scenarios: cut-ins, cut-outs, leader decelerations.
    pub mined: Vec<CategoryCount>,
    /// The same without the preset's smoothing.
    pub mined_without_smoothing: Option<Vec<CategoryCount>>,
}

impl TrackReport {
    fn how(&self) -> &'static str {
        if self.is_detected { "detected by its columns" } else { "as named" }
    }

    /// The report as text.
    pub fn text(&self) -> String {
        let how = self.how();
        let mut text = format!(
            "{}\n  {:<10} {}\n  {:<10} {} ({how})\n",
            self.file, "recording", self.understanding.recording, "preset", self.preset
        );
        let mut lines = self.understanding.lines();
        lines.extend(mined(&self.mined, self.mined_without_smoothing.clone()));
        lines.iter().for_each(|(name, words)| text += &line(name, words));
        let findings = &self.understanding.findings;
        if findings.is_empty() {
            text += "  nothing contradicts itself\n";
        }
        for is_grave in [true, false] {
            for finding in findings.iter().filter(|finding| finding.is_grave == is_grave) {
                text += &hanging(if is_grave { "  WRONG      " } else { "  note       " }, &finding.text);
            }
        }
        text
    }
}

/// Recordings that are told one by one; of more, what they have in common and what differs.
const MAX_TOLD: usize = 5;
/// Recordings that a line names.
const MAX_NAMED: usize = 5;

/// What was understood of recordings, as text.
pub fn report_text(reports: &[TrackReport]) -> String {
    if reports.len() <= MAX_TOLD {
        return reports.iter().map(TrackReport::text).collect::<Vec<_>>().join("\n");
    }
    let mut lines: Vec<(&str, String)> = Vec::new();
    let told = |name: &'static str, words: &dyn Fn(&TrackReport) -> String| {
        variants(reports, words).into_iter().map(move |words| (name, words))
    };
    let same = |name: &'static str| {
        let words = |report: &TrackReport| {
            let lines = report.understanding.lines();
            lines.into_iter().find(|(of, _)| *of == name).map(|(_, words)| words).unwrap_or_default()
        };
        told(name, &words).filter(|(_, words)| !words.is_empty())
    };
    let of_all = |value: fn(&Understanding) -> f64| reports.iter().map(|of| value(&of.understanding)).sum::<f64>();
    let total =
        |value: fn(&Understanding) -> u64| count(reports.iter().map(|of| value(&of.understanding)).sum::<u64>());
    let range = |value: fn(&Understanding) -> f64| {
        let values = reports.iter().map(|report| value(&report.understanding));
        let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
        format!("{} to {}", significant(low, 3), significant(high, 3))
    };
    lines.extend(told("preset", &|report| format!("{} ({})", report.preset, report.how())));
    lines.extend(same("rate"));
    let vehicles = format!(
        "{} cars, {} lorries; {} samples, {} h, {} km",
        total(|of| of.cars),
        total(|of| of.trucks),
        total(|of| of.samples),
        significant(of_all(|of| of.hours), 3),
        significant(of_all(|of| of.km), 4)
    );
    lines.push(("vehicles", vehicles));
    lines.extend(same("columns"));
    lines.extend(same("reference"));
    let mut classes: BTreeMap<&str, u64> = BTreeMap::new();
    for (class, number) in reports.iter().flat_map(|report| &report.understanding.classes) {
        *classes.entry(class).or_default() += number;
    }
    if !classes.is_empty() {
        let words: Vec<String> =
            classes.iter().take(12).map(|(class, number)| format!("{} {class}", count(*number))).collect();
        lines.push(("classes", words.join(", ")));
    }
    let straight = |of: &TrackReport| if of.understanding.is_straight { "straight" } else { "curved" }.to_owned();
    lines.extend(told("road", &straight));
    let (length_m, wander_m) = (range(|of| of.length_m), range(|of| of.wander_m));
    lines.push(("", format!("{length_m} m in view; vehicles wander by {wander_m} m around its line")));
    let lanes = |report: &TrackReport| {
        let of = |of: &UnderstoodCarriageway| format!("{} lanes {} from {}", of.lanes, of.way(), of.source);
        report.understanding.carriageways.iter().map(of).collect::<Vec<_>>().join("; ")
    };
    lines.extend(told("lanes", &lanes));
    let speeds = |report: &TrackReport| {
        let of = &report.understanding;
        let from = |number: u64, what: &str| if number == 0 { "as given".to_owned() } else { format!("from {what}") };
        let (along, across) = (from(of.derived_speeds, "positions"), from(of.derived_lateral, "positions"));
        format!("{along}, lateral ones {across}, accelerations {}", from(of.derived_accelerations, "speeds"))
    };
    lines.extend(told("speeds", &speeds));
    let sum = |mined: &dyn Fn(&TrackReport) -> Option<Vec<CategoryCount>>| {
        reports.iter().filter_map(mined).reduce(|sum, mined| {
            let add = |(a, b): (&CategoryCount, CategoryCount)| CategoryCount {
                found: a.found + b.found,
                kept: a.kept + b.kept,
            };
            sum.iter().zip(mined).map(add).collect()
        })
    };
    lines.extend(mined(
        &sum(&|of| Some(of.mined.clone())).unwrap_or_default(),
        sum(&|of| of.mined_without_smoothing.clone()),
    ));
    let mut text = format!("{} recordings; JSON output tells each of them\n", count_of(reports.len()));
    lines.iter().for_each(|(name, words)| text += &line(name, words));
    // Findings that differ in their numbers are one kind.
    let kind = |text: &str| text.replace(|c: char| c.is_ascii_digit() || ".,".contains(c), "");
    let mut kinds: BTreeMap<(bool, String), (&str, Vec<&TrackReport>)> = BTreeMap::new();
    for report in reports {
        for finding in &report.understanding.findings {
            kinds.entry((!finding.is_grave, kind(&finding.text))).or_insert((&finding.text, Vec::new())).1.push(report);
        }
    }
    for ((is_note, _), (first, of)) in &kinds {
        let named = if of.len() == reports.len() { "all".to_owned() } else { names(of) };
        text += &hanging(if *is_note { "  note       " } else { "  WRONG      " }, &format!("{named}: {first}"));
    }
    let calm = reports.iter().filter(|report| report.understanding.findings.is_empty()).count();
    if calm > 0 {
        text += &format!("  nothing contradicts itself in {}\n", count_of(calm));
    }
    text
}

/// The words of each recording once, those of most recordings first; others with the recordings that have them.
fn variants(reports: &[TrackReport], words: &dyn Fn(&TrackReport) -> String) -> Vec<String> {
    let mut found: BTreeMap<String, Vec<&TrackReport>> = BTreeMap::new();
    reports.iter().for_each(|report| found.entry(words(report)).or_default().push(report));
    let mut found: Vec<(String, Vec<&TrackReport>)> = found.into_iter().collect();
    found.sort_by_key(|(_, of)| std::cmp::Reverse(of.len()));
    let is_one = found.len() == 1;
    let told = |(at, (words, of)): (usize, (String, Vec<&TrackReport>))| match at {
        _ if is_one || words.is_empty() => words,
        0 => format!("{words} ({} recordings)", count_of(of.len())),
        _ => format!("{words} ({})", names(&of)),
    };
    found.into_iter().enumerate().map(told).collect()
}

/// The files of some recordings.
fn names(reports: &[&TrackReport]) -> String {
    let first: Vec<&str> =
        reports.iter().take(MAX_NAMED).map(|report| report.understanding.recording.as_str()).collect();
    let more = reports.len().saturating_sub(MAX_NAMED);
    let more = if more > 0 { format!(" and {} more", count_of(more)) } else { String::new() };
    format!("{} recordings: {}{more}", count_of(reports.len()), first.join(", "))
}

/// The lines of found scenarios, with the preset's smoothing and without.
fn mined(
    counts: &[CategoryCount],
    without: Option<Vec<CategoryCount>>,
) -> impl Iterator<Item = (&'static str, String)> {
    let without = without.map(|without| ("", format!("without smoothing {}", counts_text(&without))));
    [("scenarios", counts_text(counts))].into_iter().chain(without)
}

fn line(name: &str, words: &str) -> String {
    hanging(&format!("  {name:<10} "), words)
}

/// Words after a name, wrapped below one another.
fn hanging(name: &str, words: &str) -> String {
    let indent = name.chars().count();
    let wrapped = wrap(words, WIDTH.saturating_sub(indent).max(20));
    format!("{name}{}\n", wrapped.replace('\n', &format!("\n{}", " ".repeat(indent))))
}

/// Tracks of a carriageway and class as lines.
fn runs(
    recording: &Recording,
    carriageway: usize,
    class: VehicleClass,
    value: impl Fn(&Track, usize) -> (f64, f64),
) -> Vec<Vec<(f64, f64)>> {
    let of: Vec<&Track> = recording.tracks.iter().filter(|track| track.carriageway == carriageway).collect();
    let every = of.len().div_ceil(MAX_TRACKS).max(1);
    let points = |track: &&Track| {
        let step = track.len().div_ceil(MAX_POINTS).max(1);
        (0..track.len()).step_by(step).chain([track.len() - 1]).map(|k| value(track, k)).collect()
    };
    of.into_iter().step_by(every).filter(|track| track.class == class).map(|track| points(&track)).collect()
}

fn figure(
    recording: &Recording,
    title: &str,
    labels: [&str; 2],
    value: impl Fn(&Track, usize) -> (f64, f64) + Copy,
    lines: impl Fn(usize) -> Vec<Vec<(f64, f64)>>,
) -> Figure {
    let mut plots = Vec::new();
    for (index, carriageway) in recording.carriageways.iter().enumerate() {
        let mut rules: Vec<Rule> = Vec::new();
        let (mut xs, mut ys) = (Vec::new(), Vec::new());
        for (class, name, colour) in [(VehicleClass::Car, "cars", CAR), (VehicleClass::Truck, "lorries", TRUCK)] {
            let runs = runs(recording, index, class, value);
            xs.extend(runs.iter().flatten().map(|point| point.0));
            ys.extend(runs.iter().flatten().map(|point| point.1));
            if !runs.is_empty() {
                rules.push(Rule { runs, name: name.to_owned(), colour, width_px: 0.7, ..Rule::default() });
            }
        }
        let lane_lines = lines(index);
        ys.extend(lane_lines.iter().flatten().map(|point| point.1));
        if !lane_lines.is_empty() {
            let name = "lane lines".to_owned();
            let (runs, dash) = (lane_lines, "8,5");
            rules.push(Rule { runs, name, colour: LINE, width_px: 1.6, dash, ..Rule::default() });
        }
        let axis = |label: &str, values: &[f64]| {
            let (low, high) =
                values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
            let (low, high) = if low < high { (low, high) } else { (low - 1.0, low + 1.0) };
            PlotAxis::exactly(label, low, high)
        };
        let tracks = recording.tracks.iter().filter(|track| track.carriageway == index).count();
        plots.push(Plot {
            heading: format!("carriageway {}, {} tracks", carriageway.name, count_of(tracks)),
            x: axis(labels[0], &xs),
            y: axis(labels[1], &ys),
            rules,
            ..Plot::default()
        });
    }
    let of_all = if recording.tracks.len() > MAX_TRACKS { " Of many tracks, every n-th is drawn." } else { "" };
    Figure {
        title: title.to_owned(),
        subtitle: Some(format!("recording {}", recording.id)),
        plots,
        caption: format!("One line is one vehicle.{of_all}"),
        ..Figure::default()
    }
}

/// Where the road in view begins, m, by carriageway; figures count from there.
fn begins_m(recording: &Recording) -> Vec<f64> {
    let mut begins = vec![f64::INFINITY; recording.carriageways.len()];
    for track in &recording.tracks {
        let first = track.s_m.iter().copied().fold(f64::INFINITY, f64::min);
        begins[track.carriageway] = begins[track.carriageway].min(first);
    }
    begins
}

/// Positions along the road over time, from the first frame on.
pub fn space_time(recording: &Recording) -> Figure {
    let (rate_hz, begins) = (recording.frame_rate_hz, begins_m(recording));
    let first = recording.tracks.iter().map(|track| track.first_frame).min().unwrap_or(0);
    let value = |track: &Track, k: usize| {
        ((track.first_frame - first + k as i64) as f64 / rate_hz, track.s_m[k] - begins[track.carriageway])
    };
    let shown = Recording {
        tracks: recording
            .tracks
            .iter()
            .filter(|track| ((track.first_frame - first) as f64) < SHOWN_S * rate_hz)
            .cloned()
            .collect(),
        ..recording.clone()
    };
    figure(&shown, "Positions over time, first minutes", ["time, s", "position along the road, m"], value, |_| {
        Vec::new()
    })
}

/// Positions across the road over positions along it, with the lane lines.
pub fn across(recording: &Recording) -> Figure {
    let begins = begins_m(recording);
    let left = |carriageway: usize| recording.carriageways[carriageway].lane_lines_m[0];
    let value =
        |track: &Track, k: usize| (track.s_m[k] - begins[track.carriageway], track.d_m[k] - left(track.carriageway));
    let lines = |index: usize| {
        let here = || recording.tracks.iter().filter(move |track| track.carriageway == index);
        let high = here().flat_map(|track| track.s_m.iter().copied()).fold(f64::NEG_INFINITY, f64::max) - begins[index];
        let lines = &recording.carriageways[index].lane_lines_m;
        lines.iter().map(|line| vec![(0.0, line - lines[0]), (high, line - lines[0])]).collect()
    };
    let labels = ["position along the road, m", "position from the left edge of the leftmost lane, m"];
    figure(recording, "Positions across the road", labels, value, lines)
}
