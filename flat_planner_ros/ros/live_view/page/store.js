// What the server has told: values by name, and streams of rows [time, positions, velocities, efforts].

const KEPT = 600;     // [s] of a stream that are kept
const SPARE = 1000;   // rows beyond them before they are thrown away
const SAME = 1e-3;    // [s] within which two times are the same

export class Store {
  constructor() {
    this.values = {};
    this.streams = {};
    this.heard = 0;       // [ms] when the arm was heard last
    this.listeners = {};
  }

  on(name, act) { (this.listeners[name] ??= []).push(act); }

  rows(name) { return this.streams[name] ?? []; }

  get joints() { return this.values.joints ?? []; }

  get actuated() { return this.joints.slice(0, -1); }

  // The verdict on the motion that the plan ends with: a goal in motion continues the plan of the one before.
  get verdictOfPlan() {
    const {plan, verdicts = [], epoch} = this.values;
    return plan && verdicts.find(({state, values}) => {
      const start = Number(values.start_time) - epoch;
      return state === 'ACCEPTED' && start > plan.start - SAME && start < plan.end - SAME;
    });
  }

  forget() { this.streams = {}; }

  take({restart, streams = {}, values = {}}) {
    if (restart) this.forget();
    for (const [name, rows] of Object.entries(streams)) {
      const stream = this.streams[name] ??= [];
      for (const row of rows) stream.push(row);
      trim(stream);
      if (name === 'measured') this.heard = performance.now();
    }
    Object.assign(this.values, values);
    for (const name of Object.keys(values)) {
      for (const act of this.listeners[name] ?? []) act(this.values[name]);
    }
  }
}

function trim(rows) {
  const old = place(rows, rows.at(-1)[0] - KEPT);
  if (old > SPARE) rows.splice(0, old);
}

// Return how many rows come before a time, by bisection.
export function place(rows, time) {
  let [low, high] = [0, rows.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (rows[middle][0] < time) low = middle + 1; else high = middle;
  }
  return low;
}

// Return the rows between two times, and one beyond either end.
export function within(rows, from, to) {
  return rows.slice(Math.max(0, place(rows, from) - 1), place(rows, to) + 1);
}

// Return the row at a time, an empty one if there is none.
export function rowAt(rows, time) {
  return rows[Math.min(rows.length - 1, Math.max(0, place(rows, time)))] ?? [];
}
