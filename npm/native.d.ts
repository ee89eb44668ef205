// limber's manual. Classes and functions are those of limber's C interface, whose comments they carry: limber_world_add_body() is
// World's addBody(), limber_shape_create_box() is Shape.createBox().
//
// Units are m, kg, s, N, rad; z is up where gravity is not set otherwise. Structs are objects, of whose members any may be left out;
// { x, y, z } may be [x, y, z], and vectors and quaternions of three.js are taken as they are. What C writes is returned; null where
// a query finds nothing. Failures throw a LimberError. Arrays of results that lie in the library's memory are views of it, without a
// copy: they last until their object is disposed of, or memory grows, which any call that makes something may do.
//
// load() needs limber.wasm beside this module: bundlers that know `new URL(…, import.meta.url)` put it there, others give its URL,
// import wasm from 'limber/limber.wasm'. Files, threads and callbacks (vetoes, filters of queries) are left out.

/** What limber throws; the message is the library's line. */
export declare class LimberError extends Error {
  readonly result: Result;
}

/** Loads the WebAssembly, once, before anything else is called. `source` of limber.wasm, where it does not lie beside this module. */
export declare function load(source?: WasmSource | Promise<WasmSource>): Promise<void>;
export type WasmSource = ArrayBuffer | Uint8Array | Response | URL | string | WebAssembly.Module;
export declare function isLoaded(): boolean;

/** An object of the library: destroyed by dispose(), or some time after the last reference to it is gone. */
export declare abstract class Native {
  /** Its address. Throws once it has been disposed of. */
  readonly pointer: number;
  dispose(): void;
}

/** Numbers in the library's memory: what it fills is there without a copy. */
export declare class Memory<T extends Float32Array | Float64Array | Int32Array | Uint8Array = Float32Array | Float64Array | Int32Array | Uint8Array> extends Native {
  constructor(Type: { new (buffer: ArrayBuffer, at: number, length: number): T; readonly BYTES_PER_ELEMENT: number }, length: number);
  readonly length: number;
  /** The numbers, until memory grows: ask again after calls that may add to it. */
  readonly array: T;
}

/** Members by name, or all of them in order as an array; those left out have their defaults, or are 0. */
export type Given<T> = T extends number | bigint | boolean | string | Native | ArrayBufferView | null ? T
  : T extends (infer U)[] ? readonly Given<U>[]
  : { readonly [K in keyof T]?: Given<T[K]> } | readonly (number | readonly number[])[];
