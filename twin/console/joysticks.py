"""Operator controls: joysticks, keys and a gamepad, as in the `console:` section of a scenario. Script: `static/desk.js`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui.element import Element

if TYPE_CHECKING:
    from twin.live import Catalog


class Presence(Element, component="static/presence.js"):
    """Socket and stop button of a page. Only a page with this element may operate.

    `attends`: the page shows motion outside of a session, and renews its presence. `hardware`: Esc stops. `stop_label`: text of
    the stop button until the first tick; empty: no button.
    """

    def __init__(self, client: str, *, attends: bool, hardware: bool, stop_label: str) -> None:
        super().__init__()
        self._props.update(page=client, attends=attends, hardware=hardware, stop_label=stop_label)


class Desk(Element, component="static/desk.js"):
    """Shows held controls, renews them, and releases them if the page is hidden. `session`: they end with the session.

    `space_runs`: the space bar presses Run or Pause of a session, never with drives, which no key may start.
    """

    def __init__(self, controls: list[dict[str, Any]], *, session: bool = False, space_runs: bool = False) -> None:
        super().__init__()
        self._props.update(controls=controls, session=session, space_runs=space_runs)


def control(name: str, label: str, about: str, keys: tuple[str, str], unit: str, most: float) -> dict[str, Any]:
    """Return a control with two buttons and two keys, outside of a scenario: fully held it is `most` in the display unit."""
    return {
        "name": name,
        "input": name,
        "label": label,
        "about": about,
        "kind": "hold",
        "stick": None,
        "keys": list(keys),
        "axis": None,
        "reverse": False,
        "buttons": [None, None],
        "dead": 0.0,
        "unit": unit,
        "low": -most,
        "high": most,
        "factor": most,
        "offset": 0.0,
    }


def controls(catalog: Catalog) -> list[dict[str, Any]]:
    """Return the controls of a scenario."""
    return [
        {
            "name": item.name,
            "input": item.input,
            "label": item.label,
            "about": item.description,
            "kind": item.kind,
            "stick": item.stick,
            "keys": list(item.keys),
            "axis": item.axis,
            "reverse": item.reverse,
            "buttons": list(item.buttons),
            "dead": item.dead_zone,
            "unit": item.display_unit,
            "low": item.factor * item.low + item.offset,
            "high": item.factor * item.high + item.offset,
            "factor": item.factor,
            "offset": item.offset,
        }
        for item in catalog.controls
    ]
