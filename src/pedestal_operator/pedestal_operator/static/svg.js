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

// Keep the text of a figure as large as page.css states it, however the figure is scaled.
export function keepTextSize(svg) {
  const {width, height} = svg.viewBox.baseVal;
  new ResizeObserver(() => {
    const pixels = Math.min(svg.clientWidth / width, svg.clientHeight / height);
    if (pixels > 0) svg.style.setProperty('--pixel', 1 / pixels);
  }).observe(svg);
}

export function show(element, visible) { set(element, {visibility: visible ? 'visible' : 'hidden'}); }

export const points = (rows) => rows.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join(' ');
