// The page: puts its parts together, and draws.

import {drawArm, TRAIL} from './arm.js';
import {Connection} from './connection.js';
import {$, setText, showAnswer} from './dom.js';
import {picture, save, table} from './export.js';
import {drawFigures, openFigures, plots} from './figures.js';
import {handleGestures} from './gestures.js';
import {GoalForm} from './goal.js';
import {forgetColours} from './plots.js';
import {Pull} from './pull.js';
import {Reports} from './reports.js';
import {SettingsForm} from './settings.js';
import {place, rowAt, Store} from './store.js';
import {TimeWindow} from './timewindow.js';
import {TrackerCard} from './tracker.js';
import {clock} from './words.js';

const STALE = 2000;      // [ms] without a joint state
const LATE = 100;        // [ms] for which time goes on without any
const REST = 2;          // rest between two drawings of the plots, in terms of what one takes
const ZOOM = 2;
const STEP = 0.25;       // share of the window by which a button moves it

const store = new Store();
const connection = new Connection({begin: () => store.forget(), hear: news => store.take(news)});
const send = command => connection.send(command);
const view = new TimeWindow(Number($('span').value));
const goal = new GoalForm(store, send);
const pull = new Pull($('arm'), store, send);
new Reports(store);
new TrackerCard(store, send);
for (const form of document.querySelectorAll('.settings')) new SettingsForm(form, store, send);

// ---- buttons and keys

for (const item of document.querySelectorAll('[data-service]')) {
  const output = $(item.dataset.answer ?? 'goal-answer');
  item.onclick = () => showAnswer(output, send({do: 'call', service: item.dataset.service}));
}
document.addEventListener('keydown', event => {
  if (event.key !== 'Escape' || event.repeat || $('stop').disabled) return;
  event.preventDefault();
  $('stop').click();
});

const acts = {
  pause: () => { if (view.isLive) view.stand(); else view.live(); },
  'zoom-in': () => view.zoom(1 / ZOOM, 0.5), 'zoom-out': () => view.zoom(ZOOM, 0.5),
  earlier: () => view.move(-STEP * view.span), later: () => view.move(STEP * view.span),
};
for (const [id, act] of Object.entries(acts)) $(id).onclick = () => { act(); showWindow(); };
$('span').onchange = () => { view.span = Number($('span').value); showWindow(); };
handleGestures(view, [plots.q, plots.velocity, plots.tau, plots.residual], showWindow);

function showWindow() {
  const shown = String(Number(view.span.toPrecision(3)));
  const own = $('own-span');
  const is_choice = [...$('span').options].some(option => option !== own && option.value === shown);
  own.hidden = is_choice;
  own.value = own.textContent = is_choice ? '' : shown;
  $('span').value = shown;
  setText($('pause'), view.isLive ? 'Pause' : 'Go on');
  $('pause').setAttribute('aria-pressed', String(!view.isLive));
  $('later').disabled = view.isLive;
}

$('save-csv').onclick = () => save(new Blob([table(store, view.from, view.to)], {type: 'text/csv'}), 'csv');
$('save-png').onclick = () => {
  const {namespace = '/', epoch = 0} = store.values;
  const title = `flat_planner_ros ${namespace === '/' ? '' : namespace} up to ${clock(epoch + view.to)}`;
  picture(openFigures(), title).toBlob(content => save(content, 'png'));
};

// ---- drawing

matchMedia('(prefers-color-scheme: dark)').addEventListener('change', forgetColours);

let rested = 0;          // [ms] when the plots may be drawn again

function frame() {
  requestAnimationFrame(frame);
  const silence = performance.now() - store.heard;
  const streams = [store.rows('measured'), store.rows('reference')].filter(rows => rows.length);
  tellConnection(store.rows('measured').length > 0, silence);
  if (streams.length) {
    // Time goes on between two messages, but not for long without any.
    const newest = Math.max(...streams.map(rows => rows.at(-1)[0]));
    view.follow(Math.min(...streams.map(rows => rows[0][0])), newest + Math.min(silence, LATE) / 1000);
  }
  const begin = performance.now();
  if (begin >= rested) {
    drawFigures(store, view);
    const end = performance.now();
    rested = end + REST * (end - begin);
  }
  drawPose();
}

function drawPose() {
  const n = store.joints.length;
  if (!n) return;
  const [measured, reference] = ['measured', 'reference'].map(name => store.rows(name));
  const [m, r] = [measured, reference].map(rows => rowAt(rows, view.instant));
  const poseOf = row => row.length ? row.slice(1, 1 + n) : null;
  if (m.length) goal.fillOnce(m.slice(1, n));
  const trail = measured.slice(place(measured, view.instant - TRAIL), place(measured, view.instant) + 1);
  const {plan, links} = store.values;
  drawArm($('arm'), {
    joints: n, lengths: links, measured: poseOf(m), reference: poseOf(r), typed: goal.typed(),
    goal: plan?.final ?? null, way: plan?.way ?? null, pull: pull.pointer,
    trail: trail.filter((_, k) => k % 3 === 0).map(poseOf),
  });
}

function tellConnection(is_any, silence) {
  const [text, level] = !connection.isOpen ? ['not connected: trying again', 'error']
    : !is_any ? ['no joint states yet', 'warn']
      : silence > STALE ? [`no joint states for ${Math.round(silence / 1000)} s`, 'warn']
        : ['live', 'ok'];
  setText($('connection'), text);
  $('connection').className = `pill ${level}`;
  document.body.classList.toggle('offline', !connection.isOpen);
}

showWindow();
frame();
