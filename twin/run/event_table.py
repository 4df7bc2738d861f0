"""Events of a run, for the report, plots and the viewer: those at a time, and the occurrences of conditions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from twin import clock
from twin.results import EventLine

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from twin.scenario import Case


@dataclass(frozen=True)
class EventRow:
    """Event in the report. `variants`: where, if not in all; `only`: these as names."""

    time_ns: clock.Time
    what: str
    variants: str = ""
    only: tuple[str, ...] = ()

    @property
    def annotation(self) -> EventLine:
        """Annotation of the event in plots."""
        return EventLine(clock.seconds(self.time_ns), self.what, self.only)

    @property
    def time(self) -> str:
        """Time as text: `1.5 s`."""
        return clock.text(self.time_ns)


def event_rows(cases: Sequence[Case], occurrences: Iterable[Mapping[str, Any]] = ()) -> list[EventRow]:
    """List the events of all variants in order of time, equal ones once.

    `occurrences`: of conditions, from the summary of a run; those of each variant's first seed are listed.
    """
    variants_of: dict[tuple[clock.Time, str], list[str]] = {}
    first_seeds: dict[str, int] = {}
    for item in occurrences:
        if first_seeds.setdefault(item["variant"], item["seed"]) == item["seed"]:
            variants_of.setdefault((clock.nanoseconds(item["time"]), item["event"]), []).append(item["variant"])
    for case in cases:
        occurrences = [(event.time_ns, event.text) for event in case.events]
        for key in (*occurrences, *((fault.time_ns, f"fault {fault.text}") for fault in case.faults)):
            names = variants_of.setdefault(key, [])
            if case.variant not in names:
                names.append(case.variant)
    count = len({case.variant for case in cases})
    rows = sorted(variants_of.items(), key=lambda item: item[0][0])
    distinct = ((time, what, () if len(names) == count else tuple(names)) for (time, what), names in rows)
    return [EventRow(time, what, ", ".join(names), names) for time, what, names in distinct]
