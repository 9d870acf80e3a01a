// Forms for the parameters of the nodes: what is changed is marked, set as a whole, and can be undone.

import {element, button, readField, showAnswer} from './dom.js';
import {number, numbers} from './words.js';

const READERS = {
  number: input => readField(input, number, 'a number, please'),
  numbers: input => readField(input, numbers, 'numbers, please: 0.1, 0.2'),
  truth: input => input.checked,
  text: input => input.value,
};

export class SettingsForm {
  constructor(form, store, send) {
    Object.assign(this, {form, store, node: form.dataset.node, choices: {}});
    this.fields = element('div', '', {className: 'fields'});
    this.apply = element('button', 'Apply', {className: 'main', disabled: true});
    this.undo = button('Undo', () => this.fill(this.known, true), {disabled: true});
    this.output = element('output', '', {className: 'answer'});
    const buttons = element('div', '', {className: 'buttons'});
    buttons.append(this.apply, this.undo);
    form.append(this.fields, buttons, this.output);
    form.noValidate = true;
    form.onsubmit = event => { event.preventDefault(); this.submit(send); };
    store.on('choices', choices => this.build(choices[this.node]));
    store.on(`settings of ${this.node}`, values => this.fill(values));
  }

  get known() { return this.store.values[`settings of ${this.node}`] ?? null; }

  get inputs() { return [...this.fields.querySelectorAll('[name]')]; }

  build(choices) {
    this.choices = choices;
    this.fields.replaceChildren();
    for (const [group, names] of groups(Object.keys(choices))) {
      const place = group ? element('fieldset') : this.fields;
      if (group) {
        place.append(element('legend', group));
        this.fields.append(place);
      }
      place.append(...names.map(name => this.field(name, group)));
    }
    this.fill(this.known);
  }

  field(name, group) {
    const {description, allowed, choices: texts, kind, unit} = this.choices[name];
    const label = element('label');
    const title = element('span', `${wording(group ? name.slice(group.length + 1) : name)} `);
    if (unit) title.append(element('small', unit));
    const input = element(texts.length ? 'select' : 'input', '', {name, title: `${name}: ${description}${allowed ? `; ${allowed}` : ''}`});
    input.append(...texts.map(text => element('option', text)));
    if (kind === 'truth') input.type = 'checkbox';
    if (kind === 'number') input.inputMode = 'decimal';
    input.oninput = () => {
      // What is as it was is right, also nothing where nothing is set.
      if (shown(input) === input.dataset.known) input.setCustomValidity(''); else READERS[kind](input);
      this.mark();
    };
    label.append(title, input);
    return label;
  }

  // Show the values of a node; what somebody is about to change here stays as it is.
  fill(values, everything = false) {
    for (const input of this.inputs) {
      const is_untouched = input.dataset.known === undefined || shown(input) === input.dataset.known;
      input.disabled = !values;
      if (!values) { clear(input); continue; }
      const text = textOf(values[input.name]);
      input.dataset.known = text;
      if (input.type === 'text') input.placeholder = text === '' ? 'not set' : '';
      if (!is_untouched && !everything) continue;
      if (input.type === 'checkbox') input.checked = values[input.name]; else input.value = text;
      input.setCustomValidity('');
    }
    this.mark();
  }

  mark() {
    this.reveal();
    const changed = this.inputs.filter(input => !input.disabled && shown(input) !== input.dataset.known);
    for (const input of this.inputs) input.classList.toggle('changed', changed.includes(input));
    this.apply.disabled = !changed.length || this.inputs.some(input => !input.validity.valid);
    this.undo.disabled = !changed.length;
  }

  // Show the parameters that matter with what is chosen here, or has been chosen at the start.
  reveal() {
    for (const input of this.inputs) {
      const conditions = Object.entries(this.choices[input.name].when);
      input.closest('label').hidden = !conditions.every(([name, values]) => values.includes(this.present(name)));
    }
    for (const group of this.fields.querySelectorAll('fieldset')) {
      group.hidden = [...group.querySelectorAll('label')].every(label => label.hidden);
    }
  }

  present(name) {
    const input = this.inputs.find(input => input.name === name);
    return input ? shown(input) : this.known?.[name] ?? null;
  }

  changes() {
    const changed = this.inputs.filter(input => shown(input) !== input.dataset.known);
    return Object.fromEntries(changed.map(input => [input.name, READERS[this.choices[input.name].kind](input)]));
  }

  async submit(send) {
    if (!this.form.reportValidity()) return;
    const values = this.changes();
    const is_done = await showAnswer(this.output, send({do: 'set', node: this.node, values}));
    if (is_done) for (const input of this.inputs) if (input.name in values) input.dataset.known = shown(input);
    this.mark();
  }
}

// Return the names in groups by what stands before the first dot; those that stand alone have none.
function groups(names) {
  const found = new Map();
  const prefix = name => name.includes('.') ? name.slice(0, name.indexOf('.')) : '';
  for (const name of names) {
    const is_shared = names.filter(other => prefix(other) === prefix(name)).length > 1;
    const key = is_shared ? prefix(name) : '';
    // A group stands where its first member does.
    const place = key || `${name}.`;
    found.set(place, [...found.get(place) ?? [], name]);
  }
  return [...found].map(([place, members]) => [place.endsWith('.') ? '' : place, members]);
}

const wording = name => name.replace(/_scale$/, '').replace(/[._]/g, ' ');
const shown = input => input.type === 'checkbox' ? String(input.checked) : input.value;

function textOf(value) {
  if (value === null || value === undefined) return '';
  if (Array.isArray(value)) return value.map(textOf).join(', ');
  return typeof value === 'number' ? String(Number(value.toPrecision(9))) : String(value);
}

// A value that nobody states is not shown, not even the first of a list.
function clear(input) {
  if (input.type === 'checkbox') input.checked = false; else input.value = '';
  if (input.tagName === 'SELECT') input.selectedIndex = -1;
  input.placeholder = '';
  delete input.dataset.known;
}
