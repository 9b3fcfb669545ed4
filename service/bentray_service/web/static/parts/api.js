// Requests to the service; every failure is an Error whose message can be shown as it is, a refusal has its problem.

import { authorization } from "./key.js";

export function inWords(problem) {
  if (problem.errors && problem.errors.length > 1) {
    return problem.errors.map((one) => `${one.field}: found ${one.found}; accepted: ${one.accepted}`).join(" · ");
  }
  if (problem.field && problem.accepted) {
    return `${problem.title}. ${problem.field}: found ${problem.found}; accepted: ${problem.accepted}.`;
  }
  return `${problem.title}: ${problem.detail}`;
}

export async function request(path, options = {}) {
  let response;
  try {
    response = await fetch(path, { ...options, headers: { ...options.headers, ...authorization() } });
  } catch {
    throw new Error("The service does not answer.");
  }
  const body = await response.json().catch(() => ({ title: "The service failed", detail: `status ${response.status}` }));
  if (response.status === 401) document.dispatchEvent(new CustomEvent("locked", { detail: inWords(body) }));
  if (!response.ok) throw Object.assign(new Error(inWords(body)), { problem: body });
  return body;
}
