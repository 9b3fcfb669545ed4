// The webhook of a job: state of its message, every attempt to send it with the answer, and the time of the next one.
import { inTime } from "../parts/amounts.js";
import { request } from "../parts/api.js";
import { make } from "../parts/dom.js";
import { headedTable } from "../parts/tables.js";

const FRESH_MS = 5000;
const STATES = {
  pending: "The message is sent when the job has ended.",
  waiting: "The message has not been accepted yet.",
  delivered: "The message was accepted.",
  failed: "The message was given up after the last attempt.",
};

function rowOf({ time, status, error, seconds }, number) {
  const answer = [status !== null && `status ${status}`, error].filter(Boolean).join(": ");
  return [`${number + 1}`, inTime(time), answer, `${seconds.toFixed(2)} s`];
}

function contentOf({ url, state, attempts, due, message }) {
  const heading = make("h2", "", "Webhook");
  heading.id = "webhook-title";
  heading.append(make("span", `state ${{ delivered: "succeeded", waiting: "running" }[state] ?? state}`, state));
  const next = due ? ` Next attempt: ${inTime(due)}.` : "";
  const content = [heading, make("p", "facts", `${STATES[state]}${next}`), make("p", "facts", message ? `${url}, message ${message}` : url)];
  if (attempts.length) content.push(headedTable("Attempts to send the message", ["Attempt", "Time", "Answer", "Duration"], attempts.map(rowOf)));
  return content;
}

// Show the webhook of a job in root, and follow it until its message is accepted or given up; nothing for a job without one.
// Returns close().
export function showWebhook(root, id) {
  const panel = make("section", "panel webhook");
  panel.setAttribute("aria-labelledby", "webhook-title");
  let [closed, timer, shown] = [false, 0, ""];

  async function refresh() {
    clearTimeout(timer);
    if (!document.hidden) {
      const found = await request(`/v1/jobs/${id}`).catch(() => null);
      if (closed || (found && !found.webhook)) return;
      const signature = JSON.stringify(found?.webhook);
      if (found && signature !== shown) {
        shown = signature;
        panel.replaceChildren(...contentOf(found.webhook));
        if (!panel.isConnected) root.append(panel);
      }
      if (found && ["delivered", "failed"].includes(found.webhook.state)) return;
    }
    timer = setTimeout(refresh, FRESH_MS);
  }

  refresh();
  return () => {
    closed = true;
    clearTimeout(timer);
  };
}
