// The tracker, where one is running: what it does, on and off.

import {$, setText, showAnswer} from './dom.js';
import {precise} from './words.js';

const MILLI = 1000;
const SHORT = 0.5;    // [s] of the motion from where the arm is to where it is, from which on it is held

export class TrackerCard {
  constructor(store, send) {
    this.store = store;
    const output = $('tracker-answer');
    $('hold').onclick = () => {
      const positions = store.rows('measured').at(-1)?.slice(1, store.joints.length);
      if (positions?.every(Number.isFinite)) showAnswer(output, send({do: 'goal', positions, duration: SHORT}));
    };
    store.on('tracker', tracker => this.show(tracker));
  }

  show(tracker) {
    $('tracker-card').hidden = !tracker;
    if (!tracker) return;
    const {level, text, values} = tracker;
    setText($('tracker-level'), values.phase ?? level);
    $('tracker-level').className = `pill ${level}`;
    setText($('tracker-text'), level === 'ok' ? '' : text);
    const {error, decay_rate: decay, margin} = values;
    const told = [error === undefined ? '' : `${precise(MILLI * error, 3)} mrad from the plan`,
      decay === undefined ? '' : `errors fall to a third in ${precise(1 / decay, 2)} s`,
      margin === undefined ? '' : `margin ${precise(margin, 2)}`];
    setText($('tracker-values'), told.filter(part => part).join(' · '));
  }
}
