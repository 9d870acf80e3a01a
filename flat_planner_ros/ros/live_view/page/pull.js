// Pulling at the tip of the simulated arm, as with a rubber band, and a push for those without a pointer.

import {armInPicture} from './arm.js';
import {$, showAnswer} from './dom.js';

const PERIOD = 50;      // [ms] between two pushes, each of which acts for 100 ms
const NEAR = 28;        // [px] from the tip within which it is grasped
const STRONGEST = 0.25; // [rad] by which the spring gives way at most

export class Pull {
  constructor(canvas, store, send) {
    Object.assign(this, {canvas, store, send, pointer: null, timer: null});
    canvas.onpointerdown = event => this.grasp(event);
    canvas.onpointermove = event => { if (this.pointer) this.pointer = [event.offsetX, event.offsetY]; };
    canvas.onpointerup = canvas.onpointercancel = () => this.release();
    // A finger that grasps the tip does not scroll the page, any other does.
    canvas.addEventListener('touchstart', event => {
      const {left, top} = canvas.getBoundingClientRect();
      const [touch] = event.touches;
      if (this.isNear([touch.clientX - left, touch.clientY - top])) event.preventDefault();
    }, {passive: false});
    $('push').onclick = () => showAnswer($('push-answer'), this.push(this.ofSpring(STRONGEST)));
    store.on('nodes', nodes => { $('push-row').hidden = !nodes.flat_plant; });
  }

  get arm() {
    const {joints, values: {links}} = this.store;
    const angles = this.store.rows('measured').at(-1)?.slice(1, 1 + joints.length);
    return angles ? armInPicture(this.canvas, joints.length, links, angles) : null;
  }

  isNear([x, y]) {
    const tip = this.arm?.pixels.at(-1);
    return Boolean(tip && this.store.values.nodes?.flat_plant) && Math.hypot(x - tip[0], y - tip[1]) < NEAR;
  }

  grasp(event) {
    const at = [event.offsetX, event.offsetY];
    if (!this.isNear(at)) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.pointer = at;
    this.timer = setInterval(() => this.pull(), PERIOD);
  }

  release() {
    if (!this.pointer) return;
    this.pointer = null;
    clearInterval(this.timer);
    this.push(this.store.joints.map(() => 0));
  }

  pull() {
    const {arm} = this;
    if (arm) this.push(pullOf(arm, this.pointer, STRONGEST * (this.store.values.stiffness ?? 0)));
  }

  push(efforts) { return this.send({do: 'push', efforts}); }

  // An effort of the passive joint that its spring answers at an angle [rad].
  ofSpring(angle) {
    const {joints, values: {stiffness}} = this.store;
    return joints.map((_, k) => k === joints.length - 1 ? angle * (stiffness ?? 0) : 0);
  }
}

// Return the efforts of all joints [N m] under which a rubber band pulls the tip to a pixel; across the last link
// and as long as the arm reaches, it gives the passive joint the strongest one.
export function pullOf({pixels, links, scale, reach}, pointer, strongest) {
  const tip = pixels.at(-1);
  const pull = [pointer[0] - tip[0], tip[1] - pointer[1]].map(length => length / scale / reach);
  const stretch = Math.max(1, Math.hypot(...pull));
  const force = pull.map(share => share / stretch * strongest / links.at(-1));
  return links.map((_, k) => {
    const lever = [tip[0] - pixels[k][0], pixels[k][1] - tip[1]].map(length => length / scale);
    return lever[0] * force[1] - lever[1] * force[0];
  });
}
