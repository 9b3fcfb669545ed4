// The form of all settings of a reconstruction, made from their description; only changed settings are sent.
import { description } from "./api.js";
import { changedIn, focusOn, SettingField, settingOf, valueIn, wordsOf } from "./settings_fields.js";
import { Facts, Field, html, useEffect, useMemo, useReducer, useRef, useState } from "./view.js";

// Groups of settings that are described as a schema: [schema, settings]; the first one, without a schema, has those of no group.
export async function readSettings() {
  const { components: { schemas } } = await description();
  const entries = Object.entries(schemas.Settings.properties);
  const own = entries.filter(([, schema]) => !schema.$ref).map(([leaf, schema]) => settingOf([leaf], schema));
  const groups = entries.filter(([, schema]) => schema.$ref).map(([group, schema]) => {
    const { properties } = schemas[schema.$ref.split("/").at(-1)];
    return [schema, Object.entries(properties).map(([leaf, inner]) => settingOf([group, leaf], inner))];
  });
  return [[null, own], ...groups];
}

// The fault of a problem as [path, text]; the service names a setting with or without the place of the record.
function faultsOf({ errors, ...first }) {
  return (errors?.length ? errors : [first])
    .filter(({ field }) => field)
    .map(({ field, found, accepted }) => [field.replace(/^settings\./, ""), `Found ${found}; accepted: ${accepted}.`]);
}

// The end of a pair belongs to it; a group that is refused as a whole is told at its first setting.
function settingAt(settings, path) {
  return settings.find((setting) => path === setting.path || path.startsWith(`${setting.path}.`))
    ?? settings.find((setting) => setting.path.startsWith(`${path}.`));
}

const valueAt = (record, path) => path.split(".").reduce((inner, name) => inner?.[name], record);

// Whether a value is one of a list, or in a range that is open at its lower end.
const accepts = (accepted, value) => (Array.isArray(accepted) ? accepted.includes(value ?? null) : value > accepted.exclusiveMinimum);

// The paths of the settings that have an effect beside the others in the form. facts: what is known of the scan, by the names of the conditions.
function usedIn(root, settings, facts) {
  const at = (name) => settings.find(({ path }) => [name, `${name}.enabled`].includes(path) || path.endsWith(`.${name}`));
  const valueOf = (name) => valueIn(root, at(name));
  const holds = ([name, accepted]) => (name.startsWith("scan_") ? facts[name] ?? true : accepts(accepted, valueOf(name)));
  const isUsed = ({ schema }) => schema["x-used-when"]?.some((use) => Object.entries(use).every(holds)) ?? true;
  return new Set(settings.filter(isUsed).map(({ path }) => path));
}

// { root, faults, used, update(), changed(focus), refuse(problem, focus) } for a SettingsForm of these groups. facts: of the scan, see usedIn.
export function useSettings(groups, facts = {}) {
  const settings = useMemo(() => groups?.flatMap(([, members]) => members), [groups]);
  const root = useRef(null);
  const [faults, setFaults] = useState({});
  const [, update] = useReducer((count) => count + 1, 0);
  const used = root.current && usedIn(root.current, settings, facts);

  function show(found, focus) {
    setFaults(Object.fromEntries(found.map(([setting, text]) => [setting.path, text])));
    if (focus && found.length) focusOn(root.current, found[0][0]);
  }

  return {
    root,
    faults,
    used,
    update,

    // The settings in use that differ from their defaults, nested as the service takes them; null after a wrong number, which may get the focus.
    changed(focus) {
      const record = {};
      const wrong = [];
      const now = usedIn(root.current, settings, facts);
      for (const setting of settings.filter(({ path }) => now.has(path))) {
        const [group, leaf] = setting.path.split(".");
        try {
          const value = changedIn(root.current, setting);
          if (value === undefined) continue;
          record[group] = leaf ? { ...record[group], [leaf]: value } : value;
        } catch (error) {
          wrong.push([setting, error.message]);
        }
      }
      show(wrong, focus);
      return wrong.length ? null : record;
    },

    // Show each fault of a problem at its setting; whether all of them have one.
    refuse(problem, focus) {
      const told = faultsOf(problem);
      const found = told.map(([path, text]) => [settingAt(settings, path), text]).filter(([setting]) => setting);
      show(found, focus);
      return found.length > 0 && found.length === told.length;
    },
  };
}

// The first settings of each kind of reconstruction, the others in groups that are opened, and a filter over all of them.
// earlier: settings to begin with, in place of the defaults; form: of useSettings.
export function SettingsForm({ groups, earlier, form, onInput = () => {} }) {
  const [text, setText] = useState("");
  const [opened, setOpened] = useState(false);
  useEffect(form.update, [groups, earlier]);
  useEffect(() => {
    if (Object.keys(form.faults).length) setOpened(true);
  }, [form.faults]);
  if (!groups) return html`<${Facts}>Reading the settings</${Facts}>`;
  const settings = groups.flatMap(([, members]) => members);
  const isUsed = ({ path }) => form.used?.has(path) ?? true;
  const matches = (setting) => isUsed(setting) && wordsOf(setting).toLowerCase().includes(text);
  const fieldsOf = (members) => html`<div class="settings">
    ${members.map((setting) => html`<${SettingField} key=${setting.path} setting=${setting} fault=${form.faults[setting.path] ?? ""}
      value=${valueAt(earlier, setting.path)} hidden=${!matches(setting)} />`)}
  </div>`;
  const isFirst = ({ schema }) => schema["x-basic"];
  const others = settings.filter((setting) => !isFirst(setting));
  const unused = settings.filter((setting) => !isUsed(setting)).length;
  const change = (event) => {
    form.update();
    onInput(event);
  };
  return html`<div class="all-settings" ref=${form.root} onInput=${change}>
    <${Field} caption="Find a setting" class="setting-filter" type="search" onInput=${(event) => {
      event.stopPropagation();
      setText(event.target.value.trim().toLowerCase());
    }} onKeyDown=${(event) => event.key === "Enter" && event.preventDefault()} />
    ${fieldsOf(settings.filter(isFirst))}
    <details class="advanced" open=${opened || text !== ""} onToggle=${({ target }) => text || setOpened(target.open)}>
      <summary>Advanced (${others.filter(matches).length})</summary>
      ${groups.map(([schema, members]) => {
        const rest = members.filter((setting) => !isFirst(setting));
        if (!schema) return fieldsOf(rest);
        return html`<fieldset class="setting-group" hidden=${!rest.some(matches)}>
          <legend>${schema["x-label"] ?? schema.title}</legend>
          ${schema.description && html`<${Facts}>${schema.description}</${Facts}>`}
          ${fieldsOf(rest)}
        </fieldset>`;
      })}
    </details>
    ${unused > 0 && html`<${Facts}>${unused} settings without effect beside these are not shown.</${Facts}>`}
  </div>`;
}
