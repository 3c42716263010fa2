// What the page shows, and its address: a link shows what somebody saw.
const data = JSON.parse(document.getElementById("explorer-data").textContent);
const described = (key) => data.parameters[key];
for (const kind of data.kinds) { kind.parameters = kind.parameters.map((key) => ({ start: null, ...data.sliders.find((slider) => slider.key === key), ...described(key) })); }
for (const grid of data.grids) {
  for (const axis of [grid.x, grid.y]) { Object.assign(axis, described(axis.parameter)); }
  const [panelAxes, fixed] = [grid.panel_parameters.map(described), grid.fixed.map(([key, value]) => [described(key), value])];
  Object.assign(grid, { panelAxes, fixed, isPlain: grid.cases === "plain" && !grid.native_gap });
}
data.panels = data.grids.flatMap((grid) => grid.panels.map((values, panel) => ({ grid, panel, values })));
const state = { kind: "", profile: "", criterion: "", drivers: [], start: "gap_m", x: null, y: null, values: {}, panel: null, at: null };

const kindOf = (key = state.kind) => data.kinds.find((kind) => kind.key === key);
const parameterOf = (key) => kindOf().parameters.find((parameter) => parameter.key === key);
const settingOf = (profile = state.profile, kind = state.kind) => data.settings.find((setting) => setting.profile === profile && setting.kind === kind);
const isStart = (key) => parameterOf(key).start !== null;
// Nine decimals, as on the axes of the program.
const decimal = (value) => Math.round(value * 1e9) / 1e9;
const within = (value, low, high) => Math.min(Math.max(value, low), high);

// A vehicle is as fast as the ego if its speed is null; without one, but for cut-ins, which need another.
const isFollowing = (key) => Boolean(parameterOf(key).follows) && (state.values[key] === null || (state.values[key] === undefined && kindOf().category !== "cut-in"));
// The value of a parameter where the axes have the values `at`.
const valueOf = (key, at = {}) => at[key] ?? (isFollowing(key) ? valueOf(parameterOf(key).follows, at) : state.values[key] ?? parameterOf(key).value);
// An axis within the range of its parameter.
function axisOf(key, side, from = -Infinity, to = Infinity, cells = side === "x" ? 60 : 40) {
  const { from: low, to: high } = parameterOf(key);
  const [first, last] = [from, to].map((value) => within(value, low, high)).sort((a, b) => a - b);
  return { key, ...(first < last ? { from: first, to: last } : { from: low, to: high }), cells: within(Math.round(cells) || 2, 2, 400) };
}

const axisValues = ({ from, to, cells }) => Array.from({ length: cells }, (_, at) => decimal(from + ((to - from) * at) / (cells - 1)));
// Completes the state after a change of the kind.
function setKind(key) {
  state.kind = key;
  const isKnown = (axis) => axis && parameterOf(axis.key);
  if (!isKnown(state.x)) { state.x = axisOf(state.start, "x", 1, 60); }
  const isFree = (other) => parameterOf(other) && other !== state.x.key;
  if (!isKnown(state.y) || !isFree(state.y.key)) { state.y = axisOf(["lateral_speed_mps", "deceleration_mps2", "ego_speed_kmh"].find(isFree), "y"); }
  if (!settingOf()) { state.profile = data.settings.find(({ kind }) => kind === key).profile; }
}
// Two axes of one parameter, or both initial distances at once, are no case.
function setAxis(side, key) {
  const other = side === "x" ? "y" : "x";
  if (state[other].key === key || (isStart(state[other].key) && isStart(key))) { state[other] = axisOf(state[side].key, other); }
  state[side] = axisOf(key, side);
}

const startKey = () => [state.x.key, state.y.key].find(isStart) ?? state.start;
// The parameters that have a slider: neither an axis nor the other initial distance.
const sliderParameters = () =>
  kindOf().parameters.filter(({ key, start }) => key !== state.x.key && key !== state.y.key && (start === null || key === startKey()));

function toAddress() {
  const { kind, profile, criterion, drivers, start, x, y, values, panel, at } = state;
  const axis = ({ key, from, to, cells }) => [key, from, to, cells].join("_to_");
  const fields = { kind, profile, criterion, drivers, start, x: axis(x), y: axis(y), ...values, ...(panel === null ? {} : { panel }), ...(at ? { at } : {}) };
  return "#" + new URLSearchParams(fields);
}
// Reads the address; false if it has no state. What the page does not have is left out.
function fromAddress() {
  const fields = Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
  if (!fields.kind || !kindOf(fields.kind)) { return false; }
  const numbers = (text, separator) => (text ?? "").split(separator).map((number) => (number === "" ? NaN : Number(number)));
  state.kind = fields.kind;
  state.profile = data.profiles.includes(fields.profile) ? fields.profile : data.profiles[0];
  state.criterion = data.criteria.find(({ key }) => key === fields.criterion)?.key ?? data.criterion;
  state.drivers = data.drivers.map(({ name }) => name).filter((name) => fields.drivers === undefined || fields.drivers.split(",").includes(name));
  state.start = fields.start === "thw_s" ? "thw_s" : "gap_m";
  for (const side of ["x", "y"]) {
    const [key, ...rest] = (fields[side] ?? "").split("_to_");
    state[side] = parameterOf(key) && rest.length === 3 && rest.every((number) => Number.isFinite(Number(number))) ? axisOf(key, side, ...rest.map(Number)) : null;
  }
  const given = kindOf().parameters.filter(({ key }) => Number.isFinite(numbers(fields[key])[0]));
  const following = kindOf().parameters.filter(({ key }) => fields[key] === "null").map(({ key }) => [key, null]);
  state.values = Object.fromEntries([...following, ...given.map(({ key, from, to }) => [key, within(Number(fields[key]), from, to)])]);
  state.panel = data.panels[fields.panel] ? Number(fields.panel) : null;
  const at = numbers(fields.at, ",");
  state.at = at.length === 2 && at.every(Number.isFinite) ? at : null;
  setKind(state.kind);
  return true;
}
