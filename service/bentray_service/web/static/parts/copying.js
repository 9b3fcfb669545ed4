// Text for the clipboard; where the browser gives none, the text is shown to copy by hand.
import { make } from "./dom.js";

// A button that copies text() and says so.
export function copyButton(title, text) {
  const button = make("button", "quiet", title);
  button.type = "button";
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(text());
      button.textContent = "Copied";
      setTimeout(() => {
        button.textContent = title;
      }, 2000);
    } catch {
      showText(title, text());
    }
  });
  return button;
}

function showText(title, text) {
  const box = make("dialog", "copy");
  const area = make("textarea");
  Object.assign(area, { value: text, readOnly: true, rows: 8 });
  area.setAttribute("aria-label", title);
  const close = make("button", "", "Close");
  close.addEventListener("click", () => box.close());
  box.addEventListener("close", () => box.remove());
  box.append(area, close);
  document.body.append(box);
  box.showModal();
  area.select();
}
