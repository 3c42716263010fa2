// What the page shows, and its address: a link shows what somebody saw.
const data = JSON.parse(document.getElementById("explorer-data").textContent);
const [described, NAMES] = [(key) => data.parameters[key], data.drivers.map(({ name }) => name)];
for (const kind of data.kinds) { kind.parameters = kind.parameters.map((key) => ({ start: null, ...data.sliders.find((slider) => slider.key === key), ...described(key) })); }
for (const grid of data.grids) {
  for (const axis of [grid.x, grid.y]) { Object.assign(axis, described(axis.parameter)); }
  const [panelAxes, fixed] = [grid.panel_parameters.map(described), grid.fixed.map(([key, value]) => [described(key), value])];
  Object.assign(grid, { panelAxes, fixed, isPlain: grid.cases === "plain" && !grid.native_gap });
}
data.panels = data.grids.flatMap((grid) => grid.panels.map((values, panel) => ({ grid, panel, values })));
const state = { profile: data.profiles[0], criterion: data.criterion, drivers: data.grids[0]?.models ?? NAMES, start: "gap_m", x: null, y: null, values: {}, panel: null, at: null };
state.kind = data.kinds.find(({ category }) => category === data.category).key;
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
// An axis of a side within the range of its parameter; one cell if it has one value.
function axisOf(side, { key, from = -Infinity, to = Infinity, cells = 0 }) {
  const { from: low, to: high } = parameterOf(key);
  const [first, last] = [from, to].map((value) => within(value, low, high)).sort((a, b) => a - b);
  return { key, from: first, to: last, cells: first < last ? within(cells > 1 ? Math.round(cells) : { x: 60, y: 40 }[side], 2, 400) : 1 };
}
const axisValues = ({ from, to, cells }) => Array.from({ length: cells }, (_, at) => decimal(from + ((to - from) * at) / (cells - 1 || 1)));
const isInside = (at) => at?.every((value, of) => within(value, state["xy"[of]].from, state["xy"[of]].to) === value);
// Completes the state after a change of the kind.
function setKind(key) {
  state.kind = key;
  if (!parameterOf(state.x?.key)) { state.x = axisOf("x", { key: state.start, from: 1, to: 60 }); }
  const isFree = (other) => parameterOf(other) && other !== state.x.key;
  if (!isFree(state.y?.key)) { state.y = axisOf("y", { key: ["lateral_speed_mps", "deceleration_mps2", "ego_speed_kmh"].find(isFree) }); }
  if (!settingOf()) { state.profile = data.settings.find(({ kind }) => kind === key).profile; }
}
// Two axes of one parameter, or both initial distances at once, are no case.
function setAxis(side, key) {
  const other = side === "x" ? "y" : "x";
  if (state[other].key === key || (isStart(state[other].key) && isStart(key))) { state[other] = axisOf(other, { key: state[side].key }); }
  state[side] = axisOf(side, { key });
}
const startKey = () => [state.x.key, state.y.key].find(isStart) ?? state.start;
// The parameters of a case, without the other initial distance, and those that have a slider, not an axis.
const given = () => kindOf().parameters.filter(({ start, key }) => start === null || key === startKey());
const sliderParameters = () => given().filter(({ key }) => key !== state.x.key && key !== state.y.key);
function toAddress() {
  const { kind, profile, criterion, drivers, start, x, y, panel, at } = state;
  const axis = ({ key, from, to, cells }) => [key, from, to, cells].join("_to_");
  const values = Object.fromEntries(Object.entries(state.values).filter(([key]) => parameterOf(key)));
  return new URLSearchParams({ kind, profile, criterion, drivers, start, x: axis(x), y: axis(y), ...values, ...(panel === null ? {} : { panel }), ...(at ? { at } : {}) });
}
// What a link asks for and the page does not show, in words; empty if nothing.
function refused(asked) {
  const [shown, sorted] = [toAddress(), (text) => text?.split(",").sort().join()];
  const differing = asked.filter(([key, value]) => sorted(shown.get(key)) !== sorted(value) && !(shown.has(key) && Number(shown.get(key)) === Number(value)));
  const word = (key) => ({ x: "across", y: "up", at: "chosen case" })[key] ?? key;
  const instead = ([key]) => (shown.has(key) || parameterOf(key) ? `${word(key)} ${shown.get(key) ?? valueOf(key)}` : `no ${word(key)}`);
  return differing.length ? `The link asks for ${differing.map(([key, value]) => `${word(key)} ${value}`.trim()).join(", ")}; shown is ${differing.map(instead).join(", ")}.` : "";
}
// Reads the address as far as the page has what it names, and returns its fields; a link to a part of the page has none.
function fromAddress() {
  const asked = document.getElementById(location.hash.slice(1)) ? [] : [...new URLSearchParams(location.hash.slice(1))];
  const fields = Object.fromEntries(asked);
  if (!kindOf(fields.kind ?? "")) { return asked; }
  const numbers = (text = "", separator) => text.split(separator).map((number) => (number === "" ? NaN : Number(number)));
  state.kind = fields.kind;
  state.profile = data.profiles.includes(fields.profile) ? fields.profile : data.profiles[0];
  state.criterion = data.criteria.find(({ key }) => key === fields.criterion)?.key ?? data.criterion;
  state.drivers = NAMES.filter((name) => fields.drivers === undefined || fields.drivers.split(",").includes(name));
  state.start = fields.start === "thw_s" ? "thw_s" : "gap_m";
  for (const side of ["x", "y"]) {
    const [key, [, from, to, cells]] = [fields[side]?.split("_to_")[0], numbers(fields[side], "_to_")];
    state[side] = parameterOf(key) && [from, to, cells].every(Number.isFinite) ? axisOf(side, { key, from, to, cells }) : null;
  }
  const valued = kindOf().parameters.filter(({ key }) => fields[key] === "null" || Number.isFinite(numbers(fields[key])[0]));
  state.values = Object.fromEntries(valued.map(({ key, from, to }) => [key, fields[key] === "null" ? null : within(Number(fields[key]), from, to)]));
  state.panel = data.panels[fields.panel] ? Number(fields.panel) : null;
  const at = numbers(fields.at, ",");
  state.at = at.length === 2 && at.every(Number.isFinite) ? at : null;
  setKind(state.kind);
  return asked;
}
