// Buttons that copy a command, of reports; also buttons that a script adds later.
addEventListener("click", async ({ target }) => {
  const button = target.closest?.("button[data-command]");
  if (!button) return;
  try { await navigator.clipboard.writeText(button.dataset.command); button.textContent = "Copied"; } catch {
    if (button.parentElement.querySelector("code")) button.textContent = "Select it to copy";
    else button.replaceWith(Object.assign(document.createElement("code"), { textContent: button.dataset.command }));
  }
});
