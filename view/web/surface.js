// Bodies as they bend. The engine bends them, by as few modes as one sees: a body at rest is its model's surface.
import * as THREE from 'three';

export const COLOURS = [0xd9822b, 0x3d7ab8, 0x5f9e4f, 0xb0508c, 0x8a6fc1, 0xc2a32e, 0x3f9c98, 0xc4574b];

/** What all bodies of a model share. */
export class SurfaceModel {
  constructor({ rest, triangles }) {
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setAttribute('position', new THREE.BufferAttribute(rest, 3));
    this.geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    this.geometry.computeVertexNormals();  // weighted by area, as the engine's
    this.geometry.computeBoundingSphere();
  }

  /** m, from a body's place: none of it at rest is farther. */
  get radius() { return this.geometry.boundingSphere.center.length() + this.geometry.boundingSphere.radius; }

  dispose() { this.geometry.dispose(); }
}

/** A mesh of a model's surface, which gets vertices of its own when it bends. */
export class BendingMesh {
  constructor(model, material) {
    this.model = model;
    this.mesh = new THREE.Mesh(model.geometry, material);
    this.mesh.frustumCulled = false;
    this.bent = null;
  }

  get vertices() { return this.model.geometry.attributes.position.count; }

  /** @param surface {positions, normals}, or null: at rest */
  set(surface) {
    const { model, mesh } = this;
    if (surface !== null && this.bent === null) {
      this.bent = new THREE.BufferGeometry();
      this.bent.setIndex(model.geometry.index);
      for (const name of ['position', 'normal'])
        this.bent.setAttribute(name, new THREE.BufferAttribute(model.geometry.attributes[name].array.slice(), 3).setUsage(THREE.DynamicDrawUsage));
    }
    mesh.geometry = surface === null ? model.geometry : this.bent;
    if (surface === null) return;
    const { position, normal } = this.bent.attributes;
    position.array.set(surface.positions);
    normal.array.set(surface.normals);
    position.needsUpdate = normal.needsUpdate = true;
  }

  dispose() {
    this.bent?.dispose();
    this.mesh.material.dispose();
  }
}

/** One body: its pose and amplitudes are a slice of the engine's frame. */
export class SurfaceBody {
  constructor(model, number) {
    this.surface = new BendingMesh(model, new THREE.MeshStandardMaterial({ color: COLOURS[number % COLOURS.length], roughness: 0.6, side: THREE.DoubleSide }));
    this.mesh = this.surface.mesh;
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.drawn = { amplitudes: [], tolerance: Infinity };
  }

  /** @param frame position, quaternion (w first), amplitudes */
  place(frame) {
    this.mesh.position.set(frame[0], frame[1], frame[2]);
    this.mesh.quaternion.set(frame[4], frame[5], frame[6], frame[3]);
  }

  /** @param frame the same. @param tolerance m. @param surface gives what to draw, where it is another than was drawn */
  bend(frame, tolerance, surface) {
    const amplitudes = frame.subarray(7), { drawn } = this;
    if (tolerance >= drawn.tolerance && amplitudes.every((z, i) => z === drawn.amplitudes[i])) return;
    this.surface.set(surface());
    this.drawn = { amplitudes: amplitudes.slice(), tolerance };
  }

  dispose() { this.surface.dispose(); }
}
