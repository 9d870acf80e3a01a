// What each plot shows of the streams, and its legend.

import {$, element, setText} from './dom.js';
import {Plot} from './plots.js';
import {spectrum} from './spectrum.js';
import {rowAt} from './store.js';
import {clock, fixed, inDegrees, roundDegrees} from './words.js';

export const MILLI = 1000;
const SPECTRUM_PERIOD = 400;    // [ms] between two looks at the spectrum
const SETTLED = 0.05;           // [s] after the end of a motion from which what is left is looked at
const PERIODS = 4;              // highest frequency shown, in terms of the arm's own
const HIGHEST = 10;             // [Hz] the same where that is not known

export const tint = k => `--s${k % 6}`;

export const plots = {
  q: new Plot($('q'), {smallest: 0.05, second: v => roundDegrees(v)}),
  velocity: new Plot($('velocity'), {smallest: 0.05, second: v => roundDegrees(v)}),
  tau: new Plot($('tau'), {smallest: 1e-4, second: () => ''}),
  residual: new Plot($('residual'), {smallest: 0.05, second: v => roundDegrees(v / MILLI, 2)}),
  spectrum: new Plot($('spectrum'), {smallest: 0.005, base: 0, second: () => ''}),
};

// Draw all plots whose part of the page is open.
export function drawFigures(store, view) {
  const {plan} = store.values;
  const common = {
    from: view.from, to: view.to, zero: zeroOf(plan, view), cursor: view.cursor === null ? null : view.instant,
    shaded: plan ? [plan.start, plan.end] : null,
  };
  const n = store.joints.length;
  const {position_min: least, position_max: most, velocity, effort} = store.values.limits ?? {};
  const [arm, motors] = [store.joints, store.actuated];
  draw('q', {...common, lines: both(store, arm, 1), bounds: bounds(arm, least, most)});
  draw('velocity', {...common, lines: both(store, arm, 1 + n), bounds: bounds(arm, opposite(velocity), velocity)});
  draw('tau', {...common, lines: both(store, motors, 1 + 2 * n), bounds: bounds(motors, opposite(effort), effort)});
  draw('residual', {...common, ...residual(store, arm)});
  drawSpectrum(store, view);
  legends(store, view);
}

// A window that moves counts back from its end, one that stands from the start of the motion.
function zeroOf(plan, view) {
  return view.isLive ? view.to : plan?.start ?? view.stood;
}

function draw(name, content) {
  if ($(`${name}-figure`).open) plots[name].draw(content);
}

// Lines of what is planned, below those of what is measured.
function both(store, joints, column) {
  return ['reference', 'measured'].flatMap(stream => joints.map((_, k) => (
    {rows: store.rows(stream), column: column + k, colour: tint(k), planned: stream === 'reference'})));
}

function opposite(limits) { return limits?.map(value => value === null ? null : -value); }

// Limits of joints; null where there is none.
function bounds(joints, least, most) {
  return joints.flatMap((_, k) => [least, most]
    .map(limits => ({value: limits?.[k] ?? null, colour: tint(k)}))
    .filter(({value}) => value !== null));
}

// What is left: the envelope that the monitor has fitted, and the worst that was predicted.
function residual(store, joints) {
  const worst = MILLI * worstOf(store);
  const {plan} = store.values;
  const predicted = {start: plan?.end, until: Infinity, at: (_, sign) => sign * worst, colour: '--text', dashed: true};
  return {
    lines: joints.map((_, k) => ({rows: store.rows('residual'), column: 1 + k, factor: MILLI, colour: tint(k)})),
    bounds: Number.isFinite(worst) ? [1, -1].map(side => ({value: side * worst})) : [],
    curves: [...envelopes(store), ...(Number.isFinite(worst) && plan ? [predicted] : [])],
  };
}

function worstOf(store) {
  return Number(store.verdictOfPlan?.values.predicted_residual_worst ?? NaN);
}

function envelopes({values: {report}}) {
  if (!report || report.end === null) return [];
  const {amplitude, frequency, damping_ratio, bias, window: length} = report.values;
  if ([amplitude, frequency, damping_ratio].includes(undefined)) return [];
  const zeta = Number(damping_ratio);
  const decay = zeta * 2 * Math.PI * frequency / Math.sqrt(1 - zeta * zeta);
  const middle = MILLI * Number(bias ?? 0);
  return [{
    start: report.end,
    until: report.end + Number(length ?? 0),
    colour: '--error',
    at: (t, sign) => middle + sign * MILLI * amplitude * Math.exp(-decay * (t - report.end)),
  }];
}

// ---- the spectrum

let latest = {time: 0, rows: [], highest: HIGHEST, span: ''};

// Of what is seen after the last motion, or of all that is seen where no end of one is.
function drawSpectrum(store, view) {
  if (!$('spectrum-figure').open) return;
  const {report, plan} = store.values;
  const expected = Number(report?.values.frequency_expected ?? NaN);
  if (performance.now() - latest.time > SPECTRUM_PERIOD) {
    const highest = Number.isFinite(expected) ? PERIODS * expected : HIGHEST;
    const from = plan && plan.end > view.from && plan.end < view.to ? plan.end + SETTLED : view.from;
    const columns = store.joints.map((_, k) => 1 + k);
    const rows = spectrum(store.rows('residual'), columns, from, view.to, highest);
    latest = {time: performance.now(), rows, highest, span: `${fixed(view.to - from, 1)} s`};
    setText($('spectrum-note'), rows.length ? `of ${latest.span}` : 'too little to see yet');
  }
  plots.spectrum.draw({
    from: 0, to: latest.highest, unit: 'Hz', gap: Infinity,
    lines: store.joints.map((_, k) => ({rows: latest.rows, column: 1 + k, factor: MILLI, colour: tint(k)})),
    marks: Number.isFinite(expected) ? [{at: expected, text: `model ${fixed(expected, 3)} Hz`, colour: '--soft'}] : [],
  });
  legend('spectrum', store.joints.map((name, k) => [name, k, peakOf(latest.rows, 1 + k)]));
}

function peakOf(rows, column) {
  const peak = rows.reduce((best, row) => row[column] > (best?.[column] ?? 0) ? row : best, null);
  return peak ? `${fixed(MILLI * peak[column], 2)} at ${fixed(peak[0], 2)} Hz` : '–';
}

// ---- the values under the pointer, or the last ones

function legends(store, view) {
  const n = store.joints.length;
  const [m, e] = ['measured', 'residual'].map(name => rowAt(store.rows(name), view.instant));
  const angle = (value, digits) => `${fixed(value, digits)} = ${inDegrees(value) || '–'}`;
  legend('q', store.joints.map((name, k) => [name, k, angle(m[1 + k], 3)]));
  legend('velocity', store.joints.map((name, k) => [name, k, fixed(m[1 + n + k], 3)]));
  legend('tau', store.actuated.map((name, k) => [name, k, fixed(m[1 + 2 * n + k], 5)]));
  legend('residual', store.joints.map((name, k) => [name, k, fixed(Number.isFinite(e[1 + k]) ? MILLI * e[1 + k] : null, 2)]));
  setText($('instant'), view.cursor === null ? '' : instantOf(store, view));
}

function legend(id, entries) {
  const list = $(`${id}-legend`);
  entries.forEach(([name, k, value], index) => {
    const item = list.children[index] ?? list.appendChild(element('span'));
    setText(item, `${name} ${value}`);
    const style = `var(${tint(k)})`;
    if (item.style.color !== style) item.style.color = style;
  });
  while (list.children.length > entries.length) list.lastChild.remove();
}

// When the pointer points to, as a person says it.
function instantOf({values: {plan, epoch}}, view) {
  const parts = [`${fixed(view.instant - zeroOf(plan, view), 3)} s`];
  if (plan) parts.push(`${fixed(view.instant - plan.start, 3)} s from the start of the motion`);
  if (epoch !== undefined) parts.push(clock(epoch + view.instant));
  return parts.join(' · ');
}

// What stands above each open plot, for a picture of it.
export function openFigures() {
  return Object.keys(plots).filter(name => $(`${name}-figure`).open).map(name => ({
    canvas: $(name),
    title: $(`${name}-figure`).querySelector('summary b').textContent,
    unit: $(`${name}-figure`).querySelector('summary small').textContent,
    legend: [...$(`${name}-legend`).children].map(({textContent, style}) => ({text: textContent, colour: style.color})),
  }));
}
