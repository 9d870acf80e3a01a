// Drawing: the arm, and plots that scroll. Times are seconds on the page's axis.

const GAP = 0.25;        // [s] between two rows that no line bridges
export const TRAIL = 1.5;       // [s] of the tip's way that is shown
const PAD = {left: 52, right: 8, top: 6, bottom: 18};
const REDUCED_LENGTHS = [1, 0.62];  // of the last two links, where the model has none

export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

// Return a context whose unit is a CSS pixel, with the size of the canvas.
function prepared(canvas) {
  const scale = window.devicePixelRatio || 1;
  const {width, height} = canvas.getBoundingClientRect();
  const [w, h] = [Math.round(width * scale), Math.round(height * scale)];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const context = canvas.getContext('2d');
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  return {context, width, height};
}

// Return the round numbers in a range: few, but three at least.
export function ticks(low, high, most) {
  const power = 10 ** Math.floor(Math.log10((high - low) / most));
  for (const step of [10, 5, 2, 1].map(factor => factor * power)) {
    const first = Math.ceil(low / step - 1e-9);
    const count = Math.floor(high / step + 1e-9) - first + 1;
    if (count < 3) continue;
    const found = Array.from({length: count}, (_, k) => (first + k) * step);
    return {found, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9))};
  }
  return {found: [], decimals: 0};
}

// One plot. `lines` are {rows, column, factor, colour, planned}.
export class Plot {
  constructor(canvas, smallest) {
    this.canvas = canvas;
    this.smallest = smallest;  // half the shortest range of values
    this.range = null;
  }

  draw({from, to, lines, shaded, envelopes = [], cursor = null}) {
    const {context: c, width, height} = prepared(this.canvas);
    const box = {x: PAD.left, y: PAD.top, w: width - PAD.left - PAD.right, h: height - PAD.top - PAD.bottom};
    const visible = lines.map(line => ({...line, rows: within(line.rows, from, to)}));
    const [low, high] = this.limits(visible);
    const X = t => box.x + (t - from) / (to - from) * box.w;
    const Y = v => box.y + (high - v) / (high - low) * box.h;

    c.font = '11px system-ui, sans-serif';
    if (shaded) {
      const [a, b] = [Math.max(shaded[0], from), Math.min(shaded[1], to)];
      c.fillStyle = colour('--shade');
      if (b > a) c.fillRect(X(a), box.y, X(b) - X(a), box.h);
    }
    this.axes(c, box, X, Y, from, to, low, high);
    c.save();
    c.beginPath();
    c.rect(box.x, box.y, box.w, box.h);
    c.clip();
    for (const line of visible) this.line(c, line, X, Y);
    for (const e of envelopes) this.envelope(c, e, from, to, X, Y);
    if (cursor !== null) {
      c.strokeStyle = colour('--soft');
      c.lineWidth = 1;
      c.beginPath();
      c.moveTo(X(cursor), box.y);
      c.lineTo(X(cursor), box.y + box.h);
      c.stroke();
    }
    c.restore();
    return {from, to, box};
  }

  // The range widens at once and narrows slowly, so that the picture stays calm.
  limits(lines) {
    let [low, high] = [Infinity, -Infinity];
    for (const {rows, column, factor = 1} of lines) {
      for (const row of rows) {
        const value = row[column];
        if (value === null || value === undefined) continue;
        low = Math.min(low, value * factor);
        high = Math.max(high, value * factor);
      }
    }
    if (low > high) [low, high] = [0, 0];
    const middle = (low + high) / 2;
    const half = Math.max((high - low) / 2 * 1.12, this.smallest);
    const wanted = [middle - half, middle + half];
    const r = this.range;
    this.range = r === null ? wanted : [
      wanted[0] < r[0] ? wanted[0] : r[0] + 0.04 * (wanted[0] - r[0]),
      wanted[1] > r[1] ? wanted[1] : r[1] + 0.04 * (wanted[1] - r[1]),
    ];
    return this.range;
  }

  axes(c, box, X, Y, from, to, low, high) {
    c.strokeStyle = colour('--grid');
    c.fillStyle = colour('--soft');
    c.lineWidth = 1;
    c.beginPath();
    const vertical = ticks(low, high, 5);
    c.textAlign = 'right';
    c.textBaseline = 'middle';
    for (const v of vertical.found) {
      c.moveTo(box.x, Math.round(Y(v)) + 0.5);
      c.lineTo(box.x + box.w, Math.round(Y(v)) + 0.5);
      c.fillText(v.toFixed(vertical.decimals).replace('-', '−'), box.x - 6, Y(v));
    }
    // Seconds before the right edge: what a clock counts since its own start means nothing to a person.
    const horizontal = ticks(from - to, 0, 6);
    c.textAlign = 'center';
    c.textBaseline = 'top';
    for (const t of horizontal.found) {
      const x = X(to + t);
      c.moveTo(Math.round(x) + 0.5, box.y);
      c.lineTo(Math.round(x) + 0.5, box.y + box.h);
      if (x > box.x + 10 && x < box.x + box.w - 14) {
        c.fillText(`${t.toFixed(horizontal.decimals).replace('-', '−')} s`, x, box.y + box.h + 4);
      }
    }
    c.stroke();
  }

  // What is planned is a wide, pale line: what is measured lies on it, and both are seen where they agree.
  line(c, {rows, column, factor = 1, colour: name, planned}, X, Y) {
    c.strokeStyle = colour(name);
    c.lineWidth = planned ? 6 : 1.6;
    c.globalAlpha = planned ? 0.3 : 1;
    c.beginPath();
    let last = -Infinity;
    for (const row of rows) {
      const value = row[column];
      if (value === null || value === undefined) { last = -Infinity; continue; }
      if (row[0] - last > GAP) c.moveTo(X(row[0]), Y(value * factor));
      else c.lineTo(X(row[0]), Y(value * factor));
      last = row[0];
    }
    c.stroke();
    c.globalAlpha = 1;
  }

  envelope(c, {start, until, at}, from, to, X, Y) {
    const [a, b] = [Math.max(start, from), Math.min(until, to)];
    if (b <= a) return;
    c.strokeStyle = colour('--error');
    c.lineWidth = 1.1;
    for (const sign of [1, -1]) {
      c.beginPath();
      for (let k = 0; k <= 60; k++) {
        const t = a + (b - a) * k / 60;
        c.lineTo(X(t), Y(at(t, sign)));
      }
      c.stroke();
    }
  }
}

// Return the rows between two times, and one beyond either end.
export function within(rows, from, to) {
  return rows.slice(Math.max(0, place(rows, from) - 1), place(rows, to) + 1);
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

// The arm seen from above: measured, planned as a shadow, the goal as a dashed line.
export function drawArm(canvas, {joints, lengths, measured, reference, goal, trail}) {
  const {context: c, width, height} = prepared(canvas);
  const links = lengths ?? [...Array(Math.max(0, joints - 2)).fill(1), ...REDUCED_LENGTHS];
  const reach = links.reduce((sum, l) => sum + l, 0) * 1.12;
  const scale = Math.min(width, height) / 2 / reach;
  const place = p => [width / 2 + p[0] * scale, height / 2 - p[1] * scale];

  const points = angles => {
    const found = [[0, 0]];
    let [theta, x, y] = [0, 0, 0];
    angles.forEach((angle, k) => {
      theta += angle ?? 0;
      x += links[k] * Math.cos(theta);
      y += links[k] * Math.sin(theta);
      found.push([x, y]);
    });
    return found;
  };

  c.strokeStyle = colour('--grid');
  c.lineWidth = 1;
  for (const part of [1 / 3, 2 / 3, 1]) {
    c.beginPath();
    c.arc(width / 2, height / 2, part * reach / 1.12 * scale, 0, 2 * Math.PI);
    c.stroke();
  }
  c.beginPath();
  c.moveTo(0, height / 2); c.lineTo(width, height / 2);
  c.moveTo(width / 2, 0); c.lineTo(width / 2, height);
  c.stroke();

  const tip = angles => place(points(angles).at(-1));
  c.strokeStyle = colour(`--s${(joints - 1) % 6}`);
  c.lineCap = 'round';
  c.lineWidth = 2;
  for (let k = 1; k < trail.length; k++) {
    c.globalAlpha = 0.5 * k / trail.length;
    c.beginPath();
    c.moveTo(...tip(trail[k - 1]));
    c.lineTo(...tip(trail[k]));
    c.stroke();
  }
  c.globalAlpha = 1;
  if (goal) drawLinks(c, points(goal).map(place), {dashed: true});
  if (reference) drawLinks(c, points(reference).map(place), {shadow: true});
  if (measured) drawLinks(c, points(measured).map(place), {});
}

function drawLinks(c, points, {dashed, shadow}) {
  const last = points.length - 2;
  c.lineCap = c.lineJoin = 'round';
  for (let k = 0; k <= last; k++) {
    c.strokeStyle = dashed || shadow ? colour('--soft') : colour(`--s${k % 6}`);
    c.globalAlpha = shadow ? 0.28 : 1;
    c.lineWidth = dashed ? 1.2 : shadow ? 13 : 8;
    c.setLineDash(dashed ? [5, 5] : []);
    c.beginPath();
    c.moveTo(...points[k]);
    c.lineTo(...points[k + 1]);
    c.stroke();
  }
  c.setLineDash([]);
  c.globalAlpha = 1;
  if (dashed || shadow) return;
  points.forEach((point, k) => {
    c.beginPath();
    c.arc(...point, k === 0 ? 9 : k > last ? 4 : 6.5, 0, 2 * Math.PI);
    c.fillStyle = colour('--card');
    c.fill();
    c.strokeStyle = colour('--text');
    c.lineWidth = 2;
    c.stroke();
  });
  // The elastic joint is the one with a spring.
  const [x, y] = points[last];
  c.beginPath();
  for (let a = 0; a < 4 * Math.PI; a += 0.2) {
    const r = 1 + 4 * a / (4 * Math.PI);
    c.lineTo(x + r * Math.cos(a), y + r * Math.sin(a));
  }
  c.lineWidth = 1;
  c.stroke();
}
