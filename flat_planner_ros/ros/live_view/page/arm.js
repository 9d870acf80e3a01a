// The arm seen along its axes: measured, planned as a shadow, the goal dashed, what is typed dotted.

import {colour, prepared} from './plots.js';

export const TRAIL = 1.5;           // [s] of the tip's way that is shown
const REDUCED_LENGTHS = [1, 0.62];  // of the last two links, where the model has none
const MARGIN = 1.12;

// Where the picture has the base, and its pixels per metre.
function frameOf(width, height, links) {
  const reach = links.reduce((sum, length) => sum + length, 0);
  return {x: width / 2, y: height / 2, reach, scale: Math.min(width, height) / 2 / (MARGIN * reach)};
}

// Return the lengths of all links.
function linksOf(joints, lengths) {
  return lengths?.length === joints ? lengths : [...Array(Math.max(0, joints - 2)).fill(1), ...REDUCED_LENGTHS];
}

// Return the pixels of all joints and of the tip.
function pixelsOf(angles, links, frame) {
  let [theta, x, y] = [0, frame.x, frame.y];
  return [[x, y], ...angles.map((angle, k) => {
    theta += angle ?? 0;
    x += links[k] * frame.scale * Math.cos(theta);
    y -= links[k] * frame.scale * Math.sin(theta);
    return [x, y];
  })];
}

// Return the pixels of all joints and of the tip in the picture, and its pixels per metre.
export function armInPicture(canvas, joints, lengths, angles) {
  const {width, height} = canvas.getBoundingClientRect();
  const links = linksOf(joints, lengths);
  const frame = frameOf(width, height, links);
  return {...frame, links, pixels: pixelsOf(angles, links, frame)};
}

export function drawArm(canvas, {joints, lengths, measured, reference, goal, typed, way, trail, pull}) {
  const {context: c, width, height} = prepared(canvas);
  const links = linksOf(joints, lengths);
  const frame = frameOf(width, height, links);
  const pixels = angles => pixelsOf(angles, links, frame);
  drawGround(c, frame, width, height);
  drawTrail(c, trail.map(angles => pixels(angles).at(-1)), colour(`--s${(joints - 1) % 6}`));
  if (way) drawWay(c, way.map(angles => pixels(angles).at(-1)));
  if (goal) drawLinks(c, pixels(goal), {dashes: [5, 5]});
  for (const pose of typed) drawLinks(c, pixels(pose), {dashes: [1.5, 5], colour: '--accent'});
  if (reference) drawLinks(c, pixels(reference), {shadow: true});
  if (measured) drawLinks(c, pixels(measured), {});
  if (pull && measured) drawPull(c, pixels(measured).at(-1), pull);
}

function drawGround(c, {x, y, reach, scale}, width, height) {
  c.strokeStyle = colour('--grid');
  c.lineWidth = 1;
  for (const part of [1 / 3, 2 / 3, 1]) {
    c.beginPath();
    c.arc(x, y, part * reach * scale, 0, 2 * Math.PI);
    c.stroke();
  }
  c.beginPath();
  c.moveTo(0, y); c.lineTo(width, y);
  c.moveTo(x, 0); c.lineTo(x, height);
  c.stroke();
}

// The tip's way so far, fading.
function drawTrail(c, tips, tint) {
  c.strokeStyle = tint;
  c.lineCap = 'round';
  c.lineWidth = 2;
  for (let k = 1; k < tips.length; k++) {
    c.globalAlpha = 0.5 * k / tips.length;
    c.beginPath();
    c.moveTo(...tips[k - 1]);
    c.lineTo(...tips[k]);
    c.stroke();
  }
  c.globalAlpha = 1;
}

// The tip's way as planned.
function drawWay(c, tips) {
  c.strokeStyle = colour('--soft');
  c.globalAlpha = 0.45;
  c.lineWidth = 1;
  c.beginPath();
  for (const tip of tips) c.lineTo(...tip);
  c.stroke();
  c.globalAlpha = 1;
}

function drawLinks(c, points, {dashes = [], shadow = false, colour: name = '--soft'}) {
  const is_outline = dashes.length > 0;
  const last = points.length - 2;
  c.lineCap = c.lineJoin = 'round';
  for (let k = 0; k <= last; k++) {
    c.strokeStyle = is_outline || shadow ? colour(name) : colour(`--s${k % 6}`);
    c.globalAlpha = shadow ? 0.28 : 1;
    c.lineWidth = is_outline ? 1.4 : shadow ? 13 : 8;
    c.setLineDash(dashes);
    c.beginPath();
    c.moveTo(...points[k]);
    c.lineTo(...points[k + 1]);
    c.stroke();
  }
  c.setLineDash([]);
  c.globalAlpha = 1;
  if (!is_outline && !shadow) drawJoints(c, points, last);
}

function drawJoints(c, points, last) {
  c.strokeStyle = colour('--text');
  points.forEach((point, k) => {
    c.beginPath();
    c.arc(...point, k === 0 ? 9 : k > last ? 4 : 6.5, 0, 2 * Math.PI);
    c.fillStyle = colour('--card');
    c.fill();
    c.lineWidth = 2;
    c.stroke();
  });
  // The passive joint is the one with a spring.
  const [x, y] = points[last];
  c.beginPath();
  for (let a = 0; a < 4 * Math.PI; a += 0.2) {
    const r = 1 + 4 * a / (4 * Math.PI);
    c.lineTo(x + r * Math.cos(a), y + r * Math.sin(a));
  }
  c.lineWidth = 1;
  c.stroke();
}

// What pulls at the tip.
function drawPull(c, tip, pointer) {
  c.strokeStyle = colour('--error');
  c.lineWidth = 2;
  c.beginPath();
  c.moveTo(...tip);
  c.lineTo(...pointer);
  c.stroke();
}
