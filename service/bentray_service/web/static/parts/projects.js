// Projects of the tenant: create, rename and delete them; list, add and remove their members, and change roles.
import { inTime } from "./amounts.js";
import { request } from "./api.js";
import { make } from "./dom.js";
import { headedTable } from "./tables.js";

const JSON_TYPE = { "Content-Type": "application/json" };
const ROLES = ["reader", "contributor", "owner"];
const MEMBER = "(key:[0-9a-f]{12}|user:.{1,200})";
const WORDS = "A reader sees everything in the project, a contributor also uploads, starts and deletes, an owner also changes the project and "
  + "its members. The head of the page chooses the project in which this tab works.";

const send = (method, address, body) => request(address, { method, headers: JSON_TYPE, body: JSON.stringify(body) });

function button(text, label, onClick) {
  const made = make("button", "quiet", text);
  made.type = "button";
  made.setAttribute("aria-label", label);
  made.addEventListener("click", onClick);
  return made;
}

function roleSelect(label, role) {
  const select = make("select");
  select.setAttribute("aria-label", label);
  select.append(...ROLES.map((one) => new Option(one, one)));
  select.value = role;
  return select;
}

function labelled(caption, field) {
  const label = make("label");
  label.append(make("span", "caption", caption), field);
  return label;
}

function textField(name, length) {
  const input = make("input");
  Object.assign(input, { type: "text", name, maxLength: length, required: true, autocomplete: "off", spellcheck: false });
  return input;
}

function formOf(fields, submit, onSubmit) {
  const form = make("form", "line-form");
  const start = make("button", "", submit);
  start.type = "submit";
  form.append(...fields, start);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    onSubmit(form);
  });
  return form;
}

// One project, whose members are read once it is opened. me: how the list of members calls this caller, "" without keys; changed() is
// called after a change of the list of projects.
function projectOf(project, me, keys, changed) {
  const box = make("details", "project");
  const summary = make("summary", "", project.name);
  summary.append(" ", make("span", "state", project.role));
  const error = make("p", "error");
  error.setAttribute("role", "alert");
  error.hidden = true;
  const place = make("div");
  box.append(summary, error, place);
  const owner = project.role === "owner";

  async function act(work) {
    error.hidden = true;
    try {
      await work();
    } catch (problem) {
      error.textContent = problem.message;
      error.hidden = false;
    }
  }

  const put = (member, role) => act(async () => {
    const left = member === me && role === null;
    let members;
    try {
      ({ members } = await send("PUT", project.links.members, { member, role }));
    } catch (problem) {
      // The choice that was refused goes back to the role that the member has.
      await show();
      throw problem;
    }
    // Who has left, or owns it no more, sees another list.
    if (left || (member === me && role !== project.role)) changed();
    else draw(members);
  });

  function rowOf({ member, role, created }) {
    const mine = member === me;
    const select = owner && roleSelect(`Role of ${member}`, role);
    if (select) select.addEventListener("change", () => put(member, select.value));
    const name = keys.find(({ id }) => member === `key:${id}`)?.name;
    const words = `${member}${name ? `, ${name}` : ""}${mine ? " (you)" : ""}`;
    const remove = (owner || mine) && button(mine ? "Leave" : "Remove", mine ? `Leave ${project.name}` : `Remove ${member}`, () => {
      if (confirm(mine ? `Leave ${project.name}?` : `Remove ${member} from ${project.name}?`)) put(member, null);
    });
    return [words, select || role, remove || "–", inTime(created)];
  }

  function addForm() {
    const member = textField("member", 205);
    Object.assign(member, { pattern: MEMBER, placeholder: "user:NAME or key:ID", title: "user: and the name of a user, or key: and the id of a key" });
    const list = make("datalist");
    list.id = `keys-${project.id}`;
    list.append(...keys.map(({ id, name }) => new Option(name, `key:${id}`)));
    member.setAttribute("list", list.id);
    const role = roleSelect("Role", "reader");
    return formOf([labelled("New member", member), labelled("Role", role), list], "Add", async () => {
      await put(member.value.trim(), role.value);
      if (!error.hidden) return;
      const next = place.querySelector("[name=member]");
      next.value = "";
      next.focus();
    });
  }

  function renameForm() {
    const name = textField("name", 200);
    name.value = project.name;
    const remove = button("Delete", `Delete ${project.name}`, async () => {
      if (!confirm(`Delete ${project.name} for good?`)) return;
      await act(() => request(project.links.self, { method: "DELETE" }));
      if (error.hidden) changed();
    });
    const form = formOf([labelled("Name of the project", name)], "Rename", () => act(async () => {
      await send("PATCH", project.links.self, { name: name.value.trim() });
      changed();
    }));
    form.append(remove);
    return form;
  }

  // The element that has the focus is drawn again, and keeps it.
  function draw(members) {
    const label = place.contains(document.activeElement) && document.activeElement.getAttribute("aria-label");
    const columns = ["Member", "Role", "Change", "Since"];
    const none = make("p", "facts", "No members. Add an owner, or only callers without a key see it.");
    const content = [members.length ? headedTable(`Members of ${project.name}`, columns, members.map(rowOf)) : none];
    if (owner) content.push(addForm(), renameForm());
    place.replaceChildren(...content);
    if (label) (place.querySelector(`[aria-label="${CSS.escape(label)}"]`) ?? place.querySelector("[name=member]"))?.focus();
  }

  async function show() {
    draw((await request(project.links.self)).members);
  }

  box.addEventListener("toggle", () => box.open && !place.childElementCount && act(show));
  return box;
}

// Show the projects of the caller in root. access: of /v1/access; keys: those of the tenant.
export async function showProjects(root, access, keys) {
  const me = access.how === "open" ? "" : `${access.how === "key" ? "key" : "user"}:${access.who}`;
  const error = make("p", "error");
  error.setAttribute("role", "alert");
  error.hidden = true;
  const list = make("div", "projects");
  const name = textField("name", 200);
  const create = formOf([labelled("New project", name)], "Create", async () => {
    error.hidden = true;
    try {
      const made = await send("POST", "/v1/projects", { name: name.value.trim() });
      name.value = "";
      await refresh(made.id);
    } catch (problem) {
      error.textContent = problem.message;
      error.hidden = false;
    }
  });

  // opened: id of a project to open, by default those that are open stay so.
  async function refresh(opened) {
    const open = new Set([opened, ...[...list.querySelectorAll("details[open]")].map((one) => one.dataset.id)]);
    const { projects } = await request("/v1/projects");
    const boxes = projects.map((project) => {
      const box = projectOf(project, me, keys, () => refresh());
      box.dataset.id = project.id;
      box.open = open.has(project.id);
      return box;
    });
    list.replaceChildren(...(boxes.length ? boxes : [make("p", "facts", "No project yet. All scans and results belong to the tenant.")]));
  }

  await refresh();
  root.replaceChildren(list, create, error, make("p", "facts", WORDS));
}
