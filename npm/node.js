// limber in Node: its WebAssembly is read from the package's folder.
import { readFile } from 'node:fs/promises';
import { load as loadFrom } from './limber.js';

export * from './limber.js';
export const load = (source = readFile(new URL('./limber.wasm', import.meta.url))) => loadFrom(source);
