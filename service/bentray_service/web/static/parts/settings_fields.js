// One field of a form for each setting, made from its description in JSON Schema: label, unit, bounds, choices, default.
import { make } from "./dom.js";

// What remains of a schema that also accepts null.
const without = (schema) => ({ ...schema, ...(schema.anyOf?.find((one) => one.type !== "null") ?? {}) });

const number = (value) => Number(value).toString();

function bounds(schema) {
  const { minimum, maximum, exclusiveMinimum: above, exclusiveMaximum: below } = schema;
  const least = minimum ?? above;
  const most = maximum ?? below;
  if (least === undefined || most === undefined) return "";
  // The largest exact integer says nothing to a reader.
  if (most >= 2 ** 53 - 1) return `From ${number(least)}`;
  return `${above === undefined ? "From" : "Above"} ${number(least)} ${below === undefined ? "to" : "and below"} ${number(most)}`;
}

function numberInput(name, schema) {
  const input = make("input");
  Object.assign(input, { type: "number", name, step: "any", min: schema.minimum ?? "", max: schema.maximum ?? "", autocomplete: "off" });
  return input;
}

// What a person has typed that is no number, which the browser otherwise hands out as nothing.
class NotANumber extends Error {}

function read(input) {
  if (input.validity.badInput) throw new NotANumber("Found: no number; accepted: a number.");
  return input.value === "" ? undefined : Number(input.value);
}

// Kinds of fields: their inputs, and how a value is put in and read; undefined stands for the default.
const KINDS = {
  choice(name, schema, nullable) {
    const select = make("select");
    select.name = name;
    const words = schema["x-words"] ?? {};
    if (nullable) select.append(new Option("Automatic", ""));
    select.append(...schema.enum.map((word) => new Option(words[word] ?? word, word)));
    return {
      inputs: [select],
      put: (value) => {
        select.value = value ?? "";
      },
      take: () => select.value || undefined,
    };
  },
  yes(name) {
    const box = make("input");
    Object.assign(box, { type: "checkbox", name });
    return {
      inputs: [box],
      put: (value) => {
        box.checked = Boolean(value);
      },
      take: () => box.checked,
    };
  },
  pair(name, schema) {
    const inputs = ["lowest", "highest"].map((end, i) => {
      const input = numberInput(`${name}.${i}`, schema.prefixItems[i]);
      input.setAttribute("aria-label", `${schema["x-label"] ?? schema.title}, ${end}`);
      input.placeholder = end;
      return input;
    });
    return {
      inputs,
      put: (value) => inputs.forEach((input, i) => {
        input.value = value?.[i] ?? "";
      }),
      take: () => {
        const values = inputs.map(read);
        // One of two is sent as it is: the service says what is missing.
        return values.every((value) => value === undefined) ? undefined : values.filter((value) => value !== undefined);
      },
    };
  },
  number(name, schema) {
    const input = numberInput(name, schema);
    return {
      inputs: [input],
      put: (value) => {
        input.value = value ?? "";
      },
      take: () => read(input),
    };
  },
};

function kindOf(schema) {
  if (schema.enum) return "choice";
  if (schema.type === "boolean") return "yes";
  return schema.prefixItems ? "pair" : "number";
}

const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);

// The field of a setting: { path, node, put(value), changed(), refuse(text) }; changed() is undefined for the default.
export function settingField(path, given, prefix) {
  const schema = without(given);
  const name = path.join(".");
  const id = `${prefix}-${path.join("-")}`;
  const kind = kindOf(schema);
  const { inputs, put, take } = KINDS[kind](name, schema, Boolean(given.anyOf));
  const node = make("div", `setting setting-${kind}`);
  const label = make("label", "caption", schema["x-label"] ?? schema.title);
  if (schema["x-unit"]) label.append(` (${schema["x-unit"]})`);
  label.htmlFor = id;
  inputs[0].id = id;
  const said = [schema.description];
  if (kind === "number") said.push(bounds(schema) && `${bounds(schema)}.`);
  if (kind === "pair") said.push(bounds(schema.prefixItems[0]) && `${bounds(schema.prefixItems[0])}.`);
  if (schema["x-unset"]) said.push(`${kind === "choice" ? "Automatic" : "Empty"}: ${schema["x-unset"]}.`);
  const hint = make("small", "hint", said.filter(Boolean).join(" "));
  hint.id = `${id}-hint`;
  const error = make("p", "error");
  error.id = `${id}-error`;
  error.setAttribute("role", "alert");
  error.hidden = true;
  const box = make("div", "setting-inputs");
  box.append(...inputs);
  if (kind === "yes") box.append(label);
  node.append(...(kind === "yes" ? [] : [label]), box, hint, error);
  for (const input of inputs) input.setAttribute("aria-describedby", `${hint.id} ${error.id}`);
  const refuse = (text) => {
    error.textContent = text;
    error.hidden = !text;
    for (const input of inputs) {
      if (text) input.setAttribute("aria-invalid", "true");
      else input.removeAttribute("aria-invalid");
    }
  };
  put(schema.default);
  return {
    path: name,
    node,
    put: (value) => put(value ?? schema.default),
    changed() {
      const value = take();
      return value === undefined || same(value, schema.default) ? undefined : value;
    },
    refuse,
    focus: () => inputs[0].focus(),
  };
}
