// Controls, and what happens when one is moved.
const $ = (id) => document.getElementById(`ex-${id}`);
const complain = (text) => { $("status").textContent = text; };
let [shownMap, cursor, hovered, millisecondsPerCell] = [null, null, 0, 0];
const element = (tag, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(tag), properties);
  return made.append(...children), made;
};
const coloured = (colour, made) => { made.style.setProperty("--of", colour); return made; };
const choice = (select, options, chosen) =>
  select.replaceChildren(...options.map(([value, text]) => element("option", { value, textContent: text, selected: String(value) === String(chosen) })));
// Computes what the state says and shows it; what is moved meanwhile is computed next, with fewer cells if that takes long.
let [isBusy, next] = [false, null];
async function update(isMoving = false) {
  history.replaceState(null, "", toAddress());
  next = { isMoving };
  if (isBusy) { return; }
  isBusy = true;
  try {
    while (next) {
      const coarse = next.isMoving && millisecondsPerCell * state.x.cells * state.y.cells > 250 ? 2 : 1;
      next = null;
      const isProgram = state.panel !== null && !(device && isComputable(data.panels[state.panel]));
      if (!isProgram && !(device && settingOf())) { continue; }
      const began = performance.now();
      [shownMap, cursor] = [isProgram ? programMap(state.panel) : await deviceMap(coarse), null];
      render();
      const [milliseconds, cells] = [Math.round(performance.now() - began), shownMap.nx * shownMap.ny];
      if (!isProgram) { millisecondsPerCell = milliseconds / cells; }
      Object.assign(document.body.dataset, { drawn: milliseconds, agreement: agreement(shownMap) });
      $("time").textContent = isProgram ? `Computed by the program that wrote this page.${isComputable(data.panels[state.panel]) ? "" : " The page does not make cases of this kind: sliders show plain ones."}`
        : `${cells} cells × ${data.drivers.length} drivers, computed here in ${milliseconds} ms${adapterName ? ` on ${adapterName}` : ""}. ${agreement(shownMap)}`;
    }
    if (state.at && shownMap?.isLive) { await showCase(...state.at); }
  } catch (error) { complain(`This map could not be computed: ${error.message}`); }
  isBusy = false;
}

const shownDrivers = () => [...shownMap.names.keys()].filter((at) => state.drivers.includes(shownMap.names[at]));
function render() {
  if (!shownMap) { return; }
  drawMap($("map"), shownMap, shownDrivers(), cursor);
  $("key").innerHTML = keyOf(shownMap, shownDrivers());
  describeCell();
}
// Where in a row of cells something holds, in values of the horizontal axis.
function intervals({ xs, nx }, row, holds) {
  const ends = xs.flatMap((_, i) => (holds(row * nx + i) ? [...(i > 0 && holds(row * nx + i - 1) ? [] : [i]), ...(i + 1 < nx && holds(row * nx + i + 1) ? [] : [i])] : []));
  const run = (at) => [...new Set([ends[at], ends[at + 1]])].map((i) => short(xs[i])).join("–");
  return ends.flatMap((_, at) => (at % 2 ? [] : [run(at)])).join(", ") || "nowhere";
}
// The cell under the pointer or the keys: outcomes, and where in its row each driver fails; then the device's values.
async function describeCell() {
  const [out, mine, map] = [$("cell"), ++hovered, shownMap];
  if (!cursor) { out.innerHTML = "<p>Point at a cell, or use the arrow keys, for its values; click or press Enter for its course over time.</p>"; return; }
  const { i, j, cell } = cursor;
  const head = (text) => `<th class="text" scope="col">${text}</th>`;
  const rows = shownDrivers().map((at) => `<tr><th class="text" scope="row">${map.names[at]}</th><td class="text">${data.outcomes[map.outcome(at, cell)].label}</td>
    <td></td><td></td><td class="text">${intervals(map, j, (of) => map.isPossible(of) && failsAt(map, at, of))}</td></tr>`);
  const heads = ["driver", data.criteria.find(({ key }) => key === state.criterion).label, "min. TTC", "max. BTN", `fails in this row at (${map.x.unit})`];
  out.innerHTML = `<p>${map.x.label} <b>${short(map.xs[i])} ${map.x.unit}</b>, ${map.y.label} <b>${short(map.ys[j])} ${map.y.unit}</b></p>
    <div class="scroll"><table><thead><tr>${heads.map(head).join("")}</tr></thead><tbody>${rows.join("")}</tbody></table></div>`;
  await new Promise((done) => setTimeout(done, 40));
  if (mine !== hovered || !map.isLive || !map.isCase(cell)) { return; }
  const [setting, { points, starts }] = [settingOf(), caseAt(map.xs[i], map.ys[j])];
  const results = await Promise.all(shownDrivers().map((at) => computeOutcomes(setting, at, points, starts, 0)));
  if (mine !== hovered) { return; }
  results.forEach(({ outcomes }, row) => {
    const { ttc, btn } = readOutcome(setting, outcomes);
    const [, , first, second] = out.querySelectorAll("tbody tr")[row].cells;
    [first.textContent, second.textContent] = [Number.isFinite(ttc) ? seconds(ttc) : "–", Number.isFinite(btn) ? btn.toFixed(2) : "∞"];
  });
}

async function showCase(x, y) {
  state.at = [x, y];
  history.replaceState(null, "", toAddress());
  const [setting, one] = [settingOf(), caseAt(x, y)];
  const run = async (at) => {
    const { traced, outcomes } = await computeOutcomes(setting, at, one.points, one.starts, setting.stepCap);
    const outcome = readOutcome(setting, outcomes);
    return { ...driverAt(at), outcome, steps: readSteps(setting, traced, outcome.lastStep) };
  };
  const traces = await Promise.all([...setting.drivers.keys()].map(run));
  const unreacting = traces.pop().outcome.bits;
  $("case").hidden = false;
  $("answer").textContent = answerOf(setting, unreacting, (name) => traces.find((trace) => trace.name === name).outcome.bits & 1);
  $("command").textContent = commandOf(one);
  $("words").replaceChildren(...traces.filter(isShown).map(({ name, colour, outcome }) =>
    coloured(colour, element("li", { textContent: sentence(name, outcome, setting.thresholds) }))));
  $("trace").shown = { setting, traces };
  drawTraces($("trace"));
  document.body.dataset.traced = traces.length;
}

function buildControls() {
  choice($("kind"), data.kinds.filter(({ key }) => data.settings.some(({ kind }) => kind === key)).map(({ key, label }) => [key, label]), state.kind);
  choice($("profile"), data.profiles.filter((name) => settingOf(name)).map((name) => [name, name]), state.profile);
  const words = ({ grid, values }) => [grid.name, ...grid.panelAxes.map(({ name, unit }, at) => `${name} ${values[at]} ${unit}`)].join(", ");
  choice($("panel"), [["", "–"], ...data.panels.map((panel, at) => [at, words(panel)])], state.panel ?? "");
  for (const side of ["x", "y"]) {
    choice($(side), kindOf().parameters.map((parameter) => [parameter.key, labelOf(parameter)]), state[side].key);
    const { from: min, to: max, step } = parameterOf(state[side].key);
    for (const end of ["from", "to"]) { Object.assign($(`${side}-${end}`), { min, max, step: "any", value: state[side][end] }); }
  }
  const pick = (type, name, chosen, change) => ({ key, name: value = key, label = value, colour = "transparent" }) => {
    const input = element("input", { type, name, value, checked: chosen.includes(value), onchange: () => { change(value, input.checked); update(); } });
    return coloured(colour, element("label", {}, input, label));
  };
  $("criteria").replaceChildren(...data.criteria.map(pick("radio", "ex-criterion", [state.criterion], (key) => { state.criterion = key; })));
  $("drivers").replaceChildren(...data.drivers.map(pick("checkbox", "ex-driver", state.drivers, (name, isOn) => {
    state.drivers = data.drivers.map((of) => of.name).filter((of) => (of === name ? isOn : state.drivers.includes(of)));
  })));
  $("sliders").replaceChildren(...sliderParameters().map(slider));
  document.querySelectorAll(".ex-live, #ex-kind, #ex-profile").forEach((part) => { part.disabled = !device; });
}
function slider(parameter) {
  const { key, from, to, step, label, unit, follows, start } = parameter;
  const is = { min: from, max: to, disabled: isFollowing(key) };
  const range = element("input", { type: "range", id: `ex-value-${key}`, ...is, step, value: valueOf(key) });
  const number = element("input", { type: "number", ...is, step: "any", value: valueOf(key), ariaLabel: labelOf(parameter) });
  const set = (value, isMoving) => {
    if (value === "") { return; }
    state.values[key] = within(Number(value), from, to);
    [range.value, number.value, state.panel, $("panel").value] = [state.values[key], state.values[key], null, ""];
    update(isMoving);
  };
  Object.assign(range, { oninput: () => set(range.value, true), onchange: () => set(range.value, false) });
  number.onchange = () => set(number.value, false);
  const row = element("div", { className: "ex-value" }, element("label", { htmlFor: range.id, textContent: label }), range, number, element("span", { textContent: unit }));
  const toggle = (text, checked, change) => row.append(element("label", {}, element("input", { type: "checkbox", checked, onchange: changed(change, false) }), text));
  if (follows) { toggle("as the ego", is.disabled, () => { state.values[key] = is.disabled ? valueOf(key) : null; }); }
  if (start !== null && !isStart(state.x.key) && !isStart(state.y.key)) { toggle("as a time headway", key === "thw_s", () => { state.start = key === "thw_s" ? "gap_m" : "thw_s"; }); }
  return row;
}
// A listener that changes the state; another case is shown no more.
const changed = (change, isOther = true) => () => {
  state.panel = null;
  if (isOther) { [state.at, $("case").hidden] = [null, true]; }
  change();
  setKind(state.kind);
  buildControls();
  update();
};

function listen() {
  $("kind").onchange = changed(() => { state.kind = $("kind").value; });
  $("profile").onchange = changed(() => { state.profile = $("profile").value; });
  $("panel").onchange = changed(() => { if ($("panel").value !== "") { showPanel(Number($("panel").value)); } });
  for (const side of ["x", "y"]) {
    $(side).onchange = changed(() => setAxis(side, $(side).value));
    const [from, to] = [$(`${side}-from`), $(`${side}-to`)];
    from.onchange = to.onchange = changed(() => { state[side] = axisOf(state[side].key, side, from.valueAsNumber, to.valueAsNumber, state[side].cells); });
  }
  const canvas = $("map");
  const move = (to) => { if (to && to.cell !== cursor?.cell) { cursor = to; render(); } };
  const open = () => { if (cursor && shownMap.isLive) { showCase(shownMap.xs[cursor.i], shownMap.ys[cursor.j]); } };
  canvas.onpointermove = canvas.onclick = (event) => { move(canvas.cellAt?.(event.offsetX, event.offsetY)); if (event.type === "click") { open(); } };
  canvas.onkeydown = (event) => {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1], Enter: [0, 0] }[event.key];
    if (!way || !shownMap) { return; }
    event.preventDefault();
    const { nx, ny } = shownMap;
    const from = cursor ?? { i: nx >> 1, j: ny >> 1 };
    const [i, j] = [within(from.i + way[0], 0, nx - 1), within(from.j + way[1], 0, ny - 1)];
    move({ i, j, cell: j * nx + i });
    if (event.key === "Enter") { open(); }
  };
  $("copy").onclick = () => navigator.clipboard?.writeText($("command").textContent);
  const redraw = () => { render(); drawTraces($("trace")); };
  addEventListener("resize", redraw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  addEventListener("hashchange", () => { if (fromAddress()) { buildControls(); update(); } });
}
async function start() {
  try { await openDevice(); } catch (error) { device = null; }
  if (!fromAddress()) {
    [state.profile, state.criterion, state.drivers] = [data.profiles[0], data.criterion, data.grids[0]?.models ?? data.drivers.map(({ name }) => name)];
    state.kind = data.kinds.find(({ category }) => category === data.category).key;
    if (data.panels.length) { showPanel(0); }
    setKind(state.kind);
  }
  if (!device && data.panels.length) { showPanel(state.panel ?? 0); setKind(state.kind); }
  buildControls();
  listen();
  if (!device) {
    complain("This browser has no WebGPU, with which the page computes maps: it shows those that the program computed. For others open the page in a current Chrome, Edge, Firefox or Safari, or run lanesweep map.");
  }
  await update();
  if (!device || !settingOf()) { return; }
  const differing = await differingDrivers(settingOf());
  document.body.dataset.known = differing.join(",") || "equal";
  complain(differing.length ? `Of 256 known lanes those of ${differing.join(", ")} have other bits on this device: verdicts at thresholds may differ from the program's.`
    : "256 known lanes have the program's bits on this device.");
}
start();
