// What the plots show as a table, and as a picture.

import {colour} from './plots.js';
import {place, within} from './store.js';

const GAP = 0.25;      // [s] between two rows that nothing bridges
const QUANTITIES = {
  measured: {position: 'rad', velocity: 'rad/s', effort: 'N m'},
  reference: {position: 'rad', velocity: 'rad/s', effort: 'N m'},
  residual: {position: 'rad'},
};
const LINE = 18;       // [px] of a line of text
const PAD = 12;        // [px] around all

// Return the rows of the measured arm that are shown, with what is planned and what is left at the same times.
export function table(store, from, to) {
  const {joints, values: {epoch = 0}} = store;
  const streams = Object.entries(QUANTITIES);
  const titles = streams.flatMap(([stream, units]) => Object.entries(units).flatMap(([quantity, unit]) =>
    joints.map(joint => `${stream}.${quantity}.${joint} [${unit}]`)));
  const times = within(store.rows('measured'), from, to).map(row => row[0]).filter(time => time >= from && time <= to);
  const lines = times.map(time => [(epoch + time).toFixed(4), ...streams.flatMap(([stream, units]) =>
    between(store.rows(stream), time, joints.length * Object.keys(units).length))]);
  return [['time [s]', ...titles], ...lines].map(cells => cells.map(quoted).join(',') + '\r\n').join('');
}

// Return the values of a stream at a time, by straight lines; nothing where it has a gap.
export function between(rows, time, count) {
  const next = place(rows, time);
  const [before, after] = [rows[Math.max(0, next - 1)], rows[next]];
  if (!after || (after[0] !== time && (next === 0 || after[0] - before[0] > GAP))) return new Array(count).fill('');
  const share = after[0] > before[0] ? (time - before[0]) / (after[0] - before[0]) : 1;
  return Array.from({length: count}, (_, k) => {
    const [a, b] = [before[1 + k], after[1 + k]];
    return a === null || b === null ? '' : Number((a + share * (b - a)).toPrecision(7));
  });
}

function quoted(cell) {
  const text = String(cell);
  return /[",\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
}

// Return a canvas with the plots below each other, on the page's ground.
export function picture(figures, title) {
  const scale = window.devicePixelRatio || 1;
  const sizes = figures.map(({canvas}) => canvas.getBoundingClientRect());
  const width = Math.max(...sizes.map(size => size.width)) + 2 * PAD;
  const height = 4 * PAD + sizes.reduce((sum, size) => sum + size.height + 2 * LINE + PAD, 0);
  const whole = Object.assign(document.createElement('canvas'), {width: width * scale, height: height * scale});
  const c = whole.getContext('2d');
  c.scale(scale, scale);
  c.fillStyle = colour('--card');
  c.fillRect(0, 0, width, height);
  write(c, title, PAD, 2 * PAD, 'bold 14px system-ui, sans-serif', colour('--text'));
  let top = 3.5 * PAD;
  figures.forEach((figure, k) => {
    caption(c, figure, top + LINE - 5);
    c.drawImage(figure.canvas, PAD, top + 2 * LINE, sizes[k].width, sizes[k].height);
    top += sizes[k].height + 2 * LINE + PAD;
  });
  return whole;
}

// The title of a plot, and below it the legend.
function caption(c, {title, unit, legend}, y) {
  write(c, `${title}  [${unit}]`, PAD, y, 'bold 13px system-ui, sans-serif', colour('--text'));
  let x = PAD;
  for (const {text, colour: tint} of legend) {
    write(c, text, x, y + LINE - 2, '12px system-ui, sans-serif', resolved(tint));
    x += c.measureText(text).width + PAD;
  }
}

// A canvas does not know the page's variables.
function resolved(tint) {
  const name = tint.match(/var\((.*)\)/)?.[1];
  return name ? colour(name) : tint;
}

function write(c, text, x, y, font, tint) {
  Object.assign(c, {font, fillStyle: tint, textAlign: 'left', textBaseline: 'alphabetic'});
  c.fillText(text, x, y);
}

// Let the browser save something under a name with the present time in it.
export function save(content, kind) {
  const link = document.createElement('a');
  const time = new Date().toISOString().slice(0, 19).replace(/:/g, '-');
  link.download = `flat_planner_${time}.${kind}`;
  link.href = URL.createObjectURL(content);
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}
