// The form of all settings of a reconstruction, made from their description; only changed settings are sent.
import { description } from "./defaults.js";
import { make } from "./dom.js";
import { settingField } from "./settings_fields.js";

const REFERENCE = "#/components/schemas/";

function groupOf(schema, fields) {
  const box = make("fieldset", "setting-group");
  box.append(make("legend", "", schema["x-label"] ?? schema.title));
  if (schema.description) box.append(make("p", "facts", schema.description));
  const grid = make("div", "settings");
  grid.append(...fields.map((field) => field.node));
  box.append(grid);
  return box;
}

// The fault of a problem as [path, text]; the service names a setting with or without the place of the record.
function faultsOf(problem) {
  const { errors, ...first } = problem;
  return (errors?.length ? errors : [first])
    .filter(({ field }) => field)
    .map(({ field, found, accepted }) => [field.replace(/^settings\./, ""), `Found ${found}; accepted: ${accepted}.`]);
}

// { node, changed(), fill(settings), clear(), refuse(problem) } for the settings that are described as schema.
export async function settingsForm(schema = "Settings") {
  const { components } = await description();
  const own = [];
  const groups = [];
  for (const [name, one] of Object.entries(components.schemas[schema].properties)) {
    if (!one.$ref) {
      own.push(settingField([name], one, "set"));
      continue;
    }
    const inner = components.schemas[one.$ref.slice(REFERENCE.length)];
    const fields = Object.entries(inner.properties).map(([leaf, what]) => settingField([name, leaf], what, "set"));
    groups.push({ schema: one, fields });
  }
  const every = [...own, ...groups.flatMap(({ fields }) => fields)];
  const node = make("div", "all-settings");
  const grid = make("div", "settings");
  grid.append(...own.map((field) => field.node));
  node.append(grid, ...groups.map(({ schema: one, fields }) => groupOf(one, fields)));

  const clear = () => every.forEach((field) => field.refuse(""));

  return {
    node,
    clear,

    // The settings that differ from their defaults, nested as the service takes them; null after a wrong number, which may get the focus.
    changed(focus) {
      clear();
      const settings = {};
      let wrong = null;
      for (const field of every) {
        try {
          const value = field.changed();
          if (value === undefined) continue;
          const [group, leaf] = field.path.split(".");
          if (leaf) settings[group] = { ...settings[group], [leaf]: value };
          else settings[group] = value;
        } catch (error) {
          field.refuse(error.message);
          wrong ??= field;
        }
      }
      if (focus) wrong?.focus();
      return wrong ? null : settings;
    },

    // Put in the settings of an earlier job; what it does not name takes its default.
    fill(settings) {
      for (const field of every) {
        const [group, leaf] = field.path.split(".");
        field.put(leaf ? settings[group]?.[leaf] : settings[group]);
      }
    },

    // Show each fault of a problem at its setting; whether all of them have one.
    refuse(problem, focus) {
      clear();
      let placed = 0;
      const faults = faultsOf(problem);
      for (const [path, text] of faults) {
        // The end of a pair belongs to it; a group that is refused as a whole is told at its first setting.
        const field = every.find((one) => path === one.path || path.startsWith(`${one.path}.`)) ?? every.find((one) => one.path.startsWith(`${path}.`));
        if (!field) continue;
        field.refuse(text);
        if (focus && !placed) field.focus();
        placed += 1;
      }
      return placed > 0 && placed === faults.length;
    },
  };
}
