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
