// One field of a form for each setting, made from its description in JSON Schema: label, unit, bounds, choices, default.
import { html, Labelled, Options } from "./view.js";

// What remains of a schema that also accepts null, or several values of one kind.
const without = (schema) => ({ ...schema, ...(schema.anyOf?.find((branch) => branch.type !== "null") ?? {}), ...schema.items });

export const captionOf = (schema) => schema["x-label"] ?? schema.title;

function bounds(schema) {
  const { minimum, maximum, exclusiveMinimum: above, exclusiveMaximum: below } = schema;
  const least = minimum ?? above;
  const most = maximum ?? below;
  if (least === undefined || most === undefined) return "";
  // The largest exact integer says nothing to a reader.
  if (most >= 2 ** 53 - 1) return `From ${least}.`;
  return `${above === undefined ? "From" : "Above"} ${least} ${below === undefined ? "to" : "and below"} ${most}.`;
}

function NumberInput({ schema, value, ...more }) {
  return html`<input type="number" step="any" autocomplete="off" min=${schema.minimum} max=${schema.maximum} defaultValue=${value ?? ""} ...${more} />`;
}

// What a person has typed that is no number, which the browser otherwise hands out as nothing.
function read(input) {
  if (input.validity.badInput) throw new Error("Found: no number; accepted: a number.");
  return input.value === "" ? undefined : Number(input.value);
}

const choicesOf = (schema) => schema.enum ?? [true, false];
const YES = { true: "Yes", false: "No" };

// Kinds of fields: their inputs, and what the inputs say by a schema; undefined stands for the default.
const KINDS = {
  choice: {
    inputs: ({ schema, nullable, value, ...more }) => html`<select ...${more}>
      ${nullable && html`<option value="">Automatic</option>`}
      <${Options} entries=${choicesOf(schema).map((word) => [word, (schema["x-words"] ?? YES)[word] ?? word])} chosen=${value} />
    </select>`,
    read: ([select], schema) => choicesOf(schema).find((word) => String(word) === select.value),
    unset: "Automatic",
  },
  yes: {
    inputs: ({ schema, nullable, value, ...more }) => html`<input type="checkbox" defaultChecked=${Boolean(value)} ...${more} />`,
    read: ([box]) => box.checked,
  },
  pair: {
    inputs: ({ schema, nullable, value, name, id, ...more }) => ["lowest", "highest"].map((end, i) => html`<${NumberInput} schema=${schema.prefixItems[i]}
      value=${value?.[i]} name=${`${name}.${i}`} id=${i ? undefined : id} aria-label=${`${captionOf(schema)}, ${end}`} placeholder=${end} ...${more} />`),
    // One of two is sent as it is: the service says what is missing.
    read: (inputs) => {
      const values = inputs.map(read).filter((value) => value !== undefined);
      return values.length ? values : undefined;
    },
    about: (schema) => bounds(schema.prefixItems[0]),
  },
  number: {
    inputs: ({ nullable, ...more }) => html`<${NumberInput} ...${more} />`,
    read: ([input]) => read(input),
    about: bounds,
  },
};

function kindOf(schema, nullable) {
  if (schema.type === "boolean" && !nullable) return "yes";
  if (schema.enum || schema.type === "boolean") return "choice";
  return schema.prefixItems ? "pair" : "number";
}

// A setting as the form knows it: its path, and how it is described.
export function settingOf(path, given) {
  const schema = without(given);
  return { path: path.join("."), schema, kind: kindOf(schema, given.anyOf), nullable: Boolean(given.anyOf) };
}

// A setting below its caption, without words about it, as on a small form. value: the one to begin with, by default that of the schema.
export function PlainField({ name, given, value = given.default, ...more }) {
  const { schema, kind, nullable } = settingOf([name], given);
  return html`<${Labelled} caption=${captionOf(schema)} title=${schema.description}>
    <${KINDS[kind].inputs} schema=${schema} nullable=${nullable} value=${value} name=${name} step=${schema.type === "integer" ? "1" : "any"} ...${more} />
  </${Labelled}>`;
}

const inputsOf = (form, { path }) => [...form.querySelector(`[data-path="${path}"]`).querySelectorAll("input, select")];

export const focusOn = (form, setting) => inputsOf(form, setting)[0].focus();

// The value of a setting in the form, undefined for its default; throws an error that says what is wrong.
export function changedIn(form, setting) {
  const value = KINDS[setting.kind].read(inputsOf(form, setting), setting.schema);
  return value === undefined || JSON.stringify(value) === JSON.stringify(setting.schema.default) ? undefined : value;
}

// The value of a setting in the form, its default without one; undefined for a wrong number.
export function valueIn(form, setting) {
  try {
    return KINDS[setting.kind].read(inputsOf(form, setting), setting.schema) ?? setting.schema.default;
  } catch {
    return undefined;
  }
}

// What a filter finds a setting by.
export const wordsOf = ({ path, schema }) => [path, captionOf(schema), schema.description, ...Object.values(schema["x-words"] ?? {})].join(" ");

// value: the one to begin with; fault: what is wrong, "" for nothing.
export function SettingField({ setting: { path, schema, kind, nullable }, value, fault, hidden }) {
  const id = `set-${path.replaceAll(".", "-")}`;
  const { inputs, about = () => "", unset = "Empty" } = KINDS[kind];
  const label = html`<label class="caption" for=${id}>${captionOf(schema)}${schema["x-unit"] && ` (${schema["x-unit"]})`}</label>`;
  const hint = [schema.description, about(schema), schema["x-unset"] && `${unset}: ${schema["x-unset"]}.`].filter(Boolean).join(" ");
  const described = { "aria-describedby": `${id}-hint ${id}-error`, ...(fault && { "aria-invalid": "true" }) };
  return html`<div class=${`setting setting-${kind}`} data-path=${path} hidden=${hidden}>
    ${kind !== "yes" && label}
    <div class="setting-inputs">
      <${inputs} schema=${schema} nullable=${nullable} value=${value ?? schema.default} name=${path} id=${id} ...${described} />
      ${kind === "yes" && label}
    </div>
    <small class="hint" id=${`${id}-hint`}>${hint}</small>
    <p class="error" role="alert" id=${`${id}-error`} hidden=${!fault}>${fault}</p>
  </div>`;
}
