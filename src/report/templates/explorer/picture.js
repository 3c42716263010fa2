// Pictures: axes, lines, and a map with its key.
const shade = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const labelOf = ({ label, unit }) => `${label} (${unit})`;
const short = (value) => String(Number(value.toPrecision(4)));
// The brush of a canvas with these CSS pixels, sharp on every screen.
function brush(canvas, height) {
  const [width, ratio, paint] = [canvas.parentElement.clientWidth, window.devicePixelRatio || 1, canvas.getContext("2d")];
  Object.assign(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
  canvas.style.height = `${height}px`;
  paint.scale(ratio, ratio);
  paint.font = "12px 'DejaVu Sans', Verdana, Arial, sans-serif";
  return { paint, width };
}
function ticks(from, to, most) {
  if (from === to) { return [from]; }
  const rough = (to - from) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((times) => times * power).find((size) => size >= rough);
  const count = Math.floor(to / step + 1e-9) - Math.ceil(from / step - 1e-9) + 1;
  return Array.from({ length: count }, (_, at) => decimal((Math.ceil(from / step - 1e-9) + at) * step));
}
const pathOf = (draw) => { const path = new Path2D(); return draw(path), path; };
function line(paint, strokeStyle, lineWidth, dash, draw) {
  Object.assign(paint, { strokeStyle, lineWidth }).setLineDash(dash);
  paint.stroke(pathOf(draw));
}
function clipped(paint, shape, draw) {
  paint.save();
  paint.clip(pathOf(shape));
  draw();
  paint.restore();
}
// A frame with ticks; `atX` and `atY` place values.
function frame(paint, box, xs, ys, atX, atY) {
  line(paint, shade("--ink"), 1, [], (path) => path.rect(box.x, box.y, box.w, box.h));
  const mark = (value, x, y, wide, tall, textX, textY) => { paint.fillRect(x, y, wide, tall); paint.fillText(short(value), textX, textY); };
  Object.assign(paint, { fillStyle: shade("--ink"), textAlign: "center", textBaseline: "top" });
  for (const value of ticks(xs[0], xs.at(-1), Math.max(box.w / 70, 2))) { mark(value, atX(value), box.y + box.h, 1, 4, atX(value), box.y + box.h + 7); }
  Object.assign(paint, { textAlign: "right", textBaseline: "middle" });
  for (const value of ticks(ys[0], ys.at(-1), Math.max(box.h / 45, 2))) { mark(value, box.x - 4, atY(value), 4, 1, box.x - 7, atY(value)); }
}
// Where a value stands on an axis of cells, in cells: in the middle of the cell that has it.
function placeOf(values, value) {
  const above = within(values.findIndex((known) => known >= value), 1, values.length - 1);
  return values.length > 1 ? above + 0.5 + (value - values[above]) / (values[above] - values[above - 1]) : 0.5;
}
// The cell at a place, counted in cells; null outside the map.
function cellAt({ nx, ny }, x, y) {
  const [i, j] = [Math.floor(x), Math.floor(y)];
  return i >= 0 && j >= 0 && i < nx && j < ny ? { i, j, cell: j * nx + i } : null;
}
// With one driver a cell shows its outcome, with several how many of them fail.
function drawMap(canvas, map, shown, cursor) {
  const height = Math.min(canvas.parentElement.clientWidth * 0.72, 560);
  const { paint, width } = brush(canvas, height);
  const box = { x: 56, y: 10, w: width - 66, h: height - 60 };
  const [cw, ch] = [box.w / map.nx, box.h / map.ny];
  const [px, py] = [(i) => Math.round(box.x + i * cw), (j) => Math.round(box.y + box.h - j * ch)];
  const cellRectangle = ({ i, j }) => [px(i), py(j + 1), px(i + 1) - px(i), py(j) - py(j + 1)];
  const places = [...Array(map.nx * map.ny).keys()].map((cell) => ({ cell, i: cell % map.nx, j: Math.floor(cell / map.nx) }));
  places.forEach((place) => Object.assign(paint, { fillStyle: colourOf(map, shown, place.cell) }).fillRect(...cellRectangle(place)));
  const impossible = (path) => places.filter(({ cell }) => !map.isPossible(cell)).forEach((place) => path.rect(...cellRectangle(place)));
  clipped(paint, impossible, () => line(paint, "#ffffff", 1.2, [], (path) => {
    for (let x = box.x - height; x < width; x += 7) { path.moveTo(x, height); path.lineTo(x + height, 0); }
  }));
  const around = (holds, colour, dash, wide) => {
    const inside = places.map(({ cell }) => holds(cell));
    const edges = (path) => places.forEach(({ cell, i, j }) => {
      if (i > 0 && inside[cell] !== inside[cell - 1]) { path.moveTo(px(i), py(j)); path.lineTo(px(i), py(j + 1)); }
      if (j > 0 && inside[cell] !== inside[cell - map.nx]) { path.moveTo(px(i), py(j)); path.lineTo(px(i + 1), py(j)); }
    });
    line(paint, "#ffffff", wide + 2, [], edges);
    line(paint, colour, wide, dash, edges);
  };
  shown.forEach((at) => around((cell) => Boolean(map.isPossible(cell) && failsAt(map, at, cell)), colourOfDriver(map, at), [], 1.6));
  if (surrounds(map)) { around((cell) => Boolean(map.notPreventable(cell)), data.boundary, [5, 3], 1.8); }
  for (const [colour, wide] of cursor ? [["#ffffff", 5], ["#1a1a1a", 2]] : []) { line(paint, colour, wide, [], (path) => path.rect(...cellRectangle(cursor))); }
  frame(paint, box, map.xs, map.ys, (value) => px(placeOf(map.xs, value)), (value) => py(placeOf(map.ys, value)));
  Object.assign(paint, { textAlign: "center", textBaseline: "alphabetic" });
  paint.fillText(labelOf(map.x), box.x + box.w / 2, height - 12, box.w);
  paint.rotate(-Math.PI / 2);
  paint.fillText(labelOf(map.y), -box.y - box.h / 2, 14, box.h);
  canvas.shown = { map, cursor };
  canvas.cellAt = (x, y) => cellAt(map, (x - box.x) / cw, (box.y + box.h - y) / ch);
}
const surrounds = (map) => map.notPreventable && state.criterion === "collision" && state.drivers.length;
const colourOfDriver = (map, at) => data.drivers.find(({ name }) => name === map.names[at]).colour;
function colourOf(map, shown, cell) {
  const outcomes = shown.map((at) => map.outcome(at, cell));
  const failing = shown.filter((at) => failsAt(map, at, cell)).length;
  if (!shown.length) { return shade("--paper"); }
  if (!map.isPossible(cell)) { return data.outcomes[OUTCOME.NoTraffic].colour; }
  if (shown.length > 1 && failing > 0) { return `color-mix(in srgb, ${data.outcomes[OUTCOME.Fail].colour} ${(100 * failing) / shown.length}%, #d5deec)`; }
  // Of several that pass, one has a conflict to avoid.
  return data.outcomes[shown.length === 1 ? outcomes[0] : outcomes.find((of) => of !== OUTCOME.NoConflict) ?? OUTCOME.NoConflict].colour;
}
// What the colours and lines mean, with counts.
function keyOf(map, shown) {
  if (!shown.length) { return "<p>No driver is chosen.</p>"; }
  const cells = [...Array(map.nx * map.ny).keys()];
  const possible = cells.filter(map.isPossible);
  const [fill, rule] = ["fill", "line"].map((kind) => (colour, text) => `<li><span class="${kind}" style="--of: ${colour}"></span>${text}</li>`);
  const failing = (cell) => (shown.length > 1 && map.isPossible(cell) ? shown.filter((at) => failsAt(map, at, cell)).length : 0);
  const colours = new Map(cells.map((cell) => [colourOf(map, shown, cell), failing(cell)]));
  const label = ({ key, label }) => label + (key === "NoTraffic" ? `: ${map.noTraffic}` : "");
  const words = ([colour, count]) => fill(colour, count ? `${count} of ${shown.length} fail` : label(data.outcomes.find((of) => of.colour === colour)));
  const share = (at) => (100 * possible.filter((cell) => failsAt(map, at, cell)).length) / (possible.length || 1);
  const drivers = shown.map((at) => rule(colourOfDriver(map, at), `${map.names[at]} fails in ${share(at).toFixed(1)} %`));
  const both = surrounds(map) && possible.some(map.notPreventable) ? [rule(data.boundary, `around what is not preventable, ${map.references.join(" and ")} both collide: ${possible.filter(map.notPreventable).length}`)] : [];
  return `<ul>${[...[...colours].sort(([, a], [, b]) => a - b).map(words), ...drivers, ...both].join("")}</ul>`;
}
