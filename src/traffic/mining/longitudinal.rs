//! Longitudinal activities: when a vehicle accelerates, decelerates or cruises.
//!
//! Exact f64 comparisons of the recorded speeds, without tolerance: one golden case depends on an exact tie.

use std::collections::VecDeque;

use super::options::{LongitudinalOptions, window_samples};

/// Longitudinal activity of a vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Longitudinal {
    /// Neither of the others.
    Cruising,
    /// Accelerating.
    Accelerating,
    /// Decelerating.
    Decelerating,
}

/// An activity from sample `start` until the next event, or to the end of the track.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LongitudinalEvent {
    /// First sample.
    pub start: usize,
    /// Activity that begins there.
    pub activity: Longitudinal,
}

/// Activities of a whole track with speeds `v_mps` in m/s. The first event starts at sample 0; events
/// ascend; two in a row differ. Empty for an empty track.
pub fn longitudinal_events(v_mps: &[f64], frame_rate_hz: f64, options: &LongitudinalOptions) -> Vec<LongitudinalEvent> {
    if v_mps.is_empty() {
        return Vec::new();
    }
    let events = detect(v_mps, window_samples(options.window_s, frame_rate_hz), options);
    remove_short_cruising(v_mps, &events, options.min_cruise_s * frame_rate_hz)
}

/// A series in which an activity is an increase. Deceleration uses the negated speed, which is exact.
struct Rise {
    x: Vec<f64>,
    /// Minimum over the trailing window.
    window_min: Vec<f64>,
    /// `quiescent_from[j]`: first sample ≥ j from which the next window rises by less than the threshold.
    quiescent_from: Vec<Option<usize>>,
    window: usize,
    threshold: f64,
}

impl Rise {
    fn new(x: Vec<f64>, window: usize, threshold: f64) -> Self {
        let window_min = trailing_min(&x, window);
        let mut quiescent_from = vec![None; x.len() + 1];
        for j in (0..x.len().saturating_sub(window)).rev() {
            let end = j + window;
            quiescent_from[j] = if x[end] - window_min[end] < threshold { Some(j) } else { quiescent_from[j + 1] };
        }
        Rise { x, window_min, quiescent_from, window, threshold }
    }

    /// If an activity starts at `k`: its end, `None` inside for the end of the track.
    fn start(&self, k: usize, min_change: f64) -> Option<Option<usize>> {
        let ahead = k + self.window;
        let starts = k >= self.window
            && ahead < self.x.len()
            && self.x[k] - self.window_min[k] >= self.threshold
            && self.window_min[ahead] == self.x[k]
            && self.x[ahead] - self.window_min[ahead] > 0.0;
        if !starts {
            return None;
        }
        let end = self.quiescent_from[k + 1];
        let last = end.unwrap_or(self.x.len() - 1);
        ((self.x[last] - self.x[k]).abs() > min_change).then_some(end)
    }
}

fn detect(v: &[f64], window: usize, options: &LongitudinalOptions) -> Vec<LongitudinalEvent> {
    use Longitudinal::{Accelerating, Cruising, Decelerating};
    let threshold = options.cruise_acceleration_mps2 * options.window_s;
    let rise = Rise::new(v.to_vec(), window, threshold);
    let fall = Rise::new(v.iter().map(|v| -v).collect(), window, threshold);

    let mut events = vec![LongitudinalEvent { start: 0, activity: Cruising }];
    let mut now = Cruising;
    let mut end = None;
    for k in window..v.len() {
        let mut others =
            [(Accelerating, &rise), (Decelerating, &fall)].into_iter().filter(|(activity, _)| *activity != now);
        let begun =
            others.find_map(|(activity, series)| Some((activity, series.start(k, options.min_speed_change_mps)?)));
        (now, end) = match begun {
            Some(begun) => begun,
            None if end == Some(k) => (Cruising, None),
            None => continue,
        };
        events.push(LongitudinalEvent { start: k, activity: now });
    }
    events
}

/// Cruising shorter than `min_cruise` samples between two activities disappears: equal ones merge,
/// opposite ones meet at the last extremum of the speed inside.
fn remove_short_cruising(v: &[f64], events: &[LongitudinalEvent], min_cruise: f64) -> Vec<LongitudinalEvent> {
    let mut kept: Vec<LongitudinalEvent> = Vec::with_capacity(events.len());
    let mut i = 0;
    while i < events.len() {
        let event = events[i];
        i += 1;
        // The product of two numbers may be rounded (4 s at 29.97 Hz); it is compared with whole samples.
        let is_short = |after: &LongitudinalEvent| ((after.start - event.start) as f64) < min_cruise - 1e-6;
        let after = events.get(i).filter(|after| event.activity == Longitudinal::Cruising && is_short(after));
        let Some((before, &after)) = kept.last().zip(after) else {
            kept.push(event);
            continue;
        };
        if before.activity != after.activity {
            let start = last_extremum(v, event.start, after.start, after.activity);
            kept.push(LongitudinalEvent { start, ..after });
        }
        i += 1;
    }
    kept
}

/// The last sample in `first..=last` at which the speed is minimal (before an acceleration) or maximal.
fn last_extremum(v: &[f64], first: usize, last: usize, next: Longitudinal) -> usize {
    let sign = if next == Longitudinal::Accelerating { 1.0 } else { -1.0 };
    (first..=last).fold(first, |best, k| if sign * v[k] <= sign * v[best] { k } else { best })
}

/// Minimum over `x[k − window ..= k]` for every `k`, in linear time (monotone queue). For `k < window` the window is incomplete.
pub(super) fn trailing_min(x: &[f64], window: usize) -> Vec<f64> {
    let mut candidates: VecDeque<usize> = VecDeque::with_capacity(window.min(x.len()) + 2);
    x.iter()
        .enumerate()
        .map(|(k, &value)| {
            while candidates.back().is_some_and(|&j| x[j] >= value) {
                candidates.pop_back();
            }
            candidates.push_back(k);
            while candidates.front().is_some_and(|&j| k - j > window) {
                candidates.pop_front();
            }
            candidates.front().map_or(value, |&j| x[j])
        })
        .collect()
}
