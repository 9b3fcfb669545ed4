// Surface rendering: upload a mesh, build its geometry field, and render it as mirror or glass.
import { go } from "../parts/address.js";
import { fillDefaults } from "../parts/defaults.js";
import { at, showError } from "../parts/dom.js";
import { jobList } from "../parts/job_list.js";
import { fillSelect, imageFrame, startJob } from "../parts/panel.js";
import { load, titleOf } from "../parts/titles.js";
import { uploads } from "../parts/uploads.js";
import { queryOf } from "../parts/views.js";

const PAGE = `
  <h1>Surface rendering</h1>
  <section aria-label="Surface rendering" class="panel glass">
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
              <option value="refract">glass</option><option value="diffuse">clay</option>
            </select></label>
          <label><span class="caption">Scene</span>
            <select name="scene">
              <option value="object">object alone</option><option value="mirror-ball">two objects and a mirror ball</option>
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
          <label><span class="caption">Samples per edge</span>
            <input name="samples" type="number" min="4" max="48" required></label>
        </div>
        <button id="make" type="submit" disabled>Build the geometry field</button>
        <p id="field-error" class="error" role="alert" hidden></p>
      </form>
    </div>
    <div id="field-picture" class="picture">The image appears here</div>
  </section>
  <section aria-labelledby="jobs-title" id="of-fields">
    <h2 id="jobs-title">Geometry fields</h2>
  </section>`;

function factsOf({ faces, closed, holes, genus, repairs }) {
  const form = closed ? "closed" : `${holes} ${holes === 1 ? "hole" : "holes"}`;
  const mended = Object.values(repairs).some((count) => count > 0) ? " · mended" : "";
  return `${faces} faces · ${form} · ${genus} ${genus === 1 ? "handle" : "handles"}${mended}`;
}

export async function open(root, { id }) {
  root.innerHTML = PAGE;
  document.title = "Surface rendering – Bentray";
  const meshes = new Map();
  // The links of the newest field of each mesh.
  const fields = new Map();
  const form = at("field");
  const frame = imageFrame("field-picture", "field-error");

  function show() {
    const mesh = meshes.get(at("mesh").value);
    at("make").disabled = !mesh;
    if (!mesh) return;
    at("mesh-facts").textContent = factsOf(mesh);
    const links = fields.get(mesh.id);
    if (!links) {
      frame.clear("The image appears here once the field is built");
      return;
    }
    const { samples, ...view } = Object.fromEntries(new FormData(form));
    frame.draw(`${links.image}?${queryOf({ ...view, rays: 2 })}`, `${titleOf(mesh)}, ${view.mode}`);
  }

  async function loadMeshes(chosen) {
    const rows = await load("meshes");
    for (const row of rows) meshes.set(row.id, row);
    if (!rows.length || !root.isConnected) return;
    fillSelect("mesh", rows, titleOf, chosen);
    show();
  }

  // Jobs are listed newest first.
  function showFields(jobs) {
    const before = fields.get(at("mesh").value)?.field;
    for (const job of [...jobs].reverse()) if (job.field) fields.set(job.mesh, job.links);
    if (fields.get(at("mesh").value)?.field !== before) show();
  }

  uploads("mesh", (file) => `/v1/meshes?${queryOf({ title: file.name.slice(0, 200) })}`, "application/octet-stream", (made) => loadMeshes(made.id));
  at("mesh").addEventListener("change", () => go(`/surfaces/${at("mesh").value}`));
  form.addEventListener("change", show);
  const jobs = jobList(at("of-fields"), {
    empty: "No geometry field yet",
    wanted: (job) => job.kind === "geometry-field",
    onJobs: showFields,
  });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const settings = { samples: Number(new FormData(form).get("samples")) };
    startJob({ kind: "geometry-field", mesh: at("mesh").value, settings }, "field-error", jobs.refresh);
  });
  fillDefaults(form, "FieldSettings")
    .then(() => loadMeshes(id))
    .catch((error) => showError("field-error", error));
  return jobs.close;
}
