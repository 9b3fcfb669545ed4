// The image of a running reconstruction to scale, drawn again after each iteration in colours that change slowly.
import { showColourBar } from "../viewer/colour_bar.js";
import { ImageView } from "../viewer/image_view.js";
import { robustLimits } from "../viewer/measures.js";
import { QUANTITIES } from "../viewer/quantities.js";
import { make } from "../parts/dom.js";

const { map: MAP, words: WORDS, unit: UNIT } = QUANTITIES.speed;
// The range widens at once to that of a result, and narrows by this share of the way with each image.
const EASE = 0.5;

function speedsOf({ speed }) {
  const bytes = Uint8Array.from(atob(speed), (one) => one.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return Float32Array.from({ length: bytes.length / 4 }, (_, k) => view.getFloat32(4 * k, true));
}

// As a plane of the viewer; lengths in mm.
function planeOf(record) {
  const [na, nb] = record.shape;
  const [spacing, origin] = [record.spacing_m, record.origin_m].map((lengths) => lengths.map((one) => 1e3 * one));
  return { na, nb, names: ["x", "y"], spacing, origin, values: speedsOf(record) };
}

// What the image is of: stage and iteration, and which slice or candidate method.
function captionOf({ stage, iteration, part, parts, shape, every }, what) {
  const grid = `${shape.join(" × ")} nodes${every > 1 ? `, every ${every}th` : ""}`;
  return [`Stage ${stage}, iteration ${iteration}`, parts > 1 ? `${what} ${part} of ${parts}` : "", grid].filter(Boolean).join(" · ");
}

// Adds a figure to a place. show(record, what) shows an answer of GET /v1/jobs/{id}/preview; what: the name of its parts. close()
// ends it.
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
  bar.append(colours, make("div", "ticks"), make("p", "unit", `${WORDS} (${UNIT})`));
  const caption = make("figcaption", "facts");
  const figure = make("figure", "tile");
  figure.append(stage, bar, caption);
  place.append(figure);
  const image = new ImageView(canvas);
  let range = null;
  let shown = "";

  return {
    show(record, what) {
      const plane = planeOf(record);
      const [low, high] = robustLimits([plane.values]);
      // The same image again changes nothing.
      const ease = [record.stage, record.iteration, record.part].join() === shown ? 0 : EASE;
      shown = [record.stage, record.iteration, record.part].join();
      range = range ? [Math.min(low, range[0] + ease * (low - range[0])), Math.max(high, range[1] + ease * (high - range[1]))] : [low, high];
      image.show(plane, { low: range[0], high: range[1], map: MAP, centre: null, zoom: 1, marks: {} });
      showColourBar(bar, ...range, MAP);
      bar.hidden = false;
      hint.hidden = true;
      stage.classList.add("drawn");
      caption.textContent = captionOf(record, what);
      const [least, most] = record.range_mps.map(Math.round);
      canvas.setAttribute("aria-label", `Sound speed so far, ${least} to ${most} m/s`);
      canvas.dataset.pictures = Number(canvas.dataset.pictures || 0) + 1;
    },
    close: () => image.close(),
  };
}
