// The shell of the viewer: opens the page that the address names, and shows the state of the service.
import { parse } from "./parts/address.js";
import { lost, request } from "./parts/api.js";
import { admitted, at } from "./parts/key.js";
import { Alert, html, render } from "./parts/view.js";
import { Waiting } from "./parts/waiting.js";
import { counted } from "./parts/words.js";

// A page is pages/NAME.js with open({ id, query }), which returns its view, or a promise of it.
const PAGES = [
  [/^\/$/, "start", "#/"],
  [/^\/scans\/([^/]+)$/, "scan", "#/"],
  [/^\/batch$/, "batch", "#/"],
  [/^\/jobs$/, "jobs", "#/jobs"],
  [/^\/jobs\/([^/]+)$/, "job", "#/jobs"],
  [/^\/compare\/([^/]+)$/, "compare", "#/jobs"],
  [/^\/rendering(?:\/([^/]+))?$/, "rendering", "#/rendering"],
  [/^\/surfaces(?:\/([^/]+))?$/, "surfaces", "#/surfaces"],
  [/^\/service$/, "service", "#/service"],
];
const HEALTH_MS = 15000;
const LOST_MS = 2000;
let visit = 0;
// Opens again what could not be opened, once the service answers.
let again = null;

const show = (view) => render(view, at("page"));

function markMenu(entry) {
  for (const anchor of at("pages").querySelectorAll("a")) anchor.ariaCurrent = anchor.getAttribute("href") === entry ? "page" : null;
}

async function openPage(first) {
  const mine = ++visit;
  again = null;
  const { path, query } = parse(location.hash);
  const found = PAGES.find(([pattern]) => pattern.test(path));
  document.title = "Bentray";
  markMenu(found?.[2]);
  show(html`<${Waiting} class="loading" key=${mine} words="Opening the page" />`);
  if (!first) at("page").focus({ preventScroll: true });
  scrollTo(0, 0);
  try {
    if (!found) throw new Error(`There is no page ${path}`);
    const [pattern, name] = found;
    const { open } = await import(`./pages/${name}.js`).catch(() => {
      // Browsers remember a module that they could not read until the page is loaded again.
      again = () => location.reload();
      throw lost();
    });
    const view = await open({ id: pattern.exec(path)[1], query });
    // The reader may have gone on while the page was opened.
    if (mine === visit) show(html`<div class="content" key=${mine}>${view}</div>`);
  } catch (error) {
    if (mine !== visit) return;
    again ??= () => openPage(false);
    const unknown = error.problem?.status === 404;
    const words = unknown ? `There is no ${error.problem.found}. It has been deleted, or belongs to another tenant or project.` : error.message;
    show(html`<h1>${unknown || !found ? "Not found" : "The page could not be opened"}</h1><${Alert} error=${words} />`);
  }
}

// A line at the top while the service does not answer; what is shown stays, and unfinished jobs are followed again.
document.addEventListener("connection", ({ detail: answered }) => {
  const line = at("offline");
  if (line.hidden === answered) return;
  line.hidden = answered;
  line.textContent = answered ? "" : "The service does not answer. The page tries again every two seconds.";
  if (answered) again?.();
  else showSign("not reached", false);
  checkHealthIn(answered ? 0 : LOST_MS);
});

let checking = 0;

function checkHealthIn(milliseconds) {
  clearTimeout(checking);
  checking = setTimeout(showHealth, milliseconds);
}

function showSign(words, good) {
  at("health").textContent = words;
  at("health").className = `health ${good ? "good" : "bad"}`;
}

async function showHealth() {
  try {
    const { workers } = await request("/health/ready");
    showSign(`ready, ${counted(workers, "worker", "workers")}`, true);
  } catch (error) {
    if (at("offline").hidden) showSign(error.message, false);
  }
  checkHealthIn(at("offline").hidden ? HEALTH_MS : LOST_MS);
}

// Pages that fit the window leave room for the bar at the top.
const bar = document.querySelector(".top");
new ResizeObserver(() => document.documentElement.style.setProperty("--top", `${bar.offsetHeight}px`)).observe(bar);

// A file that misses the drop zone must not take the place of the page.
for (const name of ["dragover", "drop"]) {
  addEventListener(name, (event) => event.dataTransfer?.types.includes("Files") && event.preventDefault());
}
at("skip").addEventListener("click", (event) => {
  event.preventDefault();
  at("page").focus();
});
showHealth();
if (await admitted()) {
  addEventListener("hashchange", () => openPage(false));
  openPage(true);
} else if (at("key").hidden) {
  show(html`<${Alert} error=${at("access").textContent} />`);
  const enter = () => request("/v1/access").then(() => location.reload(), () => setTimeout(enter, LOST_MS));
  setTimeout(enter, LOST_MS);
}
