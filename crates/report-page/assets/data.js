// Reads what the page holds: the report as JSON, and arrays of whole numbers as compressed letters.
'use strict';

const report = JSON.parse(document.getElementById('data').textContent);

/** The arrays of the page by name, such as "0.points": a Uint16Array or Uint32Array with `components` numbers a row. */
async function readArrays() {
  const letters = atob(document.getElementById('arrays').textContent);
  const compressed = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) compressed[i] = letters.charCodeAt(i);
  const stream = new Blob([compressed]).stream().pipeThrough(new DecompressionStream('deflate'));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const arrays = new Map();
  let at = 0;
  for (const section of report.sections) {
    arrays.set(section.name, decoded(bytes, at, section));
    at += section.components * section.bytes * section.count;
  }
  return arrays;
}

/** Bytes are stored in planes: all lowest bytes of the first component, all second ones, and so on. Numbers are differences. */
function decoded(bytes, at, { kind, components, bytes: size, count }) {
  const isIndex = kind === 'indices';
  const numbers = isIndex ? new Uint32Array(components * count) : new Uint16Array(components * count);
  for (let k = 0; k < components; k++) {
    let before = 0;
    for (let i = 0; i < count; i++) {
      let raw = 0;
      for (let b = 0; b < size; b++) raw |= bytes[at + (k * size + b) * count + i] << (8 * b);
      const difference = (raw >>> 1) ^ -(raw & 1);
      // Corners beyond the first count from it.
      const from = isIndex && k > 0 ? numbers[components * i] : before;
      before = numbers[components * i + k] = from + difference;
      if (!isIndex) before &= 0xffff;
    }
  }
  return numbers;
}

// Scenes are drawn around the middle of the box, with a diagonal of 2.
const middle = report.lower.map((x, k) => 0.5 * (x + report.upper[k]));
const diagonal = Math.hypot(...report.lower.map((x, k) => report.upper[k] - x)) || 1;
const toScene = (place) => place.map((x, k) => (x - middle[k]) * 2 / diagonal);
const fromScene = (place) => place.map((x, k) => middle[k] + x * diagonal / 2);

/** Coordinates in the scene. */
function places(numbers) {
  const found = new Float32Array(numbers.length);
  const [scale, shift] = [[], []];
  for (let k = 0; k < 3; k++) {
    scale[k] = (report.upper[k] - report.lower[k]) / 65535 * 2 / diagonal;
    shift[k] = (report.lower[k] - middle[k]) * 2 / diagonal;
  }
  for (let i = 0; i < numbers.length; i++) found[i] = shift[i % 3] + scale[i % 3] * numbers[i];
  return found;
}

/** Signed distances, or distances where the scan has no side. */
function deviations(numbers) {
  const found = new Float32Array(numbers.length);
  for (let i = 0; i < numbers.length; i++) {
    const signed = (numbers[i] / 65535 * 2 - 1) * report.largest;
    found[i] = report.signed ? signed : Math.abs(signed);
  }
  return found;
}

/** Components from -1 to 1. */
function directions(numbers) {
  const found = new Float32Array(numbers.length);
  for (let i = 0; i < numbers.length; i++) found[i] = numbers[i] / 32767.5 - 1;
  return found;
}

const unitSymbol = report.unit;

/** A number as one reads it, with a minus as long as a plus. */
const typeset = (text) => text.replaceAll('-', '−');

/** A number with so many digits that count, zeros at its end left out. */
function digits(x, count = 4) {
  if (!Number.isFinite(x)) return '–';
  if (x !== 0 && (Math.abs(x) < 1e-4 || Math.abs(x) >= 1e6)) return typeset(x.toExponential(count - 1));
  const text = x === 0 ? '0' : x.toFixed(Math.max(0, count - 1 - Math.floor(Math.log10(Math.abs(x)))));
  return typeset(text.includes('.') ? text.replace(/\.?0+$/, '') : text);
}

/** Writes numbers that stand below one another: all with as many decimals as give the largest of them `count` digits. */
function alike(largest, count = 4) {
  const size = Math.abs(largest);
  if (!(size > 0) || size < 1e-4 || size >= 1e6) return (x) => digits(x, count - 1);
  const decimals = Math.max(0, count - 1 - Math.floor(Math.log10(size)));
  return (x) => typeset(x.toFixed(decimals).replace(/^-(0\.?0*)$/, '$1'));
}

const percent = (share) => `${(Math.floor(share * 1000) / 10).toFixed(1)} %`;

/** Coordinates as exact as the numbers of the page are. */
function coordinates(place) {
  return place.map((x, k) => {
    const step = Math.max((report.upper[k] - report.lower[k]) / 65535, 1e-12);
    return x.toFixed(Math.min(8, Math.max(0, Math.ceil(-Math.log10(step))))).replace('-', '−');
  }).join(', ');
}

/** The band of a deviation. */
function bandOf(deviation, tolerance) {
  const last = report.bands.length - 1;
  for (let i = 0; i < last; i++) if (deviation <= report.bands[i].upper * tolerance) return i;
  return last;
}
const bandColour = (i) => `rgb(${report.bands[i].colour.join(',')})`;
