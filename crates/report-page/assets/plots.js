// Plots in the plane: drawn as SVG, so that they are sharp on paper and follow the colours of the page.
'use strict';

const SVG = 'http://www.w3.org/2000/svg';

function svg(name, attributes, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

/** A frame with room for axes; `x` and `y` turn values into places. */
class Plot {
  constructor(width, height, [x0, x1], [y0, y1], logarithmic = {}) {
    Object.assign(this, { width, height, left: 52, right: 12, top: 12, bottom: 26 });
    const scale = (from, to, a, b, isLog) => {
      const f = isLog ? Math.log10 : (x) => x;
      const extent = f(to) - f(from) || 1;
      return (x) => a + (f(x) - f(from)) / extent * (b - a);
    };
    this.x = scale(x0, x1, this.left, width - this.right, logarithmic.x);
    this.y = scale(y0, y1, height - this.bottom, this.top, logarithmic.y);
    this.svg = svg('svg', { viewBox: `0 0 ${width} ${height}`, role: 'img' });
    this.frame = { x0, x1, y0, y1 };
  }

  add(name, attributes, ...children) { const made = svg(name, attributes, ...children); this.svg.append(made); return made; }

  text(x, y, text, anchor = 'middle') { return this.add('text', { x, y, 'text-anchor': anchor }, text); }

  /** Lines and numbers along both axes. */
  axes(xTicks, yTicks, { xLabel = '', format = digits, yFormat = digits } = {}) {
    const bottom = this.height - this.bottom;
    for (const y of yTicks) {
      this.add('line', { class: 'axis', x1: this.left, x2: this.width - this.right, y1: this.y(y), y2: this.y(y) });
      this.text(this.left - 6, this.y(y) + 4, yFormat(y), 'end');
    }
    this.add('line', { class: 'axis', x1: this.left, x2: this.width - this.right, y1: bottom, y2: bottom });
    for (const x of xTicks) this.text(this.x(x), bottom + 15, format(x));
    if (xLabel) this.text(this.width - this.right, bottom - 5, xLabel, 'end');
    return this;
  }

  line(className, points) {
    if (points.length) this.add('polyline', { class: className, points: points.map(([x, y]) => `${this.x(x).toFixed(2)},${this.y(y).toFixed(2)}`).join(' ') });
  }
}

/** Round numbers between two others. */
function ticks(from, to, count = 5) {
  const raw = (to - from) / count || 1, power = 10 ** Math.floor(Math.log10(Math.abs(raw) || 1));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw) || raw;
  const found = [];
  for (let k = Math.ceil(from / step - 1e-9); k * step <= to + 1e-9 * step; k++) found.push(k * step);
  return found;
}

/** Powers of ten between two numbers, and 2 and 5 of them where these are few. */
function logTicks(from, to) {
  const found = [];
  const steps = Math.log10(to / from) < 1.6 ? [1, 2, 5] : [1];
  for (let e = Math.floor(Math.log10(from)); e <= Math.ceil(Math.log10(to)); e++) for (const m of steps) {
    const x = m * 10 ** e;
    if (x >= from * 0.999 && x <= to * 1.001) found.push(x);
  }
  if (found.length < 3) return ticks(from, to, 4).filter((x) => x > 0);
  return found;
}

/** How many of the deviations lie where, in the colours of the bands. */
function histogram(tolerance) {
  const all = report.quantiles;
  if (!all.length) return document.createTextNode('No points.');
  const at = (share) => all[Math.round(share * (all.length - 1))];
  const most = Math.max(Math.abs(at(0.004)), Math.abs(at(0.996)), 1.5 * tolerance) * 1.05 || 1;
  const [low, high] = [report.signed ? -most : 0, most];
  const bins = new Array(60).fill(0), width = (high - low) / bins.length;
  for (const x of all) bins[Math.min(bins.length - 1, Math.max(0, Math.floor((x - low) / width)))]++;
  const highest = Math.max(...bins) / all.length;
  const plot = new Plot(400, 190, [low, high], [0, highest * 1.05]);
  plot.axes(ticks(low, high, 4), ticks(0, highest, 3), { yFormat: (y) => `${digits(100 * y, 2)} %`, xLabel: unitSymbol });
  plot.add('rect', { class: 'band', x: plot.x(report.signed ? -tolerance : 0), y: plot.top, width: plot.x(tolerance) - plot.x(report.signed ? -tolerance : 0), height: plot.height - plot.top - plot.bottom });
  bins.forEach((count, k) => {
    if (!count) return;
    const x = low + k * width, top = plot.y(count / all.length);
    plot.add('rect', { x: plot.x(x), y: top, width: plot.x(x + width) - plot.x(x) - 0.5, height: plot.height - plot.bottom - top, fill: bandColour(bandOf(x + width / 2, tolerance)), stroke: 'rgb(128 128 128 / .5)', 'stroke-width': 0.5 });
  });
  for (const x of report.signed ? [-tolerance, tolerance] : [tolerance]) plot.add('line', { class: 'mark', x1: plot.x(x), x2: plot.x(x), y1: plot.top, y2: plot.height - plot.bottom });
  return plot.svg;
}

/** Largest and root mean square distance over control points, and the share within the tolerance. */
function convergence() {
  const steps = report.steps;
  const box = document.createElement('div');
  const positive = (x) => Math.max(x, 1e-300);
  const counts = steps.map((step) => step.control_points);
  const errors = steps.flatMap((step) => [positive(step.largest), positive(step.rms)]).concat(report.tolerance);
  const around = ([a, b], f) => (a === b ? [a / f, b * f] : [a, b]);
  const xs = around([Math.min(...counts), Math.max(...counts)], 1.5);
  const ys = [Math.min(...errors) / 1.3, Math.max(...errors) * 1.3];
  const top = new Plot(400, 175, xs, ys, { x: true, y: true });
  top.axes(logTicks(...xs), logTicks(...ys), { format: (x) => digits(x, 3), yFormat: (y) => digits(y, 2) });
  top.add('line', { class: 'mark', x1: top.left, x2: top.width - top.right, y1: top.y(report.tolerance), y2: top.y(report.tolerance) });
  top.text(top.width - top.right, top.y(report.tolerance) - 4, 'tolerance', 'end');
  const dots = (plot, className, points) => {
    plot.line(className, points);
    for (const [x, y] of points) plot.add('circle', { class: className, cx: plot.x(x), cy: plot.y(y), r: 2.5 });
  };
  dots(top, 'first', steps.map((s) => [s.control_points, positive(s.largest)]));
  dots(top, 'second', steps.map((s) => [s.control_points, positive(s.rms)]));
  const low = Math.min(...steps.map((s) => s.within), report.within);
  const bottom = new Plot(400, 105, xs, [Math.max(0, low - 0.05), 1]);
  bottom.x = top.x;
  bottom.axes(logTicks(...xs), ticks(Math.max(0, low - 0.05), 1, 3), { format: (x) => digits(x, 3), yFormat: (y) => `${Math.round(100 * y)} %` });
  bottom.add('line', { class: 'mark', x1: bottom.left, x2: bottom.width - bottom.right, y1: bottom.y(report.within), y2: bottom.y(report.within) });
  dots(bottom, 'third', steps.map((s) => [s.control_points, s.within]));
  const key = document.createElement('p');
  key.className = 'note';
  for (const [name, text] of [['first', 'largest distance'], ['second', 'root mean square'], ['third', 'share of the points within']]) {
    key.append(svgKey(name), ` ${text}  `);
  }
  const last = document.createElement('span');
  last.textContent = 'over control points; dashed: what was asked for.';
  key.append(last);
  box.append(top.svg, bottom.svg, key);
  return box;
}

function svgKey(className) {
  const made = svg('svg', { viewBox: '0 0 22 8', style: 'display:inline;width:22px;height:8px' });
  made.append(svg('line', { class: className, x1: 0, x2: 22, y1: 4, y2: 4 }));
  return made;
}

/** The points in the square of the parameters, and the cells. */
function drawPlane(canvas, parts, tolerance) {
  const size = Math.min(900, Math.round(canvas.clientWidth * Math.min(2, window.devicePixelRatio || 1))) || 400;
  canvas.width = canvas.height = size;
  const context = canvas.getContext('2d');
  const style = getComputedStyle(document.documentElement);
  context.fillStyle = style.getPropertyValue('--card');
  context.fillRect(0, 0, size, size);
  const image = context.getImageData(0, 0, size, size);
  const radius = (count) => Math.max(0, Math.min(3, Math.round(0.2 * size / Math.sqrt(count))));
  for (const { parameters, deviations: d } of parts) {
    if (!parameters) continue;
    const reach = radius(d.length);
    for (let i = 0; i < d.length; i++) {
      const x = Math.round(parameters[2 * i] / 65535 * (size - 1)), y = Math.round((1 - parameters[2 * i + 1] / 65535) * (size - 1));
      const colour = report.bands[bandOf(d[i], tolerance)].colour;
      for (let dy = -reach; dy <= reach; dy++) for (let dx = -reach; dx <= reach; dx++) {
        if (x + dx < 0 || x + dx >= size || y + dy < 0 || y + dy >= size) continue;
        image.data.set(colour, 4 * ((y + dy) * size + x + dx));
      }
    }
  }
  context.putImageData(image, 0, 0);
  context.strokeStyle = style.getPropertyValue('--accent');
  context.globalAlpha = 0.6;
  context.lineWidth = 1;
  context.beginPath();
  for (const { cells } of parts) {
    // The lower and the left side of each cell are all sides but those of the square.
    for (let i = 0; cells && i < cells.length; i += 4) {
      const [a, b, c, d] = [cells[i], cells[i + 1], cells[i + 2], cells[i + 3]].map((x) => Math.round(x / 65535 * (size - 1)));
      context.moveTo(a + 0.5, size - 0.5 - d);
      context.lineTo(a + 0.5, size - 0.5 - b);
      context.lineTo(c + 0.5, size - 0.5 - b);
    }
  }
  context.stroke();
  context.globalAlpha = 1;
}

/** Pieces put end to end: lists of [x, y, z] along each line. */
function chained(pieces) {
  const key = (p) => p.map((x) => Math.round(x * 1e5)).join(',');
  const at = new Map();
  pieces.forEach((piece, i) => [piece.slice(0, 3), piece.slice(4, 7)].forEach((end) => {
    const k = key(end);
    if (!at.has(k)) at.set(k, []);
    at.get(k).push(i);
  }));
  const used = new Uint8Array(pieces.length), chains = [];
  const next = (end) => (at.get(key(end)) || []).find((i) => !used[i]);
  const grow = (chain) => {
    for (let i = next(chain.at(-1)); i !== undefined; i = next(chain.at(-1))) {
      used[i] = 1;
      const [a, b] = [pieces[i].slice(0, 3), pieces[i].slice(4, 7)];
      chain.push(key(a) === key(chain.at(-1)) ? b : a);
    }
    return chain;
  };
  for (let i = 0; i < pieces.length; i++) {
    if (used[i]) continue;
    used[i] = 1;
    const forward = grow([pieces[i].slice(0, 3), pieces[i].slice(4, 7)]);
    chains.push(grow(forward.reverse()));
  }
  return chains.sort((a, b) => b.length - a.length);
}

/** Samples of the scan with how far along the chains they are: [length, deviation, chain]. Lengths are in the scene. */
function along(chains, samples) {
  const points = [];
  let length = 0;
  chains.forEach((chain, number) => chain.forEach((p, i) => {
    if (i > 0) length += Math.hypot(...p.map((x, k) => x - chain[i - 1][k]));
    points.push([...p, length, number]);
  }));
  const step = Math.max(1, Math.ceil(points.length / 1500)), few = points.filter((_, i) => i % step === 0);
  const found = samples.map((s) => {
    let best = [Infinity, null];
    for (const p of few) {
      const squared = (p[0] - s[0]) ** 2 + (p[1] - s[1]) ** 2 + (p[2] - s[2]) ** 2;
      if (squared < best[0]) best = [squared, p];
    }
    return best[1] && [best[1][3], s[3], best[1][4]];
  });
  return { length, samples: found.filter(Boolean).sort((a, b) => a[0] - b[0]) };
}

/** The deviation along a section. */
function sectionPlot({ length, samples }, tolerance) {
  const unit = diagonal / 2;
  const most = Math.max(1.5 * tolerance, ...samples.map((s) => Math.abs(s[1]))) * 1.05;
  const low = report.signed ? -most : 0;
  const plot = new Plot(1100, 220, [0, length * unit || 1], [low, most]);
  plot.axes(ticks(0, length * unit, 8), ticks(low, most, 4), { xLabel: `length along the section, ${unitSymbol}` });
  plot.add('rect', { class: 'band', x: plot.left, width: plot.width - plot.left - plot.right, y: plot.y(tolerance), height: plot.y(report.signed ? -tolerance : 0) - plot.y(tolerance) });
  for (const [s, deviation] of samples) plot.add('circle', { cx: plot.x(s * unit).toFixed(2), cy: plot.y(deviation).toFixed(2), r: 2.2, fill: bandColour(bandOf(deviation, tolerance)), stroke: 'rgb(128 128 128 / .7)', 'stroke-width': 0.5 });
  return plot.svg;
}

/** The section in its plane, with the deviation of each sample as a line across, enlarged. */
function profilePlot(chains, samples, axis, tolerance) {
  const [a, b] = axis === 0 ? [1, 2] : axis === 1 ? [0, 2] : [0, 1];
  const all = chains.flat();
  const range = (k) => [Math.min(...all.map((p) => p[k])), Math.max(...all.map((p) => p[k]))];
  let [xs, ys] = [range(a), range(b)];
  const isTall = ys[1] - ys[0] > xs[1] - xs[0];
  const [h, v] = isTall ? [b, a] : [a, b];
  if (isTall) [xs, ys] = [ys, xs];
  const width = 1100, scale = Math.min((width - 80) / (xs[1] - xs[0] || 1), 280 / (ys[1] - ys[0] || 1));
  const height = (ys[1] - ys[0]) * scale + 90;
  const shift = (width - (xs[1] - xs[0]) * scale) / 2;
  const place = (p) => [shift + (p[h] - xs[0]) * scale, height - 45 - (p[v] - ys[0]) * scale];
  // A tolerance is drawn twelve pixels long.
  const factor = 12 / (tolerance * 2 / diagonal * scale);
  const made = svg('svg', { viewBox: `0 0 ${width} ${height}`, role: 'img' });
  for (const chain of chains) made.append(svg('polyline', { class: 'outline', points: chain.map((p) => place(p).map((x) => x.toFixed(1)).join(',')).join(' ') }));
  for (const s of samples) {
    const [x, y] = place(s), towards = s[4];
    if (!towards) continue;
    const reach = Math.sign(s[3]) * Math.min(60, 12 * Math.abs(s[3]) / tolerance);
    const band = bandOf(s[3], tolerance), isSmall = report.bands[band].upper === 0.5;
    made.append(svg('line', { class: isSmall ? 'outline' : '', x1: x.toFixed(1), y1: y.toFixed(1), x2: (x + reach * towards[h]).toFixed(1), y2: (y - reach * towards[v]).toFixed(1), ...(isSmall ? {} : { stroke: bandColour(band) }), 'stroke-width': 1.5 }));
  }
  return { svg: made, factor };
}
