// Colour maps: 256 colours each, the tables of Matplotlib as the images of the service use them.

// Hexadecimal colours without separators, by the name of the map; see test_colormaps.py.
const TABLES = await (await fetch(new URL("./colormaps.json", import.meta.url))).json();

export const NAMES = Object.keys(TABLES);

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
