// The image of a running reconstruction to scale, drawn again after each iteration in colours that change slowly.
import { html, useRef } from "../parts/view.js";
import { ColourBar } from "../viewer/colour_bar.js";
import { Field } from "../viewer/field.js";
import { useImage } from "../viewer/image.js";
import { robustLimits } from "../viewer/measures.js";
import { float32Of } from "../viewer/npy.js";
import { QUANTITIES } from "../viewer/quantities.js";
import { WHOLE } from "../viewer/state.js";

const { map: MAP, words: WORDS, unit: UNIT } = QUANTITIES.speed;
// The range widens at once to that of a result, and narrows by this share of the way with each image.
const EASE = 0.5;

// What the image is of: stage and iteration, and which slice or candidate method.
function captionOf({ stage, iteration, part, parts, shape, every }, what) {
  const grid = `${shape.join(" × ")} nodes${every > 1 ? `, every ${every}th` : ""}`;
  return [`Stage ${stage}, iteration ${iteration}`, parts > 1 ? `${what} ${part} of ${parts}` : "", grid].filter(Boolean).join(" · ");
}

// What is shown after another record, {} before the first one: its plane and the range of its colours.
function follow(before, record) {
  const [spacing, origin] = [record.spacing_m, record.origin_m].map((lengths) => lengths.map((metres) => 1e3 * metres));
  const plane = new Field(float32Of(record.speed), record.shape, spacing, origin).plane("z", 0);
  const [low, high] = robustLimits([plane.values]);
  const key = [record.stage, record.iteration, record.part].join();
  // The same image again changes nothing.
  const ease = key === before.key ? 0 : EASE;
  const eased = (from, to) => from + ease * (to - from);
  const range = { low: Math.min(low, eased(before.low ?? low, low)), high: Math.max(high, eased(before.high ?? high, high)) };
  return { record, plane, key, pictures: (before.pictures ?? 0) + 1, ...range };
}

// record: an answer of GET /v1/jobs/{id}/preview, or null before the first one; what: the name of its parts.
export function PreviewPicture({ record, what }) {
  const state = useRef({});
  if (record && record !== state.current.record) state.current = follow(state.current, record);
  const { plane, pictures, low = 0, high = 1 } = state.current;
  const [canvas, , marks] = useImage({ plane, low, high, map: MAP, ...WHOLE, marks: {} });
  const label = record ? `Sound speed so far, ${record.range_mps.map(Math.round).join(" to ")} m/s` : "No image yet";
  return html`<figure class="tile">
    <div class=${`preview-stage ${record ? "drawn" : ""}`}>
      <canvas class="preview" ref=${canvas} role="img" aria-label=${label} data-pictures=${pictures}></canvas>
      ${marks}
      <p class="hint" hidden=${record !== null}>The image appears after the first iteration</p>
    </div>
    <${ColourBar} low=${low} high=${high} map=${MAP} words=${`${WORDS} (${UNIT})`} hidden=${!record} />
    <figcaption class="facts">${record && captionOf(record, what)}</figcaption>
  </figure>`;
}
