// The explorer of a map's page in a browser whose WebGPU runs on the processor: cells and traces against the program, what
// the page says of them, every control by keyboard, and the page without WebGPU. Arguments: the program, the browser, the pages.
import { execFileSync } from 'node:child_process';
import { readFileSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import puppeteer from 'puppeteer-core';

const [program, executablePath, ...pages] = process.argv.slice(2);
const SETTINGS = 20;
const MAX_BYTES = 500_000;
const software = ['--enable-unsafe-webgpu', '--enable-unsafe-swiftshader', '--use-webgpu-adapter=swiftshader'];
let failures = 0;
const check = (holds, text) => {
  if (!holds) failures += 1;
  console.log(`${holds ? 'ok' : 'FAILED'}: ${text}`);
};

// What the program prints; `check` has an exit status per answer.
function run(args) {
  try {
    return execFileSync(program, args, { encoding: 'utf8', maxBuffer: 1 << 28, stdio: ['ignore', 'pipe', 'ignore'] });
  } catch (error) {
    if (!error.stdout) throw error;
    return error.stdout;
  }
}

async function open(flags, page, hash = '') {
  const browser = await puppeteer.launch({ executablePath, args: ['--headless=new', '--no-sandbox', ...flags] });
  const tab = await browser.newPage();
  tab.on('pageerror', (error) => check(false, `the page complains: ${error.message}`));
  await tab.setViewport({ width: 1280, height: 1000 });
  await tab.goto(`file://${resolve(page)}${hash}`);
  await tab.waitForFunction(() => document.body.dataset.drawn, { timeout: 300_000 });
  return { browser, tab };
}

async function go(tab, hash) {
  await tab.evaluate((to) => { delete document.body.dataset.drawn; delete document.body.dataset.traced; location.hash = to; }, hash);
  await tab.waitForFunction(() => document.body.dataset.drawn, { timeout: 300_000 });
}

// Random numbers, the same in every run (mulberry32).
let seed = 157;
function draw() {
  seed = (seed + 0x6d2b79f5) | 0;
  let mixed = Math.imul(seed ^ (seed >>> 15), seed | 1);
  mixed ^= mixed + Math.imul(mixed ^ (mixed >>> 7), mixed | 61);
  return ((mixed ^ (mixed >>> 14)) >>> 0) / 2 ** 32;
}
const among = (all) => all[Math.floor(draw() * all.length)];

// A setting with random values, and axes of a few cells around random values.
function randomSetting(data) {
  const { profile, kind: key } = among(data.settings);
  const kind = data.kinds.find((of) => of.key === key);
  const start = among(['gap_m', 'thw_s']);
  const sliders = kind.parameters.map((name) => data.sliders.find((of) => of.key === name));
  const usable = sliders.filter((of) => of.start === undefined || of.key === start);
  const value = {};
  // To two decimals; a vehicle that brakes ends slower than it began.
  for (const { key: of, from, to } of usable) value[of] = Math.round(100 * (from + draw() * (to - from))) / 100;
  if ('end_speed_kmh' in value) value.end_speed_kmh = Math.round(30 * value.other_speed_kmh) / 100;
  const x = among(usable);
  const y = among(usable.filter((of) => of !== x));
  const axis = ({ key: of, from, to }) => [of, Math.max(from, value[of] * 0.8), Math.min(to, value[of] * 1.2 + 0.5), 6].join('_to_');
  const fields = { kind: key, profile, criterion: among(data.criteria).key, drivers: data.drivers.map((of) => of.name).join(','), start, ...value };
  return `#${new URLSearchParams({ ...fields, x: axis(x), y: axis(y) })}`;
}

async function againstProgram(tab, data) {
  let compared = 0;
  for (let setting = 0; setting < SETTINGS; setting += 1) {
    const hash = randomSetting(data);
    await go(tab, hash);
    await tab.focus('#ex-map');
    await tab.keyboard.press('ArrowRight');
    for (let step = 0; step < setting % 3; step += 1) await tab.keyboard.press(among(['ArrowUp', 'ArrowDown', 'ArrowLeft']));
    await tab.keyboard.press('Enter');
    await tab.waitForFunction(() => document.body.dataset.traced, { timeout: 300_000 });
    const shown = await tab.evaluate(() => {
      const { map, cursor } = document.getElementById('ex-map').shown;
      const { setting: of, traces } = document.getElementById('ex-trace').shown;
      return {
        command: document.getElementById('ex-command').textContent,
        answer: document.getElementById('ex-answer').textContent,
        bits: map.names.map((_, at) => map.bits(at, cursor.cell)),
        isCase: map.isCase(cursor.cell),
        outcomes: traces.map((trace) => trace.outcome.bits),
        dt: of.dt,
        // Infinity is lost on its way.
        steps: JSON.stringify(traces.map((trace) => trace.steps), (_, value) => (value === Infinity ? 'inf' : value)),
      };
    });
    if (!shown.isCase) { console.log(`no such case: ${shown.command}`); continue; }
    compared += 1;
    const args = shown.command.replace(' --sheet case.html', '').split(' ').slice(1);
    const answer = JSON.parse(run([...args, '--format', 'json', '--accept-implausible']));
    const theirs = answer.profiles[0].models.map((of) => of.collision + 2 * of.ttc + 4 * of.btn);
    check(String(theirs) === String(shown.bits.map((bits) => bits & 7)), `cell = check (${theirs}): ${shown.command}`);
    check(String(theirs) === String(shown.outcomes.map((bits) => bits & 7)), 'trace = check');
    const nominal = answer.profiles[0].nominal_answer;
    check(nominal === null || shown.answer.includes(`At exactly these values: ${nominal}`), `${shown.answer} = ${nominal}`);
    if (setting % 4 === 0) againstSimulate(args, shown, data.drivers.map((of) => of.name));
  }
  check(compared >= SETTINGS / 2, `${compared} of ${SETTINGS} settings were cases`);
}

// Every step of every driver until one reacts a step earlier than the other: the page has binary32, `simulate` binary64.
function againstSimulate(args, shown, names) {
  const lanes = JSON.parse(shown.steps, (_, value) => (value === 'inf' ? Infinity : value));
  const flags = args.slice(1).map((flag) => (flag === '--profiles' ? '--profile' : flag));
  names.forEach((name, at) => {
    const [head, ...rows] = run(['simulate', ...flags, '--models', name, '--accept-implausible']).trim().split('\n').map((row) => row.split(','));
    const column = (key) => head.indexOf(key);
    // The difference over what is allowed. Quotients of small differences of speed are less exact than speeds and gaps.
    let worst = 0;
    const near = (ours, text, allowed) => {
      const theirs = text === 'inf' ? Infinity : Number(text);
      const isLarge = ours > 1e3 && theirs > 1e3;
      if (ours !== theirs && !isLarge) worst = Math.max(worst, Math.abs(ours - theirs) / Math.max(1, Math.abs(theirs)) / allowed);
      if (Number.isNaN(ours)) worst = Infinity;
    };
    const steps = lanes[at];
    const apart = rows.findIndex((row, step) => step < steps.length && row[column('unsafe')] !== String(Number(steps[step].isUnsafe)));
    const compared = apart < 0 ? Math.min(rows.length, steps.length) : apart;
    rows.slice(0, compared).forEach((row, step) => {
      near(steps[step].v, row[column('v_ego_mps')], 1e-3);
      ['other', 'ahead'].slice(0, steps[step].vehicles.length).forEach((vehicle, which) => {
        const ours = steps[step].vehicles[which];
        near(ours.v, row[column(`${vehicle}_v_mps`)], 1e-3);
        near(ours.gap, row[column(`${vehicle}_gap_m`)], 5e-3);
        if (Math.abs(steps[step].v - ours.v) > 0.5) {
          near(ours.ttc, row[column(`${vehicle}_ttc_s`)], 1e-2);
          if (ours.gap > 1 && ours.btn < 2) near(ours.btn, row[column(`${vehicle}_btn`)], 1e-2);
        }
      });
    });
    const isWhole = apart >= 0 || Math.abs(rows.length - steps.length) <= 1;
    check(isWhole && compared > 1 && worst < 1, `trace = simulate: ${name}, ${compared} of ${rows.length} rows, ${(100 * worst).toFixed(0)} % of the allowed difference`);
  });
}

// What a reader sees: texts by their ids, the chosen cell, and whether the page computes.
const seen = (tab) => tab.evaluate(() => {
  const text = (id) => document.getElementById(`ex-${id}`).textContent;
  const { map, cursor } = document.getElementById('ex-map').shown;
  const [lead, notice] = [document.querySelector('header p').textContent, document.getElementById('ex-notice')];
  const { top, bottom } = document.getElementById('ex-words').getBoundingClientRect();
  const ends = ['x-from', 'x-to', 'x-cells', 'y-from', 'y-to', 'y-cells'].map((id) => Number(document.getElementById(`ex-${id}`).value));
  return { lead, notice: notice.hidden ? '' : notice.textContent, cases: text('cases'), key: text('key'), cell: text('cell'), answer: text('answer'), ends,
    chosen: cursor && [map.xs[cursor.i], map.ys[cursor.j]], isInView: top > 0 && bottom <= innerHeight, hash: location.hash };
});

// A precomputed map with other cases than those of the sliders.
async function ofOtherCases(tab) {
  const before = await seen(tab);
  check(before.ends[3] === 0 && before.ends[4] === 1.7, `the axis shows its values: ${before.ends}`);
  check(/run-up/.test(before.cases) && /outcomes only/.test(before.cell), `it says what its cases are: ${before.cases}`);
  const busy = await tab.evaluate(() => {
    delete document.body.dataset.drawn;
    const range = document.getElementById('ex-value-ego_speed_kmh');
    range.value = 25;
    range.dispatchEvent(new Event('input'));
    const canvas = document.getElementById('ex-map');
    const { x, y, width, height } = canvas.getBoundingClientRect();
    canvas.dispatchEvent(new PointerEvent('pointermove', { clientX: x + width / 2, clientY: y + height / 2 }));
    return [document.getElementById('ex-time').textContent, document.getElementById('ex-picture').ariaBusy, String(canvas.shown.cursor)];
  });
  check(String(busy) === 'computing …,true,null', `while it computes: ${busy}`);
  await tab.waitForFunction(() => document.body.dataset.drawn && document.getElementById('ex-picture').ariaBusy === 'false', { timeout: 300_000 });
  const after = await seen(tab);
  check(/^Plain.*run-up/.test(after.cases) && after.lead.includes('ego 25 km/h'), `it says that its cases are others: ${after.cases}`);
  await tab.evaluate(() => document.querySelector('input[value=ttc]').click());
  check(/fail TTC under jrc-2021/.test((await seen(tab)).lead), 'the first sentence follows the criterion');
}

// Links: what the page has not, the chosen case, and where the ticks of the map stand.
async function byLink(tab) {
  const broken = '#kind=cut-in&profile=nope&ego_speed_kmh=abc&other_speed_kmh=30&x=gap_m_to_10_to_20_to_6&y=lateral_speed_mps_to_1_to_1.4_to_5&at=14,1.2';
  await go(tab, broken);
  const { notice, hash, chosen, cell, ends } = await seen(tab);
  check(/profile nope, ego_speed_kmh abc.*jrc-2021/.test(notice) && hash === broken, `a broken link: ${notice}`);
  check(String(chosen) === '14,1.2' && /14 m.*1.2 m/.test(cell) && String(ends) === '10,20,6,1,1.4,5', `the chosen cell of a link: ${chosen}`);
  const ticks = await tab.evaluate(() => {
    const canvas = document.getElementById('ex-map');
    const [wide, ratio] = [canvas.parentElement.clientWidth - 66, devicePixelRatio];
    const row = canvas.getContext('2d').getImageData(0, Math.round((canvas.height / ratio - 48) * ratio), canvas.width, 1).data;
    // In cells; a tick begins where a pixel is dark.
    return [...Array(canvas.width).keys()].filter((x) => row[4 * x + 3] > 100 && !(row[4 * x - 1] > 100)).map((x) => (6 * (x / ratio - 56)) / wide);
  });
  const wanted = ticks.map((_, at) => 0.5 + (5 * at) / (ticks.length - 1));
  check(ticks.length > 5 && ticks.every((tick, at) => Math.abs(tick - wanted[at]) < 0.03), `ticks stand in the middle of their cells: ${ticks.map((tick) => tick.toFixed(2))}`);
  await go(tab, '#foo');
  check(/foo/.test((await seen(tab)).notice), 'a link to nothing');
  await tab.evaluate(() => { scrollTo(0, 0); delete document.body.dataset.traced; });
  await tab.focus('#ex-map');
  await tab.keyboard.press('ArrowUp');
  await tab.keyboard.press('Enter');
  await tab.waitForFunction(() => document.body.dataset.traced, { timeout: 300_000 });
  check((await seen(tab)).isInView, 'Enter brings the case into view');
}

// A cell of a cut-out in which vehicles drive through one another.
async function throughOneAnother(tab) {
  const { ends, key } = await seen(tab);
  await go(tab, `${(await seen(tab)).hash || '#kind=cut-out&thw_s=2&start=thw_s&x=ahead_gap_m_to_2_to_60_to_30&y=lateral_speed_mps_to_0.1_to_1.8_to_18&ego_speed_kmh=10'}&at=${ends[0]},${ends[3]}`);
  const { answer } = await seen(tab);
  check(/drives through the one ahead/.test(key) && /^No such traffic: .*drives through the one ahead/.test(answer), `traffic that there is not: ${answer}`);
}

async function byKeyboard(tab) {
  const wanted = await tab.evaluate(() => {
    const controls = [...document.querySelectorAll('#explorer :is(input, select, button, canvas[tabindex])')];
    const name = (of) => of.id || of.ariaLabel || `${of.name}${of.type === 'radio' ? '' : of.value}` || of.textContent || of.parentElement.textContent;
    globalThis.nameOf = name;
    const isShown = (of) => !of.matches(':disabled') && of.offsetParent !== null;
    return [...new Set(controls.filter(isShown).map(name))];
  });
  const reached = new Set();
  await tab.evaluate(() => { document.activeElement.blur(); scrollTo(0, 0); });
  for (let step = 0; step < wanted.length * 3 + 20; step += 1) {
    await tab.keyboard.press('Tab');
    reached.add(await tab.evaluate(() => globalThis.nameOf(document.activeElement)));
  }
  const missed = wanted.filter((name) => !reached.has(name));
  check(wanted.length > 15 && missed.length === 0, `${wanted.length} controls by keyboard${missed.length ? `, not ${missed}` : ''}`);
}

for (const [at, page] of pages.entries()) {
  const bytes = statSync(page).size;
  check(bytes < MAX_BYTES, `${page}: ${bytes} bytes`);
  const { browser, tab } = await open(software, page);
  await tab.waitForFunction(() => document.body.dataset.known, { timeout: 300_000 });
  const state = await tab.evaluate(() => ({ ...document.body.dataset, data: JSON.parse(document.getElementById('explorer-data').textContent) }));
  check(state.known === 'equal', `known lanes: ${state.known}`);
  check(!/differ/.test(state.agreement), `the program's map: ${state.agreement}`);
  console.log(`first picture: ${state.drawn} ms`);
  const braking = await open(software, page, `#kind=${state.data.category}-braking`);
  await braking.tab.waitForFunction(() => document.body.dataset.known, { timeout: 300_000 });
  check(await braking.tab.evaluate(() => document.body.dataset.known) === 'equal', 'known lanes of vehicles that brake');
  await braking.browser.close();
  if (at === 0) {
    await ofOtherCases(tab);
    await byLink(tab);
    await againstProgram(tab, state.data);
    await byKeyboard(tab);
  } else {
    await throughOneAnother(tab);
  }
  await browser.close();
  const without = await open(['--disable-gpu'], page, '#kind=lvd&panel=0');
  const shown = await without.tab.evaluate(() => document.getElementById('ex-status').textContent + document.getElementById('ex-key').textContent);
  check(shown.includes('no WebGPU') && shown.includes('fails in'), 'without WebGPU the page shows the program\'s map');
  check(/kind lvd; shown is/.test((await seen(without.tab)).notice), 'without WebGPU it says what a link asked for');
  await without.browser.close();
}
// A page whose time step is another one must say that its lanes differ.
const planted = join(tmpdir(), `lanesweep-planted-${process.pid}.html`);
writeFileSync(planted, readFileSync(pages[0], 'utf8').replace(/"frame_dt":[\d.]+/g, (text) => `"frame_dt":${1.01 * Number(text.slice(11))}`));
const { browser, tab } = await open(software, planted);
await tab.waitForFunction(() => document.body.dataset.known, { timeout: 300_000 });
const known = await tab.evaluate(() => document.body.dataset.known);
check(known !== 'equal', `planted: the lanes of ${known} differ`);
await browser.close();
rmSync(planted);
process.exit(failures === 0 ? 0 : 1);
