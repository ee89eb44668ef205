// The WebAssembly behind the classes of limber.js: calls of C functions with objects, arrays and texts of the script's.
import instantiate from './limber_wasm.js';
import { compile, LimberError, start } from './source.js';

export { LimberError };

let wasm, loading, structs, defaults;
const bad = (line) => new LimberError(1, line);

/** Loads the WebAssembly, once. @param source of limber.wasm: bytes, a Response, a URL, a WebAssembly.Module, or a promise of one */
export const load = (source = new URL('./limber.wasm', import.meta.url)) => loadOnce(instantiate, source, 'limber.wasm');
export const isLoaded = () => wasm !== undefined;

/** @param make what emscripten wrote beside the file, which has the C interface, and may have more */
export function loadOnce(make, source, file) {
  const begin = async () => { wasm = await start(make, await compile(source, file)); };
  return loading ??= begin().catch((error) => { loading = undefined; throw error; });
}

export function loaded() {
  if (wasm === undefined) throw bad('limber is not loaded yet: await load() first');
  return wasm;
}

// Objects ---------------------------------------------------------------------------------------------------------

const forgotten = new FinalizationRegistry((destroy) => destroy());

/** An object of the library: destroyed by dispose(), or some time after the last reference to it is gone. */
export class Native {
  #pointer;
  constructor(key, pointer, destroy, owner) {
    if (key !== forgotten) throw bad(`a ${new.target.name} is made by a static method of its class`);
    this.#pointer = pointer;
    this.owner = owner;  // in whose memory it lies
    this.destroy = destroy;
    if (destroy) forgotten.register(this, destroy, this);
  }
  get pointer() {
    if (this.#pointer === 0) throw bad(`this ${this.constructor.name} has been disposed of`);
    return this.#pointer;
  }
  dispose() {
    if (this.#pointer === 0) return;
    this.#pointer = 0;
    forgotten.unregister(this);
    this.destroy?.();
  }
}
/** @param destroy none: its owner does @param owner in whose memory it lies */
export const wrapped = (Class, pointer, destroy, owner) => new Class(forgotten, pointer, destroy, owner);

if (Symbol.dispose) Native.prototype[Symbol.dispose] = Native.prototype.dispose;

/** Numbers in the library's memory: what it fills is there without a copy. */
export class Memory extends Native {
  #array;
  constructor(Type, length) {
    if (!Number.isInteger(length) || length < 0) throw bad(`a Memory of ${length} numbers`);
    const { _malloc, _free } = loaded(), at = _malloc(Math.max(Type.BYTES_PER_ELEMENT * length, 1));
    if (at === 0) throw new LimberError(4, `no memory for ${length} numbers`);
    super(forgotten, at, () => _free(at));
    this.Type = Type;
    this.length = length;
  }
  /** The numbers, until memory grows: ask again after calls that may add to it. */
  get array() {
    const at = this.pointer;
    if (this.#array?.buffer !== wasm.HEAPU8.buffer) this.#array = new this.Type(wasm.HEAPU8.buffer, at, this.length);
    return this.#array;
  }
}

// Values ----------------------------------------------------------------------------------------------------------

const arrays = { double: Float64Array, float: Float32Array, int32_t: Int32Array, uint32_t: Uint32Array, size_t: Uint32Array,
  int64_t: BigInt64Array, uint64_t: BigUint64Array, bool: Uint8Array, void: Uint8Array };
const isPlain = (value) => [Object.prototype, null].includes(Object.getPrototypeOf(value));
const sizeOf = (type) => arrays[type]?.BYTES_PER_ELEMENT ?? structs[type].size;
const at = (type, address) => new arrays[type](wasm.HEAPU8.buffer, address, 1);

let borrowed = [];  // heap of the call that is under way
function room(bytes) {
  if (bytes <= 4096) return wasm.stackAlloc(bytes + 15 & ~15);
  const address = wasm._malloc(bytes);
  if (address === 0) throw new LimberError(4, `no memory for ${bytes} bytes`);
  borrowed.push(address);
  return address;
}

/** Defaults, or 0, where a value of a type goes. */
function clear(type, address) {
  wasm.HEAPU8.fill(0, address, address + sizeOf(type));
  if (defaults[type]) return wasm[defaults[type]](address);
  for (const [, offset, kind, count] of structs[type]?.members ?? [])
    if (structs[kind]) for (let i = 0; i < Math.max(count, 1); ++i) clear(kind, address + offset + i * sizeOf(kind));
}

function writeScalar(type, address, value, name) {
  const wide = type.includes('int64'), of = typeof value;
  if (of !== 'number' && of !== 'boolean' && of !== 'bigint') throw bad(`${name} is ${value}, expected a number`);
  at(type, address)[0] = wide ? BigInt(value) : type === 'bool' ? Number(Boolean(value)) : Number(value);
}

/** Members that a value gives; others stay. */
function write(type, address, value, name) {
  if (arrays[type]) return writeScalar(type, address, value, name);
  if (value === null || typeof value !== 'object') throw bad(`${name} is ${value}, expected members or numbers of a ${type}`);
  const { members } = structs[type];
  const inOrder = Array.isArray(value) || ArrayBuffer.isView(value);
  if (inOrder && value.length !== members.length) throw bad(`${name} has ${value.length} items, expected ${members.length}`);
  if (!inOrder && isPlain(value)) {
    const unknown = Object.keys(value).find((key) => !members.some(([member]) => member === key));
    if (unknown) throw bad(`${name} has no ${unknown}, expected one of: ${members.map(([member]) => member).join(', ')}`);
  }
  members.forEach(([member, offset, kind, count], i) => {
    const given = inOrder ? value[i] : value[member], place = address + offset, told = `${name}.${member}`;
    if (given === undefined) return;
    if (kind.startsWith('*')) {
      const array = structs[kind.slice(1)] && given ? array_(kind.slice(1), given, told) : given?.pointer ?? 0;
      at('uint32_t', place)[0] = array;
      if (Array.isArray(given)) at('uint32_t', place + 4)[0] = given.length;
    } else if (count) {
      if (given?.length !== count) throw bad(`${told} has ${given?.length} items, expected ${count}`);
      for (let k = 0; k < count; ++k) write(kind, place + k * sizeOf(kind), given[k], told);
    } else {
      write(kind, place, given, told);
    }
  });
}

/** Where the items of an array are for a call. */
function array_(type, items, name) {
  if (items instanceof Memory) return items.pointer;
  if (items instanceof ArrayBuffer) items = new Uint8Array(items);
  if (items?.length === undefined) throw bad(`${name} is ${items}, expected an array`);
  const size = sizeOf(type), address = room(items.length * size);
  if (arrays[type] && ArrayBuffer.isView(items)) {
    new arrays[type](wasm.HEAPU8.buffer, address, items.length).set(items);
  } else {
    for (let i = 0; i < items.length; ++i) {
      if (structs[type]) clear(type, address + i * size);
      write(type, address + i * size, items[i], `${name}[${i}]`);
    }
  }
  return address;
}

function text(address) {
  const end = wasm.HEAPU8.indexOf(0, address);
  return new TextDecoder().decode(wasm.HEAPU8.slice(address, end));
}

function read(type, address) {
  if (type === 'bool') return at(type, address)[0] !== 0;
  if (arrays[type]) return at(type, address)[0];
  const found = {};
  for (const [member, offset, kind, count, of] of structs[type].members) {
    const place = address + offset;
    if (kind === '*char') {
      found[member] = text(at('uint32_t', place)[0]);
    } else if (kind.startsWith('*')) {  // of an object: without a copy
      if (of && arrays[kind.slice(1)])
        found[member] = () => new arrays[kind.slice(1)](wasm.HEAPU8.buffer, at('uint32_t', place)[0], count * found[of]);
    } else if (count) {
      found[member] = Array.from({ length: count }, (_, i) => read(kind, place + i * sizeOf(kind)));
    } else {
      found[member] = read(kind, place);
    }
  }
  for (const member in found) if (typeof found[member] === 'function') found[member] = found[member]();  // lengths may come behind
  return found;
}

// Calls -----------------------------------------------------------------------------------------------------------

export function check(result) {
  if (result) throw new LimberError(result, text(wasm._limber_last_error()));
}

/** How many numbers C will write. */
function expected(of, self, given) {
  if (of === 'ids') return given[0].length;
  if (of === 'impulses') return given[3].length || given[1].length;
  const { modes, render } = (self.bodyModel?.(given[0]) ?? self).getData();
  return of === 'modes' ? modes : render.vertices;
}

/** A function of the script's that calls one of C's. Its arguments are described by words: npm/generate. */
function caller(classes, [cls, isStatic, cName, name, result, words]) {
  const what = (cls ? `${cls}.` : '') + name, made = words.find((word) => word.startsWith('made '))?.slice(5);
  return function (...given) {
    const { stackSave, stackRestore } = loaded(), stack = stackSave(), before = borrowed;
    borrowed = [];
    try {
      const call = [], answers = [], copies = [];
      let next = 0, list, items = {}, each = [];
      if (result.startsWith('struct ')) call.push(room(sizeOf(result.slice(7))));
      for (const word of words) {
        const [kind, type, more, counter] = word.split(' ');
        const value = ['object', 'struct', 'array', 'filled', 'text', 'number', 'integer', 'wide'].includes(kind) &&
          !(kind === 'object' && cls && !isStatic && call.length === 0) ? given[next++] : this;
        if (kind === 'object') {
          if (!(value instanceof Native)) throw bad(`${what}: argument ${next} is ${value}, expected an object of limber`);
          call.push(value.pointer);
        } else if (kind === 'struct') {
          const address = room(sizeOf(type));
          clear(type, address);
          if (value != null || !defaults[type]) write(type, address, value, `${what}: ${type}`);
          call.push(address);
        } else if (kind === 'array') {
          items[more] = value instanceof ArrayBuffer ? value.byteLength : value?.length;
          call.push(array_(type, value, `${what}: ${more}`));
        } else if (kind === 'count') {
          call.push(Math.floor(items[more] / Number(type)));
        } else if (kind === 'filled') {
          const wanted = value == null ? 0 : Number(more) * expected(type, this, given);
          if (value != null && value.length !== wanted) throw bad(`${what}: an array of ${value.length} numbers, expected ${wanted}`);
          if (value == null || value instanceof Memory) {
            call.push(value?.pointer ?? 0);
          } else {
            call.push(room(value.byteLength));
            copies.push([value, call.at(-1)]);
          }
        } else if (kind === 'text') {
          call.push(value == null ? 0 : array_('bool', new TextEncoder().encode(`${value}\0`), what));
        } else if (kind === 'each') {
          const n = given[0][counter]();  // of the asset
          call.push(room(n * sizeOf(type)));
          each.push([more, type, n, call.at(-1)]);
        } else if (kind === 'list') {
          list = type;
          call.push(0);
        } else if (kind === 'capacity') {
          call.push(0, room(4));
        } else if (kind === 'made' || kind === 'answer') {
          call.push(room(kind === 'made' ? 4 : sizeOf(type)));
          answers.push([type, call.at(-1)]);
        } else {
          if (!['number', 'boolean', 'bigint'].includes(typeof value) || (kind === 'integer' && !Number.isInteger(value)))
            throw bad(`${what}: argument ${next} is ${value}, expected a${kind === 'integer' ? ' whole' : ''} number`);
          call.push(kind === 'wide' ? BigInt(value) : value);
        }
      }
      if (result === 'void*') call.push(room(4));
      let back = wasm[`_${cName}`](...call);
      if (list) {
        check(back);
        const n = read('size_t', call.at(-1)), size = sizeOf(list), address = room(n * size);
        call.splice(-3, 2, address, n);
        check(wasm[`_${cName}`](...call));
        return Array.from({ length: n }, (_, i) => read(list, address + i * size));
      }
      if (result === 'result') check(back);
      for (const [array, address] of copies)
        array.set(new array.constructor(wasm.HEAPU8.buffer, address, array.length));
      if (made) {
        const pointer = read('uint32_t', answers[0][1]), destroy = wasm[`_limber_${made.toLowerCase()}_destroy`];
        return new classes[made](forgotten, pointer, destroy && (() => destroy(pointer)), isStatic ? undefined : this);
      }
      if (each.length)
        return Object.fromEntries(each.map(([name, type, n, at]) => [name, Array.from({ length: n }, (_, i) => read(type, at + i * sizeOf(type)))]));
      if (answers.length === 2 && answers[0][0] === 'bool' && !read('bool', answers[0][1])) return null;  // nothing found
      if (answers.length) return read(...answers.at(-1));
      if (result.startsWith('struct ')) return read(result.slice(7), call[0]);
      if (result === 'char*') return back === 0 ? null : text(back);
      if (result === 'void*') return new Uint8Array(wasm.HEAPU8.buffer, back, read('size_t', call.at(-1)));
      return result === 'bool' ? back !== 0 : result === 'uint64_t' ? BigInt.asUintN(64, back) : result === 'result' ? undefined : back;
    } finally {
      borrowed.forEach((address) => wasm._free(address));
      borrowed = before;
      stackRestore(stack);
    }
  };
}

/** Makes methods of classes of what npm/generate tells; @return functions that belong to none */
export function define(told) {
  structs = told.structs;
  defaults = { transform: '_limber_identity' };
  const free = {};
  for (const one of told.functions) {
    const [cls, isStatic, cName, name, result, words] = one;
    if (result.startsWith('struct ') && words.length === 0) defaults[result.slice(7)] = `_${cName}`;
    const owner = cls === '' ? free : isStatic ? told.classes[cls] : told.classes[cls].prototype;
    owner[name] = caller(told.classes, one);
  }
  return free;
}
