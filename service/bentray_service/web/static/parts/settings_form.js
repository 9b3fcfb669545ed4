// The form of all settings of a reconstruction, made from their description; only changed settings are sent.
import { description } from "./description.js";
import { changedIn, focusOn, SettingField, settingOf } from "./settings_fields.js";
import { Facts, html, useMemo, useRef, useState } from "./view.js";

const REFERENCE = "#/components/schemas/";

// Groups of settings that are described as a schema: [schema, settings]; the first one, without a schema, has those of no group.
export async function readSettings(name = "Settings") {
  const { components: { schemas } } = await description();
  const entries = Object.entries(schemas[name].properties);
  const own = entries.filter(([, schema]) => !schema.$ref).map(([leaf, schema]) => settingOf([leaf], schema));
  const groups = entries.filter(([, schema]) => schema.$ref).map(([group, schema]) => {
    const { properties } = schemas[schema.$ref.slice(REFERENCE.length)];
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

// { root, faults, changed(focus), refuse(problem, focus) } for a SettingsForm of these groups.
export function useSettings(groups) {
  const settings = useMemo(() => groups?.flatMap(([, members]) => members), [groups]);
  const root = useRef(null);
  const [faults, setFaults] = useState({});

  function show(found, focus) {
    setFaults(Object.fromEntries(found.map(([setting, text]) => [setting.path, text])));
    if (focus && found.length) focusOn(root.current, found[0][0]);
  }

  return {
    root,
    faults,

    // The settings that differ from their defaults, nested as the service takes them; null after a wrong number, which may get the focus.
    changed(focus) {
      const record = {};
      const wrong = [];
      for (const setting of settings) {
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

// earlier: settings to begin with, in place of the defaults; form: of useSettings.
export function SettingsForm({ groups, earlier, form, onInput }) {
  if (!groups) return html`<${Facts}>Reading the settings</${Facts}>`;
  return html`<div class="all-settings" ref=${form.root} onInput=${onInput}>
    ${groups.map(([schema, settings]) => {
      const fields = html`<div class="settings">
        ${settings.map((setting) => html`<${SettingField} key=${setting.path} setting=${setting} fault=${form.faults[setting.path] ?? ""}
          value=${valueAt(earlier, setting.path)} />`)}
      </div>`;
      if (!schema) return fields;
      return html`<fieldset class="setting-group">
        <legend>${schema["x-label"] ?? schema.title}</legend>
        ${schema.description && html`<${Facts}>${schema.description}</${Facts}>`}
        ${fields}
      </fieldset>`;
    })}
  </div>`;
}
