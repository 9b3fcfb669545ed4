// A menu that opens below its title, and closes by Escape, by a click elsewhere and when its focus goes on.
import { make } from "./dom.js";

// A details element with a title and a sheet of content.
export function menuOf(title, sheet, className = "") {
  const menu = make("details", `menu ${className}`.trim());
  const summary = make("summary", "", title);
  sheet.classList.add("sheet");
  menu.append(summary, sheet);
  menu.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !menu.open) return;
    menu.open = false;
    summary.focus();
  });
  menu.addEventListener("focusout", ({ relatedTarget: next }) => {
    if (next && !menu.contains(next)) menu.open = false;
  });
  const elsewhere = ({ target }) => {
    if (!menu.contains(target)) menu.open = false;
  };
  menu.addEventListener("toggle", () => {
    if (menu.open) document.addEventListener("pointerdown", elsewhere);
    else document.removeEventListener("pointerdown", elsewhere);
  });
  return menu;
}
