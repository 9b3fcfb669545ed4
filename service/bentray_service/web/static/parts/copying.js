// Text for the clipboard; where the browser gives none, the text is shown to copy by hand.
import { Button, html, useLater, useRef, useState } from "./view.js";

const COPIED_MS = 2000;

// A button that copies text() and says so.
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
