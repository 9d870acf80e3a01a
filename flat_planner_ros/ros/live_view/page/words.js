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

// Return an angle in degrees as text.
export function inDegrees(radians) {
  return radians === null ? '' : `${Number((radians / DEGREE).toFixed(1))}°`.replace('-', '−');
}

export function precise(value, digits) {
  const x = Number(value);
  if (!Number.isFinite(x)) return '–';
  const text = Math.abs(x) < 1e-3 && x !== 0 ? x.toExponential(digits - 2) : String(Number(x.toPrecision(digits)));
  return text.replace(/-/g, '−');
}

// Return a time since 1970, or since a simulation has begun [s], as a person says it.
export function clock(time) {
  return time > 1e9 ? new Date(1000 * time).toLocaleTimeString([], {hour12: false}) : `${time.toFixed(1)} s`;
}

// Return a sentence without times since 1970, where it also says when that is from now on.
export function readable(text) {
  return text.replace(/\bat \d+\.\d+ s, (in \d)/g, '$1')
    .replace(/\bat (\d{10}\.\d+) s/g, (_, time) => `at ${clock(Number(time))}`);
}
