// What a person does to a world: a hand that drags, pins that hold, pokes, joints that are led.
const FAR = 1e4;  // m, how long rays are
const ANGULAR_FREQUENCY = 50;  // rad/s, of what hangs on a joint that is led, on the drive's spring: it arrives within some tenths
const DELAY = 0.1;             // s, in which a third of the way is left

const scaled = (v, length) => v.map((x) => (x * length) / Math.hypot(...v));
export const array = ({ x, y, z }) => [x, y, z];

/** v turned by a unit quaternion. */
function turned({ w, x, y, z }, [a, b, c]) {
  const tx = 2 * (y * c - z * b), ty = 2 * (z * a - x * c), tz = 2 * (x * b - y * a);
  return [a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx];
}

/** All that a ray meets, by distance. */
export const rayHits = (world, from, along) => world.castRayAll(from, scaled(along, FAR));

export class Hands {
  /** @param held what a person holds: {hand: {id, body, at} or null, pins, joints: by joint and coordinate {place, speed}} */
  constructor(scene, held) {
    this.scene = scene;
    this.held = held ?? { hand: null, pins: [], joints: scene.joints.map(() => [0, 1, 2].map(() => ({ place: NaN, speed: NaN }))) };
  }
  get world() { return this.scene.world; }
  mass(body) { return this.world.bodyModel(body).getData().mass; }

  grab({ body, at }, frequency) {
    this.letGo();
    const mass = this.mass(body), omega = 2 * Math.PI * frequency;
    this.held.hand = { id: this.world.addHandle(body, at, { stiffness: mass * omega * omega, damping: 1.4 * mass * omega }), body, at };
  }
  holds() { return this.held.hand !== null && this.world.containsHandle(this.held.hand.id); }
  dragTo(target) { if (this.holds() && target.every(Number.isFinite)) this.world.setHandleTarget(this.held.hand.id, target, [0, 0, 0]); }
  letGo() {
    if (this.holds()) this.world.removeHandle(this.held.hand.id);
    this.held.hand = null;
  }
  /** The force is on the body. */
  state() {
    const pins = this.held.pins.filter((id) => this.world.containsHandle(id)).length;
    if (!this.holds()) return { holds: false, point: [0, 0, 0], target: [0, 0, 0], force: [0, 0, 0], pins };
    const { id, body, at } = this.held.hand, { target, force } = this.world.handleState(id);
    return { holds: true, point: array(this.world.pointPosition(body, at)), target: array(target), force: array(force), pins };
  }
  pin({ body, at }) { this.held.pins.push(this.world.addHandle(body, at)); }
  unpin() {
    for (const id of this.held.pins) if (this.world.containsHandle(id)) this.world.removeHandle(id);
    this.held.pins = [];
  }
  /** @param speed m/s that the body's mass gets @return the impulse */
  poke({ body, at }, along, speed) {
    const impulse = scaled(along, speed * this.mass(body));
    this.world.applyImpulse(body, at, impulse, 0, 0);
    return impulse;
  }

  /** A coordinate goes to a place, and is held there as by a spring; or goes on at a speed; or is left to what the scene has act on it. */
  wish(joint, coordinate, angle, { place = NaN, speed = NaN } = {}) {
    const { load, acts } = this.scene.description.joints[joint], { gravity } = this.world.getOptions(), own = acts[coordinate] ?? {};
    const inertia = angle ? load.inertia : load.mass, wanted = { ...own };
    if (!Number.isNaN(place)) {
      wanted.driveTarget = place;
      wanted.driveStiffness = inertia * ANGULAR_FREQUENCY ** 2;
      wanted.driveDamping = DELAY * wanted.driveStiffness;
    } else if (!Number.isNaN(speed)) {
      const weight = Math.hypot(...array(gravity)) * (angle ? load.moment : load.mass);
      wanted.driveStiffness = wanted.driveDamping = 0;
      wanted.motorVelocity = speed;
      wanted.motorMaxForce = (own.friction ?? 0) + 2 * weight + inertia * Math.abs(speed) / DELAY;
    }
    this.world.setJointActuation(this.scene.joints[joint], coordinate, wanted);
    this.held.joints[joint][coordinate] = { place, speed };
  }

  /** Nine numbers each: origin and axis in the world, coordinates. */
  jointFrames() {
    return Float64Array.from(this.scene.description.joints.flatMap(({ on, origin, axis }, i) => {
      const { pose: { q, p } } = this.world.bodyState(this.scene.bodies[on]);
      const at = turned(q, origin), from = array(p);
      return [...at.map((x, k) => x + from[k]), ...turned(q, axis), ...this.world.jointState(this.scene.joints[i]).position];
    }));
  }
}
