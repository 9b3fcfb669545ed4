// Colour maps, 256 colours each: the tables of Matplotlib as the images of the service use them; and the colour bar below images.
import { html, useMemo } from "../parts/view.js";
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

const anchorOf = (share) => (share < 0.05 ? "start" : share > 0.95 ? "end" : "middle");

// The colours of a map with round values below them, as SVG that needs no style sheet. width: pixels; without it all of the width there is.
export function Strip({ low, high, map, width = null }) {
  const stops = useMemo(() => Array.from({ length: 256 }, (_, k) => (
    html`<stop offset=${(k + 0.5) / 256} stop-color=${`#${TABLES[map].slice(6 * k, 6 * k + 6)}`} />`
  )), [map]);
  const at = (share) => (width ? share * width : `${100 * share}%`);
  return html`
    <linearGradient id=${`colours-${map}`}>${stops}</linearGradient>
    <rect width=${at(1)} height="18" fill=${`url(#colours-${map})`} stroke="#888" stroke-width="0.5" />
    ${ticks(low, high, COUNT).map((value) => {
      const share = (value - low) / (high - low);
      return html`<line x1=${at(share)} x2=${at(share)} y1="18" y2="23" stroke="#888" /><text x=${at(share)} y="36" text-anchor=${anchorOf(share)}>${value}</text>`;
    })}`;
}

// words: of the quantity and its unit.
export function ColourBar({ low, high, map, words, hidden = false }) {
  return html`<div class="colour-bar" hidden=${hidden}>
    <svg role="img" aria-label=${`Colours from ${Number(low.toPrecision(5))} to ${Number(high.toPrecision(5))}`}>
      <${Strip} low=${low} high=${high} map=${map} /></svg>
    <p class="unit">${words}</p>
  </div>`;
}
