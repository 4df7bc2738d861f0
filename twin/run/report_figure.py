"""Figure of a report."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.results import EventLine


@dataclass(frozen=True)
class ReportFigure:
    """Figure of a report: SVG for paper; charts of panes in its place on a screen, with events as marks.

    `events`: by the numbers of their marks.
    `command`: shows all samples; `query`: of the viewer's address, too. `violations`: names of those it shows. `is_scene`: replaced by a film.
    `computed`: chart of the values that an analysis computes of its curves.
    """

    title: str
    svg: str
    note: str = ""
    panels: Sequence[Any] = ()
    marks: Sequence[Any] = ()
    events: Mapping[int, EventLine] = field(default_factory=dict)
    command: str = ""
    query: str = ""
    violations: tuple[str, ...] = ()
    is_scene: bool = False
    computed: ReportFigure | None = None
