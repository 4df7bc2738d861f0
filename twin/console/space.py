"""Picture in three dimensions: a scene of the scenario, drawn by the three.js of the web library."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nicegui.element import Element
from nicegui.elements import scene as library

from twin.scene import Space, SpaceView

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.live import Catalog
    from twin.results import Expression


def members(formula: Expression) -> set[str]:
    """Return the names of the members whose signals a formula reads."""
    return {signal.name.partition(".")[0] for signal in formula.signals}


def space_view(catalog: Catalog, number: int) -> SpaceView:
    """Return a scene in three dimensions of a session: an arc in place of a line that a recording lacks is left out."""
    data = catalog.spaces[number]
    space = Space.of(data["space"])
    shaped = {member for line in space.lines if line.signal for member in members(line.signal)}
    lines = [line for line in space.lines if not (line.root and shaped.intersection(*map(members, line.tip)))]
    space = replace(space, lines=tuple(lines))
    units = {name: catalog.signals[name].unit for name in space.names}
    return SpaceView(space, list(zip(*data["curvature"], strict=True)), data["diameter"], units)


class SpacePicture(
    Element, component="static/space.js", esm={"nicegui-scene": str(Path(library.__file__).parent / "dist")}
):
    """A scene in three dimensions on a page, which turns and zooms; it emits `unavailable` where the browser has no WebGL.

    It is no `ui.scene`, which draws for ever after it is removed, and never releases the geometry of deleted objects.
    """

    def __init__(self, catalog: Catalog, number: int) -> None:
        super().__init__()
        data = catalog.spaces[number]
        fixed = space_view(catalog, number).fixed
        tolerance = 1e3 * catalog.targets["tolerance"] if catalog.targets else 0.0
        self._props.update(
            number=number,
            scene={**fixed, "title": data["title"], "axes": data["axes"], "tolerance": tolerance},
            reached=[],
        )

    def show_reached(self, names: list[str]) -> None:
        """Mark targets as reached."""
        if names != self._props["reached"]:
            self._props["reached"] = names
            self.update()


def titles(spaces: tuple[Mapping[str, Any], ...]) -> dict[int, str]:
    """Return the labels of the scenes in three dimensions by number: 3-D, with the title where there are several."""
    return {number: f"3-D: {space['title']}" if len(spaces) > 1 else "3-D" for number, space in enumerate(spaces)}
