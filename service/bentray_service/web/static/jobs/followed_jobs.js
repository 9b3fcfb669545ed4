// Jobs kept up to date while a page is open: by one stream of server-sent events, opened again when it ends, or by polling where there is none.
import { authorization, request } from "../parts/api.js";
import { useAct, useEffect, useNewest, useRead, useReducer, useRef, useShown } from "../parts/view.js";

// Without a stream of events: intervals while a job is unfinished, and else.
const BUSY_MS = 3000;
export const IDLE_MS = 15000;
// With one: soon after a change of a state; the histories, and the place in the queue, which other tenants change too.
const SOON_MS = 50;
const HISTORY_MS = 3000;

const STREAM = "/v1/events";
// Between two streams: after one that ended, and after those that could not be opened, twice as long each time.
const AGAIN_MS = 200;
const LATER_MS = 5000;
const LATEST_MS = 60000;

export const isUnfinished = ({ state }) => ["queued", "running", "cancelling"].includes(state);

// [jobs, error, refresh, change]: the records of read(), null before the first ones, read anew for another key. onJobs(jobs) is called whenever
// one has changed; change(address, method) changes one and reads them again.
export function useJobs({ read, key = "", historyMs = HISTORY_MS, onJobs = () => {} }) {
  const [, draw] = useReducer((count) => count + 1, 0);
  const [live, shown] = [useRef(false), useShown()];
  // Of jobs that read() does not return.
  const states = useRef(new Map());
  const newest = useNewest({ read, onJobs });
  const [failure, act] = useAct();

  async function readAll() {
    const found = await newest.current.read();
    if (shown.current) newest.current.onJobs(found);
    return found;
  }
  function waitOf(found, problem) {
    if (!live.current || problem) return found?.some(isUnfinished) ? BUSY_MS : IDLE_MS;
    return found?.some((job) => job.ahead) ? HISTORY_MS : null;
  }
  const [jobs, error, refresh, readIn] = useRead(readAll, { waitOf, key, settle: 0 });
  const current = useNewest(jobs);

  function onChange({ id, state, progress }) {
    const job = current.current?.find((row) => row.id === id);
    const before = job ? job.state : states.current.get(id);
    states.current.set(id, state);
    if (before !== state) return readIn(SOON_MS);
    if (!job || JSON.stringify(job.progress) === JSON.stringify(progress)) return;
    job.progress = progress;
    newest.current.onJobs(current.current);
    draw();
    readIn(historyMs);
  }
  function onOpen(open) {
    live.current = open;
    // Changes before it opened are not in the stream.
    readIn(open ? SOON_MS : BUSY_MS);
  }
  useEffect(() => jobEvents({ onChange, onOpen }), []);
  const change = (address, method) => act(async () => {
    await request(address, { method });
    await refresh();
  });
  return [jobs, failure ?? error, refresh, change];
}

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
function jobEvents({ onChange, onOpen }) {
  let controller = new AbortController();
  async function connect({ signal }) {
    for (let wait = LATER_MS, pause = AGAIN_MS; !signal.aborted; pause = AGAIN_MS) {
      try {
        const response = await fetch(STREAM, { headers: authorization(), signal, cache: "no-store" });
        if (!response.ok) throw new Error(`status ${response.status}`);
        wait = LATER_MS;
        onOpen(true);
        for await (const change of changesIn(response.body)) onChange(change);
      } catch {
        if (signal.aborted) return;
        onOpen(false);
        [pause, wait] = [wait, Math.min(2 * wait, LATEST_MS)];
      }
      await new Promise((resolve) => setTimeout(resolve, pause));
    }
  }
  function follow() {
    controller.abort();
    controller = new AbortController();
    if (!document.hidden) connect(controller);
  }
  document.addEventListener("visibilitychange", follow);
  follow();
  return () => {
    document.removeEventListener("visibilitychange", follow);
    controller.abort();
  };
}
