// The service: its version, and the workers.
import { request } from "../parts/api.js";
import { make } from "../parts/dom.js";

export async function open(root) {
  document.title = "Service – Bentray";
  const [{ workers }, { tenant, how, scopes }] = await Promise.all([request("/health/ready"), request("/v1/access")]);
  const words = how === "open" ? "Open to this machine" : `Tenant ${tenant} (${scopes.join(", ")})`;
  root.append(make("h1", "", "Service"), make("p", "", `${workers} ${workers === 1 ? "worker" : "workers"}`), make("p", "", words));
  return () => {};
}
