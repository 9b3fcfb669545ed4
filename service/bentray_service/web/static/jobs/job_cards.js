// A list of the newest jobs as cards, kept up to date while the page is open: pictures, state, progress, plan, misfit and files.
import { glassOf, linkTo, queryOf, shownBy } from "../parts/address.js";
import { inWords, request } from "../parts/api.js";
import { FORMATS } from "../parts/export_menu.js";
import { KeyLink, Picture } from "../parts/key.js";
import { loadTitles, Renamable, titleOfJob } from "../parts/lists.js";
import { Alert, Button, html, useRead, useState } from "../parts/view.js";
import { Waiting } from "../parts/waiting.js";
import { duration, inNanoseconds, placeInQueue, settingsOf, tasksInWords } from "../parts/words.js";
import { useJobs } from "./followed_jobs.js";
import { residuals, Sparkline } from "./misfit_curve.js";

// An image that links to a larger one.
function Drawn({ address, words, larger = address }) {
  const [state, setState] = useState("drawing");
  return html`<div class=${`picture ${state}`}>
    ${state === "drawing" && html`<${Waiting} words="Drawing the image" />`}
    ${state === "failed"
      ? "The image could not be drawn."
      : html`<${KeyLink} href=${larger}><${Picture} address=${address} alt=${words} onShown=${() => setState("drawn")} onError=${() => setState("failed")} /></${KeyLink}>`}
  </div>`;
}

// The slice without a frame, whose text would be too small, and its range of colours; a 3-D volume is also rendered.
function Volume({ job, title }) {
  const [volume] = useRead(() => request(job.links.volume));
  if (!volume) return html`<div class="picture"><${Waiting} words="Reading the volume" /></div>`;
  const [low, high] = volume.value_range;
  const range = low < high ? { low, high } : {};
  const { refraction } = volume.links;
  return html`
    <${Drawn} address=${`${job.links.image}?${queryOf({ frame: false, size: 320, ...range })}`} words=${`Sound speed, ${title}`} larger=${job.links.image} />
    <p class="caption">Sound speed, ${Math.round(low)} (dark) to ${Math.round(high)} m/s (bright)</p>
    ${refraction && html`
      <${Drawn} address=${`${refraction}?${queryOf(glassOf(volume))}`} words=${`Volume rendering, ${title}`} />
      <p class="caption">Volume rendering</p>`}`;
}

// A turntable rests at its first frame; an animated picture plays when asked.
function Turntable({ job, title }) {
  const [plays, setPlays] = useState(false);
  const { frames, turn_deg: turn, format, ...view } = job.settings;
  const still = `${job.links.volume}/refraction.png?${queryOf(shownBy(view))}`;
  return html`
    <div class="picture"><${KeyLink} href=${still}><${Picture} address=${plays ? job.links.animation : still} alt=${`Volume rendering, ${title}`} /></${KeyLink}></div>
    ${format === "apng" && html`<${Button} onClick=${() => setPlays(!plays)}>${plays ? "Stop" : "Play"}</${Button}>`}`;
}

function Pictures({ job, title }) {
  const { field, image, animation } = job.links;
  if (field) return html`<${Drawn} address=${`${image}?${queryOf({ width: 320, height: 320, rays: 2 })}`} words=${`Surface rendering, ${title}`} />`;
  if (image) return html`<${Volume} job=${job} title=${title} />`;
  if (animation) return html`<${Turntable} job=${job} title=${title} />`;
  const ended = job.state === "failed" || job.state === "cancelled";
  const words = job.kind === "simulation" ? "A scan; it has no image yet" : "The image follows";
  return html`<div class=${ended || job.kind === "simulation" ? "picture none" : "picture"}>${ended ? "No image" : words}</div>`;
}

// The plan in a line, with details on demand.
export function Plan({ plan }) {
  const time = plan.minutes ? `, about ${duration(60 * plan.minutes)}` : "";
  return html`<details class="plan">
    <summary>Plan: ${tasksInWords(plan)}${time}</summary>
    <p>${plan.why}</p>
  </details>`;
}

function Progress({ job: { progress: { done, total, phase }, seconds } }) {
  const share = total ? `${phase} ${Math.floor((100 * done) / total)} %` : "starting";
  return html`
    ${total
      ? html`<progress key="share" aria-label="Progress" max=${total} value=${done}></progress>`
      : html`<progress key="unknown" aria-label="Progress"></progress>`}
    <p>${share} · ${duration(seconds || 0)}</p>`;
}

function Links({ job: { links }, onCancel }) {
  const { field, animation, data, cancel } = links;
  return html`<div class="links">
    ${field && html`<${KeyLink} href=${links.geometry_image}>Geometry image</${KeyLink}>
      <${KeyLink} href=${links.normal_map}>Normal map</${KeyLink}>
      <${KeyLink} href=${field}>Figures</${KeyLink}>`}
    ${animation && html`<${KeyLink} href=${animation} download="">Frames</${KeyLink}>`}
    ${data && html`<details class="formats">
      <summary>Download</summary>
      ${FORMATS.map(({ format, title }) => html`<${KeyLink} href=${`${data}?format=${format}`} download="">${title}</${KeyLink}> `)}
    </details>`}
    ${cancel && html`<${Button} onClick=${onCancel}>Cancel</${Button}>`}
  </div>`;
}

function JobCard({ job, title, onCancel, onRename }) {
  const course = residuals(job.history);
  const { values } = course;
  const unfinished = job.state === "running" || job.state === "cancelling";
  return html`<li class="job" id=${job.id}>
    <div class="pictures"><${Pictures} key=${job.state} job=${job} title=${title} /></div>
    <div>
      <h2><${Renamable} record=${job} field="name" name=${job.title} onRename=${onRename}><a href=${`#/jobs/${job.id}`}>${job.title}</a></${Renamable}><span class=${`state ${job.state}`}>${job.state}</span></h2>
      <p class="input">${title}</p>
      <p>${settingsOf(job)}</p>
      ${job.ahead !== null && html`<p>${placeInQueue(job.ahead)}</p>`}
      ${job.plan && html`<${Plan} plan=${job.plan} />`}
      ${job.advice && html`<p>${job.advice}</p>`}
      ${unfinished && html`<${Progress} job=${job} />`}
      ${!unfinished && job.seconds !== null && job.finished && html`<p>took ${duration(job.seconds)}</p>`}
      ${values.length > 0 && html`<p>residual ${inNanoseconds(values[0])}${values.length > 1 && ` → ${inNanoseconds(values.at(-1))}`}</p>`}
      ${values.length > 1 && html`<${Sparkline} ...${course} />`}
      ${job.error && html`<p class="error">${inWords(job.error)}</p>`}
      <${Links} job=${job} onCancel=${onCancel} />
    </div>
  </li>`;
}

// The newest ones are shown, the others are in the table of jobs.
const MOST = 6;

// filters: of the table of jobs; read(): jobs, by default those with the filters; onJobs(jobs) is called with all of them; refresh:
// { current } that gets a function that reads them again.
export function JobList({ empty = "", filters = {}, read, onJobs, refresh = {} }) {
  const query = new URLSearchParams(filters);
  const [jobs, error, again, change] = useJobs({
    async read() {
      const found = await (read ? read() : request(`/v1/jobs?${query}`).then((answer) => answer.jobs));
      await loadTitles(found);
      return found;
    },
    onJobs,
  });
  refresh.current = again;
  return html`
    <${Alert} id="jobs-error" error=${error} />
    <p class="empty" hidden=${!jobs || jobs.length > 0}>${empty}</p>
    <ul class="jobs" id="jobs">
      ${jobs?.slice(0, MOST).map((job) => html`<${JobCard} key=${job.id} job=${job} onRename=${again} onCancel=${() => change(job.links.cancel, "POST")}
        title=${titleOfJob(job) || job.dataset || job.volume || job.mesh} />`)}
    </ul>
    <p class="links" hidden=${!(jobs?.length > MOST)}><a href=${linkTo("/jobs", query)}>All in the table of jobs</a></p>`;
}
