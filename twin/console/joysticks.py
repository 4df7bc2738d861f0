"""What a hand moves: joysticks, keys and a gamepad, by the scenario's `console:`. The work is done in `static/desk.js`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui.element import Element

if TYPE_CHECKING:
    from twin.live import Catalog


class Presence(Element, component="static/presence.js"):
    """The page's end of the wire, and the stop: on every page. Only a page with it may operate.

    `attends`: it shows what moves beside a session, and renews that it does.
    """

    def __init__(self, client: str, attends: bool = False) -> None:
        super().__init__()
        self._props.update(page=client, attends=attends)


class Desk(Element, component="static/desk.js"):
    """Shows what is held, renews it, and lets go where nobody looks."""

    def __init__(self, controls: list[dict[str, Any]]) -> None:
        super().__init__()
        self._props["controls"] = controls


def control(name: str, label: str, about: str, keys: tuple[str, str], unit: str, most: float) -> dict[str, Any]:
    """A button for each way and two keys, outside of a scenario: held at 1 it is `most` in the unit shown."""
    return {
        "name": name, "input": name, "label": label, "about": about, "kind": "hold", "stick": None, "keys": list(keys),
        "axis": None, "reverse": False, "buttons": [None, None], "dead": 0.0, "unit": unit, "low": -most, "high": most,
        "factor": most, "offset": 0.0,
    }  # fmt: skip


def controls(catalog: Catalog) -> list[dict[str, Any]]:
    """Those that a scenario names."""
    return [
        {
            "name": one.name, "input": one.input, "label": one.label, "about": one.description, "kind": one.kind,
            "stick": one.stick, "keys": list(one.keys), "axis": one.axis, "reverse": one.reverse,
            "buttons": list(one.buttons), "dead": one.dead_zone, "unit": one.display_unit,
            "low": one.factor * one.low + one.offset, "high": one.factor * one.high + one.offset,
            "factor": one.factor, "offset": one.offset,
        }
        for one in catalog.controls
    ]  # fmt: skip
