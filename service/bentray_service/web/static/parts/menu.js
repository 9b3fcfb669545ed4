// A menu that opens below its title, and closes by Escape, by a click elsewhere and when its focus goes on.
import { html, useEffect, useRef } from "./view.js";

// onOpen() is called when it opens.
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
