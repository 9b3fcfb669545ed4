// The result of a reconstruction: image to measure in, how it was made, and what can be done with it.
import { Onward, onwardIn } from "../jobs/onward.js";
import { go, keepQuery, parse, queryOf } from "../parts/address.js";
import { kept, request } from "../parts/api.js";
import { ExportMenu, undrawn } from "../parts/export_menu.js";
import { deleteRecord, Renamable, Thumbnail } from "../parts/lists.js";
import { Provenance } from "../parts/provenance.js";
import { ChoiceTable, facts, loadResult, nameOf, PlanTable, TruthTable } from "../parts/result_tables.js";
import { Alert, Button, CopyButton, Facts, Form, html, Menu, useAct, useEffect, useRead, useState } from "../parts/view.js";
import { inTime } from "../parts/words.js";
import { QUANTITIES } from "../viewer/quantities.js";
import { stateOf } from "../viewer/state.js";
import { Viewer } from "../viewer/viewer.js";

// The view of a result as code: Python with the client of Bentray, and curl.
function pythonOf({ job, volume }, stored) {
  const name = stored === "truth" ? "speed" : stored;
  return [
    "import bentray",
    "",
    `with bentray.Client("${location.origin}") as client:`,
    `    result = client.result("${volume.id}")  # of ${job.id}`,
    `${name} = result.${name}  # ${volume.shape.join(" × ")} nodes, ${name === "speed" ? "m/s" : "SI units"}`,
    'x, y = (1e3 * result.coordinates[axis] for axis in ("x", "y"))  # mm',
    "",
  ].join("\n");
}

function curlOf({ volume }, stored) {
  const query = queryOf({ format: "npy", quantity: stored });
  const key = kept("key") ? ' -H "Authorization: Bearer $BENTRAY_KEY"' : "";
  return `curl${key} -o ${stored}.npy '${location.origin}${volume.links.data}?${query}'\n`;
}

// Results of other jobs to compare this one with, at most three.
function CompareMenu({ job }) {
  const [found] = useRead(() => request("/v1/jobs?kind=reconstruction&state=succeeded&limit=100"));
  const [chosen, setChosen] = useState([]);
  const isSame = (other) => other.dataset === job.dataset;
  const others = found?.jobs.filter((other) => other.id !== job.id).sort((a, b) => isSame(b) - isSame(a)) ?? [];
  if (!others.length) return null;
  const choose = ({ currentTarget }) => setChosen(new FormData(currentTarget).getAll("other"));
  return html`<${Menu} title="Compare with">
    <${Form} class="sheet" onChange=${choose} onSubmit=${() => go(`/compare/${[job.id, ...chosen].join(",")}`)}>
      <div class="others">
        ${others.map((other) => html`<label key=${other.id}><input type="checkbox" name="other" value=${other.id} /> <${Thumbnail} record=${other} />
          ${other.title}, ${isSame(other) ? "this scan" : "another scan"}, ${inTime(other.created)}</label>`)}
      </div>
      <${Facts}>One to three others</${Facts}>
      <button type="submit" disabled=${chosen.length < 1 || chosen.length > 3}>Compare</button>
    </${Form}>
  </${Menu}>`;
}

function Result({ result: first, query }) {
  const [job, setJob] = useState(first.job);
  const [state] = useState(() => stateOf(query));
  const [drawn] = useState(undrawn);
  const [error, act] = useAct();
  const result = { ...first, job };
  const { volume, summary, values, notes } = result;
  const width = summary.resolution_width_m[Math.floor(summary.resolution_width_m.length / 2)];
  const name = nameOf(result);
  useEffect(() => {
    document.title = `${name} – Bentray`;
  }, [name]);

  const remove = () => deleteRecord(act, `the result ${name}`, volume.links.self, "/jobs");
  // The view beside the job that goes on from this one.
  const keep = (view) => keepQuery(new URLSearchParams([...view, ...onwardIn(parse(location.hash).query)]));
  const stored = () => QUANTITIES[state.quantity].reads[0];
  return html`<div class="wide screen">
    <div class="head">
      <p class="crumb"><a href="#/jobs">Jobs</a> · <a id="result-scan" href=${`#/scans/${job.dataset}`}>Scan</a></p>
      <${Renamable} record=${job} field="name" name=${name} onRename=${setJob}><h1 id="result-name">${name}</h1></${Renamable}>
      <div id="result-actions" class="links">
        <${CompareMenu} job=${job} />
        <${ExportMenu} result=${result} drawn=${drawn} />
        <a class="button quiet" href=${`#/scans/${job.dataset}?from=${job.id}`}>Run again with changes</a>
        <${Menu} title="More">
          <div class="sheet">
            <${CopyButton} title="Copy link" text=${() => location.href} />
            <${CopyButton} title="Copy as Python" text=${() => pythonOf(result, stored())} />
            <${CopyButton} title="Copy as curl" text=${() => curlOf(result, stored())} />
            <${Button} onClick=${remove}>Delete</${Button}>
          </div>
        </${Menu}>
      </div>
    </div>
    <p id="result-facts" class="facts line" title=${facts(result)}>${facts(result)}</p>
    <div id="result-cautions">
      ${summary.cautions.map(({ doubtful, text }) => html`<p class=${doubtful ? "error" : "notice"} role="note">${doubtful && "Doubtful result. "}${text}</p>`)}
    </div>
    <${Alert} id="result-error" error=${error} />
    <${Onward} job=${job} summary=${summary} query=${query}>
      <${Viewer} panes=${[{ title: name, values, notes, stored: summary.quantities, detail: width && 1e3 * width }]} state=${state} keep=${keep} drawn=${drawn} id="result-viewer" aria-label="Image" />
    </${Onward}>
  </div>
  <div class="wide">
    <div id="result-tables" class="result-tables">
      <${ChoiceTable} ...${summary} advice=${job.advice} />
      <${TruthTable} truth=${summary.truth} />
      <${PlanTable} plan=${job.plan} />
      <${Provenance} job=${job} volume=${volume} />
    </div>
  </div>`;
}

export const open = async ({ id, query }) => html`<${Result} result=${await loadResult(id)} query=${query} />`;
