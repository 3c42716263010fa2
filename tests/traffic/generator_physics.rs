//! The synthetic recordings are physically possible, well-formed, and the same everywhere.

use crate::common::mined::recordings;
use crate::common::with_threads;
use lanesweep::support::plain_text::hex;
use lanesweep::traffic::trajectory::generator::{GeneratorOptions, generate, generate_one};
use lanesweep::traffic::trajectory::{Recording, Track};
use rayon::prelude::*;
use sha2::{Digest, Sha256};

/// SHA-256 of the first twelve default recordings' data as [`digest`] writes it. It changes when the generator does,
/// and then on purpose: every published default result changes with it.
const DEFAULT_DIGEST: &str = "e070e1fefac703b2c818b9e4919b5b2b06d73352db96732935e6f188b82739f8";

fn digest<'r>(recordings: impl IntoIterator<Item = &'r Recording>) -> String {
    let mut hash = Sha256::new();
    for recording in recordings {
        hash.update(recording.id.as_bytes());
        hash.update(bytemuck::bytes_of(&recording.frame_rate_hz));
        for carriageway in &recording.carriageways {
            hash.update(carriageway.name.as_bytes());
            hash.update(bytemuck::cast_slice(&carriageway.lane_lines_m));
        }
        for track in &recording.tracks {
            hash.update(track.id.to_le_bytes());
            hash.update(format!("{:?}", track.class).as_bytes());
            hash.update((track.carriageway as u64).to_le_bytes());
            hash.update(track.first_frame.to_le_bytes());
            hash.update(bytemuck::cast_slice(&[track.length_m, track.width_m]));
            for series in [&track.s_m, &track.d_m, &track.v_s_mps, &track.v_d_mps, &track.a_s_mps2] {
                hash.update(bytemuck::cast_slice(series));
            }
            hash.update(bytemuck::cast_slice(&track.lane));
        }
    }
    hex(&hash.finalize())
}

#[test]
fn the_default_recordings_are_the_same_bits_on_every_machine_and_thread_count() {
    let options = GeneratorOptions { recordings: 2, ..GeneratorOptions::default() };
    let one = with_threads(1, || generate(&options).unwrap());
    assert_eq!(digest(&one), digest(recordings(2)), "one thread and all threads differ");
    assert_eq!(digest(recordings(12)), DEFAULT_DIGEST, "the default recordings have changed");
}

#[test]
fn one_recording_alone_is_the_one_among_all_and_another_seed_gives_another() {
    let options = GeneratorOptions { recordings: 3, duration_s: 20.0, ..GeneratorOptions::default() };
    let all = generate(&options).unwrap();
    assert_eq!(all.iter().map(|r| r.id.as_str()).collect::<Vec<_>>(), ["01", "02", "03"]);
    for (index, recording) in all.iter().enumerate() {
        assert_eq!(&generate_one(&options, index).unwrap(), recording);
    }
    assert!(generate_one(&options, 3).is_err());
    let other = GeneratorOptions { seed: options.seed + 1, ..options.clone() };
    assert_ne!(generate_one(&other, 0).unwrap(), all[0]);
    // The number of recordings does not reach into any of them.
    assert_eq!(generate_one(&GeneratorOptions { recordings: 1, ..options }, 0).unwrap(), all[0]);
    // Another frame rate gives the same kind of traffic.
    for frame_rate_hz in [10.0, 30.0] {
        let options =
            GeneratorOptions { frame_rate_hz, recordings: 1, duration_s: 60.0, ..GeneratorOptions::default() };
        let recording = generate_one(&options, 0).unwrap();
        let last = recording.tracks.iter().map(Track::last_frame).max().unwrap();
        assert_eq!((recording.frame_rate_hz, last as f64), (frame_rate_hz, 60.0 * frame_rate_hz));
        assert!((60..220).contains(&recording.tracks.len()), "{} vehicles in a minute", recording.tracks.len());
    }
}

#[test]
fn no_two_vehicles_overlap() {
    recordings(28).par_iter().for_each(|recording| {
        let last = recording.tracks.iter().map(Track::last_frame).max().unwrap();
        let mut present: Vec<Vec<usize>> = vec![Vec::new(); last as usize + 1];
        for (i, track) in recording.tracks.iter().enumerate() {
            for frame in track.first_frame..=track.last_frame() {
                present[frame as usize].push(i);
            }
        }
        for (frame, there) in present.iter().enumerate() {
            for (n, &i) in there.iter().enumerate() {
                for &j in &there[..n] {
                    let (a, b) = (&recording.tracks[i], &recording.tracks[j]);
                    let (p, q) = (a.index_of(frame as i64).unwrap(), b.index_of(frame as i64).unwrap());
                    let along = (a.s_m[p] - b.s_m[q]).abs() - 0.5 * (a.length_m + b.length_m);
                    let across = (a.d_m[p] - b.d_m[q]).abs() - 0.5 * (a.width_m + b.width_m);
                    let is_apart = a.carriageway != b.carriageway || along > 0.0 || across > 0.0;
                    assert!(
                        is_apart,
                        "{}, frame {frame}: {} and {} overlap by {along}, {across} m",
                        recording.id, a.id, b.id
                    );
                }
            }
        }
    });
}

#[test]
fn speeds_and_accelerations_are_bounded_and_positions_are_their_integrals() {
    let (mut samples, mut above) = (0, 0);
    // Half of the last written digit of a position, of a speed over one step, and the same again.
    let digits = 0.005;
    for recording in recordings(12) {
        let dt = 1.0 / recording.frame_rate_hz;
        for t in &recording.tracks {
            assert!(t.v_s_mps.iter().all(|v| (0.0..=60.0).contains(v)), "speed of {}/{}", recording.id, t.id);
            // Known to be wrong: noise lifts some cars in a lane change above 3.0 m/s². The fraction is bounded below.
            assert!(t.a_s_mps2.iter().all(|a| (-8.5..=3.5).contains(a)), "acceleration of {}/{}", recording.id, t.id);
            samples += t.len();
            above += t.a_s_mps2.iter().filter(|a| **a > 3.0).count();
            assert!(t.v_d_mps.iter().all(|v| v.abs() < 3.5), "lateral speed of {}/{}", recording.id, t.id);
            for k in 1..t.len() {
                let along = t.s_m[k] - t.s_m[k - 1] - 0.5 * dt * (t.v_s_mps[k] + t.v_s_mps[k - 1]);
                let across = t.d_m[k] - t.d_m[k - 1] - 0.5 * dt * (t.v_d_mps[k] + t.v_d_mps[k - 1]);
                let speed = t.v_s_mps[k] - t.v_s_mps[k - 1] - dt * t.a_s_mps2[k - 1];
                assert!(along.abs() < 2.5 * digits, "{}/{}: s {along}", recording.id, t.id);
                assert!(across.abs() < 2.5 * digits, "{}/{}: d {across}", recording.id, t.id);
                assert!(speed.abs() < 2.5 * digits, "{}/{}: v {speed}", recording.id, t.id);
            }
            // No drift: rounding does not add up over the whole track.
            let integral: f64 = (1..t.len()).map(|k| 0.5 * dt * (t.v_s_mps[k] + t.v_s_mps[k - 1])).sum();
            let way = t.s_m[t.len() - 1] - t.s_m[0];
            assert!((way - integral).abs() < 0.05, "{}/{}: {way} against {integral}", recording.id, t.id);
        }
    }
    assert!(above * 5000 < samples, "{above} of {samples} samples above 3.0 m/s²");
}

#[test]
fn vehicles_appear_once_pass_through_the_window_of_the_camera_and_keep_in_the_lanes_of_their_road() {
    let options = GeneratorOptions::default();
    let end = options.duration_s * options.frame_rate_hz;
    for recording in recordings(12) {
        let mut before = (0, 1);
        for track in &recording.tracks {
            let (what, now) = (format!("{}/{}", recording.id, track.id), (track.id, track.first_frame));
            assert!(now.0 == before.0 + 1 && now.1 >= before.1, "{now:?} after {before:?}");
            before = now;
            let start = if track.carriageway == 0 { -options.window_m } else { 0.0 };
            let (first, last) = (track.s_m[0] - start, track.s_m[track.len() - 1] - start);
            assert!(first > -0.01 && last < options.window_m + 0.01, "{what}");
            // Cut only by the recording's start and end.
            assert!(first < 2.5 || track.first_frame == 1, "{what} appears at {first}");
            assert!(last > options.window_m - 2.5 || track.last_frame() as f64 == end, "{what}");
            let road = &recording.carriageways[track.carriageway];
            for (d, lane) in track.d_m.iter().zip(&track.lane) {
                assert_eq!(road.lane_at(*d), Some(usize::from(*lane)));
            }
        }
    }
}
