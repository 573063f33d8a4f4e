// Strip charts of the last ten minutes.
import {describe} from './figures.js';
import {onDraw} from './link.js';
import {find, make, number, time} from './text.js';

const POINT_PERIOD_S = 0.5;  // some hundred pixels show about a thousand points
const DRAW_PERIOD_MS = 1000;  // the lines move by less than a pixel
const MAX_GAP_S = 15;  // after a longer gap (hidden page, lost link) the page requests the history
const RECENT_S = 20;  // every value of this time is on the scale
const MAX_OFF_SCALE = 0.15;  // share of the earlier values that may be off the scale, at either end
const MAX_TICKS = 3;  // a chart is as high as three or four lines of text
const TICK_STEPS = [1, 2, 3, 5, 10, 20];  // times a power of ten
const COLOURS = ['--first', '--second', '--third', '--fourth'];
const STYLES = ['first', 'second', 'third', 'fourth'];
const TITLES = {error: 'receiver error [deg]', rate: 'axis rates [deg/s]', torque: 'motor torques [Nm]',
                level: 'signal level [dB-Hz]'};
const CHARTS = {
  error: [['cross-elevation', 'cross_elevation'], ['elevation', 'elevation']],
  rate: [['azimuth', 'azimuth_rate'], ['elevation', 'elevation_rate']],
  torque: [['az 1', 'azimuth_motor_1'], ['az 2', 'azimuth_motor_2'], ['el 1', 'elevation_motor_1'],
           ['el 2', 'elevation_motor_2']],
  level: [['C/N0', 'level']],
};
const SLEWED = ['error', 'rate'];  // charts in which a slew would hide the tracking
const TIMED = 'level';  // the lowest chart, which has the times of all

function colour(name) { return getComputedStyle(document.documentElement).getPropertyValue(name).trim(); }

function row(now) {
  const [azimuth, elevation] = now.axes;
  const torques = [0, 1, 2, 3].map((i) => now.torques[i] ?? null);
  return [now.t, now.receiver[0], now.receiver[1], azimuth.error, elevation.error, azimuth.rate, elevation.rate,
          ...torques, now.receiver[2]];
}

// Draw lines at 0.05 and 0.1 beamwidths on the chart of the errors.
function marks(plot, beamwidth) {
  if (!beamwidth) return;
  const {ctx, bbox} = plot;
  ctx.save();
  ctx.strokeStyle = colour('--dim');
  ctx.setLineDash([2, 4]);
  ctx.beginPath();
  for (const share of [-0.1, -0.05, 0.05, 0.1]) {
    const y = plot.valToPos(share * beamwidth, 'y', true);
    if (y < bbox.top || y > bbox.top + bbox.height) continue;
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
  }
  ctx.stroke();
  ctx.restore();
}

// Return the lowest and the highest value to show of lines over the times t, null for a missing value. A slew leaves the
// scale after RECENT_S, so that it does not hide the tracking: earlier values are on the scale only if they are near
// most of them.
export function shownRange(t, lines) {
  const known = lines.flatMap((line) => line.map((value, i) => [value, t[i]])).filter(([value]) => value !== null);
  if (!known.length) return [null, null];
  const sorted = known.map(([value]) => value).sort((a, b) => a - b);
  const cut = Math.floor(MAX_OFF_SCALE * sorted.length);
  const [low, high] = [sorted[cut], sorted[sorted.length - 1 - cut]];
  const kept = known.filter(([value, at]) => at > t.at(-1) - RECENT_S
                                             || (value >= 2 * low - high && value <= 2 * high - low));
  return [Math.min(...kept.map(([value]) => value)), Math.max(...kept.map(([value]) => value))];
}

// Return two or three round numbers between two others: an axis with one label has no scale.
export function ticks(low, high) {
  const unit = 10 ** Math.floor(Math.log10((high - low) / (MAX_TICKS + 1)));
  const ends = (step) => [Math.ceil(low / step / unit), Math.floor(high / step / unit)];
  const step = TICK_STEPS.find((each) => ends(each)[1] - ends(each)[0] < MAX_TICKS);
  const [first, last] = ends(step);
  return Array.from({length: last - first + 1}, (_, i) => (first + i) * step * unit);
}

// Return the texts of ticks, with as many decimals as their step has.
export function tickTexts(values) {
  const digits = Math.max(0, -Math.floor(Math.log10(values[1] - values[0]) + 1e-6));
  return values.map((value) => number(value, digits));
}

class Chart {
  constructor(name, series, beamwidth) {
    this.place = find(`chart-${name}`);
    const axis = {stroke: colour('--dim'), grid: {stroke: colour('--edge'), width: 1}, ticks: {show: false},
                  font: '12px system-ui, sans-serif'};
    const heading = this.place.parentElement.querySelector('h2');
    series.forEach(([label], i) => heading.appendChild(make('i', STYLES[i], label)));
    this.plot = new uPlot({
      ...this.size(), cursor: {show: false}, legend: {show: false}, padding: [8, 22, 0, 0],
      scales: {x: {time: false}, y: {range: (plot, low, high) => Chart.range(
        ...(SLEWED.includes(name) ? shownRange(plot.data[0], plot.data.slice(1)) : [low, high]))}},
      axes: [{...axis, size: name === TIMED ? 19 : 5, gap: 1, space: 72,
              values: (plot, values) => values.map((value) => (name === TIMED ? time(value) : ''))},
             {...axis, size: 50, gap: 3, space: 1, splits: (plot, side, low, high) => ticks(low, high),
              values: (plot, values) => tickTexts(values)}],
      series: [{}, ...series.map((_, i) => ({stroke: colour(COLOURS[i]), width: 1.2, points: {show: false}}))],
      hooks: name === 'error' ? {drawAxes: [(plot) => marks(plot, beamwidth())]} : {},
    }, [[], ...series.map(() => [])], this.place);
    new ResizeObserver(() => this.plot.setSize(this.size())).observe(this.place);
  }

  static range(low, high) {
    if (low === null || high === null) return [-1, 1];
    const margin = Math.max(0.08 * (high - low), 1e-3 * Math.max(Math.abs(low), Math.abs(high)), 1e-6);
    return [low - margin, high + margin];
  }

  size() { return {width: Math.max(this.place.clientWidth, 60), height: Math.max(this.place.clientHeight, 30)}; }
}

export function begin() {
  let beamwidth = 0;
  let span = 600;
  let columns = null;
  let data = [];  // one array for each column of the history
  let last = -Infinity;
  let drawn = -Infinity;
  const charts = Object.entries(CHARTS).map(
    ([name, series]) => ({series, chart: new Chart(name, series, () => beamwidth)}));

  // Return the text alternative of a chart: the last number of each line, and its range.
  function text(series) {
    return series.map(([label, column]) => {
      const values = columns ? data[columns.indexOf(column)] : [];
      const found = values.filter((value) => value !== null);
      if (!found.length) return `${label} unknown`;
      const [low, high] = [found.reduce((a, b) => Math.min(a, b)), found.reduce((a, b) => Math.max(a, b))];
      return `${label} ${number(values.at(-1), 3)}, in ten minutes ${number(low, 3)} to ${number(high, 3)}`;
    }).join('; ');
  }
  for (const [name, series] of Object.entries(CHARTS)) describe(`chart-${name}`, TITLES[name], () => text(series));

  function redraw() {
    const end = data[0].at(-1) ?? 0;
    const begin = Math.max(end - span, data[0][0] ?? 0);
    for (const {series, chart} of charts) {
      const used = [data[0], ...series.map(([, column]) => data[columns.indexOf(column)])];
      chart.plot.batch(() => {
        chart.plot.setData(used, true);
        chart.plot.setScale('x', {min: Math.min(begin, end - 1), max: end});
      });
    }
  }

  async function fetchHistory() {
    const rows = await fetch('history', {cache: 'no-store'}).then((answer) => answer.json()).catch(() => null);
    if (rows === null) {  // no link: the next state requests the history again
      last = -Infinity;
      return;
    }
    data = columns.map((_, i) => rows.map((values) => values[i]));
    last = data[0].at(-1) ?? -Infinity;
    redraw();
  }

  onDraw((sections) => {
    if (sections.fixed) {
      beamwidth = sections.fixed.beamwidth;
      span = sections.fixed.span;
      if (!columns) {
        columns = sections.fixed.history;
        data = columns.map(() => []);
        fetchHistory();
      }
    }
    const now = sections.now;
    if (!now || !columns) return;
    if (now.t < last || now.t > last + MAX_GAP_S) {  // also after a move of the slider of a recording
      last = now.t;
      fetchHistory();
      return;
    }
    if (now.t - last < POINT_PERIOD_S) return;
    last = now.t;
    row(now).forEach((value, i) => data[i].push(value));
    const old = data[0].findIndex((t) => t >= last - span);
    if (old > 50) data.forEach((values) => values.splice(0, old));
    if (performance.now() - drawn < DRAW_PERIOD_MS) return;
    drawn = performance.now();
    redraw();
  });
}
