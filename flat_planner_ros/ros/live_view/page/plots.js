// One plot on a canvas: axes, lines of rows, bounds, envelopes and marks. Nothing here knows what is shown.

import {within} from './store.js';
import {minus} from './words.js';

const GAP = 0.25;      // [s] between two rows that no line bridges
const PAD = {left: 52, right: 8, second: 54, top: 6, bottom: 18};
const NARROWING = 0.04;   // share of the way by which a range narrows at each drawing
const NEAR = 1;           // bounds this near to what is shown, in terms of its range, are shown, too
const DENSE = 2;          // rows per pixel from which only their extremes are drawn

// Colours of the page by name; asking for one takes longer than drawing a line.
const colours = new Map();

export function colour(name) {
  if (!colours.has(name)) colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  return colours.get(name);
}

// Light and dark have other ones.
export function forgetColours() { colours.clear(); }

// Return a context whose unit is a CSS pixel, with the size of the canvas.
export function prepared(canvas) {
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

// Return the points of a line, of dense rows the extremes in each pixel; null where the line is broken.
export function points({rows, column, factor = 1}, from, to, pixels, gap = GAP) {
  const found = [];
  const bin = rows.length > DENSE * pixels ? (to - from) / pixels : 0;
  let last = -Infinity;
  let until = -Infinity;
  let low = null;     // the rows with the extremes of a bin
  let high = null;
  const pointOf = row => [row[0], row[column] * factor];
  const flush = () => {
    if (low !== null) found.push(...(low[0] <= high[0] ? [low, high] : [high, low]).map(pointOf));
    low = high = null;
  };
  for (const row of rows) {
    const is_known = row[column] !== null && row[column] !== undefined;
    if (!is_known || row[0] - last > gap) { flush(); found.push(null); }
    last = is_known ? row[0] : -Infinity;
    if (!is_known) continue;
    if (!bin) { found.push(pointOf(row)); continue; }
    if (row[0] >= until) { flush(); until = row[0] + bin; }
    if (low === null || row[column] < low[column]) low = row;
    if (high === null || row[column] > high[column]) high = row;
  }
  flush();
  return found;
}

// `smallest` is half the shortest range of values, `base` a value that is always shown.
export class Plot {
  constructor(canvas, {smallest, base = null, second = null}) {
    Object.assign(this, {canvas, smallest, base, second});
    this.range = null;
    this.box = null;
  }

  // `lines` are {rows, column, factor, colour, planned}; `bounds` {value, colour}, `curves` {start, until,
  // at(t, sign), colour, dashed}, `marks` {at, text, colour}; `zero` is where the horizontal axis counts from.
  draw({from, to, zero = 0, unit = 's', gap = GAP, lines, shaded = null, bounds = [], curves = [], marks = [], cursor = null}) {
    const {context: c, width, height} = prepared(this.canvas);
    if (!width || to <= from) return;
    const box = {x: PAD.left, y: PAD.top, w: width - PAD.left - (this.second ? PAD.second : PAD.right), h: height - PAD.top - PAD.bottom};
    const visible = lines.map(line => ({...line, points: points({...line, rows: within(line.rows, from, to)}, from, to, box.w, gap)}));
    const [low, high] = this.limits(visible, bounds);
    const X = t => box.x + (t - from) / (to - from) * box.w;
    const Y = v => box.y + (high - v) / (high - low) * box.h;
    Object.assign(this, {box, X, Y});
    c.font = '11px system-ui, sans-serif';
    if (shaded) this.shade(c, Math.max(shaded[0], from), Math.min(shaded[1], to));
    this.vertical(c, low, high);
    this.horizontal(c, from - zero, to - zero, zero, unit);
    c.save();
    c.beginPath();
    c.rect(box.x, box.y, box.w, box.h);
    c.clip();
    for (const line of visible) this.line(c, line);
    for (const bound of bounds) this.bound(c, bound, low, high);
    for (const curve of curves) this.curve(c, curve, from, to);
    for (const mark of marks) this.mark(c, mark);
    if (cursor !== null) this.mark(c, {at: cursor, colour: '--soft'});
    c.restore();
  }

  // The range widens at once and narrows slowly, so that the picture stays calm.
  limits(lines, bounds) {
    let [low, high] = this.base === null ? [Infinity, -Infinity] : [this.base, this.base];
    for (const line of lines) {
      for (const point of line.points) {
        if (point === null) continue;
        if (point[1] < low) low = point[1];
        if (point[1] > high) high = point[1];
      }
    }
    if (low > high) [low, high] = [0, 0];
    const near = NEAR * Math.max(high - low, 2 * this.smallest);
    const [bottom, top] = [low, high];
    for (const {value} of bounds) {
      if (value > top && value - top < near) high = Math.max(high, value);
      if (value < bottom && bottom - value < near) low = Math.min(low, value);
    }
    const middle = (low + high) / 2;
    const half = Math.max((high - low) / 2 * 1.12, this.smallest);
    const wanted = this.base === null ? [middle - half, middle + half] : [this.base, this.base + 2 * half];
    const r = this.range ?? wanted;
    this.range = [
      wanted[0] < r[0] ? wanted[0] : r[0] + NARROWING * (wanted[0] - r[0]),
      wanted[1] > r[1] ? wanted[1] : r[1] + NARROWING * (wanted[1] - r[1]),
    ];
    return this.range;
  }

  shade(c, from, to) {
    if (to <= from) return;
    c.fillStyle = colour('--shade');
    c.fillRect(this.X(from), this.box.y, this.X(to) - this.X(from), this.box.h);
  }

  // Values at the left; at the right the same in a second unit.
  vertical(c, low, high) {
    const {box, Y, second} = this;
    const {found, decimals} = ticks(low, high, 5);
    c.strokeStyle = colour('--grid');
    c.fillStyle = colour('--soft');
    c.lineWidth = 1;
    c.textBaseline = 'middle';
    c.beginPath();
    for (const v of found) {
      c.moveTo(box.x, Math.round(Y(v)) + 0.5);
      c.lineTo(box.x + box.w, Math.round(Y(v)) + 0.5);
      c.textAlign = 'right';
      c.fillText(minus(v.toFixed(decimals)), box.x - 6, Y(v));
      c.textAlign = 'left';
      if (second) c.fillText(second(v), box.x + box.w + 4, Y(v));
    }
    c.stroke();
  }

  horizontal(c, from, to, zero, unit) {
    const {box, X} = this;
    const {found, decimals} = ticks(from, to, Math.max(3, Math.min(6, box.w / 90)));
    c.strokeStyle = colour('--grid');
    c.fillStyle = colour('--soft');
    c.textAlign = 'center';
    c.textBaseline = 'top';
    c.beginPath();
    for (const t of found) {
      const x = X(zero + t);
      c.moveTo(Math.round(x) + 0.5, box.y);
      c.lineTo(Math.round(x) + 0.5, box.y + box.h);
      if (x < box.x + 10 || x > box.x + box.w - 14) continue;
      c.fillText(`${minus(t.toFixed(decimals))} ${unit}`, x, box.y + box.h + 4);
    }
    c.stroke();
  }

  // What is planned is a wide, pale line: what is measured lies on it, and both are seen where they agree.
  line(c, {points: found, colour: name, planned}) {
    c.strokeStyle = colour(name);
    c.lineWidth = planned ? 6 : 1.6;
    c.lineJoin = 'round';
    c.globalAlpha = planned ? 0.3 : 1;
    c.beginPath();
    let is_new = true;
    for (const point of found) {
      if (point === null) { is_new = true; continue; }
      if (is_new) c.moveTo(this.X(point[0]), this.Y(point[1])); else c.lineTo(this.X(point[0]), this.Y(point[1]));
      is_new = false;
    }
    c.stroke();
    c.globalAlpha = 1;
  }

  // A limit; one without a colour only widens the range.
  bound(c, {value, colour: name}, low, high) {
    if (!name || value < low || value > high) return;
    const {box, Y} = this;
    c.strokeStyle = colour(name);
    this.stroke(c, [[box.x, Y(value)], [box.x + box.w, Y(value)]], [7, 4]);
  }

  curve(c, {start, until, at, colour: name, dashed}, from, to) {
    const [a, b] = [Math.max(start, from), Math.min(until, to)];
    if (b <= a) return;
    c.strokeStyle = colour(name);
    for (const sign of [1, -1]) {
      const times = Array.from({length: 61}, (_, k) => a + (b - a) * k / 60);
      this.stroke(c, times.map(t => [this.X(t), this.Y(at(t, sign))]), dashed ? [3, 3] : []);
    }
  }

  mark(c, {at, text = '', colour: name}) {
    const {box} = this;
    const x = this.X(at);
    c.strokeStyle = c.fillStyle = colour(name);
    this.stroke(c, [[x, box.y], [x, box.y + box.h]], text ? [2, 3] : []);
    const is_right = x > box.x + box.w / 2;
    c.textAlign = is_right ? 'right' : 'left';
    c.textBaseline = 'top';
    c.fillText(text, x + (is_right ? -4 : 4), box.y + 2);
  }

  stroke(c, pixels, dashes) {
    c.lineWidth = 1.1;
    c.setLineDash(dashes);
    c.beginPath();
    for (const pixel of pixels) c.lineTo(...pixel);
    c.stroke();
    c.setLineDash([]);
  }
}
