// Text alternatives of the figures: their present numbers, for screen readers.
import {age, condition, state} from './link.js';
import {set} from './svg.js';
import {find} from './text.js';

const PERIOD_MS = 1000;
const figures = [];

// Give a figure a name, and the text that numbers(state) returns.
export function describe(id, name, numbers) {
  figures.push({id, name, numbers});
  set(find(id), {role: 'img', 'aria-label': name});
}

export function begin() {
  setInterval(() => {
    if (!state.now || document.hidden) return;
    const old = condition() === 'live' ? '' : `${age().toFixed(0)} s ago: `;
    for (const {id, name, numbers} of figures) set(find(id), {'aria-label': `${name}: ${old}${numbers(state)}`});
  }, PERIOD_MS);
}
