// Several scans with one set of settings: choose them, start one reconstruction of each, and follow them as one batch.
import { go } from "../parts/address.js";
import { send } from "../parts/api.js";
import { load, titleOf } from "../parts/lists.js";
import { readSettings, SettingsForm, useSettings } from "../parts/settings_form.js";
import { Alert, Button, Facts, Field, Form, html, Section, useShown, useState } from "../parts/view.js";
import { counted, inTime } from "../parts/words.js";

const wordsOf = (scan) => `${scan.ntx} emitters × ${scan.nrx} receivers · ${inTime(scan.created)}`;

// chosen: ids, as a Set.
function Choice({ scans, chosen, onChange }) {
  const [text, setText] = useState("");
  const shows = (scan) => `${titleOf(scan)}${wordsOf(scan)}`.toLowerCase().includes(text);
  const toggle = ({ target }) => {
    const others = [...chosen].filter((id) => id !== target.value);
    onChange(new Set(target.checked ? [...others, target.value] : others));
  };
  // In the filter it is no start of a batch.
  const ignoreEnter = (event) => event.key === "Enter" && event.preventDefault();
  const none = scans.length ? "No scan is chosen." : "No scan is stored yet.";
  return html`<${Section} id="choice" title="Scans">
    <div class="line-form">
      <${Field} caption="Show scans with" id="choice-filter" type="search" onKeyDown=${ignoreEnter}
        onInput=${({ target }) => setText(target.value.trim().toLowerCase())} />
      <${Button} id="choose-all" onClick=${() => onChange(new Set([...chosen, ...scans.filter(shows).map((scan) => scan.id)]))}>Choose all shown</${Button}>
      <${Button} id="choose-none" onClick=${() => onChange(new Set())}>Choose none</${Button}>
    </div>
    <ul id="choices" class="choices" aria-labelledby="choice-title">
      ${scans.map((scan) => html`<li key=${scan.id} hidden=${!shows(scan)}>
        <label>
          <input type="checkbox" name="dataset" value=${scan.id} checked=${chosen.has(scan.id)} onChange=${toggle} />
          <span>${titleOf(scan)}</span>
          <small>${wordsOf(scan)}</small>
        </label>
      </li>`)}
    </ul>
    <p id="choice-count" class="facts" role="status">${chosen.size ? `${chosen.size} of ${scans.length} scans chosen, one job each.` : none}</p>
  </${Section}>`;
}

function Batch({ scans, groups }) {
  const [chosen, setChosen] = useState(new Set());
  const [{ error, opened, sending }, setState] = useState({ error: null, opened: false, sending: false });
  const settings = useSettings(groups);
  const shown = useShown();

  async function start({ currentTarget: { elements } }) {
    const same = settings.changed(true);
    if (!same) return setState({ error: null, opened: true, sending: false });
    const datasets = scans.map((scan) => scan.id).filter((id) => chosen.has(id));
    const body = { datasets, name: elements.name.value.trim(), settings: same, webhook: elements.webhook.value.trim() || null };
    setState({ error: null, opened, sending: true });
    try {
      const made = await send("POST", "/v1/batches", body);
      if (shown.current) go(`/jobs?batch=${made.id}`);
    } catch (problem) {
      const placed = settings.refuse(problem.problem ?? {}, false);
      setState({ error: placed ? null : problem, opened: opened || placed, sending: false });
      // Once the settings are open.
      if (placed) setTimeout(() => shown.current && settings.refuse(problem.problem, true));
    }
    return undefined;
  }

  return html`
    <p class="crumb"><a href="#/">Scans</a></p>
    <h1>Reconstruct several scans</h1>
    <${Form} id="batch-form" novalidate onSubmit=${start}>
      <${Choice} scans=${scans} chosen=${chosen} onChange=${setChosen} />
      <${Section} id="same" title="The same for all">
        <${Field} caption="Name of the batch" name="name" type="text" maxlength="200" />
        <details id="batch-own" open=${opened} onToggle=${({ target }) => setState((before) => ({ ...before, opened: target.open }))}>
          <summary>All settings</summary>
          <div id="batch-settings"><${SettingsForm} groups=${groups} form=${settings} /></div>
        </details>
        <details id="batch-webhook">
          <summary>Webhook</summary>
          <${Field} caption="Address that receives a signed message when each job ends" name="webhook" type="url" maxlength="2000"
            placeholder="https://" />
        </details>
        <${Facts}>As they are, rays and method are chosen automatically for each scan.</${Facts}>
        <button id="batch-start" type="submit" disabled=${sending || !chosen.size}>${chosen.size ? `Start ${counted(chosen.size, "job", "jobs")}` : "Start"}</button>
        <${Alert} id="batch-error" error=${error} />
      </${Section}>
    </${Form}>`;
}

export async function open() {
  document.title = "Reconstruct several scans – Bentray";
  const [scans, groups] = await Promise.all([load("datasets"), readSettings()]);
  return html`<${Batch} scans=${scans} groups=${groups} />`;
}
