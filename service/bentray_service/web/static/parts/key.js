// Who uses this tab: with an API key, kept until the tab is closed and in no address, or signed in at an OpenID provider.
import { authorization, keep, kept, request, respond } from "./api.js";
import { html, useEffect, useRef } from "./view.js";

// An element of the shell by its id.
export const at = (id) => document.getElementById(id);

// Whether requests need headers, which elements and links cannot send.
const hasHeaders = () => Object.keys(authorization()).length > 0;
const blobOf = async (address) => (await respond(address)).blob();

// A picture of the service, once the reader comes near it. With headers, which its element cannot send, it is fetched for it.
export function Picture({ address, onShown = () => {}, onError = () => {}, ...more }) {
  const image = useRef(null);
  useEffect(() => {
    if (!hasHeaders()) return undefined;
    const near = new IntersectionObserver((entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      near.disconnect();
      blobOf(address).then((blob) => Object.assign(image.current ?? {}, { src: URL.createObjectURL(blob) }), onError);
    }, { rootMargin: "300px" });
    near.observe(image.current);
    return () => near.disconnect();
  }, [address]);
  const onLoad = ({ target }) => {
    URL.revokeObjectURL(target.src);
    onShown();
  };
  return html`<img ref=${image} loading="lazy" src=${hasHeaders() ? undefined : address} onLoad=${onLoad}
    onError=${onError} ...${more} />`;
}

// Under the name that the service states, as a browser does for a link.
async function save(address) {
  const response = await respond(address);
  const [, stated] = /filename="(.+)"/.exec(response.headers.get("Content-Disposition")) ?? [];
  const path = address.split("?")[0].split("/");
  saveBlob(await response.blob(), stated ?? `${path.slice(-2).join("-")}${path.at(-1).includes(".") ? "" : ".json"}`);
}

export function saveBlob(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

// A link cannot send a key either: what it leads to is fetched, and saved.
export function KeyLink({ href, children, ...more }) {
  const follow = (event) => {
    if (!hasHeaders()) return;
    event.preventDefault();
    const anchor = event.currentTarget;
    save(href).catch((error) => {
      anchor.title = error.message;
    });
  };
  return html`<a href=${href} onClick=${follow} ...${more}>${children}</a>`;
}

// Where the service has an OpenID provider, the form offers it; it leads back to the view that is open.
async function offerSignIn() {
  const response = await fetch("/sign-in/provider").catch(() => null);
  const { name } = response?.ok ? await response.json() : { name: null };
  at("sign-in").hidden = !name;
  if (!name) return;
  const anchor = at("sign-in").querySelector("a");
  anchor.textContent = `Sign in with ${name}`;
  anchor.href = `/sign-in?address=${encodeURIComponent(location.hash || "#/")}`;
}

async function signOut() {
  const response = await fetch("/sign-out", { method: "POST" });
  const { address } = response.ok ? await response.json() : { address: null };
  location.assign(address ?? "/");
}

function requestKey(why) {
  at("key").hidden = false;
  offerSignIn();
  at("key-error").textContent = kept("key") ? why : "";
  at("key-error").hidden = !kept("key");
}

// The projects of the user, if there are any; choosing one opens the page again in it.
async function offerProjects() {
  const { projects } = await request("/v1/projects");
  const select = at("project");
  select.replaceChildren(new Option("No project", ""), ...projects.map(({ id, name }) => new Option(name, id)));
  select.value = kept("project") ?? "";
  select.hidden = !projects.length;
  select.addEventListener("change", () => openIn(select.value));
}

function openIn(project) {
  keep("project", project);
  // What the address names belongs to the project before.
  location.hash = "#/";
  location.reload();
}

// Show the identity of the user; returns whether the service accepts the key.
export async function admitted() {
  document.addEventListener("locked", (event) => requestKey(event.detail));
  at("key").addEventListener("submit", (event) => {
    event.preventDefault();
    keep("key", new FormData(event.target).get("key").trim());
    location.reload();
  });
  let leave = () => {
    keep("key", null);
    location.reload();
  };
  at("forget").addEventListener("click", () => leave());
  at("forget").hidden = !kept("key");
  try {
    const { tenant, how, who, scopes } = await request("/v1/access");
    const names = { open: "Open to this machine", session: who };
    at("access").textContent = names[how] ?? `Tenant ${tenant}`;
    // The page of the service lists the scopes; here they would take a second row.
    at("access").title = how === "open" ? "" : `${tenant}: ${scopes.join(", ")}`;
    if (how === "session") {
      leave = signOut;
      at("forget").textContent = "Sign out";
      at("forget").hidden = false;
    }
    await offerProjects();
    return true;
  } catch (error) {
    // Removed from the project, or it was deleted.
    if (error.problem?.field === "project" && kept("project")) openIn("");
    // Other errors than a missing key are shown with their reason.
    at("access").textContent = at("key").hidden ? error.message : "Authentication required";
    return false;
  }
}
