"""Clocks as modelDescription.xml declares them, and when they tick: FMI 3.0.2, section 2.2.8.

Time-based clocks tick when they are due; what is due is an exact time, never a sum of floats.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.errors import CouplingError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.coupling import MemberVariable
    from twin.fmi.model_description import Declared

TRIGGERED = "triggered"
PERIODIC = ("constant", "fixed", "calculated", "tunable")  # `calculated` was in the drafts of FMI 3.0
APERIODIC = ("changing", "countdown")
SETTABLE = ("fixed", "tunable")  # by the importer, where the interval is declared
UNKNOWN, UNCHANGED, CHANGED = range(3)  # fmi3IntervalQualifier
ROUNDING = 8 * sys.float_info.epsilon  # relative


@dataclass(frozen=True, slots=True)
class Clock:
    """A clock. `interval` and `shift` are exact times [ns]; None: queried from the FMU. Small `priority` runs first."""

    name: str
    reference: int
    causality: str
    variability: str  # intervalVariability
    interval: clock.Time | None = None
    shift: clock.Time = 0
    priority: int = 0
    supports_fraction: bool = False

    @property
    def is_time_based(self) -> bool:
        """Whether the FMU or its description says when it ticks, and it is for the importer to let it tick."""
        return self.causality == "input" and self.variability != TRIGGERED

    @property
    def is_settable(self) -> bool:
        """Whether the interval is for the importer to set."""
        return self.is_time_based and self.variability in SETTABLE and self.interval is not None


@dataclass(slots=True)
class Clocks:
    """All clocks of an FMU in the order of their declaration, and the clocks of variables by value reference.

    `initial`: value references of the clocked variables that initialization computes.
    """

    every: tuple[Clock, ...] = ()
    of: dict[int, tuple[int, ...]] = field(default_factory=dict)
    initial: frozenset[int] = frozenset()


def read(root: Any, bare: Sequence[Declared]) -> Clocks:
    """Clocks from the variables' elements; ValueError with the line."""
    elements = [element for element in root.find("ModelVariables") if isinstance(element.tag, str)]
    declared_clocks = [declared(element) for element in elements if element.tag == "Clock"]
    if not declared_clocks:
        return Clocks()
    clock_references = {clock.reference for clock in declared_clocks}
    of = {}
    for own, element in zip(bare, elements, strict=True):
        references = tuple(int(word) for word in (element.get("clocks") or "").split())
        if wrong := [reference for reference in references if reference not in clock_references]:
            raise ValueError(f"line {element.sourceline}: {own.name!r}, clocks: there is no clock {wrong[0]}")
        if references and own.type != "Clock":
            of[own.reference] = references
    unknowns = (element.get("valueReference", "") for element in root.iterfind("ModelStructure/InitialUnknown"))
    return Clocks(tuple(declared_clocks), of, frozenset(int(unknown) for unknown in unknowns) & of.keys())


def shown(
    declared_variables: Mapping[str, MemberVariable], clocks: Clocks, capabilities: Mapping[str, bool]
) -> dict[str, MemberVariable]:
    """Variables with clocks as others see them: whether they tick; as nothing without Event Mode, which they need."""
    variables = dict(declared_variables)
    if capabilities["hasEventMode"]:
        for declaration in clocks.every:
            interval = declaration.variability if declaration.is_time_based else ""
            variables[declaration.name] = replace(
                declared_variables[declaration.name], dtype=np.dtype(np.bool_), interval=interval
            )
    return variables


def declared(element: Any) -> Clock:
    """A clock from its element."""
    try:
        return Clock(
            element.get("name"),
            int(element.get("valueReference")),
            element.get("causality", "local"),
            element.get("intervalVariability", TRIGGERED),
            time(element, "interval", None),
            time(element, "shift", 0) or 0,
            int(element.get("priority", "0")),
            element.get("supportsFraction") in ("true", "1"),
        )
    except (ValueError, CouplingError) as error:
        raise ValueError(f"line {element.sourceline}: clock {element.get('name')!r}: {error}") from None


def time(element: Any, word: str, default: clock.Time | None) -> clock.Time | None:
    """An interval or a shift [ns]: as an exact ratio if it is declared as a fraction."""
    counter, resolution, text = (
        element.get(attribute) for attribute in (f"{word}Counter", "resolution", f"{word}Decimal")
    )
    if counter is not None and resolution is not None:
        return clock.to_time(Fraction(int(counter), int(resolution)) * clock.NANOSECONDS)
    return default if text is None else clock.nanoseconds(text, f"{word}Decimal")


def computed(seconds: float, what: str, now: clock.Time = 0) -> clock.Time:
    """Convert a time [s] computed by an FMU, perhaps as a difference from now; to whole nanoseconds if within rounding."""
    near = round(seconds * clock.NANOSECONDS)
    largest = max(abs(seconds) * clock.NANOSECONDS, abs(float(now)))
    return near if abs(near - seconds * clock.NANOSECONDS) <= ROUNDING * largest else clock.nanoseconds(seconds, what)


@dataclass(slots=True)
class Timer:
    """Next tick of a time-based clock [ns]; None while it is unknown."""

    own: Clock
    interval: clock.Time | None = None
    due: clock.Time | None = None

    def begin(self, start: clock.Time, given_interval: clock.Time | None) -> None:
        """Start in Initialization Mode. `given_interval`: the interval that the FMU returned, None if it returned none."""
        self.interval = self.own.interval if given_interval is None else given_interval
        if self.interval is not None:
            self.due = start + (self.own.shift if self.own.variability in PERIODIC else self.interval)

    def ticked(self, now: clock.Time) -> None:
        """Schedule the next tick after a tick now."""
        self.due = now + self.interval if self.own.variability in PERIODIC and self.interval else None

    def update(self, now: clock.Time, interval: clock.Time | None, qualifier: int) -> None:
        """Apply the interval and qualifier that the FMU returned at the end of an event."""
        if qualifier == CHANGED and interval is not None:
            self.interval, self.due = interval, now + interval
        elif qualifier == UNKNOWN:
            self.due = None
        elif self.own.variability == "changing" and self.due is None and self.interval is not None:
            self.due = now + self.interval  # as long as the last one

    @property
    def needs_interval_query(self) -> bool:
        """Whether the interval is to be queried from the FMU after events."""
        return self.own.variability in APERIODIC or (self.own.variability == "tunable" and self.own.interval is None)
