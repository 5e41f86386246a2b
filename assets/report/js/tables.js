// Figures: large ones on top, all of them in tables below.

function element(tag, className, ...children) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  made.append(...children);
  return made;
}

/** A figure's name and its unit, which the name ends with in brackets. */
function splitUnit(name) {
  const [, what, unit] = /^(.*?)(?: \(([^()]*)\))?$/.exec(name);
  return [what.charAt(0).toUpperCase() + what.slice(1), unit ?? ''];
}

/** A status as words: visible-set-shrank → visible set shrank. */
const words = (status) => String(status).replaceAll('-', ' ');

function summary({ report, size }) {
  const { n_frames, n_points, iterations, solver, seconds, status } = report;
  return [
    `${n_frames} frames of ${size.join(' × ')}`,
    `${n_points.toLocaleString('en')} points`,
    `${iterations} steps of ${words(solver)} in ${seconds.toFixed(1)} s`,
    words(status),
  ].join(' · ');
}

function fillHeadlines(list, { rows, headlines }) {
  for (const row of headlines) {
    const { name, initial, last } = rows[row];
    const [what, unit] = splitUnit(name);
    const before = element('span', 'initial', `${initial == null ? '–' : brief(+initial)} →`);
    const value = element('span', 'last', brief(+last) + (unit === 'deg' ? '°' : ''));
    const rest = element('span', 'unit', unit === 'deg' ? '' : unit);
    list.append(element('div', 'headline', element('dt', '', what), element('dd', '', before, value, rest)));
  }
}

function fillRow(body, cells) {
  const [first, ...others] = cells;
  const head = element('th', '', first);
  head.scope = 'row';
  body.append(element('tr', '', head, ...others.map((cell) => element('td', '', cell))));
}

function fillMetrics(body, rows) {
  for (const { name, initial, last } of rows) {
    const [what, unit] = splitUnit(name);
    fillRow(body, [what, initial ?? '–', last ?? '–', unit]);
  }
}

const mean = (values) => values.reduce((sum, x) => sum + x, 0) / values.length;

/** Standard deviations, where the solver knows them. */
function uncertaintyRows({ uncertainty }) {
  if (!uncertainty) return [];
  const rows = [
    ['Rotation', mean(uncertainty.rotation_sigma_deg), 'deg'],
    ['Relative rotation', mean(uncertainty.relative_rotation_sigma_deg), 'deg'],
    ['Translation', mean(uncertainty.translation_sigma), 'diagonals'],
    ['Point', uncertainty.point_sigma_mean, 'diagonals'],
  ];
  return rows.filter(([, value]) => isFinite(value)).map(([name, value, unit]) => [name, brief(value), unit]);
}

function hypothesisRows({ report, kept }) {
  return report.hypotheses.map(({ status, confidence, objectives, cost }, i) => [
    i === kept ? `${i + 1} (kept, replayed here)` : String(i + 1),
    brief(confidence),
    brief(objectives[objectives.length - 1]),
    brief(cost),
    words(status),
  ]);
}

function fillTables(report) {
  const body = (id) => document.querySelector(`#${id} tbody`);
  fillMetrics(body('metrics'), report.rows);
  const uncertainty = uncertaintyRows(report.report);
  uncertainty.forEach((row) => fillRow(body('sigmas'), row));
  document.getElementById('sigmas').hidden = uncertainty.length === 0;
  hypothesisRows(report).forEach((row) => fillRow(body('hypotheses'), row));
}
