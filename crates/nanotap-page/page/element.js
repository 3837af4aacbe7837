// New elements of the page.

/** An element with properties and children; children that are false or empty are left out. */
export function make(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children.filter(Boolean));
  return made;
}

/** Whether an element is on the screen: a film moves only there. */
export function inView(one) {
  const { width, top, bottom } = one.getBoundingClientRect();
  return width > 0 && bottom > 0 && top < innerHeight;
}

/** An element of a picture, with attributes and children. */
export function drawn(name, attributes, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}
