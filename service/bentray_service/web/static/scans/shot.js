// The shot of a scan: which emission, its traces on a canvas, and the arrivals of one receiver as text.
import { request } from "../parts/api.js";
import { at, make, showError } from "../parts/dom.js";
import { ShotCanvas } from "./shot_canvas.js";

const SHOT = `
  <h2 id="shot-title">Traces</h2>
  <div class="shot-controls">
    <label class="shot-slider"><span class="caption">Emission</span><input id="shot-slider" type="range" min="0" step="1" value="0"></label>
    <label><span class="caption">Emission number</span><input id="shot-number" type="number" min="0" step="1" value="0"></label>
    <label id="shot-slices" hidden><span class="caption">Slice</span><input id="shot-slice" type="number" min="0" step="1" value="0"></label>
    <label id="shot-shots" hidden><span class="caption">Traces</span><select id="shot-quantity">
      <option value="object">with the object</option><option value="water">of the water shot</option></select></label>
  </div>
  <canvas id="shot" class="shot" tabindex="0" role="application" aria-roledescription="image" aria-describedby="shot-keys"></canvas>
  <p class="facts" id="shot-legend"></p>
  <p class="facts" id="shot-facts" role="status"></p>
  <label class="shot-receiver"><span class="caption">Receiver, from 0</span>
    <input id="shot-receiver" type="number" min="0" step="1" value="0"></label>
  <p class="facts" id="shot-values"></p>
  <p class="facts" id="shot-keys">Left and right, on the picture, choose the receiver; Page up and Page down the emission.</p>
  <p id="shot-error" class="error" role="alert" hidden></p>`;
// Between the last movement of the slider and the request.
const WAIT_MS = 80;

const microseconds = (seconds) => `${(1e6 * seconds).toFixed(2)} µs`;

const NO_SHOT = "no arrivals here: the scan has no water shot. A reconstruction estimates one from the paths that miss the object, "
  + "and picks the arrivals against it; the quality report as an image shows them";
const NO_PULSE = "no arrivals here: the traces have no pulse to pick";

function legendOf(shot, hasWater) {
  const of = shot.picker ? `picked by ${shot.picker}` : "of the file";
  const picks = shot.pick_s ? `arrival with the object, ${of}` : hasWater ? NO_PULSE : NO_SHOT;
  const marks = [make("span", "line-mark"), make("span", shot.pick_s ? "dot-mark" : "")];
  return [marks[0], " arrival in water along a straight line · ", marks[1], ` ${picks}`];
}

function factsOf(shot) {
  const found = shot.pick_s?.filter((one) => one !== null).length;
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

// Open in a section; geometry: a promise of GET /v1/datasets/{id}/geometry; onEmission(element) is told which element emits.
// Returns close().
export function openShot(section, scan, geometry, onEmission) {
  section.innerHTML = SHOT;
  const canvas = new ShotCanvas(at("shot"));
  const [slider, number, slice, receiver] = ["shot-slider", "shot-number", "shot-slice", "shot-receiver"].map(at);
  for (const one of [slider, number]) one.max = scan.ntx - 1;
  slice.max = scan.slices - 1;
  at("shot-slices").hidden = scan.slices < 2;
  const water = geometry.then(({ water_shot: has }) => has, () => false);
  water.then((has) => {
    if (at("shot-shots")) at("shot-shots").hidden = !has;
  });
  let [wanted, timer] = ["", 0];

  function tell() {
    receiver.value = canvas.cursor;
    at("shot-values").textContent = valuesOf(canvas.shot, canvas.cursor);
  }

  async function read() {
    const address = `/v1/datasets/${scan.id}/traces?emission=${slider.value}&slice=${slice.value}&quantity=${at("shot-quantity").value}`;
    if (address === wanted) return;
    wanted = address;
    try {
      const [shot, hasWater] = await Promise.all([request(address), water]);
      // The reader may have moved on, or closed the page.
      if (address !== wanted || !section.isConnected) return;
      showError("shot-error", null);
      canvas.show(shot);
      receiver.max = shot.receivers - 1;
      at("shot").setAttribute("aria-label", `Traces of emission ${shot.emission}: ${shot.receivers} receivers over time`);
      at("shot-legend").replaceChildren(...legendOf(shot, hasWater));
      at("shot-facts").textContent = factsOf(shot);
      tell();
      onEmission(shot.element);
    } catch (error) {
      if (address !== wanted) return;
      wanted = "";
      showError("shot-error", error);
    }
  }

  function choose(value) {
    const emission = Math.min(scan.ntx - 1, Math.max(0, Math.round(Number(value) || 0)));
    slider.value = emission;
    number.value = emission;
    slider.setAttribute("aria-valuetext", `emission ${emission} of ${scan.ntx}`);
    clearTimeout(timer);
    timer = setTimeout(read, WAIT_MS);
  }

  function point(value) {
    if (!canvas.shot) return;
    canvas.cursor = Math.min(canvas.shot.receivers - 1, Math.max(0, Math.round(Number(value) || 0)));
    canvas.draw();
    tell();
  }

  slider.addEventListener("input", () => choose(slider.value));
  number.addEventListener("change", () => choose(number.value));
  slice.addEventListener("change", () => {
    slice.value = Math.min(scan.slices - 1, Math.max(0, Math.round(Number(slice.value) || 0)));
    read();
  });
  at("shot-quantity").addEventListener("change", read);
  receiver.addEventListener("change", () => point(receiver.value));
  at("shot").addEventListener("pointermove", (event) => canvas.shot && point(canvas.receiverAt(event.offsetX)));
  at("shot").addEventListener("keydown", (event) => {
    const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], PageUp: [0, -1], PageDown: [0, 1] }[event.key];
    if (!move) return;
    event.preventDefault();
    if (move[0]) point(canvas.cursor + move[0]);
    else choose(Number(slider.value) + move[1]);
  });
  choose(0);
  return () => {
    wanted = "closed";
    clearTimeout(timer);
    canvas.close();
  };
}
