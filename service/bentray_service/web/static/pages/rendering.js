// Volume rendering: a volume in three planes, as a lit surface or as glass, turned by mouse, touch or keyboard, and turntables of it.
import { glassOf, keepQuery, queryOf, shownBy } from "../parts/address.js";
import { propertiesOf, request } from "../parts/api.js";
import { KeyLink } from "../parts/key.js";
import { load, titleOf } from "../parts/lists.js";
import { PlainField } from "../parts/settings_fields.js";
import { html, useEffect, useRead, useReducer, useRef, useState } from "../parts/view.js";
import { planOf, waitInWords } from "../parts/words.js";
import { CAMERA, FULL_PX, PREVIEW_PX, rounded, ScenePage, useScene } from "../scenes/scene.js";
import { ChoiceBar } from "../viewer/controls.js";
import { Values } from "../viewer/quantities.js";
import { stateOf } from "../viewer/state.js";
import { Viewer } from "../viewer/viewer.js";
import { localPreviews } from "../webgl/local_previews.js";

// The side of the picture that a link opens, pixels.
const LINKED_PX = 1024;
// Steps of the slider of iso-values, and the height of their histogram in its own unit.
const [STEPS, HEIGHT] = [500, 60];
// After the last change until the time of a turntable is asked for.
const PLAN_MS = 400;
// Glass of an upload bends light less than a window pane, so that thin walls do not scatter it.
const UPLOAD_INDEX = 1.2;
const WORDS = ["View of the volume: arrow keys turn it, plus and minus zoom, Home resets", "No volume yet"];

// A lit surface has nothing behind it to be sampled after refraction: its edges are smoothed by more rays.
function samplingOf({ mode, supersampling }) {
  const real = supersampling === "real" || (mode === "shaded" && supersampling === "prss");
  return real ? { supersampling: "real", degree: 2 } : { supersampling };
}

// The view of a volume that the values of the form state; without iso-value and index, those that suit the volume.
function viewOf(volume, { frames, iso, index, smoothing, filter, up, ...rest }) {
  const suited = volume.water_speed_mps === null ? { index: [UPLOAD_INDEX] } : iso || index ? {} : glassOf(volume);
  delete suited.elevation_deg;
  return shownBy({
    ...suited,
    ...(iso && { iso: [Number(iso)] }),
    ...(index && { index: [Number(index)] }),
    ...(smoothing && { smoothing: Number(smoothing) }),
    ...(filter !== "bspline3" && { filter }),
    ...(up !== "auto" && { up }),
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

const isoValuesOf = ({ iso }, histogram) => iso ?? (histogram?.iso == null ? [] : [histogram.iso]);

// What draws the preview in this browser, or null.
function drawerOf(local, volume, view, histogram) {
  const { index = [1.5], ...rest } = view;
  // The default iso-value is known for the default filter and smoothing alone.
  const iso = isoValuesOf(view, view.filter || view.smoothing !== undefined ? null : histogram);
  const up = view.up ?? histogram?.up;
  return up && local.drawer(volume, { ...rest, up, iso, index: iso.map((_, k) => index[k] ?? index[0]) }, PREVIEW_PX);
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

// The histogram of a volume and its default iso-value; read() reads it once: after the first picture, whose worker has filtered the volume.
function useHistogram(volume, onError) {
  const [counted, setCounted] = useState(null);
  const [histogram, error] = useRead(() => counted && request(counted.links.histogram), { key: counted?.id });
  useEffect(() => error && onError(error), [error]);
  return [counted?.id === volume?.id ? histogram : null, () => setCounted(volume ?? null)];
}

// The time of a turntable in words, which the camera does not change: [words, plan, forget]; plan(job) asks for it unless it is known, and
// again after forget().
function usePlan() {
  const [job, plan] = useState(null);
  const [forgotten, forget] = useReducer((count) => count + 1, 0);
  const still = Object.fromEntries(CAMERA.map((name) => [name, 0]));
  const key = JSON.stringify([forgotten, job && { ...job, settings: { ...job.settings, ...still } }]);
  const [estimate, error] = useRead(() => job && planOf(job), { key, settle: PLAN_MS });
  return [error?.message ?? (estimate ? `Turntable: ${waitInWords(estimate)}` : ""), plan, forget];
}

// With a line at each of some values: counts in bins of equal width, on a logarithmic scale: peaks of air hide everything else on a linear one.
function Histogram({ counts, minimum, maximum, unit, marks, format }) {
  const nodes = counts.reduce((sum, count) => sum + count, 0);
  const label = `Histogram of ${nodes.toLocaleString("en")} nodes from ${format(minimum)} to ${format(maximum)} ${unit}`.trim();
  const most = Math.log1p(Math.max(...counts));
  const steps = counts.map((count, bin) => `V${(HEIGHT * (1 - Math.log1p(count) / most)).toFixed(2)}H${bin + 1}`);
  const across = (value) => (counts.length * (value - minimum)) / (maximum - minimum || 1);
  return html`<svg class="histogram" viewBox=${`0 0 ${counts.length} ${HEIGHT}`} preserveAspectRatio="none" role="img" aria-label=${label}>
    <path d=${`M0 ${HEIGHT}${steps.join("")}V${HEIGHT}Z`} />
    ${marks.map((value) => html`<line x1=${across(value)} x2=${across(value)} y1="0" y2=${HEIGHT} />`)}
  </svg>`;
}

// The fields of the view; fields: their schemas by name; marks: the iso-values that are shown.
function Fields({ volume, histogram, marks, fields, onSlide }) {
  const automatic = (value) => (value == null ? "automatic" : `automatic: ${value}`);
  const { minimum, maximum, unit } = histogram ?? { minimum: 0, maximum: 1, unit: "" };
  const slide = (event) => {
    event.stopPropagation();
    onSlide(rounded(event.target.valueAsNumber));
  };
  const field = (name, more) => html`<${PlainField} name=${name} given=${fields[name]} ...${more} />`;
  return html`
    <fieldset class="modes">
      <legend class="caption">Show as</legend>
      <label><input type="radio" name="mode" value="shaded" defaultChecked /> Surface, lit</label>
      <label><input type="radio" name="mode" value="refract" /> Glass</label>
    </fieldset>
    <label for="iso" class="caption">Iso-value</label>
    <div id="histogram">${histogram && html`<${Histogram} ...${histogram} marks=${marks} format=${rounded} />`}</div>
    <input id="iso-slider" type="range" min=${minimum} max=${maximum} step=${(maximum - minimum) / STEPS} value=${marks[0]} aria-label="Iso-value by slider" disabled=${!histogram}
      aria-valuetext=${marks.length ? `${rounded(marks[0])} ${unit}`.trim() : undefined} onInput=${slide} />
    <input id="iso" name="iso" type="number" step="any" placeholder=${automatic(histogram?.iso == null ? null : rounded(histogram.iso))} />
    <div class="numbers">
      ${field("index", { value: "", placeholder: !volume ? "automatic" : volume.water_speed_mps === null ? UPLOAD_INDEX : "automatic: of sound" })}
      ${["backdrop", "supersampling"].map((name) => field(name))}
      ${field("smoothing", { placeholder: automatic(histogram?.smoothing) })}
      ${["filter", "up", "zoom", "azimuth_deg", "elevation_deg", "frames"].map((name) => field(name, { required: true }))}
    </div>`;
}

const VIEWS = { planes: "Planes", surface: "Surface" };

// A volume in planes across its axes, in the viewer of results; view: { current }, the query of its address, which is kept there while the surface is shown.
function Planes({ volume, view }) {
  const [state] = useState(() => ({ ...stateOf(view.current), ...(view.current.get("view") !== "planes" && { planes: true }) }));
  const [panes] = useState(() => [{ title: titleOf(volume), values: new Values(volume), notes: {}, stored: [volume.source === "upload" ? "value" : "speed"] }]);
  const keep = (query) => {
    view.current = new URLSearchParams([["view", "planes"], ...query]);
    keepQuery(view.current);
  };
  return html`<${Viewer} panes=${panes} state=${state} keep=${keep} id="planes" aria-label="Planes" />`;
}

// fields: of the form, as schemas by name.
function Rendering({ volumes, id, query, fields }) {
  const [marks, setMarks] = useState([]);
  const [link, setLink] = useState("");
  const [ended, planes] = [useRef(null), useRef(query)];
  const [local] = useState(localPreviews);
  const [planWords, plan, forgetPlan] = usePlan();
  const scene = useScene({ records: volumes, id, query, pictureOf });
  const { record: volume, form, values, show, setError } = scene;
  const [histogram, readHistogram] = useHistogram(volume, setError);
  // An upload opens in planes, unless the address describes its surface.
  const [shown, setShown] = useState(query.get("view") ?? (volume?.source === "upload" && !query.size ? "planes" : "surface"));
  const inPlanes = Boolean(volume) && shown === "planes";
  const turntable = (given = values()) => (
    { kind: "refraction", volume: volume.id, settings: { ...viewOf(volume, given), frames: Number(given.frames), format: "apng" } }
  );

  function pictureOf(record, given) {
    const view = viewOf(record, given);
    setMarks(isoValuesOf(view, histogram));
    plan(turntable(given));
    const [preview, full] = addressesOf(record, view);
    return {
      preview,
      full,
      drawHere: drawerOf(local, record, view, histogram),
      keep() {
        keepQuery(new URLSearchParams([["view", "surface"], ...changedIn(form.current)]));
        setLink(`${record.links.refraction}?${queryOf({ ...view, width: LINKED_PX, height: LINKED_PX })}`);
      },
    };
  }

  useEffect(() => local.close, []);
  useEffect(() => {
    if (!inPlanes) show();
  }, [volume?.id, inPlanes]);
  // What is chosen by default is known.
  useEffect(() => {
    if (histogram) setMarks(isoValuesOf(viewOf(volume, values()), histogram));
  }, [histogram]);

  // The values of the form, and the planes, belong to the volume before it.
  async function onStored({ id: name, links }) {
    if (!links.refraction) throw new Error("The volume is stored, but it cannot be rendered: its spacing is not uniform.");
    form.current.reset();
    planes.current = new URLSearchParams();
    scene.setRecords(await loadVolumes());
    scene.choose(name);
    setShown("planes");
  }

  const describe = () => {
    const [azimuth, elevation] = CAMERA.map((name) => rounded(Number(values()[name])));
    const turned = `azimuth ${azimuth}°, elevation ${elevation}°`;
    return { facts: turned, label: `Volume rendering of ${titleOf(volume)}, ${turned}` };
  };
  // The time is asked for again once a job has ended.
  function onJobs(jobs) {
    const now = jobs.filter((job) => job.finished).length;
    if (ended.current !== null && now !== ended.current) forgetPlan();
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
  // Results are deleted on their own pages.
  const products = volume?.source === "upload" ? "turntables" : null;
  return html`<${ScenePage} scene=${scene} title="Volume rendering" name="volume" path="/rendering" onStored=${onStored} onChange=${() => show()}
    stage=${{ id: "glass", words: WORDS, hint: "The image appears here", describe, onShown: readHistogram, onError }}
    formats="NumPy (.npy, .npz), NRRD, NIfTI or HDF5 of Bentray" none="No 3-D volume yet" form="look" products=${products}
    above=${volume && html`<${ChoiceBar} label="View" className="views" entries=${Object.entries(VIEWS)} chosen=${shown} onChoose=${setShown} />`}
    instead=${inPlanes && html`<${Planes} key=${volume.id} volume=${volume} view=${planes} />`}
    facts=${volume && `${volume.shape.join(" × ")} nodes · values ${volume.value_range.map(rounded).join(" to ")} ${volume.unit}`}
    fields=${html`<${Fields} volume=${volume} histogram=${histogram} marks=${marks} fields=${fields} onSlide=${slide} />`}
    begin=${{ id: "turn", title: "Render a turntable", job: turntable }}
    actions=${html`<${KeyLink} id="picture-link" href=${link} hidden=${!link}>Open the picture</${KeyLink}>`}
    jobs=${{ title: "Turntables", kind: "refraction", empty: "No turntable yet", onJobs }}>
    <p id="turn-plan" class="facts" role="status">${planWords}</p>
  </${ScenePage}>`;
}

const loadVolumes = async () => (await load("volumes")).filter((volume) => volume.links.refraction);

export async function open({ id, query }) {
  document.title = "Volume rendering – Bentray";
  const [volumes, fields, asked] = await Promise.all([loadVolumes(), propertiesOf("Turntable"), id && request(`/v1/volumes/${id}`)]);
  if (asked && !asked.links.refraction) throw new Error(`${titleOf(asked)} has ${asked.shape.join(" × ")} nodes, which cannot be rendered; accepted: a volume with equal spacings`);
  return html`<${Rendering} volumes=${volumes} id=${id} query=${query} fields=${fields} />`;
}
