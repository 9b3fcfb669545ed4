// How far a phase of a job is, moving evenly between two reports, and the time that is left.

// Reports of the last seconds from which the rate is taken, and the share that only the next phase reaches.
const WINDOW_S = 20;
const FULL = 0.995;

export class ProgressEstimate {
  phase = null;
  reports = [];
  // Of a phase: the share that is shown, and the tasks it stands for; null before the first report is shown.
  shown = 0;
  tasks = null;

  // A report at a time, s: { done, total, phase }, and the running time of the job, s. The total may fall, where
  // tasks turn out not to be needed, and grow.
  add(now, { done, total, phase }, seconds) {
    if (phase !== this.phase || done < (this.reports.at(-1)?.done ?? 0)) {
      // What was done before the page was opened took as long as the job has run, if there was no phase before.
      const begun = this.phase === null && done ? [{ time: now - seconds, done: 0 }] : [];
      Object.assign(this, { phase, reports: begun, shown: 0, tasks: null });
    }
    this.total = total;
    if (this.reports.at(-1)?.done === done) return;
    this.reports.push({ time: now, done });
    while (this.reports.length > 2 && this.reports[1].time < now - WINDOW_S) this.reports.shift();
  }

  // Tasks per second; null before two reports.
  rate() {
    const [first, last] = [this.reports[0], this.reports.at(-1)];
    return last?.time > first?.time ? (last.done - first.done) / (last.time - first.time) : null;
  }

  // Tasks done at a time: after the last report it moves on at the rate so far, by one step at most.
  reached(now) {
    const last = this.reports.at(-1);
    const before = this.reports.at(-2);
    return last.done + (before ? Math.min((this.rate() ?? 0) * Math.max(0, now - last.time), last.done - before.done) : 0);
  }

  // From 0 to 1, never back. Each task takes its part of what is left of the bar, so that a total that changes
  // changes the pace, and the bar does not jump.
  share(now) {
    if (!this.total || !this.reports.length) return 0;
    if (this.reports.at(-1).done >= this.total) return (this.shown = 1);
    const tasks = Math.min(this.reached(now), FULL * this.total);
    if (this.tasks === null) this.shown = tasks / this.total;
    else if (tasks > this.tasks) this.shown += (1 - this.shown) * ((tasks - this.tasks) / (this.total - this.tasks));
    this.tasks = Math.max(tasks, this.tasks ?? 0);
    return this.shown;
  }

  // Seconds until the end of the phase; null while they are unknown.
  left(now) {
    const rate = this.rate();
    if (!rate || !this.total) return null;
    return Math.max(0, this.total - this.reached(now)) / rate;
  }
}
