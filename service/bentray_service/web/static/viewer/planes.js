// Planes of results at a cursor; the same object for the same values, so that each is coloured once.
import { AXES, difference } from "./field.js";

export class Planes {
  // fields: of one quantity, one for each pane; spread: the standard deviation of the only pane, or null; quantity: its name.
  constructor(quantity, fields, spread) {
    Object.assign(this, { quantity, fields, spread, kept: new Map() });
  }

  get main() {
    return this.fields[0];
  }

  // What make() returns, until one of the parts changes.
  once(key, parts, make) {
    const before = this.kept.get(key);
    if (before?.parts.every((part, k) => part === parts[k])) return before.value;
    const value = make();
    this.kept.set(key, { parts, value });
    return value;
  }

  planeOf(field, key, axis, cursor) {
    const index = field.nearest(axis, cursor[AXES.indexOf(axis)]);
    return this.once(`${key} ${axis}`, [field, index], () => field.plane(axis, index));
  }

  // The plane of a pane.
  plane(number, axis, cursor) {
    return this.planeOf(this.fields[number], number, axis, cursor);
  }

  // The plane of a tile: that of its pane, minus that of the first one where the tile says so.
  shown({ number, axis, minus }, cursor) {
    const plane = this.plane(number, axis, cursor);
    if (!minus) return plane;
    const first = this.plane(0, axis, cursor);
    return this.once(`difference ${number} ${axis}`, [plane, first], () => difference(plane, first));
  }

  deviations(axis, cursor) {
    return this.spread && this.planeOf(this.spread, "deviations", axis, cursor);
  }
}
