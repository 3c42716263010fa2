//! Figures of the traffic in recordings, by definitions of their own: the miner is not used here.

use crate::common::quintic;
use lanesweep::traffic::trajectory::{Recording, Track, VehicleClass};

/// Lateral speed above which a vehicle is seen to change lane, m/s.
const CHANGING_MPS: f64 = 0.1;
/// A vehicle that enters a lane this much or less before the next one cuts in, s.
const CUT_IN_WITHIN_S: f64 = 4.0;

#[derive(Debug, Default)]
pub struct Traffic {
    pub rows: usize,
    pub vehicles: usize,
    pub flow_per_direction_vehph: f64,
    pub density_per_lane_vehpkm: f64,
    pub visible_s: Vec<f64>,
    pub mean_speeds_mps: [Vec<f64>; 2],
    pub lengths_m: [Vec<f64>; 2],
    pub widths_m: [Vec<f64>; 2],
    pub driven_km: f64,
    pub crossings: usize,
    pub complete_changes: usize,
    /// Duration of the quintic with the change's way and largest lateral speed.
    pub change_durations_s: Vec<f64>,
    /// Root mean square distance from that quintic, as a share of the way.
    pub quintic_residuals: Vec<f64>,
    pub cut_in_headways_s: Vec<f64>,
    pub headways_s: Vec<f64>,
}

/// Index of a class in the pairs above.
pub fn class_index(class: VehicleClass) -> usize {
    usize::from(class == VehicleClass::Truck)
}

/// Counts over all recordings, each `duration_s` long with `window_m` of road.
pub fn measure(recordings: &[&Recording], duration_s: f64, window_m: f64) -> Traffic {
    let mut traffic = Traffic::default();
    let (mut directions, mut lanes, mut samples) = (0, 0, 0.0);
    for recording in recordings {
        directions += recording.carriageways.len();
        lanes += recording.carriageways.iter().map(|c| c.lane_count()).sum::<usize>();
        samples = duration_s * recording.frame_rate_hz;
        one_recording(recording, &mut traffic);
    }
    let hours = duration_s / 3600.0;
    traffic.flow_per_direction_vehph = traffic.vehicles as f64 / (directions as f64 * hours);
    traffic.density_per_lane_vehpkm = traffic.rows as f64 / (samples * lanes as f64 * window_m / 1000.0);
    traffic
}

fn one_recording(recording: &Recording, traffic: &mut Traffic) {
    let last = recording.tracks.iter().map(Track::last_frame).max().unwrap_or(0);
    // (track, sample) of everybody in view, per frame.
    let mut present: Vec<Vec<(usize, usize)>> = vec![Vec::new(); last as usize + 1];
    for (i, track) in recording.tracks.iter().enumerate() {
        for k in 0..track.len() {
            present[track.first_frame as usize + k].push((i, k));
        }
    }
    // Bumper-to-bumper headway between a vehicle and the next in a lane, ahead (+1) or behind (−1).
    let headway = |i: usize, k: usize, lane: u16, side: f64| -> Option<f64> {
        let own = &recording.tracks[i];
        let others = present[own.first_frame as usize + k].iter().filter(|&&(j, q)| {
            let other = &recording.tracks[j];
            j != i
                && other.carriageway == own.carriageway
                && other.lane[q] == lane
                && side * (other.s_m[q] - own.s_m[k]) > 0.0
        });
        let distance = |&&(j, q): &&(usize, usize)| (recording.tracks[j].s_m[q] - own.s_m[k]).abs();
        let &(j, q) = others.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        let other = &recording.tracks[j];
        let gap_m = (other.s_m[q] - own.s_m[k]).abs() - 0.5 * (own.length_m + other.length_m);
        let speed_mps = if side > 0.0 { own.v_s_mps[k] } else { other.v_s_mps[q] };
        (speed_mps > 0.1).then(|| gap_m / speed_mps)
    };

    let rate = recording.frame_rate_hz;
    let second = rate.round() as usize;
    for (i, track) in recording.tracks.iter().enumerate() {
        let n = track.len();
        let class = class_index(track.class);
        traffic.rows += n;
        traffic.vehicles += 1;
        traffic.visible_s.push(n as f64 / rate);
        traffic.mean_speeds_mps[class].push(track.v_s_mps.iter().sum::<f64>() / n as f64);
        traffic.lengths_m[class].push(track.length_m);
        traffic.widths_m[class].push(track.width_m);
        traffic.driven_km += (track.s_m[n - 1] - track.s_m[0]) / 1000.0;
        traffic.headways_s.extend((0..n).step_by(second).filter_map(|k| headway(i, k, track.lane[k], 1.0)));
        for k in 1..n {
            if track.lane[k] != track.lane[k - 1] {
                traffic.crossings += 1;
                lane_change(track, k, rate, traffic);
                let behind = headway(i, k, track.lane[k], -1.0).filter(|h| *h < CUT_IN_WITHIN_S);
                traffic.cut_in_headways_s.extend(behind);
            }
        }
    }
}

/// The lane change that crosses a line at sample `k`: how long, and how near to a quintic.
fn lane_change(track: &Track, k: usize, rate: f64, traffic: &mut Traffic) {
    let changing = |j: usize| track.v_d_mps[j].abs() > CHANGING_MPS && track.v_d_mps[j] * track.v_d_mps[k] > 0.0;
    let start = (0..k).rev().take_while(|&j| changing(j)).last().unwrap_or(k);
    let end = (k + 1..track.len()).take_while(|&j| changing(j)).last().unwrap_or(k);
    if start == 0 || end + 1 == track.len() {
        return;
    }
    traffic.complete_changes += 1;
    let way = track.d_m[end] - track.d_m[start];
    let fastest = track.v_d_mps[start..=end].iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let duration_s = 1.875 * way.abs() / fastest;
    traffic.change_durations_s.push(duration_s);

    // The quintic of that duration whose middle is where half of the way is done.
    let half = 0.5 * (track.d_m[end] + track.d_m[start]);
    let middle = (start..end).find(|&j| (track.d_m[j] - half) * (track.d_m[j + 1] - half) <= 0.0).unwrap_or(k);
    let squares = (start..=end).map(|j| {
        let share = quintic((j as f64 - middle as f64) / (rate * duration_s) + 0.5);
        let off = (track.d_m[j] - half) / way + 0.5 - share;
        off * off
    });
    traffic.quintic_residuals.push((squares.sum::<f64>() / (end - start + 1) as f64).sqrt());
}

/// Spread (m/s²) and correlation time (s) of the noise in the accelerations of vehicles that nothing
/// disturbs, from mean squared differences D(t) = 2σ²(1 − e^(−t/τ)) over two lags: they leave out slow
/// changes of the mean.
pub fn noise_sd_and_correlation(recordings: &[Recording]) -> (f64, f64) {
    const LAGS_S: [f64; 2] = [1.5, 6.0];
    let [short, long] = LAGS_S.map(|lag_s| {
        let (mut sum, mut count) = (0.0, 0.0);
        for recording in recordings {
            let lag = (lag_s * recording.frame_rate_hz).round() as usize;
            for track in &recording.tracks {
                for k in lag..track.len() {
                    let difference = track.a_s_mps2[k] - track.a_s_mps2[k - lag];
                    sum += difference * difference;
                    count += 1.0;
                }
            }
        }
        sum / count
    });
    let saturation = |lag: usize, tau: f64| 1.0 - (-LAGS_S[lag] / tau).exp();
    let (mut low, mut high) = (0.1, 6.0);
    for _ in 0..60 {
        let middle: f64 = 0.5 * (low + high);
        if saturation(0, middle) / saturation(1, middle) > short / long { low = middle } else { high = middle }
    }
    ((long / (2.0 * saturation(1, low))).sqrt(), low)
}

/// Value at a share (0 to 1) of the ascending values.
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

/// Place of the highest density, smoothed by a normal kernel of this spread.
pub fn mode(values: &[f64], kernel: f64) -> f64 {
    let density = |x: f64| values.iter().map(|v| (-0.5 * ((v - x) / kernel).powi(2)).exp()).sum::<f64>();
    let step = 0.1 * kernel;
    let (low, high) = (quantile(values, 0.0), quantile(values, 1.0));
    let places = (0..=((high - low) / step) as usize).map(|k| low + k as f64 * step);
    places.map(|x| (density(x), x)).max_by(|a, b| a.0.total_cmp(&b.0)).map_or(f64::NAN, |(_, x)| x)
}

pub fn share(values: &[f64], condition: impl Fn(f64) -> bool) -> f64 {
    values.iter().filter(|v| condition(**v)).count() as f64 / values.len() as f64
}

pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
