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
// Round numbers in a range.
function ticks(from, to, most) {
  const rough = (to - from) / most || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((times) => times * power).find((size) => size >= rough);
  const count = Math.floor(to / step + 1e-9) - Math.ceil(from / step - 1e-9) + 1;
  return Array.from({ length: count }, (_, at) => decimal((Math.ceil(from / step - 1e-9) + at) * step));
}

function line(paint, colour, wide, dash, draw) {
  paint.save();
  Object.assign(paint, { strokeStyle: colour, lineWidth: wide }).setLineDash(dash);
  paint.beginPath();
  draw();
  paint.stroke();
  paint.restore();
}
// Draws within a path only.
function clipped(paint, path, draw) {
  paint.save();
  paint.beginPath();
  path();
  paint.clip();
  draw();
  paint.restore();
}
// A frame with ticks; `atX` and `atY` place values.
function frame(paint, box, xs, ys, atX, atY) {
  Object.assign(paint, { fillStyle: shade("--ink"), textAlign: "center", textBaseline: "top" });
  line(paint, shade("--ink"), 1, [], () => paint.rect(box.x, box.y, box.w, box.h));
  for (const value of ticks(xs[0], xs.at(-1), Math.max(box.w / 70, 2))) {
    paint.fillRect(atX(value), box.y + box.h, 1, 4);
    paint.fillText(short(value), atX(value), box.y + box.h + 7);
  }
  Object.assign(paint, { textAlign: "right", textBaseline: "middle" });
  for (const value of ticks(ys[0], ys.at(-1), Math.max(box.h / 45, 2))) {
    paint.fillRect(box.x - 4, atY(value), 4, 1);
    paint.fillText(short(value), box.x - 7, atY(value));
  }
}
// Where a value stands on an axis of cells, in cells.
function placeOf(values, value) {
  const above = values.findIndex((known) => known >= value);
  if (above <= 0) { return above === 0 ? 0.5 : values.length - 0.5; }
  return above - 0.5 + (value - values[above]) / (values[above] - values[above - 1]);
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
  for (const place of places) {
    paint.fillStyle = colourOf(map, shown, place.cell);
    paint.fillRect(...cellRectangle(place));
  }
  const impossible = () => places.filter(({ cell }) => !map.isPossible(cell)).forEach((place) => paint.rect(...cellRectangle(place)));
  clipped(paint, impossible, () => line(paint, "#ffffff", 1.2, [], () => {
    for (let x = box.x - height; x < width; x += 7) { paint.moveTo(x, height); paint.lineTo(x + height, 0); }
  }));
  const around = (holds, colour, dash, wide) => {
    const inside = places.map(({ cell }) => holds(cell));
    const edges = () => places.forEach(({ cell, i, j }) => {
      if (i > 0 && inside[cell] !== inside[cell - 1]) { paint.moveTo(px(i), py(j)); paint.lineTo(px(i), py(j + 1)); }
      if (j > 0 && inside[cell] !== inside[cell - map.nx]) { paint.moveTo(px(i), py(j)); paint.lineTo(px(i + 1), py(j)); }
    });
    line(paint, "#ffffff", wide + 2, [], edges);
    line(paint, colour, wide, dash, edges);
  };
  shown.forEach((at) => around((cell) => Boolean(map.isPossible(cell) && failsAt(map, at, cell)), colourOfDriver(map, at), [], 1.6));
  if (surrounds(map)) { around((cell) => Boolean(map.notPreventable(cell)), data.boundary, [5, 3], 1.8); }
  for (const [colour, wide] of cursor ? [["#ffffff", 5], ["#1a1a1a", 2]] : []) { line(paint, colour, wide, [], () => paint.rect(...cellRectangle(cursor))); }
  frame(paint, box, map.xs, map.ys, (value) => px(placeOf(map.xs, value)), (value) => py(placeOf(map.ys, value)));
  Object.assign(paint, { textAlign: "center", textBaseline: "alphabetic" });
  paint.fillText(labelOf(map.x), box.x + box.w / 2, height - 12, box.w);
  paint.rotate(-Math.PI / 2);
  paint.fillText(labelOf(map.y), -box.y - box.h / 2, 14, box.h);
  canvas.shown = { map, cursor };
  canvas.cellAt = (x, y) => {
    const [i, j] = [Math.floor((x - box.x) / cw), Math.floor((box.y + box.h - y) / ch)];
    return i >= 0 && j >= 0 && i < map.nx && j < map.ny ? { i, j, cell: j * map.nx + i } : null;
  };
}

const surrounds = (map) => map.notPreventable && state.criterion === "collision";
const colourOfDriver = (map, at) => data.drivers.find(({ name }) => name === map.names[at]).colour;

function colourOf(map, shown, cell) {
  const outcomes = shown.map((at) => map.outcome(at, cell));
  const failing = shown.filter((at) => failsAt(map, at, cell)).length;
  if (!map.isPossible(cell) || !shown.length) { return data.outcomes[OUTCOME.NoTraffic].colour; }
  if (shown.length > 1 && failing > 0) { return mixed(failing / shown.length); }
  // Of several that pass, one has a conflict to avoid.
  return data.outcomes[shown.length === 1 ? outcomes[0] : outcomes.find((of) => of !== OUTCOME.NoConflict) ?? OUTCOME.NoConflict].colour;
}
// From pale to the colour of a failure.
function mixed(share) {
  const [from, to] = ["#d5deec", data.outcomes[OUTCOME.Fail].colour].map((colour) => [1, 3, 5].map((at) => Number.parseInt(colour.slice(at, at + 2), 16)));
  return `rgb(${from.map((value, at) => Math.round(value + (to[at] - value) * share))})`;
}
// What the colours and lines mean, with counts.
function keyOf(map, shown) {
  const cells = [...Array(map.nx * map.ny).keys()];
  const possible = cells.filter(map.isPossible);
  const entry = (kind) => (colour, text) => `<li><span class="${kind}" style="--of: ${colour}"></span>${text}</li>`;
  const [fill, rule] = [entry("fill"), entry("line")];
  const failing = (cell) => (shown.length > 1 && map.isPossible(cell) ? shown.filter((at) => failsAt(map, at, cell)).length : 0);
  const colours = new Map(cells.map((cell) => [colourOf(map, shown, cell), failing(cell)]));
  const words = ([colour, count]) => fill(colour, count ? `${count} of ${shown.length} fail` : data.outcomes.find((of) => of.colour === colour).label);
  const share = (at) => (100 * possible.filter((cell) => failsAt(map, at, cell)).length) / (possible.length || 1);
  const drivers = shown.map((at) => rule(colourOfDriver(map, at), `${map.names[at]} fails in ${share(at).toFixed(1)} %`));
  const both = surrounds(map) && possible.some(map.notPreventable) ? [rule(data.boundary, `around what is not preventable, ${map.references.join(" and ")} both collide: ${possible.filter(map.notPreventable).length}`)] : [];
  return `<ul>${[...[...colours].sort(([, a], [, b]) => a - b).map(words), ...drivers, ...both].join("")}</ul>`;
}
