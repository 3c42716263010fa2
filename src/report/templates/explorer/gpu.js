// The device: the program's own shaders and constants, as WebGPU pipelines.
const [WORKGROUP, RECORD, TRACED_STEP, INPUT] = [64, 14, 19, "read-only-storage"];
let [device, adapterName, pipelines] = [null, "", new Map()];
async function openDevice() {
  const adapter = await navigator.gpu?.requestAdapter({ powerPreference: "high-performance" });
  device = (await adapter?.requestDevice()) ?? null;
  adapterName = ["vendor", "architecture", "description"].map((key) => adapter?.info?.[key]).filter(Boolean).join(" ");
  device?.addEventListener("uncapturederror", (event) => complain(event.error.message));
  device?.lost.then(({ message }) => { device = null; complain(`The device was lost: ${message}`); });
}
// A pipeline of a source, compiled once for its constants; `types` are those of its bindings.
function pipeline(code, entryPoint, types, constants) {
  const key = code.length + entryPoint + JSON.stringify(constants);
  if (!pipelines.has(key)) {
    const entries = types.map((type, binding) => ({ binding, visibility: GPUShaderStage.COMPUTE, buffer: { type } }));
    const group = device.createBindGroupLayout({ entries });
    const [layout, module] = [device.createPipelineLayout({ bindGroupLayouts: [group] }), device.createShaderModule({ code })];
    pipelines.set(key, device.createComputePipelineAsync({ layout, compute: { module, entryPoint, constants } }).then((made) => ({ made, group })));
  }
  return pipelines.get(key);
}
// After the drivers comes the ego that never reacts, which has the source of the first.
function lanePipeline(setting, at, part) {
  const constants = { ...setting.shared, ...setting.drivers[at], ...(part === "trace" ? data.traced : {}) };
  const types = ["uniform", INPUT, INPUT, INPUT, INPUT, ...Array(part === "trace" ? 2 : 3).fill("storage")];
  return pipeline(data.source.shared + data.source[part] + (data.drivers[at] ?? data.drivers[0]).source, part, types, constants);
}
// One computation with its buffers, each of contents or of a number of bytes.
class Computation {
  buffers = [];
  encoder = device.createCommandEncoder();
  buffer(contents, usage = GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC | GPUBufferUsage.COPY_DST) {
    const made = device.createBuffer({ size: Math.max(contents.byteLength ?? contents, 16), usage });
    if (contents.byteLength) { device.queue.writeBuffer(made, 0, contents); }
    this.buffers.push(made);
    return made;
  }
  uniform = (...words) => this.buffer(new Uint32Array(words), GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST);
  dispatch({ made, group }, buffers, invocations) {
    const pass = this.encoder.beginComputePass();
    pass.setPipeline(made);
    pass.setBindGroup(0, device.createBindGroup({ layout: group, entries: buffers.map((buffer, binding) => ({ binding, resource: { buffer } })) }));
    pass.dispatchWorkgroups(Math.ceil(invocations / WORKGROUP));
    pass.end();
  }
  async read(buffers) {
    const copies = buffers.map(({ size }) => this.buffer(size, GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST));
    buffers.forEach((buffer, at) => this.encoder.copyBufferToBuffer(buffer, 0, copies[at], 0, buffer.size));
    device.queue.submit([this.encoder.finish()]);
    await Promise.all(copies.map((copy) => copy.mapAsync(GPUMapMode.READ)));
    const bytes = copies.map((copy) => copy.getMappedRange().slice(0));
    this.buffers.forEach((buffer) => buffer.destroy());
    return bytes;
  }
  // Cases of points, which have as many numbers as the kind, and the starts of every case's lanes.
  async cases(setting, points, starts) {
    const count = points.length / setting.generator.recipe_dimensions;
    const numbers = new Float32Array([...points, ...Array(setting.generator.recipe_dimensions).fill(0)]);
    const [cases, samples] = [this.buffer(count * data.caseWords * 4), this.buffer(count * 8)];
    const bound = [this.uniform(0, 0, count, 0, 0, 0, count, 0, points.length, 0, 0, 0), this.buffer(new Uint32Array(setting.recipe)), this.buffer(numbers), this.buffer(16), cases, this.buffer(16), samples];
    const types = ["uniform", INPUT, INPUT, INPUT, "storage", "storage", "storage"];
    for (const entry of ["generate", "mark_traffic"]) { this.dispatch(await pipeline(data.source.generator, entry, types, setting.generator), bound, count); }
    const words = new Uint32Array(starts.flatMap(([kind, value]) => [kind, ...new Uint32Array(Float32Array.of(value).buffer)]));
    return { samples, lanes: count * starts.length, inputs: [cases, this.buffer(words), this.buffer(16), this.buffer(16)] };
  }
  launch = ({ shared }, lanes, headways, driver = 0, firstWord = 0) => this.uniform(lanes, headways, 0, 1, 0, 0, firstWord, 0, driver, WORKGROUP, shared.frame_longest_burst >> 1, 0);
}
// Verdict bits of every lane for each driver and the ego that never reacts, and whether it is no such traffic (1) or case (2).
async function computeVerdicts(setting, points, starts) {
  const compiled = await Promise.all(setting.drivers.map((_, at) => lanePipeline(setting, at, "lanes")));
  const all = new Computation();
  const { samples, lanes, inputs } = await all.cases(setting, points, starts);
  const words = Math.ceil(lanes / 8);
  const results = [all.buffer(compiled.length * words * 4), all.buffer(RECORD * 4), all.buffer(compiled.length * 4)];
  compiled.forEach((of, at) => all.dispatch(of, [all.launch(setting, lanes, starts.length, at, at * words), ...inputs, ...results], lanes));
  const [bits, done, drawn] = (await all.read([results[0], results[2], samples])).map((bytes) => new Uint32Array(bytes));
  if (compiled.some((_, at) => done[at] !== lanes)) { throw new Error("the device did not finish every lane"); }
  const bitsOf = (at, lane) => (bits[at * words + (lane >> 3)] >> ((lane & 7) * 4)) & 15;
  const impossible = (lane) => { const at = 2 * Math.floor(lane / starts.length); return drawn[at] > 64 ? 2 : drawn[at + 1]; };
  return { bitsOf, impossible };
}
// Lanes of one driver to their ends, with the first steps of the first one.
async function computeOutcomes(setting, at, points, starts, steps) {
  const compiled = await lanePipeline(setting, at, "trace");
  const all = new Computation();
  const { lanes, inputs } = await all.cases(setting, points, starts);
  const results = [all.buffer(Math.max(steps, 1) * TRACED_STEP * 4), all.buffer(lanes * RECORD * 4)];
  all.dispatch(compiled, [all.launch(setting, lanes, starts.length), ...inputs, ...results], lanes);
  return all.read(results);
}
async function runCase(setting, at, { points, starts }, steps) {
  const [traced, outcomes] = await computeOutcomes(setting, at, points, starts, steps);
  const outcome = readOutcome(setting, outcomes);
  return { ...data.drivers[at], outcome, steps: readSteps(setting, traced, outcome.lastStep) };
}
// The value of a BTN's quotient.
const btnOf = ({ btn }, numerator, denominator) => btn.scale * (denominator === 0 ? Infinity : (numerator / denominator) ** (btn.isRoot ? 0.5 : 1));
function readOutcome(setting, bytes) {
  const [words, values] = [new Uint32Array(bytes), new Float32Array(bytes)];
  const time = (step) => (step === 0xffffffff ? null : step * setting.dt);
  const whole = { bits: words[0] & 15, contact: (words[0] >> 4) & 3, reaction: time(words[1]), end: time(words[2]), lastStep: words[2] };
  return { ...whole, impact: values[3], closing: values[4], ttc: values[5], btn: btnOf(setting, values[6], values[7]) };
}
// The drivers whose lanes have other words than the program computed, but for the quotient of the BTN.
async function differingDrivers(setting) {
  const { points, starts, hashes } = setting.known;
  const isEqual = await Promise.all(data.drivers.map(async (_, at) => {
    const [, outcomes] = await computeOutcomes(setting, at, points, starts, 0);
    const words = new Uint32Array(outcomes).filter((_, word) => word % RECORD !== 6 && word % RECORD !== 7);
    return hashes[at] === words.reduce((hash, word) => Math.imul(hash ^ word, data.hash.prime) >>> 0, data.hash.basis);
  }));
  return data.drivers.filter((_, at) => !isEqual[at]).map(({ name }) => name);
}
