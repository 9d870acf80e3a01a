// Words and numbers of the page: angles as people write them, times as they say them. Nothing here needs a browser.

const DEGREE = Math.PI / 180;
const PART_OF_PI = /^([-+]?)(?:(\d+\.?\d*|\.\d+)\*?)?(?:pi|π)(?:\/(\d+\.?\d*|\.\d+))?$/i;

// Return the number that a text states, null if it states none.
export function number(text) {
  const plain = text.trim().replace('−', '-').replace(',', '.');
  const value = Number(plain);
  return plain !== '' && Number.isFinite(value) ? value : null;
}

// Return the angle [rad] that a text states, null if it states none: 1.57, 90deg, 90°, pi/2.
export function angle(text) {
  const plain = text.trim().replace('−', '-').replace(',', '.').replace(/\s*rad$/i, '');
  const degrees = plain.match(/^(.*?)\s*(?:deg|°)$/i);
  if (degrees) {
    const value = number(degrees[1]);
    return value === null ? null : value * DEGREE;
  }
  const part = plain.match(PART_OF_PI);
  if (!part) return number(plain);
  const value = Math.PI * Number(part[2] ?? 1) / Number(part[3] ?? 1);
  return Number.isFinite(value) ? (part[1] === '-' ? -value : value) : null;
}

// Return a number's text with the sign that is as wide as a digit.
export function minus(text) {
  return String(text).replace(/-/g, '−');
}

// Return an angle in degrees as text.
export function inDegrees(radians, decimals = 1) {
  return radians === null || radians === undefined ? '' : minus(`${Number((radians / DEGREE).toFixed(decimals))}°`);
}

// The same short enough for an axis.
export function roundDegrees(radians, digits = 3) {
  return minus(`${Number((radians / DEGREE).toPrecision(digits))}°`);
}

// Return the numbers that a text lists, null if it lists none or something else.
export function numbers(text) {
  const found = text.split(/[;\s]+|,\s+/).filter(part => part !== '').map(number);
  return found.length && !found.includes(null) ? found : null;
}

export function fixed(value, digits) {
  return value === null || value === undefined ? '–' : minus(value.toFixed(digits));
}

export function precise(value, digits) {
  const x = Number(value);
  if (!Number.isFinite(x)) return '–';
  const text = Math.abs(x) < 1e-3 && x !== 0 ? x.toExponential(digits - 2) : String(Number(x.toPrecision(digits)));
  return minus(text);
}

// Return a time since 1970, or since a simulation has begun [s], as a person says it.
export function clock(time) {
  return time > 1e9 ? new Date(1000 * time).toLocaleTimeString([], {hour12: false}) : `${time.toFixed(1)} s`;
}

// Return the times of via points on the way to a duration [s]: those that are open lie evenly between the others.
// Null if the times contradict each other; all 0 where the duration is open, too.
export function viaTimes(given, duration) {
  if (given.every(time => time === null) && duration === 0) return given.map(() => 0);
  const times = [0, ...given, duration];
  for (let k = 1; k < times.length - 1; k++) {
    if (times[k] !== null) continue;
    const next = times.findIndex((time, j) => j > k && time !== null);
    times[k] = times[k - 1] + (times[next] - times[k - 1]) / (next - k + 1);
  }
  return times.every((time, k) => k === 0 || time > times[k - 1]) ? times.slice(1, -1) : null;
}

// Return the command that sends a goal from a terminal.
export function goalCommand(namespace, joints, goal) {
  const point = (positions, time) => {
    const nanoseconds = Math.round(1e9 * time);
    return `{positions: [${positions.map(decimal).join(', ')}], time_from_start: `
      + `{sec: ${Math.floor(nanoseconds / 1e9)}, nanosec: ${nanoseconds % 1e9}}}`;
  };
  const points = [...goal.via.map(({positions, time}) => point(positions, time)), point(goal.positions, goal.duration)];
  return `ros2 topic pub --once -w 1 ${namespace === '/' ? '' : namespace}/flat_planner/goal `
    + `trajectory_msgs/msg/JointTrajectory '{joint_names: [${joints.join(', ')}], points: [${points.join(', ')}]}'`;
}

// YAML takes 1 for an integer and 1.0 for a number.
function decimal(value) {
  return Number.isInteger(value) ? value.toFixed(1) : String(value);
}

// Return a sentence without times since 1970, where it also says when that is from now on.
export function readable(text) {
  return text.replace(/\bat \d+\.\d+ s, (in \d)/g, '$1')
    .replace(/\bat (\d{10}\.\d+) s/g, (_, time) => `at ${clock(Number(time))}`);
}
