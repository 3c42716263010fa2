// The explorer of a map's page in a browser whose WebGPU runs on the processor: cells and traces against the program, every
// control by keyboard, and the page without WebGPU. Arguments: the program, the browser, the pages.
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
    await tab.evaluate((to) => { delete document.body.dataset.drawn; delete document.body.dataset.traced; location.hash = to; }, hash);
    await tab.waitForFunction(() => document.body.dataset.drawn, { timeout: 300_000 });
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
    const args = shown.command.split(' ').slice(1);
    const answer = JSON.parse(run([...args, '--format', 'json', '--accept-implausible']));
    const theirs = answer.profiles[0].models.map((of) => of.collision + 2 * of.ttc + 4 * of.btn);
    check(String(theirs) === String(shown.bits.map((bits) => bits & 7)), `cell = check (${theirs}): ${shown.command}`);
    check(String(theirs) === String(shown.outcomes.map((bits) => bits & 7)), 'trace = check');
    const nominal = answer.profiles[0].nominal_answer;
    check(nominal === null || shown.answer.toLowerCase().startsWith(nominal), `${shown.answer} = ${nominal}`);
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
  if (at === 0) {
    await againstProgram(tab, state.data);
    await byKeyboard(tab);
  }
  await browser.close();
  const without = await open(['--disable-gpu'], page);
  const seen = await without.tab.evaluate(() => document.getElementById('ex-status').textContent + document.getElementById('ex-key').textContent);
  check(seen.includes('no WebGPU') && seen.includes('fails in'), 'without WebGPU the page shows the program\'s map');
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
