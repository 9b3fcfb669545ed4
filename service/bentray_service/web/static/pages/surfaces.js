// Surface rendering: upload a mesh, build its geometry field, and render it as mirror, glass or clay in a scene.
import { go, keepQuery } from "../parts/address.js";
import { request } from "../parts/api.js";
import { fillDefaults } from "../parts/defaults.js";
import { at, make, showError } from "../parts/dom.js";
import { objectAt, objectsOf, placeAt } from "../parts/ground.js";
import { jobList } from "../jobs/job_list.js";
import { orbit } from "../parts/orbit.js";
import { deleteStored, fillSelect, startJob } from "../parts/panel.js";
import { pictureStream, rateOf } from "../parts/picture_stream.js";
import { load, titleOf } from "../parts/titles.js";
import { uploads } from "../parts/uploads.js";
import { queryOf } from "../parts/views.js";

const PREVIEW_PX = 256;
const FULL_PX = 512;
const FARTHEST_M = 5;

const PAGE = `
  <h1>Surface rendering</h1>
  <section aria-label="Surface rendering" class="panel viewer">
    <div>
      <div id="stage" class="stage" tabindex="0" role="group" aria-label="View of the scene: arrow keys turn it, plus and minus zoom, Home resets; objects on the ground are dragged">
        <canvas id="field-picture" width="512" height="512" role="img" aria-label="No image yet"></canvas>
        <p class="hint" id="stage-hint">The image appears here</p>
      </div>
      <p id="view-facts" class="facts"></p>
      <p id="field-error" class="error" role="alert" hidden></p>
      <div id="accuracy"></div>
    </div>
    <div>
      <div id="mesh-place" data-prompt="Choose a mesh" data-formats="PLY, OBJ, OFF, STL, glTF or GLB"></div>
      <label for="mesh" class="caption">Mesh to render</label>
      <select id="mesh" disabled><option value="">No mesh uploaded yet</option></select>
      <p id="mesh-facts" class="facts"></p>
      <form id="field">
        <div class="numbers">
          <label><span class="caption">Material</span>
            <select name="mode">
              <option value="reflect">mirror</option><option value="self">mirror with self-reflection</option>
              <option value="self-only">self-reflection alone</option>
              <option value="refract">glass</option><option value="refract-single">glass, refracted once</option>
              <option value="diffuse">clay</option>
            </select></label>
          <label><span class="caption">Scene</span>
            <select name="scene">
              <option value="object">object alone</option><option value="mirror-ball">two and a ball</option>
              <option value="two-mirrors">two objects</option>
            </select></label>
          <label><span class="caption">Field lookup</span>
            <select name="lookup">
              <option value="accurate">accurate</option><option value="linear">linear</option>
              <option value="nearest">nearest</option><option value="exact">exact (no field)</option>
              <option value="uv-nearest">published, nearest (u, v)</option><option value="uv-linear">published, linear (u, v)</option>
            </select></label>
          <label><span class="caption">Up axis</span>
            <select name="up"><option>z</option><option>y</option></select></label>
          <label><span class="caption">Refractive index</span>
            <input name="index" type="number" min="0.1" max="10" step="any" value="1.5" required></label>
          <label><span class="caption">Share of the light</span>
            <input name="share" title="Reflected or refracted" type="number" min="0" max="1" step="any" value="0.85" required></label>
          <label><span class="caption">Azimuth, degrees</span>
            <input name="azimuth_deg" type="number" min="-36000" max="36000" step="any" value="-60" required></label>
          <label><span class="caption">Elevation, degrees</span>
            <input name="elevation_deg" type="number" min="-89" max="89" step="any" value="15" required></label>
          <label><span class="caption">Zoom</span>
            <input name="zoom" type="number" min="0.05" max="50" step="any" value="1" required></label>
          <label><span class="caption">Samples per edge</span>
            <input name="samples" type="number" min="4" max="48" required></label>
        </div>
        <div id="objects" class="numbers"></div>
        <div class="actions">
          <button id="make" type="submit" disabled>Build the geometry field</button>
          <button id="reset-view" type="button" class="quiet">Reset the view</button>
          <button id="delete-mesh" type="button" class="quiet" hidden>Delete the mesh</button>
        </div>
      </form>
    </div>
  </section>
  <section aria-labelledby="jobs-title" id="of-fields">
    <h2 id="jobs-title">Geometry fields</h2>
  </section>`;

const CAMERA = ["azimuth_deg", "elevation_deg", "zoom"];

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

// The errors of a field in words, lengths in per cent of the edge of its unit cube.
function accuracyTable({ errors, sizes, seconds, settings }) {
  const bytes = ((sizes.outer_bytes + sizes.inner_bytes) / 2 ** 20).toPrecision(3);
  const time = Object.values(seconds).reduce((sum, one) => sum + one, 0);
  const rows = [
    ["Rays for which the field hits where the mesh is missed, or the reverse", percent(errors.lookup_wrong)],
    ["Distance between a lookup and the exact hit, half of the rays", percent(errors.lookup_median)],
    ["The same, 99 of 100 rays", percent(errors.lookup_99)],
    ["Geometry image off the surface, rms", percent(errors.image_rms)],
    ["Geometry image off the surface, at most", percent(errors.image_greatest)],
    ["Parameterisation", errors.conformal ? "conformal" : "not conformal"],
    ["Tables", `${bytes} MiB from ${settings.samples} samples per edge, ${time.toPrecision(2)} s of computing`],
  ];
  const table = make("table", "errors");
  table.append(make("caption", "caption", "Error of the geometry field, per cent of the edge of its cube"));
  const body = table.createTBody();
  for (const [what, value] of rows) {
    const row = body.insertRow();
    const head = make("th", "", what);
    head.scope = "row";
    row.append(head, make("td", "", value));
  }
  return table;
}

export async function open(root, { id, query }) {
  root.innerHTML = PAGE;
  document.title = "Surface rendering – Bentray";
  const meshes = new Map();
  // The links of the newest field of each mesh.
  const fields = new Map();
  const form = at("field");
  const value = (name) => form.elements[name].value;
  let objects = [];
  let shownScene = "";
  let measured = "";
  let keeping = 0;
  const stream = pictureStream(at("field-picture"), {
    onShown({ quality, rate }) {
      at("stage-hint").hidden = true;
      const turned = `azimuth ${value("azimuth_deg")}°, elevation ${value("elevation_deg")}°`;
      at("view-facts").textContent = `${turned}${quality === "full" ? "" : rateOf(rate)}`;
      at("field-picture").setAttribute("aria-label", `${titleOf(meshes.get(at("mesh").value))}, ${value("mode")}, ${turned}`);
    },
    onError: (error) => showError("field-error", error),
  });

  function view() {
    const { samples, ...given } = Object.fromEntries(new FormData(form));
    // What the material shows nothing of, which the service refuses.
    if (!given.mode.startsWith("refract")) delete given.index;
    if (given.mode === "diffuse") delete given.share;
    const names = objects.flatMap((_, number) => [`x${number}`, `y${number}`]);
    const places = names.map((name) => Number(given[name]));
    for (const name of names) delete given[name];
    const standing = objectsOf(given.scene).flatMap(({ x, y }) => [x, y]);
    const moved = places.some((one, index) => one !== standing[index]);
    return { ...given, ...(moved && { positions_m: places }) };
  }

  const cameraView = () => ({ scene: value("scene"), ...Object.fromEntries(CAMERA.map((name) => [name, Number(value(name))])) });

  // Numbers for the places of the movable objects of the scene.
  function showObjects(places = []) {
    const scene = value("scene");
    if (scene === shownScene) return;
    shownScene = scene;
    objects = objectsOf(scene);
    at("objects").replaceChildren(
      ...objects.flatMap((object, number) =>
        ["x", "y"].map((axis, second) => {
          const label = make("label");
          const input = make("input");
          Object.assign(input, { name: `${axis}${number}`, type: "number", min: -FARTHEST_M, max: FARTHEST_M, step: "any", required: true });
          input.value = places[2 * number + second] ?? object[axis];
          label.append(make("span", "caption", `${object.name}, ${axis}, m`), input);
          return label;
        }),
      ),
    );
    readPlaces();
  }

  function readPlaces() {
    objects.forEach((object, number) => {
      object.x = Number(value(`x${number}`));
      object.y = Number(value(`y${number}`));
    });
  }

  async function showAccuracy(links) {
    if (measured === links.field) return;
    measured = links.field;
    const record = await request(links.field);
    if (root.isConnected && measured === links.field) at("accuracy").replaceChildren(accuracyTable(record));
  }

  function show(moving = false) {
    const mesh = meshes.get(at("mesh").value);
    at("make").disabled = at("delete-mesh").hidden = !mesh;
    if (!mesh) return;
    at("mesh-facts").textContent = factsOf(mesh);
    showObjects();
    const links = fields.get(mesh.id);
    if (!links) {
      at("stage-hint").textContent = "The image appears here once the field is built";
      return;
    }
    if (!form.checkValidity()) {
      if (!moving) form.reportValidity();
      return;
    }
    readPlaces();
    const full = `${links.image}?${queryOf({ ...view(), rays: 2, width: FULL_PX, height: FULL_PX })}`;
    const preview = `${links.image}?${queryOf({ ...view(), width: PREVIEW_PX, height: PREVIEW_PX })}`;
    if (moving) stream.move(preview, full);
    else stream.set(full);
    showAccuracy(links).catch((error) => showError("field-error", error));
    clearTimeout(keeping);
    keeping = setTimeout(() => root.isConnected && keepQuery(queryOf(view())), 200);
  }

  async function loadMeshes(chosen) {
    const rows = await load("meshes");
    for (const row of rows) meshes.set(row.id, row);
    if (!rows.length || !root.isConnected) return;
    fillSelect("mesh", rows, titleOf, chosen);
    show();
  }

  // Of all jobs, also those that the list no longer has; records and jobs are the newest first.
  async function loadFields() {
    const { geometry_fields: records } = await request("/v1/geometry-fields?limit=1000");
    for (const { mesh, links } of records.reverse()) fields.set(mesh, { ...links, field: links.self });
  }

  function showFields(jobs) {
    const before = fields.get(at("mesh").value)?.field;
    for (const job of [...jobs].reverse()) if (job.field) fields.set(job.mesh, job.links);
    if (fields.get(at("mesh").value)?.field !== before) show();
  }

  function turn(right, up) {
    const azimuth = (Number(value("azimuth_deg")) + right) % 360;
    const elevation = Math.min(89, Math.max(-89, Number(value("elevation_deg")) + up));
    form.elements.azimuth_deg.value = Number(azimuth.toFixed(2));
    form.elements.elevation_deg.value = Number(elevation.toFixed(2));
    show(true);
  }

  function zoom(factor) {
    form.elements.zoom.value = Number(Math.min(50, Math.max(0.05, Number(value("zoom")) * factor)).toPrecision(4));
    show(true);
  }

  function reset() {
    for (const name of CAMERA) form.elements[name].value = form.elements[name].defaultValue;
    shownScene = "";
    show(true);
  }

  // A pointer that goes down on an object moves it over the ground, as far as the pointer goes.
  function drag(event) {
    if (!objects.length) return false;
    const box = at("stage").getBoundingClientRect();
    const point = (from) => [(from.clientX - box.left) / box.width - 0.5, (from.clientY - box.top) / box.height - 0.5];
    const number = objectAt(cameraView(), objects, ...point(event));
    if (number < 0) return false;
    const object = objects[number];
    const height = object.size / 2;
    let last = placeAt(cameraView(), ...point(event), height);
    if (!last) return false;
    at("stage").setPointerCapture(event.pointerId);
    const follow = (moved) => {
      const place = moved.pointerId === event.pointerId && placeAt(cameraView(), ...point(moved), height);
      if (!place) return;
      for (const [axis, name] of ["x", "y"].entries()) {
        const next = Math.min(FARTHEST_M, Math.max(-FARTHEST_M, object[name] + place[axis] - last[axis]));
        form.elements[`${name}${number}`].value = Number(next.toFixed(3));
      }
      last = place;
      show(true);
    };
    const stop = (ended) => {
      if (ended.pointerId !== event.pointerId) return;
      at("stage").removeEventListener("pointermove", follow);
      for (const name of ["pointerup", "pointercancel"]) at("stage").removeEventListener(name, stop);
    };
    at("stage").addEventListener("pointermove", follow);
    for (const name of ["pointerup", "pointercancel"]) at("stage").addEventListener(name, stop);
    return true;
  }

  uploads("mesh", (file) => ({ kind: "mesh", title: file.name.slice(0, 200) }), (made) => loadMeshes(made.id));
  at("mesh").addEventListener("change", () => go(`/surfaces/${at("mesh").value}`));
  form.addEventListener("change", () => show());
  orbit(at("stage"), { turn, zoom, reset, dragged: drag });
  at("reset-view").addEventListener("click", reset);
  at("delete-mesh").addEventListener("click", async () => {
    const mesh = meshes.get(at("mesh").value);
    if (await deleteStored(`/v1/meshes/${mesh.id}`, `${titleOf(mesh)} and its geometry fields`, "field-error")) go("/surfaces");
  });
  const jobs = jobList(at("of-fields"), {
    empty: "No geometry field yet",
    filters: { kind: "geometry-field" },
    onJobs: showFields,
  });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const settings = { samples: Number(value("samples")) };
    startJob({ kind: "geometry-field", mesh: at("mesh").value, settings }, "field-error", jobs.refresh);
  });
  Promise.all([loadFields(), fillDefaults(form.elements.samples.closest("label"), "FieldSettings")])
    .then(() => {
      for (const [name, given] of query) if (form.elements[name]) form.elements[name].value = given;
      showObjects(query.getAll("positions_m").map(Number));
      return loadMeshes(id);
    })
    .catch((error) => showError("field-error", error));
  return () => {
    clearTimeout(keeping);
    stream.close();
    jobs.close();
  };
}
