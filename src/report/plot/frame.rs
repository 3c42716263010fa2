//! The surroundings of a plot: ticks with their numbers, and names.

use super::axis::{Axis, Tick, on_circle};
use super::svg::{Anchor, Canvas, GREY, GRID, Paint, Position, Type};
use super::{NAME_GAP_PX, NAME_PX, Name, Plot, RADIUS_PX, SPOKE_PX, TEXT, TICK};

impl Plot {
    /// Draws the horizontal axis: grid, ticks, numbers.
    pub(super) fn numbers_below(
        &self,
        canvas: &mut Canvas,
        axis: &Axis,
        (top, bottom): (f64, f64),
        (has_numbers, has_grid): (bool, bool),
    ) {
        // As many numbers as have room.
        let has_room = |ticks: &Vec<Tick>| {
            let widths: Vec<f64> = ticks.iter().map(|tick| TICK.text_px(&tick.label)).collect();
            widths.len() > 1 && widths.iter().sum::<f64>() + 10.0 * widths.len() as f64 <= axis.length_px() + 20.0
        };
        let most = (axis.length_px() / 18.0) as usize;
        let ticks = (2..=most).rev().map(|count| axis.ticks(count)).find(has_room);
        let ticks = ticks.unwrap_or_else(|| axis.ticks(2));
        let line = |tick: &Tick, from: f64, to: f64| vec![(tick.at_px, from), (tick.at_px, to)];
        marks(canvas, &ticks, has_grid, &|tick| line(tick, top, bottom), &|tick| line(tick, bottom, bottom + 4.0));
        for Tick { at_px, label } in ticks.iter().filter(|_| has_numbers) {
            // A number at an end must not reach into the next plot.
            let (half, (left, right)) = (TICK.text_px(label) / 2.0, axis.ends_px());
            let x = at_px.clamp(left + half - 3.0, (right - half + 3.0).max(left + half - 3.0));
            canvas.text((x, bottom + 17.0), label, TICK, Anchor::Middle);
        }
    }

    /// Draws the names of a vertical axis at the left and their notes at the right.
    pub(super) fn names_beside(&self, canvas: &mut Canvas, (left, right): (f64, f64), (top, bottom): (f64, f64)) {
        let name_px = self.y.names.iter().map(|name| TEXT.text_px(&name.words)).fold(0.0, f64::max).min(NAME_PX);
        for (at, name) in self.y.names.iter().enumerate() {
            // In the middle between this name and the next.
            let end = self.y.names.get(at + 1).map_or(bottom, |next| top - next.at);
            let words_px = TEXT.height_px(&name.words, name_px + 1.0).max(TEXT.line_px());
            let y = (top - name.at + end - words_px) / 2.0;
            canvas.paragraph((left - name_px - 8.0, y), &name.words, TEXT, name_px + 1.0);
            canvas.paragraph((right + 8.0, y), &name.note, TEXT, NAME_PX);
        }
    }
}

/// Draws the vertical axis: grid, ticks, numbers.
pub(super) fn numbers_left(
    canvas: &mut Canvas,
    axis: &Axis,
    (left, right): (f64, f64),
    (has_numbers, has_grid): (bool, bool),
) {
    // As many numbers as fit above one another without crowding.
    let ticks = axis.ticks((axis.length_px() / 18.0).clamp(2.0, 6.0) as usize);
    let line = |tick: &Tick, from: f64, to: f64| vec![(from, tick.at_px), (to, tick.at_px)];
    marks(canvas, &ticks, has_grid, &|tick| line(tick, left, right), &|tick| line(tick, left - 4.0, left));
    for Tick { at_px, label } in ticks.iter().filter(|_| has_numbers) {
        canvas.text((left - 7.0, at_px + 4.5), label, TICK, Anchor::End);
    }
}

/// Draws a grid line and a mark at every tick.
fn marks(
    canvas: &mut Canvas,
    ticks: &[Tick],
    has_grid: bool,
    grid: &dyn Fn(&Tick) -> Vec<Position>,
    mark: &dyn Fn(&Tick) -> Vec<Position>,
) {
    let lines = ticks.iter().filter(|_| has_grid).map(grid);
    canvas.path(&lines.collect::<Vec<_>>(), false, Paint::line(GRID, 0.6));
    canvas.path(&ticks.iter().map(mark).collect::<Vec<_>>(), false, Paint::line(GREY, 1.0));
}

/// Draws a spoke's name outside the outer ring: upward at the top, downward at the bottom, centred at the sides.
pub(super) fn spoke_name(canvas: &mut Canvas, name: &Name, centre: Position, turn: f64) {
    let (x, y) = on_circle(centre, RADIUS_PX + NAME_GAP_PX, turn);
    let anchor = match libm::sin(turn) {
        across if across > 0.2 => Anchor::Start,
        across if across < -0.2 => Anchor::End,
        _ => Anchor::Middle,
    };
    let set = if name.is_empty { Type { colour: GREY, ..TEXT } } else { TEXT };
    // The cosine goes from 1 (the block ends at y) through 0 (centred on y) to -1 (it starts at y).
    let top = y - set.height_px(&name.words, SPOKE_PX) * (1.0 + libm::cos(turn)) / 2.0;
    canvas.block((x, top), &name.words, set, SPOKE_PX, anchor);
}
