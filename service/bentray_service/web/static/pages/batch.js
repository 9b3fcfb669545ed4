// Several scans with one set of settings: choose them, start one reconstruction of each, and follow them as one batch.
import { go } from "../parts/address.js";
import { inTime } from "../parts/amounts.js";
import { request } from "../parts/api.js";
import { at, make, showError } from "../parts/dom.js";
import { settingsForm } from "../parts/settings_form.js";
import { load, titleOf } from "../parts/titles.js";

const PAGE = `
  <p class="crumb"><a href="#/">Scans</a></p>
  <h1>Reconstruct several scans</h1>
  <form id="batch-form" novalidate>
    <section class="panel" aria-labelledby="choice-title">
      <h2 id="choice-title">Scans</h2>
      <div class="line-form">
        <label><span class="caption">Show scans with</span>
          <input id="choice-filter" type="search" autocomplete="off"></label>
        <button id="choose-all" type="button" class="quiet">Choose all shown</button>
        <button id="choose-none" type="button" class="quiet">Choose none</button>
      </div>
      <ul id="choices" class="choices" aria-labelledby="choice-title"></ul>
      <p id="choice-count" class="facts" role="status"></p>
    </section>
    <section class="panel" aria-labelledby="same-title">
      <h2 id="same-title">The same for all</h2>
      <label><span class="caption">Name of the batch</span>
        <input name="name" type="text" maxlength="200" autocomplete="off"></label>
      <details id="batch-own">
        <summary>All settings</summary>
        <div id="batch-settings"><p class="facts">Reading the settings</p></div>
      </details>
      <details id="batch-webhook">
        <summary>Webhook</summary>
        <label><span class="caption">Address that receives a signed message when each job ends</span>
          <input name="webhook" type="url" maxlength="2000" autocomplete="off" placeholder="https://"></label>
      </details>
      <p class="facts">As they are, rays and method are chosen automatically for each scan.</p>
      <button id="batch-start" type="submit" disabled>Start</button>
      <p id="batch-error" class="error" role="alert" hidden></p>
    </section>
  </form>`;

const JSON_TYPE = { "Content-Type": "application/json" };

function choice(scan) {
  const item = make("li");
  const label = make("label");
  const box = make("input");
  Object.assign(box, { type: "checkbox", name: "dataset", value: scan.id });
  const words = make("small", "", `${scan.ntx} emitters × ${scan.nrx} receivers · ${inTime(scan.created)}`);
  label.append(box, make("span", "", titleOf(scan)), words);
  item.append(label);
  return item;
}

export async function open(root) {
  document.title = "Reconstruct several scans – Bentray";
  const [scans, settings] = await Promise.all([load("datasets"), settingsForm()]);
  root.innerHTML = PAGE;
  const form = at("batch-form");
  at("batch-settings").replaceChildren(settings.node);
  at("choices").replaceChildren(...scans.map(choice));
  const items = [...at("choices").children];
  const boxes = items.map((item) => item.querySelector("input"));
  const chosen = () => boxes.filter((box) => box.checked).map((box) => box.value);

  function count() {
    const { length } = chosen();
    const none = scans.length ? "No scan is chosen." : "No scan is stored yet.";
    at("choice-count").textContent = length ? `${length} of ${scans.length} scans chosen, one job each.` : none;
    at("batch-start").disabled = !length;
    at("batch-start").textContent = length ? `Start ${length === 1 ? "1 job" : `${length} jobs`}` : "Start";
  }

  at("choice-filter").addEventListener("input", ({ target }) => {
    const text = target.value.trim().toLowerCase();
    items.forEach((item) => {
      item.hidden = !item.textContent.toLowerCase().includes(text);
    });
  });
  at("choose-all").addEventListener("click", () => {
    items.forEach((item, i) => {
      if (!item.hidden) boxes[i].checked = true;
    });
    count();
  });
  at("choose-none").addEventListener("click", () => {
    for (const box of boxes) box.checked = false;
    count();
  });
  at("choices").addEventListener("change", count);
  // Enter in the filter is no start of a batch.
  at("choice-filter").addEventListener("keydown", (event) => event.key === "Enter" && event.preventDefault());
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const datasets = chosen();
    const same = settings.changed(true);
    if (!same || !datasets.length) {
      at("batch-own").open ||= !same;
      return;
    }
    const { name, webhook } = form.elements;
    const body = { datasets, name: name.value.trim(), settings: same, webhook: webhook.value.trim() || null };
    showError("batch-error", null);
    at("batch-start").disabled = true;
    try {
      const made = await request("/v1/batches", { method: "POST", headers: JSON_TYPE, body: JSON.stringify(body) });
      if (root.isConnected) go(`/jobs?batch=${made.id}`);
    } catch (error) {
      if (!root.isConnected) return;
      at("batch-start").disabled = false;
      const placed = settings.refuse(error.problem ?? {}, false);
      at("batch-own").open ||= placed;
      if (placed) settings.refuse(error.problem, true);
      else showError("batch-error", error);
    }
  });
  count();
  return () => {};
}
