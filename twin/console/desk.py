"""What a hand moves: joysticks, keys and a gamepad, by the scenario's `console:`. The work is done in `static/desk.js`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui.element import Element

if TYPE_CHECKING:
    from twin.live import Catalog


class Presence(Element, component="static/presence.js"):
    """The page's end of the wire, and the stop: on every page. Only a page with it may operate."""

    def __init__(self, client: str) -> None:
        super().__init__()
        self._props["page"] = client


class Desk(Element, component="static/desk.js"):
    """Shows what is held, renews it, and lets go where nobody looks."""

    def __init__(self, catalog: Catalog) -> None:
        super().__init__()
        self._props["controls"] = [
            {
                "name": one.name, "input": one.input, "label": one.label, "about": one.description, "kind": one.kind,
                "stick": one.stick, "keys": list(one.keys), "axis": one.axis, "reverse": one.reverse,
                "buttons": list(one.buttons), "dead": one.dead_zone, "unit": one.display_unit,
                "low": one.factor * one.low + one.offset, "high": one.factor * one.high + one.offset,
                "factor": one.factor, "offset": one.offset,
            }
            for one in catalog.controls
        ]  # fmt: skip
