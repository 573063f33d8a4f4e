// Drawing in SVG: every shape is a class of page.css.

const NAMESPACE = 'http://www.w3.org/2000/svg';

export function draw(parent, tag, attributes, text) {
  const element = document.createElementNS(NAMESPACE, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  parent.appendChild(element);
  return element;
}

// Set what is not so already.
export function set(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (element.getAttribute(name) !== String(value)) element.setAttribute(name, value);
  }
}

export function show(element, there) { set(element, {visibility: there ? 'visible' : 'hidden'}); }

export const points = (rows) => rows.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join(' ');
