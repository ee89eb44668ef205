// The states of a scene that one goes back to.
import { Snapshot } from 'limber';

const MOST_BYTES = 100 * 2 ** 20;

export class History {
  constructor() { this.keys = []; }  // by step: {step, snapshot, hands, added}

  clear() { for (const { snapshot } of this.keys.splice(0)) snapshot.dispose(); }

  /** Keys of this step and later ones are those of another future: they go. Where all take too much, every second of the older half does. */
  keep(scene, hands, added) {
    const step = scene.stepsTaken();
    while (this.keys.length > 0 && this.keys.at(-1).step >= step) this.keys.pop().snapshot.dispose();
    const snapshot = Snapshot.create();
    scene.saveState(snapshot);
    this.keys.push({ step, snapshot, hands: structuredClone(hands), added, size: snapshot.bytes().length });
    if (this.keys.reduce((sum, { size }) => sum + size, 0) <= MOST_BYTES) return;
    const half = this.keys.length / 2, stays = (_, i) => i % 2 === 0 || i >= half;  // the first always
    for (const { snapshot: gone } of this.keys.filter((key, i) => !stays(key, i))) gone.dispose();
    this.keys = this.keys.filter(stays);
  }
}
