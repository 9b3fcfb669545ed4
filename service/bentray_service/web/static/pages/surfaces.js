// Surface rendering: a mesh with its geometry field as mirror, glass or clay, turned by mouse, touch or keyboard, its objects moved.
import { JobList } from "../jobs/job_list.js";
import { go, keepQuery } from "../parts/address.js";
import { request, send } from "../parts/api.js";
import { DropZone } from "../parts/drop_zone.js";
import { objectAt, objectsOf, placeAt } from "../parts/ground.js";
import { CAMERA, cameraOf, Choice, defaultsOf, deleteStored, fillForm, NumberField, RecordSelect, Stage } from "../parts/scene.js";
import { Pairs } from "../parts/tables.js";
import { load, titleOf } from "../parts/titles.js";
import { Alert, Button, Facts, Form, html, useAct, useEffect, useLater, useRead, useRef, useState } from "../parts/view.js";
import { queryOf } from "../parts/views.js";

const PREVIEW_PX = 256;
const FULL_PX = 512;
const FARTHEST_M = 5;
const KEEP_MS = 200;
const WORDS = ["View of the scene: arrow keys turn it, plus and minus zoom, Home resets; objects on the ground are dragged", "No image yet"];
const MATERIALS = [
  ["reflect", "mirror"], ["self", "mirror with self-reflection"], ["self-only", "self-reflection alone"],
  ["refract", "glass"], ["refract-single", "glass, refracted once"], ["diffuse", "clay"],
];
const SCENES = [["object", "object alone"], ["mirror-ball", "two and a ball"], ["two-mirrors", "two objects"]];
const LOOKUPS = [
  ["accurate", "accurate"], ["linear", "linear"], ["nearest", "nearest"], ["exact", "exact (no field)"],
  ["uv-nearest", "published, nearest (u, v)"], ["uv-linear", "published, linear (u, v)"],
];

function factsOf({ faces, closed, holes, genus, repairs }) {
  const form = closed ? "closed" : `${holes} ${holes === 1 ? "hole" : "holes"}`;
  const mended = Object.values(repairs).some((count) => count > 0) ? " · mended" : "";
  return `${faces} faces · ${form} · ${genus} ${genus === 1 ? "handle" : "handles"}${mended}`;
}

// Below this share rounding decides.
const SMALLEST = 1e-5;

function percent(share) {
  if (share === null) return "no ray hits the mesh";
  return share > 0 && share < SMALLEST ? `below ${100 * SMALLEST} %` : `${Number((100 * share).toPrecision(2))} %`;
}

// The errors of a field in words, lengths in per cent of the edge of its unit cube. address: of its record.
function Accuracy({ address, onError }) {
  const [record, error] = useRead(() => request(address), undefined, address);
  useEffect(() => error && onError(error), [error]);
  if (!record) return null;
  const { errors, sizes, seconds, settings } = record;
  const bytes = ((sizes.outer_bytes + sizes.inner_bytes) / 2 ** 20).toPrecision(3);
  const time = Object.values(seconds).reduce((sum, part) => sum + part, 0);
  const rows = [
    ["Rays for which the field hits where the mesh is missed, or the reverse", percent(errors.lookup_wrong)],
    ["Distance between a lookup and the exact hit, half of the rays", percent(errors.lookup_median)],
    ["The same, 99 of 100 rays", percent(errors.lookup_99)],
    ["Geometry image off the surface, rms", percent(errors.image_rms)],
    ["Geometry image off the surface, at most", percent(errors.image_greatest)],
    ["Parameterisation", errors.conformal ? "conformal" : "not conformal"],
    ["Tables", `${bytes} MiB from ${settings.samples} samples per edge, ${time.toPrecision(2)} s of computing`],
  ];
  return html`<${Pairs} className="errors" caption="Error of the geometry field, per cent of the edge of its cube" rows=${rows} />`;
}

// The view that the values of the form state: without what the material shows nothing of, which the service refuses, and with the places of
// the objects once one of them was moved.
function viewOf({ samples, ...values }) {
  if (!values.mode.startsWith("refract")) delete values.index;
  if (values.mode === "diffuse") delete values.share;
  const standing = objectsOf(values.scene);
  const names = standing.flatMap((_, number) => [`x${number}`, `y${number}`]);
  const places = names.map((name) => Number(values[name]));
  for (const name of names) delete values[name];
  const moved = standing.flatMap(({ x, y }) => [x, y]).some((place, index) => place !== places[index]);
  return { ...values, ...(moved && { positions_m: places }) };
}

// A pointer that goes down on an object moves it over the ground, as far as the pointer goes. values(): of the form; move(number, [x, y]) moves
// an object. Returns whether the pointer is on one.
function dragObject(event, values, move) {
  const stage = event.currentTarget;
  const camera = () => ({ scene: values().scene, ...Object.fromEntries(CAMERA.map((name) => [name, Number(values()[name])])) });
  const placed = () => objectsOf(values().scene).map((object, number) => ({ ...object, x: Number(values()[`x${number}`]), y: Number(values()[`y${number}`]) }));
  const objects = placed();
  if (!objects.length) return false;
  const box = stage.getBoundingClientRect();
  const point = (from) => [(from.clientX - box.left) / box.width - 0.5, (from.clientY - box.top) / box.height - 0.5];
  const number = objectAt(camera(), objects, ...point(event));
  if (number < 0) return false;
  const height = objects[number].size / 2;
  let last = placeAt(camera(), ...point(event), height);
  if (!last) return false;
  stage.setPointerCapture(event.pointerId);
  const follow = (moved) => {
    const place = moved.pointerId === event.pointerId && placeAt(camera(), ...point(moved), height);
    if (!place) return;
    const { x, y } = placed()[number];
    const next = [x + place[0] - last[0], y + place[1] - last[1]].map((metres) => Math.min(FARTHEST_M, Math.max(-FARTHEST_M, metres)));
    last = place;
    move(number, next.map((metres) => Number(metres.toFixed(3))));
  };
  const stop = (ended) => {
    if (ended.pointerId !== event.pointerId) return;
    stage.removeEventListener("pointermove", follow);
    for (const name of ["pointerup", "pointercancel"]) stage.removeEventListener(name, stop);
  };
  stage.addEventListener("pointermove", follow);
  for (const name of ["pointerup", "pointercancel"]) stage.addEventListener(name, stop);
  return true;
}

// Numbers for the places of the movable objects of a scene. places: x and y of each, by default where they stand.
function Objects({ scene, places }) {
  return html`<div id="objects" class="numbers">
    ${objectsOf(scene).flatMap((object, number) => ["x", "y"].map((axis, k) => html`<${NumberField} key=${`${scene} ${axis}${number}`} name=${`${axis}${number}`}
      caption=${`${object.name}, ${axis}, m`} min=${-FARTHEST_M} max=${FARTHEST_M} required defaultValue=${places[2 * number + k] ?? object[axis]} />`))}
  </div>`;
}

// scene, places: of the objects, see Objects.
function Fields({ defaults, scene, places }) {
  const number = (name) => ({ name, required: true, defaultValue: defaults[name] });
  return html`
    <div class="numbers">
      <${Choice} caption="Material" name="mode" entries=${MATERIALS} />
      <${Choice} caption="Scene" name="scene" entries=${SCENES} />
      <${Choice} caption="Field lookup" name="lookup" entries=${LOOKUPS} />
      <${Choice} caption="Up axis" name="up" entries=${["z", "y"]} />
      <${NumberField} caption="Refractive index" min="0.1" max="10" ...${number("index")} />
      <${NumberField} caption="Share of the light" title="Reflected or refracted" min="0" max="1" ...${number("share")} />
      <${NumberField} caption="Azimuth, degrees" min="-36000" max="36000" ...${number("azimuth_deg")} />
      <${NumberField} caption="Elevation, degrees" min="-89" max="89" ...${number("elevation_deg")} />
      <${NumberField} caption="Zoom" min="0.05" max="50" ...${number("zoom")} />
      <${NumberField} caption="Samples per edge" min="4" max="48" step="1" ...${number("samples")} />
    </div>
    <${Objects} scene=${scene} places=${places} />`;
}

const DEFAULTS = { index: 1.5, share: 0.85, azimuth_deg: -60, elevation_deg: 15, zoom: 1 };

// fields: links of the newest field of each mesh, by the id of the mesh.
function Surfaces({ meshes: first, fields: known, id, query, defaults }) {
  const [meshes, setMeshes] = useState(first);
  const [chosen, setChosen] = useState(id);
  const [fields, setFields] = useState(known);
  const [{ scene, places }, setScene] = useState({ scene: query.get("scene") ?? "object", places: query.getAll("positions_m").map(Number) });
  const [error, act, setError] = useAct();
  const [form, stream, refresh] = [useRef(null), useRef(null), useRef(null)];
  const later = useLater();
  const mesh = meshes.find((row) => row.id === chosen) ?? meshes[0];
  const links = mesh && fields[mesh.id];
  const values = () => Object.fromEntries(new FormData(form.current));

  function show(moving = false) {
    if (!links) return;
    if (!form.current.checkValidity()) {
      if (!moving) form.current.reportValidity();
      return;
    }
    const view = viewOf(values());
    const full = `${links.image}?${queryOf({ ...view, rays: 2, width: FULL_PX, height: FULL_PX })}`;
    if (moving) stream.current.move(`${links.image}?${queryOf({ ...view, width: PREVIEW_PX, height: PREVIEW_PX })}`, full);
    else stream.current.set(full);
    later(() => keepQuery(queryOf(view)), KEEP_MS);
  }

  useEffect(() => fillForm(form.current, query), []);
  // Another scene has other objects, once they are drawn.
  useEffect(() => show(), [mesh?.id, links?.field, scene]);

  // Objects of the scene: [x, y] of each, m.
  function place(objects) {
    objects.forEach((metres, number) => ["x", "y"].forEach((axis, k) => {
      form.current.elements[`${axis}${number}`].value = metres[k];
    }));
  }

  function onChange() {
    if (values().scene === scene) show();
    else setScene({ scene: values().scene, places: [] });
  }
  const orbit = cameraOf(form, 89, show);
  const camera = {
    ...orbit,
    reset() {
      place(objectsOf(scene).map(({ x, y }) => [x, y]));
      orbit.reset();
    },
    dragged: (event) => dragObject(event, values, (number, metres) => {
      place(Object.assign([], { [number]: metres }));
      show(true);
    }),
  };
  const describe = () => {
    const { mode, azimuth_deg: azimuth, elevation_deg: elevation } = values();
    const turned = `azimuth ${azimuth}°, elevation ${elevation}°`;
    return { facts: turned, label: `${titleOf(mesh)}, ${mode}, ${turned}` };
  };
  const onJobs = (jobs) => {
    const made = jobs.filter((job) => job.field).reverse().map((job) => [job.mesh, job.links]);
    if (made.length) setFields((before) => ({ ...before, ...Object.fromEntries(made) }));
  };
  const stored = async (made) => {
    setMeshes(await load("meshes"));
    setChosen(made.id);
  };
  const build = () => act(async () => {
    await send("POST", "/v1/jobs", { kind: "geometry-field", mesh: mesh.id, settings: { samples: Number(values().samples) } });
    await refresh.current();
  });
  const remove = () => act(async () => {
    if (await deleteStored(`/v1/meshes/${mesh.id}`, `${titleOf(mesh)} and its geometry fields`)) go("/surfaces");
  });
  return html`
    <h1>Surface rendering</h1>
    <section aria-label="Surface rendering" class="panel viewer">
      <div>
        <${Stage} id="field-picture" words=${WORDS} hint=${mesh ? "The image appears here once the field is built" : "The image appears here"}
          describe=${describe} onError=${setError} camera=${camera} stream=${stream} />
        <${Alert} id="field-error" error=${error} />
        <div id="accuracy">${links && html`<${Accuracy} address=${links.field} onError=${setError} />`}</div>
      </div>
      <div>
        <${DropZone} name="mesh" prompt="Choose a mesh" formats="PLY, OBJ, OFF, STL, glTF or GLB"
          metadataOf=${(file) => ({ kind: "mesh", title: file.name.slice(0, 200) })} onStored=${stored} />
        <${RecordSelect} id="mesh" caption="Mesh to render" records=${meshes} chosen=${mesh?.id} none="No mesh uploaded yet"
          onChoose=${(name) => go(`/surfaces/${name}`)} />
        <${Facts} id="mesh-facts">${mesh && factsOf(mesh)}</${Facts}>
        <${Form} id="field" ref=${form} onChange=${onChange} onSubmit=${build}>
          <${Fields} defaults=${{ ...DEFAULTS, ...defaults }} scene=${scene} places=${places} />
          <div class="actions">
            <button id="make" type="submit" disabled=${!mesh}>Build the geometry field</button>
            <${Button} id="reset-view" onClick=${camera.reset}>Reset the view</${Button}>
            <${Button} id="delete-mesh" hidden=${!mesh} onClick=${remove}>Delete the mesh</${Button}>
          </div>
        </${Form}>
      </div>
    </section>
    <section aria-labelledby="jobs-title" id="of-fields">
      <h2 id="jobs-title">Geometry fields</h2>
      <${JobList} refresh=${refresh} empty="No geometry field yet" filters=${{ kind: "geometry-field" }} onJobs=${onJobs} />
    </section>`;
}

export async function open({ id, query }) {
  document.title = "Surface rendering – Bentray";
  const [meshes, { geometry_fields: records }, { samples }] = await Promise.all([
    load("meshes"), request("/v1/geometry-fields?limit=1000"), defaultsOf("FieldSettings"),
  ]);
  // Records are the newest first.
  const fields = Object.fromEntries(records.reverse().map(({ mesh, links }) => [mesh, { ...links, field: links.self }]));
  return html`<${Surfaces} meshes=${meshes} fields=${fields} id=${id} query=${query} defaults=${{ samples }} />`;
}
