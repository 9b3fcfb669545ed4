// The view of a result as code: Python with the client of Bentray, and curl.
import { kept } from "./api.js";
import { queryOf } from "./views.js";

export function pythonOf({ job, volume }, stored) {
  const name = stored === "truth" ? "speed" : stored;
  return [
    "from bentray_service.client import Client",
    "",
    `with Client("${location.origin}") as client:`,
    `    result = client.result("${volume.id}")  # of ${job.id}`,
    `values = result.values["${name}"]  # ${volume.shape.join(" × ")} nodes, ${name === "speed" ? "m/s" : "SI units"}`,
    'x, y = (1e3 * result.coordinates[axis] for axis in ("x", "y"))  # mm',
    "",
  ].join("\n");
}

export function curlOf({ volume }, stored) {
  const query = queryOf({ format: "npy", quantity: stored });
  const key = kept("key") ? ' -H "Authorization: Bearer $BENTRAY_KEY"' : "";
  return `curl${key} -o ${stored}.npy '${location.origin}${volume.links.data}?${query}'\n`;
}
