// Light or dark as in the system or as chosen before (theme.py); paper is light. Runs before anything is drawn.
{
  let chosen = null;
  try { chosen = localStorage.getItem("twin-dark"); } catch { /* a file may not remember */ }
  const system = matchMedia("(prefers-color-scheme: dark)");
  const set = (isDark) => document.body.classList.toggle("body--dark", isDark);
  const screen = () => set(chosen === null ? system.matches : chosen === "1");
  system.addEventListener("change", screen);
  addEventListener("beforeprint", () => set(false));
  addEventListener("afterprint", screen);
  screen();
}
