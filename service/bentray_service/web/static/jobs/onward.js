// From a first image by rays on to full waveforms where these are advised: the offer, the second job in place of the image, and its stop.
import { keepQuery, pick } from "../parts/address.js";
import { request, send } from "../parts/api.js";
import { Alert, Button, html, useAct, useEffect, useRead, useState } from "../parts/view.js";
import { planOf, waitInWords } from "../parts/words.js";
import { isUnfinished } from "./followed_jobs.js";
import { LiveJob } from "./live_job.js";

// Best may take half an hour of one processor core for full waveforms.
export const PRESETS = { fast: { method: "auto" }, best: { method: "auto", minutes: 30 } };

function Offer({ times, job, onStart }) {
  const [estimate] = useRead(() => planOf(job));
  const takes = estimate && estimate.minutes !== null ? ` Best takes ${waitInWords(estimate)}.` : "";
  return html`<p id="onward" class="notice" role="note">
    Fast is not enough for this scan (held-out misfit ${times.toPrecision(2)} × noise).${takes}${" "}
    <${Button} id="onward-start" quiet=${false} onClick=${onStart}>Go on to Best</${Button}>
  </p>`;
}

// children: the image of the job. query: then=best starts the second job at once; best: the id of one that runs.
export function Onward({ job, summary, query, children }) {
  const times = summary.misfit_over_noise;
  const [best, setBest] = useState(null);
  const [error, act] = useAct();
  const next = { kind: "reconstruction", dataset: job.dataset, settings: PRESETS.best };
  const start = () => act(async () => {
    const started = await send("POST", "/v1/jobs", next);
    // A page that is loaded again follows this job, and starts none.
    keepQuery(new URLSearchParams({ best: started.id }));
    setBest(started);
  });
  const follow = (id) => act(async () => {
    const started = await request(`/v1/jobs/${id}`);
    if (isUnfinished(started)) setBest(started);
  });
  useEffect(() => {
    if (query.get("best")) follow(query.get("best"));
    else if (times !== null && query.get("then") === "best") start();
  }, []);
  if (best) return html`<${LiveJob} first=${best} before=${children} onSuccess=${() => location.replace(`#/jobs/${best.id}`)} />`;
  return html`
    ${times !== null && html`<${Offer} times=${times} job=${next} onStart=${start} />`}
    <${Alert} id="onward-error" error=${error} />
    ${children}`;
}

// The parameters of ``Onward`` in an address, which the view of an image keeps.
export const onwardIn = (query) => pick(query, ["best"]);
