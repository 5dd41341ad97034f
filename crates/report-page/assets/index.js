// The table of a batch: a row a part, sorted by the column whose head is clicked.
'use strict';

const rows = JSON.parse(document.getElementById('data').textContent);
const made = (name, text = '', className = '') => Object.assign(document.createElement(name), { textContent: text, className });
const rank = { failed: 0, usable: 1, good: 2 };
const number = (x, digits) => (x === 0 ? '0' : Math.abs(x) < 1e-3 || Math.abs(x) >= 1e6 ? x.toExponential(2) : Number(x.toPrecision(digits)).toString());
const figure = (k, show) => ({ value: (row) => (row.figures ? row.figures[k] : -Infinity), show: (row) => (row.figures ? show(row.figures[k]) : '–'), isNumber: true });

const columns = [
  { head: 'Part', value: (row) => row.name },
  { head: 'Verdict', value: (row) => rank[row.tone] },
  { head: 'Control points', ...figure(0, (x) => x.toLocaleString('en')) },
  { head: 'Within', ...figure(1, (x) => `${(Math.floor(1000 * x) / 10).toFixed(1)} %`) },
  { head: 'Largest', ...figure(2, (x) => number(x, 4)) },
  { head: 'Tolerance', ...figure(3, (x) => number(x, 4)) },
  { head: 'Seconds', ...figure(4, (x) => x.toFixed(1)) },
  { head: 'Why', value: (row) => row.reasons.join(' ') },
];

function nameCell(row) {
  const cell = made('td');
  const name = row.page ? Object.assign(made('a', row.name), { href: encodeURI(row.page).replace(/[?#]/g, encodeURIComponent) }) : made('b', row.name);
  if (row.picture) cell.append(Object.assign(made('img', '', 'thumb'), { src: `data:image/png;base64,${row.picture}`, alt: '' }));
  cell.append(name);
  return cell;
}

function rowOf(row) {
  const line = made('tr');
  const verdict = made('td');
  verdict.append(made('span', row.verdict, `badge ${row.tone}`));
  const reasons = made('td');
  reasons.append(...row.reasons.map((text) => made('div', text)));
  const figures = columns.filter((column) => column.isNumber).map((column) => made('td', column.show(row), 'number'));
  line.append(nameCell(row), verdict, ...figures, reasons);
  return line;
}

const table = document.getElementById('parts'), body = made('tbody'), head = made('tr');
let sorted = { column: null, isDown: false };

function sortBy(column, cell) {
  const isDown = sorted.column === column && !sorted.isDown;
  sorted = { column, isDown };
  const compared = (a, b) => (column.value(a) < column.value(b) ? -1 : column.value(a) > column.value(b) ? 1 : 0);
  body.replaceChildren(...[...rows].sort((a, b) => (isDown ? -compared(a, b) : compared(a, b))).map(rowOf));
  head.querySelectorAll('th').forEach((other) => other.removeAttribute('aria-sort'));
  cell.setAttribute('aria-sort', isDown ? 'descending' : 'ascending');
}

for (const column of columns) {
  const cell = made('th', column.head, column.isNumber ? 'number' : '');
  cell.tabIndex = 0;
  cell.onclick = () => sortBy(column, cell);
  cell.onkeydown = (event) => { if (event.key === 'Enter') cell.onclick(); };
  head.append(cell);
}
const top_ = made('thead');
top_.append(head);
body.append(...rows.map(rowOf));
table.append(top_, body);
