// Projects of the tenant: create, rename and delete them; list, add and remove their members, and change roles.
import { request, send } from "./api.js";
import { Alert, Button, Choice, Facts, Field, Form, HeadedTable, html, Options, useAct, useRead, useRef, useState } from "./view.js";
import { inTime } from "./words.js";

const ROLES = ["reader", "contributor", "owner"];
const MEMBER = "(key:[0-9a-f]{12}|user:.{1,200})";
const COLUMNS = ["Member", "Role", "Change", "Since"];
const WORDS = "A reader sees everything in the project, a contributor also uploads, starts and deletes, an owner also changes the project and "
  + "its members. The head of the page chooses the project in which this tab works.";

function NameField({ caption, ...more }) {
  return html`<${Field} caption=${caption} type="text" name="name" maxlength="200" required spellcheck="false" ...${more} />`;
}

// keys: those of the tenant; put(member, role) returns whether the member has the role.
function AddMember({ id, keys, put, field }) {
  async function add({ currentTarget: form }) {
    const { member, role } = form.elements;
    if (!(await put(member.value.trim(), role.value))) return;
    form.reset();
    member.focus();
  }
  return html`<${Form} class="line-form" onSubmit=${add}>
    <${Field} caption="New member" type="text" name="member" ref=${field} list=${`keys-${id}`} maxlength="205" required spellcheck="false"
        pattern=${MEMBER} placeholder="user:NAME or key:ID" title="user: and the name of a user, or key: and the id of a key" />
    <${Choice} caption="Role" name="role" aria-label="Role" entries=${ROLES} />
    <datalist id=${`keys-${id}`}><${Options} entries=${keys.map((key) => [`key:${key.id}`, key.name])} /></datalist>
    <button type="submit">Add</button>
  </${Form}>`;
}

// One project, whose members are read once it is opened. me: how the list of members calls this caller, "" without keys; onChange() is
// called after a change of the list of projects.
function Project({ project, me, keys, opened, onChange }) {
  const { id, name, role: mine, links } = project;
  const [error, act] = useAct();
  const [members, setMembers] = useState(null);
  const field = useRef(null);
  const owner = mine === "owner";
  const read = async () => setMembers((await request(links.self)).members);

  const put = (member, role) => act(async () => {
    const answer = await send("PUT", links.members, { member, role }).catch(async (problem) => {
      // The choice that was refused goes back to the role that the member has.
      await read();
      throw problem;
    });
    // Who has left, or owns it no more, sees another list.
    if (member === me && role !== mine) onChange();
    else setMembers(answer.members);
  });

  async function remove(member) {
    const question = member === me ? `Leave ${name}?` : `Remove ${member} from ${name}?`;
    // The button that had the focus is gone.
    if (confirm(question) && (await put(member, null))) field.current?.focus();
  }

  function rowOf({ member, role, created }) {
    const key = keys.find((known) => member === `key:${known.id}`)?.name;
    const words = `${member}${key ? `, ${key}` : ""}${member === me ? " (you)" : ""}`;
    const select = html`<select aria-label=${`Role of ${member}`} value=${role} onChange=${({ target }) => put(member, target.value)}>
      <${Options} entries=${ROLES} />
    </select>`;
    const [verb, label] = member === me ? ["Leave", `Leave ${name}`] : ["Remove", `Remove ${member}`];
    const button = html`<${Button} aria-label=${label} onClick=${() => remove(member)}>${verb}</${Button}>`;
    return [words, owner ? select : role, owner || member === me ? button : "–", inTime(created)];
  }

  const rename = ({ currentTarget: { elements } }) => act(async () => {
    await send("PATCH", links.self, { name: elements.name.value.trim() });
    onChange();
  });

  async function destroy() {
    if (confirm(`Delete ${name} for good?`) && (await act(() => request(links.self, { method: "DELETE" })))) onChange();
  }

  return html`<details class="project" open=${opened} onToggle=${({ target }) => target.open && !members && act(read)}>
    <summary>${name} <span class="state">${mine}</span></summary>
    <${Alert} error=${error} />
    ${members && html`<div>
      ${members.length
        ? html`<${HeadedTable} label=${`Members of ${name}`} columns=${COLUMNS} rows=${members.map(rowOf)} keys=${members.map((one) => one.member)} />`
        : html`<${Facts}>No members. Add an owner, or only callers without a key see it.</${Facts}>`}
      ${owner && html`
        <${AddMember} id=${id} keys=${keys} put=${put} field=${field} />
        <${Form} class="line-form" onSubmit=${rename}>
          <${NameField} caption="Name of the project" defaultValue=${name} />
          <button type="submit">Rename</button>
          <${Button} aria-label=${`Delete ${name}`} onClick=${destroy}>Delete</${Button}>
        </${Form}>`}
    </div>`}
  </details>`;
}

// The projects of the caller. access: of /v1/access; keys: those of the tenant.
export function Projects({ access, keys }) {
  const me = access.how === "open" ? "" : `${access.how === "key" ? "key" : "user"}:${access.who}`;
  const [found, readError, refresh] = useRead(() => request("/v1/projects"));
  const [error, act] = useAct();
  const [made, setMade] = useState("");

  const create = ({ currentTarget: form }) => act(async () => {
    const { id } = await send("POST", "/v1/projects", { name: form.elements.name.value.trim() });
    form.reset();
    setMade(id);
    await refresh();
  });

  if (!found) return html`<${Alert} error=${readError} />`;
  const { projects } = found;
  return html`
    <div class="projects">
      ${projects.map((project) => html`<${Project} key=${`${project.id} ${project.role}`} project=${project} me=${me} keys=${keys}
        opened=${project.id === made} onChange=${refresh} />`)}
      ${!projects.length && html`<${Facts}>No project yet. All scans and results belong to the tenant.</${Facts}>`}
    </div>
    <${Form} class="line-form" onSubmit=${create}>
      <${NameField} caption="New project" />
      <button type="submit">Create</button>
    </${Form}>
    <${Alert} error=${error ?? readError} />
    <${Facts}>${WORDS}</${Facts}>`;
}
