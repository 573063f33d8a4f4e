// Numbers and times as an operator reads them.

export const ABSENT = '-';

export function number(value, digits) {
  if (value === null || value === undefined || !Number.isFinite(value)) return ABSENT;
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace('-', '') : text;
}

// The time of a day in UTC, or the seconds of a recording whose time begins at 0.
export function time(seconds, digits = 0) {
  if (seconds === null || seconds === undefined) return ABSENT;
  if (seconds < 1e8) return `${seconds.toFixed(Math.max(digits, 1))} s`;
  const scale = 10 ** digits;
  return new Date(Math.floor(seconds * scale) / scale * 1000).toISOString().slice(11, digits ? 20 + digits : 19);
}

// The same to the minute, or to the second of a recording.
export function minute(seconds) { return seconds < 1e8 ? `${seconds.toFixed(0)} s` : time(seconds).slice(0, 5); }

// The day of a time in UTC.
export function day(seconds) { return new Date(1000 * seconds).toUTCString().slice(5, 11); }

// Write a text, and nothing where it is there already.
export function say(element, text, style = '') {
  if (element.textContent !== text) element.textContent = text;
  if (element.className !== style) element.className = style;
}

export const find = (id) => document.getElementById(id);

export function make(tag, style = '', text = '') {
  const element = document.createElement(tag);
  if (style) element.className = style;
  if (text) element.textContent = text;
  return element;
}
