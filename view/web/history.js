// The states of a scene that one goes back to.
import { Snapshot } from 'limber';

const MOST_BYTES = 100 * 2 ** 20;

export class History {
  constructor(most = MOST_BYTES) {
    this.most = most;
    this.keys = [];  // by step: {step, snapshot, hands, added, size}
    this.bytes = 0;
  }

  forget({ snapshot, size }) {
    snapshot.dispose();
    this.bytes -= size;
  }
  clear() { this.keys.splice(0).forEach((key) => this.forget(key)); }

  /** Keys of this step and later ones are those of another future: they go. Where all take too much, every second of the older half does. */
  keep(scene, hands, added) {
    const step = scene.stepsTaken();
    while (this.keys.length > 0 && this.keys.at(-1).step >= step) this.forget(this.keys.pop());
    const snapshot = Snapshot.create();
    scene.saveState(snapshot);
    const size = snapshot.bytes().length;
    this.keys.push({ step, snapshot, hands: structuredClone(hands), added, size });
    this.bytes += size;
    if (this.bytes <= this.most) return;
    const half = this.keys.length / 2, stays = (_, i) => i % 2 === 0 || i >= half;  // the first always
    this.keys.filter((key, i) => !stays(key, i)).forEach((key) => this.forget(key));
    this.keys = this.keys.filter(stays);
  }
}
