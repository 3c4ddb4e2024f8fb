// Judges each glTF with Khronos' validator. Prints its errors and warnings; exits 1 if any file has an error, 2 if
// there is nothing to judge.
import { readFile } from 'node:fs/promises';
import { dirname, resolve } from 'node:path';
import validator from 'gltf-validator';

const kSeverities = ['error', 'warning'];

const files = process.argv.slice(2);
if (files.length === 0) {
  console.error('usage: node validate.mjs FILE...');
  process.exit(2);
}

let failed = 0;
for (const file of files) {
  const { issues } = await validator.validateBytes(new Uint8Array(await readFile(file)), {
    uri: file,
    externalResourceFunction: async (uri) =>
      new Uint8Array(await readFile(resolve(dirname(file), decodeURIComponent(uri)))),
  });
  for (const { severity, code, pointer, message } of issues.messages) {
    if (severity < kSeverities.length) {
      console.log(`${file}: ${kSeverities[severity]}: ${pointer ?? ''} ${code}: ${message}`);
    }
  }
  console.log(`${file}: ${issues.numErrors} errors, ${issues.numWarnings} warnings`);
  failed += issues.numErrors > 0 ? 1 : 0;
}
process.exit(failed > 0 ? 1 : 0);
