// Light or dark: the choice of the reader, else that of the system. A classic script, so that it runs before the first paint.
{
  const STORED = "bentray-theme";
  const system = matchMedia("(prefers-color-scheme: dark)");
  const root = document.documentElement;
  const other = () => (root.dataset.theme === "dark" ? "light" : "dark");

  const show = () => {
    root.dataset.theme = localStorage.getItem(STORED) || (system.matches ? "dark" : "light");
    const button = document.getElementById("theme");
    if (!button) return;
    button.textContent = other() === "dark" ? "Dark" : "Light";
    button.setAttribute("aria-label", `Switch to ${other()} colours`);
  };

  show();
  system.addEventListener("change", show);
  document.addEventListener("DOMContentLoaded", () => {
    show();
    document.getElementById("theme")?.addEventListener("click", () => {
      // The choice of the system is not stored: the page follows it again.
      if ((other() === "dark") === system.matches) localStorage.removeItem(STORED);
      else localStorage.setItem(STORED, other());
      show();
    });
  });
}
