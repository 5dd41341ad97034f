// Puts the report on the page, and connects what can be clicked with the viewer.
'use strict';

const byId = (id) => document.getElementById(id);
const made = (name, text = '', className = '') => {
  const element = document.createElement(name);
  element.textContent = text;
  if (className) element.className = className;
  return element;
};
const withUnit = (x) => `${digits(x)} ${unitSymbol}`;
const signedUnit = (x) => `${report.signed && x > 0 ? '+' : ''}${withUnit(x)}`;

/** What can change on the page. */
const state = { tolerance: report.tolerance, viewer: null, labels: [], chosen: -1, picked: null, section: { axis: null, at: 0, side: 1 } };

// ---- what stands on the page whatever the browser can draw

function tableOf(element, rows) {
  element.replaceChildren(...rows.map((cells) => {
    const row = made('tr');
    row.append(...cells.map((cell) => (cell instanceof Node ? cell : made('td', cell))));
    return row;
  }));
}

function fillText() {
  byId('verdict').classList.add(report.headline.tone);
  byId('figures').replaceChildren(...report.headline.figures.map(({ name, value }) => {
    const pair = made('div');
    pair.append(made('dt', name), made('dd', value));
    return pair;
  }));
  document.querySelectorAll('.unit').forEach((element) => { element.textContent = unitSymbol; });
  byId('signs').textContent = report.signs;
  byId('shares-note').textContent = report.sharesNote;
  tableOf(byId('facts'), report.facts.map(({ name, value }) => [name, value]));
  tableOf(byId('options'), report.options.map(({ name, value }) => [name, value]));
  fillReasons();
  fillWorst();
  byId('convergence-card').hidden = !report.steps.length;
  if (report.steps.length) byId('convergence').replaceChildren(convergence());
  if (report.tried.length) {
    const table = made('table');
    const [head, ...rows] = report.tried;
    tableOf(table, [head.map((cell) => made('th', cell)), ...rows]);
    byId('tried').append(table);
  }
}

function fillReasons() {
  const list = made('ul');
  for (const { tone, text, place } of report.reasons) {
    const item = made('li', `${text} `, '');
    item.prepend(made('b', `${tone}: `, tone));
    if (place) {
      const button = made('button', 'show', 'place');
      button.onclick = () => state.viewer && goTo(toScene(place));
      item.append(button);
    }
    list.append(item);
  }
  for (const text of report.warnings) {
    const item = made('li', text);
    item.prepend(made('b', 'note: ', 'usable'));
    list.append(item);
  }
  byId('reasons').replaceChildren(list.children.length ? list : made('p', 'As it was asked for, with nothing to look at.'));
}

function fillWorst() {
  const head = made('thead'), body = made('tbody'), row = made('tr');
  const written = alike(Math.max(...report.worst.map((worst) => Math.abs(worst.deviation))));
  row.append(made('th', '#'), made('th', unitSymbol, 'number'), made('th', 'what'));
  head.append(row);
  report.worst.forEach(({ what, deviation, place }, i) => {
    const entry = made('tr');
    entry.tabIndex = 0;
    entry.title = `At ${coordinates(place)}`;
    const sign = report.signed && deviation > 0 ? '+' : '';
    entry.append(made('td', i + 1), made('td', sign + written(deviation), 'number'), made('td', what));
    entry.onclick = () => state.viewer && goTo(toScene(place), i);
    entry.onkeydown = (event) => { if (event.key === 'Enter') entry.onclick(); };
    body.append(entry);
  });
  byId('worst').replaceChildren(head, body);
  if (!report.worst.length) byId('worst').replaceChildren(made('caption', 'None.'));
  byId('worst-csv').disabled = !report.worst.length;
  byId('worst-csv').onclick = () => {
    const quoted = (text) => `"${text.replaceAll('"', '""')}"`;
    const lines = report.worst.map((w, i) => [i + 1, ...w.place, w.deviation, quoted(w.what)].join(','));
    const text = ['number,x,y,z,deviation,what', ...lines, ''].join('\n');
    const link = made('a');
    link.href = URL.createObjectURL(new Blob([text], { type: 'text/csv' }));
    link.download = `${report.headline.title.replace(/\.[^.]*$/, '')}.worst.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  };
}

// ---- what follows the tolerance

function shareWithin(tolerance) {
  const all = report.quantiles;
  return all.length ? all.filter((x) => Math.abs(x) <= tolerance).length / all.length : 1;
}

function fillLegend() {
  const all = report.quantiles, counts = report.bands.map(() => 0);
  for (const x of all) counts[bandOf(x, state.tolerance)]++;
  const rows = [];
  for (let i = report.bands.length - 1; i >= 0; i--) {
    const upper = report.bands[i].upper, lower = i ? report.bands[i - 1].upper : null;
    if (!report.signed && upper !== null && upper < 0) continue;
    const isMiddle = upper !== null && lower !== null && upper + lower === 0;
    if (!report.signed && upper !== null && upper <= 0) continue;
    const written = alike(4 * state.tolerance, 3), of = (x) => written(x * state.tolerance);
    const sign = (x) => (report.signed && x > 0 ? '+' : '') + of(x);
    const text = upper === null ? `over ${sign(lower)}` : lower === null ? `under ${sign(upper)}`
      : isMiddle ? (report.signed ? `±${of(upper)}` : `up to ${of(upper)}`) : `${sign(lower)} to ${sign(upper)}`;
    const swatch = made('td'), colour = made('i');
    colour.style.background = bandColour(i);
    swatch.append(colour);
    rows.push([swatch, text, made('td', all.length ? `${(100 * counts[i] / all.length).toFixed(1)} %` : '')]);
  }
  tableOf(byId('legend'), rows);
}

function fillPercentiles() {
  const all = report.quantiles;
  if (!all.length) return;
  const sizes = all.map(Math.abs).sort((a, b) => a - b);
  // In thousandths, millionths or thousands of the unit where that takes fewer digits.
  const power = sizes.at(-1) > 0 ? 3 * Math.floor(Math.log10(sizes.at(-1) * 10) / 3) : 0;
  const written = alike(sizes.at(-1) / 10 ** power);
  const at = (list, share) => written(list[Math.round(share * (list.length - 1))] / 10 ** power);
  const unit = power ? `10${[...String(power)].map((c) => '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'['-0123456789'.indexOf(c)]).join('')} ${unitSymbol}` : unitSymbol;
  const shares = [0.01, 0.05, 0.5, 0.95, 0.99];
  const rows = [[unit, ...shares.map((s) => `${Math.round(100 * s)} %`), 'most'].map((cell) => made('th', cell))];
  if (report.signed) rows.push(['signed', ...shares.map((s) => at(all, s)), at(all, 1)]);
  rows.push([report.signed ? 'size' : 'distance', ...shares.map((s) => at(sizes, s)), at(sizes, 1)]);
  tableOf(byId('percentiles'), rows);
}

function setTolerance(tolerance) {
  if (!(tolerance > 0)) return;
  state.tolerance = tolerance;
  byId('tolerance').value = Number(tolerance.toPrecision(4));
  byId('tolerance-slider').value = Math.log10(tolerance / report.tolerance);
  byId('share').textContent = `${percent(shareWithin(tolerance))} ${report.sharesOf} within.`;
  fillLegend();
  byId('histogram').replaceChildren(histogram(tolerance));
  if (state.viewer) {
    state.viewer.set('tolerance', tolerance);
    later('plane', () => { if (!byId('plane-card').hidden) drawPlane(byId('plane'), state.viewer.parts, state.tolerance); });
    later('section', showSectionPlots);
  }
}

const waiting = new Map();
/** Does something a moment later, once for all that asked for it until then. */
function later(name, work) {
  clearTimeout(waiting.get(name));
  waiting.set(name, setTimeout(work, 40));
}

// ---- the viewer

function fillLayers(viewer) {
  const counts = (of) => viewer.parts.reduce((sum, part) => sum + of(part), 0);
  const shown = counts((part) => part.deviations.length), all = report.parts.reduce((sum, part) => sum + part.points, 0);
  const hasTriangles = counts((part) => part.triangles.length) > 0;
  const decimated = shown < all ? `${shown.toLocaleString('en')} of ${all.toLocaleString('en')}` : shown.toLocaleString('en');
  const layers = [
    ['scan', hasTriangles ? 'Scan' : 'Scan points', true, hasTriangles ? '' : decimated],
    ['points', 'Points of the scan', false, decimated],
    ['surface', 'Surface', true, ''],
    ['cells', 'Patches and cells', true, ''],
    ['net', 'Control net', false, counts((part) => part.control.length / 3).toLocaleString('en')],
    ['set-aside', 'Set aside as outliers', true, counts((part) => part.setAside.length).toLocaleString('en')],
    ['left-out', 'Left out before the fit', false, counts((part) => part.leftOut.length / 3).toLocaleString('en')],
  ];
  const boxes = {};
  const add = (id, text, isOn, count, change) => {
    const label = made('label'), box = made('input');
    Object.assign(box, { type: 'checkbox', id: `show-${id}`, checked: isOn });
    box.onchange = () => change(box.checked);
    label.append(box, made('span', text), made('span', count, 'count'));
    byId('layers').append(label);
    boxes[id] = box;
    change(isOn);
  };
  for (const [layer, text, isOn, count] of layers) {
    if (viewer.layers.has(layer)) add(layer, text, isOn, count, (is) => viewer.show(layer, is));
  }
  add('reflects', 'Reflection lines', false, '', (is) => {
    viewer.set('reflects', is);
    if (!boxes.scan || boxes.scan.checked !== is) return;
    // Reflections are on the surface: the scan before it would hide them.
    boxes.scan.checked = !is;
    boxes.scan.onchange();
  });
  add('beyond', 'Only beyond the tolerance', false, '', (is) => viewer.set('onlyBeyond', is));
  add('labels', 'Numbers of worst places', true, '', (is) => { byId('labels').hidden = !is; });
  if (viewer.parts.length > 1) addPartChoice(viewer);
}

/** One of several parts can be looked at alone. */
function addPartChoice(viewer) {
  const label = made('label', 'Part'), choice = made('select');
  choice.id = 'part';
  choice.append(...['all', ...viewer.parts.map((part) => part.name)].map((name) => made('option', name)));
  choice.onchange = () => { viewer.isolate(choice.selectedIndex - 1); later('section', showSectionPlots); };
  label.append(choice);
  byId('layers').append(label);
}

function showLabels() {
  const { viewer } = state;
  state.labels.forEach(({ element, place, facing, part }) => {
    if (place && facing) element.classList.toggle('behind', viewer.facesAway(place, facing));
    const isShown = part === undefined || !(viewer.isolated >= 0) || part === viewer.isolated;
    const at = place && isShown && viewer.onScreen(place);
    element.hidden = !at;
    if (at) element.style.transform = `translate(${at[0].toFixed(1)}px, ${at[1].toFixed(1)}px)`;
  });
}

function makeLabels() {
  state.labels = report.worst.map(({ place }, i) => {
    const at = toScene(place);
    const { normal, part } = state.viewer.nearest(at);
    return { element: made('span', i + 1, 'label'), place: at, facing: normal, part };
  });
  state.labels.push({ element: made('span', '', 'label picked'), place: null });
  byId('labels').replaceChildren(...state.labels.map(({ element }) => element));
}

function choose(number) {
  state.labels.forEach(({ element }, i) => element.classList.toggle('chosen', i === number));
}

function goTo(place, number = -1) {
  choose(number);
  state.viewer.flyTo(place);
  if (number >= 0) {
    const { deviation, what } = report.worst[number];
    byId('readout').textContent = `${number + 1}: ${signedUnit(deviation)}, ${what}, at ${coordinates(fromScene(place))}`;
  }
  byId('viewer').scrollIntoView({ block: 'nearest', behavior: 'smooth' });
}

/** A click that is no drag tells the distance there. */
function listenForPicks(viewer) {
  let down = null;
  viewer.canvas.addEventListener('pointerdown', (event) => { down = [event.clientX, event.clientY]; });
  viewer.canvas.addEventListener('pointerup', (event) => {
    if (!down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 4 || event.button !== 0) return;
    const box = viewer.canvas.getBoundingClientRect();
    const found = viewer.pick(event.clientX - box.left, event.clientY - box.top);
    state.labels.at(-1).place = found && found.place;
    byId('readout').textContent = found
      ? `${report.signed ? 'Deviation' : 'Distance'} ${signedUnit(found.deviation)} (${digits(Math.abs(found.deviation) / state.tolerance, 3)} tolerances) at ${coordinates(fromScene(found.place))}`
      : 'Nothing of the scan is there.';
    choose(-1);
    viewer.isStale = true;
  });
}

function listenForViews(viewer) {
  const last = {};
  document.querySelectorAll('[data-view]').forEach((button) => {
    button.onclick = () => {
      const view = button.dataset.view;
      if (view === 'home') { viewer.home(); return; }
      last[view] = -(last[view] || -1);
      const k = 'xyz'.indexOf(view), eye = [0, 0, 0], up = [0, 0, 0];
      eye[k] = last[view];
      up[k === 2 ? 1 : 2] = 1;
      viewer.look(eye, up);
    };
  });
}

// ---- the section

function listenForSection(viewer) {
  const [axis, slider, flip] = [byId('section-axis'), byId('section-slider'), byId('section-flip')];
  const update = () => {
    const k = axis.value === '' ? null : Number(axis.value);
    slider.disabled = flip.disabled = k === null;
    state.section.axis = k;
    byId('section-card').hidden = k === null;
    if (k === null) {
      byId('section-place').textContent = '';
      viewer.set('section', new THREE.Vector4(0, 0, 0, 1));
    } else {
      const real = report.lower[k] + Number(slider.value) * (report.upper[k] - report.lower[k]);
      const place = fromScene([0, 0, 0]);
      place[k] = real;
      state.section.at = toScene(place)[k];
      byId('section-place').textContent = `${'xyz'[k]} = ${digits(real)}`;
      const normal = [0, 0, 0];
      normal[k] = state.section.side;
      viewer.set('section', new THREE.Vector4(...normal, state.section.side * state.section.at + 1e-4));
    }
    later('section', showSectionPlots);
  };
  axis.onchange = slider.oninput = update;
  flip.onclick = () => { state.section.side *= -1; update(); };
}

/** Samples of the scan along a plane: where its triangles cross it, or points near it. */
function sectionSamples(part, axis, at, spacing) {
  if (part.triangles.length) {
    return sectionOf(part.points, part.triangles, part.deviations, axis, at).map((ends) => [...ends.slice(0, 4), null]);
  }
  const found = [];
  for (let i = 0; i < part.deviations.length; i++) {
    if (part.isAside[i] || Math.abs(part.points[3 * i + axis] - at) > spacing) continue;
    found.push([part.points[3 * i], part.points[3 * i + 1], part.points[3 * i + 2], part.deviations[i], null]);
  }
  return found;
}

function showSectionPlots() {
  const { viewer, section: { axis, at } } = state;
  const line = viewer.sectionLine;
  if (axis === null) {
    line.geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(0), 3));
    viewer.isStale = true;
    return;
  }
  const cuts = viewer.shownParts().map((part) => ({ part, pieces: sectionOf(part.vertices, part.faces, null, axis, at) }));
  const pieces = cuts.flatMap((cut) => cut.pieces);
  line.geometry.setAttribute('position', new THREE.BufferAttribute(Float32Array.from(pieces.flatMap((p) => [...p.slice(0, 3), ...p.slice(4, 7)])), 3));
  viewer.isStale = true;
  const chains = chained(pieces);
  let samples = cuts.flatMap(({ part }) => sectionSamples(part, axis, at, 1.2 * viewer.spacing));
  const step = Math.max(1, Math.ceil(samples.length / 2500));
  samples = samples.filter((_, i) => i % step === 0);
  byId('section-plot').replaceChildren(chains.length && samples.length
    ? sectionPlot(along(chains, samples), state.tolerance) : document.createTextNode('The plane misses the surface here.'));
  const few = samples.filter((_, i) => i % Math.max(1, Math.ceil(samples.length / 500)) === 0);
  for (const sample of few) sample[4] = viewer.normalNear(sample);
  if (!chains.length) { byId('section-profile').replaceChildren(); return; }
  const { svg: profile, factor } = profilePlot(chains, few, axis, state.tolerance);
  byId('section-scale').textContent = digits(factor, 2);
  byId('section-profile').replaceChildren(profile);
}

// ---- from the beginning

/** Lines in the colours of the page. */
function followColours(viewer) {
  const apply = () => {
    const style = getComputedStyle(document.documentElement);
    const rgb = (name) => {
      const hex = style.getPropertyValue(name).trim().slice(1);
      return [0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
    };
    viewer.ink('cells', rgb('--cell'));
    viewer.ink('section', rgb('--failed'));
    viewer.ink('net', rgb('--net'));
    viewer.ink('left-out', rgb('--left-out'));
    if (!byId('plane-card').hidden) drawPlane(byId('plane'), viewer.parts, state.tolerance);
  };
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', apply);
  apply();
}

function fallBack(error) {
  byId('readout').textContent = `No view to turn here (${error.message}): this is a picture from when the page was written.`;
  byId('controls').querySelectorAll('#layers, fieldset:has(#section-axis)').forEach((element) => { element.hidden = true; });
  byId('views').hidden = true;
  byId('plane-card').hidden = true;
}

async function start() {
  fillText();
  byId('tolerance').onchange = () => setTolerance(Number(byId('tolerance').value));
  byId('tolerance-slider').oninput = () => setTolerance(report.tolerance * 10 ** Number(byId('tolerance-slider').value));
  byId('tolerance-reset').onclick = () => setTolerance(report.tolerance);
  setTolerance(report.tolerance);
  fillPercentiles();
  try {
    if (typeof DecompressionStream === 'undefined') throw new Error('the browser cannot decompress');
    const viewer = new Viewer(byId('canvas'), await readArrays());
    state.viewer = viewer;
    byId('plane-card').hidden = !viewer.parts.some((part) => part.cells && part.cells.length);
    fillLayers(viewer);
    makeLabels();
    viewer.onDraw = showLabels;
    document.documentElement.classList.add('drawn');
    viewer.draw();
    // Asking for a pixel waits until the picture is there.
    const gl = viewer.renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    document.documentElement.dataset.firstFrame = Math.round(performance.now() - parsingStart);
    listenForPicks(viewer);
    listenForViews(viewer);
    listenForSection(viewer);
    followColours(viewer);
    viewer.run();
  } catch (error) {
    fallBack(error);
  }
  document.documentElement.dataset.ready = 'yes';
}

start();
