//! Makes one recording of the simulated carriageways: road, numbering, and the decimals of a highD file, so that
//! reading a written recording gives the same bits.

use super::inflow::demand;
use super::options::GeneratorOptions;
use super::random::{Purpose, TrafficRandom};
use super::traffic::Traffic;
use super::vehicle::Vehicle;
use crate::trajectory::{Carriageway, NO_LANE, Recording, Track, highd};
use lanesweep_support::error::Result;

/// Upper edge of the image to the first line, and between the carriageways, m.
const VERGE_M: f64 = 8.0;
const MEDIAN_M: f64 = 4.5;

/// One recording. `index` counts from 0. An error means that a highD file could not hold it.
pub(super) fn record(options: &GeneratorOptions, index: usize) -> Result<Recording> {
    let mut site = TrafficRandom::new(options.seed, index, 0, Purpose::Site);
    // Two of three recordings have three lanes per direction.
    let lanes = if index % 3 == 2 { 2 } else { 3 };
    let lane_width_m = [3.5, 3.75, 3.6][(site.uniform() * 3.0) as usize % 3];
    let road = [lanes, if index % 6 == 4 { 2 } else { lanes }];
    let speed_level = site.normal_within(1.0, 0.03, 0.92, 1.08);
    let truck_level = site.normal_within(1.0, 0.15, 0.6, 1.4);
    let mut seen: Vec<(usize, Vehicle)> = Vec::new();
    for (carriageway, &lanes) in road.iter().enumerate() {
        let flow_level = site.normal_within(1.0, 0.08, 0.8, 1.12);
        let demand = demand(options, (lanes, lane_width_m), [flow_level, truck_level, speed_level]);
        let traffic = Traffic::new(options, lane_width_m, demand, (index, carriageway));
        seen.extend(traffic.run().into_iter().map(|vehicle| (carriageway, vehicle)));
    }
    // Numbers ascend by first appearance; the sort is stable, so ties keep carriageway and arrival.
    seen.sort_by_key(|(_, vehicle)| vehicle.samples.first_frame);

    let carriageways = carriageways(road, lane_width_m);
    let tracks = seen
        .into_iter()
        .enumerate()
        .map(|(k, (carriageway, vehicle))| track(k as u32 + 1, carriageway, &carriageways, options.window_m, vehicle))
        .collect();
    let id = format!("{:02}", index + 1);
    let mut recording = Recording { id, frame_rate_hz: options.frame_rate_hz, carriageways, tracks, synthetic: true };
    highd::quantize(&mut recording)?;
    label_lanes(&mut recording);
    Ok(recording)
}

/// Lanes by the written centre, because rounding may move it over a line.
fn label_lanes(recording: &mut Recording) {
    for track in &mut recording.tracks {
        let road = &recording.carriageways[track.carriageway];
        let lane = |d: &f64| road.lane_at(*d).map_or(NO_LANE, |lane| lane as u16);
        track.lane = track.d_m.iter().map(lane).collect();
    }
}

/// Lane lines of the internal model for a highD image with `y` down: the upper carriageway (`1`, towards −x) has d =
/// y, the lower one (`2`) d = −y.
fn carriageways(lanes: [usize; 2], lane_width_m: f64) -> Vec<Carriageway> {
    let upper_end_m = VERGE_M + lanes[0] as f64 * lane_width_m;
    let lines = |first_m: f64, lanes: usize| (0..=lanes).map(|k| first_m - k as f64 * lane_width_m).collect();
    vec![
        Carriageway { name: "1".to_owned(), lane_lines_m: lines(upper_end_m, lanes[0]) },
        Carriageway { name: "2".to_owned(), lane_lines_m: lines(-(upper_end_m + MEDIAN_M), lanes[1]) },
    ]
}

fn track(id: u32, carriageway: usize, carriageways: &[Carriageway], window_m: f64, vehicle: Vehicle) -> Track {
    // highD's x runs with carriageway 2 and against carriageway 1, whose s therefore ends at 0.
    let start_m = if carriageway == 0 { -window_m } else { 0.0 };
    let left_m = carriageways[carriageway].lane_lines_m[0];
    let Vehicle { class, length_m, width_m, samples: mut track, .. } = vehicle;
    track.s_m.iter_mut().for_each(|s_m| *s_m += start_m);
    track.d_m.iter_mut().for_each(|d_m| *d_m += left_m);
    let first_frame = track.first_frame + 1;
    // `label_lanes` sets the lanes, by the rounded positions.
    let lane = vec![NO_LANE; track.len()];
    Track { id, class, length_m, width_m, carriageway, first_frame, lane, ..track }
}
