// One case: the drivers' answers in words, its command, and its course over time.
const seconds = (value) => `${value.toFixed(2)} s`;
const kmh = (speed) => speed * parameterOf("ego_speed_kmh").perSi;
function sentence(name, { bits, contact, reaction, end, impact, closing, ttc, btn }, thresholds) {
  const reacts = reaction === null ? "does not react" : `reacts at ${seconds(reaction)}`;
  const collides = () => `and collides (${["", "side", "rear-end"][contact]} contact) at ${seconds(end)}, driving ${kmh(impact).toFixed(1)} km/h, closing in at ${kmh(closing).toFixed(1)} km/h`;
  const ends = bits & 1 ? collides() : bits & 8 ? "and has not collided when the run ends" : "and does not collide";
  const near = Number.isFinite(ttc) ? `smallest TTC ${seconds(ttc)}${bits & 2 ? ` (fails: below ${thresholds.ttc} s)` : ""}` : "no TTC";
  const fails = bits & 4 ? ` (fails: ${bits & 1 && !(btn > thresholds.btn) ? "a contact" : `above ${thresholds.btn}`})` : "";
  const braking = btn > 1 && !(bits & 1) ? "; a BTN above 1 does not contradict an avoided collision" : "";
  return `${name} ${reacts} ${ends}; ${near}, largest BTN ${Number.isFinite(btn) ? btn.toFixed(2) : "infinite"}${fails}${braking}.`;
}
// The answer as `check` computes it, before it examines how robust it is: at exactly these values.
function answerOf({ references, settles }, unreacting, collides) {
  const avoiding = references.filter((name) => !collides(name));
  if (!references.length) { return "the profile has no reference drivers, which would say what is preventable."; }
  if (!(unreacting & 1)) { return unreacting & 8 && settles ? "undecided: the run ends before anything happens." : "no conflict: nothing collides even if the ego never reacts."; }
  return avoiding.length ? `preventable: ${avoiding.join(" and ")} ${avoiding.length > 1 ? "avoid" : "avoids"} the collision.` : `not preventable: ${references.join(" and ")} collide.`;
}
// The case of these values on the axes: the numbers of its point, and its start.
function caseAt(x, y) {
  const valueAt = (key) => valueOf(key, { [state.x.key]: x, [state.y.key]: y });
  const points = kindOf().parameters.filter(({ start }) => start === null).map(({ key, perSi }) => valueAt(key) / perSi);
  const { key, start, perSi } = parameterOf(startKey());
  return { points, starts: [[start, valueAt(key) / perSi]], valueAt };
}
function commandOf({ valueAt }) {
  const flags = given().map(({ key, flag, suffix, sign }) => `--${flag} ${decimal(sign * valueAt(key))}${suffix}`);
  return ["lanesweep check --category", kindOf().category, ...flags, ...data.sizes, `--profiles ${state.profile} --sheet case.html`].join(" ");
}
// The steps that a lane wrote. TTC and BTN are those of the vehicles that the criteria evaluate.
function readSteps(setting, bytes, lastStep) {
  const [values, words] = [new Float32Array(bytes), new Uint32Array(bytes)];
  return Array.from({ length: Math.min(lastStep + 1, values.length / TRACED_STEP) }, (_, at) => {
    const first = at * TRACED_STEP;
    const vehicles = [first + 3, first + 11].slice(0, setting.generator.recipe_pair + 1).map((of) => (
      { v: values[of], gap: values[of + 1], lateral: values[of + 2], ttc: values[of + 4], btn: btnOf(setting, values[of + 5], values[of + 6]), isJudged: words[of + 7] & 2 }));
    const judged = vehicles.filter(({ isJudged }) => isJudged);
    const worst = (better, key) => (judged.length ? better(...judged.map((of) => of[key])) : NaN);
    return { t: at * setting.dt, v: values[first], isUnsafe: words[first + 2] === 1, vehicles, gap: worst(Math.min, "gap"), ttc: worst(Math.min, "ttc"), btn: worst(Math.max, "btn") };
  });
}
// The last time at which a driver decides or is decided, as in the sheet of `check`.
function decisive({ steps, outcome: { bits, reaction, end } }, { ttc, btn }) {
  const changed = steps.findLast(({ v }) => Math.abs(kmh(v - steps.at(-1).v)) > 1)?.t ?? 0;
  // The first time near the worst value, if that is near its threshold.
  const first = (valueOf, limit, slack) => {
    const least = steps.map(valueOf).reduce((least, value) => (value < least ? value : least), Infinity);
    return Number.isFinite(least) && least <= limit ? steps.find((step) => valueOf(step) <= least + slack(least)).t : 0;
  };
  return Math.max(reaction ?? 0, bits & 1 ? end : 0, changed, first(({ gap }) => gap, Infinity, (least) => Math.max(0.01, least / 20)),
    first((step) => step.ttc, 10 * ttc, (least) => least / 20), first((step) => -step.btn, -btn / 10, (least) => -least / 20));
}
// Of the panels over time, the values of a driver, and of the other vehicles, which are the same for all.
const PANELS = [
  { title: "Gap from the ego (m)", of: ({ vehicles }) => vehicles.map(({ gap }) => gap), others: () => [], dashed: "; dashed: to the vehicle ahead" },
  { title: "Speed (km/h); grey: other vehicles", of: ({ v }) => [kmh(v)], others: ({ vehicles }) => vehicles.map(({ v }) => kmh(v)) },
  { title: "TTC (s)", of: ({ ttc }) => [ttc], others: () => [], most: 10, threshold: "ttc" },
  { title: "BTN", of: ({ btn }) => [btn], others: () => [], most: 2, threshold: "btn" },
];
const chosen = (traces) => traces.filter(({ name }) => state.drivers.includes(name));
function drawTraces(canvas) {
  const { setting, traces: all = [] } = canvas.shown ?? {};
  const traces = chosen(all);
  if (!traces.length) { brush(canvas, 0); return; }
  const [across, tall] = [canvas.parentElement.clientWidth > 640 ? 2 : 1, 210];
  const { paint, width } = brush(canvas, (PANELS.length / across) * tall);
  const longest = traces.reduce((most, trace) => (trace.steps.length > most.steps.length ? trace : most));
  const until = Math.min(Math.max(...traces.map((trace) => decisive(trace, setting.thresholds))) + 2, longest.steps.at(-1).t) || 1;
  const isPair = longest.steps[0].vehicles.length > 1;
  PANELS.forEach(({ title, of, others, most, threshold, dashed }, at) => {
    const box = { x: (at % across) * (width / across) + 44, y: Math.floor(at / across) * tall + 22, w: width / across - 56, h: tall - 60 };
    const series = (steps, valuesOf) => valuesOf(steps[0]).map((_, which) => steps.filter(({ t }) => t <= until).map((step) => [step.t, valuesOf(step)[which]]));
    const lines = [
      ...(threshold ? [[data.boundary, [5, 3], [0, until].map((t) => [t, setting.thresholds[threshold]])]] : []),
      ...series(longest.steps, others).map((points, which) => [shade("--soft"), which ? [5, 3] : [], points]),
      ...traces.flatMap(({ colour, steps }) => series(steps, of).map((points, which) => [colour, which ? [5, 3] : [], points])),
    ];
    // Gaps to a vehicle that has driven away do not count.
    const counting = ({ vehicles }) => vehicles.filter(({ isJudged }) => isJudged).map(({ gap }) => gap);
    const finite = (dashed && isPair ? traces.flatMap(({ steps }) => steps.flatMap(counting)) : lines.flatMap(([, , points]) => points.map(([, value]) => value))).filter(Number.isFinite);
    const high = finite.reduce((top, value) => Math.max(top, value), 1);
    const [low, top] = [most ? 0 : finite.reduce((least, value) => Math.min(least, value), 0), most ? Math.min(high, most) : high];
    const [atX, atY] = [(t) => box.x + (t / until) * box.w, (value) => box.y + box.h - ((value - low) / (top - low)) * box.h];
    const draw = (points) => (path) => points.forEach(([t, value], of) => {
      if (Number.isFinite(value)) { path[Number.isFinite(points[of - 1]?.[1]) ? "lineTo" : "moveTo"](atX(t), atY(value)); }
    });
    clipped(paint, (path) => path.rect(box.x, box.y, box.w, box.h), () => lines.forEach(([colour, dash, points]) => line(paint, colour, 1.8, dash, draw(points))));
    frame(paint, box, [0, until], [low, top], atX, atY);
    Object.assign(paint, { textAlign: "left", textBaseline: "bottom" });
    paint.fillText(title + (isPair && dashed ? dashed : "") + (at + across >= PANELS.length ? ", over time (s)" : ""), box.x, box.y - 5, box.w);
  });
}
