// Changes of jobs as they happen: one stream of server-sent events, opened again when it ends.
import { authorization } from "../parts/api.js";

const STREAM = "/v1/events";
const SOON_MS = 200;
const LATER_MS = 5000;
const LATEST_MS = 60000;

// The data of events named "job" in a body, as they arrive.
async function* changesIn(body) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    const blocks = (rest + value).split("\n\n");
    rest = blocks.pop();
    for (const block of blocks) {
      const lines = block.split("\n");
      const data = lines.find((line) => line.startsWith("data: "));
      if (data && lines.includes("event: job")) yield JSON.parse(data.slice(6));
    }
  }
}

// Calls onChange({ id, state, progress }) for each change of a job, and onOpen(open) when the stream opens and when it cannot
// be opened. A hidden tab holds no connection. Returns close(). An EventSource could not send the key.
export function jobEvents({ onChange, onOpen }) {
  let controller = null;
  let timer = 0;
  let wait = LATER_MS;

  async function connect() {
    clearTimeout(timer);
    if (document.hidden || controller) return;
    controller = new AbortController();
    const { signal } = controller;
    let pause = SOON_MS;
    try {
      const response = await fetch(STREAM, { headers: authorization(), signal, cache: "no-store" });
      if (!response.ok) throw new Error(`status ${response.status}`);
      wait = LATER_MS;
      onOpen(true);
      for await (const change of changesIn(response.body)) if (!signal.aborted) onChange(change);
    } catch {
      if (signal.aborted) return;
      onOpen(false);
      pause = wait;
      wait = Math.min(2 * wait, LATEST_MS);
    }
    if (signal.aborted) return;
    controller = null;
    timer = setTimeout(connect, pause);
  }

  function drop() {
    clearTimeout(timer);
    controller?.abort();
    controller = null;
  }

  const follow = () => (document.hidden ? drop() : connect());
  document.addEventListener("visibilitychange", follow);
  connect();
  return () => {
    document.removeEventListener("visibilitychange", follow);
    drop();
  };
}
