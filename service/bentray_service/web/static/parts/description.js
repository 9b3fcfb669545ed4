// The OpenAPI description of the service: defaults, settings and choices.
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

// The JSON schemas of the properties of a record, and of the parameters of a GET request, by name.
export const propertiesOf = async (schema) => (await description()).components.schemas[schema].properties;

export async function parametersOf(path) {
  const { parameters } = (await description()).paths[path].get;
  return Object.fromEntries(parameters.map(({ name, schema }) => [name, schema]));
}
