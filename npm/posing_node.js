// limber/posing in Node: its WebAssembly is read from the package's folder.
import { readFile } from 'node:fs/promises';
import { load as loadFrom } from './posing.js';

export * from './posing.js';
export const load = (source = readFile(new URL('./posing.wasm', import.meta.url))) => loadFrom(source);
