// Requests to the service; every failure is an Error whose message can be shown as it is, a refusal has its problem.

import { authorization } from "./key.js";

// What was found in a field, or in a file as a whole.
function foundIn({ field, found, accepted }) {
  return `${field === "file" ? "Found" : `${field}: found`} ${found}; accepted: ${accepted}`;
}

export function inWords(problem) {
  if (problem.errors && problem.errors.length > 1) return problem.errors.map(foundIn).join(" · ");
  if (problem.field && problem.accepted) return `${problem.field === "file" ? "" : `${problem.title}. `}${foundIn(problem)}.`;
  return `${problem.title}: ${problem.detail}`;
}

const LOST = "The service does not answer.";

// What waits for the service hears of it: whether the newest request was answered, however.
function report(answered) {
  document.dispatchEvent(new CustomEvent("connection", { detail: answered }));
}

// For a request that was not answered: an error to throw.
export function lost() {
  report(false);
  return new Error(LOST);
}

export async function request(path, options = {}) {
  let response;
  try {
    response = await fetch(path, { ...options, headers: { ...options.headers, ...authorization() } });
  } catch {
    throw lost();
  }
  report(true);
  const body = await response.json().catch(() => ({ title: "The service failed", detail: `status ${response.status}` }));
  if (response.status === 401) document.dispatchEvent(new CustomEvent("locked", { detail: inWords(body) }));
  if (!response.ok) throw Object.assign(new Error(inWords(body)), { problem: body });
  return body;
}

// A request with a JSON body.
export function send(method, path, body, headers = {}) {
  return request(path, { method, headers: { "Content-Type": "application/json", ...headers }, body: JSON.stringify(body) });
}
