// How far a phase of a job is, moving evenly between two reports, and the time that is left.

// Reports of the last seconds from which the rate is taken, and the share that only the next phase reaches.
const WINDOW_S = 20;
const FULL = 0.995;

export class ProgressEstimate {
  constructor() {
    this.phase = null;
    this.reports = [];
    this.shown = 0;
  }

  // A report at a time, s: { done, total, phase }, and the running time of the job, s.
  add(now, { done, total, phase }, seconds) {
    if (phase !== this.phase || done < (this.reports.at(-1)?.done ?? 0)) {
      // What was done before the page was opened took as long as the job has run, if there was no phase before.
      const begun = this.phase === null && done ? [{ time: now - seconds, done: 0 }] : [];
      [this.phase, this.reports, this.shown] = [phase, begun, 0];
    }
    this.total = total;
    if (this.reports.at(-1)?.done === done) return;
    this.reports.push({ time: now, done });
    while (this.reports.length > 2 && this.reports[1].time < now - WINDOW_S) this.reports.shift();
  }

  // Tasks per second; null before two reports.
  rate() {
    if (this.reports.length < 2) return null;
    const [first, last] = [this.reports[0], this.reports.at(-1)];
    return last.time > first.time ? (last.done - first.done) / (last.time - first.time) : null;
  }

  // From 0 to 1, never back; between two reports it moves on at the rate so far, by one step at most.
  share(now) {
    const last = this.reports.at(-1);
    if (!this.total || !last) return 0;
    const before = this.reports.at(-2);
    const ahead = before ? Math.min((this.rate() ?? 0) * Math.max(0, now - last.time), last.done - before.done) : 0;
    const reached = last.done >= this.total ? 1 : Math.min(FULL, (last.done + ahead) / this.total);
    this.shown = Math.max(this.shown, reached);
    return this.shown;
  }

  // Seconds until the end of the phase; null while they are unknown.
  left(now) {
    const rate = this.rate();
    if (!rate || !this.total) return null;
    return ((1 - this.share(now)) * this.total) / rate;
  }
}
