// Requests to the service; every failure is an Error whose message can be shown as it is.

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
  if (!response.ok) throw new Error(inWords(body));
  return body;
}

// fetch() cannot tell how much of a body has been sent; XMLHttpRequest can.
export function upload(address, mediaType, file, onProgress) {
  return new Promise((resolve, reject) => {
    const sender = new XMLHttpRequest();
    sender.open("POST", address);
    sender.setRequestHeader("Content-Type", mediaType);
    for (const [name, value] of Object.entries(authorization())) sender.setRequestHeader(name, value);
    sender.responseType = "json";
    sender.upload.onprogress = (event) => event.lengthComputable && onProgress(event.loaded / event.total);
    sender.onerror = () => reject(new Error("The upload failed: the service did not accept it or does not answer."));
    sender.onload = () => {
      if (sender.status === 201) resolve(sender.response);
      else reject(new Error(sender.response ? inWords(sender.response) : `The service answered ${sender.status}.`));
    };
    sender.send(file);
  });
}
