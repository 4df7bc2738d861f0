"""Events of a run, for the report, plots and the viewer: those at a time, and the occurrences of conditions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.errors import quote_names
from twin.results import EventLine

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.scenario import Case


@dataclass(frozen=True)
class EventRow:
    """Event in the report. `variants`: where, if not in all; `only`: these as names. `label`: in plots, if not `what`."""

    time_ns: clock.Time
    what: str
    variants: str = ""
    only: tuple[str, ...] = ()
    label: str = ""

    @property
    def annotation(self) -> EventLine:
        """Annotation of the event in plots."""
        return EventLine(clock.seconds(self.time_ns), self.label or self.what, self.only)

    @property
    def time(self) -> str:
        """Time as text: `1.5 s`."""
        return clock.text(self.time_ns)


def event_rows(cases: Sequence[Case], occurrences: Iterable[Mapping[str, Any]] = ()) -> list[EventRow]:
    """List the events of all variants in order of time, equal ones once.

    `occurrences`: of conditions, from the summary of a run; those of each variant's first seed are listed.
    """
    variants_of: dict[tuple[clock.Time, str, str], list[str]] = {}
    first_seeds: dict[str, int] = {}
    for item in occurrences:
        if first_seeds.setdefault(item["variant"], item["seed"]) == item["seed"]:
            key = (clock.nanoseconds(item["time"]), item["event"], item["label"])
            variants_of.setdefault(key, []).append(item["variant"])
    for case in cases:
        events = [(event.time_ns, event.text) for event in case.events]
        faults = [(fault.time_ns, f"fault {fault.text}") for fault in case.faults]
        for time, what in (*events, *faults):
            variants_of.setdefault((time, what, ""), []).append(case.variant)
    count = len({case.variant for case in cases})
    rows = []
    for (time, what, label), variants in sorted(variants_of.items(), key=lambda entry: entry[0][0]):
        names = tuple(dict.fromkeys(variants))
        names = () if len(names) == count else names
        rows.append(EventRow(time, what, ", ".join(quote_names(names)), names, label))
    return rows
