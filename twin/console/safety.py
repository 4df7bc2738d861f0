"""Safety panel for drives on a bus: armed or not, state of each drive, distance from its limits, timing of bus and loop."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from nicegui import ui

if TYPE_CHECKING:
    from twin.console.page import PageContext

WARNING_FRACTION = 0.8  # of a limit: shown as a warning
SHOWN_UNITS = {
    unit + rate: (shown + rate, factor)
    for unit, shown, factor in (("m", "mm", 1e3), ("rad", "deg", math.degrees(1.0)))
    for rate in ("", "/s")
}


def panel(context: PageContext) -> None:
    """Create the panel; it is updated ten times a second."""
    live = context.console.live
    assert live is not None
    with ui.element("section").classes("twin-safety full-width"):
        head = ui.html("", sanitize=False)
        nodes = ui.html("", sanitize=False)
        rest = ui.html("", sanitize=False)

    def update() -> None:
        status = live.state.hardware
        if status is not None:
            for element, text in ((head, heading(status)), (nodes, drives(status)), (rest, details(status))):
                if element.content != text:
                    element.content = text

    update()
    ui.timer(0.1, update)


def heading(status: Mapping[str, Any]) -> str:
    """Return whether drives may move, the control program, and the timing of bus and loop."""
    armed = "armed: power may be on" if status["armed"] else "not armed"
    if status["simulated"]:
        armed = "simulated drives, in simulated time: pause, step and pace apply to them"
    kind = "warn" if status["armed"] and not status["simulated"] else "good"
    if status["stopped"] == "stopped":
        armed, kind = "stopped; states as last read", "soft"
    elif status["stopped"]:
        armed, kind = f"stopped: {status['stopped']}", "bad"
    figures = {"master": status["control"], "bus": f"{status['interface']} {status['channel']}".strip() or "simulated"}
    if status["brought_up"]:
        figures["bus"] += f", load {100 * status['bus_load']:.1f} %"
        figures["cycle"] = f"{status['cycle'] * 1e3:g} ms, {status['cycles']} done"
        figures["jitter"] = f"{status['jitter_99'] * 1e3:.2f} ms (99 %), {status['jitter_max'] * 1e3:.2f} ms at most"
    rows = "".join(f"<dt>{escaped(name)}</dt><dd>{escaped(text)}</dd>" for name, text in figures.items())
    return f'<p class="twin-state twin-{kind}">{escaped(armed)}</p><dl>{rows}</dl>'


def drives(status: Mapping[str, Any]) -> str:
    """Return each drive with state, errors and a bar for each limit."""
    over = {"heartbeat_age": None} if status["stopped"] else {}  # nothing is watched any more
    return "".join(drive(name, {**entry, **over}) for name, entry in status["nodes"].items())


def drive(name: str, node: Mapping[str, Any]) -> str:
    """Return one drive."""
    errors = "".join(f'<li class="twin-bad">{escaped(text)}</li>' for text in node["errors"])
    bars = "".join(bar(limit) for limit in node["limits"])
    age, limit = node["heartbeat_age"], node["heartbeat_limit"]
    beat = f"heartbeat {age * 1e3:.0f} of {limit * 1e3:.0f} ms" if age is not None and limit else "no heartbeat watched"
    kind = "bad" if "ault" in node["state"] else "good" if node["state"].lower() == "operation enabled" else "soft"
    return (
        f'<article><header><b>{escaped(name)}</b> <span class="twin-soft">node {node["node"]}, {escaped(node["profile"])}</span>'
        f'<span class="twin-state twin-{kind}">{escaped(node["state"])}</span></header>'
        f'<p class="twin-soft">{escaped(node["mode"])}; {beat}; {node["lost"]} lost, {node["late"]} late</p>'
        f"<ul>{errors}</ul>{bars}</article>"
    )


def bar(limit: Mapping[str, Any]) -> str:
    """Return a bar that shows how close a limit is."""
    part = min(max(float(limit["part"] or 0.0), 0.0), 1.0)
    kind = "bad" if part >= 1.0 else "warn" if part >= WARNING_FRACTION else "good"
    unit, factor = SHOWN_UNITS.get(limit["unit"], (limit["unit"], 1.0))
    value, low, high = (factor * limit[name] for name in ("value", "low", "high"))
    text = f"{value:.4g} of {low:.4g} to {high:.4g} {unit}"
    return (
        f'<div class="twin-limit" title="{escaped(text)}"><span>{escaped(limit["name"])}</span>'
        f'<i><b class="twin-{kind}" style="width:{100 * part:.0f}%"></b></i>'
        f'<span class="twin-figures">{value:.3g} {escaped(unit)}</span></div>'
    )


def details(status: Mapping[str, Any]) -> str:
    """Return force monitors, residuals of the shadow, modules and notes."""
    instant = f" at {status['time']:.2f} s" if "time" in status else ""
    rows = [(f"watch {name}", watch(entry, instant)) for name, entry in status["watches"].items()]
    rows += [
        (f"shadow {name}", shadow(entry, rotary=status["nodes"].get(name, {}).get("rotary", False)))
        for name, entry in status["shadow"].items()
    ]
    rows += [(f"module {name}", words(entry)) for name, entry in status["modules"].items()]
    listed = "".join(f"<dt>{escaped(name)}</dt><dd>{escaped(text)}</dd>" for name, text in rows)
    notes = "".join(f"<li>{escaped(text)}</li>" for text in status["notes"])
    return f"<dl>{listed}</dl><ul>{notes}</ul>"


def watch(monitor: Mapping[str, Any], instant: str = "") -> str:
    """Return a force monitor [N]: value and its `instant`, stop limit, and why the drive retracts if it does."""
    now = "not known" if monitor["force"] is None else f"{monitor['force']:.3f} N"
    return f"{monitor['signal']} is {now}{instant}, stops above {monitor['above']:g} N. {monitor['retracts']}".rstrip(
        " ."
    )


def shadow(residual: Mapping[str, Any], *, rotary: bool = False) -> str:
    """Return the residuals between drive and twin: now, tolerance band, largest; and warnings."""
    length, factor = ("deg", math.degrees(1.0)) if rotary else ("mm", 1e3)
    kinds = {"position": (length, factor), "velocity": (f"{length}/s", factor), "current": ("A", 1.0)}

    def shown(value: float | None, unit: str, times: float) -> str:
        return "not known" if value is None else f"{times * value:.3g} {unit}"

    residuals = ", ".join(
        f"{name} {shown(residual['now'][name], *kind)} (band {shown(residual['bands'][name], *kind)}, "
        f"largest {shown(residual['largest'][name], *kind)})"
        for name, kind in kinds.items()
    )
    return ". ".join([residuals, *residual["warnings"]])


def words(status: Any) -> str:
    """Return a small table as one line."""
    if isinstance(status, Mapping):
        return ", ".join(f"{name} {words(entry)}" for name, entry in status.items())
    return f"{status:.4g}" if isinstance(status, float) else str(status)


def escaped(text: Any) -> str:
    """Return text of drives and files, escaped for HTML."""
    from html import escape

    return escape(str(text))
