// Maps: those of the program and of the device. A map has axes, and for a driver and a cell verdict bits and an outcome.
const OUTCOME = Object.fromEntries(data.outcomes.map(({ key }, at) => [key, at]));
const criterionBit = () => data.criteria.find(({ key }) => key === state.criterion).bit;
const failsAt = (map, at, cell) => (map.bits(at, cell) >> criterionBit()) & 1;
// The kind with the parameters of the program's map; undefined if there is none.
function kindOfGrid({ x, y, panelAxes, fixed, category }) {
  const flags = [x, y, ...panelAxes, ...fixed.map(([axis]) => axis)].map(({ flag }) => flag);
  const isKnown = (kind, flag) => kind.parameters.some((of) => of.flag === flag) || data.sizes.some((size) => size.startsWith(`--${flag} `));
  return data.kinds.find((kind) => kind.category === category.replace("_", "-") && flags.every((flag) => isKnown(kind, flag)));
}
// The slider of a program's parameter, and a value in its unit.
const sliderOf = (grid, { flag }) => kindOfGrid(grid)?.parameters.find((of) => of.flag === flag);
const inUnit = (grid, of, value) => decimal((value / of.perSi) * sliderOf(grid, of).perSi);
// The values of a program's axis that the page has too.
function sharedValues(grid, side) {
  const { from, to } = sliderOf(grid, grid[side]);
  return grid[side].values.map((value) => inUnit(grid, grid[side], value)).filter((value) => value >= from && value <= to);
}
// Whether the device computes the same cases, and if not, how they differ from its own, in words.
const isComputable = ({ grid }) => grid.isPlain && kindOfGrid(grid) && settingOf(data.profiles[0], kindOfGrid(grid).key) && ["x", "y"].every((side) => sharedValues(grid, side).length === grid[side].values.length);
const isPrecomputed = () => state.panel !== null && !(device && isComputable(data.panels[state.panel]));
const RUN_UP = "the lateral speed builds up in a run-up before the start, and a run of CCHDM ends once the vehicles overlap laterally at a large TTC";
const STEPS = "the lateral position moves as in the JRC's simulator, step by step, from one step after the start";
const difference = ({ cases, category, native_gap: native }) =>
  [cases === "jrc-comparison" && RUN_UP, cases !== "plain" && category !== "lvd" && STEPS, cases === "jrc" && category === "cut_out" && "a cut-out covers 4 m", native && "each driver starts at its own gap"].filter(Boolean).join("; ") || "their profile or some of their values have no control here";
// The state of a panel of the program's maps, as far as the page has its parameters.
function showPanel(at) {
  const { grid, values } = data.panels[at];
  Object.assign(state, { panel: at, profile: data.profiles[0], kind: kindOfGrid(grid)?.key ?? state.kind, values: { other_speed_kmh: null }, at: null });
  for (const side of kindOfGrid(grid) ? ["x", "y"] : []) {
    const shared = sharedValues(grid, side);
    state[side] = axisOf(side, { key: sliderOf(grid, grid[side]).key, from: shared[0], to: shared.at(-1), cells: shared.length });
  }
  for (const [of, value] of [...grid.fixed, ...grid.panelAxes.map((axis, place) => [axis, values[place]])].filter(([axis]) => sliderOf(grid, axis))) {
    const { key, start } = sliderOf(grid, of);
    [state.values[key], state.start] = [inUnit(grid, of, value), start === null ? state.start : key];
  }
}
// Why there is no such case: a cut-out's other vehicle, and one that brakes.
const [THROUGH, FASTER] = ["the vehicle that cuts out drives through the one ahead of it", "the vehicle that brakes would end faster than it began"];
// Run lengths: a count, if it is not 1, and a letter.
const unpacked = (text) => [...text.matchAll(/(\d*)([a-z])/g)].flatMap(([, count, letter]) => Array(Number(count || 1)).fill(letter.charCodeAt(0) - 97));
function programMap(at) {
  const { grid, panel } = data.panels[at];
  grid.runs ??= Object.fromEntries(Object.entries(grid.outcomes).map(([criterion, drivers]) => [criterion, drivers.map(unpacked)]));
  const [nx, ny] = [grid.x.values.length, grid.y.values.length];
  const outcome = (driver, cell, criterion = state.criterion) => grid.runs[criterion][driver][panel * nx * ny + cell];
  const fails = (driver, cell, key) => [OUTCOME.Fail, OUTCOME.FailByReaction].includes(outcome(driver, cell, key));
  const bits = (driver, cell) => data.criteria.reduce((sum, { key, bit }) => sum | (fails(driver, cell, key) << bit), 0);
  const references = data.settings.find(({ profile }) => profile === data.profiles[0])?.references ?? [];
  const notPreventable = (cell) => references.every((name) => outcome(grid.models.indexOf(name), cell, "collision") === OUTCOME.Fail);
  return { nx, ny, x: grid.x, y: grid.y, xs: grid.x.values, ys: grid.y.values, names: grid.models, bits, outcome, isPossible: (cell) => outcome(0, cell) !== OUTCOME.NoTraffic,
    noTraffic: THROUGH, references, notPreventable: references.length && references.every((name) => grid.models.includes(name)) ? notPreventable : null };
}
// If the initial distance is on an axis, its values are the starts of the other axis' cases.
async function deviceMap() {
  const [setting, { x, y }] = [settingOf(), state];
  const [xs, ys, across, up] = [axisValues(x), axisValues(y), isStart(x.key), isStart(y.key)];
  const cases = (across ? xs.slice(0, 1) : xs).flatMap((i) => (up ? ys.slice(0, 1) : ys).map((j) => caseAt(i, j).points));
  const starts = (across ? xs.map((i) => [i, ys[0]]) : up ? ys.map((j) => [xs[0], j]) : [[xs[0], ys[0]]]).map(([i, j]) => caseAt(i, j).starts[0]);
  const { bitsOf, impossible } = await computeVerdicts(setting, cases.flat(), starts);
  const [nx, ny, names] = [xs.length, ys.length, NAMES];
  const laneOf = (cell) => { const [i, j] = [cell % nx, Math.floor(cell / nx)]; return across ? j * nx + i : i * ny + j; };
  const [bits, unreacting] = [(driver, cell) => bitsOf(driver, laneOf(cell)), (cell) => bitsOf(names.length, laneOf(cell))];
  const [isPossible, isCase] = [(cell) => impossible(laneOf(cell)) === 0, (cell) => impossible(laneOf(cell)) !== 2];
  const outcome = (driver, cell) => {
    const [isCollision, fails] = [state.criterion === "collision", (bits(driver, cell) >> criterionBit()) & 1];
    if (!isPossible(cell)) { return OUTCOME.NoTraffic; }
    if (isCollision && setting.settles && !fails && (unreacting(cell) & 9) === 8) { return OUTCOME.Undecided; }
    if (!isCollision || unreacting(cell) & 1) { return fails ? OUTCOME.Fail : OUTCOME.Pass; }
    return fails ? OUTCOME.FailByReaction : OUTCOME.NoConflict;
  };
  const { references } = setting;
  const allCollide = (cell) => isPossible(cell) && (unreacting(cell) & 1) === 1 && references.every((name) => bits(names.indexOf(name), cell) & 1);
  const noTraffic = [kindOf().category === "cut-out" && THROUGH, parameterOf("end_speed_kmh") && FASTER].filter(Boolean).join(", or ");
  return { nx, ny, x: parameterOf(x.key), y: parameterOf(y.key), xs, ys, names, bits, outcome, isPossible, isCase, noTraffic, references, notPreventable: references.length ? allCollide : null, isLive: true };
}
// What a map of the device and the program's map of the same cells have in common.
function agreement(map) {
  const ours = state.panel === null || state.profile !== data.profiles[0] ? null : programMap(state.panel);
  if (!map.isLive || ours?.nx !== map.nx || ours.ny !== map.ny) { return ""; }
  const cells = [...Array(ours.nx * ours.ny).keys()].filter((cell) => ours.isPossible(cell) && map.isCase(cell));
  const differs = (name, at) => cells.filter((cell) => ours.outcome(at, cell) !== OUTCOME.Undecided && failsAt(ours, at, cell) !== failsAt(map, map.names.indexOf(name), cell));
  const differing = ours.names.flatMap(differs).length;
  return differing ? `${differing} of ${cells.length * ours.names.length} verdicts differ from the program's.` : "Every verdict is the program's.";
}
