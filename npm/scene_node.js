// limber/scene in Node: its WebAssembly is read from the package's folder.
import { readFile } from 'node:fs/promises';
import { load as loadFrom } from './scene.js';

export * from './scene.js';
export const load = (source = readFile(new URL('./scene.wasm', import.meta.url))) => loadFrom(source);
