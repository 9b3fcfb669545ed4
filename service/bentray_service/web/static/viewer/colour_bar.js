// Colour maps, 256 colours each: the tables of Matplotlib as the images of the service use them; and the colour bar below images.
import { html, useLayoutEffect, useRef } from "../parts/view.js";
import { ticks } from "./plot.js";

// Hexadecimal colours without separators, by the name of the map; see test_colormaps.py.
const TABLES = await (await fetch(new URL("./colormaps.json", import.meta.url))).json();

export const NAMES = Object.keys(TABLES);
// Values beside the colours.
const COUNT = 5;

const made = new Map();

// The colours of a map, as 256 pixels of ImageData in the byte order of this machine.
export function coloursOf(name) {
  if (!made.has(name)) {
    const bytes = new Uint8ClampedArray(1024);
    for (let k = 0; k < 256; k += 1) {
      for (let c = 0; c < 3; c += 1) bytes[4 * k + c] = parseInt(TABLES[name].slice(6 * k + 2 * c, 6 * k + 2 * c + 2), 16);
      bytes[4 * k + 3] = 255;
    }
    made.set(name, new Uint32Array(bytes.buffer));
  }
  return made.get(name);
}

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
