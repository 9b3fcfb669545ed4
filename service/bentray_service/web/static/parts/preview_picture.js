// The image of a running reconstruction, drawn again after each iteration in colours that change slowly.
import { coloursOf } from "../viewer/colormaps.js";
import { coloured } from "../viewer/image_view.js";
import { make } from "./dom.js";

const MAP = "viridis";
// A range widens at once, so that no value is beyond it, and narrows by this share of the way with each image.
const EASE = 0.5;

function speedsOf({ speed }) {
  const bytes = Uint8Array.from(atob(speed), (one) => one.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return Float32Array.from({ length: bytes.length / 4 }, (_, k) => view.getFloat32(4 * k, true));
}

// What the image is of: stage and iteration, and which slice or candidate method.
function captionOf({ stage, iteration, part, parts, shape, every }, what) {
  const grid = `${shape.join(" × ")} nodes${every > 1 ? `, every ${every}th` : ""}`;
  return [`Stage ${stage}, iteration ${iteration}`, parts > 1 ? `${what} ${part} of ${parts}` : "", grid].filter(Boolean).join(" · ");
}

// Adds a figure to a place; show(record, what) shows an answer of GET /v1/jobs/{id}/preview; what: the name of its parts.
export function previewPicture(place) {
  const canvas = make("canvas", "preview");
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "No image yet");
  const hint = make("p", "hint", "The image appears after the first iteration");
  const stage = make("div", "preview-stage");
  stage.append(canvas, hint);
  const bar = make("div", "colour-bar");
  bar.hidden = true;
  const colours = make("canvas");
  [colours.width, colours.height] = [256, 1];
  const marks = make("div", "ticks");
  bar.append(colours, marks, make("p", "unit", "sound speed (m/s)"));
  const caption = make("figcaption", "facts");
  const figure = make("figure", "tile");
  figure.append(stage, bar, caption);
  place.append(figure);
  let range = null;

  return {
    show(record, what) {
      const [low, high] = record.range_mps;
      range = range ? [Math.min(low, range[0] + EASE * (low - range[0])), Math.max(high, range[1] + EASE * (high - range[1]))] : [low, high];
      // An even image has no range.
      const [from, to] = range[1] > range[0] ? range : [range[0] - 1, range[1] + 1];
      const [na, nb] = record.shape;
      [canvas.width, canvas.height] = [na, nb];
      canvas.getContext("2d").putImageData(coloured({ na, nb, values: speedsOf(record) }, from, to, MAP), 0, 0);
      const strip = new ImageData(256, 1);
      new Uint32Array(strip.data.buffer).set(coloursOf(MAP));
      colours.getContext("2d").putImageData(strip, 0, 0);
      marks.replaceChildren(...[0, 0.5, 1].map((share) => make("span", "", String(Math.round(from + share * (to - from))))));
      bar.hidden = false;
      hint.hidden = true;
      caption.textContent = captionOf(record, what);
      canvas.setAttribute("aria-label", `Sound speed so far, ${Math.round(low)} to ${Math.round(high)} m/s`);
      canvas.dataset.pictures = Number(canvas.dataset.pictures || 0) + 1;
    },
  };
}
