// The colour bar below images: its colours, and five values of the range.
import { make } from "../parts/dom.js";
import { coloursOf } from "./colormaps.js";

const SHARES = [0, 0.25, 0.5, 0.75, 1];

// box holds a canvas of 256 × 1 pixels and .ticks.
export function showColourBar(box, low, high, map) {
  const strip = new ImageData(256, 1);
  new Uint32Array(strip.data.buffer).set(coloursOf(map));
  box.querySelector("canvas").getContext("2d").putImageData(strip, 0, 0);
  const marks = SHARES.map((share) => make("span", "", Number((low + share * (high - low)).toPrecision(5))));
  box.querySelector(".ticks").replaceChildren(...marks);
}
