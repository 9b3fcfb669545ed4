// Elements of the page by id.

export const at = (id) => document.getElementById(id);

// Show the message of an error; null hides it.
export function showError(id, error) {
  at(id).textContent = error ? error.message : "";
  at(id).hidden = !error;
}
