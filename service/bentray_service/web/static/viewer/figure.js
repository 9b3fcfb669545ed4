// A figure for a paper: the images of a view with axes, marks, colour bars and caption, as SVG that needs no style sheet, and as PNG drawn from it.
import { html, render } from "../parts/view.js";
import { Strip } from "./colour_bar.js";
import { extent } from "./field.js";
import { draw, geometryAt, geometryOf, layersOf, Marks } from "./image.js";
import { Axes, ticks } from "./plot.js";

// Pixels of 1/96 inch: of all images with their numbers at most; of a figure at least; around an image, for its numbers; of lines of text; below a colour bar, for
// its numbers; and of a tick.
const [WIDTH, HEIGHT, LEAST_WIDTH] = [600, 480, 440];
const [LEFT, RIGHT, TOP, BOTTOM] = [50, 14, 8, 42];
const [LINE, GAP, BAR_HEIGHT, TICK] = [14, 16, 42, 4];
// 300 dots per inch.
const RATIO = 300 / 96;
const FAMILY = "Helvetica, Arial, 'DejaVu Sans', sans-serif";
const SIZE = 11;

// A text in lines of at most this many pixels.
function wrapped(text, width) {
  const pen = document.createElement("canvas").getContext("2d");
  pen.font = `${SIZE}px ${FAMILY}`;
  return text.split(" ").filter(Boolean).reduce(([line, ...before], word) => {
    const longer = line ? `${line} ${word}` : word;
    return pen.measureText(longer).width <= width || !line ? [longer, ...before] : [word, line, ...before];
  }, [""]).reverse();
}

const Lines = ({ lines, x, y, ...more }) => lines.map((line, k) => html`<text x=${x} y=${y + k * LINE} ...${more}>${line}</text>`);

// What is seen of a plane on a canvas of this size: [left, right, bottom, top], mm, and the border to another plane.
function seen(look, [width, height]) {
  const { toPlane, border } = geometryOf(look, width, height);
  const [left, right, bottom, top] = extent(look.plane);
  const [[x0, y1], [x1, y0]] = [toPlane(0, 0), toPlane(width, height)];
  const limits = [Math.max(left, x0), Math.min(right, x1), Math.max(bottom, y0), Math.min(top, y1)];
  return { limits: limits[0] < limits[1] && limits[2] < limits[3] ? limits : [left, right, bottom, top], seam: toPlane(border, 0)[0] };
}

// An image with its axes; scale: pixels for a millimetre.
function Panel({ look, limits: [x0, x1, y0, y1], seam, scale, marked }) {
  const [width, height] = [(x1 - x0) * scale, (y1 - y0) * scale];
  const centre = [(x0 + x1) / 2, (y0 + y1) / 2];
  const { toCanvas } = geometryAt(centre, scale, width, height, Infinity);
  const [px, py] = [(x) => toCanvas(x, 0)[0], (y) => toCanvas(0, y)[1]];
  const geometry = geometryAt(centre, scale, width, height, look.other ? px(seam) : Infinity);
  const canvas = document.createElement("canvas");
  draw(canvas, layersOf(look), look, geometry, width, height, RATIO);
  const marks = marked ? { ...look.marks, cursor: null } : {};
  // The page may not load the image, which the figure names: see figureOf. The lines of the grid are seen as ticks beside the image.
  return html`
    <${Axes} box=${[-TICK, 0, width, height + TICK]} px=${px} py=${py} x=${ticks(x0, x1, Math.max(2, width / 45))} y=${ticks(y0, y1, Math.max(2, height / 45))}
      words=${look.plane.names.map((name) => `${name} (mm)`)} height=${height + BOTTOM} margin=${12 - LEFT} />
    <rect width=${width} height=${height} fill="#0c0f11" />
    <image width=${width} height=${height} data-href=${canvas.toDataURL()} />
    <svg width=${width} height=${height}><${Marks} geometry=${geometry} marks=${marks} width=${width} height=${height} /></svg>
    <rect width=${width} height=${height} fill="none" stroke="#333" stroke-width="0.7" />`;
}

// Images in so many columns: { columns, rows, scale }, with the heights of the rows, mm, and pixels for a millimetre. sides: of the images, mm.
function inColumns(sides, columns) {
  const rows = [];
  sides.forEach(([, height], k) => (rows[Math.floor(k / columns)] = Math.max(rows[Math.floor(k / columns)] ?? 0, height)));
  const widest = Math.max(...sides.map(([width]) => width));
  const scale = Math.min((WIDTH / columns - LEFT - RIGHT) / widest, (HEIGHT - rows.length * BOTTOM) / rows.reduce((sum, height) => sum + height, 0));
  return { columns, rows, scale, cell: LEFT + widest * scale + RIGHT };
}

// { svg, width, height } of what a view shows: { panels: [{ title, look, size }], bars, words }, with the look of useImage, the size of its
// canvas, and the properties of colour bars. caption: below; marked: with what is measured.
export function figureOf({ panels, bars }, caption, marked) {
  const images = panels.map((panel) => ({ ...panel, ...seen(panel.look, panel.size) }));
  const sides = images.map(({ limits: [x0, x1, y0, y1] }) => [x1 - x0, y1 - y0]);
  const { columns, rows, scale, cell } = images.map((_, k) => inColumns(sides, k + 1)).sort((one, other) => other.scale - one.scale)[0];
  const width = Math.max(LEAST_WIDTH, Math.ceil(columns * cell));
  const titles = images.map(({ title }) => (title ? wrapped(title, cell - LEFT) : []));
  const top = TOP + LINE * Math.max(...titles.map((lines) => lines.length));
  const across = (width - columns * cell) / 2;
  const topOf = (row) => rows.slice(0, row).reduce((sum, high) => sum + top + high * scale + BOTTOM, 0);
  const long = (width - GAP * (bars.length + 1)) / bars.length;
  const barWords = bars.map(({ words }) => wrapped(words, long));
  const barTop = topOf(rows.length) + GAP / 2;
  const captionTop = barTop + BAR_HEIGHT + LINE * (Math.max(...barWords.map((lines) => lines.length)) + 1);
  const captionLines = wrapped(caption, width - 2 * GAP);
  const height = captionTop + LINE * captionLines.length;
  const moved = (x, y, content) => html`<g transform=${`translate(${x} ${y})`}>${content}</g>`;
  const host = document.createElement("div");
  render(html`<svg xmlns="http://www.w3.org/2000/svg" width=${width} height=${height} viewBox=${`0 0 ${width} ${height}`} font-family=${FAMILY} font-size=${SIZE} fill="#222">
    <rect width=${width} height=${height} fill="#fff" />
    ${images.map((image, k) => moved(across + (k % columns) * cell + LEFT, topOf(Math.floor(k / columns)) + top, html`
      <${Lines} lines=${titles[k]} x="0" y=${TOP - 2 - LINE * titles[k].length} font-weight="600" /><${Panel} ...${image} scale=${scale} marked=${marked} />`))}
    ${bars.map((bar, k) => moved(GAP + k * (long + GAP), barTop, html`
      <${Strip} ...${bar} width=${long} /><${Lines} lines=${barWords[k]} x=${long / 2} y=${BAR_HEIGHT + LINE / 2} text-anchor="middle" />`))}
    <${Lines} lines=${captionLines} x=${GAP} y=${captionTop} />
  </svg>`, host);
  return { svg: new XMLSerializer().serializeToString(host.firstChild).replaceAll("data-href=", "href="), width, height };
}

export const svgOf = ({ svg }) => new Blob([svg], { type: "image/svg+xml" });

export async function pngOf(figure) {
  const [image, canvas] = ["img", "canvas"].map((name) => document.createElement(name));
  image.src = URL.createObjectURL(svgOf(figure));
  await image.decode();
  [canvas.width, canvas.height] = [figure.width, figure.height].map((length) => Math.round(length * RATIO));
  canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
  URL.revokeObjectURL(image.src);
  return new Promise((done) => canvas.toBlob(done, "image/png"));
}
