// One plane on a canvas: colours, zoom and pan in mm, scale bar, cursor, and what is measured.
import { useLayoutEffect, useRef } from "../parts/view.js";
import { coloursOf } from "./colour_bar.js";
import { extent } from "./field.js";

const MISSING = 0xffe4e4e4;
// Of the width of the canvas at most, for the scale bar; and the share of the canvas that the image fills.
const BAR_SHARE = 0.3;
const FILL = 0.97;

// Opacity of a node: 1 where it is known, 0 where two standard deviations reach half the range of the colours.
function opacity(deviation, low, high) {
  return Math.min(1, Math.max(0, 1 - (4 * deviation) / (high - low)));
}

// deviations: a plane of the same nodes that fades what is not known, or null.
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
      if (deviations) image.data[4 * place + 3] = Math.round(255 * opacity(deviations.values[a * nb + b], low, high));
    }
  }
  return image;
}

// A round length of at most this many mm: 1, 2 or 5 of a power of ten.
function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return Math.max(...[0.5, 1, 2, 5].map((step) => step * power).filter((one) => one <= most));
}

// [canvas, view]: for the element of a plane, and its ImageView, which shows it after each drawing of the component. plane: null for none yet.
export function useImageView(plane, look) {
  const [canvas, view] = [useRef(null), useRef(null)];
  useLayoutEffect(() => {
    view.current = new ImageView(canvas.current);
    const watcher = new ResizeObserver(() => view.current.draw());
    watcher.observe(canvas.current);
    return () => watcher.disconnect();
  }, []);
  useLayoutEffect(() => {
    if (plane) view.current.show(plane, look);
  });
  return [canvas, view];
}

class ImageView {
  constructor(canvas) {
    Object.assign(this, { canvas, plane: null });
  }

  // Show a plane; other: one shown right of the share `swipe` of the width; deviations: those that fade the plane.
  // look: centre ([x, y] mm or null), zoom, marks.
  show(plane, { low, high, map, other = null, swipe = 0.5, deviations = null, ...look }) {
    const key = [low, high, map].join(" ");
    if (plane !== this.plane || other !== this.other || deviations !== this.deviations || key !== this.key) {
      this.bitmaps = [plane, other].filter(Boolean).map((one) => {
        const bitmap = document.createElement("canvas");
        [bitmap.width, bitmap.height] = [one.na, one.nb];
        bitmap.getContext("2d").putImageData(coloured(one, low, high, map, one === plane ? deviations : null), 0, 0);
        return bitmap;
      });
    }
    Object.assign(this, { plane, other, deviations, key, swipe, look });
    this.draw();
  }

  // Pixels of the page for a millimetre.
  get scale() {
    const [left, right, bottom, top] = extent(this.plane);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return FILL * Math.min(width / (right - left), height / (top - bottom)) * this.look.zoom;
  }

  get centre() {
    const [left, right, bottom, top] = extent(this.plane);
    return this.look.centre ?? [(left + right) / 2, (bottom + top) / 2];
  }

  // Position in mm of a point of the canvas in pixels of the page, and back.
  toPlane(px, py) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return [this.centre[0] + (px - width / 2) / this.scale, this.centre[1] - (py - height / 2) / this.scale];
  }

  toCanvas(x, y) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return [width / 2 + (x - this.centre[0]) * this.scale, height / 2 - (y - this.centre[1]) * this.scale];
  }

  // Whether the other plane is shown at this place across.
  showsOther(x) {
    return Boolean(this.other) && this.toCanvas(x, 0)[0] > this.swipe * this.canvas.clientWidth;
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!this.plane || !width || !height) return;
    const ratio = window.devicePixelRatio || 1;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      [this.canvas.width, this.canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    }
    const pen = this.canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.imageSmoothingEnabled = false;
    this.drawPlane(pen, this.plane, this.bitmaps[0]);
    if (this.other) {
      const border = this.swipe * width;
      pen.save();
      pen.beginPath();
      pen.rect(border, 0, width - border, height);
      pen.clip();
      pen.clearRect(border, 0, width - border, height);
      this.drawPlane(pen, this.other, this.bitmaps[1]);
      pen.restore();
      this.stroke(pen, () => [pen.moveTo(border, 0), pen.lineTo(border, height)]);
    }
    this.drawMarks(pen);
    this.drawScaleBar(pen, width, height);
  }

  drawPlane(pen, plane, bitmap) {
    const [left, right, bottom, top] = extent(plane);
    const [x0, y0] = this.toCanvas(left, top);
    const [x1, y1] = this.toCanvas(right, bottom);
    pen.drawImage(bitmap, x0, y0, x1 - x0, y1 - y0);
  }

  // White with a dark edge, visible on any colour.
  stroke(pen, trace, width = 1.5) {
    for (const [colour, wide] of [["#101010", width + 2], ["#ffffff", width]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = wide;
      pen.beginPath();
      trace();
      pen.stroke();
    }
  }

  drawMarks(pen) {
    const { cursor, profile, region, measures = [] } = this.look.marks;
    if (cursor) {
      const [x, y] = this.toCanvas(...cursor);
      this.stroke(pen, () => {
        for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
          pen.moveTo(x + 4 * dx, y + 4 * dy);
          pen.lineTo(x + 12 * dx, y + 12 * dy);
        }
      }, 1);
    }
    if (profile) {
      const [from, to] = [this.toCanvas(profile[0], profile[1]), this.toCanvas(profile[2], profile[3])];
      this.stroke(pen, () => [pen.moveTo(...from), pen.lineTo(...to)]);
      // The end where the profile begins.
      this.stroke(pen, () => pen.arc(...from, 4, 0, 2 * Math.PI));
    }
    for (const measure of measures) this.drawMeasure(pen, measure);
    if (region) {
      const [x0, y0] = this.toCanvas(region.place[0], region.place[1]);
      const [x1, y1] = this.toCanvas(region.place[2], region.place[3]);
      this.stroke(pen, () => {
        if (region.shape === "ellipse") pen.ellipse((x0 + x1) / 2, (y0 + y1) / 2, Math.abs(x1 - x0) / 2, Math.abs(y1 - y0) / 2, 0, 0, 2 * Math.PI);
        else pen.rect(Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0));
      });
    }
  }

  // points: in the plane, mm; words: beside the last one.
  drawMeasure(pen, { kind, points, words }) {
    const path = points.map((point) => this.toCanvas(...point));
    this.stroke(pen, () => {
      path.forEach((point, k) => (k ? pen.lineTo(...point) : pen.moveTo(...point)));
      if (kind === "area") pen.closePath();
    });
    for (const point of kind === "area" ? [] : path) this.stroke(pen, () => pen.arc(...point, 2, 0, 2 * Math.PI));
    const [x, y] = path.at(-1);
    this.drawWords(pen, words, x + 8, y - 8);
  }

  drawWords(pen, words, x, y) {
    pen.font = "600 13px system-ui, sans-serif";
    pen.lineWidth = 3;
    pen.strokeStyle = "#101010";
    pen.strokeText(words, x, y);
    pen.fillStyle = "#ffffff";
    pen.fillText(words, x, y);
  }

  drawScaleBar(pen, width, height) {
    const length = roundLength((BAR_SHARE * width) / this.scale);
    const [left, base] = [14, height - 14];
    this.stroke(pen, () => [pen.moveTo(left, base), pen.lineTo(left + length * this.scale, base)], 3);
    this.drawWords(pen, `${Number(length.toPrecision(3))} mm`, left, base - 8);
  }
}
