// Maps: the panels of the program, and those that the device computes. A map has axes, and for a driver and a cell verdict
// bits and an outcome.
const OUTCOME = Object.fromEntries(data.outcomes.map(({ key }, at) => [key, at]));
const criterionBit = () => data.criteria.find(({ key }) => key === state.criterion).bit;
const failsAt = (map, at, cell) => (map.bits(at, cell) >> criterionBit()) & 1;
// The kind with the parameters of the program's map; undefined if there is none.
function kindOfGrid({ x, y, panelAxes, fixed, category }) {
  const flags = [x, y, ...panelAxes, ...fixed.map(([axis]) => axis)].map(({ flag }) => flag);
  const isKnown = (kind, flag) => kind.parameters.some((of) => of.flag === flag) || data.sizes.some((size) => size.startsWith(`--${flag} `));
  return data.kinds.find((kind) => kind.category === category.replace("_", "-") && flags.every((flag) => isKnown(kind, flag)));
}
// Whether the device computes the same cases.
const isComputable = ({ grid }) => grid.isPlain && data.settings.some(({ profile, kind }) => profile === data.profiles[0] && kind === kindOfGrid(grid)?.key);
// The state of a panel of the program's maps, as far as the page has its parameters.
function showPanel(at) {
  const { grid, values } = data.panels[at];
  const [given, kind] = [[...grid.fixed, ...grid.panelAxes.map((axis, place) => [axis, values[place]])], kindOfGrid(grid)];
  [state.panel, state.profile, state.values] = [at, data.profiles[0], { other_speed_kmh: null }];
  if (!kind) { return; }
  state.kind = kind.key;
  const known = ({ flag }) => kind.parameters.find((of) => of.flag === flag);
  const inUnit = (of, value) => decimal((value / of.perSi) * known(of).perSi);
  for (const side of ["x", "y"]) {
    const of = grid[side];
    state[side] = axisOf(known(of).key, side, inUnit(of, of.values[0]), inUnit(of, of.values.at(-1)), of.values.length);
  }
  for (const [of, value] of given.filter(([axis]) => known(axis))) {
    state.values[known(of).key] = inUnit(of, value);
    if (known(of).start !== null) { state.start = known(of).key; }
  }
}
// Run lengths: a count, if it is not 1, and a letter.
const unpacked = (text) => [...text.matchAll(/(\d*)([a-z])/g)].flatMap(([, count, letter]) => Array(Number(count || 1)).fill(letter.charCodeAt(0) - 97));

function programMap(at) {
  const { grid, panel } = data.panels[at];
  grid.runs ??= Object.fromEntries(Object.entries(grid.outcomes).map(([criterion, drivers]) => [criterion, drivers.map(unpacked)]));
  const [nx, ny] = [grid.x.values.length, grid.y.values.length];
  const outcome = (driver, cell, criterion = state.criterion) => grid.runs[criterion][driver][panel * nx * ny + cell];
  const fails = (of) => of === OUTCOME.Fail || of === OUTCOME.FailByReaction;
  const bits = (driver, cell) => data.criteria.reduce((sum, { key, bit }) => sum | (fails(outcome(driver, cell, key)) << bit), 0);
  const references = data.settings.find(({ profile }) => profile === data.profiles[0])?.references ?? [];
  const notPreventable = (cell) => references.every((name) => outcome(grid.models.indexOf(name), cell, "collision") === OUTCOME.Fail);
  return { nx, ny, x: grid.x, y: grid.y, xs: grid.x.values, ys: grid.y.values, names: grid.models, bits, outcome, isPossible: (cell) => outcome(0, cell) !== OUTCOME.NoTraffic,
    references, notPreventable: references.length && references.every((name) => grid.models.includes(name)) ? notPreventable : null };
}
// `coarse`: fewer cells. If the initial distance is on an axis, its values are the starts of the other axis' cases.
async function deviceMap(coarse) {
  const setting = settingOf();
  const [x, y] = [state.x, state.y].map((axis) => ({ ...axis, cells: Math.max(Math.round(axis.cells / coarse), 2) }));
  const [xs, ys, across, up] = [axisValues(x), axisValues(y), isStart(x.key), isStart(y.key)];
  const cases = (across ? xs.slice(0, 1) : xs).flatMap((i) => (up ? ys.slice(0, 1) : ys).map((j) => caseAt(i, j).points));
  const points = new Float32Array(cases.flatMap((of) => [...of]));
  const starts = (across ? xs.map((i) => [i, ys[0]]) : up ? ys.map((j) => [xs[0], j]) : [[xs[0], ys[0]]]).map(([i, j]) => caseAt(i, j).starts[0]);
  const { bitsOf, impossible } = await computeVerdicts(setting, points, starts);
  const [nx, ny, names] = [xs.length, ys.length, data.drivers.map(({ name }) => name)];
  const laneOf = (cell) => { const [i, j] = [cell % nx, Math.floor(cell / nx)]; return across ? j * nx + i : i * ny + j; };
  const bits = (driver, cell) => bitsOf(driver, laneOf(cell));
  const unreacting = (cell) => bits(names.length, cell);
  const isPossible = (cell) => impossible(laneOf(cell)) === 0;
  const outcome = (driver, cell) => {
    const [isCollision, fails] = [state.criterion === "collision", (bits(driver, cell) >> criterionBit()) & 1];
    if (!isPossible(cell)) { return OUTCOME.NoTraffic; }
    if (isCollision && setting.settles && !fails && (unreacting(cell) & 9) === 8) { return OUTCOME.Undecided; }
    if (!isCollision || unreacting(cell) & 1) { return fails ? OUTCOME.Fail : OUTCOME.Pass; }
    return fails ? OUTCOME.FailByReaction : OUTCOME.NoConflict;
  };
  const { references } = setting;
  const allCollide = (cell) => isPossible(cell) && (unreacting(cell) & 1) === 1 && references.every((name) => bits(names.indexOf(name), cell) & 1);
  const isCase = (cell) => impossible(laneOf(cell)) !== 2;
  return { nx, ny, x: parameterOf(x.key), y: parameterOf(y.key), xs, ys, names, bits, outcome, isPossible, isCase, references, notPreventable: references.length ? allCollide : null, isLive: true };
}
// What a map of the device and the program's map of the same cells have in common.
function agreement(map) {
  const ours = state.panel === null || state.profile !== data.profiles[0] ? null : programMap(state.panel);
  if (!map.isLive || ours?.nx !== map.nx || ours.ny !== map.ny) { return ""; }
  const cells = [...Array(ours.nx * ours.ny).keys()].filter((cell) => ours.isPossible(cell) && map.isCase(cell));
  const differs = (name, at) => cells.filter((cell) => ours.outcome(at, cell) !== OUTCOME.Undecided && failsAt(ours, at, cell) !== failsAt(map, map.names.indexOf(name), cell)).length;
  const differing = ours.names.reduce((sum, name, at) => sum + differs(name, at), 0);
  return differing ? `${differing} of ${cells.length * ours.names.length} verdicts differ from the program's.` : "Every verdict is the program's.";
}
