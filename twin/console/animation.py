"""Animation of a session: the pictures of `twin.web`, moved by the values of each tick, and scenes in three dimensions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from nicegui import ui
from nicegui.element import Element

from twin.console.space import SpacePicture, titles
from twin.results import si_conversion

if TYPE_CHECKING:
    from twin.console.page import PageContext
    from twin.live import Catalog, CatalogControl

FLAT = -1  # number of the picture in two dimensions
NO_WEBGL = "3-D is not available: this browser has no WebGL."


def to_si(catalog: Catalog) -> Catalog:
    """Return a catalog whose start values, targets and warnings are in SI, like the values that move pictures."""

    def scale(signal: str) -> tuple[float, float]:
        return si_conversion(catalog.signals[signal.partition("[")[0]].unit)

    scales = {name: scale(name) for name in catalog.signals}
    signals = {
        name: signal
        if signal.start is None or scales[name] == (1.0, 0.0)
        else replace(signal, start=convert(signal.start, scales[name]))
        for name, signal in catalog.signals.items()
    }
    warnings = tuple(
        {**each, **{key: convert(each[key], scale(each["signal"])) for key in ("above", "below") if key in each}}
        for each in catalog.warnings
    )
    targets = dict(catalog.targets)
    if targets:
        factor, offset = scale(targets["signal"])
        points = {name: convert(point, (factor, offset)) for name, point in targets["points"].items()}
        targets |= {"points": points, "tolerance": factor * targets["tolerance"]}
    return replace(catalog, signals=signals, targets=targets, warnings=warnings)


def convert(value: Any, scale: tuple[float, float]) -> Any:
    """Return a plain value or array as `factor * value + offset` by its `scale`, (factor, offset)."""
    return (scale[0] * np.asarray(value) + scale[1]).tolist()


class Picture(Element, component="static/picture.js"):
    """The animation on a page, with warnings of the scenario and targets of the operator.

    A warning says which of the `controls` with keys to move, and which way.
    """

    def __init__(
        self,
        views: list[dict[str, Any]],
        warnings: Sequence[Mapping[str, Any]] = (),
        controls: Sequence[CatalogControl] = (),
    ) -> None:
        super().__init__()
        keys = [
            {"input": each.input, "label": each.label, "keys": each.keys} for each in controls if len(each.keys) == 2
        ]
        self._props.update(views=views, warnings=list(warnings), controls=keys, reached=[])

    def show_reached(self, names: list[str]) -> None:
        """Mark targets as reached."""
        if names != self._props["reached"]:
            self._props["reached"] = names
            self.update()


class Pictures:
    """The picture of a session, and the selection of one in three dimensions, of which only the shown one exists.

    `catalog`: in SI, see `to_si`.
    """

    def __init__(self, context: PageContext, catalog: Catalog, views: list[dict[str, Any]]) -> None:
        self.context, self.catalog = context, catalog
        self.reached: list[str] = []
        self.space: SpacePicture | None = None
        options = ({FLAT: "2-D"} if views else {}) | titles(catalog.spaces)
        number = context.shown_space if context.shown_space in options else next(iter(options))
        with ui.row().classes("items-center full-width no-wrap gap-2") as self.head:
            self.toggle = ui.toggle(options, value=number, on_change=lambda chosen: self.show(chosen.value))
            self.toggle.props('dense no-caps unelevated aria-label="dimensions of the picture"')
            self.toggle.classes("twin-dimensions")
            self.toggle.visible = len(options) > 1
            self.note = ui.label(NO_WEBGL).classes("twin-soft").props("role=status")
            self.note.visible = False
        self.picture = Picture(views, catalog.warnings, catalog.controls)  # warns in three dimensions too
        self.container = ui.element("div").classes("full-width")
        self.show(number)

    def show(self, number: int) -> None:
        """Show a picture by its number."""
        self.context.shown_space = number
        self.container.clear()
        self.space = None
        self.picture.classes(add="twin-flat" if number != FLAT else "", remove="twin-flat" if number == FLAT else "")
        if number != FLAT:
            with self.container:
                self.space = SpacePicture(self.catalog, number)
            self.space.on("unavailable", self._show_flat)
            self.space.show_reached(self.reached)

    def _show_flat(self) -> None:
        self.note.visible = True
        self.toggle.disable()
        self.toggle.value = FLAT

    def show_reached(self, names: list[str]) -> None:
        """Mark targets as reached."""
        self.reached = names
        self.picture.show_reached(names)
        if self.space is not None:
            self.space.show_reached(names)
