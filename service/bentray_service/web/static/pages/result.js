// The result of a reconstruction: image to measure in, how it was made, and what can be done with it.
import { go, keepQuery } from "../parts/address.js";
import { inTime } from "../parts/amounts.js";
import { request } from "../parts/api.js";
import { curlOf, pythonOf } from "../parts/code_snippets.js";
import { copyButton } from "../parts/copying.js";
import { make, showError } from "../parts/dom.js";
import { exportMenu } from "../parts/export_menu.js";
import { menuOf } from "../parts/menu.js";
import { deleteStored } from "../parts/panel.js";
import { provenanceTable } from "../parts/provenance.js";
import { choiceTable, facts, planTable, truthTable } from "../parts/result_tables.js";
import { loadResult, methodOf, nameOf } from "../parts/results.js";
import { QUANTITIES } from "../viewer/quantities.js";
import { stateOf } from "../viewer/state.js";
import { viewer } from "../viewer/viewer.js";

const PAGE = `
  <p class="crumb"><a href="#/jobs">Jobs</a> · <a id="result-scan">Scan</a></p>
  <h1 id="result-name"></h1>
  <p id="result-facts" class="facts"></p>
  <div id="result-cautions"></div>
  <div id="result-actions" class="links"></div>
  <form id="rename" class="rename" hidden>
    <label>Name <input name="name" type="text" maxlength="200"></label>
    <button type="submit">Rename</button>
  </form>
  <p id="result-error" class="error" role="alert" hidden></p>
  <section id="result-viewer" aria-label="Image"></section>
  <div id="result-tables" class="result-tables"></div>`;

const JSON_TYPE = { "Content-Type": "application/json" };

function button(title, onClick) {
  const made = make("button", "quiet", title);
  made.type = "button";
  made.addEventListener("click", onClick);
  return made;
}

// Results of other jobs to compare this one with, at most three.
async function compareMenu(job) {
  const { jobs } = await request("/v1/jobs?kind=reconstruction&state=succeeded&limit=100");
  const others = jobs.filter((one) => one.id !== job.id).sort((a, b) => (b.dataset === job.dataset) - (a.dataset === job.dataset));
  if (!others.length) return null;
  const form = make("form");
  const list = make("div", "others");
  for (const one of others) {
    const label = make("label");
    const box = make("input");
    Object.assign(box, { type: "checkbox", name: "other", value: one.id });
    const same = one.dataset === job.dataset ? "this scan" : "another scan";
    label.append(box, ` ${one.name || methodOf(one)}, ${same}, ${inTime(one.created)}`);
    list.append(label);
  }
  const start = make("button", "", "Compare");
  start.type = "submit";
  const sync = () => {
    const chosen = form.querySelectorAll("input:checked").length;
    start.disabled = chosen < 1 || chosen > 3;
  };
  form.addEventListener("change", sync);
  sync();
  form.append(list, make("p", "facts", "One to three others"), start);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    go(`/compare/${[job.id, ...new FormData(form).getAll("other")].join(",")}`);
  });
  return menuOf("Compare with", form);
}

export async function open(root, { id, query }) {
  const result = await loadResult(id);
  const { job, volume, summary } = result;
  root.innerHTML = PAGE;
  root.classList.add("wide");
  const part = (name) => root.querySelector(`#${name}`);
  const entitle = () => {
    document.title = `${nameOf(result)} – Bentray`;
    part("result-name").textContent = nameOf(result);
  };
  entitle();
  part("result-facts").textContent = facts(result);
  part("result-cautions").append(...summary.cautions.map((one) => {
    const notice = make("p", one.doubtful ? "error" : "notice", `${one.doubtful ? "Doubtful result. " : ""}${one.text}`);
    notice.setAttribute("role", "note");
    return notice;
  }));
  part("result-scan").href = `#/scans/${job.dataset}`;
  const shown = viewer(part("result-viewer"), [{ title: nameOf(result), values: result.values, stored: summary.quantities }], stateOf(query), keepQuery);
  const stored = () => QUANTITIES[shown.state.quantity].reads[0];

  const rename = part("rename");
  rename.elements.name.value = job.name || "";
  rename.addEventListener("submit", async (event) => {
    event.preventDefault();
    try {
      const name = new FormData(rename).get("name").trim();
      result.job = await request(job.links.self, { method: "PATCH", headers: JSON_TYPE, body: JSON.stringify({ name }) });
      rename.hidden = true;
      entitle();
    } catch (error) {
      showError("result-error", error);
    }
  });
  const remove = button("Delete", async () => {
    if (await deleteStored(volume.links.self, `the result ${nameOf(result)}`, "result-error")) go("/jobs");
  });
  const again = make("a", "button quiet", "Run again with changes");
  again.href = `#/scans/${job.dataset}?from=${job.id}`;
  part("result-actions").append(
    exportMenu(result, shown.state),
    copyButton("Copy link", () => location.href),
    copyButton("Copy as Python", () => pythonOf(result, stored())),
    copyButton("Copy as curl", () => curlOf(result, stored())),
    again,
    remove,
  );
  remove.before(button("Rename", () => {
    rename.hidden = !rename.hidden;
    if (!rename.hidden) rename.elements.name.focus();
  }));
  compareMenu(job).then((menu) => menu && part("result-actions")?.prepend(menu), () => {});
  part("result-tables").append(...[choiceTable(summary, job), truthTable(summary), planTable(job), provenanceTable(result)].filter(Boolean));
  return shown.close;
}
