// Posing: the parts of a model turn and slide in its joints, and soft ones deform, so that handles reach their targets with the least
// energy. Lengths are in the model's unit. Failures throw a LimberError.
import { LimberError, WasmSource } from './limber.js';
export { LimberError };

/** Loads the WebAssembly, once, before a model is opened. `source` of posing.wasm, where it does not lie beside this module. */
export declare function load(source?: WasmSource | Promise<WasmSource>): Promise<unknown>;

export type Point = readonly [number, number, number];
/** As the joints file has them. */
export interface JointType { type: string; limits?: object }
export interface PoseResult {
  /** Call solve() again while it is 'going on'. */
  status: 'converged' | 'local minimum' | 'going on' | 'stalled' | 'infeasible';
  iterations: number;
  energy: number;
  jointError: number;
  limitViolation: number;
  /** How far handles are from their targets at most. */
  handleError: number;
}

/** A jointed model that is pulled at points. Each has a WebAssembly of its own, which goes with the last reference to it. */
export declare class Posing {
  /** The first part is pinned, all are rigid. `files`: texts or bytes by their names, of which `model` and `joints` are two. */
  static open(files: Readonly<Record<string, string | Uint8Array | ArrayBuffer>>, model: string, joints: string): Promise<Posing>;

  readonly scene: {
    name: string;
    vertices: number;
    parts: { name: string; triangles: number; soft: boolean; pinned: boolean }[];
    joints: { a: string; b: string; type: string; limits: object }[];
  };
  /** Vertices of each, part by part. */
  readonly triangles: Uint32Array;
  /** x, y, z of each vertex where it is now. */
  positions(): Float32Array;
  /** Of each joint where it stands: origin, axis, three coordinates. */
  jointFrames(): Float64Array;
  handles(): { point: Point; target: Point }[];

  /** The first place that a ray meets. */
  cast(from: Point, along: Point): { part: number; point: Point; distance: number } | null;
  /** Makes a handle at the place that the last cast() met, and holds it. */
  grab(): void;
  /** Holds a handle of handles(). */
  take(handle: number): void;
  /** The target of the handle that is held. */
  dragTo(target: Point): void;
  letGo(): void;
  removeHandles(): void;

  /** A name that no other part has, and jointsText() tells. */
  setName(part: number, name: string): void;
  setPinned(part: number, pinned: boolean): void;
  setSoft(part: number, soft: boolean): void;
  setJoint(joint: number, told: JointType): void;
  /** Cuts the part that the last cast() met in two, on a ball. @param from, to directions from the eye to the ends of a line across it */
  cut(eye: Point, from: Point, to: Point): void;
  /** False where there is nothing to take back. */
  undo(): boolean;
  reset(): void;
  /** Up to 30 iterations towards the pose. */
  solve(): PoseResult;
  /** The pose as a model of its own (OBJ), and its joints file. */
  modelText(): string;
  jointsText(): string;
}
