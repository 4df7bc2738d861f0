"""Style of the pages: one style sheet, light and dark, a header."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from nicegui import ui

DARK = "() => { const dark = !Quasar.Dark.isActive; Quasar.Dark.set(dark); localStorage.setItem('twin-dark', dark ? '1' : '0'); }"
REMEMBERED = """<script>
addEventListener("load", () => { const kept = localStorage.getItem("twin-dark");
  const set = () => window.Quasar ? Quasar.Dark.set(kept === "1") : setTimeout(set, 20); if (kept !== null) set(); });
</script>"""


def apply_style() -> None:
    """Apply the style to a page; light or dark as in the system, until the user chooses."""
    ui.add_head_html('<link rel="stylesheet" href="/web/style.css">' + REMEMBERED)
    ui.colors(
        primary="#1f6f8b",
        secondary="#49656f",
        accent="#c46a1b",
        positive="#2e8b57",
        negative="#b83326",
        warning="#c98a00",
    )
    ui.query(".nicegui-content").classes("p-0 gap-0")


@contextmanager
def page_frame(title: str, links: dict[str, str] | None = None, here: str = "") -> Iterator[ui.row]:
    """Create a page with a header: title, links to other pages, a row for content, a light/dark button."""
    apply_style()
    ui.page_title(title)
    with ui.header(elevated=False).classes("twin-top row items-center no-wrap"):
        ui.html('<img src="/web/favicon.svg" alt="" width="22" height="22">', sanitize=False)
        ui.label(title).classes("twin-title ellipsis")
        for name, path in (links or {}).items():
            ui.link(name, path).classes("twin-link" + " twin-here" * (name == here))
        ui.space()
        row = ui.row().classes("items-center no-wrap gap-2")
        ui.button(icon="contrast").props("flat round dense aria-label='light or dark'").on(
            "click", js_handler=DARK
        ).tooltip("light or dark")
    yield row
