// The amplitudes of a swing by frequency. Nothing here needs a browser.

import {within} from './store.js';

const STEP = 0.01;       // [s] between two samples, as often as rows come
const MOST = 8192;       // samples of the longest window, zeros included
const FINER = 4;         // zeros that follow, in terms of the samples: a peak is not missed between two lines

// Return rows [frequency, amplitude of each column] of what lies between two times; none if that is too short.
export function spectrum(rows, columns, from, to, highest) {
  const seen = within(rows, from, to).filter(row => row[0] >= from && row[0] <= to);
  if (seen.length < 16) return [];
  const [begin, end] = [seen[0][0], seen.at(-1)[0]];
  const step = Math.max(STEP, (end - begin) / (MOST / FINER));
  const count = Math.floor((end - begin) / step) + 1;
  const found = columns.map(column => amplitudes(resampled(seen, column, begin, step, count)));
  const size = 2 * found[0].length;
  const lines = Math.min(found[0].length, Math.ceil(highest * size * step) + 1);
  return Array.from({length: lines}, (_, k) => [k / (size * step), ...found.map(line => line[k])]);
}

// Return values at even times, by straight lines between the rows.
export function resampled(rows, column, begin, step, count) {
  const known = rows.filter(row => row[column] !== null && row[column] !== undefined);
  if (!known.length) return new Array(count).fill(0);
  let k = 0;
  return Array.from({length: count}, (_, i) => {
    const time = begin + i * step;
    while (k < known.length - 2 && known[k + 1][0] < time) k += 1;
    const [a, b] = [known[k], known[Math.min(k + 1, known.length - 1)]];
    const share = b[0] > a[0] ? Math.min(1, Math.max(0, (time - a[0]) / (b[0] - a[0]))) : 0;
    return a[column] + share * (b[column] - a[column]);
  });
}

// Return the amplitude of each frequency up to half of the sampling's, by a Hann window without mean and drift.
export function amplitudes(values) {
  const count = values.length;
  const weights = values.map((_, k) => 0.5 - 0.5 * Math.cos(2 * Math.PI * (k + 0.5) / count));
  const places = values.map((_, k) => k - (count - 1) / 2);
  const weighted = factors => weights.reduce((sum, weight, k) => sum + weight * factors(k), 0);
  const total = weighted(() => 1);
  const mean = weighted(k => values[k]) / total;
  const drift = weighted(k => places[k] * values[k]) / weighted(k => places[k] ** 2);
  const size = 2 ** Math.ceil(Math.log2(FINER * count));
  const [real, imaginary] = [new Float64Array(size), new Float64Array(size)];
  values.forEach((value, k) => { real[k] = weights[k] * (value - mean - drift * places[k]); });
  transform(real, imaginary);
  return Array.from({length: size / 2}, (_, k) => 2 * Math.hypot(real[k], imaginary[k]) / total);
}

// The fast Fourier transform in place, for a power of two.
export function transform(real, imaginary) {
  const size = real.length;
  for (let i = 1, j = 0; i < size; i++) {
    let bit = size >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) {
      [real[i], real[j]] = [real[j], real[i]];
      [imaginary[i], imaginary[j]] = [imaginary[j], imaginary[i]];
    }
  }
  for (let half = 1; half < size; half *= 2) {
    for (let k = 0; k < half; k++) {
      const [c, s] = [Math.cos(Math.PI * k / half), -Math.sin(Math.PI * k / half)];
      for (let a = k; a < size; a += 2 * half) {
        const b = a + half;
        const x = real[b] * c - imaginary[b] * s;
        const y = real[b] * s + imaginary[b] * c;
        [real[b], imaginary[b]] = [real[a] - x, imaginary[a] - y];
        [real[a], imaginary[a]] = [real[a] + x, imaginary[a] + y];
      }
    }
  }
}
