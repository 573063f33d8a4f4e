// Angles, errors, rates and travel of the axes, the signal level, and the dial of the receiver errors.
import {onDraw} from './link.js';
import {draw, set, show} from './svg.js';
import {find, number, setText, time} from './text.js';

const AXES = ['az', 'el'];
const LIMIT_WARNING_S = 20;  // time to a limit
const TRAIL_POINTS = 25;  // of the dial
const DIAL_RADIUS_BEAMWIDTHS = 0.6;

function axisState(status, now, axis) {
  const {limit_s: limit, limited} = status.axes[axis];
  if (limited) return [`${limited} limited`, 'warn'];
  const left = parseFloat(limit);
  if (Number.isFinite(left) && left < LIMIT_WARNING_S) return [`limit in ${left.toFixed(0)} s`, 'warn'];
  if (now.axes[axis].actual === null) return ['silent', 'bad'];
  return [Math.abs(now.axes[axis].rate) < 0.002 ? 'stopped' : 'moving', ''];
}

function showAxes({now, status, fixed}) {
  AXES.forEach((name, i) => {
    const axis = now.axes[i];
    const wide = fixed && fixed.beamwidth && Math.abs(axis.error) > 0.1 * fixed.beamwidth;
    setText(find(`${name}-actual`), `${number(axis.actual, 3)}°`);
    setText(find(`${name}-commanded`), `${number(axis.commanded, 3)}°`);
    setText(find(`${name}-error`), `${number(axis.error, 4)}°`, wide ? 'warn' : '');
    setText(find(`${name}-rate`), `${number(axis.rate, 3)} °/s`);
    if (status) setText(find(`${name}-state`), ...axisState(status, now, i));
  });
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
      draw(this.svg, 'text', {x: this.x(angle), y: 24, 'text-anchor': 'middle'}, `${angle}`);
    }
    if (stow !== null) draw(this.svg, 'line', {x1: this.x(stow), x2: this.x(stow), y1: 2, y2: 13, class: 'stow'});
    this.commanded = draw(this.svg, 'line', {y1: 1, y2: 14, class: 'there'});
    this.actual = draw(this.svg, 'line', {y1: 1, y2: 14, class: 'here'});
  }

  show({actual, commanded}) {
    if (!this.actual) return;
    for (const [line, angle] of [[this.actual, actual], [this.commanded, commanded]]) {
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
    for (const [name, mark, y] of [['loss', loss, 40], ['lock', detect, 27]]) {
      if (mark === null || mark === undefined) continue;
      draw(this.svg, 'line', {x1: this.x(mark), x2: this.x(mark), y1: 1, y2: y - 8, class: 'mark'});
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
    const unit = 100 / DIAL_RADIUS_BEAMWIDTHS;
    for (const [share, label] of [[0.1, '0.1'], [0.5, '0.5 beamwidth']]) {
      draw(this.svg, 'circle', {cx: 0, cy: 0, r: share * unit, class: 'ring'});
      draw(this.svg, 'text', {x: 4, y: -share * unit - 3}, label);
    }
    draw(this.svg, 'line', {x1: -100, x2: 100, y1: 0, y2: 0, class: 'line'});
    draw(this.svg, 'line', {x1: 0, x2: 0, y1: -100, y2: 100, class: 'line'});
    draw(this.svg, 'text', {x: 108, y: -5, 'text-anchor': 'end'}, 'cross-el');
    draw(this.svg, 'text', {x: 4, y: 107}, 'el');
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

export function begin() {
  const travels = AXES.map((name) => new Travel(`${name}-travel`));
  const level = new Level();
  const dial = new Dial();
  onDraw((sections, state) => {
    if (!sections.now) return;
    showAxes(state);
    const fixed = state.fixed || {};
    travels.forEach((travel, i) => {
      const limits = fixed.limits && fixed.limits[i];
      if (limits && limits[0] !== null) travel.scale(limits, fixed.stow[i]);
      travel.show(sections.now.axes[i]);
    });
    const [x, y, strength] = sections.now.receiver;
    level.show(strength, x !== null, fixed);
    dial.show([x, y], fixed.beamwidth);
    setText(find('time'), time(sections.now.t));
  });
}
