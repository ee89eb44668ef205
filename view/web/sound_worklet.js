// The thread that plays: limber's synthesizer, WebAssembly by itself. process() renders; messages come between two of its calls.
const BLOW = 14;  // numbers of a blow, sound_interface.cpp

class Ringing extends AudioWorkletProcessor {
  constructor({ processorOptions: { wasm } }) {
    super();
    const module = new WebAssembly.Module(wasm), imports = {};
    for (const { module: from, name } of WebAssembly.Module.imports(module))
      (imports[from] ??= {})[name] = name === 'emscripten_notify_memory_growth' ? () => {} : () => { throw new Error(`the synthesizer ended by ${name}`); };
    this.engine = new WebAssembly.Instance(module, imports).exports;
    this.engine._initialize();
    this.engine.sound_open(sampleRate);
    this.blow = this.engine.malloc(8 * BLOW);
    this.look();
    this.port.onmessage = ({ data }) => {
      if (data.kind) this.addKind(data.kind);
      if (data.body !== undefined) this.engine.sound_add_body(data.body);
      if (data.blows) this.strike(data.blows);
      this.look();
      if (data.done) this.port.postMessage('done');
    };
  }

  /** Views of the memory, which a body that comes may let grow. */
  look() {
    const { buffer } = this.engine.memory;
    if (this.doubles?.buffer === buffer) return;
    this.doubles = new Float64Array(buffer);
    this.floats = new Float32Array(buffer);
  }

  addKind({ modes, vertices, numbers, shapes }) {
    const { malloc, free, memory } = this.engine, at = malloc(numbers.byteLength), under = malloc(shapes.byteLength);
    new Float64Array(memory.buffer).set(numbers, at / 8);
    new Float32Array(memory.buffer).set(shapes, under / 4);
    this.engine.sound_add_kind(modes, vertices, at, under);
    free(at), free(under);
  }

  strike(blows) {
    for (let i = 0; i < blows.length; i += BLOW) {
      for (let j = 0; j < BLOW; ++j) this.doubles[this.blow / 8 + j] = blows[i + j];
      this.engine.sound_strike(this.blow);
    }
  }

  process(inputs, [[left, right]]) {
    const at = this.engine.sound_render(left.length) / 4;
    for (let n = 0; n < left.length; ++n) {
      left[n] = this.floats[at + 2 * n];
      right[n] = this.floats[at + 2 * n + 1];
    }
    return true;
  }
}

registerProcessor('limber-sound', Ringing);
