// Volume rendering: a volume as a lit surface or as glass, turned by mouse, touch or keyboard, and turntables of it.
import { JobList } from "../jobs/job_list.js";
import { go, keepQuery } from "../parts/address.js";
import { request, send } from "../parts/api.js";
import { DropZone } from "../parts/drop_zone.js";
import { Histogram } from "../parts/histogram.js";
import { KeyLink } from "../parts/key.js";
import { planOf, waitInWords } from "../parts/plan_estimate.js";
import { CAMERA, cameraOf, Choice, defaultsOf, deleteStored, fillForm, NumberField, RecordSelect, rounded, Stage } from "../parts/scene.js";
import { load, titleOf } from "../parts/titles.js";
import { Alert, Button, Facts, Form, html, useAct, useEffect, useLater, useRef, useState } from "../parts/view.js";
import { glassOf, queryOf, shownBy } from "../parts/views.js";
import { localPreviews } from "../webgl/local_previews.js";

// Sides of pictures, pixels: while the view moves, at rest, and of the picture that a link opens.
const PREVIEW_PX = 256;
const FULL_PX = 512;
const LINKED_PX = 1024;
// Steps of the slider of iso-values.
const STEPS = 500;
// After the last change until the time of a turntable is asked for, and until the address has the view: browsers limit how often it changes.
const PLAN_MS = 400;
const KEEP_MS = 200;
// Glass of an upload bends light less than a window pane, so that thin walls do not scatter it.
const UPLOAD_INDEX = 1.2;
const WORDS = ["View of the volume: arrow keys turn it, plus and minus zoom, Home resets", "No volume yet"];
const BACKDROPS = ["checkerboard", "picture", ["warped-checkerboard", "warped checkerboard"], ["warped-picture", "warped picture"]];
const SAMPLINGS = [["none", "none"], ["prss", "PRSS"], ["real", "more rays"]];
const FILTERS = [
  ...[2, 3, 4, 5, 6].map((order) => [`bspline${order}`, `B-spline ${order}`]),
  ["catmull-rom", "Catmull–Rom"], ["trilinear", "trilinear"], ["central", "central differences"],
];

// A lit surface has nothing behind it to be sampled after refraction: its edges are smoothed by more rays.
function samplingOf({ mode, supersampling }) {
  const real = supersampling === "real" || (mode === "shaded" && supersampling === "prss");
  return real ? { supersampling: "real", degree: 2 } : { supersampling };
}

// The view of a volume that the values of the form state; without iso-value and index, those that suit the volume.
function viewOf(volume, { frames, iso, index, smoothing, filter, ...rest }) {
  const suited = volume.water_speed_mps === null ? { index: UPLOAD_INDEX } : iso || index ? {} : glassOf(volume);
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

// The addresses of the preview of a view, and of the full picture.
function addressesOf({ links }, view) {
  // A lit surface costs less than every other ray of glass.
  const spacing = view.mode === "refract" ? { ray_spacing: 2 } : {};
  const preview = { ...view, degree: null, supersampling: "none", width: PREVIEW_PX, height: PREVIEW_PX, ...spacing };
  const full = { ...view, width: FULL_PX, height: FULL_PX };
  return [preview, full].map((query) => `${links.refraction}?${queryOf(query)}`);
}

function isoValuesOf({ iso }, histogram) {
  if (iso !== undefined) return [iso].flat();
  return histogram?.iso == null ? [] : [histogram.iso];
}

// What draws the preview in this browser, or null.
function drawerOf(local, volume, view, histogram) {
  const { iso, index = [1.5], ...rest } = view;
  // The default iso-value is known for the default filter and smoothing alone.
  const known = iso !== undefined || (!rest.filter && rest.smoothing === undefined && histogram?.iso != null);
  if (!known) return null;
  const [values, indices] = [isoValuesOf(view, histogram), [index].flat()];
  return local.drawer(volume, { ...rest, iso: values, index: values.map((_, k) => indices[k] ?? indices[0]) }, PREVIEW_PX);
}

// What differs from the defaults of a form, so that the address restores the view.
function changedIn(form) {
  const changed = new URLSearchParams();
  for (const input of form.elements) {
    if (!input.name || input.name === "frames" || (input.type === "radio" && !input.checked)) continue;
    const usual = input.options ? ([...input.options].find((option) => option.defaultSelected) ?? input.options[0]).value : input.defaultValue;
    if (input.value !== (input.type === "radio" ? "shaded" : usual)) changed.set(input.name, input.value);
  }
  return changed;
}

// The turntable of a view.
function turntableOf(volume, { iso, index, ...rest }, frames) {
  const lists = { ...(iso !== undefined && { iso: [iso].flat() }), ...(index !== undefined && { index: [index].flat() }) };
  return { kind: "refraction", volume: volume.id, settings: { ...rest, ...lists, frames: Number(frames), format: "apng" } };
}

// The histogram of a volume and its default iso-value; read() reads it once: after the first picture, whose worker has filtered the volume.
function useHistogram(volume, onError) {
  const [histogram, setHistogram] = useState(null);
  const counted = useRef("");
  async function read() {
    if (!volume || counted.current === volume.id) return;
    counted.current = volume.id;
    setHistogram(null);
    try {
      const found = await request(volume.links.histogram);
      if (counted.current === volume.id) setHistogram({ ...found, volume: volume.id });
    } catch (error) {
      onError(error);
    }
  }
  return [histogram?.volume === volume?.id ? histogram : null, read];
}

// The time of a turntable in words, which the camera does not change: [words, plan, forget]; plan(job) asks for it unless it is known, and
// again after forget().
function usePlan() {
  const [words, setWords] = useState("");
  const later = useLater();
  const planned = useRef("");
  function plan(job) {
    const key = JSON.stringify({ ...job, settings: { ...job.settings, ...Object.fromEntries(CAMERA.map((name) => [name, 0])) } });
    if (key === planned.current) return;
    planned.current = key;
    later(async () => {
      const found = await planOf(job).then((estimate) => `Turntable: ${waitInWords(estimate)}`, (problem) => problem.message);
      if (key === planned.current) setWords(found);
    }, PLAN_MS);
  }
  const forget = () => {
    planned.current = "";
  };
  return [words, plan, forget];
}

// The fields of the view; marks: the iso-values that are shown.
function Fields({ volume, histogram, marks, defaults, onSlide }) {
  const automatic = (value) => (value == null ? "automatic" : `automatic: ${value}`);
  const { minimum, maximum, unit } = histogram ?? { minimum: 0, maximum: 1, unit: "" };
  const slide = (event) => {
    event.stopPropagation();
    onSlide(rounded(minimum + ((maximum - minimum) * Number(event.target.value)) / STEPS));
  };
  const step = histogram && marks.length ? (STEPS * (marks[0] - minimum)) / (maximum - minimum || 1) : undefined;
  return html`
    <fieldset class="modes">
      <legend class="caption">Show as</legend>
      <label><input type="radio" name="mode" value="shaded" defaultChecked /> Surface, lit</label>
      <label><input type="radio" name="mode" value="refract" /> Glass</label>
    </fieldset>
    <label for="iso" class="caption">Iso-value</label>
    <div id="histogram">${histogram && html`<${Histogram} ...${histogram} marks=${marks} format=${rounded} />`}</div>
    <input id="iso-slider" type="range" min="0" max=${STEPS} value=${step} aria-label="Iso-value by slider" disabled=${!histogram}
      aria-valuetext=${marks.length ? `${rounded(marks[0])} ${unit}`.trim() : undefined} onInput=${slide} />
    <input id="iso" name="iso" type="number" step="any" placeholder=${automatic(histogram?.iso == null ? null : rounded(histogram.iso))} />
    <div class="numbers">
      <${NumberField} caption="Refractive index" name="index" min="0.01" max="100"
        placeholder=${!volume ? "automatic" : volume.water_speed_mps === null ? UPLOAD_INDEX : "automatic: of sound"} />
      <${Choice} caption="Backdrop" name="backdrop" entries=${BACKDROPS} />
      <${Choice} caption="Supersampling" name="supersampling" entries=${SAMPLINGS} chosen="prss"
        title="PRSS: samples behind the volume after refraction; more rays: real supersampling, slower" />
      <${NumberField} caption="Smoothing" name="smoothing" min="0" max="1000000" placeholder=${automatic(histogram?.smoothing)} />
      <${Choice} caption="Filter" name="filter" entries=${FILTERS} chosen="bspline3" />
      <${NumberField} caption="Zoom" name="zoom" min="0.05" max="50" required defaultValue=${defaults.zoom} />
      <${NumberField} caption="Azimuth, degrees" name="azimuth_deg" min="-36000" max="36000" required defaultValue=${defaults.azimuth_deg} />
      <${NumberField} caption="Elevation, degrees" name="elevation_deg" min="-90" max="90" required defaultValue=${defaults.elevation_deg} />
      <${NumberField} caption="Frames per turn" name="frames" min="1" max="720" step="1" required defaultValue=${defaults.frames} />
    </div>`;
}

function Rendering({ volumes: first, id, query, defaults }) {
  const [volumes, setVolumes] = useState(first);
  const [chosen, setChosen] = useState(id);
  const volume = volumes.find((row) => row.id === chosen) ?? volumes[0];
  const [error, act, setError] = useAct();
  const [marks, setMarks] = useState([]);
  const [link, setLink] = useState("");
  const [form, stream, refresh, ended] = [useRef(null), useRef(null), useRef(null), useRef(null)];
  const [local] = useState(localPreviews);
  const [histogram, readHistogram] = useHistogram(volume, setError);
  const [planWords, plan, forgetPlan] = usePlan();
  const later = useLater();

  const values = () => Object.fromEntries(new FormData(form.current));
  const turntable = () => turntableOf(volume, viewOf(volume, values()), values().frames);

  // Show the values of the form; moving: as one of many steps.
  function show(moving = false) {
    if (!volume) return;
    if (!form.current.checkValidity()) {
      if (!moving) form.current.reportValidity();
      return;
    }
    const view = viewOf(volume, values());
    setMarks(isoValuesOf(view, histogram));
    plan(turntable());
    const [preview, full] = addressesOf(volume, view);
    if (moving) stream.current.move(preview, full, drawerOf(local, volume, view, histogram));
    else stream.current.set(full);
    later(() => {
      keepQuery(changedIn(form.current));
      setLink(`${volume.links.refraction}?${queryOf({ ...view, width: LINKED_PX, height: LINKED_PX })}`);
    }, KEEP_MS);
  }

  useEffect(() => {
    fillForm(form.current, query);
    return local.close;
  }, []);
  useEffect(() => show(), [volume?.id]);
  // What is chosen by default is known.
  useEffect(() => {
    if (histogram) setMarks(isoValuesOf(viewOf(volume, values()), histogram));
  }, [histogram]);

  // The values of the form belong to the volume before it.
  async function stored({ id: name, links }) {
    if (!links.refraction) throw new Error("The volume is stored, but it cannot be rendered: its spacing is not uniform.");
    form.current.reset();
    setVolumes(await loadVolumes());
    setChosen(name);
  }

  const describe = () => {
    const [azimuth, elevation] = CAMERA.map((name) => rounded(Number(values()[name])));
    const turned = `azimuth ${azimuth}°, elevation ${elevation}°`;
    return { facts: turned, label: `Volume rendering of ${titleOf(volume)}, ${turned}` };
  };
  const remove = () => act(async () => {
    if (await deleteStored(volume.links.self, `${titleOf(volume)} and its turntables`)) go("/rendering");
  });
  const render = () => act(async () => {
    await send("POST", "/v1/jobs", turntable());
    await refresh.current();
  });
  // The time is asked for again once a job has ended.
  function onJobs(jobs) {
    const now = jobs.filter((job) => job.finished).length;
    if (ended.current !== null && now !== ended.current) {
      forgetPlan();
      if (volume && form.current.checkValidity()) plan(turntable());
    }
    ended.current = now;
  }
  const slide = (value) => {
    form.current.elements.iso.value = value;
    show(true);
  };
  const onError = (problem) => {
    setError(problem);
    if (problem) readHistogram();
  };
  const camera = cameraOf(form, 90, show);
  // Results are deleted on their own pages.
  const deletable = volume?.source === "upload";
  return html`
    <h1>Volume rendering</h1>
    <section aria-label="Volume rendering" class="panel viewer">
      <div>
        <${Stage} id="glass" words=${WORDS} hint="The image appears here" describe=${describe} onShown=${readHistogram} onError=${onError}
          camera=${camera} stream=${stream} />
        <${Alert} id="look-error" error=${error} />
      </div>
      <div>
        <${DropZone} name="volume" prompt="Choose a volume" formats="NumPy (.npy, .npz), NRRD, NIfTI or HDF5 of Bentray"
          metadataOf=${(file) => ({ kind: "volume", title: file.name.slice(0, 200) })} onStored=${stored} />
        <${RecordSelect} id="volume" caption="Volume to render" records=${volumes} chosen=${volume?.id} none="No 3-D volume yet"
          onChoose=${(name) => go(`/rendering/${name}`)} />
        <${Facts} id="volume-facts">
          ${volume && `${volume.shape.join(" × ")} nodes · values ${volume.value_range.map(rounded).join(" to ")} ${volume.unit}`}
        </${Facts}>
        <${Form} id="look" ref=${form} onChange=${() => show()} onSubmit=${render}>
          <${Fields} volume=${volume} histogram=${histogram} marks=${marks} defaults=${defaults} onSlide=${slide} />
          <div class="actions">
            <button id="turn" type="submit" disabled=${!volume}>Render a turntable</button>
            <${Button} id="reset-view" onClick=${camera.reset}>Reset the view</${Button}>
            <${Button} id="delete-volume" hidden=${!deletable} onClick=${remove}>Delete the volume</${Button}>
            <${KeyLink} id="picture-link" href=${link} hidden=${!link}>Open the picture</${KeyLink}>
          </div>
          <p id="turn-plan" class="facts" role="status">${planWords}</p>
        </${Form}>
      </div>
    </section>
    <section aria-labelledby="jobs-title" id="turntables">
      <h2 id="jobs-title">Turntables</h2>
      <${JobList} refresh=${refresh} empty="No turntable yet" filters=${{ kind: "refraction" }} onJobs=${onJobs} />
    </section>`;
}

const loadVolumes = async () => (await load("volumes")).filter((volume) => volume.links.refraction);

export async function open({ id, query }) {
  document.title = "Volume rendering – Bentray";
  const [volumes, defaults] = await Promise.all([loadVolumes(), defaultsOf("Turntable")]);
  return html`<${Rendering} volumes=${volumes} id=${id} query=${query} defaults=${defaults} />`;
}
