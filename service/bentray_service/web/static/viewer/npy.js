// Arrays of NumPy files, with their values as they are.

const TYPES = {
  f8: Float64Array, f4: Float32Array, u1: Uint8Array, i1: Int8Array, u2: Uint16Array, i2: Int16Array, u4: Uint32Array, i4: Int32Array,
};

// { values, shape } of a file in C order.
export function parseNpy(buffer) {
  const view = new DataView(buffer);
  if (buffer.byteLength < 12 || view.getUint32(0) !== 0x934e554d) throw new Error("The values are not a NumPy file");
  const long = view.getUint8(6) > 1;
  const start = long ? 12 : 10;
  const end = start + (long ? view.getUint32(8, true) : view.getUint16(8, true));
  const header = new TextDecoder("latin1").decode(new Uint8Array(buffer, start, end - start));
  const kind = /'descr':\s*'[<|](\w+)'/.exec(header)?.[1];
  const shape = /'shape':\s*\(([^)]*)\)/.exec(header)?.[1].split(",").filter((one) => one.trim()).map(Number);
  if (!TYPES[kind] || !shape || !/'fortran_order':\s*False/.test(header)) throw new Error(`Values of an unknown layout: ${header.trim()}`);
  return { values: new TYPES[kind](buffer, end), shape };
}

// Little-endian 32-bit numbers in base64, as the service writes them in JSON.
export function float32Of(text) {
  const view = new DataView(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
  return Float32Array.from({ length: view.byteLength / 4 }, (_, k) => view.getFloat32(4 * k, true));
}
