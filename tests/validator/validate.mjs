// Checks GLB files with the Khronos glTF validator:  node validate.mjs FILE…
// One line per file with the number of errors, warnings, infos and hints. Exit code 0 only if no file has an error, a warning,
// or an info or hint other than the two that an extension of limber's own brings with it.
import { readFile } from 'node:fs/promises';
import validator from 'gltf-validator';

// The extension is not registered with Khronos, and what only it refers to looks unused.
const ALLOWED = new Set(['UNSUPPORTED_EXTENSION', 'UNUSED_OBJECT']);
const SEVERITIES = ['error', 'warning', 'info', 'hint'];
const SHOWN = 20;

const files = process.argv.slice(2);
if (files.length === 0) {
  console.error('usage: node validate.mjs FILE…');
  process.exit(2);
}

let failed = false;
for (const file of files) {
  const { issues } = await validator.validateBytes(new Uint8Array(await readFile(file)), { uri: file, maxIssues: 0 });
  const counts = `${issues.numErrors} errors, ${issues.numWarnings} warnings, ${issues.numInfos} infos, ${issues.numHints} hints`;
  const wrong = issues.messages.filter((issue) => !ALLOWED.has(issue.code));
  console.log(`${file}: ${counts}`);
  for (const issue of wrong.slice(0, SHOWN))
    console.log(`  ${SEVERITIES[issue.severity]} ${issue.code} at ${issue.pointer ?? `byte ${issue.offset}`}: ${issue.message}`);
  if (wrong.length > SHOWN) console.log(`  and ${wrong.length - SHOWN} more`);
  failed ||= wrong.length > 0;
}
process.exit(failed ? 1 : 0);
