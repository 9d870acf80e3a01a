// Zoom and pan: pointers, wheel and keys move the time that the plots show.

import {$} from './dom.js';

const STEP = 0.1;       // share of the window by which a key moves it
const LEAST = 10;       // [px] between two fingers that stretch

// Let pointers, wheel and keys move a window; `changed` is called after each move.
export function handleGestures(view, plots, changed) {
  for (const plot of plots) {
    const shareOf = x => plot.box ? (x - plot.box.x) / plot.box.w : 0;
    const pointers = new Map();
    const {canvas} = plot;
    canvas.onpointerdown = event => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, event.offsetX);
    };
    canvas.onpointermove = event => {
      const share = shareOf(event.offsetX);
      if (!pointers.has(event.pointerId)) {
        view.cursor = share >= 0 && share <= 1 ? share : null;
        return;
      }
      drag(pointers, event, plot, view);
      changed();
    };
    canvas.onpointerup = canvas.onpointercancel = event => { pointers.delete(event.pointerId); };
    canvas.onpointerleave = () => { view.cursor = null; };
    canvas.ondblclick = () => { view.live(); changed(); };
    // A wheel alone scrolls the page, and so it shall be.
    canvas.addEventListener('wheel', event => {
      if (!event.ctrlKey && !event.metaKey && !event.shiftKey) return;
      event.preventDefault();
      view.zoom(Math.exp((event.deltaY || event.deltaX) / 400), shareOf(event.offsetX));
      changed();
    }, {passive: false});
  }
  $('plots').onkeydown = event => {
    const move = {
      ArrowLeft: () => view.move(-STEP * view.span), ArrowRight: () => view.move(STEP * view.span),
      '+': () => view.zoom(0.5, 0.5), '-': () => view.zoom(2, 0.5), End: () => view.live(),
    }[event.key];
    if (!move || event.target !== $('plots')) return;
    event.preventDefault();
    move();
    changed();
  };
}

// One pointer moves the window, two stretch it.
function drag(pointers, event, plot, view) {
  const before = [...pointers.values()];
  pointers.set(event.pointerId, event.offsetX);
  const after = [...pointers.values()];
  if (after.length === 1) {
    view.move((before[0] - after[0]) / plot.box.w * view.span);
    return;
  }
  const [old, now] = [before, after].map(([a, b]) => Math.max(LEAST, Math.abs(a - b)));
  view.zoom(old / now, ((after[0] + after[1]) / 2 - plot.box.x) / plot.box.w);
}

