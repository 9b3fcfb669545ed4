// Elements of the page: found by id, made, and filled.

export const at = (id) => document.getElementById(id);

export function make(tag, className, text) {
  const node = document.createElement(tag);
  if (className) node.className = className;
  if (text !== undefined) node.textContent = text;
  return node;
}

// Show the message of an error; null hides it. The page with the element may be closed already.
export function showError(id, error) {
  const place = at(id);
  if (!place) return;
  place.textContent = error ? error.message : "";
  place.hidden = !error;
}
