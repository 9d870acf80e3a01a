// The page: hears the server's news over a websocket, draws them, and sends commands back.

import {drawArm, place, Plot, TRAIL} from './plots.js';
import {angle, clock, inDegrees, number as numberIn, precise, readable} from './words.js';

const PATIENCE = {shortest: 500, longest: 5000};  // [ms] between two tries to connect
const HISTORY = 3000;                             // rows that are kept of a stream
const STALE = 2000;                               // [ms] without a joint state
const MILLI = 1000;
const AGE = 1e-3;                                 // [s] from which a motion is another one

const $ = id => document.getElementById(id);
const state = {streams: {}, values: {}, paused: null, cursor: null, heard: 0, latest: 0};
const plots = {q: new Plot($('q'), 0.05), tau: new Plot($('tau'), 1e-4), residual: new Plot($('residual'), 0.05)};

// ---- connection

let socket = null;
let wait = PATIENCE.shortest;
let number = 0;
const waiting = new Map();

function connect() {
  socket = new WebSocket(`ws://${location.host}/ws`);
  socket.onopen = () => { wait = PATIENCE.shortest; state.streams = {}; };
  socket.onmessage = event => hear(JSON.parse(event.data));
  socket.onclose = () => {
    for (const finish of waiting.values()) finish({ok: false, text: 'the connection is lost'});
    waiting.clear();
    setTimeout(connect, wait);
    wait = Math.min(2 * wait, PATIENCE.longest);
  };
}

function send(command) {
  return new Promise(finish => {
    if (socket.readyState !== WebSocket.OPEN) return finish({ok: false, text: 'not connected'});
    number += 1;
    waiting.set(number, finish);
    socket.send(JSON.stringify({...command, id: number}));
  });
}

function hear(news) {
  if (news.reply) {
    waiting.get(news.reply.id)?.(news.reply);
    waiting.delete(news.reply.id);
  }
  if (news.restart) state.streams = {};
  for (const [name, rows] of Object.entries(news.streams ?? {})) {
    const stream = state.streams[name] ??= [];
    for (const row of rows) stream.push(row);
    if (stream.length > HISTORY) stream.splice(0, stream.length - HISTORY);
    if (name === 'measured') state.heard = performance.now();
  }
  for (const [name, value] of Object.entries(news.values ?? {})) {
    state.values[name] = value;
    (show[name] ?? (() => {}))(value);
  }
}

// ---- what stands on the page

const show = {
  namespace(name) { $('namespace').textContent = name === '/' ? '' : name; },
  nodes(nodes) {
    $('nodes').replaceChildren(...Object.entries(nodes).map(([name, is_there]) => {
      const item = element('li', name);
      item.className = is_there ? '' : 'absent';
      item.title = is_there ? 'is there' : 'is not there';
      return item;
    }));
    const needs = {replan: 'flat_planner', stop: 'flat_planner', adopt: 'flat_planner', reset: 'flat_plant'};
    for (const button of document.querySelectorAll('[data-service]')) {
      button.disabled = !nodes[needs[button.dataset.service]];
    }
    tellReportAge();
  },
  joints(joints) {
    const actuated = joints.slice(0, -1);
    const former = [...$('goal-joints').querySelectorAll('input')].map(input => input.name);
    if (former.join() === actuated.join()) return;
    $('goal-joints').replaceChildren(...actuated.flatMap(goalField));
  },
  choices(choices) { for (const form of document.querySelectorAll('.settings')) build(form, choices[form.dataset.node]); },
  verdicts(verdicts) {
    $('verdicts').replaceChildren(...verdicts.map(({time, level, state, text}) => {
      const item = element('li');
      const name = element('b', state.toLowerCase() || level);
      name.className = level;
      item.append(element('time', clock(time)), name, element('span', readable(text)));
      return item;
    }));
    predict(verdicts.find(verdict => verdict.state === 'ACCEPTED'));
  },
  plan() { tellReportAge(); },
  report({level, text, values}) {
    tellReportAge();
    $('amplitude').textContent = values.amplitude === undefined ? '?' : precise(MILLI * values.amplitude, 3);
    const rows = [
      ['frequency', values.frequency, 'Hz', values.frequency_expected],
      ['damping ratio', values.damping_ratio, '', values.damping_expected],
      ['settled after', values.settled === 'true' ? values.settling_time : undefined, 's'],
      ['swing', values.peak_to_peak && MILLI * values.peak_to_peak, 'mrad'],
      ...Object.keys(values).filter(key => key.startsWith('final_error.')).map(key =>
        [`final error, ${key.slice(12)}`, MILLI * values[key], 'mrad']),
      ...Object.keys(values).filter(key => key.startsWith('rms_effort.')).slice(0, -1).map(key =>
        [`rms effort, ${key.slice(11)}`, values[key], 'N m']),
      ['stiffness', values.stiffness_estimate, 'N m/rad'],
      ['damping', values.damping_estimate, 'N m s/rad'],
    ].filter(row => row[1] !== undefined);
    $('report').replaceChildren(...rows.flatMap(([name, value, unit, expected]) => [
      element('dt', name),
      element('dd', `${precise(value, 4)} ${unit}` + (expected === undefined ? '' : ` (model ${precise(expected, 4)})`)),
    ]));
  },
  'settings of flat_planner'(values) { fill('flat_planner', values); tellDrive(); },
  'settings of flat_plant'(values) { fill('flat_plant', values); tellDrive(); },
};

// What the planner plans for, and whether the plant is driven so.
function tellDrive() {
  const [planned, played] = ['flat_planner', 'flat_plant'].map(node => state.values[`settings of ${node}`]?.drive);
  const differs = planned && played && planned !== played;
  $('drive').textContent = (planned ? `drive: ${planned}` : '') + (differs ? `, that of the plant: ${played}` : '');
  $('drive').classList.toggle('error', Boolean(differs));
}

// What the last accepted motion is predicted to leave, beside the button that asked for it.
function predict(verdict) {
  const {predicted_residual: nominal, predicted_residual_worst: worst, predicted_residual_box: box, advice} = verdict?.values ?? {};
  const told = [];
  if (nominal !== undefined) told.push(`leaves ${precise(MILLI * nominal, 2)} mrad on the arm as modelled`);
  if (worst !== undefined) told.push(`up to ${precise(MILLI * worst, 2)} mrad with ${box}`.replaceAll('+-', '±'));
  $('prediction').textContent = told.join(', ') + (advice ? `. ${advice}` : '');
}

// A report that is not on the last motion, or whose monitor is gone, is of no colour.
function tellReportAge() {
  const {report, plan, nodes} = state.values;
  if (!report) return;
  const is_old = plan && report.start !== null && plan.start - report.start > AGE;
  const is_gone = nodes && !nodes.flat_monitor;
  const remark = is_old ? ', of an earlier motion' : is_gone ? ', the monitor is gone' : '';
  const pill = $('report-level');
  [pill.textContent, pill.title] = [report.level + remark, report.text];
  pill.className = `pill ${remark ? 'stale' : report.level}`;
}

function element(kind, text = '') {
  const made = document.createElement(kind);
  made.textContent = text;
  return made;
}

function goalField(name) {
  const [label, input, degrees, presets] = ['label', 'input', 'small', 'div'].map(kind => element(kind));
  label.append(name);
  Object.assign(input, {name, autocomplete: 'off', placeholder: '…', title: 'an angle: 1.57, 90° or pi/2'});
  degrees.className = 'degrees';
  const unit = element('span');
  unit.append(input, ' rad ', degrees);
  label.append(unit);
  presets.className = 'presets';
  const show = () => { degrees.textContent = inDegrees(readAngle(input)); };
  input.oninput = () => { input.dataset.touched = 'true'; show(); };
  input.onshow = show;
  for (const [text, value] of [['−π', -Math.PI], ['−π/2', -Math.PI / 2], ['0', 0], ['π/2', Math.PI / 2], ['π', Math.PI]]) {
    const button = element('button', text);
    button.type = 'button';
    button.onclick = () => { input.value = String(Number(value.toFixed(6))); input.oninput(); };
    presets.append(button);
  }
  return [label, presets];
}

// Where the arm is seen for the first time, the goal starts from: nothing moves before somebody has typed.
function fillGoal(angles) {
  [...$('goal-joints').querySelectorAll('input')].forEach((input, k) => {
    if (input.dataset.touched || input.value !== '' || !Number.isFinite(angles[k])) return;
    input.value = String(Number(angles[k].toFixed(3)));
    input.onshow();
  });
}

// Return what a field states, and mark the field if that is nothing.
function readField(input, meaning, remark) {
  const value = meaning(input.value);
  input.setCustomValidity(value === null ? remark : '');
  return value;
}
const read = input => readField(input, numberIn, 'a number, please');
const readAngle = input => readField(input, angle, 'an angle, please: 1.57, 90° or pi/2');

async function answer(output, command) {
  output.className = 'answer';
  output.textContent = '…';
  const {ok, text} = await send(command);
  output.className = `answer ${ok ? 'ok' : 'error'}`;
  output.textContent = readable(text);
  return ok;
}

$('goal').onsubmit = event => {
  event.preventDefault();
  const positions = [...$('goal-joints').querySelectorAll('input')].map(readAngle);
  const duration = read($('duration'));
  if ([...positions, duration].includes(null)) {
    $('goal').reportValidity();
    return;
  }
  $('prediction').textContent = '';
  answer($('goal-answer'), {do: 'goal', positions, duration});
};
// A mark goes with the next key: a form is never blocked by what it once was.
$('duration').oninput = event => read(event.target);
document.addEventListener('keydown', event => {
  if (event.key !== 'Escape' || event.repeat || $('stop').disabled) return;
  event.preventDefault();
  $('stop').click();
});
for (const button of document.querySelectorAll('[data-service]')) {
  const output = button.dataset.service === 'adopt' ? $('adopt-answer') : $('goal-answer');
  button.onclick = () => answer(output, {do: 'call', service: button.dataset.service});
}

// ---- parameters

function build(form, choices) {
  const fields = element('div');
  fields.className = 'fields';
  for (const [name, {description, allowed, choices: texts, kind}] of Object.entries(choices)) {
    const label = element('label', name.replace(/^mismatch\.|_scale$/g, '').replace('_', ' '));
    const input = element(texts.length ? 'select' : 'input');
    input.append(...texts.map(text => element('option', text)));
    if (kind === 'bool') input.type = 'checkbox'; else if (!texts.length) input.inputMode = 'decimal';
    Object.assign(input, {name, title: `${name}: ${description}${allowed ? `; ${allowed}` : ''}`});
    input.oninput = () => { if (kind === 'float') read(input); mark(form); };
    label.append(input);
    fields.append(label);
  }
  const [buttons, apply, undo, output] = ['div', 'button', 'button', 'output'].map(kind => element(kind));
  Object.assign(apply, {textContent: 'Apply', className: 'main', disabled: true});
  Object.assign(undo, {textContent: 'Undo', type: 'button', disabled: true});
  undo.onclick = () => fill(form.dataset.node, state.values[`settings of ${form.dataset.node}`], true);
  [buttons.className, output.className] = ['buttons', 'answer'];
  buttons.append(apply, undo);
  form.replaceChildren(fields, buttons, output);
  form.noValidate = true;
  form.onsubmit = async event => {
    event.preventDefault();
    if (!form.reportValidity()) return;
    const values = changes(form);
    const is_done = await answer(output, {do: 'set', node: form.dataset.node, values});
    if (is_done) for (const input of inputs(form)) if (input.name in values) input.dataset.known = shown(input);
    mark(form);
  };
  fill(form.dataset.node, state.values[`settings of ${form.dataset.node}`] ?? null);
}

const inputs = form => [...form.querySelectorAll('[name]')];
const shown = input => input.type === 'checkbox' ? String(input.checked) : input.value;

function changes(form) {
  const kinds = state.values.choices[form.dataset.node];
  const changed = inputs(form).filter(input => shown(input) !== input.dataset.known);
  return Object.fromEntries(changed.map(input => {
    const {kind} = kinds[input.name];
    return [input.name, kind === 'float' ? read(input) : kind === 'bool' ? input.checked : input.value];
  }));
}

function mark(form) {
  let any = false;
  for (const input of inputs(form)) {
    const is_changed = !input.disabled && shown(input) !== input.dataset.known;
    input.classList.toggle('changed', is_changed);
    any ||= is_changed;
  }
  form.querySelector('.main').disabled = !any || inputs(form).some(input => !input.validity.valid);
  form.querySelector('[type=button]').disabled = !any;
}

// Show the values of a node; what somebody is about to change here stays as it is.
function fill(node, values, everything = false) {
  const form = document.querySelector(`.settings[data-node=${node}]`);
  for (const input of inputs(form)) {
    const is_untouched = input.dataset.known === undefined || shown(input) === input.dataset.known;
    input.disabled = !values;
    if (!values) {
      // A value that nobody states is not shown, not even the first of a list.
      if (input.type === 'checkbox') input.checked = false; else input.value = '';
      if (input.tagName === 'SELECT') input.selectedIndex = -1;
      delete input.dataset.known;
      continue;
    }
    const value = values[input.name];
    const text = typeof value === 'number' ? String(Number(value.toPrecision(9))) : String(value);
    input.dataset.known = text;
    if (!is_untouched && !everything) continue;
    if (input.type === 'checkbox') input.checked = value; else input.value = text;
    input.setCustomValidity('');
  }
  if (form.querySelector('.main')) mark(form);
}

// ---- drawing

function envelopes() {
  const {report, joints} = state.values;
  if (!report || !joints || report.end === null) return [];
  const {amplitude, frequency, damping_ratio, bias, window: length} = report.values;
  if ([amplitude, frequency, damping_ratio].includes(undefined)) return [];
  const zeta = Number(damping_ratio);
  const decay = zeta * 2 * Math.PI * frequency / Math.sqrt(1 - zeta * zeta);
  const middle = MILLI * Number(bias ?? 0);
  return [{
    start: report.end,
    until: report.end + Number(length ?? 0),
    at: (t, sign) => middle + sign * MILLI * amplitude * Math.exp(-decay * (t - report.end)),
  }];
}

function legend(id, entries) {
  const list = $(id);
  entries.forEach(([name, tint, value], k) => {
    const item = list.children[k] ?? list.appendChild(element('span'));
    const text = `${name} ${value}`;
    if (item.textContent !== text) item.textContent = text;
    const style = `var(--${tint})`;
    if (item.style.color !== style) item.style.color = style;
  });
  while (list.children.length > entries.length) list.lastChild.remove();
}

function fixed(value, digits) {
  return value === null || value === undefined ? '–' : value.toFixed(digits).replace('-', '−');
}

function frame() {
  requestAnimationFrame(frame);
  const {values, streams} = state;
  const joints = values.joints ?? [];
  const n = joints.length;
  const measured = streams.measured ?? [];
  const reference = streams.reference ?? [];
  const residual = streams.residual ?? [];
  const silence = performance.now() - state.heard;
  tellConnection(measured.length > 0, silence);
  // Time goes on between two messages, but not for long without any.
  const ends = [measured, reference].filter(rows => rows.length).map(rows => rows.at(-1)[0]);
  const now = ends.length ? Math.max(...ends) + Math.min(silence, 100) / MILLI : 0;
  const span = Number($('span').value);
  const to = state.paused ?? now;
  const view = {from: to - span, to, shaded: values.plan ? [values.plan.start, values.plan.end] : null, cursor: state.cursor === null ? null : to - span + state.cursor * span};
  const instant = view.cursor ?? to;
  const at = rows => rows.length ? rows[Math.min(rows.length - 1, Math.max(0, place(rows, instant)))] : [];
  const [m, r, e] = [at(measured), at(reference), at(residual)];
  const actuated = joints.slice(0, -1);

  if (m.length) fillGoal(m.slice(1, n));

  state.box = plots.q.draw({...view, lines: [
    ...joints.map((_, k) => ({rows: reference, column: 1 + k, colour: `--s${k % 6}`, planned: true})),
    ...joints.map((_, k) => ({rows: measured, column: 1 + k, colour: `--s${k % 6}`})),
  ]}).box;
  plots.tau.draw({...view, lines: [
    ...actuated.map((_, k) => ({rows: reference, column: 1 + 2 * n + k, colour: `--s${k % 6}`, planned: true})),
    ...actuated.map((_, k) => ({rows: measured, column: 1 + 2 * n + k, colour: `--s${k % 6}`})),
  ]});
  plots.residual.draw({...view, envelopes: envelopes(), lines: joints.map((_, k) =>
    ({rows: residual, column: 1 + k, factor: MILLI, colour: `--s${k % 6}`}))});
  legend('q-legend', joints.map((name, k) => [name, `s${k % 6}`, `${fixed(m[1 + k], 3)} = ${Number.isFinite(m[1 + k]) ? inDegrees(m[1 + k]) : '–'}`]));
  legend('tau-legend', actuated.map((name, k) => [name, `s${k % 6}`, fixed(m[1 + 2 * n + k], 5)]));
  legend('residual-legend', joints.map((name, k) => [name, `s${k % 6}`, fixed(e[1 + k] === null || e[1 + k] === undefined ? null : MILLI * e[1 + k], 2)]));

  const trail = measured.slice(place(measured, instant - TRAIL), place(measured, instant) + 1).filter((_, k) => k % 3 === 0);
  drawArm($('arm'), {
    joints: n,
    lengths: values.links?.[0]?.length === n ? values.links[0] : null,
    measured: m.length ? m.slice(1, 1 + n) : null,
    reference: r.length ? r.slice(1, 1 + n) : null,
    goal: values.plan?.final ?? null,
    trail: trail.map(row => row.slice(1, 1 + n)),
  });
}

function tellConnection(is_any, silence) {
  const is_open = socket?.readyState === WebSocket.OPEN;
  const [text, level] = !is_open ? ['not connected: trying again', 'error']
    : !is_any ? ['no joint states yet', 'warn']
      : silence > STALE ? [`no joint states for ${Math.round(silence / MILLI)} s`, 'warn']
        : ['live', 'ok'];
  const pill = $('connection');
  if (pill.textContent !== text) [pill.textContent, pill.className] = [text, `pill ${level}`];
  document.body.classList.toggle('offline', !is_open);
}

$('pause').onclick = event => {
  const rows = state.streams.measured ?? [];
  state.paused = state.paused === null ? rows.at(-1)?.[0] ?? 0 : null;
  event.target.textContent = state.paused === null ? 'Pause' : 'Go on';
  event.target.setAttribute('aria-pressed', String(state.paused !== null));
};
for (const id of ['q', 'tau', 'residual']) {
  $(id).onpointermove = event => {
    if (!state.box) return;
    const x = (event.offsetX - state.box.x) / state.box.w;
    state.cursor = x >= 0 && x <= 1 ? x : null;
  };
  $(id).onpointerleave = () => { state.cursor = null; };
}

connect();
frame();
