// Controls, and what happens when one is moved.
const $ = (id) => document.getElementById(`ex-${id}`);
const complain = (text) => { $("status").textContent = text; };
const notice = (text) => { [$("notice").textContent, $("notice").hidden] = [text, !text]; };
let [shownMap, cursor, hovered, isBusy, isAsked] = [null, null, 0, false, false];
const element = (tag, properties = {}, ...children) => { const made = Object.assign(document.createElement(tag), properties); return made.append(...children), made; };
const coloured = (colour, made) => { made.style.setProperty("--of", colour); return made; };
const choice = (select, options, chosen) => { select.replaceChildren(...options.map(([value, textContent]) => element("option", { value, textContent }))); select.value = chosen; };
const panelWords = ({ grid, values }) => [grid.name, ...grid.panelAxes.map(({ name, unit }, at) => `${name} ${values[at]} ${unit}`)].join(", ");
// What the user changed: a notice is out of date, and the address is that of the new state.
const save = () => { notice(""); history.replaceState(null, "", `#${toAddress()}`); };
// What the page shows, as its first sentence, and what sets precomputed maps apart.
function describeState() {
  const value = ({ key, label, unit }) => `${label} ${isFollowing(key) ? "that of the ego" : `${short(valueOf(key))} ${unit}`}`;
  const [{ label }, panel] = [data.criteria.find(({ key }) => key === state.criterion), isPrecomputed() ? data.panels[state.panel] : null];
  const held = panel ? `precomputed map ${panelWords(panel)}` : [kindOf().label, ...sliderParameters().map(value)].join(", ");
  document.querySelector("header p").textContent = `Cells that fail ${label} under ${state.profile}: ${held}; ${state.drivers.length ? `drivers ${state.drivers.join(", ")}` : "no driver"}.`;
  const other = data.grids.find((grid) => kindOfGrid(grid) === kindOf() && !isComputable({ grid }));
  $("cases").textContent = panel ? (isComputable(panel) ? "" : `Cases unlike those of the sliders: ${difference(panel.grid)}. A moved slider shows a map of plain cases; its counts may differ.`)
    : other ? `Plain cases. A precomputed map has others: ${difference(other)}. Its counts may differ.` : "";
}
// Greys what the page shows while it computes what the state says; what is changed meanwhile is computed next.
async function update() {
  isAsked = true;
  if (isBusy) { return; }
  isBusy = true;
  const mark = () => { for (const part of ["picture", "case"]) { $(part).ariaBusy = isBusy; } };
  try {
    while (isAsked) {
      [isAsked, shownMap, cursor, hovered, $("time").textContent] = [false, null, null, hovered + 1, "computing …"];
      mark();
      const began = performance.now();
      const made = isPrecomputed() ? programMap(state.panel) : device && await deviceMap();
      if (isAsked || !made) { continue; }
      [shownMap, cursor] = [made, state.at && made.isLive ? cellAt(made, placeOf(made.xs, state.at[0]), placeOf(made.ys, state.at[1])) : null];
      const milliseconds = Math.round(performance.now() - began);
      $("time").textContent = made.isLive ? `${made.nx * made.ny} cells × ${data.drivers.length} drivers, computed here in ${milliseconds} ms${adapterName ? ` on ${adapterName}` : ""}. ${agreement(made)}` : "Computed by the program that wrote this page.";
      await settle();
      Object.assign(document.body.dataset, { drawn: milliseconds, agreement: agreement(made) });
    }
  } catch (error) { [$("map").width, $("time").textContent, $("status").textContent] = [0, "", `This map could not be computed: ${error.message}`]; }
  isBusy = false;
  mark();
}
// Shows the map, and the chosen case.
async function settle() {
  describeState();
  render();
  if (state.at && shownMap?.isLive) { await showCase(); }
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
  const runs = xs.map((_, i) => (holds(row * nx + i) ? "x" : " ")).join("").matchAll(/x+/g);
  return [...runs].map(({ index, 0: run }) => [...new Set([index, index + run.length - 1])].map((i) => short(xs[i])).join("–")).join(", ") || "nowhere";
}
// The cell under the pointer or the keys: outcomes, and where in its row each driver fails; then the device's values.
async function describeCell() {
  const [out, mine, map] = [$("cell"), ++hovered, shownMap];
  const hint = map.isLive ? "A click or Enter shows a cell's course over time, below." : "This map has outcomes only. Courses over time belong to maps computed here.";
  if (!cursor) { out.innerHTML = `<p>Point at a cell, or use the arrow keys, for its values. ${hint}</p>`; return; }
  const { i, j, cell } = cursor;
  const rows = shownDrivers().map((at) => `<tr><th class="text" scope="row">${map.names[at]}</th><td class="text">${data.outcomes[map.outcome(at, cell)].label}</td>
    <td></td><td></td><td class="text">${intervals(map, j, (of) => map.isPossible(of) && failsAt(map, at, of))}</td></tr>`);
  const heads = ["driver", data.criteria.find(({ key }) => key === state.criterion).label, "min. TTC", "max. BTN", `fails in this row at (${map.x.unit})`];
  out.innerHTML = `<p>${map.x.label} <b>${short(map.xs[i])} ${map.x.unit}</b>, ${map.y.label} <b>${short(map.ys[j])} ${map.y.unit}</b></p>
    <div class="scroll"><table><thead><tr>${heads.map((text) => `<th class="text" scope="col">${text}</th>`).join("")}</tr></thead><tbody>${rows.join("")}</tbody></table></div><p>${hint}</p>`;
  await new Promise((done) => setTimeout(done, 40));
  if (mine !== hovered || !map.isLive || !map.isCase(cell)) { return; }
  const runs = await Promise.all(shownDrivers().map((at) => runCase(settingOf(), at, caseAt(map.xs[i], map.ys[j]), 0)));
  if (mine !== hovered) { return; }
  runs.forEach(({ outcome: { ttc, btn } }, row) => {
    const [, , first, second] = out.querySelectorAll("tbody tr")[row].cells;
    [first.textContent, second.textContent] = [Number.isFinite(ttc) ? seconds(ttc) : "–", Number.isFinite(btn) ? btn.toFixed(2) : "∞"];
  });
}
async function showCase() {
  const [at, setting, one] = [state.at, settingOf(), caseAt(...state.at)];
  const impossible = (await computeVerdicts(setting, one.points, one.starts)).impossible(0);
  const traces = impossible === 2 ? [] : await Promise.all(setting.drivers.map((_, at) => runCase(setting, at, one, setting.stepCap)));
  if (at !== state.at || isAsked) { return; }
  const unreacting = traces.pop()?.outcome.bits;
  const answer = () => `At exactly these values: ${answerOf(setting, unreacting, (name) => traces.find((trace) => trace.name === name).outcome.bits & 1)}`;
  $("case").hidden = false;
  $("answer").textContent = [answer, () => `No such traffic: ${THROUGH}. ${answer()}`, () => `No such case: ${FASTER}.`][impossible]();
  [$("command").textContent, $("copy").textContent] = [commandOf(one), "copy"];
  $("words").replaceChildren(...chosen(traces).map(({ name, colour, outcome }) => coloured(colour, element("li", { textContent: sentence(name, outcome, setting.thresholds) }))));
  $("trace").shown = { setting, traces };
  drawTraces($("trace"));
  document.body.dataset.traced = traces.length;
}
function buildControls() {
  choice($("kind"), data.kinds.filter(({ key }) => data.settings.some(({ kind }) => kind === key)).map(({ key, label }) => [key, label]), state.kind);
  choice($("profile"), data.profiles.filter((name) => settingOf(name)).map((name) => [name, name]), state.profile);
  choice($("panel"), [["", "none: computed here"], ...data.panels.map((panel, at) => [at, panelWords(panel)])], state.panel ?? "");
  for (const side of ["x", "y"]) {
    choice($(side), kindOf().parameters.map((parameter) => [parameter.key, parameter.label]), state[side].key);
    const [{ from, to }, axis, grid] = [parameterOf(state[side].key), state[side], isPrecomputed() ? data.panels[state.panel].grid : null];
    const values = grid ? grid[side].values.map((value) => (sliderOf(grid, grid[side]) ? inUnit(grid, grid[side], value) : value)) : axisValues(axis);
    for (const [end, min, max, value] of [["from", from, axis.to, values[0]], ["to", axis.from, to, values.at(-1)], ["cells", 2, 400, values.length]]) {
      const input = Object.assign($(`${side}-${end}`), { min, max, value });
      input.onchange = () => { if (accepts(input)) { changed(() => { state[side] = axisOf(side, { ...axis, [end]: input.valueAsNumber }); }, false)(); } };
    }
  }
  const pick = (type, name, chosen, change) => ({ key, name: value = key, label = value, colour = "transparent" }) => {
    const input = element("input", { type, name, value, checked: chosen.includes(value), onchange: () => { change(value, input.checked); save(); settle(); } });
    return coloured(colour, element("label", {}, input, label));
  };
  $("criteria").replaceChildren(...data.criteria.map(pick("radio", "ex-criterion", [state.criterion], (key) => { state.criterion = key; })));
  const turn = (name, isOn) => { state.drivers = NAMES.filter((of) => (of === name ? isOn : state.drivers.includes(of))); };
  $("drivers").replaceChildren(...data.drivers.map(pick("checkbox", "ex-driver", state.drivers, turn)));
  $("sliders").replaceChildren(...sliderParameters().map(slider));
  document.querySelectorAll(".ex-live, #ex-kind, #ex-profile").forEach((part) => { part.disabled = !device; });
}
// Whether an input has a number in its range. If not, the page says so, and shows the number in force.
function accepts(input) {
  const { ariaLabel, min, max, value } = input;
  if (value !== "" && input.checkValidity()) { return true; }
  buildControls();
  notice(`${ariaLabel}: ${value || "this"} is not a number from ${min} to ${max}. Nothing has changed.`);
  return false;
}
function slider(parameter) {
  const { key, from, to, step, label, unit, follows, start } = parameter;
  const is = { min: from, max: to, disabled: isFollowing(key) };
  const range = element("input", { type: "range", id: `ex-value-${key}`, ...is, step, value: valueOf(key) });
  const number = element("input", { type: "number", ...is, step: "any", value: valueOf(key), ariaLabel: labelOf(parameter) });
  const set = ({ value }) => {
    [state.values[key], range.value, number.value, state.panel, $("panel").value] = [Number(value), value, value, null, ""];
    save();
    update();
  };
  range.oninput = () => set(range);
  number.onchange = () => { if (accepts(number)) { set(number); } };
  const row = element("div", { className: "ex-value" }, element("label", { htmlFor: range.id, textContent: label }), range, number, element("span", { textContent: unit }));
  const toggle = (text, checked, change) => row.append(element("label", {}, element("input", { type: "checkbox", checked, onchange: changed(change, false) }), text));
  if (follows) { toggle("same speed as the ego", is.disabled, () => { state.values[key] = is.disabled ? valueOf(key) : null; }); }
  if (start !== null && !isStart(state.x.key) && !isStart(state.y.key)) { toggle("as a time headway", key === "thw_s", () => { state.start = key === "thw_s" ? "gap_m" : "thw_s"; }); }
  return row;
}
// A listener that changes the state; another case is shown no more.
const changed = (change, isOther = true) => () => {
  state.panel = null;
  change();
  setKind(state.kind);
  if (isOther || !isInside(state.at)) { [state.at, $("case").hidden] = [null, true]; }
  buildControls();
  save();
  update();
};
function listen() {
  $("kind").onchange = changed(() => { state.kind = $("kind").value; });
  $("profile").onchange = changed(() => { state.profile = $("profile").value; });
  $("panel").onchange = changed(() => { if ($("panel").value !== "") { showPanel(Number($("panel").value)); } });
  for (const side of ["x", "y"]) { $(side).onchange = changed(() => setAxis(side, $(side).value)); }
  const canvas = $("map");
  const move = (to) => { if (to && shownMap && to.cell !== cursor?.cell) { cursor = to; render(); } };
  const open = async () => {
    if (!cursor || !shownMap?.isLive) { return; }
    state.at = [shownMap.xs[cursor.i], shownMap.ys[cursor.j]];
    save();
    await showCase();
    $("words").scrollIntoView({ block: "nearest" });
  };
  canvas.onpointermove = canvas.onclick = (event) => { move(canvas.cellAt?.(event.offsetX, event.offsetY)); if (event.type === "click") { open(); } };
  canvas.onkeydown = (event) => {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1], Enter: [0, 0] }[event.key];
    if (!way || !shownMap) { return; }
    event.preventDefault();
    const { i, j } = cursor ?? { i: shownMap.nx >> 1, j: shownMap.ny >> 1 };
    move(cellAt(shownMap, i + way[0], j + way[1]));
    if (event.key === "Enter") { open(); }
  };
  $("copy").onclick = async () => {
    getSelection().selectAllChildren($("command"));
    $("copy").textContent = await (navigator.clipboard?.writeText($("command").textContent) ?? Promise.reject()).then(() => "copied", () => "the line is selected: copy it");
  };
  const redraw = () => { render(); drawTraces($("trace")); };
  addEventListener("resize", redraw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  for (const event of ["beforeprint", "afterprint"]) { addEventListener(event, () => { document.documentElement.toggleAttribute("data-print", event === "beforeprint"); redraw(); }); }
  addEventListener("hashchange", follow);
}
// Shows what the address asks for, as far as the page has it, else the first map of the program.
async function follow() {
  const asked = fromAddress();
  if (data.panels.length && !(device && state.x)) { showPanel(state.panel ?? 0); }
  setKind(state.kind);
  buildControls();
  notice(refused(asked));
  $("case").hidden = !state.at;
  await update();
}
async function start() {
  try { await openDevice(); } catch { device = null; }
  listen();
  if (!device) { complain("This browser has no WebGPU, with which the page computes maps: it shows those that the program computed. For others open the page in a current Chrome, Edge, Firefox or Safari, or run lanesweep map."); }
  await follow();
  if (!device || !settingOf()) { return; }
  const differing = await differingDrivers(settingOf());
  document.body.dataset.known = differing.join(",") || "equal";
  complain(differing.length ? `This device computes other bits than the program for ${differing.join(", ")} in 256 known runs: a verdict near a threshold may differ from the program's.`
    : "Checked: 256 known runs end on this device as in the program, bit for bit but for the value of the BTN: no sign that maps computed here differ from the program's.");
}
start();
