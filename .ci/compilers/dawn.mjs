// Chrome's WGSL compiler on every kernel of a folder of `pipelines`, with its constants: any message, also
// a warning, is an error.
import { readFileSync, readdirSync } from 'node:fs';
import { create } from 'webgpu';

const folder = process.argv[2];
// Kept until the end: the device does not keep it.
const gpu = create(['backend=null']);
const adapter = await gpu.requestAdapter();
const device = await adapter.requestDevice();
let compiled = 0;
let messages = 0;
const complain = (text) => {
  messages += 1;
  console.log(text);
};
for (const file of readdirSync(folder).filter((name) => name.endsWith('.wgsl')).sort()) {
  const code = readFileSync(`${folder}/${file}`, 'utf8');
  const constants = JSON.parse(readFileSync(`${folder}/${file.replace(/wgsl$/, 'constants.json')}`, 'utf8'));
  device.pushErrorScope('validation');
  const module = device.createShaderModule({ code });
  const info = await module.getCompilationInfo();
  for (const { lineNum, linePos, type, message } of info.messages) {
    complain(`${file}:${lineNum}:${linePos}: ${type}: ${message}`);
  }
  device.createComputePipeline({ layout: 'auto', compute: { module, constants } });
  const error = await device.popErrorScope();
  if (error && info.messages.length === 0) complain(`${file}: ${error.message}`);
  compiled += 1;
}
console.log(`${compiled} kernels compiled by Chrome's WGSL compiler, ${messages} messages`);
device.destroy();
process.exit(messages === 0 && compiled > 0 ? 0 : 1);
