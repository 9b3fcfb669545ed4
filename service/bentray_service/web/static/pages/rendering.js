// Volume rendering: a volume as a lit surface or as glass, turned by mouse, touch or keyboard, and turntables of it.
import { go, keepQuery } from "../parts/address.js";
import { request } from "../parts/api.js";
import { fillDefaults } from "../parts/defaults.js";
import { at, showError } from "../parts/dom.js";
import { drawHistogram } from "../parts/histogram.js";
import { jobList } from "../jobs/job_list.js";
import { withKey } from "../parts/key.js";
import { orbit } from "../parts/orbit.js";
import { deleteStored, fillSelect, startJob } from "../parts/panel.js";
import { pictureStream, rateOf } from "../parts/picture_stream.js";
import { planOf, queueInWords, timeInWords } from "../parts/plan_estimate.js";
import { load, titleOf } from "../parts/titles.js";
import { uploads } from "../parts/uploads.js";
import { glassOf, queryOf, shownBy } from "../parts/views.js";
import { localPreviews } from "../webgl/local_previews.js";

// Sides of pictures, pixels: while the view moves, at rest, and of the picture that a link opens.
const PREVIEW_PX = 256;
const FULL_PX = 512;
const LINKED_PX = 1024;
// Steps of the slider of iso-values.
const STEPS = 500;
const CAMERA = ["azimuth_deg", "elevation_deg", "zoom"];
// After the last change until the time of a turntable is asked for.
const PLAN_MS = 400;

const PAGE = `
  <h1>Volume rendering</h1>
  <section aria-label="Volume rendering" class="panel viewer">
    <div>
      <div id="stage" class="stage" tabindex="0" role="group" aria-label="View of the volume: arrow keys turn it, plus and minus zoom, Home resets">
        <canvas id="glass" width="512" height="512" role="img" aria-label="No volume yet"></canvas>
        <p class="hint" id="stage-hint">The image appears here</p>
      </div>
      <p id="view-facts" class="facts"></p>
      <p id="look-error" class="error" role="alert" hidden></p>
    </div>
    <div>
      <div id="volume-place" data-prompt="Choose a volume" data-formats="NumPy (.npy, .npz), NRRD, NIfTI or HDF5 of Bentray"></div>
      <label for="volume" class="caption">Volume to render</label>
      <select id="volume" disabled><option value="">No 3-D volume yet</option></select>
      <p id="volume-facts" class="facts"></p>
      <form id="look">
        <fieldset class="modes">
          <legend class="caption">Show as</legend>
          <label><input type="radio" name="mode" value="shaded" checked> Surface, lit</label>
          <label><input type="radio" name="mode" value="refract"> Glass</label>
        </fieldset>
        <label for="iso" class="caption">Iso-value</label>
        <div id="histogram"></div>
        <input id="iso-slider" type="range" min="0" max="${STEPS}" aria-label="Iso-value by slider" disabled>
        <input id="iso" name="iso" type="number" step="any" placeholder="automatic">
        <div class="numbers">
          <label><span class="caption">Refractive index</span>
            <input name="index" type="number" min="0.01" max="100" step="any" placeholder="automatic"></label>
          <label><span class="caption">Backdrop</span>
            <select name="backdrop">
              <option value="checkerboard">checkerboard</option><option value="picture">picture</option>
              <option value="warped-checkerboard">warped checkerboard</option><option value="warped-picture">warped picture</option>
            </select></label>
          <label><span class="caption">Supersampling</span>
            <select name="supersampling" title="PRSS: samples behind the volume after refraction; more rays: real supersampling, slower">
              <option value="none">none</option><option value="prss" selected>PRSS</option>
              <option value="real">more rays</option>
            </select></label>
          <label><span class="caption">Smoothing</span>
            <input name="smoothing" type="number" min="0" max="1000000" step="any" placeholder="automatic"></label>
          <label><span class="caption">Filter</span>
            <select name="filter">
              <option value="bspline2">B-spline 2</option><option value="bspline3" selected>B-spline 3</option>
              <option value="bspline4">B-spline 4</option><option value="bspline5">B-spline 5</option>
              <option value="bspline6">B-spline 6</option><option value="catmull-rom">Catmull–Rom</option>
              <option value="trilinear">trilinear</option><option value="central">central differences</option>
            </select></label>
          <label><span class="caption">Zoom</span>
            <input name="zoom" type="number" min="0.05" max="50" step="any" required></label>
          <label><span class="caption">Azimuth, degrees</span>
            <input name="azimuth_deg" type="number" min="-36000" max="36000" step="any" required></label>
          <label><span class="caption">Elevation, degrees</span>
            <input name="elevation_deg" type="number" min="-90" max="90" step="any" required></label>
          <label><span class="caption">Frames per turn</span>
            <input name="frames" type="number" min="1" max="720" required></label>
        </div>
        <div class="actions">
          <button id="turn" type="submit" disabled>Render a turntable</button>
          <button id="reset-view" type="button" class="quiet">Reset the view</button>
          <button id="delete-volume" type="button" class="quiet" hidden>Delete the volume</button>
          <a id="picture-link" hidden>Open the picture</a>
        </div>
        <p id="turn-plan" class="facts" role="status"></p>
      </form>
    </div>
  </section>
  <section aria-labelledby="jobs-title" id="turntables">
    <h2 id="jobs-title">Turntables</h2>
  </section>`;

// A lit surface has nothing behind it to be sampled after refraction: its edges are smoothed by more rays.
function samplingOf({ mode, supersampling }) {
  const real = supersampling === "real" || (mode === "shaded" && supersampling === "prss");
  return real ? { supersampling: "real", degree: 2 } : { supersampling };
}

const rounded = (value) => Number(value.toPrecision(4));

// Glass of an upload bends light less than a window pane, so that thin walls do not scatter it.
const UPLOAD_INDEX = 1.2;

export async function open(root, { id, query }) {
  root.innerHTML = PAGE;
  document.title = "Volume rendering – Bentray";
  const volumes = new Map();
  const form = at("look");
  const field = (name) => form.elements[name];
  let bars = null;
  let histogram = null;
  let counted = "";

  const local = localPreviews();
  const stream = pictureStream(at("glass"), {
    onShown({ quality, rate }) {
      at("stage-hint").hidden = true;
      const turned = `azimuth ${rounded(Number(field("azimuth_deg").value))}°, elevation ${rounded(Number(field("elevation_deg").value))}°`;
      at("view-facts").textContent = `${turned}${quality === "full" ? "" : rateOf(rate)}`;
      at("glass").setAttribute("aria-label", `Volume rendering of ${titleOf(chosen())}, ${turned}`);
      showHistogram();
    },
    onError(error) {
      showError("look-error", error);
      if (error) showHistogram();
    },
  });

  const chosen = () => volumes.get(at("volume").value);

  // The values of the form; without iso-value and index, those that suit the volume.
  function view() {
    const volume = chosen();
    const { frames, iso, index, smoothing, filter, ...rest } = Object.fromEntries(new FormData(form));
    const sound = volume.water_speed_mps !== null;
    const suited = !sound ? { index: UPLOAD_INDEX } : iso || index ? {} : glassOf(volume);
    delete suited.elevation_deg;
    return shownBy({
      ...suited,
      ...(iso && { iso: Number(iso) }),
      ...(index && { index: Number(index) }),
      ...(smoothing && { smoothing: Number(smoothing) }),
      ...(filter !== "bspline3" && { filter }),
      mode: rest.mode,
      ...(rest.mode === "refract" && { backdrop: rest.backdrop }),
      ...samplingOf(rest),
      ...Object.fromEntries(CAMERA.map((name) => [name, Number(rest[name])])),
    });
  }

  function addressOf(more) {
    return `${chosen().links.refraction}?${queryOf({ ...view(), ...more })}`;
  }

  function addresses() {
    const small = { supersampling: "none", width: PREVIEW_PX, height: PREVIEW_PX };
    // A lit surface costs less than every other ray of glass.
    if (field("mode").value === "refract") small.ray_spacing = 2;
    const preview = new URLSearchParams(addressOf(small).split("?")[1]);
    preview.delete("degree");
    return [`${chosen().links.refraction}?${preview}`, addressOf({ width: FULL_PX, height: FULL_PX })];
  }

  function isoValues() {
    const { iso } = view();
    return iso === undefined ? (histogram?.iso == null ? [] : [histogram.iso]) : [iso].flat();
  }

  // What draws the preview in this browser, or null.
  function drawerHere() {
    const { iso, index = [1.5], ...rest } = view();
    // The default iso-value is known for the default filter and smoothing alone.
    const known = iso !== undefined || (!rest.filter && rest.smoothing === undefined && histogram?.iso != null);
    if (!known) return null;
    const indices = [index].flat();
    return local.drawer(chosen(), { ...rest, iso: isoValues(), index: isoValues().map((_, k) => indices[k] ?? indices[0]) }, PREVIEW_PX);
  }

  function markIso() {
    const values = isoValues();
    bars?.mark(values);
    if (histogram && values.length) {
      at("iso-slider").value = (STEPS * (values[0] - histogram.minimum)) / (histogram.maximum - histogram.minimum || 1);
      at("iso-slider").setAttribute("aria-valuetext", `${rounded(values[0])} ${histogram.unit}`.trim());
    }
  }

  // What differs from the defaults, so that the address restores the view.
  function keepView() {
    const kept = new URLSearchParams();
    for (const input of form.elements) {
      if (!input.name || input.name === "frames" || (input.type === "radio" && !input.checked)) continue;
      const fallback = input.type === "radio" ? "shaded" : input.options ? [...input.options].find((one) => one.defaultSelected)?.value ?? input.options[0].value : input.defaultValue;
      if (input.value !== fallback) kept.set(input.name, input.value);
    }
    keepQuery(kept);
    at("picture-link").hidden = false;
    at("picture-link").href = addressOf({ width: LINKED_PX, height: LINKED_PX });
  }

  // The turntable of the present view.
  function turntable() {
    const { iso, index, ...rest } = view();
    const lists = { ...(iso !== undefined && { iso: [iso].flat() }), ...(index !== undefined && { index: [index].flat() }) };
    return { kind: "refraction", volume: at("volume").value, settings: { ...rest, ...lists, frames: Number(field("frames").value), format: "apng" } };
  }

  let planning = 0;
  let planned = "";

  // The time of a turntable, which the camera does not change; asked again once a job has ended.
  function showPlan() {
    const job = turntable();
    const key = JSON.stringify({ ...job, settings: { ...job.settings, ...Object.fromEntries(CAMERA.map((name) => [name, 0])) } });
    if (key === planned) return;
    planned = key;
    clearTimeout(planning);
    planning = setTimeout(async () => {
      const words = await planOf(job).then(
        (estimate) => `Turntable: ${[timeInWords(estimate), queueInWords(estimate)].filter(Boolean).join(", ")}`,
        (problem) => problem.message,
      );
      if (root.isConnected && key === planned) at("turn-plan").textContent = words;
    }, PLAN_MS);
  }

  let keeping = 0;

  // Show the values of the form; moving: as one of many steps.
  function show(moving = false) {
    at("turn").disabled = !chosen();
    if (!chosen()) return;
    if (!form.checkValidity()) {
      if (!moving) form.reportValidity();
      return;
    }
    markIso();
    showPlan();
    const [preview, full] = addresses();
    if (moving) stream.move(preview, full, drawerHere());
    else stream.set(full);
    // Browsers limit how often the address changes.
    clearTimeout(keeping);
    keeping = setTimeout(() => root.isConnected && chosen() && keepView(), 200);
  }

  // After the first picture: its worker has filtered the volume by then.
  async function showHistogram() {
    const volume = chosen();
    if (!volume || counted === volume.id) return;
    counted = volume.id;
    bars = histogram = null;
    at("histogram").replaceChildren();
    at("iso-slider").disabled = true;
    try {
      const found = await request(volume.links.histogram);
      if (chosen()?.id !== volume.id) return;
      histogram = found;
      bars = drawHistogram(at("histogram"), found, rounded);
      at("iso-slider").disabled = false;
      field("iso").placeholder = found.iso === null ? "automatic" : `automatic: ${rounded(found.iso)}`;
      field("smoothing").placeholder = found.smoothing === null ? "automatic" : `automatic: ${found.smoothing}`;
      markIso();
    } catch (error) {
      showError("look-error", error);
    }
  }

  function chooseVolume() {
    const volume = chosen();
    const [lowest, highest] = volume.value_range.map(rounded);
    const size = volume.shape.join(" × ");
    at("volume-facts").textContent = `${size} nodes · values ${lowest} to ${highest} ${volume.unit}`;
    // Results are deleted on their own pages.
    at("delete-volume").hidden = volume.source !== "upload";
    field("index").placeholder = volume.water_speed_mps === null ? String(UPLOAD_INDEX) : "automatic: of sound";
    show();
  }

  async function loadVolumes(name) {
    const inSpace = (await load("volumes")).filter((row) => row.links.refraction);
    for (const row of inSpace) volumes.set(row.id, row);
    if (!inSpace.length || !root.isConnected) return;
    fillSelect("volume", inSpace, titleOf, name);
    chooseVolume();
  }

  // The values of the form belong to the volume before it.
  async function stored({ id: name, links }) {
    if (!links.refraction) throw new Error("The volume is stored, but it cannot be rendered: its spacing is not uniform.");
    form.reset();
    await loadVolumes(name);
  }

  function turn(right, up) {
    const azimuth = (Number(field("azimuth_deg").value) + right) % 360;
    const elevation = Math.min(90, Math.max(-90, Number(field("elevation_deg").value) + up));
    field("azimuth_deg").value = Number(azimuth.toFixed(2));
    field("elevation_deg").value = Number(elevation.toFixed(2));
    show(true);
  }

  function zoom(factor) {
    field("zoom").value = rounded(Math.min(50, Math.max(0.05, Number(field("zoom").value) * factor)));
    show(true);
  }

  function reset() {
    for (const name of CAMERA) field(name).value = field(name).defaultValue;
    show(true);
  }

  uploads("volume", (file) => ({ kind: "volume", title: file.name.slice(0, 200) }), stored);
  at("volume").addEventListener("change", () => go(`/rendering/${at("volume").value}`));
  form.addEventListener("change", () => show());
  at("iso-slider").addEventListener("input", (event) => {
    event.stopPropagation();
    const { minimum, maximum } = histogram;
    field("iso").value = rounded(minimum + ((maximum - minimum) * Number(at("iso-slider").value)) / STEPS);
    show(true);
  });
  orbit(at("stage"), { turn, zoom, reset });
  at("reset-view").addEventListener("click", reset);
  at("delete-volume").addEventListener("click", async () => {
    const { links, ...volume } = chosen();
    if (!(await deleteStored(links.self, `${titleOf(volume)} and its turntables`, "look-error"))) return;
    go("/rendering");
  });
  withKey(at("picture-link"));
  let ended = null;
  const jobs = jobList(at("turntables"), {
    empty: "No turntable yet",
    filters: { kind: "refraction" },
    onJobs(all) {
      const now = all.filter((job) => job.finished).length;
      if (ended !== null && now !== ended) {
        planned = "";
        if (chosen() && form.checkValidity()) showPlan();
      }
      ended = now;
    },
  });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    startJob(turntable(), "look-error", jobs.refresh);
  });
  fillDefaults(form, "Turntable")
    .then(() => {
      for (const [name, value] of query) {
        if (field(name)) field(name).value = value;
      }
      return loadVolumes(id);
    })
    .catch((error) => showError("look-error", error));
  return () => {
    clearTimeout(keeping);
    clearTimeout(planning);
    stream.close();
    local.close();
    jobs.close();
  };
}
