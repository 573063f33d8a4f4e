// The sky from above: north up, east to the right, the zenith in the middle.
import {describe} from './figures.js';
import {onDraw} from './link.js';
import {draw, keepTextSize, points, set, show} from './svg.js';
import {day, find, make, minute, number, setText, time} from './text.js';

const RADIUS = 96;
const ARROW = 24;     // length of the longest arrow

let shown = false;    // true while the residuals take the place of the sky

function place([azimuth, elevation]) {
  const r = RADIUS * (90 - elevation) / 90;
  const angle = azimuth * Math.PI / 180;
  return [r * Math.sin(angle), -r * Math.cos(angle)];
}

const known = ([azimuth, elevation]) => azimuth !== null && elevation !== null && elevation > -5;
const line = (rows) => points(rows.filter(known).map(place));

function grid(svg) {
  for (const elevation of [0, 30, 60]) {
    draw(svg, 'circle', {cx: 0, cy: 0, r: RADIUS * (90 - elevation) / 90, class: 'line'});
    if (elevation) draw(svg, 'text', {x: 2, y: RADIUS * (90 - elevation) / 90 - 1}, `${elevation}°`);
  }
  draw(svg, 'line', {x1: -RADIUS, x2: RADIUS, y1: 0, y2: 0, class: 'line'});
  draw(svg, 'line', {x1: 0, x2: 0, y1: -RADIUS, y2: RADIUS, class: 'line'});
  for (const [name, azimuth] of [['N', 0], ['E', 90], ['S', 180], ['W', 270]]) {
    const [x, y] = place([azimuth, -7]);
    draw(svg, 'text', {x, y: y + 3, 'text-anchor': 'middle'}, name);
  }
}

// Fill the area below a line around the horizon (edge 0), or above a line near the zenith (edge 90).
function band(svg, rows, edge, style) {
  if (!rows.length) return;
  const ring = Array.from({length: 73}, (_, i) => [5 * i, edge]);
  const path = (list) => `M${points(list.map(place))}Z`;
  draw(svg, 'path', {d: path(rows) + (edge < 45 ? path(ring) : ''), class: style});
}

function passLine(pass) {
  return words([['rise', `${time(pass.aos)} at ${number(pass.from, 0)}°`], ['highest', `${number(pass.highest, 1)}°`],
                ['set', `${time(pass.los)} at ${number(pass.to, 0)}°`],
                ['azimuth turns', `${number(pass.travel, 0)}°`],
                ['expected loss', pass.loss ? `${number(parseFloat(pass.loss), 1)} s` : 'none']]);
}

function nextLine(pass, now) {
  const other = day(pass.aos) === day(now) ? '' : `${day(pass.aos)} `;
  return words([['next', `${other}${minute(pass.aos)} to ${minute(pass.los)}`], ['', `${number(pass.highest, 0)}°`],
                ['az', `${number(pass.from, 0)}° to ${number(pass.to, 0)}°`]]);
}

function words(pairs) {
  const line = make('div');
  for (const [name, text] of pairs) {
    const part = make('span');
    part.append(make('em', '', `${name} `), text);
    line.append(part, ' ');
  }
  return line;
}

// Draw the parts that stand still, or move with the deck once a second.
function drawSky(svg, sky) {
  svg.replaceChildren();
  band(svg, sky.floor, 0, 'floor');
  band(svg, sky.top, 90, 'floor');
  for (const sector of sky.sectors) draw(svg, 'polygon', {points: line(sector), class: 'sector'});
  grid(svg);
  draw(svg, 'polyline', {points: line(sky.path), class: 'path'});
  if (sky.hole.length === 2) {
    const inside = sky.path.filter(([, , t]) => t >= sky.hole[0] && t <= sky.hole[1]);
    draw(svg, 'polyline', {points: line(inside), class: 'hole'});
    if (inside.length) draw(svg, 'text', {x: place(inside[0])[0] + 6, y: place(inside[0])[1] - 4}, 'keyhole');
  }
  if (sky.bow.length) {
    const [x, y] = place([sky.bow[0], 0]);
    draw(svg, 'line', {x1: 0.93 * x, y1: 0.93 * y, x2: 1.04 * x, y2: 1.04 * y, class: 'bow'});
    draw(svg, 'text', {x: 0.84 * x, y: 0.84 * y + 3, 'text-anchor': 'middle'}, 'bow');
  }
  if (sky.sun.length && sky.sun[1] > 0) {
    const [x, y] = place(sky.sun);
    draw(svg, 'circle', {cx: x, cy: y, r: 3.5, class: 'sun'});
    draw(svg, 'text', {x: x + 6, y: y + 3}, 'sun');
  }
}

const size = ([, , across, upward]) => Math.hypot(across, upward);
const largest = (rows) => Math.max(...rows.map(size), 1e-9);
const rms = (rows) => Math.sqrt(rows.reduce((sum, row) => sum + size(row) ** 2, 0) / (2 * rows.length));

// Draw the residuals [deg] of the pointing model in force: as arrows, and as dots whose size grows with the residual.
function drawResiduals(svg, rows) {
  svg.replaceChildren();
  grid(svg);
  for (const row of rows) {
    const [azimuth, elevation, across, upward] = row;
    const angle = azimuth * Math.PI / 180;
    const [x, y] = place([azimuth, elevation]);
    const scale = ARROW / largest(rows);
    // Cross-elevation points along the azimuth, elevation to the middle.
    const dx = scale * (across * Math.cos(angle) - upward * Math.sin(angle));
    const dy = scale * (across * Math.sin(angle) + upward * Math.cos(angle));
    const barb = (turn) => [x + 0.75 * dx - turn * 0.15 * dy, y + 0.75 * dy + turn * 0.15 * dx];
    draw(svg, 'polyline', {points: points([[x, y], [x + dx, y + dy], barb(1), [x + dx, y + dy], barb(-1)]),
                           class: 'residual'});
    draw(svg, 'circle', {cx: x, cy: y, r: 1 + 2.5 * size(row) / largest(rows), class: 'residual-place'});
  }
}

const residualLine = (rows) =>
  `rms ${number(rms(rows), 4)}°, longest arrow ${number(largest(rows), 4)}°`;

// Show the passes, and the predictions of the control unit.
function showPasses({passes, coming, station}, {status, now}) {
  const lines = passes.map(passLine);
  if (!lines.length) lines.push(make('span', 'none', 'no program track'));
  lines.push(...coming.map((pass) => nextLine(pass, now ? now.t : 0)));
  for (const text of status ? [status.keyhole, status.blockage] : []) if (text) lines.push(make('div', 'note', text));
  if (station) lines.push(words([['position', station]]));
  find('passes').replaceChildren(...lines);
}

// Return the text alternative of the plot.
function skyText({now, sky}) {
  const direction = ([azimuth, elevation]) => `azimuth ${number(azimuth, 1)}°, elevation ${number(elevation, 1)}°`;
  if (shown && sky && sky.residuals.length) {
    return `${sky.residuals.length} residuals of the pointing model in force, ${residualLine(sky.residuals)}`;
  }
  const parts = [known(now.beam) ? `beam at ${direction(now.beam)}` : 'beam unknown'];
  if (!sky) return parts[0];
  const [first, last] = [sky.path[0], sky.path.at(-1)];
  if (first) parts.push(`program track from ${direction(first)} to ${direction(last)}`);
  if (sky.hole.length === 2) parts.push(`keyhole from ${time(sky.hole[0])} to ${time(sky.hole[1])}`);
  if (sky.sectors.length) parts.push(`${sky.sectors.length} hidden sectors`);
  if (sky.sun.length && sky.sun[1] > 0) parts.push(`sun at ${direction(sky.sun)}`);
  if (sky.bow.length) parts.push(`bow at azimuth ${number(sky.bow[0], 0)}°`);
  return parts.join('; ');
}

export function begin() {
  const svg = find('sky-plot');
  keepTextSize(svg);
  describe('sky-plot', 'sky', skyText);
  const still = draw(svg, 'g', {});
  const past = draw(svg, 'polyline', {class: 'past'});
  const beam = draw(svg, 'circle', {r: 5, class: 'beam'});
  const button = find('show-residuals');
  let sky = null;
  const redraw = () => {
    const rows = sky.residuals;
    button.hidden = !rows.length;
    if (!rows.length) shown = false;
    button.setAttribute('aria-pressed', shown);
    setText(find('sky-frame'), shown ? residualLine(rows) : sky.bow.length ? 'earth angles, on a ship' : 'north up');
    if (shown) drawResiduals(still, rows);
    else drawSky(still, sky);
    show(past, !shown);
  };
  button.onclick = () => {
    shown = !shown;
    redraw();
  };
  onDraw((sections, state) => {
    if (sections.sky) {
      sky = sections.sky;
      redraw();
    }
    if (state.sky && (sections.sky || sections.status)) showPasses(state.sky, state);
    if (sections.past) set(past, {points: line(sections.past)});
    if (sections.now) {
      show(beam, known(sections.now.beam) && !shown);
      if (known(sections.now.beam)) {
        const [cx, cy] = place(sections.now.beam).map((value) => value.toFixed(1));
        set(beam, {cx, cy});
      }
    }
  });
}
