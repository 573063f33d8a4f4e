// Numbers and times as text for the operator.

export const ABSENT = '-';

export function number(value, digits) {
  if (value === null || value === undefined || !Number.isFinite(value)) return ABSENT;
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace('-', '') : text;
}

// Return the number in a decimal text with a point or a comma, null for any other text.
export function decimal(text) {
  const plain = text.trim().replace('\u2212', '-').replace(',', '.');
  return /^[+-]?(\d+\.?\d*|\.\d+)$/.test(plain) ? Number(plain) : null;
}

// Return the time of day in UTC, or the seconds of a recording that begins at 0.
export function time(seconds, digits = 0) {
  if (seconds === null || seconds === undefined) return ABSENT;
  if (seconds < 1e8) return `${seconds.toFixed(Math.max(digits, 1))} s`;
  const scale = 10 ** digits;
  return new Date(Math.floor(seconds * scale) / scale * 1000).toISOString().slice(11, digits ? 20 + digits : 19);
}

// Return the time of day to the minute, or the full seconds of a recording.
export function minute(seconds) { return seconds < 1e8 ? `${seconds.toFixed(0)} s` : time(seconds).slice(0, 5); }

// Return the day of a time in UTC.
export function day(seconds) { return new Date(1000 * seconds).toUTCString().slice(5, 11); }

// Set text and style of an element if they have changed.
export function setText(element, text, style = '') {
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
