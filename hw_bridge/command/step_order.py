"""Lift the order of a drive's steps on the commissioning page, after a question that names those that are skipped."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.command.commissioning_steps import ALWAYS, STEPS, missing_steps

if TYPE_CHECKING:
    from nicegui.elements.switch import Switch

    from hw_bridge.command.pages import Page

SKIPPED = "{name}: not done with this drive and hardware file: step {steps}."
RISK = (
    "If the encoder or “inverted” of the file is wrong, the drive moves the wrong way, to an end stop.",
    "Skip these steps only if this drive was commissioned before with this file.",
)


def order_switch(page: Page, name: str) -> None:
    """Switch that lifts the order of a drive's steps."""
    from nicegui import ui

    switch = ui.switch("commissioned before: steps in any order").props("dense")
    switch.on_value_change(lambda event: change_order(page, name, switch, event.value))


async def change_order(page: Page, name: str, switch: Switch, is_lifted: bool) -> None:
    """Lift the order of a drive's steps, after a question that names those that are skipped, or restore it."""
    if is_lifted == (name in page.commissioned):  # the switch follows the answer
        return
    skipped = missing_steps(STEPS[-1], lambda each: page.is_done(each, name)) if is_lifted else {}
    skipped.pop(ALWAYS, None)
    if skipped:
        switch.value = False  # until it is answered
        if not await confirm([SKIPPED.format(name=name, steps=", ".join(skipped.values())), *RISK]):
            return
    (page.commissioned.add if is_lifted else page.commissioned.discard)(name)
    switch.value = is_lifted
    page.update()


async def confirm(lines: list[str]) -> bool:
    """Ask whether steps may be skipped."""
    from nicegui import ui

    with ui.dialog().props("persistent") as dialog, ui.card():
        with ui.column().classes("twin-result twin-warn gap-1"):
            for line in lines:
                ui.label(line)
        with ui.row():
            ui.button("Keep the order", on_click=lambda: dialog.submit(False)).props("no-caps outline")
            ui.button("Skip these steps", on_click=lambda: dialog.submit(True)).props("no-caps flat color=warning")
    answer = bool(await dialog)
    if not dialog.is_deleted:  # with its page
        dialog.delete()
    return answer
