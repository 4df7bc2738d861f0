"""Animation of a session: the pictures of `twin.web`, moved by the values of each tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from nicegui.element import Element


class Picture(Element, component="static/picture.js"):
    """The animation on a page, with warnings of the scenario and targets of the operator."""

    def __init__(self, views: list[dict[str, Any]], warnings: Sequence[Mapping[str, Any]] = ()) -> None:
        super().__init__()
        self._props.update(views=views, warnings=list(warnings), reached=[])

    def show_reached(self, names: list[str]) -> None:
        """Mark targets as reached."""
        if names != self._props["reached"]:
            self._props["reached"] = names
            self.update()
