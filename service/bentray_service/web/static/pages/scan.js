// One scan: its geometry, facts, quality and traces, the reconstruction to start, and the reconstructions of it.
import { JobList } from "../jobs/job_cards.js";
import { PRESETS } from "../jobs/onward.js";
import { go } from "../parts/address.js";
import { request, send } from "../parts/api.js";
import { KeyLink, Picture } from "../parts/key.js";
import { titleOf } from "../parts/lists.js";
import { readSettings, SettingsForm, useSettings } from "../parts/settings_form.js";
import { Alert, Button, Form, html, Section, useAct, useEffect, useRead, useReducer, useRef, useState } from "../parts/view.js";
import { Waiting } from "../parts/waiting.js";
import { planInWords, planOf, waitInWords } from "../parts/words.js";
import { ScanEditor } from "../scans/scan_edit.js";
import { Elements, factRows, inWordsOf, Quality } from "../scans/scan_facts.js";
import { Shot } from "../scans/shot.js";

const PLAN_MS = 400;

function factsOf(scan) {
  const times = scan.has_travel_times ? "travel times" : "raw traces";
  const slices = scan.slices > 1 ? ` · ${scan.slices} slices` : "";
  const stated = scan.water_temperature_c;
  const water = stated === null ? `water ${scan.water_speed_mps.toFixed(1)} m/s` : `water ${stated} °C, stated here`;
  return `${scan.ntx} emitters × ${scan.nrx} receivers · ${times}${slices} · ${water}`;
}

// A button with the time that its settings take; a plan that is refused says why. changes: of jobs, which change the time.
function Preset({ id, name, title, words, scan, changes }) {
  const job = { kind: "reconstruction", dataset: scan.id, settings: PRESETS[name] };
  const [estimate, error] = useRead(() => planOf(job), { key: changes });
  return html`<button id=${id} type="submit" value=${name}>${title}
    <small id=${`${name}-words`}>${words}</small>
    <small class="time" id=${`${name}-time`} title=${estimate?.basis}>${estimate ? waitInWords(estimate) : error?.message ?? "estimating the time"}</small></button>`;
}

// The plan of the settings in the form, in words: [words, later]; later() asks for it a moment after a change.
function usePlan(scan, form) {
  const [asked, later] = useReducer((count) => count + 1, 0);
  const [words, setWords] = useState("");
  const [estimate, error] = useRead(async () => {
    const settings = asked ? form.changed(false) : null;
    return settings && planOf({ kind: "reconstruction", dataset: scan.id, settings });
  }, { key: asked, settle: PLAN_MS });
  useEffect(() => {
    // A setting that the service refuses is told at its field before anything is started.
    if (error) setWords(form.refuse(error.problem ?? {}, false) ? "" : error.message);
    else setWords(estimate ? `${planInWords(estimate)}. ${estimate.basis}` : "");
  }, [estimate, error]);
  return [words, later];
}

// from: the id of a job whose settings are run again with changes; changes: of jobs; onStarted() is called after a start.
function Run({ scan, from, changes, onStarted }) {
  const [read, readError] = useRead(() => Promise.all([
    readSettings(),
    from && request(`/v1/jobs/${from}`).catch((problem) => setError(problem)),
  ]));
  const [groups, earlier] = read ?? [];
  const [opened, setOpened] = useState(false);
  const [error, act, setError] = useAct();
  const form = useSettings(groups, { scan_traces: scan.has_traces, scan_picks: !scan.has_travel_times });
  const [plan, later] = usePlan(scan, form);
  useEffect(() => {
    if (earlier) setOpened(true);
  }, [earlier]);

  function start({ submitter }) {
    // Enter in a setting starts with it, though the browser names the first button of the form.
    const choice = document.activeElement?.closest("#run-settings") ? "own" : submitter?.value;
    const [own, onward] = ["own", "onward"].map((value) => choice === value);
    const settings = own ? form.changed(true) : PRESETS[choice] ?? PRESETS.fast;
    if (settings) act(async () => {
      const started = send("POST", "/v1/jobs", { kind: "reconstruction", dataset: scan.id, settings });
      await started.then(({ id }) => (onward ? go(`/jobs/${id}?then=best`) : onStarted()), (problem) => {
        if (!own || !form.refuse(problem.problem ?? {}, true)) throw problem;
      });
    });
  }

  const best = scan.has_traces ? "then full waveform, where it predicts unused traces better" : "the same here: full waveforms need traces, and the file has none";
  return html`<${Section} id="run" title="Reconstruction">
    <${Form} id="run" novalidate onSubmit=${start}>
      <p class="links"><button id="reconstruct" type="submit" value="onward">Reconstruct</button>
        <small>Fast is drawn first; where it is not enough, Best follows in its place.</small></p>
      <div class="presets">
        <${Preset} id="start" name="fast" title="Fast" words="rays and method chosen automatically" scan=${scan} changes=${changes} />
        <${Preset} id="best" name="best" title="Best" words=${best} scan=${scan} changes=${changes} />
      </div>
      <details id="run-own" open=${opened} onToggle=${({ target }) => {
        setOpened(target.open);
        if (target.open && groups) later();
      }}>
        <summary>All settings</summary>
        <div id="run-settings"><${SettingsForm} groups=${groups} earlier=${earlier?.settings} form=${form} onInput=${later} /></div>
        <p id="own-plan" class="facts" role="status">${plan}</p>
        <button id="start-own" type="submit" value="own" disabled=${!groups}>Start</button>
      </details>
      <${Alert} id="run-error" error=${error ?? readError} />
    </${Form}>
  </${Section}>`;
}

// element: the one that emits; openWater(): opens the form of the water; onChange(scan) gets the record after a change.
function About({ scan, geometry, geometryError, element, openWater, onChange }) {
  const address = `/v1/datasets/${scan.id}/quality`;
  const water = scan.water_temperature_c ?? "";
  const [report, error] = useRead(() => request(address), { key: water });
  const [opened, setOpened] = useState(false);
  // The water of the picture of the report that is shown.
  const [drawn, setDrawn] = useState(null);
  const [waterError, act] = useAct();
  const useWater = (celsius) => act(async () => onChange(await send("PATCH", `/v1/datasets/${scan.id}`, { water_temperature_c: celsius })));
  return html`<${Section} id="about" title="Geometry and quality">
    <div class="about">
      <figure id="elements" class="figure">
        ${!geometry && !geometryError && html`<${Waiting} words="Reading the geometry" />`}
        ${geometry && html`
          <${Elements} geometry=${geometry} chosen=${element} />
          <figcaption class="facts">${inWordsOf(geometry)}. Circles emit, dots receive.</figcaption>`}
      </figure>
      <div>
        <dl id="scan-facts" class="terms">
          ${geometry && factRows(geometry, scan).map(([term, value]) => html`
            <dt>${term}</dt>
            <dd data-term=${term}>${value}
              ${term === "Water" && html` <${Button} aria-label="Correct the water temperature" onClick=${openWater}>Correct</${Button}>`}</dd>`)}
        </dl>
        <${Alert} id="geometry-error" error=${geometryError} />
        <h3>Quality</h3>
        <div id="quality">
          ${report && html`<${Quality} report=${report} several=${scan.slices > 1} useWater=${useWater} />`}
          ${!report && !error && html`<${Waiting} words="Checking the scan" />`}
        </div>
        <${Alert} id="quality-error" error=${error ?? waterError} />
      </div>
    </div>
    <details id="quality-more" onToggle=${({ target }) => setOpened(opened || target.open)}>
      <summary>Matrix and histogram of the travel times, excluded pairs</summary>
      ${/* Another fragment after another temperature, or the browser would keep the picture that it has. */
        opened && html`
          ${drawn !== water && html`<${Waiting} words="Drawing the report" />`}
          <${Picture} id="quality-picture" class="report" address=${`${address}.png#${water}`} onShown=${() => setDrawn(water)} onError=${() => setDrawn(water)}
          alt="Traces with picks, matrix and histogram of the travel times, excluded pairs with reasons, findings" />`}
      <p><${KeyLink} id="quality-page" href=${`${address}.png`} target="_blank" rel="noopener">Quality report as an image</${KeyLink}></p>
    </details>
  </${Section}>`;
}

function Scan({ scan: first, from }) {
  const [scan, setScan] = useState(first);
  const [changes, setChanges] = useState(0);
  const states = useRef(null);
  const [element, setElement] = useState(null);
  const [refresh, openWater] = [useRef(null), useRef(null)];
  const water = scan.water_temperature_c ?? "";
  const [geometry, geometryError] = useRead(() => request(`/v1/datasets/${scan.id}/geometry`), { key: water });
  useEffect(() => {
    document.title = `${titleOf(scan)} – Bentray`;
  }, [scan]);
  // A job that ends changes the estimates, one that waits the place in the queue.
  function onJobs(jobs) {
    const now = jobs.map((job) => job.id + job.state).join();
    if (states.current !== null && states.current !== now) setChanges((count) => count + 1);
    states.current = now;
  }
  const hasWater = geometry ? geometry.water_shot : geometryError ? false : null;
  return html`
    <h1 id="scan-name">${titleOf(scan)}</h1>
    <p id="dataset-facts" class="facts">${factsOf(scan)}</p>
    <${ScanEditor} scan=${scan} proposed=${geometry?.proposed_corrections ?? []} onChange=${setScan} openWater=${openWater} />
    <${Run} scan=${scan} from=${from} changes=${changes} onStarted=${() => refresh.current()} />
    <${Section} id="jobs" title="Reconstructions of this scan" className="of-scan">
      <${JobList} refresh=${refresh} empty="Nothing has run yet. Press Fast or Best. The image appears here."
        filters=${{ kind: "reconstruction", text: scan.id }} onJobs=${onJobs} />
    </${Section}>
    <${About} scan=${scan} geometry=${geometry} geometryError=${geometryError} element=${element} openWater=${() => openWater.current()} onChange=${setScan} />
    ${scan.has_traces && html`<${Shot} key=${water} scan=${scan} hasWater=${hasWater} onEmission=${setElement} />`}`;
}

export async function open({ id, query }) {
  return html`<${Scan} scan=${await request(`/v1/datasets/${id}`)} from=${query.get("from")} />`;
}
