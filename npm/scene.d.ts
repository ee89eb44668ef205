// Scenes: files that limber-simulate plays, in a World of limber that a script reaches into while they go on. load() of this entry
// is limber's too: scene.wasm has all of limber.wasm. Failures throw a LimberError.
import { BodyId, JointId, LimberError, Model, Native, Snapshot, WasmSource, World } from './limber.js';
export { LimberError };

/** Loads the WebAssembly, once, in the place of limber's load(). `source` of scene.wasm, where it does not lie beside this module. */
export declare function load(source?: WasmSource | Promise<WasmSource>): Promise<void>;

/** What may be other than the scene says. */
export interface SceneSettings {
  gravity: readonly number[];
  step: number;
  substeps: number;
  /** Of each model at most. */
  modes: number;
  /** A factor on the decay of every mode. */
  damping: number;
  /** Where the scene has contact. */
  friction: number;
  solver: 'game' | 'exact';
  /** A factor on the friction in joints. */
  joint_friction: number;
  /** By model a factor on Young's modulus; null: rigid. */
  stiffness: readonly (number | null)[];
}
export interface Surface { points: number[]; triangles: number[] }
export interface Standing extends Surface { name: string; ground: boolean }
export interface SceneDescription {
  name: string;
  settings: SceneSettings;
  contact: boolean;
  models: { name: string; sound: { modes: number; vertices: number } }[];
  /** `shape`: what touches in the place of the model's surface. */
  bodies: { name: string; model: number; shape?: Surface }[];
  statics: Standing[];
  sensors: Standing[];
  /** `origin` and `axis` in the frame of the body `on`; `acts`, by coordinate, as World.setJointActuation() takes it; `load`: upper bounds of what hangs on it. */
  joints: { type: string; a: string; b: string; limits: (number | null)[][]; on: number; origin: number[]; axis: number[];
    load: { mass: number; moment: number; inertia: number }; acts: object[] }[];
}

/** A scene in a World. Bodies bend by their modes, without a modal skin. */
export declare class Scene extends Native {
  /** @param files texts or bytes by their paths @param name of the scene, one of them */
  static open(files: Record<string, string | Uint8Array | ArrayBuffer>, name: string): Scene;
  /** As it begins: with the settings of the last begin(), or the scene's own. */
  readonly description: SceneDescription;
  /** Until the next begin(). */
  readonly models: readonly Model[];

  /** Begins, or begins anew: the World of before is disposed of. Settings that are not given stay. */
  begin(settings?: Partial<SceneSettings>): World;
  /** Undefined until begin(). Its steps are taken by step(). */
  readonly world: World;
  readonly bodies: readonly BodyId[];
  readonly statics: readonly BodyId[];
  readonly sensors: readonly BodyId[];
  readonly joints: readonly JointId[];

  /** Another body of a model, at rest. */
  addBody(model: number, position: readonly number[], name: string): BodyId;
  /** Lets act what the scene says of this step, and takes it. */
  step(): void;
  stepsTaken(): number;
  /** As World's functions, with what the scene has begun. A body that was added since goes. */
  saveState(snapshot: Snapshot): void;
  restoreState(bytes: Uint8Array): void;

  /** Of each body position, quaternion (w first) and amplitudes, one after another. */
  frame(): Float32Array;
  /** A body's surface in its own frame, off by no more than the tolerance, until the next call; null: it is at rest. @param touching the surface that touches, else the drawn one */
  bent(body: number, tolerance: number, touching?: boolean): { positions: Float32Array; normals: Float32Array } | null;
  /** Over all bodies: J; bodies asleep; contacts that press. */
  sums(): { kineticRigid: number; potential: number; kineticModal: number; elastic: number; asleep: number; pressing: number };
  /** What pressed in the last step, six numbers each: place, and mean force on the first body. */
  contacts(): Float64Array;

  /** Adds the state as it is to a recording. */
  record(): void;
  /** An animated GLB of the states, which are forgotten. */
  recording(): Uint8Array;

  /** What one hears of a model: null, or its modes at the vertices of the surface that is struck. */
  sound(model: number): { modes: number; vertices: number; eigenvalues: Float64Array; decays: Float64Array; gains: Float64Array; shapes: Float32Array } | null;
  /** Pa at one metre that no poke at 1 m/s exceeds. @param contactTime s */
  loudness(model: number, contactTime: number): number;
  /** Whether blows are noted from now on. */
  listen(on: boolean): void;
  /** Notes a blow by somebody, in the world. */
  noteBlow(body: number, at: readonly number[], impulse: readonly number[], contactTime: number): void;
  /** Blows since the last call, 15 numbers each: body, vertices and weights (3 each), impulse in the body's frame (3), contact time, delay after the step's start, place (3). */
  takeBlows(): Float64Array;
}
