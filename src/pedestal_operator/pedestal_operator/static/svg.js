// Drawing in SVG: page.css has a class for every shape.

const NAMESPACE = 'http://www.w3.org/2000/svg';

export function draw(parent, tag, attributes, text) {
  const element = document.createElementNS(NAMESPACE, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  parent.appendChild(element);
  return element;
}

// Set the attributes that have changed.
export function set(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (element.getAttribute(name) !== String(value)) element.setAttribute(name, value);
  }
}

export function show(element, visible) { set(element, {visibility: visible ? 'visible' : 'hidden'}); }

export const points = (rows) => rows.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join(' ');
