// One plane as an image: its colours on a canvas, zoom and pan in mm; over it scale bar, cursor, and what is measured.
import { html, useLayoutEffect, useMemo, useSize } from "../parts/view.js";
import { coloursOf } from "./colour_bar.js";
import { extent } from "./field.js";

const MISSING = 0xffe4e4e4;
// Of the width of the canvas at most, for the scale bar; and the share of the canvas that the image fills.
const BAR_SHARE = 0.3;
const FILL = 0.97;

// A canvas with a pixel for each node. deviations: a plane of the same nodes that fades what is not known, or null.
function coloured(plane, low, high, map, deviations) {
  const { na, nb, values } = plane;
  const image = new ImageData(na, nb);
  const pixels = new Uint32Array(image.data.buffer);
  const colours = coloursOf(map);
  const scale = 256 / (high - low);
  for (let a = 0; a < na; a += 1) {
    for (let b = 0; b < nb; b += 1) {
      const value = values[a * nb + b];
      const step = Math.floor((value - low) * scale);
      const place = (nb - 1 - b) * na + a;
      pixels[place] = Number.isFinite(value) ? colours[Math.min(255, Math.max(0, step))] : MISSING;
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

// Where a plane is on a canvas of this size, pixels of the page. scale: pixels for a millimetre; centre: mm; border: right of which another
// plane is shown, Infinity without one.
function geometryOf(plane, { centre, zoom, other, swipe }, width, height) {
  const [left, right, bottom, top] = extent(plane);
  const scale = FILL * Math.min(width / (right - left), height / (top - bottom)) * zoom;
  const [x, y] = centre ?? [(left + right) / 2, (bottom + top) / 2];
  return {
    scale,
    centre: [x, y],
    border: other ? swipe * width : Infinity,
    // Position in mm of a point of the canvas, and back.
    toPlane: (px, py) => [x + (px - width / 2) / scale, y - (py - height / 2) / scale],
    toCanvas: (mx, my) => [width / 2 + (mx - x) * scale, height / 2 - (my - y) * scale],
  };
}

function draw(canvas, planes, bitmaps, { toCanvas, border }, width, height) {
  const ratio = window.devicePixelRatio || 1;
  [canvas.width, canvas.height] = [width, height].map((length) => Math.round(length * ratio));
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.imageSmoothingEnabled = false;
  planes.forEach((plane, k) => {
    const [left, right, bottom, top] = extent(plane);
    const [[x0, y0], [x1, y1]] = [toCanvas(left, top), toCanvas(right, bottom)];
    if (k) {
      pen.beginPath();
      pen.rect(border, 0, width, height);
      pen.clip();
      pen.clearRect(border, 0, width, height);
    }
    pen.drawImage(bitmaps[k], x0, y0, x1 - x0, y1 - y0);
  });
}

// White with a dark edge, visible on any colour. measures: points in the plane, mm, and words beside the last one.
function Marks({ geometry: { scale, border, toCanvas }, marks: { cursor, profile, region, measures = [] }, width, height }) {
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
  const measureOf = ({ kind, points, words }) => {
    const [x, y] = toCanvas(...points.at(-1));
    return html`<path d=${line(points) + (kind === "area" ? "Z" : "")} />${kind !== "area" && points.map((point) => dot(point, 2))}
      <text x=${x + 8} y=${y - 8}>${words}</text>`;
  };
  const length = roundLength((BAR_SHARE * width) / scale);
  const shapes = () => html`
    ${border < Infinity && html`<path d=${`M${border} 0V${height}`} />`}
    ${cursor && html`<path class="cross" d=${cross(toCanvas(...cursor))} />`}
    ${/* The end where the profile begins has a dot. */ profile && html`<path d=${line(ends(profile))} />${dot(ends(profile)[0], 4)}`}
    ${measures.map(measureOf)}
    ${region && shapeOf(region)}
    <path class="bar" d=${`M14 ${height - 14}h${length * scale}`} />
    <text x="14" y=${height - 22}>${`${Number(length.toPrecision(3))} mm`}</text>`;
  return html`<svg class="marks" width=${width} height=${height} aria-hidden="true"><g class="edge">${shapes()}</g><g>${shapes()}</g></svg>`;
}

// [canvas, geometry, marks]: for the canvas of a plane, where the plane is on it, and what stands over it, beside the canvas. other: a plane that is
// shown right of the share `swipe` of the width; deviations: those that fade the plane; centre: mm or null. Without a plane there is nothing.
export function useImage({ plane, other = null, deviations = null, low, high, map, marks, ...look }) {
  const [canvas, width, height] = useSize();
  const planes = useMemo(() => [plane, other].filter(Boolean), [plane, other]);
  const bitmaps = useMemo(() => planes.map((one) => coloured(one, low, high, map, one === plane ? deviations : null)), [planes, deviations, low, high, map]);
  const geometry = plane && width > 0 ? geometryOf(plane, { other, ...look }, width, height) : null;
  useLayoutEffect(() => {
    if (geometry) draw(canvas.current, planes, bitmaps, geometry, width, height);
  }, [bitmaps, width, height, look.centre, look.zoom, look.swipe]);
  return [canvas, geometry, geometry && html`<${Marks} geometry=${geometry} marks=${marks} width=${width} height=${height} />`];
}
