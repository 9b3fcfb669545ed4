// Position, node and value under the pointer or the cursor, in a line.
import { html } from "../parts/view.js";
import { AXES, nodeAt, shownPlane } from "./field.js";
import { shown } from "./quantities.js";

function valueAt(plane, x, y) {
  const node = nodeAt(plane, x, y);
  return { node, value: node ? plane.values[node[0] * plane.nb + node[1]] : NaN };
}

// tile: the image; place: in it, mm; other: whether the right one of two images is shown there; spoken: whether a key moved the cursor;
// apart: whether each pane is read.
export function Readout({ quantity, fields, panes, cursor, tile, place: [x, y], other, spoken, apart }) {
  const { axis, number } = tile;
  const field = fields[number];
  const plane = shownPlane(fields, tile, cursor);
  const [across, up] = plane.names;
  const words = [`${across} ${x.toFixed(2)} mm`, `${up} ${y.toFixed(2)} mm`];
  const k = AXES.indexOf(axis);
  const slice = field.nearest(axis, cursor[k]);
  if (field.dimension === 3 && !(field.uneven && axis === "z")) words.splice(k, 0, `${axis} ${field.position(axis, slice).toFixed(2)} mm`);
  const { node, value } = valueAt(other ? fields[tile.other].planeAt(axis, cursor) : plane, x, y);
  const worded = (found) => `${shown(found, quantity)} ${quantity.unit}`;
  if (apart) {
    panes.forEach(({ title }, pane) => words.push(`${title}: ${worded(valueAt(fields[pane].planeAt(axis, cursor), x, y).value)}`));
  } else {
    words.push(worded(value));
    if (node) words.push(`node ${(field.dimension === 3 ? [...node.slice(0, k), slice, ...node.slice(k)] : node).join(", ")}`);
  }
  return html`<p class="readout" aria-live=${spoken ? "polite" : "off"} data-value=${value} data-x=${x} data-y=${y} data-node=${node ? node.join(",") : ""}>
    ${words.join(" · ")}
  </p>`;
}
