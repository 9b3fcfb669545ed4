// One plane as an image: its colours on a canvas, zoom and pan in mm; over it scale bar, cursor, and what is measured.
import { html, useLayoutEffect, useMemo, useSize } from "../parts/view.js";
import { coloursOf } from "./colour_bar.js";
import { extent, refined } from "./field.js";

const MISSING = 0xffe4e4e4;
// Of the width of the canvas at most, for the scale bar; and the share of the canvas that the image fills.
const BAR_SHARE = 0.3;
const FILL = 0.97;
// Of the value beside a measure, pixels of the page at most.
const WORDS = 96;

// A canvas with a pixel for each node. deviations: a plane of the same nodes that fades what is not known, or null; above: whether it lies above
// another plane, which is seen where values are missing, and where they are below the limits if `clear`.
function coloured({ plane, low, high, map, deviations = null, above = false, clear = false }) {
  const { na, nb, values } = plane;
  const image = new ImageData(na, nb);
  const pixels = new Uint32Array(image.data.buffer);
  const colours = coloursOf(map);
  const scale = 256 / (high - low);
  const missing = above ? 0 : MISSING;
  for (let a = 0; a < na; a += 1) {
    for (let b = 0; b < nb; b += 1) {
      const value = values[a * nb + b];
      const step = Math.floor((value - low) * scale);
      const place = (nb - 1 - b) * na + a;
      pixels[place] = Number.isFinite(value) ? colours[Math.min(255, Math.max(0, step))] : missing;
      if (clear && value < low) pixels[place] = 0;
      // Opaque where it is known, clear where two standard deviations reach half the range of the colours.
      if (deviations) image.data[4 * place + 3] = 255 * (1 - (4 * deviations.values[a * nb + b]) / (high - low));
    }
  }
  const bitmap = Object.assign(document.createElement("canvas"), { width: na, height: nb });
  bitmap.getContext("2d").putImageData(image, 0, 0);
  return bitmap;
}

// A round length of at most this many mm: 1, 2 or 5 of a power of ten.
function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return Math.max(...[0.5, 1, 2, 5].map((step) => step * power).filter((one) => one <= most));
}

// Where a plane is on a canvas of this size, pixels of the page.
export function geometryOf({ plane, centre, zoom, other, swipe }, width, height) {
  const [left, right, bottom, top] = extent(plane);
  const scale = FILL * Math.min(width / (right - left), height / (top - bottom)) * zoom;
  return geometryAt(centre ?? [(left + right) / 2, (bottom + top) / 2], scale, width, height, other ? swipe * width : Infinity);
}

// scale: pixels for a millimetre; centre: mm; border: right of which another plane is shown, Infinity without one.
export function geometryAt([x, y], scale, width, height, border) {
  return {
    scale,
    centre: [x, y],
    border,
    // Position in mm of a point of the canvas, and back.
    toPlane: (px, py) => [x + (px - width / 2) / scale, y - (py - height / 2) / scale],
    toCanvas: (mx, my) => [width / 2 + (mx - x) * scale, height / 2 - (my - y) * scale],
  };
}

// The planes of a look, see useImage, over each other, each with its bitmap.
export function layersOf({ plane, other, over, deviations, low, high, map, interpolation }) {
  const finer = interpolation === "linear" ? refined : (given) => given;
  const layers = [{ plane, low, high, map, deviations: deviations && finer(deviations) }];
  if (other) layers.push({ plane: other, low, high, map, beside: true });
  if (over) layers.push({ ...over, above: true });
  return layers.map((layer) => ({ ...layer, bitmap: coloured({ ...layer, plane: finer(layer.plane) }) }));
}

// ratio: pixels of the canvas for one of the page.
export function draw(canvas, layers, { interpolation, opacity }, { toCanvas, border }, width, height, ratio) {
  [canvas.width, canvas.height] = [width, height].map((length) => Math.round(length * ratio));
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.imageSmoothingEnabled = interpolation === "linear";
  layers.forEach(({ plane, bitmap, beside, above }) => {
    const [left, right, bottom, top] = extent(plane);
    const [[x0, y0], [x1, y1]] = [toCanvas(left, top), toCanvas(right, bottom)];
    if (beside) {
      pen.beginPath();
      pen.rect(border, 0, width, height);
      pen.clip();
      pen.clearRect(border, 0, width, height);
    }
    pen.globalAlpha = above ? opacity : 1;
    pen.drawImage(bitmap, x0, y0, x1 - x0, y1 - y0);
  });
}

// White with a dark edge, visible on any colour, as SVG that needs no style sheet. measures: points in the plane, mm, and words beside the last one.
export function Marks({ geometry: { scale, border, toCanvas }, marks: { cursor, profile, region, measures = [] }, width, height }) {
  const line = (points) => `M${points.map((point) => toCanvas(...point).join(" ")).join("L")}`;
  const dot = (point, radius) => {
    const [x, y] = toCanvas(...point);
    return html`<circle cx=${x} cy=${y} r=${radius} />`;
  };
  const cross = ([x, y]) => [[1, 0], [-1, 0], [0, 1], [0, -1]].map(([dx, dy]) => `M${x + 4 * dx} ${y + 4 * dy}l${8 * dx} ${8 * dy}`).join("");
  const ends = ([x0, y0, x1, y1]) => [[x0, y0], [x1, y1]];
  const shapeOf = ({ shape, place }) => {
    const [[x0, y0], [x1, y1]] = ends(place).map((point) => toCanvas(...point));
    const [rx, ry] = [Math.abs(x1 - x0) / 2, Math.abs(y1 - y0) / 2];
    if (shape === "ellipse") return html`<ellipse cx=${(x0 + x1) / 2} cy=${(y0 + y1) / 2} rx=${rx} ry=${ry} />`;
    return html`<path d=${`M${x0} ${y0}H${x1}V${y1}H${x0}Z`} />`;
  };
  const length = roundLength((BAR_SHARE * width) / scale);
  const shapes = (colour, edge) => {
    const words = (text, x, y, more) => html`<text x=${x} y=${y} fill=${colour} stroke-width=${1.5 * edge} ...${more}>${text}</text>`;
    const measureOf = ({ kind, points, words: value }) => {
      const [x, y] = toCanvas(...points.at(-1));
      const beside = x < width - WORDS ? words(value, x + 8, y - 8) : words(value, x - 8, y - 8, { "text-anchor": "end" });
      return html`<path d=${line(points) + (kind === "area" ? "Z" : "")} />${kind !== "area" && points.map((point) => dot(point, 2))}${beside}`;
    };
    return html`<g fill="none" stroke=${colour} stroke-width=${1.5 + edge} font-size="13" font-weight="600">
      ${border < Infinity && html`<path d=${`M${border} 0V${height}`} />`}
      ${cursor && html`<path stroke-width=${1 + edge} d=${cross(toCanvas(...cursor))} />`}
      ${/* The end where the profile begins has a dot. */ profile && html`<path d=${line(ends(profile))} />${dot(ends(profile)[0], 4)}`}
      ${measures.map(measureOf)}
      ${region && shapeOf(region)}
      <path class="bar" stroke-width=${3 + edge} d=${`M14 ${height - 14}h${length * scale}`} />
      ${words(`${Number(length.toPrecision(3))} mm`, 14, height - 22)}
    </g>`;
  };
  return html`${shapes("#101010", 2)}${shapes("#fff", 0)}`;
}

// [canvas, geometry, marks] of a look: for the canvas of a plane, where the plane is on it, and what stands over it, beside the canvas. other: a
// plane that is shown right of the share `swipe` of the width; over: { plane, low, high, map, clear } of what lies above it, with this opacity;
// deviations: those that fade the plane; centre: mm or null; interpolation: between nodes. Without a plane there is nothing.
export function useImage(look) {
  const [canvas, width, height] = useSize();
  const { plane, other, over, deviations, low, high, map, marks, interpolation } = look;
  const colours = [over?.plane, over?.low, over?.high, over?.map, over?.clear];
  const layers = useMemo(() => plane && layersOf(look), [plane, other, deviations, low, high, map, interpolation, ...colours]);
  const geometry = plane && width > 0 ? geometryOf(look, width, height) : null;
  useLayoutEffect(() => {
    if (geometry) draw(canvas.current, layers, look, geometry, width, height, window.devicePixelRatio || 1);
  }, [layers, width, height, look.centre, look.zoom, look.swipe, look.opacity]);
  return [canvas, geometry, geometry && html`<svg class="marks" width=${width} height=${height} aria-hidden="true">
    <${Marks} geometry=${geometry} marks=${marks} width=${width} height=${height} /></svg>`];
}
