// Default settings of jobs, from the OpenAPI description.
import { request } from "./api.js";

let asked = null;

// The OpenAPI description, requested once.
export function description() {
  asked ??= request("/openapi.json").catch((error) => {
    asked = null;
    throw error;
  });
  return asked;
}

// Fill the required numbers of a form with the defaults of a schema, also those that a reset restores.
export async function fillDefaults(form, schema) {
  const { components } = await description();
  for (const input of form.querySelectorAll("input[required]")) {
    if (input.type === "number") input.defaultValue = components.schemas[schema].properties[input.name].default;
  }
}
