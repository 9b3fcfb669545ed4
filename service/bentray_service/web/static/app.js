// The shell of the viewer: opens the page that the address names, and shows the state of the service.
import { request } from "./parts/api.js";
import { at, make } from "./parts/dom.js";
import { admitted } from "./parts/key.js";
import { parse } from "./parts/address.js";

// A page is pages/NAME.js with open(root, { id, query }), which returns close(), or a promise of it.
const PAGES = [
  [/^\/$/, "start", "#/"],
  [/^\/scans\/([^/]+)$/, "scan", "#/"],
  [/^\/jobs$/, "jobs", "#/jobs"],
  [/^\/jobs\/([^/]+)$/, "job", "#/jobs"],
  [/^\/compare\/([^/]+)$/, "compare", "#/jobs"],
  [/^\/rendering(?:\/([^/]+))?$/, "rendering", "#/rendering"],
  [/^\/surfaces(?:\/([^/]+))?$/, "surfaces", "#/surfaces"],
  [/^\/service$/, "service", "#/service"],
];
const HEALTH_MS = 15000;
let closeShown = () => {};
let visit = 0;

function markMenu(entry) {
  for (const anchor of at("pages").querySelectorAll("a")) {
    if (anchor.getAttribute("href") === entry) anchor.setAttribute("aria-current", "page");
    else anchor.removeAttribute("aria-current");
  }
}

async function openPage(first) {
  const mine = ++visit;
  const { path, query } = parse(location.hash);
  const found = PAGES.find(([pattern]) => pattern.test(path));
  closeShown();
  closeShown = () => {};
  document.title = "Bentray";
  markMenu(found?.[2]);
  const root = make("div", "content");
  const waiting = make("p", "loading", "Opening the page");
  at("page").replaceChildren(waiting, root);
  if (!first) at("page").focus({ preventScroll: true });
  scrollTo(0, 0);
  try {
    if (!found) throw new Error(`There is no page ${path}`);
    const [pattern, name] = found;
    const { open } = await import(`./pages/${name}.js`);
    if (mine !== visit) return;
    const close = await open(root, { id: pattern.exec(path)[1], query });
    // The reader may have gone on while the page was opened.
    if (mine === visit) closeShown = close;
    else close();
  } catch (error) {
    if (mine !== visit) return;
    const message = make("p", "error", error.message);
    message.setAttribute("role", "alert");
    root.replaceChildren(message);
  } finally {
    waiting.remove();
  }
}

async function showHealth() {
  const sign = at("health");
  try {
    const { workers } = await request("/health/ready");
    sign.textContent = workers === 1 ? "ready, 1 worker" : `ready, ${workers} workers`;
    sign.className = "health good";
  } catch (error) {
    sign.textContent = error.message;
    sign.className = "health bad";
  }
  setTimeout(showHealth, HEALTH_MS);
}

at("skip").addEventListener("click", (event) => {
  event.preventDefault();
  at("page").focus();
});
showHealth();
if (await admitted(request)) {
  addEventListener("hashchange", () => openPage(false));
  openPage(true);
}
