// The shot of a scan: which emission, its traces with arrivals over them, and the arrivals of one receiver as text.
import { request } from "../parts/api.js";
import { keyHandler } from "../parts/pointers.js";
import { Alert, Choice, Facts, Field, html, Section, useEffect, useLayoutEffect, useRead, useRef, useSize, useState } from "../parts/view.js";
import { Waiting } from "../parts/waiting.js";
import { float32Of } from "../viewer/npy.js";
import { Axes, ticks } from "../viewer/plot.js";

// Between the last movement of the slider and the request.
const WAIT_MS = 80;
// Margins of the picture, pixels.
const [LEFT, RIGHT, TOP, BOTTOM] = [52, 8, 8, 40];

const NO_SHOT = "no arrivals here: the scan has no water shot. A reconstruction estimates one from the paths that miss the object, "
  + "and picks the arrivals against it; the quality report as an image shows them";
const NO_PULSE = "no arrivals here: the traces have no pulse to pick";

const SHOTS = [["object", "with the object"], ["water", "of the water shot"]];

const microseconds = (seconds) => `${(1e6 * seconds).toFixed(2)} µs`;
const within = (value, most) => Math.min(most, Math.max(0, Math.round(Number(value) || 0)));

function Legend({ shot, hasWater }) {
  const picks = shot.pick_s ? `arrival with the object, ${shot.picker ? `picked by ${shot.picker}` : "of the file"}` : hasWater ? NO_PULSE : NO_SHOT;
  return html`<span class="line-mark"></span> arrival in water along a straight line · <span class=${shot.pick_s ? "dot-mark" : ""}></span> ${picks}`;
}

function factsOf(shot) {
  const found = shot.pick_s?.filter((time) => time !== null).length;
  const arrivals = shot.pick_s ? ` · arrivals in ${found} of ${shot.receivers}` : "";
  const last = shot.first_s + (shot.samples - 1) * shot.step_s;
  const span = `${microseconds(shot.first_s)} to ${microseconds(last)}`;
  return `Emission ${shot.emission} by element ${shot.element} · ${shot.receivers} receivers${arrivals} · ${span}; each trace divided by its peak`;
}

function valuesOf(shot, receiver) {
  const straight = shot.straight_s[receiver];
  const words = `Receiving element ${shot.receiver_element[receiver]}: straight line ${microseconds(straight)}`;
  if (!shot.pick_s) return words;
  const pick = shot.pick_s[receiver];
  if (pick === null) return `${words}, no arrival with the object`;
  return `${words}, with the object ${microseconds(pick)}, difference ${microseconds(pick - straight)}`;
}

function Count({ most, onCount, ...more }) {
  return html`<${Field} type="number" min="0" max=${most} step="1" onChange=${({ target }) => onCount(target.value)} ...${more} />`;
}

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

// Receivers across, time down, grey by amplitude. cursor: the receiver that is marked, counted in the picture; onPoint(receiver): of the one below the pointer.
function Traces({ shot, cursor, onPoint, ...more }) {
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

// hasWater: whether there is a water shot, null while that is unknown; onEmission(element) is told which element emits.
export function Shot({ scan, hasWater, onEmission }) {
  const [emission, setEmission] = useState(0);
  const [slice, setSlice] = useState(0);
  const [quantity, setQuantity] = useState("object");
  const [cursor, setCursor] = useState(0);
  const address = `/v1/datasets/${scan.id}/traces?emission=${emission}&slice=${slice}&quantity=${quantity}`;
  const [shot, error] = useRead(() => request(address), { key: address, settle: WAIT_MS });
  useEffect(() => shot && onEmission(shot.element), [shot]);
  const receiver = shot ? Math.min(cursor, shot.receivers - 1) : 0;

  const choose = (value) => setEmission(within(value, scan.ntx - 1));
  const point = (value) => shot && setCursor(within(value, shot.receivers - 1));
  const onKeyDown = keyHandler(() => ({
    ArrowLeft: () => point(receiver - 1),
    ArrowRight: () => point(receiver + 1),
    PageUp: () => choose(emission - 1),
    PageDown: () => choose(emission + 1),
  }));
  const label = shot && `Traces of emission ${shot.emission}: ${shot.receivers} receivers over time`;
  return html`<${Section} id="shot" title="Traces" className="panel traces">
    <div class="shot-controls">
      <${Field} caption="Emission" label=${{ class: "shot-slider" }} id="shot-slider" type="range" min="0" max=${scan.ntx - 1} step="1"
        value=${emission} aria-valuetext=${`emission ${emission} of ${scan.ntx}`} onInput=${({ target }) => choose(target.value)} />
      <${Count} caption="Emission number" id="shot-number" most=${scan.ntx - 1} value=${emission} onCount=${choose} />
      <${Count} caption="Slice" label=${{ id: "shot-slices", hidden: scan.slices < 2 }} id="shot-slice" most=${scan.slices - 1} value=${slice}
        onCount=${(value) => setSlice(within(value, scan.slices - 1))} />
      <${Choice} caption="Traces" label=${{ id: "shot-shots", hidden: !hasWater }} id="shot-quantity" entries=${SHOTS} chosen=${quantity}
        onChange=${({ target }) => setQuantity(target.value)} />
    </div>
    ${!shot && !error && html`<${Waiting} words="Reading the traces" />`}
    <${Traces} shot=${shot} cursor=${receiver} id="shot" aria-describedby="shot-keys" aria-label=${label} onPoint=${point} onKeyDown=${onKeyDown} />
    <${Facts} id="shot-legend">${shot && hasWater !== null && html`<${Legend} shot=${shot} hasWater=${hasWater} />`}</${Facts}>
    <p class="facts" id="shot-facts" role="status">${shot && factsOf(shot)}</p>
    <${Count} caption="Receiver, from 0" label=${{ class: "shot-receiver" }} id="shot-receiver" most=${shot && shot.receivers - 1} value=${receiver}
      onCount=${point} />
    <${Facts} id="shot-values">${shot && valuesOf(shot, receiver)}</${Facts}>
    <${Facts} id="shot-keys">Left and right, on the picture, choose the receiver; Page up and Page down the emission.</${Facts}>
    <${Alert} id="shot-error" error=${error} />
  </${Section}>`;
}
