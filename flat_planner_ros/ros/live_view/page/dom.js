// Pieces of the document that several modules make or find.

import {readable} from './words.js';

export const $ = id => document.getElementById(id);

export function element(kind, text = '', properties = {}) {
  return Object.assign(document.createElement(kind), {textContent: text}, properties);
}

export function button(text, act, properties = {}) {
  return element('button', text, {type: 'button', onclick: act, ...properties});
}

// Show what becomes of a command beside the button that asked for it; return whether it was done.
export async function showAnswer(output, asked) {
  output.className = 'answer';
  output.textContent = '…';
  const {ok, text} = await asked;
  output.className = `answer ${ok ? 'ok' : 'error'}`;
  output.textContent = readable(text);
  return ok;
}

// Return what a field states, and mark the field if that is nothing.
export function readField(input, meaning, remark) {
  const value = meaning(input.value);
  input.setCustomValidity(value === null ? remark : '');
  return value;
}

// Change a text only if it is another one: what is read aloud is not read again and again.
export function setText(item, text) {
  if (item.textContent !== text) item.textContent = text;
}
