// Opens a report page and the page of a batch in Chromium, from files and without a network, uses them, and looks at what is drawn.
//
// node check.mjs PAGE.html [INDEX.html]; CHROMIUM names the browser if it is not found. Without one it says so and ends well.

import { existsSync } from 'node:fs';
import { mkdtemp, readFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

const browsers = [process.env.CHROMIUM, '/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'];
const executablePath = browsers.find((path) => path && existsSync(path));
const [pagePath, indexPath] = process.argv.slice(2);
if (!pagePath) {
  console.error('usage: node check.mjs PAGE.html [INDEX.html]');
  process.exit(2);
}
if (!executablePath) {
  console.log('skipped: no Chromium here (apt-get install chromium, or name one in CHROMIUM)');
  process.exit(0);
}
const { chromium } = await import('playwright-core');

/** Milliseconds from the start of parsing to the first frame that are allowed, drawn without a graphics card. */
const MOST_TO_FIRST_FRAME = Number(process.env.MOST_TO_FIRST_FRAME || 2000);

let failures = 0;
function check(what, holds, found = '') {
  if (!holds) failures += 1;
  console.log(`${holds ? 'ok  ' : 'FAIL'} ${what}${found === '' ? '' : `: ${found}`}`);
}

const browser = await chromium.launch({ executablePath, args: ['--no-sandbox'] });

/** A page of the browser; what it complains of and asks for is kept. */
async function opened(path, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, acceptDownloads: true, ...options });
  const page = await context.newPage();
  const complaints = [], requests = [];
  page.on('console', (message) => { if (['error', 'assert'].includes(message.type())) complaints.push(message.text()); });
  page.on('pageerror', (error) => complaints.push(error.message));
  page.on('request', (request) => { if (!/^(file|data|blob):/.test(request.url())) requests.push(request.url()); });
  await page.goto(pathToFileURL(resolve(path)).href);
  return { page, complaints, requests, close: () => context.close() };
}

/** Shares of the pixels of the viewer that are blue, orange, neutral and light, and dark lines, as they are seen. */
async function colours(page) {
  return page.evaluate(async () => {
    const canvas = document.getElementById('canvas');
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    const copy = Object.assign(document.createElement('canvas'), { width: canvas.width, height: canvas.height });
    const context = copy.getContext('2d');
    context.drawImage(canvas, 0, 0);
    const { data } = context.getImageData(0, 0, copy.width, copy.height);
    const found = { drawn: 0, blue: 0, orange: 0, neutral: 0, dark: 0 };
    for (let i = 0; i < data.length; i += 4) {
      if (data[i + 3] < 200) continue;
      const [r, g, b] = [data[i], data[i + 1], data[i + 2]];
      found.drawn += 1;
      if (b > r + 25) found.blue += 1;
      else if (r > b + 25) found.orange += 1;
      else if (r < 90) found.dark += 1;
      else found.neutral += 1;
    }
    return found;
  });
}

const text = (page, id) => page.locator(`#${id}`).innerText();
const settled = (page) => page.waitForTimeout(700);

async function checkPage() {
  const { page, complaints, requests, close } = await opened(pagePath);
  await page.waitForSelector('html[data-ready]', { timeout: 60000 });
  const report = await page.evaluate(() => JSON.parse(document.getElementById('data').textContent));
  const firstFrame = Number(await page.evaluate(() => document.documentElement.dataset.firstFrame));
  check('the viewer draws', await page.evaluate(() => document.documentElement.classList.contains('drawn')), await text(page, 'readout'));
  check(`the first frame comes within ${MOST_TO_FIRST_FRAME} ms`, firstFrame > 0 && firstFrame <= MOST_TO_FIRST_FRAME, `${firstFrame} ms`);
  check('the verdict stands at the head', (await text(page, 'verdict')) === report.headline.verdict, report.headline.verdict);
  const signs = await text(page, 'signs');
  check('the legend says what signs mean', report.signed ? /Positive .*Negative/.test(signs) : /^Unsigned/.test(signs), signs);

  const before = await colours(page);
  check('the scan and lines are drawn', before.drawn > 20000 && before.neutral > 5000 && before.dark > 100, JSON.stringify(before));
  await page.fill('#tolerance', String(report.tolerance / 8));
  await page.locator('#tolerance').blur();
  await settled(page);
  const tighter = await colours(page);
  check('a smaller tolerance shows more colour', tighter.blue + tighter.orange > 1.5 * (before.blue + before.orange) + 100, JSON.stringify(tighter));
  check('and a smaller share within', parseFloat(await text(page, 'share')) < 99.9, await text(page, 'share'));
  await page.click('#tolerance-reset');

  const box = await page.locator('#canvas').boundingBox();
  let readout = '';
  for (const [x, y] of [[0.5, 0.5], [0.45, 0.55], [0.55, 0.45], [0.4, 0.4], [0.6, 0.6], [0.5, 0.35]]) {
    await page.mouse.click(box.x + x * box.width, box.y + y * box.height);
    readout = await text(page, 'readout');
    if (/^D/.test(readout) && / at /.test(readout)) break;
  }
  check('a click tells the distance and the place', /^(Deviation|Distance) [+−]?[\d.e−]+ \S+ \([\d.e−]+ tolerances\) at /.test(readout), readout);

  const sectionAxis = report.upper.map((x, k) => x - report.lower[k]).reduce((best, x, k, all) => (x > all[best] ? k : best), 0);
  await page.selectOption('#section-axis', String(sectionAxis));
  await settled(page);
  const cut = await colours(page);
  check('a section takes a part away', cut.drawn < 0.9 * before.drawn && cut.drawn > 0.05 * before.drawn, `${cut.drawn} of ${before.drawn}`);
  check('and shows a curve', (await page.locator('#section-plot circle').count()) > 5, await page.locator('#section-plot circle').count());
  await page.selectOption('#section-axis', '');

  await checkPlaces(page, report);
  await page.click('[data-view=home]');
  await page.click('#show-reflects');
  await settled(page);
  const reflecting = await colours(page);
  check('reflection lines are dark and light', reflecting.dark > 3 * before.dark + 1000 && reflecting.neutral > 1000, JSON.stringify(reflecting));
  check('no complaint', complaints.length === 0, complaints.join('; '));
  check('no request', requests.length === 0, requests.join(' '));
  await close();
}

async function checkPlaces(page, report) {
  if (!report.worst.length) return;
  await page.locator('#worst tbody tr').first().click();
  await settled(page);
  const readout = await text(page, 'readout');
  check('the worst place is flown to', readout.startsWith('1: '), readout);
  const label = await page.locator('.label.chosen').boundingBox(), stage = await page.locator('#viewer').boundingBox();
  const off = label ? Math.hypot(label.x + label.width / 2 - stage.x - stage.width / 2, label.y + label.height / 2 - stage.y - stage.height / 2) : Infinity;
  check('and stands in the middle', off < 15, `${off.toFixed(1)} pixels off`);
  const [download] = await Promise.all([page.waitForEvent('download'), page.click('#worst-csv')]);
  const path = join(await mkdtemp(join(tmpdir(), 'page-')), 'worst.csv');
  await download.saveAs(path);
  const lines = (await readFile(path, 'utf8')).trim().split('\n');
  check('worst places come as CSV', lines[0] === 'number,x,y,z,deviation,what' && lines.length === 1 + report.worst.length, `${lines.length} lines`);
}

async function checkDark() {
  const { page, close } = await opened(pagePath, { colorScheme: 'dark' });
  await page.waitForSelector('html[data-ready]', { timeout: 60000 });
  const shades = await page.evaluate(() => [getComputedStyle(document.body).backgroundColor, getComputedStyle(document.body).color]);
  const light = (colour) => colour.match(/\d+/g).slice(0, 3).reduce((sum, x) => sum + Number(x), 0) / 3;
  check('dark where dark is asked for', light(shades[0]) < 60 && light(shades[1]) > 180, shades.join(' and '));
  const pdf = await page.pdf({ format: 'A4' });
  check('prints', pdf.length > 20000, `${pdf.length} bytes`);
  await close();
}

/** A browser without WebGL. */
async function checkFallback() {
  const context = await browser.newContext();
  const page = await context.newPage();
  await page.addInitScript(() => { HTMLCanvasElement.prototype.getContext = () => null; });
  await page.goto(pathToFileURL(resolve(pagePath)).href);
  await page.waitForSelector('html[data-ready]', { timeout: 60000 });
  const readout = await text(page, 'readout');
  check('without WebGL there is a picture', await page.locator('#picture').isVisible() && /picture/.test(readout), readout);
  await context.close();
}

async function checkIndex() {
  const { page, complaints, requests, close } = await opened(indexPath);
  const tones = () => page.locator('#parts tbody .badge').evaluateAll((all) => all.map((badge) => ['failed', 'usable', 'good'].findIndex((tone) => badge.classList.contains(tone))));
  const found = await tones();
  check('a batch has its failures first', found.length > 0 && found.every((x, i) => i === 0 || x >= found[i - 1]), found.join(' '));
  await page.locator('#parts th', { hasText: 'Part' }).click();
  const names = await page.locator('#parts tbody td:first-child').allInnerTexts();
  const sorted = [...names].sort((a, b) => (a.trim() < b.trim() ? -1 : 1));
  check('and is sorted by name on a click', names.join() === sorted.join(), names.map((name) => name.trim()).join(', '));
  check('no complaint', complaints.length === 0, complaints.join('; '));
  check('no request', requests.length === 0, requests.join(' '));
  const link = page.locator('#parts a').first();
  if (await link.count()) {
    await link.click();
    await page.waitForSelector('html[data-ready]', { timeout: 60000 });
    check('its links lead to pages', (await page.locator('#verdict').count()) === 1);
  }
  await close();
}

await checkPage();
await checkDark();
await checkFallback();
if (indexPath) await checkIndex();
await browser.close();
console.log(failures ? `${failures} checks failed` : 'all checks hold');
process.exit(failures ? 1 : 0);
