// A list of the newest jobs as cards, kept up to date while the page is open.
import { linkTo } from "../parts/address.js";
import { request } from "../parts/api.js";
import { loadTitles, titleOfJob } from "../parts/titles.js";
import { Alert, html } from "../parts/view.js";
import { useJobs } from "./followed_jobs.js";
import { JobCard } from "./job_cards.js";

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
      ${jobs?.slice(0, MOST).map((job) => html`<${JobCard} key=${job.id} job=${job} onCancel=${() => change(job.links.cancel, "POST")}
        title=${titleOfJob(job) || job.dataset || job.volume || job.mesh} />`)}
    </ul>
    <p class="links" hidden=${!(jobs?.length > MOST)}><a href=${linkTo("/jobs", query)}>All in the table of jobs</a></p>`;
}
