"""Charts of a session: a tree to select signals, panes that follow the time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

from twin import web
from twin.console.curves import SessionCurves
from twin.console.operator_panel import HELD, RELEASED, condense

if TYPE_CHECKING:
    from twin.console.session import Host
    from twin.live import Catalog

ALL_TIME = 0.0  # of the selection of the visible time: the whole run
SPANS = {
    5.0: "5 s",
    10.0: "10 s",
    30.0: "30 s",
    60.0: "1 min",
    300.0: "5 min",
    1200.0: "20 min",
    ALL_TIME: "whole run",
}
FOREVER = 1e9  # [s]: JSON has no infinity
MARKS = 100
MARK_WIDTH = 28  # characters
FIRST_CURVES, FIRST_PANES = 8, 3
STEPPED = ("Boolean", "Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64", "Enumeration")


def first_panes(catalog: Catalog, curves: SessionCurves) -> list[web.Pane]:
    """Return the panes for the scenario's plots as far as they are plain signals, else for its first outputs."""
    panes, color, colors = list[web.Pane](), 0, dict[str, int]()
    for title, unit, names in catalog.plots:
        shown = [name for name in names if name in curves.signals][: FIRST_CURVES - color]
        if not shown or len(panes) == FIRST_PANES:
            continue
        labels = [catalog.labels.get(name, name) for name in shown]
        keys = labels if len(set(labels)) == len(labels) else shown  # an instrument has one color in all panes
        pane_curves = [
            _curve(curves, name, colors.setdefault(key, len(colors))) for name, key in zip(shown, keys, strict=True)
        ]
        panes.append(web.Pane(title, _unit(curves, shown[0]) or unit, pane_curves))
        signal = curves.signals[shown[0]]
        if title in catalog.bands:
            low, high = (signal.factor * edge + signal.offset for edge in catalog.bands[title])
            panes[-1].band = (low, high)
        panes[-1].lines = [signal.factor * line + signal.offset for line in catalog.lines.get(title, ())]
        panes[-1].limits = warning_limits(catalog, curves, shown)
        color += len(shown)
    if not panes:
        outputs = [name for name, signal in curves.signals.items() if signal.kind == "output"][:2]
        panes = [web.Pane(unit=_unit(curves, name), curves=[_curve(curves, name, k)]) for k, name in enumerate(outputs)]
    return panes


def warning_limits(catalog: Catalog, curves: SessionCurves, shown: list[str]) -> list[dict[str, Any]]:
    """Return the limits of the warnings of shown signals, in display units."""
    warnings = [
        (curves.signals[each["signal"]], each)
        for each in catalog.warnings
        if each["signal"] in shown and "minus" not in each
    ]
    edges = [(signal, each["above"]) for signal, each in warnings]
    edges += [(signal, each["below"]) for signal, each in warnings if signal.unit == "N" and "below" in each]
    return [
        {"y": signal.factor * edge + signal.offset, "from": catalog.start, "to": FOREVER, "failed": True, "warns": True}
        for signal, edge in edges
    ]


def _unit(curves: SessionCurves, name: str) -> str:
    return curves.signals[name].display_unit


def _curve(curves: SessionCurves, name: str, color: int) -> web.ChartCurve:
    return web.ChartCurve(name, name, color, step=curves.signals[name].type in STEPPED, faint=curves.previous(name))


def panel(console: Host) -> None:
    """Create the chart with its tree and the selection of the visible time."""
    curves, catalog = console.source, console.catalog
    assert curves is not None
    assert catalog is not None
    show_commands(console, ChartPanel(curves, first_panes(catalog, curves)))


class ChartPanel:
    """A chart with its tree, kept consistent. Actions from the browser are checked here."""

    def __init__(self, curves: SessionCurves, panes: list[web.Pane]) -> None:
        self.curves = curves
        with ui.row().classes("items-center full-width no-wrap gap-2"):
            self.span = ui.select(SPANS, value=10.0).props("dense options-dense borderless aria-label='seconds shown'")
            self.follow = ui.button("follow", on_click=self.follow_time).props("flat dense no-caps")
            self.follow.tooltip("drag: zoom, shift-drag: move, wheel, click: cursors")
            self.cursor_label = ui.label().classes("twin-soft twin-figures ellipsis")
            if curves.previous_run is not None:
                ui.label(f"faint: {curves.previous_run.title}").classes("twin-soft")
            ui.space()
            picking = (
                ui.button(icon="account_tree").props("flat round dense aria-label='signals'").tooltip("pick signals")
            )
        with ui.element("div").classes("twin-select"):
            drawer = ui.element("div").classes("twin-drawer twin-shut")
            self.chart = web.Chart("/data", panes, follow=True).classes("twin-live-chart")
        picking.on_click(lambda: drawer.classes(toggle="twin-shut"))
        drawer.on("keydown.escape", lambda: drawer.classes(add="twin-shut"))
        with drawer:
            self.tree = web.Tree(self.leaves(), self.select, curve_names(self.chart))
        self.chart.on_action("drop", self.drop)
        self.chart.on_action("remove", lambda action: self.select(action.get("name"), False))
        self.chart.on_action("window", self.window)
        self.chart.on_action("cursors", self.cursors)
        self.span.on_value_change(self.follow_time)
        self.resize()

    def leaves(self) -> list[web.Leaf]:
        """Return all signals that can be shown, by member."""
        return [
            web.Leaf(
                name,
                tuple(signal.member.split(".")),
                name.removeprefix(f"{signal.member}."),
                signal.display_unit,
                signal.description,
            )
            for name, signal in self.curves.signals.items()
        ]

    def resize(self) -> None:
        """Set the height to the number of panes."""
        self.chart.style(f"height: {max(190, 165 * len(self.chart.panes) + 30)}px")

    def select(self, name: Any, on: bool, pane: int | None = None) -> None:
        """Show or hide a signal."""
        if not isinstance(name, str) or name not in self.curves.signals:
            return
        if not on:
            self.chart.remove_curve(name)
        elif len(curve_names(self.chart)) < web.frames.MAX_CURVES:
            signal = self.curves.signals[name]
            faint = self.curves.previous(name)
            self.chart.add(name, signal.display_unit, name, pane=pane, step=signal.type in STEPPED, faint=faint)
        self.tree.show(curve_names(self.chart))
        self.resize()

    def drop(self, action: dict[str, Any]) -> None:
        """Handle a signal dragged into a pane."""
        index = action.get("pane")
        self.select(
            action.get("name"), True, index if isinstance(index, int) and 0 <= index < len(self.chart.panes) else None
        )

    def follow_time(self) -> None:
        """Follow the time again, or show the whole run."""
        if self.span.value == ALL_TIME:
            self.chart.show(None, None)
        else:
            self.chart.show_last(self.span.value)
        self.window({"follow": True})

    def window(self, action: dict[str, Any]) -> None:
        """Highlight the button while the time is not followed."""
        self.follow.props(remove="color") if action.get("follow") is True else self.follow.props("color=accent")

    def cursors(self, action: dict[str, Any]) -> None:
        """Show the time between the cursors and its frequency."""
        a, b = action.get("a"), action.get("b")
        self.cursor_label.text = ""
        if isinstance(a, int | float):
            self.cursor_label.text = f"t1: {a:.6g} s"
            if isinstance(b, int | float) and a != b:
                self.cursor_label.text = f"from t1 to t2: {b - a:.6g} s, {1 / abs(b - a):.6g} Hz"


def show_commands(console: Host, panel: ChartPanel) -> None:
    """Show executed commands in the chart, and the whole run at its end."""
    count, has_ended = [-1], [False]
    controls = {control.input: control for control in console.catalog.controls} if console.catalog is not None else {}

    def update() -> None:
        ended = console.live is not None and console.has_ended
        if ended and not has_ended[0]:
            panel.span.set_value(ALL_TIME)
        has_ended[0] = ended
        done = console.live.done if console.live is not None else ()
        if len(done) != count[0]:
            count[0] = len(done)
            acts = [command for command in condense(done, controls) if RELEASED not in command.text]
            panel.chart.show_marks([{"at": act.time, "text": mark_text(act.text)} for act in acts[-MARKS:]])

    ui.timer(0.25, update)


def mark_text(text: str) -> str:
    """Return a short label of a command: `wall.stiffness = 2` without the verb, the name of a control that was held."""
    short = text.removeprefix("set ").removesuffix(HELD)
    return short if len(short) <= MARK_WIDTH else f"{short[: MARK_WIDTH - 1]}\N{HORIZONTAL ELLIPSIS}"


def curve_names(chart: web.Chart) -> list[str]:
    """Return the names of the curves."""
    return [curve.name for pane in chart.panes for curve in pane.curves]
