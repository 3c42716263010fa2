//! The line of a road: it turns positions into distances along the road (s) and to the left of the line (d).
//!
//! The line is fitted to the tracks of one direction of travel. It begins as the path of the vehicle that was seen
//! farthest, and gets the median direction of all vehicles, which lane changes do not move. Then it is shifted sideways by
//! the median drift of their d. It is a straight line where that describes the tracks as well.

/// Distance of the line's points, m.
const STEP_M: f64 = 5.0;
/// Length over which directions and shifts are averaged, m.
const BIN_M: f64 = 20.0;
/// Length of a track that tells something about the road, m.
const MIN_TRACK_M: f64 = 30.0;
/// Rounds of turning, and of shifting, the line.
const ROUNDS: usize = 3;
/// Length by which the line goes on straight beyond the tracks, m.
const BEYOND_M: f64 = 300.0;
/// Maximum number of steps of a line: 100 km.
const MAX_STEPS: usize = 20_000;
/// A direction within this of an axis of the file is that axis, rad.
const ON_AXIS_RAD: f64 = 2e-4;

/// A path: positions in the plane, in the order of travel, m.
pub(super) type Path = Vec<[f64; 2]>;

/// A position on the road.
#[derive(Debug, Clone, Copy)]
pub(super) struct OnRoad {
    pub s_m: f64,
    pub d_m: f64,
}

/// A line with a direction.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RoadLine {
    points: Vec<[f64; 2]>,
    tangents: Vec<[f64; 2]>,
    s_m: Vec<f64>,
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Component of `b` to the left of `a`.
pub(super) fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn length(a: [f64; 2]) -> f64 {
    libm::hypot(a[0], a[1])
}

pub(super) fn unit(a: [f64; 2]) -> Option<[f64; 2]> {
    let length = length(a);
    (length > 1e-9).then(|| [a[0] / length, a[1] / length])
}

fn angle(a: [f64; 2]) -> f64 {
    libm::atan2(a[1], a[0])
}

/// The median; NaN without values.
pub(in crate::trajectory) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The smallest and the largest value.
pub(in crate::trajectory) fn range(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

impl RoadLine {
    /// The straight line through a point.
    pub(super) fn straight(through: [f64; 2], direction: [f64; 2]) -> RoadLine {
        let end = [through[0] + direction[0], through[1] + direction[1]];
        RoadLine { points: vec![through, end], tangents: vec![direction; 2], s_m: vec![0.0, 1.0] }
    }

    pub(super) fn is_straight(&self) -> bool {
        self.points.len() == 2
    }

    /// A line along points at least a millimetre apart; `None` for fewer than two.
    fn along(points: &[[f64; 2]]) -> Option<RoadLine> {
        let mut kept: Vec<[f64; 2]> = Vec::new();
        for &point in points {
            if kept.last().is_none_or(|last| length(minus(point, *last)) > 1e-3) {
                kept.push(point);
            }
        }
        if kept.len() < 2 {
            return None;
        }
        let last = kept.len() - 1;
        let tangent = |i: usize| unit(minus(kept[(i + 1).min(last)], kept[i.saturating_sub(1)]));
        let tangents: Option<Vec<[f64; 2]>> = (0..kept.len()).map(tangent).collect();
        let mut s_m = vec![0.0];
        for pair in kept.windows(2) {
            s_m.push(s_m[s_m.len() - 1] + length(minus(pair[1], pair[0])));
        }
        Some(RoadLine { points: kept, tangents: tangents?, s_m })
    }

    /// The other way round.
    pub(super) fn reversed(&self) -> RoadLine {
        let last = self.s_m[self.s_m.len() - 1];
        let mut reversed = self.clone();
        reversed.points.reverse();
        reversed.tangents.reverse();
        reversed.tangents.iter_mut().for_each(|t| *t = [-t[0], -t[1]]);
        reversed.s_m = self.s_m.iter().rev().map(|s| last - s).collect();
        if self.is_straight() {
            // s grows from the same point, so that positions only change their sign.
            return RoadLine::straight(self.points[0], reversed.tangents[0]);
        }
        reversed
    }

    /// A point on the road.
    pub(super) fn project(&self, point: [f64; 2]) -> OnRoad {
        self.project_near(point, None).0
    }

    /// Projects a point: the nearest segment around `near`, or of all. Between two points of the line the direction turns
    /// evenly, so that s and d do not jump. Returns also the direction of the road there, and the segment.
    fn project_near(&self, point: [f64; 2], near: Option<usize>) -> (OnRoad, [f64; 2], usize) {
        if self.is_straight() {
            let (tangent, off) = (self.tangents[0], minus(point, self.points[0]));
            return (OnRoad { s_m: dot(off, tangent), d_m: cross(tangent, off) }, tangent, 0);
        }
        let segments = self.points.len() - 1;
        let ahead = |i: usize| dot(minus(point, self.points[i]), self.tangents[i]);
        let at = near.unwrap_or_else(|| {
            let nearest = |i: &usize| length(minus(point, self.points[*i]));
            (0..self.points.len()).min_by(|a, b| nearest(a).total_cmp(&nearest(b))).unwrap_or(0)
        });
        let mut at = at.min(segments - 1);
        while at > 0 && ahead(at) < 0.0 {
            at -= 1;
        }
        while at + 1 < segments && ahead(at + 1) >= 0.0 {
            at += 1;
        }
        let (before, after) = (ahead(at), ahead(at + 1));
        let part = if before - after > 1e-12 { before / (before - after) } else { 0.0 };
        let clamped = part.clamp(0.0, 1.0);
        let mix = |a: [f64; 2], b: [f64; 2]| [a[0] + clamped * (b[0] - a[0]), a[1] + clamped * (b[1] - a[1])];
        let tangent = unit(mix(self.tangents[at], self.tangents[at + 1])).unwrap_or(self.tangents[at]);
        let foot = mix(self.points[at], self.points[at + 1]);
        let off = minus(point, foot);
        let s_m = self.s_m[at] + clamped * (self.s_m[at + 1] - self.s_m[at]) + dot(off, tangent);
        (OnRoad { s_m, d_m: cross(tangent, off) }, tangent, at)
    }

    /// A path on the road.
    pub(super) fn project_all(&self, path: &[[f64; 2]]) -> Vec<OnRoad> {
        self.along_path(path).map(|(on, _)| on).collect()
    }

    /// Directions of the road at the points of a path.
    pub(super) fn directions(&self, path: &[[f64; 2]]) -> Vec<[f64; 2]> {
        self.along_path(path).map(|(_, tangent)| tangent).collect()
    }

    fn along_path(&self, path: &[[f64; 2]]) -> impl Iterator<Item = (OnRoad, [f64; 2])> {
        let mut near = None;
        path.iter().map(move |point| {
            let (on, tangent, at) = self.project_near(*point, near);
            near = Some(at);
            (on, tangent)
        })
    }

    /// Median over the tracks of the range of their d, m: lane keeping, and the error of the line.
    fn wander_m(&self, paths: &[Path]) -> f64 {
        let ranges =
            paths.iter().filter(|path| path_length(path) >= MIN_TRACK_M).map(|path| d_range(&self.project_all(path)));
        median(&mut ranges.collect::<Vec<_>>())
    }

    /// The line of paths in one direction of travel; `None` if none of them moves.
    pub(super) fn fit(paths: &[Path]) -> Option<RoadLine> {
        let straight = straight_fit(paths)?;
        let Some(curved) = curved_fit(paths) else { return Some(straight) };
        let (of_straight, of_curved) = (straight.wander_m(paths), curved.wander_m(paths));
        if of_straight <= 1.15 * of_curved + 0.05 || of_straight.is_nan() {
            return Some(straight);
        }
        // s begins where the tracks begin.
        let mut curved = curved;
        curved.s_m.iter_mut().for_each(|s| *s -= BEYOND_M);
        Some(curved)
    }
}

fn path_length(path: &[[f64; 2]]) -> f64 {
    match path {
        [first, .., last] => length(minus(*last, *first)),
        _ => 0.0,
    }
}

fn d_range(on: &[OnRoad]) -> f64 {
    let (low, high) = range(on.iter().map(|p| p.d_m));
    high - low
}

/// The straight line in the median direction of the tracks.
fn straight_fit(paths: &[Path]) -> Option<RoadLine> {
    let longest = paths.iter().max_by(|a, b| path_length(a).total_cmp(&path_length(b)))?;
    let along = unit(minus(*longest.last()?, *longest.first()?))?;
    let mut turns: Vec<f64> = paths
        .iter()
        .filter(|path| path_length(path) >= MIN_TRACK_M.min(0.5 * path_length(longest)))
        .filter_map(|path| unit(minus(*path.last()?, *path.first()?)))
        .map(|direction| libm::atan2(cross(along, direction), dot(along, direction)))
        .collect();
    let mut direction = angle(along) + median(&mut turns);
    let quarter = std::f64::consts::FRAC_PI_2;
    let axis = libm::round(direction / quarter);
    let mut tangent = [libm::cos(direction), libm::sin(direction)];
    if (direction - axis * quarter).abs() < ON_AXIS_RAD {
        direction = axis * quarter;
        tangent = [libm::round(libm::cos(direction)), libm::round(libm::sin(direction))];
    }
    let origin = if tangent.contains(&0.0) { [0.0; 2] } else { longest[0] };
    Some(RoadLine::straight(origin, tangent))
}

/// The line from the path of the farthest track, turned and shifted to fit all.
fn curved_fit(paths: &[Path]) -> Option<RoadLine> {
    let longest = paths.iter().max_by(|a, b| path_length(a).total_cmp(&path_length(b)))?;
    let mut line = resampled(longest)?;
    extend(&mut line, paths)?;
    for _ in 0..ROUNDS {
        line = turned(&line, paths)?;
    }
    for _ in 0..ROUNDS {
        line = shifted(&line, paths)?;
    }
    Some(line)
}

/// A line through the path, smoothed over [`BIN_M`], straight beyond its ends.
fn resampled(path: &[[f64; 2]]) -> Option<RoadLine> {
    let raw = RoadLine::along(path)?;
    let end = raw.s_m[raw.s_m.len() - 1];
    let steps = (end / STEP_M).floor() as usize;
    if !(4..=MAX_STEPS).contains(&steps) {
        return None;
    }
    let mean_near = |s: f64| {
        let from = raw.s_m.partition_point(|v| *v < s - BIN_M / 2.0);
        let to = raw.s_m.partition_point(|v| *v <= s + BIN_M / 2.0).max(from + 1).min(raw.points.len());
        let of = &raw.points[from.min(to - 1)..to];
        let sum = of.iter().fold([0.0; 2], |sum, p| [sum[0] + p[0], sum[1] + p[1]]);
        [sum[0] / of.len() as f64, sum[1] / of.len() as f64]
    };
    let inner: Vec<[f64; 2]> = (0..=steps).map(|i| mean_near(i as f64 * STEP_M)).collect();
    lengthened(&inner)
}

/// A line through points, with straight ends.
fn lengthened(points: &[[f64; 2]]) -> Option<RoadLine> {
    // Over some points, because the last ones are noisy.
    let reach = (BIN_M / STEP_M) as usize;
    let last = points.len().checked_sub(1)?;
    let begin = unit(minus(*points.get(reach)?, points[0]))?;
    let end = unit(minus(points[last], points[last - reach]))?;
    let steps = (BEYOND_M / STEP_M) as usize;
    let go = |from: [f64; 2], along: [f64; 2], by: f64| [from[0] + by * along[0], from[1] + by * along[1]];
    let before = (1..=steps).rev().map(|i| go(points[0], begin, -(i as f64) * STEP_M));
    let after = (1..=steps).map(|i| go(points[last], end, i as f64 * STEP_M));
    RoadLine::along(&before.chain(points.iter().copied()).chain(after).collect::<Vec<_>>())
}

/// Replaces the straight ends by the paths of vehicles that were seen beyond them.
fn extend(line: &mut RoadLine, paths: &[Path]) -> Option<()> {
    let steps = (BEYOND_M / STEP_M) as usize;
    for _ in 0..64 {
        let (from, to) = (line.s_m[steps], line.s_m[line.s_m.len() - 1 - steps]);
        let mut best: Option<(f64, bool, Vec<OnRoad>, &Path)> = None;
        for path in paths.iter().filter(|path| path_length(path) >= 2.0 * BIN_M) {
            let on = line.project_all(path);
            let (first, last) = (on.first()?.s_m, on.last()?.s_m);
            for (gain, at_end) in [(last - to, true), (from - first, false)] {
                let overlaps = if at_end { first < to - BIN_M } else { last > from + BIN_M };
                if overlaps && gain > BIN_M && best.as_ref().is_none_or(|(most, ..)| gain > *most) {
                    best = Some((gain, at_end, on.clone(), path));
                }
            }
        }
        let Some((_, at_end, on, path)) = best else { return Some(()) };
        // Beside the line by its d near the end.
        let near = |p: &&OnRoad| if at_end { (to - p.s_m).abs() < BIN_M } else { (p.s_m - from).abs() < BIN_M };
        let beside = median(&mut on.iter().filter(near).map(|p| p.d_m).collect::<Vec<_>>());
        let raw = RoadLine::along(path)?;
        let moved =
            |(point, tangent): (&[f64; 2], &[f64; 2])| [point[0] + beside * tangent[1], point[1] - beside * tangent[0]];
        let moved: Vec<[f64; 2]> = raw.points.iter().zip(&raw.tangents).map(moved).collect();
        let inner = &line.points[steps..line.points.len() - steps];
        let joined: Vec<[f64; 2]> = if at_end {
            inner.iter().copied().chain(moved.into_iter().filter(|p| line.project(*p).s_m > to)).collect()
        } else {
            moved.into_iter().filter(|p| line.project(*p).s_m < from).chain(inner.iter().copied()).collect()
        };
        *line = resampled(&joined)?;
    }
    Some(())
}

/// Index of a bin along the line.
fn bin(line: &RoadLine, s_m: f64) -> usize {
    ((s_m / BIN_M).max(0.0) as usize).min(bins(line) - 1)
}

fn bins(line: &RoadLine) -> usize {
    ((line.s_m[line.s_m.len() - 1] / BIN_M).ceil() as usize).max(1)
}

/// Value at `s` between the middles of bins.
fn between(values: &[f64], s_m: f64) -> f64 {
    let at = (s_m / BIN_M - 0.5).clamp(0.0, (values.len() - 1) as f64);
    let below = at.floor() as usize;
    let above = (below + 1).min(values.len() - 1);
    values[below] + (at - below as f64) * (values[above] - values[below])
}

/// Medians by bin, 0 where a bin has fewer than five values; smoothed over three bins.
fn medians(mut by_bin: Vec<Vec<f64>>) -> Vec<f64> {
    let raw: Vec<f64> = by_bin.iter_mut().map(|values| if values.len() < 5 { 0.0 } else { median(values) }).collect();
    let mean = |i: usize| {
        let near = &raw[i.saturating_sub(1)..(i + 2).min(raw.len())];
        near.iter().sum::<f64>() / near.len() as f64
    };
    (0..raw.len()).map(mean).collect()
}

/// The line with the median direction of the tracks.
fn turned(line: &RoadLine, paths: &[Path]) -> Option<RoadLine> {
    let mut turns: Vec<Vec<f64>> = vec![Vec::new(); bins(line)];
    for path in paths {
        let on: Vec<(OnRoad, [f64; 2])> = line.along_path(path).collect();
        // Steps of a few metres, because positions are noisy.
        let mut from = 0;
        for k in 1..path.len() {
            let step = minus(path[k], path[from]);
            if length(step) >= STEP_M {
                let tangent = on[usize::midpoint(from, k)].1;
                turns[bin(line, on[k].0.s_m)].push(libm::atan2(cross(tangent, step), dot(tangent, step)));
                from = k;
            }
        }
    }
    let turns = medians(turns);
    let middle = line.points.len() / 2;
    let angles: Vec<f64> =
        line.tangents.iter().zip(&line.s_m).map(|(tangent, s)| angle(*tangent) + between(&turns, *s)).collect();
    let step = |i: usize| {
        let (a, b) =
            ([libm::cos(angles[i]), libm::sin(angles[i])], [libm::cos(angles[i + 1]), libm::sin(angles[i + 1])]);
        let by = (line.s_m[i + 1] - line.s_m[i]) / 2.0;
        [by * (a[0] + b[0]), by * (a[1] + b[1])]
    };
    // From the middle to both ends.
    let mut points = vec![line.points[middle]; line.points.len()];
    for i in middle..line.points.len() - 1 {
        let by = step(i);
        points[i + 1] = [points[i][0] + by[0], points[i][1] + by[1]];
    }
    for i in (0..middle).rev() {
        let by = step(i);
        points[i] = [points[i + 1][0] - by[0], points[i + 1][1] - by[1]];
    }
    RoadLine::along(&points)
}

/// The line shifted sideways by the drift of the vehicles: the median of how far they move to the left from bin to bin,
/// summed up along the road. Lane changes are too few to move a median.
fn shifted(line: &RoadLine, paths: &[Path]) -> Option<RoadLine> {
    let mut steps: Vec<Vec<f64>> = vec![Vec::new(); bins(line)];
    for path in paths {
        let mut means: Vec<(usize, f64, f64)> = Vec::new();
        for on in line.project_all(path) {
            let at = bin(line, on.s_m);
            match means.last_mut() {
                Some((last, sum, count)) if *last == at => (*sum, *count) = (*sum + on.d_m, *count + 1.0),
                _ => means.push((at, on.d_m, 1.0)),
            }
        }
        for pair in means.windows(2) {
            let ((a, sum_a, count_a), (b, sum_b, count_b)) = (pair[0], pair[1]);
            if b == a + 1 {
                steps[b].push(sum_b / count_b - sum_a / count_a);
            }
        }
    }
    let drifts = medians(steps).into_iter().scan(0.0, |drift, step| {
        *drift += step;
        Some(*drift)
    });
    let drifts: Vec<f64> = drifts.collect();
    let middle = between(&drifts, 0.5 * line.s_m[line.s_m.len() - 1]);
    let moved = line.points.iter().zip(&line.tangents).zip(&line.s_m).map(|((point, tangent), s)| {
        let by = between(&drifts, *s) - middle;
        [point[0] - by * tangent[1], point[1] + by * tangent[0]]
    });
    RoadLine::along(&moved.collect::<Vec<_>>())
}
