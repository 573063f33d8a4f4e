// Angles, errors, rates and travel of the axes, the signal level, and the dial of the receiver errors.
import {describe} from './figures.js';
import {onDraw, state} from './link.js';
import {draw, keepTextSize, set, show} from './svg.js';
import {find, number, setText} from './text.js';

const AXES = ['az', 'el'];
const TRAIL_POINTS = 25;  // of the dial
const DIAL_RADIUS_BEAMWIDTHS = 0.6;

function showAxes({now, status, fixed}) {
  AXES.forEach((name, i) => {
    const axis = now.axes[i];
    const wide = fixed && fixed.beamwidth && Math.abs(axis.error) > 0.1 * fixed.beamwidth;
    setText(find(`${name}-actual`), `${number(axis.actual, 3)}°`);
    setText(find(`${name}-commanded`), `${number(axis.commanded, 3)}°`);
    setText(find(`${name}-error`), `${number(axis.error, 4)}°`, wide ? 'warn' : '');
    setText(find(`${name}-encoder`), `${number(axis.encoder, 3)}°`);
    setText(find(`${name}-rate`), `${number(axis.rate, 3)} °/s`);
    if (status) setText(find(`${name}-state`), status.axes[i].text, status.axes[i].level);
  });
  // Without a pointing model the encoders show the direction of the beam.
  const encoders = find('encoder');
  encoders.hidden = !(status && status.model);
  encoders.title = status ? status.model : '';
}

// A bar from limit to limit. Its scale is in degrees and shows whole turns.
class Travel {
  constructor(id) {
    this.svg = find(id);
    this.limits = null;
  }

  scale(limits, stow) {
    const key = JSON.stringify([limits, stow, this.svg.clientWidth]);
    if (key === this.limits || !this.svg.clientWidth) return;
    this.limits = key;
    this.svg.replaceChildren();
    const [low, high] = limits;
    const margin = 0.04 * (high - low);
    const width = this.svg.clientWidth;
    this.x = (angle) => (angle - low + margin) / (high - low + 2 * margin) * width;
    draw(this.svg, 'rect', {x: 0, y: 3, width, height: 9, class: 'bar'});
    draw(this.svg, 'rect', {x: this.x(low), y: 3, width: this.x(high) - this.x(low), height: 9, class: 'reach'});
    const step = high - low > 400 ? 180 : high - low > 200 ? 90 : 30;
    for (let angle = Math.ceil(low / step) * step; angle <= high; angle += step) {
      draw(this.svg, 'line', {x1: this.x(angle), x2: this.x(angle), y1: 12, y2: 15, class: 'mark'});
      draw(this.svg, 'text', {x: this.x(angle), y: 27, 'text-anchor': 'middle'}, `${angle}`);
    }
    if (stow !== null) draw(this.svg, 'line', {x1: this.x(stow), x2: this.x(stow), y1: 2, y2: 13, class: 'stow'});
    this.commanded = draw(this.svg, 'line', {y1: 1, y2: 14, class: 'there'});
    this.actual = draw(this.svg, 'line', {y1: 1, y2: 14, class: 'here'});
  }

  // The limits are encoder angles.
  show({encoder, error}) {
    if (!this.actual) return;
    const commanded = encoder === null || error === null ? null : encoder + error;
    for (const [line, angle] of [[this.actual, encoder], [this.commanded, commanded]]) {
      show(line, angle !== null);
      if (angle === null) continue;
      const x = this.x(angle).toFixed(1);
      set(line, {x1: x, x2: x});
    }
  }
}

class Level {
  constructor() {
    this.svg = find('level-bar');
    this.drawn = null;
  }

  scale(high, detect, loss) {
    const width = this.svg.clientWidth;
    const key = JSON.stringify([width, high, detect, loss]);
    if (key === this.drawn || !width) return;
    this.drawn = key;
    const low = 20;
    this.x = (value) => Math.max(0, Math.min(width, (value - low) / (high - low) * width));
    this.svg.replaceChildren();
    draw(this.svg, 'rect', {x: 0, y: 3, width, height: 11, class: 'bar'});
    this.bar = draw(this.svg, 'rect', {x: 0, y: 3, width: 0, height: 11, class: 'reach'});
    for (const [name, mark, y] of [['loss', loss, 42], ['lock', detect, 28]]) {
      if (mark === null || mark === undefined) continue;
      draw(this.svg, 'line', {x1: this.x(mark), x2: this.x(mark), y1: 1, y2: y - 10, class: 'mark'});
      draw(this.svg, 'text', {x: this.x(mark) + 2, y}, `${name} ${mark.toFixed(0)}`);
    }
  }

  show(level, locked, {detect, loss}) {
    this.scale(Math.max(80, 10 * Math.ceil((level || 0) / 10)), detect, loss);
    if (!this.drawn) return;
    set(this.bar, {width: level === null ? 0 : this.x(level).toFixed(0)});
    setText(find('level'), `${number(level, 1)} dB-Hz`);
    setText(find('lock'), locked ? '● locked' : '○ no lock', locked ? '' : 'warn');
  }
}

// Direction of the target from the beam in beamwidths: cross-elevation to the right, elevation up.
class Dial {
  constructor() {
    this.svg = find('dial');
    keepTextSize(this.svg);
    const unit = 100 / DIAL_RADIUS_BEAMWIDTHS;
    for (const [share, label] of [[0.1, '0.1'], [0.5, '0.5 beamwidths']]) {
      draw(this.svg, 'circle', {cx: 0, cy: 0, r: share * unit, class: 'ring'});
      draw(this.svg, 'text', {x: 0, y: -share * unit - 4, 'text-anchor': 'middle', class: 'minor'}, label);
    }
    draw(this.svg, 'line', {x1: -100, x2: 100, y1: 0, y2: 0, class: 'line'});
    draw(this.svg, 'line', {x1: 0, x2: 0, y1: -100, y2: 100, class: 'line'});
    draw(this.svg, 'text', {x: 108, y: -5, 'text-anchor': 'end', class: 'minor'}, 'cross-el');
    draw(this.svg, 'text', {x: 4, y: 107, class: 'minor'}, 'el');
    this.trail = draw(this.svg, 'polyline', {class: 'trail'});
    this.spot = draw(this.svg, 'circle', {r: 4, class: 'beam'});
    this.none = draw(this.svg, 'text', {x: 0, y: 45, 'text-anchor': 'middle'}, 'no error signal');
    this.past = [];
  }

  show([x, y], beamwidth) {
    const visible = x !== null && y !== null && beamwidth;
    show(this.none, !visible);
    show(this.spot, visible);
    show(this.trail, visible);
    if (!visible) { this.past = []; return; }
    const unit = 100 / DIAL_RADIUS_BEAMWIDTHS;
    const place = [x, -y].map((error) => Math.max(-105, Math.min(105, error / beamwidth * unit)).toFixed(1));
    this.past.push(place.join(','));
    this.past = this.past.slice(-TRAIL_POINTS);
    set(this.spot, {cx: place[0], cy: place[1]});
    set(this.trail, {points: this.past.join(' ')});
  }
}

const angle = (value) => `${number(value, 2)}°`;

function travelText({now, fixed}, i) {
  const {actual, commanded} = now.axes[i];
  const limits = fixed && fixed.limits[i][0] !== null ? `, limits ${fixed.limits[i].map(angle).join(' and ')}` : '';
  return `actual ${angle(actual)}, commanded ${angle(commanded)}${limits}`;
}

function levelText({now, fixed}) {
  const {detect, loss} = fixed || {};
  return `${number(now.receiver[2], 1)} dB-Hz, lock at ${number(detect, 0)}, loss at ${number(loss, 0)}`;
}

function dialText({now, fixed}) {
  const [x, y] = now.receiver;
  if (x === null || y === null || !fixed || !fixed.beamwidth) return 'no error signal';
  const [cross, elevation] = [x, y].map((error) => number(error / fixed.beamwidth, 2));
  return `cross-elevation ${cross}, elevation ${elevation} beamwidths`;
}

export function begin() {
  describe('az-travel', 'azimuth travel', (state) => travelText(state, 0));
  describe('el-travel', 'elevation travel', (state) => travelText(state, 1));
  describe('level-bar', 'signal level', levelText);
  describe('dial', 'direction of the target from the beam', dialText);
  const travels = AXES.map((name) => new Travel(`${name}-travel`));
  const level = new Level();
  const dial = new Dial();
  function showFigures({now, fixed}) {
    const constants = fixed || {};
    travels.forEach((travel, i) => {
      const limits = constants.limits && constants.limits[i];
      if (limits && limits[0] !== null) travel.scale(limits, constants.stow[i]);
      travel.show(now.axes[i]);
    });
    level.show(now.receiver[2], now.receiver[0] !== null, constants);
  }
  const resized = new ResizeObserver(() => { if (state.now) showFigures(state); });
  for (const id of ['axes', 'level-bar']) resized.observe(find(id));
  onDraw((sections) => {
    if (!sections.now) return;
    showAxes(state);
    showFigures(state);
    dial.show(state.now.receiver, (state.fixed || {}).beamwidth);
  });
}
