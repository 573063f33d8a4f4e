// The sky from above: north up, east to the right, the zenith in the middle.
import {onState} from './link.js';
import {draw, points, set} from './svg.js';
import {find, make, number, say, time} from './text.js';

const RADIUS = 96;

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

// What lies below a line around the horizon, or above one near the zenith.
function band(svg, rows, edge, style) {
  if (!rows.length) return;
  const ring = Array.from({length: 73}, (_, i) => [5 * i, edge]);
  const path = (list) => `M${points(list.map(place))}Z`;
  draw(svg, 'path', {d: path(rows) + (edge < 45 ? path(ring) : ''), class: style});
}

function passLine(pass) {
  const line = make('div');
  for (const [name, text] of [
    ['rise', `${time(pass.aos)} at ${number(pass.from, 0)}°`], ['highest', `${number(pass.highest, 1)}°`],
    ['set', `${time(pass.los)} at ${number(pass.to, 0)}°`], ['azimuth turns', `${number(pass.travel, 0)}°`],
    ['expected loss', pass.loss ? `${number(parseFloat(pass.loss), 1)} s` : 'none']]) {
    const part = make('span');
    part.append(make('em', '', `${name} `), text);
    line.append(part, ' ');
  }
  return line;
}

function redraw(svg, sky) {
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
  draw(svg, 'polyline', {points: line(sky.past), class: 'past'});
  if (sky.bow.length) {
    const [x, y] = place([sky.bow[0], 0]);
    draw(svg, 'line', {x1: 0.93 * x, y1: 0.93 * y, x2: 1.04 * x, y2: 1.04 * y, class: 'bow'});
    draw(svg, 'text', {x: 0.84 * x, y: 0.84 * y + 3, 'text-anchor': 'middle'}, 'bow');
  }
  if (sky.sun) {
    const [x, y] = place(sky.sun);
    draw(svg, 'circle', {cx: x, cy: y, r: 3.5, class: 'hole'});
    draw(svg, 'text', {x: x + 6, y: y + 3}, 'sun');
  }
}

// What the control unit announces, on ship and ashore.
function ahead(told) {
  for (const text of told ? [told.keyhole, told.blockage] : []) {
    if (text) find('passes').appendChild(make('div', 'note', text));
  }
}

export function begin() {
  const svg = find('sky-plot');
  let beam = null;
  onState((came, state) => {
    if (came.sky) {
      redraw(svg, came.sky);
      beam = draw(svg, 'circle', {r: 5, class: 'beam'});
      const lines = came.sky.passes.map(passLine);
      find('passes').replaceChildren(...lines.length ? lines : [make('span', 'none', 'no program track')]);
      ahead(state.told);
      say(find('sky-frame'), came.sky.bow.length ? 'earth angles, on a ship' : 'north up');
    }
    if ((came.now || came.sky) && beam) {
      const there = state.now && known(state.now.beam);
      beam.style.display = there ? '' : 'none';
      const [cx, cy] = there ? place(state.now.beam) : [0, 0];
      set(beam, {cx, cy});
    }
  });
}
