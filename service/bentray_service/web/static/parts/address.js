// The address of a view: #/path?query. The path names the page, the query its state.

export function parse(hash) {
  const [path, query = ""] = hash.replace(/^#/, "").split("?");
  return { path: path || "/", query: new URLSearchParams(query) };
}

// Open a page, such as "/jobs".
export function go(path) {
  if (location.hash === `#${path}`) dispatchEvent(new Event("hashchange"));
  else location.hash = `#${path}`;
}

// State the view in the address, without a step in the history and without opening the page again.
export function keepQuery(query) {
  history.replaceState(history.state, "", linkTo(parse(location.hash).path, query));
}

// Some parameters of an address.
export function pick(query, names) {
  return new URLSearchParams([...query].filter(([name]) => names.includes(name)));
}

// The address of a page with parameters, if there are any.
export const linkTo = (path, query) => `#${path}${query.size ? `?${query}` : ""}`;
