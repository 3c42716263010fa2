//! Lane lines of a carriageway, from the lateral positions of its vehicles: by the names of lanes in the file, by bands of
//! a known width, or by where vehicles drive.

use super::road::median;

/// Lanes are at least so far apart, m.
const MIN_SPACING_M: f64 = 2.2;
/// The middles of neighbouring lanes are at most so far apart, m.
const MAX_SPACING_M: f64 = 6.0;
/// Width of a lane if nothing tells it, m.
const USUAL_WIDTH_M: f64 = 3.6;
/// A lane has at least this fraction of the samples.
const MIN_FRACTION: f64 = 0.004;
/// Standard deviation of the kernel over lateral positions, m.
const KERNEL_M: f64 = 0.3;
/// Raster of lateral positions, m.
const RASTER_M: f64 = 0.1;
/// A valley between two lanes is lower than this fraction of the lower peak.
const VALLEY: f64 = 0.7;
/// Maximum number of lanes.
const MAX_LANES: usize = 32;

/// Lateral position and name of the lane of a sample.
pub(super) type Lateral = (f64, Option<u32>);

/// Where lane lines come from.
pub(super) const BY_NAME: &str = "the names of lanes in the file";
pub(super) const BY_WIDTH: &str = "bands of the width in the preset";

/// Lane lines from left to right; `None` without samples.
pub(super) fn lane_lines(samples: &[Lateral], width_m: Option<f64>) -> Option<(Vec<f64>, &'static str)> {
    if samples.is_empty() {
        return None;
    }
    let named = centres_by_name(samples);
    let (centres, source) = match (named.is_empty(), width_m) {
        (_, Some(width_m)) => return Some((bands(samples, width_m), BY_WIDTH)),
        (false, None) => (named, BY_NAME),
        (true, None) => (centres_by_position(samples), "where vehicles drive"),
    };
    Some((lines_around(&centres), source))
}

/// The centres, with those of lanes between them that no vehicle uses: of few vehicles, none may be in neighbouring lanes.
fn with_empty_lanes(centres: &[f64]) -> Vec<f64> {
    let mut all = vec![centres[0]];
    for pair in centres.windows(2) {
        let lanes = ((pair[0] - pair[1]) / USUAL_WIDTH_M).round().clamp(1.0, MAX_LANES as f64);
        all.extend((1..=lanes as usize).map(|lane| pair[0] + (pair[1] - pair[0]) * lane as f64 / lanes));
    }
    all
}

/// Lines midway between the centres, and beyond the outer ones.
fn lines_around(centres: &[f64]) -> Vec<f64> {
    let is_sparse = centres.windows(2).all(|pair| pair[0] - pair[1] > MAX_SPACING_M);
    let centres = if is_sparse { &with_empty_lanes(centres) } else { centres };
    let mut spacings: Vec<f64> = centres.windows(2).map(|pair| pair[0] - pair[1]).collect();
    let usual = if spacings.is_empty() { USUAL_WIDTH_M } else { median(&mut spacings) };
    let half = usual.clamp(MIN_SPACING_M, MAX_SPACING_M) / 2.0;
    let mut lines = vec![centres[0] + half];
    lines.extend(centres.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])));
    lines.push(centres[centres.len() - 1] - half);
    lines
}

/// Bands of the width, as many as have vehicles.
fn bands(samples: &[Lateral], width_m: f64) -> Vec<f64> {
    let mut band: Vec<i64> = samples.iter().map(|(d, _)| (d / width_m).floor() as i64).collect();
    band.sort_unstable();
    let used = |at: &&i64| {
        let from = band.partition_point(|b| b < *at);
        let to = band.partition_point(|b| b <= *at);
        (to - from) as f64 >= MIN_FRACTION * band.len() as f64
    };
    let low = *band.iter().find(used).unwrap_or(&band[0]);
    let high = *band.iter().rev().find(used).unwrap_or(&band[0]);
    let high = high.min(low + MAX_LANES as i64);
    (low..=high + 1).rev().map(|line| line as f64 * width_m).collect()
}

/// Medians of the names' lateral positions, from left to right; names of one lane along the road are joined.
fn centres_by_name(samples: &[Lateral]) -> Vec<f64> {
    let mut sorted: Vec<Lateral> = samples.iter().copied().filter(|(_, name)| name.is_some()).collect();
    sorted.sort_by(|a, b| a.1.cmp(&b.1).then(a.0.total_cmp(&b.0)));
    let total = sorted.len() as f64;
    let groups = sorted.chunk_by(|a, b| a.1 == b.1);
    let mut centres: Vec<(f64, f64)> = groups
        .filter(|group| group.len() as f64 >= MIN_FRACTION * total)
        .map(|group| {
            let quarter = |part: usize| group[part * group.len() / 4].0;
            // A ramp that joins a lane is not beside the others yet.
            let is_steady = quarter(3) - quarter(1) < MIN_SPACING_M / 2.0;
            (quarter(2), group.len() as f64 * if is_steady { 1.0 } else { 1e-6 })
        })
        .collect();
    centres.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut joined: Vec<(f64, f64)> = Vec::new();
    for (d_m, weight) in centres {
        match joined.last_mut() {
            Some((of, sum)) if *of - d_m < MIN_SPACING_M => {
                *of = (*of * *sum + d_m * weight) / (*sum + weight);
                *sum += weight;
            }
            _ => joined.push((d_m, weight)),
        }
    }
    joined.into_iter().map(|(d_m, _)| d_m).take(MAX_LANES).collect()
}

/// Peaks of the density of lateral positions, from left to right.
fn centres_by_position(samples: &[Lateral]) -> Vec<f64> {
    let mut d: Vec<f64> = samples.iter().map(|(d_m, _)| *d_m).collect();
    d.sort_by(f64::total_cmp);
    // Without the outermost ones, which may be anywhere.
    let cut = d.len() / 500;
    let d = &d[cut..d.len() - cut];
    let (low, high) = (d[0] - 1.0, d[d.len() - 1] + 1.0);
    let cells = (((high - low) / RASTER_M).ceil() as usize + 1).min(20_000);
    let mut counts = vec![0.0; cells];
    for value in d {
        counts[(((value - low) / RASTER_M) as usize).min(cells - 1)] += 1.0;
    }
    let reach = (4.0 * KERNEL_M / RASTER_M) as i64;
    let kernel = |offset: i64| libm::exp(-0.5 * (offset as f64 * RASTER_M / KERNEL_M).powi(2));
    let smooth = |at: usize| -> f64 {
        let near = (-reach..=reach)
            .filter_map(|offset| Some((offset, *counts.get(usize::try_from(at as i64 + offset).ok()?)?)));
        near.map(|(offset, count)| kernel(offset) * count).sum()
    };
    let density: Vec<f64> = (0..cells).map(smooth).collect();
    let is_peak = |at: &usize| {
        let left = if *at == 0 { 0.0 } else { density[at - 1] };
        density[*at] > left && density[*at] >= density.get(at + 1).copied().unwrap_or(0.0)
    };
    let mut peaks: Vec<usize> = (0..cells).filter(is_peak).collect();
    let highest = peaks.iter().map(|at| density[*at]).fold(0.0, f64::max);
    peaks.retain(|at| density[*at] >= 0.01 * highest);
    // The lower of two peaks that are too near, or without a valley between them, is none.
    loop {
        let valley = |a: usize, b: usize| density[a..=b].iter().copied().fold(f64::INFINITY, f64::min);
        let bad = (1..peaks.len()).find(|&i| {
            let (a, b) = (peaks[i - 1], peaks[i]);
            ((b - a) as f64) * RASTER_M < MIN_SPACING_M || valley(a, b) > VALLEY * density[a].min(density[b])
        });
        let Some(i) = bad else { break };
        peaks.remove(if density[peaks[i - 1]] < density[peaks[i]] { i - 1 } else { i });
    }
    // A raster is off to one side, the median of the vehicles around a peak is not.
    let refined = |at: usize| {
        let peak = low + (at as f64 + 0.5) * RASTER_M;
        let from = d.partition_point(|value| *value < peak - 0.5 * MIN_SPACING_M);
        let near = &d[from..d.partition_point(|value| *value <= peak + 0.5 * MIN_SPACING_M)];
        if near.is_empty() { peak } else { 0.5 * (near[(near.len() - 1) / 2] + near[near.len() / 2]) }
    };
    let mut centres: Vec<f64> = peaks.into_iter().map(refined).collect();
    centres.reverse();
    centres.truncate(MAX_LANES);
    if centres.is_empty() { vec![d[d.len() / 2]] } else { centres }
}
