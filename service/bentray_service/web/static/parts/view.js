// The structure of pages: Preact with htm, and the elements, tables and hooks that all pages share.
import { useEffect, useLayoutEffect, useRef, useState } from "../vendor/hooks.mjs";
import htm from "../vendor/htm.mjs";
import { h } from "../vendor/preact.mjs";

export { render } from "../vendor/preact.mjs";
export { useEffect, useLayoutEffect, useMemo, useReducer, useRef, useState } from "../vendor/hooks.mjs";

export const html = htm.bind(h);

// error: an Error or its words; without one it is hidden.
export function Alert({ error, id, className = "" }) {
  return html`<p id=${id} class=${`error ${className}`.trim()} role="alert" hidden=${!error}>${error?.message ?? error}</p>`;
}

export function Facts({ children, ...more }) {
  return html`<p class="facts" ...${more}>${children}</p>`;
}

// A part of a page below its heading, which names it. id: of the heading before "-title"; className: "panel" in a frame.
export function Section({ id, title, className = "panel", children, ...more }) {
  return html`<section class=${className} aria-labelledby=${`${id}-title`} ...${more}><h2 id=${`${id}-title`}>${title}</h2>${children}</section>`;
}

// A part of a page that is opened by its heading.
export function FoldedSection({ title, className = "", children }) {
  return html`<details class=${`panel folded ${className}`.trim()}><summary><h2>${title}</h2></summary>${children}</details>`;
}

// A field below its caption.
export function Labelled({ caption, children, ...more }) {
  return html`<label ...${more}><span class="caption">${caption}</span>${children}</label>`;
}

// An input below its caption, or a choice. label: attributes of the label; entries, chosen: see Options.
export function Field({ caption, label, ...more }) {
  return html`<${Labelled} caption=${caption} ...${label}><input autocomplete="off" ...${more} /></${Labelled}>`;
}

export function Choice({ caption, label, entries, chosen, ...more }) {
  return html`<${Labelled} caption=${caption} ...${label}><select ...${more}><${Options} entries=${entries} chosen=${chosen} /></select></${Labelled}>`;
}

// entries: [value, words], or words that are their own value. A reset of the form goes back to the chosen one.
export function Options({ entries, chosen }) {
  return entries.map((entry) => {
    const [value, words] = [entry].flat();
    const selected = value === chosen;
    return html`<option key=${value} value=${value} selected=${selected} defaultSelected=${selected}>${words ?? value}</option>`;
  });
}

export function Button({ children, quiet = true, ...more }) {
  return html`<button type="button" class=${quiet ? "quiet" : ""} ...${more}>${children}</button>`;
}

// A form that is handled here: onSubmit(event) in place of the browser.
export function Form({ onSubmit, children, ...more }) {
  const submit = (event) => {
    event.preventDefault();
    onSubmit(event);
  };
  return html`<form onSubmit=${submit} ...${more}>${children}</form>`;
}

// label: of the frame, another one than that of the section; columns: headings, if there are any; rows: lists of texts or elements, with keys if
// they move; chosen: the number of the row that is marked.
export function HeadedTable({ label, columns = [], rows, keys = [], className = "headed", chosen = -1 }) {
  return html`<div class="scroll" tabindex="0" role="region" aria-label=${label}>
    <table class=${className}>
      ${columns.length > 0 && html`<thead><tr>${columns.map((name) => html`<th scope="col">${name}</th>`)}</tr></thead>`}
      <tbody>${rows.map(([first, ...others], number) => html`<tr key=${keys[number] ?? number} class=${number === chosen ? "chosen" : ""}>
        <th scope="row">${first}</th>
        ${others.map((cell) => html`<td>${cell}</td>`)}
      </tr>`)}</tbody>
    </table>
  </div>`;
}

// Names and values.
export function Pairs({ rows, className = "pairs", caption }) {
  return html`<table class=${className}>
    ${caption && html`<caption class="caption">${caption}</caption>`}
    <tbody>${rows.map(([name, value]) => html`<tr><th scope="row">${name}</th><td>${value}</td></tr>`)}</tbody>
  </table>`;
}

// A menu that opens below its title, and closes by Escape, by a click elsewhere and when its focus goes on. onOpen() is called when it opens.
export function Menu({ title, className = "", onOpen = () => {}, children }) {
  const menu = useRef(null);
  useEffect(() => {
    const elsewhere = ({ target }) => {
      if (!menu.current.contains(target)) menu.current.open = false;
    };
    document.addEventListener("pointerdown", elsewhere);
    return () => document.removeEventListener("pointerdown", elsewhere);
  }, []);
  const onKeyDown = ({ key, currentTarget }) => {
    if (key !== "Escape" || !currentTarget.open) return;
    currentTarget.open = false;
    currentTarget.querySelector("summary").focus();
  };
  const onFocusOut = ({ relatedTarget: next, currentTarget }) => {
    if (next && !currentTarget.contains(next)) currentTarget.open = false;
  };
  return html`<details ref=${menu} class=${`menu ${className}`.trim()} onKeyDown=${onKeyDown} onFocusOut=${onFocusOut} onToggle=${({ target }) => target.open && onOpen()}>
    <summary>${title}</summary>
    ${children}
  </details>`;
}

const COPIED_MS = 2000;

// A button that copies text() and says so; where the browser gives no clipboard, the text is shown to copy by hand.
export function CopyButton({ title, text }) {
  const [copied, setCopied] = useState(false);
  const [dialog, area] = [useRef(null), useRef(null)];
  const later = useLater();
  async function copy() {
    try {
      await navigator.clipboard.writeText(text());
      setCopied(true);
      later(() => setCopied(false), COPIED_MS);
    } catch {
      area.current.value = text();
      dialog.current.showModal();
      area.current.select();
    }
  }
  return html`
    <${Button} onClick=${copy}>${copied ? "Copied" : title}</${Button}>
    <dialog class="copy" ref=${dialog}>
      <textarea ref=${area} readonly rows="8" aria-label=${title}></textarea>
      <button type="button" onClick=${() => dialog.current.close()}>Close</button>
    </dialog>`;
}

// Whether the component is still shown, as { current }.
export function useShown() {
  const shown = useRef(true);
  useEffect(() => () => {
    shown.current = false;
  }, []);
  return shown;
}

// [element, width, height]: the size of an element, pixels of the page; 0 before it is shown.
export function useSize() {
  const element = useRef(null);
  const [size, setSize] = useState([0, 0]);
  useLayoutEffect(() => {
    const watcher = new ResizeObserver(([{ contentRect: { width, height } }]) => setSize([width, height]));
    watcher.observe(element.current);
    return () => watcher.disconnect();
  }, []);
  return [element, ...size];
}

// The newest value for functions that outlive a drawing, as { current }.
export function useNewest(value) {
  const newest = useRef(value);
  newest.current = value;
  return newest;
}

// [error, act, setError]: act(work) waits for work() and keeps what it throws as the error; returns whether it succeeded.
export function useAct() {
  const [error, setError] = useState(null);
  async function act(work) {
    setError(null);
    try {
      await work();
      return true;
    } catch (problem) {
      setError(problem);
      return false;
    }
  }
  return [error, act, setError];
}

const NOTHING = { value: null, error: null };

// [value, error, refresh, readIn] of read(), which is read again after waitOf(value, error) milliseconds while the tab is seen, null: not
// again; and anew for another key, before whose value there is none. settle: then it is read that many milliseconds after the last change of the
// key, and the value before stays until then. readIn(milliseconds): again after a time, unless that is done earlier anyway.
export function useRead(read, { waitOf = () => null, key = "", settle = null } = {}) {
  const [{ value, error }, setState] = useState(NOTHING);
  const reader = useRef(null);
  useEffect(() => {
    let [closed, timer, due, reading] = [false, 0, Infinity, null];
    let [last, problem] = [settle === null ? null : value, null];
    async function readNow() {
      try {
        [last, problem] = [await read(), null];
      } catch (thrown) {
        problem = thrown;
      }
      reading = null;
      if (closed) return;
      setState({ value: last, error: problem });
      const wait = waitOf(last, problem);
      if (wait !== null && !document.hidden) reader.current.readIn(wait);
    }
    reader.current = {
      async refresh() {
        // What is read already may be older than the wish.
        await reading;
        clearTimeout(timer);
        due = Infinity;
        reading ??= readNow();
        return reading;
      },
      readIn(milliseconds) {
        const then = performance.now() + milliseconds;
        if (closed || then >= due) return;
        due = then;
        clearTimeout(timer);
        timer = setTimeout(reader.current.refresh, milliseconds);
      },
    };
    const onVisible = () => document.hidden || waitOf(last, problem) === null || reader.current.refresh();
    document.addEventListener("visibilitychange", onVisible);
    if (settle) reader.current.readIn(settle);
    else reader.current.refresh();
    return () => {
      closed = true;
      clearTimeout(timer);
      document.removeEventListener("visibilitychange", onVisible);
      if (settle === null) setState(NOTHING);
    };
  }, [key]);
  return [value, error, () => reader.current.refresh(), (milliseconds) => reader.current.readIn(milliseconds)];
}

// later(work, milliseconds) puts off the work that waited before; none is done once the component is gone.
export function useLater() {
  const timer = useRef(0);
  useEffect(() => () => clearTimeout(timer.current), []);
  return (work, milliseconds) => {
    clearTimeout(timer.current);
    timer.current = setTimeout(work, milliseconds);
  };
}
