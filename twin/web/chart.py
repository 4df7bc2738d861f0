"""A chart on a page: panes of curves over time, which request the visible samples from the server."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from nicegui.element import Element

if TYPE_CHECKING:
    from collections.abc import Callable

COLORS = 8  # `--line-0` to `--line-7` of the style


@dataclass
class ChartCurve:
    """A line of a pane: `name` in the source, `color` of the palette, `step`: constant between samples.

    Other curves of the source: `faint` is drawn faintly behind it, the area between `low` and `high` is filled lightly.
    """

    name: str
    label: str = ""
    color: int = 0
    step: bool = False
    faint: str = ""
    low: str = ""
    high: str = ""


@dataclass
class Pane:
    """Curves over one axis, in a height of `weight` relative to other panes.

    `own`: not over time but over `x` ({label, unit}); `log`: logarithmic axes ("x", "y", "xy"). `limits`: lines with `y`,
    `from` and `to` [s], red if `failed`.
    """

    title: str = ""
    unit: str = ""
    curves: list[ChartCurve] = field(default_factory=list)
    weight: float = 1.0
    band: tuple[float, float] | None = None
    lines: list[float] = field(default_factory=list)
    limits: list[dict[str, Any]] = field(default_factory=list)
    own: bool = False
    log: str = ""
    x: dict[str, str] | None = None


class Chart(Element, component="static/chart_element.js"):
    """Panes with a common time axis, zoomed and moved together.

    `url`: a route made with `frames.route`. `follow`: show the last `span` seconds, updated 30 times a second.
    """

    def __init__(self, url: str, panes: list[Pane], *, span: float = 10.0, follow: bool = False) -> None:
        super().__init__()
        self.panes = panes
        self._props.update(url=url, span=span, follow=follow, marks=[], panes=[asdict(pane) for pane in panes])

    def show_panes(self) -> None:
        """Redraw `panes`."""
        self._props["panes"] = [asdict(pane) for pane in self.panes]
        self.update()

    def show_marks(self, marks: list[dict[str, Any]]) -> None:
        """Draw events ({at, text})."""
        self._props["marks"] = marks
        self.update()

    def show(self, start: float | None, stop: float | None) -> None:
        """Show a window of time, or all."""
        self.run_method("show", start, stop)

    def show_last(self, span: float) -> None:
        """Follow the last seconds."""
        self.run_method("followed", span)

    def add(
        self, name: str, unit: str, label: str = "", *, pane: int | None = None, step: bool = False, faint: str = ""
    ) -> None:
        """Add a curve to a pane, to the first with its unit, or to a new one; do nothing if it is shown already."""
        if any(curve.name == name for pane in self.panes for curve in pane.curves):
            return
        used = [curve.color for pane in self.panes for curve in pane.curves]
        color = min(range(COLORS), key=lambda number: (used.count(number), number))
        curve = ChartCurve(name, label, color, step, faint)
        fitting = [pane for pane in self.panes if pane.unit == unit and not pane.own] if pane is None else []
        if pane is not None and 0 <= pane < len(self.panes):
            fitting = [self.panes[pane]]
        if fitting:
            fitting[0].curves.append(curve)
        else:
            self.panes.append(Pane(unit=unit, curves=[curve]))
        self.show_panes()

    def remove_curve(self, name: str) -> None:
        """Remove a curve, and a pane that becomes empty."""
        for pane in self.panes:
            pane.curves = [curve for curve in pane.curves if curve.name != name]
        self.panes = [pane for pane in self.panes if pane.curves]
        self.show_panes()

    def on_action(self, event: str, callback: Callable[[dict[str, Any]], object]) -> None:
        """Register a callback for user actions: window, cursors, drop, remove. The callback checks its argument."""
        self.on(event, lambda action: callback(action.args if isinstance(action.args, dict) else {}))
