// The table of jobs: one row a job, with filters and pages in the address; kept up to date while it is open.
import { keepQuery } from "../parts/address.js";
import { request } from "../parts/api.js";
import { make } from "../parts/dom.js";
import { followJobs } from "./followed_jobs.js";
import { jobFilters } from "./job_filters.js";
import { inTime } from "../parts/amounts.js";
import { duration, inWords, moment } from "../parts/job_words.js";
import { methodOf } from "../parts/results.js";
import { loadTitles, titleOfJob } from "../parts/titles.js";

const PAGE = 25;
const ENDED = ["succeeded", "failed", "cancelled"];
const PLACES = { dataset: "scans", volume: "rendering", mesh: "surfaces" };
// On a small screen the name of the column stands before each text.
const COLUMNS = ["Name", "Kind", "Scan", "State", "Started by", "When", "Duration", "Actions"];

// Roles in full, since a table that is laid out as cards is no table for a screen reader.
function row(cells, role = "cell") {
  const line = make("tr");
  line.setAttribute("role", "row");
  cells.forEach((content, i) => {
    const cell = make(role === "cell" ? "td" : "th");
    cell.setAttribute("role", role);
    if (role === "cell") cell.dataset.column = COLUMNS[i];
    cell.append(content);
    line.append(cell);
  });
  return line;
}

function nameOf(job) {
  return job.name || (job.kind === "reconstruction" ? methodOf(job) : inWords(job.kind));
}

function jobLink(job) {
  const anchor = make("a", "", nameOf(job));
  anchor.href = `#/jobs/${job.id}`;
  return anchor;
}

// What the job reads, or the scan that it made.
function source(job) {
  const field = ["mesh", "dataset", "volume"].find((one) => job[one] && !(one === "volume" && job.kind === "reconstruction"));
  if (!field) return "–";
  const anchor = make("a", "", titleOfJob(job));
  anchor.href = `#/${PLACES[field]}/${job[field]}`;
  return anchor;
}

function stateOf(job) {
  const box = make("div", "state-cell");
  box.append(make("span", `state ${job.state}`, job.state));
  const { done, total, phase } = job.progress;
  if (job.state === "running" && total) {
    const bar = make("progress");
    Object.assign(bar, { max: total, value: done });
    bar.setAttribute("aria-label", `Progress of ${nameOf(job)}`);
    box.append(bar, make("small", "", `${phase} ${Math.floor((100 * done) / total)} %`));
  }
  if (job.error) box.append(make("small", "reason", job.error.detail));
  return box;
}

function button(text, job, onClick) {
  const made = make("button", "quiet", text);
  made.type = "button";
  made.dataset.action = text;
  made.setAttribute("aria-label", `${text} ${nameOf(job)} of ${moment(job.created)}`);
  made.addEventListener("click", onClick);
  return made;
}

function when(job) {
  const time = make("time", "", moment(job.created));
  time.dateTime = job.created;
  time.title = inTime(job.created);
  return time;
}

// Show the table in root with the filters and the page of query. Returns { refresh, close }.
export async function jobTable(root, query) {
  let asked = new URLSearchParams([...query].filter(([name]) => ["batch", "text", "state", "kind", "before"].includes(name)));
  const rows = new Map();
  const error = make("p", "error");
  error.setAttribute("role", "alert");
  error.hidden = true;
  const told = make("p", "facts");
  told.setAttribute("role", "status");
  const body = make("tbody");
  body.setAttribute("role", "rowgroup");
  const head = make("thead");
  head.setAttribute("role", "rowgroup");
  head.append(row(COLUMNS, "columnheader"));
  const table = make("table", "job-table");
  table.setAttribute("role", "table");
  table.setAttribute("aria-label", "Jobs");
  table.append(head, body);
  const pages = make("nav", "pages");
  pages.setAttribute("aria-label", "Pages of the list");
  const batch = asked.get("batch");
  const filters = await jobFilters(asked, (changed) => {
    asked = changed;
    // The page of a batch stays that of the batch.
    if (batch) asked.set("batch", batch);
    keepQuery(asked);
    followed.refresh();
  });
  root.append(filters.form, error, told, table, pages);

  const show = (problem) => {
    error.textContent = problem ? problem.message : "";
    error.hidden = !problem;
  };

  async function act(promise) {
    try {
      show(null);
      await promise;
    } catch (problem) {
      return show(problem);
    }
    return followed.refresh();
  }

  function actions(job) {
    const box = make("div", "row-actions");
    if (job.links.cancel) box.append(button("Cancel", job, () => act(request(job.links.cancel, { method: "POST" }))));
    if (ENDED.includes(job.state)) {
      box.append(
        button("Delete", job, () => {
          const made = job.kind === "simulation" ? "Its scan stays." : "What it made is deleted too.";
          if (confirm(`Delete ${nameOf(job)} of ${moment(job.created)}? ${made}`)) act(request(job.links.self, { method: "DELETE" }));
        }),
      );
    }
    return box;
  }

  // Rows that stay the same keep their elements, and with them the focus; one that changes gives it to the same button.
  function draw(jobs) {
    const present = new Set(jobs.map((job) => job.id));
    for (const [id, { line }] of rows) {
      if (present.has(id)) continue;
      line.remove();
      rows.delete(id);
    }
    jobs.forEach((job, place) => {
      const { history, plan, advice, settings, ...shown } = job;
      if (ENDED.includes(job.state)) delete shown.progress;
      const signature = JSON.stringify([shown, titleOfJob(job)]);
      const known = rows.get(job.id);
      let line = known?.line;
      if (known?.signature !== signature) {
        const focused = line?.contains(document.activeElement) ? document.activeElement.dataset.action ?? "link" : "";
        const fresh = row([
          jobLink(job), inWords(job.kind), source(job), stateOf(job), job.started_by || "–", when(job),
          job.seconds === null ? "–" : duration(job.seconds), actions(job),
        ]);
        fresh.id = job.id;
        line?.replaceWith(fresh);
        line = fresh;
        rows.set(job.id, { line, signature });
        if (focused) (line.querySelector(`[data-action="${focused}"]`) ?? line.querySelector("a")).focus();
      }
      if (body.children[place] !== line) body.insertBefore(line, body.children[place] ?? null);
    });
  }

  function pageLink(text, more) {
    const address = new URLSearchParams(asked);
    address.delete("before");
    if (more) address.set("before", more);
    const anchor = make("a", "button", text);
    anchor.href = `#/jobs${address.size ? `?${address}` : ""}`;
    return anchor;
  }

  function scansLink() {
    const anchor = make("a", "", "To the scans");
    anchor.href = "#/";
    return anchor;
  }

  let older = "";

  async function read() {
    for (;;) {
      const mine = asked;
      const { jobs, next } = await request(`/v1/jobs?${new URLSearchParams([...mine, ["limit", PAGE]])}`);
      await loadTitles(jobs);
      // The filters may have been changed in the meantime.
      if (mine !== asked) continue;
      older = next && new URLSearchParams(next.split("?")[1]).get("before");
      return jobs;
    }
  }

  function onJobs(jobs) {
    draw(jobs);
    table.hidden = !jobs.length;
    const filtered = [...asked.keys()].some((name) => name !== "before" && name !== "batch");
    const none = filtered ? "No job matches these filters." : "Nothing has run yet. Upload a scan and press Fast or Best.";
    const many = `${jobs.length === 1 ? "1 job" : `${jobs.length} jobs`}${older ? " on this page, and older ones" : ""}`;
    told.textContent = jobs.length ? many : none;
    if (!jobs.length && !filtered) told.append(" ", scansLink());
    // Nothing to look for yet.
    filters.form.hidden = !jobs.length && !asked.size;
    const links = [asked.has("before") && pageLink("Newest jobs", ""), older && pageLink("Older jobs", older)].filter(Boolean);
    if (pages.dataset.links !== links.map(String).join(" ")) {
      pages.dataset.links = links.map(String).join(" ");
      pages.replaceChildren(...links);
    }
  }

  function onError(problem) {
    show(problem);
    if (problem && asked.has("before")) pages.replaceChildren(pageLink("Newest jobs", ""));
  }

  const followed = followJobs({ read, onJobs, onError });
  await followed.ready;
  return {
    refresh: followed.refresh,
    close() {
      followed.close();
      filters.close();
    },
  };
}
