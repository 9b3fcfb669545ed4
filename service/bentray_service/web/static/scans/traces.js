// The traces of one emission: receivers across, time down, grey by amplitude, arrivals over them.
import { html, useLayoutEffect, useRef, useSize } from "../parts/view.js";
import { float32Of } from "../viewer/npy.js";
import { Axes, ticks } from "../viewer/plot.js";

const [LEFT, RIGHT, TOP, BOTTOM] = [52, 8, 8, 40];

function drawGreys(canvas, { receivers, samples, traces }) {
  const image = new ImageData(receivers, samples);
  // Receivers, samples.
  const values = float32Of(traces);
  for (let receiver = 0; receiver < receivers; receiver += 1) {
    for (let k = 0; k < samples; k += 1) {
      const at = 4 * (k * receivers + receiver);
      image.data.fill(127.5 * (1 + values[receiver * samples + k]), at, at + 3);
      image.data[at + 3] = 255;
    }
  }
  [canvas.width, canvas.height] = [receivers, samples];
  canvas.getContext("2d").putImageData(image, 0, 0);
}

// Axes, arrivals and the marked receiver, on a picture of this size, pixels.
function Marks({ shot, cursor, width, height }) {
  const [right, bottom] = [width - RIGHT, height - BOTTOM];
  const { first_s: first, step_s: step, samples, receivers } = shot;
  const [across, down] = [(right - LEFT) / receivers, (bottom - TOP) / (samples * step)];
  // A sample and a receiver are as wide as their pixel; their values are those of its middle.
  const px = (receiver) => LEFT + (receiver + 0.5) * across;
  const py = (seconds) => TOP + (seconds - first + 0.5 * step) * down;
  const columns = ticks(0, receivers - 1, Math.max(2, Math.floor((right - LEFT) / 80))).filter(Number.isInteger);
  const dots = shot.pick_s?.map((time, k) => (time === null ? "" : `M${px(k).toFixed(2)} ${py(time).toFixed(2)}h0`)) ?? [];
  const line = shot.straight_s.map((time, k) => `${px(k).toFixed(2)},${py(time).toFixed(2)}`);
  const box = { x: LEFT, y: TOP, width: right - LEFT, height: bottom - TOP };
  return html`<svg width=${width} height=${height} aria-hidden="true">
    <${Axes} box=${[LEFT, TOP, right, bottom]} px=${px} py=${(time) => py(1e-6 * time)} x=${columns} y=${ticks(1e6 * first, 1e6 * (first + samples * step), 6)}
      wordsOf=${(receiver) => shot.receiver_element[receiver]} words=${["receiving element", "time (µs)"]} height=${height} margin="12" />
    <svg viewBox=${Object.values(box).join(" ")} ...${box}>
      <path class="pick" stroke-width=${receivers > 100 ? 3.2 : 6} d=${dots.join("")} />
      <polyline class="straight" points=${line.join(" ")} />
      <rect class="cursor" x=${px(cursor) - 2} y="0" width="4" height=${height} />
    </svg>
  </svg>`;
}

// cursor: the receiver that is marked, counted in the picture; onPoint(receiver): of the one below the pointer.
export function Traces({ shot, cursor, onPoint, ...more }) {
  const canvas = useRef(null);
  const [element, width, height] = useSize();
  useLayoutEffect(() => {
    if (shot) drawGreys(canvas.current, shot);
  }, [shot]);
  const point = ({ clientX, currentTarget }) => {
    const share = (clientX - currentTarget.getBoundingClientRect().left - LEFT) / (width - LEFT - RIGHT);
    onPoint(Math.floor(share * shot.receivers));
  };
  // Few samples have sharp edges.
  const smooth = shot && (shot.samples > devicePixelRatio * height || shot.receivers > devicePixelRatio * width);
  return html`<div class="shot" ref=${element} tabindex="0" role="application" aria-roledescription="image" onPointerMove=${shot && point} ...${more}>
    <canvas class=${smooth ? "" : "sharp"} ref=${canvas}></canvas>
    ${shot && width > 0 && html`<${Marks} shot=${shot} cursor=${cursor} width=${width} height=${height} />`}
  </div>`;
}
