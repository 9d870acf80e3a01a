// What the nodes say: which are there, their verdicts, what motions are predicted to leave and what they left.

import {$, button, element, setText} from './dom.js';
import {MILLI} from './figures.js';
import {clock, inDegrees, minus, precise, readable} from './words.js';

const AGE = 1e-3;     // [s] from which a motion is another one
const NEEDS = {
  replan: 'flat_planner', stop: 'flat_planner', settle: 'flat_planner', adopt: 'flat_planner', reset: 'flat_plant',
};

export class Reports {
  constructor(store) {
    this.store = store;
    store.on('namespace', name => { $('namespace').textContent = name === '/' ? '' : name; });
    store.on('nodes', nodes => this.showNodes(nodes));
    store.on('verdicts', verdicts => this.showVerdicts(verdicts));
    store.on('report', report => this.showReport(report));
    store.on('plan', () => this.showReport());
    store.on('drift', drift => this.showDrift(drift));
    for (const node of ['flat_planner', 'flat_plant']) store.on(`settings of ${node}`, () => this.showDrive());
  }

  showNodes(nodes) {
    $('nodes').replaceChildren(...Object.entries(nodes).map(([name, is_there]) => element('li', name, {
      className: is_there ? '' : 'absent', title: is_there ? 'is there' : 'is not there',
    })));
    for (const item of document.querySelectorAll('[data-service]')) {
      const needed = NEEDS[item.dataset.service];
      if (needed) item.disabled = !nodes[needed];
    }
    this.showLevel();
  }

  // An arm that ages is said beside what its last motion left.
  showDrift(drift) {
    $('drift').hidden = !drift || drift.level === 'ok';
    setText($('drift'), drift ? readable(drift.text) : '');
  }

  // What the planner plans for, and whether the plant is driven so.
  showDrive() {
    const driveOf = node => this.store.values[`settings of ${node}`]?.drive;
    const [planned, played] = [driveOf('flat_planner'), driveOf('flat_plant')];
    const differs = Boolean(planned && played && planned !== played);
    $('drive').textContent = (planned ? `drive: ${planned}` : '') + (differs ? `, that of the plant: ${played}` : '');
    $('drive').classList.toggle('error', differs);
  }

  showVerdicts(verdicts) {
    $('verdicts').replaceChildren(...verdicts.map(({time, level, state, text}) => {
      const item = element('li');
      const name = element('b', state.toLowerCase() || level, {className: level});
      item.append(element('time', clock(time)), name, element('span', readable(text)));
      return item;
    }));
    this.showPrediction(verdicts.find(verdict => verdict.state === 'ACCEPTED'));
    this.showReport();
  }

  // What the last accepted motion is predicted to leave, beside the button that asked for it.
  showPrediction(verdict) {
    const {predicted_residual: nominal, predicted_residual_worst: worst, predicted_residual_box: box,
      predicted_miss_worst: miss, advice} = verdict?.values ?? {};
    const told = [];
    if (nominal !== undefined) told.push(`leaves ${precise(MILLI * nominal, 2)} mrad on the arm as modelled`);
    if (worst !== undefined) told.push(`up to ${precise(MILLI * worst, 2)} mrad with ${box}`.replaceAll('+-', '±'));
    if (miss !== undefined) told.push(`stops up to ${precise(MILLI * miss, 2)} mrad from the goal`);
    $('prediction').replaceChildren(told.join(', '));
    if (advice) $('prediction').append(element('br'), `Advice: ${advice} `, ...useOf(advice));
  }

  showReport(report = this.store.values.report) {
    if (!report) return;
    this.showLevel();
    const {values} = report;
    $('amplitude').textContent = values.amplitude === undefined ? '?' : precise(MILLI * values.amplitude, 3);
    $('amplitude-degrees').textContent = values.amplitude === undefined ? '' : `= ${inDegrees(Number(values.amplitude), 3)}`;
    $('report').replaceChildren(...[...this.predicted(report), ...measured(values)].flatMap(([name, text]) =>
      [element('dt', name), element('dd', text)]));
  }

  // What the verdict on the same motion had predicted.
  predicted({start}) {
    const {plan} = this.store.values;
    const verdict = this.store.verdictOfPlan;
    if (!verdict || start === null || Math.abs(plan.start - start) > AGE) return [];
    const {predicted_residual: nominal, predicted_residual_worst: worst} = verdict.values;
    if (nominal === undefined) return [];
    return [['predicted', `${precise(MILLI * nominal, 3)} mrad`],
      ...(worst === undefined ? [] : [['predicted at worst', `${precise(MILLI * worst, 3)} mrad`]])];
  }

  // A report that is not on the last motion, or whose monitor is gone, is of no colour.
  showLevel() {
    const {report, plan, nodes} = this.store.values;
    if (!report) return;
    const is_old = plan && report.start !== null && plan.start - report.start > AGE;
    const is_gone = nodes && !nodes.flat_monitor;
    const remark = is_old ? ', of an earlier motion' : is_gone ? ', the monitor is gone' : '';
    const pill = $('report-level');
    setText(pill, report.level + remark);
    pill.title = report.text;
    pill.className = `pill ${remark ? 'stale' : report.level}`;
  }
}

// A duration that is advised can be taken over.
function useOf(advice) {
  const seconds = advice.match(/longer \(([\d.]+) s\)/)?.[1];
  if (!seconds) return [];
  const use = () => { $('duration').value = seconds; $('duration').dispatchEvent(new Event('input')); };
  return [button(`Take ${seconds} s`, use, {title: 'into the field; Move sends it'})];
}

// Return names and texts of what a report has measured.
function measured(values) {
  const ofJoints = (prefix, name) => Object.keys(values).filter(key => key.startsWith(`${prefix}.`))
    .map(key => [`${name}, ${key.slice(prefix.length + 1)}`, values[key]]);
  const beside = expected => expected === undefined ? '' : ` (model ${precise(expected, 3)})`;
  return [
    ['frequency', values.frequency, 1, 'Hz', beside(values.frequency_expected)],
    ['damping ratio', values.damping_ratio, 1, '', beside(values.damping_expected)],
    ['settled after', values.settled === 'true' ? values.settling_time : undefined, 1, 's'],
    ['swing', values.peak_to_peak, MILLI, 'mrad'],
    ...ofJoints('final_error', 'final error').map(entry => [...entry, MILLI, 'mrad']),
    ...ofJoints('rms_effort', 'rms effort').slice(0, -1).map(entry => [...entry, 1, 'N m']),
    ['stiffness', values.stiffness_estimate, 1, 'N m/rad', spread(values.stiffness_std)],
    ['damping', values.damping_estimate, 1, 'N m s/rad', spread(values.damping_std)],
  ].filter(row => row[1] !== undefined)
    .map(([name, value, factor, unit, remark = '']) => [name, minus(`${precise(factor * value, 3)} ${unit}`) + remark]);
}

function spread(deviation) {
  return deviation === undefined ? '' : ` ± ${precise(deviation, 2)}`;
}
