// Requests to the service, and its OpenAPI description; every failure is an Error whose message can be shown as it is, a refusal has its problem.
// What this tab keeps until it is closed: the API key ("key") and the project in which it works ("project"); null without.
export const kept = (name) => sessionStorage.getItem(`bentray-${name}`);

// Without a value it is forgotten.
export function keep(name, value) {
  if (value) sessionStorage.setItem(`bentray-${name}`, value);
  else sessionStorage.removeItem(`bentray-${name}`);
}

// The headers of every request.
export function authorization() {
  const [key, project] = [kept("key"), kept("project")];
  return { ...(key && { Authorization: `Bearer ${key}` }), ...(project && { "Bentray-Project": project }) };
}

// What was found in a field, or in a file as a whole.
function foundIn({ field, found, accepted }) {
  return `${field === "file" ? "Found" : `${field}: found`} ${found}; accepted: ${accepted}`;
}

export function inWords(problem) {
  if (problem.errors && problem.errors.length > 1) return problem.errors.map(foundIn).join(" · ");
  if (problem.field && problem.accepted) return `${problem.field === "file" ? "" : `${problem.title}. `}${foundIn(problem)}.`;
  return `${problem.title}: ${problem.detail}`;
}

// What waits for the service hears of it: whether the newest request was answered, however.
function report(answered) {
  document.dispatchEvent(new CustomEvent("connection", { detail: answered }));
}

// For a request that was not answered: an error to throw.
export function lost() {
  report(false);
  return new Error("The service does not answer.");
}

// The response to a request that was not refused.
export async function respond(path, options = {}) {
  let response;
  try {
    response = await fetch(path, { ...options, headers: { ...options.headers, ...authorization() } });
  } catch (error) {
    throw options.signal?.aborted ? error : lost();
  }
  report(true);
  if (response.ok) return response;
  const problem = await response.json().catch(() => ({ title: "The service failed", detail: `status ${response.status}` }));
  if (response.status === 401) document.dispatchEvent(new CustomEvent("locked", { detail: inWords(problem) }));
  throw Object.assign(new Error(inWords(problem)), { problem, response });
}

// What the service answers, null for nothing.
export async function request(path, options) {
  const response = await respond(path, options);
  return response.status === 204 ? null : response.json();
}

// A request with a JSON body.
export function send(method, path, body, headers = {}) {
  return request(path, { method, headers: { "Content-Type": "application/json", ...headers }, body: JSON.stringify(body) });
}

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
