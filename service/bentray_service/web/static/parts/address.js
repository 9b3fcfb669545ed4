// The address of a view: #/path?query, whose path names the page and whose query its state; and views of a volume as queries of pictures.

export function parse(hash) {
  const [path, query = ""] = hash.replace(/^#/, "").split("?");
  return { path: path || "/", query: new URLSearchParams(query) };
}

// Open a page, such as "/jobs".
export function go(path) {
  if (location.hash === `#${path}`) dispatchEvent(new Event("hashchange"));
  else location.hash = `#${path}`;
}

// State the view in the address, and the path if it is another one, without a step in the history and without opening the page again.
export function keepQuery(query, path = parse(location.hash).path) {
  history.replaceState(history.state, "", linkTo(path, query));
}

// Some parameters of an address.
export function pick(query, names) {
  return new URLSearchParams([...query].filter(([name]) => names.includes(name)));
}

// The address of a page with parameters, if there are any.
export const linkTo = (path, query) => `#${path}${query.size ? `?${query}` : ""}`;

// Smallest difference from the speed of water, relative to it, of a surface to render.
const MIN_CONTRAST = 0.005;

// A 3-D reconstruction as glass in water, with the refractive index of sound.
export function glassOf({ water_speed_mps: water, value_range: [lowest, highest] }) {
  const between = (speed) => Number(((water + speed) / 2).toPrecision(6));
  const index = (speed) => Number((water / speed).toPrecision(4));
  const slower = lowest < (1 - MIN_CONTRAST) * water;
  const faster = highest > (1 + MIN_CONTRAST) * water;
  if (!slower && !faster) return {};
  return {
    iso: [...(slower ? [between(lowest)] : []), ...(faster ? [between(highest)] : [])],
    outside: slower ? index(lowest) : 1,
    index: [...(slower ? [1] : []), ...(faster ? [index(highest)] : [])],
    surroundings: slower ? 1 : 0,
    elevation_deg: 35,
  };
}

// What a lit surface shows nothing of: the service refuses it beside one.
const OF_GLASS = ["index", "outside", "surroundings", "backdrop", "backdrop_distance", "squares", "fresnel", "depth", "ray_spacing"];

// A view without what it shows nothing of.
export function shownBy(view) {
  return Object.fromEntries(Object.entries(view).filter(([name]) => view.mode !== "shaded" || !OF_GLASS.includes(name)));
}

// Lists repeat their name; what is null is left to the service.
export function queryOf(view) {
  const given = Object.entries(view).filter(([, value]) => value !== null);
  return new URLSearchParams(given.flatMap(([name, value]) => [value].flat().map((one) => [name, one])));
}
