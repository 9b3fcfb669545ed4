// The quantities of a result: names, units, colours, and where their values come from.
import { respond } from "../parts/api.js";
import { Field } from "./field.js";
import { parseNpy } from "./npy.js";

// Decibels per centimetre of one neper per metre.
const DB_CM_OF_NP_M = 20 / Math.LN10 / 100;

// Quantities of which the uncertainty is known.
export const FADED = ["speed", "error"];

export const QUANTITIES = {
  speed: { title: "Speed", words: "sound speed", unit: "m/s", map: "viridis", digits: 2, reads: ["speed"] },
  coverage: { title: "Coverage", words: "ray length per node", unit: "m", map: "magma", digits: 4, reads: ["coverage"], least: 0 },
  recovery: {
    title: "Resolution", words: "recovered fraction of a checkerboard", unit: "", map: "bone", digits: 3, reads: ["recovery"],
    limits: [0, 1],
  },
  uncertainty: {
    title: "Uncertainty", words: "standard deviation of the speed", unit: "m/s", map: "inferno", digits: 2, reads: ["uncertainty"],
    least: 0,
  },
  reflection: {
    title: "Reflection", words: "reflection, envelope relative to its maximum", unit: "dB", map: "gray", digits: 1,
    reads: ["reflection"], limits: [-50, 0],
  },
  error: {
    title: "Difference to truth", words: "speed minus true speed", unit: "m/s", map: "RdBu_r", digits: 2, reads: ["speed", "truth"],
    symmetric: true,
  },
  value: { title: "Values", words: "value", unit: "", map: "gray", digits: 3, reads: ["value"] },
  truth: { title: "Truth", words: "true sound speed", unit: "m/s", map: "viridis", digits: 2, reads: ["truth"] },
  attenuation: {
    title: "Attenuation (experimental)", words: "attenuation, experimental", unit: "dB/cm", map: "cividis", digits: 4,
    reads: ["attenuation"], factor: DB_CM_OF_NP_M,
  },
};

// The map of a quantity above another one, which is grey: with no grey in it.
export const overMapOf = ({ map }) => (["gray", "bone", "cividis"].includes(map) ? "plasma" : map);

// A number with the digits of its quantity.
export function shown(value, { digits }) {
  if (!Number.isFinite(value)) return "no value";
  return Math.abs(value) !== 0 && Math.abs(value) < 10 ** -digits ? value.toExponential(3) : value.toFixed(digits);
}

// The names of the quantities that a result with these stored quantities has.
export function shownOf(stored) {
  return Object.keys(QUANTITIES).filter((name) => QUANTITIES[name].reads.every((one) => stored.includes(one)));
}

async function bytesOf(address, onProgress) {
  const response = await respond(address);
  const total = Number(response.headers.get("Content-Length")) || 0;
  if (!total) return response.arrayBuffer();
  const bytes = new Uint8Array(total);
  let done = 0;
  const reader = response.body.getReader();
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    bytes.set(part.value, done);
    done += part.value.length;
    onProgress(done / total);
  }
  return bytes.buffer;
}

// The values of one result, read once each.
export class Values {
  // grids: of quantities with a grid of their own, by name.
  constructor(volume, grids = {}) {
    this.volume = volume;
    this.grids = grids;
    this.read = new Map();
  }

  stored(name, onProgress) {
    if (!this.read.has(name)) {
      // An upload has nothing but its values.
      const quantity = name === "value" ? "" : `&quantity=${name}`;
      const reading = bytesOf(`${this.volume.links.data}?format=npy${quantity}`, onProgress).then(parseNpy);
      reading.catch(() => this.read.delete(name));
      this.read.set(name, reading);
    }
    return this.read.get(name);
  }

  // A quantity as a field, in its unit.
  async field(name, onProgress = () => {}) {
    const { reads, factor } = QUANTITIES[name];
    const [first, second] = await Promise.all(reads.map((one) => this.stored(one, onProgress)));
    let { values } = first;
    if (second) values = values.map((value, k) => value - second.values[k]);
    if (factor) values = values.map((value) => value * factor);
    const millimetres = (lengths) => lengths.map((one) => (one === null ? null : 1e3 * one));
    const grid = this.grids[name] ?? this.volume;
    return new Field(values, first.shape, millimetres(grid.spacing_m), millimetres(grid.origin_m));
  }
}
