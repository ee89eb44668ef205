// Bodies that bend on the GPU: the modes of a model lie in a texture, a body's amplitudes are uniforms.
import * as THREE from 'three';

export const COLOURS = [0xd9822b, 0x3d7ab8, 0x5f9e4f, 0xb0508c, 0x8a6fc1, 0xc2a32e, 0x3f9c98, 0xc4574b];

const DECLARATIONS = `
uniform highp sampler2D modes;
uniform int vertices;
uniform vec4 amplitudes[PACKS];
vec3 bent(const int part, vec3 sum) {
  for (int mode = 0; mode < MODES; ++mode) {
    int texel = 2 * (mode * vertices + gl_VertexID) + part;
    sum += amplitudes[mode / 4][mode % 4] * texelFetch(modes, ivec2(texel % WIDTH, texel / WIDTH), 0).xyz;
  }
  return sum;
}
#include <common>`;

/** What all bodies of a model share. */
export class SurfaceModel {
  constructor({ rest, normals, shapes, triangles, vertices, modes }) {
    this.vertices = vertices;
    this.modes = modes;
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setAttribute('position', new THREE.BufferAttribute(rest, 3));
    this.geometry.setAttribute('normal', new THREE.BufferAttribute(normals, 3));
    this.geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    if (modes === 0) return;
    const texels = shapes.length / 4;
    this.width = texels > 4096 * 4096 ? 8192 : 2048;
    const height = Math.ceil(texels / this.width), data = new Float32Array(4 * this.width * height);
    data.set(shapes);
    this.texture = new THREE.DataTexture(data, this.width, height, THREE.RGBAFormat, THREE.FloatType);
    this.texture.needsUpdate = true;
  }

  dispose() {
    this.geometry.dispose();
    this.texture?.dispose();
  }
}

/** A material whose vertices go where the modes of a model take them. @param amplitudes four to a vector, those of a body */
export function bending(material, model, amplitudes) {
  if (model.modes === 0) return material;
  material.onBeforeCompile = (shader) => {
    shader.uniforms.modes = { value: model.texture };
    shader.uniforms.vertices = { value: model.vertices };
    shader.uniforms.amplitudes = { value: amplitudes };
    const defines = `#define MODES ${model.modes}\n#define PACKS ${amplitudes.length}\n#define WIDTH ${model.width}\n`;
    shader.vertexShader = defines + shader.vertexShader.replace('#include <common>', DECLARATIONS)
      .replace('#include <beginnormal_vertex>', 'vec3 objectNormal = normalize(bent(1, normal));')
      .replace('#include <begin_vertex>', 'vec3 transformed = bent(0, position);');
  };
  material.customProgramCacheKey = () => `bends ${model.modes} ${model.width}`;
  return material;
}

/** One body: its pose and amplitudes are set from a slice of the engine's frame. */
export class SurfaceBody {
  constructor(model, number) {
    this.amplitudes = Array.from({ length: Math.max(1, Math.ceil(model.modes / 4)) }, () => new THREE.Vector4());
    const material = new THREE.MeshStandardMaterial({ color: COLOURS[number % COLOURS.length], roughness: 0.6, side: THREE.DoubleSide });
    this.mesh = new THREE.Mesh(model.geometry, bending(material, model, this.amplitudes));
    this.mesh.customDepthMaterial = bending(new THREE.MeshDepthMaterial({ depthPacking: THREE.RGBADepthPacking }), model, this.amplitudes);
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.mesh.frustumCulled = false;
  }

  /** @param frame position, quaternion (w first), amplitudes */
  set(frame) {
    this.mesh.position.set(frame[0], frame[1], frame[2]);
    this.mesh.quaternion.set(frame[4], frame[5], frame[6], frame[3]);
    for (let i = 7; i < frame.length; ++i) this.amplitudes[(i - 7) >> 2].setComponent((i - 7) & 3, frame[i]);
  }

  dispose() {
    this.mesh.material.dispose();
    this.mesh.customDepthMaterial.dispose();
  }
}
