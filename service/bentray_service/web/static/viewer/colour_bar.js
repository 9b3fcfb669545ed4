// The colour bar below images: its colours, and round values at their places in the range.
import { make } from "../parts/dom.js";
import { coloursOf } from "./colormaps.js";
import { ticks } from "./plot.js";

const COUNT = 5;

// box holds a canvas of 256 × 1 pixels and .ticks.
export function showColourBar(box, low, high, map) {
  const strip = new ImageData(256, 1);
  new Uint32Array(strip.data.buffer).set(coloursOf(map));
  const canvas = box.querySelector("canvas");
  canvas.getContext("2d").putImageData(strip, 0, 0);
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `Colours from ${Number(low.toPrecision(5))} to ${Number(high.toPrecision(5))}`);
  const marks = ticks(low, high, COUNT).map((value) => {
    const share = (value - low) / (high - low);
    const mark = make("span", share < 0.05 ? "first" : share > 0.95 ? "last" : "", value);
    mark.style.left = `${100 * share}%`;
    return mark;
  });
  box.querySelector(".ticks").replaceChildren(...marks);
}
