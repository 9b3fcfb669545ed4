// Light or dark: the choice of the reader, else that of the system. A classic script, so that it runs before the first paint.
{
  const STORED = "bentray-theme";
  const system = matchMedia("(prefers-color-scheme: dark)");
  const root = document.documentElement;

  const chosen = () => localStorage.getItem(STORED) || (system.matches ? "dark" : "light");

  const show = () => {
    root.dataset.theme = chosen();
    const button = document.getElementById("theme");
    if (button) button.textContent = chosen() === "dark" ? "Light" : "Dark";
    if (button) button.setAttribute("aria-label", `Switch to ${chosen() === "dark" ? "light" : "dark"} colours`);
    document.dispatchEvent(new Event("theme"));
  };

  show();
  system.addEventListener("change", show);
  document.addEventListener("DOMContentLoaded", () => {
    show();
    document.getElementById("theme")?.addEventListener("click", () => {
      const other = chosen() === "dark" ? "light" : "dark";
      // The choice of the system is not stored: the page follows it again.
      if ((other === "dark") === system.matches) localStorage.removeItem(STORED);
      else localStorage.setItem(STORED, other);
      show();
    });
  });
}
