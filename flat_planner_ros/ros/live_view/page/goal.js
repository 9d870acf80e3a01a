// The form for goals: a field and a slider for each motor, via points, the last goal again.

import {$, button, element, readField, showAnswer} from './dom.js';
import {angle, goalCommand, inDegrees, number, viaTimes} from './words.js';

const PRESETS = [['−π', -Math.PI], ['−π/2', -Math.PI / 2], ['0', 0], ['π/2', Math.PI / 2], ['π', Math.PI]];
const SLIDER = {reach: 2 * Math.PI, step: 0.01};   // [rad]
const ANGLE_REMARK = 'an angle, please: 1.57, 90° or pi/2';
const MOST_VIA = 16;
const HERE = 0.005;   // [rad] within which a pose is where the arm is

const readAngle = input => readField(input, angle, ANGLE_REMARK);
const readNumber = input => readField(input, number, 'a number, please');
const short = value => String(Number(value.toFixed(6)));

export class GoalForm {
  constructor(store, send) {
    Object.assign(this, {store, send, last: null});
    $('goal').onsubmit = event => { event.preventDefault(); this.submit(); };
    // A mark goes with the next key: a form is never blocked by what it once was.
    $('duration').oninput = event => readNumber(event.target);
    $('add-via').onclick = () => this.addVia();
    $('last-goal').onclick = () => this.fillLast();
    $('copy-goal').onclick = () => this.copy();
    store.on('joints', () => this.build());
    store.on('limits', () => this.setReach());
    store.on('verdicts', verdicts => this.remember(verdicts));
  }

  get inputs() { return [...$('goal-joints').querySelectorAll('[name]')]; }

  get vias() { return [...$('via-points').children]; }

  // ---- fields

  build() {
    if (this.inputs.map(input => input.name).join() === this.store.actuated.join()) return;
    $('goal-joints').replaceChildren(...this.store.actuated.map((name, k) => this.jointField(name, k)));
    $('via-points').replaceChildren();
    this.setReach();
  }

  jointField(name, k) {
    const field = element('div', '', {className: 'joint'});
    const {label, input} = angleField(name);
    const slider = element('input', '', {type: 'range', step: SLIDER.step, title: `${name}: drag, or use the arrow keys`});
    slider.setAttribute('aria-label', `${name}, jog`);
    input.onangle = value => { if (value !== null) slider.value = value; };
    slider.oninput = () => setAngle(input, Number(slider.value));
    slider.onchange = () => { if ($('jog').checked) this.submit(); };
    const presets = element('div', '', {className: 'presets'});
    const here = () => { const at = this.measured()?.[k]; if (Number.isFinite(at)) setAngle(input, at); };
    presets.append(button('here', here, {title: 'where the joint is now'}));
    for (const [text, value] of PRESETS) presets.append(button(text, () => setAngle(input, value)));
    field.append(label, slider, presets);
    return field;
  }

  // A slider reaches from limit to limit, or a turn either way.
  setReach() {
    const {position_min: least, position_max: most} = this.store.values.limits ?? {};
    this.inputs.forEach((input, k) => {
      const slider = input.closest('.joint').querySelector('[type=range]');
      const value = angle(input.value) ?? 0;
      slider.min = least?.[k] ?? Math.min(-SLIDER.reach, value - SLIDER.reach);
      slider.max = most?.[k] ?? Math.max(SLIDER.reach, value + SLIDER.reach);
      slider.value = value;
    });
  }

  measured() { return this.store.rows('measured').at(-1)?.slice(1); }

  // Where the arm is seen for the first time, the goal starts from: nothing moves before somebody has typed.
  fillOnce(angles) {
    this.inputs.forEach((input, k) => {
      if (input.dataset.touched || input.value !== '' || !Number.isFinite(angles[k])) return;
      input.value = String(Number(angles[k].toFixed(3)));
      input.onshow();
      this.setReach();
    });
  }

  // ---- via points

  addVia(positions = this.halfWay(), time = null) {
    if (this.vias.length >= MOST_VIA) return;
    const field = element('fieldset', '', {className: 'via'});
    field.append(element('legend', 'via'));
    this.store.actuated.forEach((name, k) => {
      const {label, input} = angleField(name);
      setAngle(input, positions[k]);
      field.append(label);
    });
    const label = element('label', 'at ');
    const unit = element('span', ' s');
    const input = element('input', '', {className: 'time', inputMode: 'decimal', autocomplete: 'off', placeholder: 'open',
      title: 'time from the start; open: evenly between the others, or with duration 0 when the motion costs least'});
    input.value = time === null ? '' : String(time);
    input.oninput = () => readTime(input);
    unit.prepend(input);
    label.append(unit);
    field.append(label, button('Remove', () => field.remove(), {title: 'take this point out'}));
    $('via-points').append(field);
  }

  halfWay() {
    const here = this.measured() ?? [];
    return this.inputs.map((input, k) => Number((((here[k] ?? 0) + (angle(input.value) ?? 0)) / 2).toFixed(2)));
  }

  // ---- what the form states

  // Return the goal; null where a field states nothing, which is marked.
  read() {
    const positions = this.inputs.map(readAngle);
    const duration = readNumber($('duration'));
    const points = this.vias.map(field => [...field.querySelectorAll('[name]')].map(readAngle));
    const fields = this.vias.map(field => field.querySelector('.time'));
    const given = fields.map(readTime);
    if ([...positions, duration, ...points.flat()].includes(null) || given.includes(undefined)) return null;
    const times = viaTimes(given, duration);
    if (times === null) {
      fields[0].setCustomValidity(`the times must increase, up to the duration of ${duration} s`);
      return null;
    }
    return {positions, duration, via: points.map((entry, k) => ({positions: entry, time: times[k]}))};
  }

  submit() {
    const goal = this.read();
    if (goal === null) {
      $('goal').reportValidity();
      return;
    }
    this.last = goal;
    $('prediction').textContent = '';
    showAnswer($('goal-answer'), this.send({do: 'goal', ...goal}));
  }

  // The poses that are typed, via points first, but for those that are none, and where the arm is.
  typed() {
    const here = this.measured() ?? [];
    const poses = [...this.vias.map(field => [...field.querySelectorAll('[name]')]), this.inputs]
      .map(inputs => inputs.map(input => angle(input.value)))
      .filter(angles => angles.length && !angles.includes(null));
    return poses.filter(angles => angles.some((value, k) => Math.abs(value - here[k]) > HERE)).map(angles => [...angles, 0]);
  }

  // ---- the last goal

  // Goals of others are known by what their verdicts say: the final pose and the duration.
  remember(verdicts) {
    if (this.last) return;
    const values = verdicts.find(({values}) => values['goal.positions'])?.values;
    const list = key => values?.[key]?.replace(/[[\]]/g, '').split(', ') ?? [];
    const named = Object.fromEntries(list('goal.joint_names').map((name, k) => [name, Number(list('goal.positions')[k])]));
    const positions = this.store.actuated.map(name => named[name]);
    if (!positions.length || !positions.every(Number.isFinite)) return;
    this.others = {positions, duration: Number(values['goal.time_from_start'] ?? 0), via: []};
  }

  fillLast() {
    const goal = this.last ?? this.others;
    if (!goal) return this.say(false, 'no goal has been sent yet');
    this.inputs.forEach((input, k) => setAngle(input, goal.positions[k]));
    $('duration').value = short(goal.duration);
    readNumber($('duration'));
    $('via-points').replaceChildren();
    for (const {positions, time} of goal.via) this.addVia(positions, time || null);
  }

  // Copy the command that sends what the form states.
  async copy() {
    const goal = this.read();
    if (goal === null) return $('goal').reportValidity();
    const {namespace = '/'} = this.store.values;
    const text = goalCommand(namespace, this.store.actuated, goal);
    try {
      await navigator.clipboard.writeText(text);
      this.say(true, `copied: ${text}`);
    } catch {
      this.say(true, text);   // to be copied by hand
    }
  }

  say(is_well, text) {
    $('goal-answer').className = `answer ${is_well ? 'ok' : 'error'}`;
    $('goal-answer').textContent = text;
  }
}

// Return a labelled field for an angle, with its degrees beside it.
function angleField(name) {
  const label = element('label', name);
  const input = element('input', '', {name, autocomplete: 'off', placeholder: '…', title: 'an angle: 1.57, 90° or pi/2'});
  const degrees = element('small', '', {className: 'degrees'});
  const unit = element('span');
  unit.append(input, ' rad ', degrees);
  label.append(unit);
  input.onshow = () => {
    const value = readAngle(input);
    degrees.textContent = inDegrees(value);
    input.onangle?.(value);
  };
  input.oninput = () => { input.dataset.touched = 'true'; input.onshow(); };
  return {label, input};
}

function setAngle(input, value) {
  input.value = short(value);
  input.oninput();
}

// Return a time, null where it is open, undefined where it is none, which is marked.
function readTime(input) {
  if (input.value.trim() === '') {
    input.setCustomValidity('');
    return null;
  }
  return readNumber(input) ?? undefined;
}
