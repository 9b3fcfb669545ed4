// The colour bar below images: its colours, and round values at their places in the range.
import { html, useLayoutEffect, useRef } from "../parts/view.js";
import { coloursOf } from "./colormaps.js";
import { ticks } from "./plot.js";

const COUNT = 5;

const sideOf = (share) => (share < 0.05 ? "first" : share > 0.95 ? "last" : "");

// words: of the quantity and its unit.
export function ColourBar({ low, high, map, words, hidden = false }) {
  const strip = useRef(null);
  useLayoutEffect(() => {
    const image = new ImageData(256, 1);
    new Uint32Array(image.data.buffer).set(coloursOf(map));
    strip.current.getContext("2d").putImageData(image, 0, 0);
  }, [map]);
  const marks = ticks(low, high, COUNT).map((value) => [value, (value - low) / (high - low)]);
  return html`<div class="colour-bar" hidden=${hidden}>
    <canvas width="256" height="1" ref=${strip} role="img" aria-label=${`Colours from ${Number(low.toPrecision(5))} to ${Number(high.toPrecision(5))}`}></canvas>
    <div class="ticks">${marks.map(([value, share]) => html`<span class=${sideOf(share)} style=${{ left: `${100 * share}%` }}>${value}</span>`)}</div>
    <p class="unit">${words}</p>
  </div>`;
}
