// The night of a station that takes its passes by itself: what runs, what is queued, and what became of the others.
import {onDraw} from './link.js';
import {find, make, minute, number} from './text.js';

const AHEAD = ['running', 'queued'];

function row({case: name, begin, end, highest, state, text}) {
  const style = state === 'failed' ? 'warn' : AHEAD.includes(state) ? '' : 'past';
  const line = make('div', style);
  line.dataset.state = state;
  line.append(make(state === 'running' ? 'b' : 'em', '', state), ` ${name} `, make('em', '', 'from '),
              `${minute(begin)} to ${minute(end)}, ${number(highest, 0)}°${text ? `: ${text}` : ''}`);
  return line;
}

export function begin() {
  onDraw(({night}) => {
    if (night === undefined) return;  // no message about it since the last drawing
    find('night').hidden = !night;
    if (!night) return;
    const ahead = AHEAD.flatMap((state) => night.passes.filter((pass) => pass.state === state));
    const past = night.passes.filter((pass) => !AHEAD.includes(pass.state)).reverse();
    find('night').replaceChildren(make('div', 'now', night.now), ...[...ahead, ...past].map(row));
  });
}
