// A quantity on a grid, planes of it, and those of several results; lengths in mm.

export const AXES = "xyz";

export class Field {
  // values: (nx, ny[, nz]) in C order; spacing and origin per axis, mm; null for uneven heights, which are counted instead.
  constructor(values, shape, spacing, origin) {
    this.uneven = shape.length === 3 && spacing[2] === null;
    this.values = values;
    this.shape = shape;
    this.spacing = spacing.map((one) => one ?? 1);
    this.origin = origin.map((one, k) => (spacing[k] === null ? 0 : one));
    // By axis: the plane at the cursor, which stays the same object until it moves, so that each is coloured once.
    this.kept = {};
  }

  get dimension() {
    return this.shape.length;
  }

  // Axes across which planes can be shown to scale.
  get axes() {
    if (this.dimension === 2) return ["z"];
    return this.uneven ? ["z"] : ["z", "y", "x"];
  }

  count(axis) {
    return this.dimension === 3 ? this.shape[AXES.indexOf(axis)] : 1;
  }

  // The plane across an axis: its first axis to the right, its second up, values[a * nb + b].
  plane(axis, index) {
    const across = AXES.indexOf(axis);
    const [first, second] = [0, 1, 2].filter((one) => one !== across);
    const [na, nb] = [this.shape[first], this.shape[second]];
    const grid = {
      na, nb, names: [AXES[first], AXES[second]],
      spacing: [this.spacing[first], this.spacing[second]], origin: [this.origin[first], this.origin[second]],
    };
    if (this.dimension === 2) return { ...grid, values: this.values };
    const strides = [this.shape[1] * this.shape[2], this.shape[2], 1];
    const values = new Float64Array(na * nb);
    let k = 0;
    for (let a = 0; a < na; a += 1) {
      let place = a * strides[first] + index * strides[across];
      for (let b = 0; b < nb; b += 1, place += strides[second]) values[k++] = this.values[place];
    }
    return { ...grid, values };
  }

  planeAt(axis, cursor) {
    const index = this.nearest(axis, cursor[AXES.indexOf(axis)]);
    if (this.kept[axis]?.index !== index) this.kept[axis] = { index, plane: this.plane(axis, index) };
    return this.kept[axis].plane;
  }

  // Position of a node along an axis, mm; its number where the heights are uneven; 0 where there is no such axis.
  position(axis, index) {
    const k = AXES.indexOf(axis);
    return k >= this.dimension ? 0 : this.origin[k] + index * this.spacing[k];
  }

  // The node nearest to a position, within the grid.
  nearest(axis, position) {
    const k = AXES.indexOf(axis);
    if (k >= this.dimension) return 0;
    return Math.min(this.shape[k] - 1, Math.max(0, Math.round((position - this.origin[k]) / this.spacing[k])));
  }
}

// The node of a plane at a position in mm, or null outside its cells.
export function nodeAt(plane, x, y) {
  const a = Math.round((x - plane.origin[0]) / plane.spacing[0]);
  const b = Math.round((y - plane.origin[1]) / plane.spacing[1]);
  return a >= 0 && b >= 0 && a < plane.na && b < plane.nb ? [a, b] : null;
}

// Linear interpolation between the nodes of a plane; NaN outside them.
export function interpolated(plane, x, y) {
  const u = (x - plane.origin[0]) / plane.spacing[0];
  const v = (y - plane.origin[1]) / plane.spacing[1];
  const edge = 1e-9;
  if (!(u >= -edge && v >= -edge && u <= plane.na - 1 + edge && v <= plane.nb - 1 + edge)) return NaN;
  const a = Math.min(Math.max(Math.floor(u), 0), Math.max(plane.na - 2, 0));
  const b = Math.min(Math.max(Math.floor(v), 0), Math.max(plane.nb - 2, 0));
  const [p, q] = [u - a, v - b];
  const at = (i, j) => plane.values[Math.min(i, plane.na - 1) * plane.nb + Math.min(j, plane.nb - 1)];
  const mixed = (one, other, share) => (share <= edge ? one : share >= 1 - edge ? other : one * (1 - share) + other * share);
  return mixed(mixed(at(a, b), at(a, b + 1), q), mixed(at(a + 1, b), at(a + 1, b + 1), q), p);
}

// Nodes of a plane with more nodes at most, and how many times as many along an axis.
const [FINE_NODES, FINEST] = [2 ** 20, 8];
const fine = new WeakMap();

// The same plane with more nodes, linear between those that it has; beyond the outer ones, and beside missing values, as at the nearest one.
export function refined(plane) {
  if (!fine.has(plane)) fine.set(plane, refine(plane));
  return fine.get(plane);
}

function refine(plane) {
  const { na, nb, values } = plane;
  const factor = Math.min(FINEST, Math.max(1, Math.floor(Math.sqrt(FINE_NODES / (na * nb)))));
  const spacing = plane.spacing.map((step) => step / factor);
  const origin = plane.origin.map((start, k) => start - plane.spacing[k] / 2 + spacing[k] / 2);
  // Of each new node along an axis: the two old ones around it, and the share of the second.
  const between = (count) => Array.from({ length: count * factor }, (_, k) => {
    const position = Math.min(count - 1, Math.max(0, (k + 0.5) / factor - 0.5));
    return [Math.floor(position), Math.ceil(position), position % 1];
  });
  const alongB = between(nb);
  const finer = new Float64Array(na * nb * factor ** 2);
  let number = 0;
  for (const [a, a1, p] of between(na)) {
    for (const [b, b1, q] of alongB) {
      const value = (1 - p) * ((1 - q) * values[a * nb + b] + q * values[a * nb + b1]) + p * ((1 - q) * values[a1 * nb + b] + q * values[a1 * nb + b1]);
      finer[number++] = Number.isFinite(value) ? value : values[(p < 0.5 ? a : a1) * nb + (q < 0.5 ? b : b1)];
    }
  }
  return { ...plane, na: na * factor, nb: nb * factor, spacing, origin, values: finer };
}

// The limits of a plane with the halves of the cells at its border, mm: [left, right, bottom, top].
export function extent({ na, nb, spacing, origin }) {
  return [
    origin[0] - spacing[0] / 2, origin[0] + (na - 0.5) * spacing[0],
    origin[1] - spacing[1] / 2, origin[1] + (nb - 0.5) * spacing[1],
  ];
}

// One plane minus another, at the nodes of the first.
function difference(plane, other) {
  const values = new Float64Array(plane.na * plane.nb);
  for (let a = 0; a < plane.na; a += 1) {
    for (let b = 0; b < plane.nb; b += 1) {
      const [x, y] = [plane.origin[0] + a * plane.spacing[0], plane.origin[1] + b * plane.spacing[1]];
      values[a * plane.nb + b] = plane.values[a * plane.nb + b] - interpolated(other, x, y);
    }
  }
  return { ...plane, values, other };
}

const differences = new WeakMap();

// The plane of a tile at a cursor: that of its pane, minus that of the first one where the tile says so. fields: one for each pane.
export function shownPlane(fields, { number, axis, minus }, cursor) {
  const plane = fields[number].planeAt(axis, cursor);
  if (!minus) return plane;
  const first = fields[0].planeAt(axis, cursor);
  if (differences.get(plane)?.other !== first) differences.set(plane, difference(plane, first));
  return differences.get(plane);
}
