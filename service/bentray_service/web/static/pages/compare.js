// Two to four results with one range of colours and one cursor: side by side, as difference, or with a border to swipe.
import { keepQuery } from "../parts/address.js";
import { FigureExport, undrawn } from "../parts/export_menu.js";
import { facts, loadResult, nameOf } from "../parts/result_tables.js";
import { html, Menu } from "../parts/view.js";
import { stateOf } from "../viewer/state.js";
import { Viewer } from "../viewer/viewer.js";

const LETTERS = "ABCD";
const MOST = LETTERS.length;

export async function open({ id, query }) {
  const ids = [...new Set(id.split(","))];
  if (ids.length < 2 || ids.length > MOST) throw new Error(`A comparison needs two to ${MOST} results, not ${ids.length}`);
  const results = await Promise.all(ids.map(loadResult));
  const dimensions = new Set(results.map(({ volume }) => volume.shape.length));
  if (dimensions.size > 1) throw new Error("An image and a volume cannot be compared");
  document.title = "Comparison – Bentray";
  const panes = results.map(({ job, values, summary, notes }, k) => ({ title: `${LETTERS[k]} ${job.title}`, values, notes, stored: summary.quantities }));
  const drawn = undrawn();
  return html`<div class="wide screen">
    <div class="head">
      <h1>Comparison</h1>
      <div id="result-actions" class="links">
        <${Menu} title="Export" className="export"><div class="sheet"><${FigureExport} drawn=${drawn} results=${results} name="comparison" /></div></${Menu}>
      </div>
    </div>
    <ol class="compared">
      ${results.map((result, k) => html`<li class="line">
        <a href=${`#/jobs/${result.job.id}`}>${LETTERS[k]}: ${nameOf(result)}</a>
        <span class="facts"> ${facts(result)}</span>
      </li>`)}
    </ol>
    <${Viewer} panes=${panes} state=${stateOf(query)} keep=${keepQuery} drawn=${drawn} aria-label="Images" />
  </div>`;
}
