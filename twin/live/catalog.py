"""Catalog of a session: signals, controls, events and plots, built in the loop's process and sent as plain data."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


@dataclass(frozen=True)
class CatalogSignal:
    """A variable with its conversion to the display unit: shown = factor * value + offset. Arrays are one signal.

    `settable`: the operator may set it; `held`: it moves only while the operator holds a control.
    """

    name: str  # member.variable
    member: str
    kind: str  # output, input, parameter or local
    type: str  # FMI's
    shape: tuple[int, ...] = ()
    unit: str = ""
    display_unit: str = ""
    factor: float = 1.0
    offset: float = 0.0
    description: str = ""
    minimum: float | None = None
    maximum: float | None = None
    start: Any = None
    items: Mapping[str, int] = field(default_factory=dict)  # of an enumeration
    recorded: bool = False
    settable: bool = False
    held: bool = False


@dataclass(frozen=True)
class CatalogControl:
    """A control that moves an input: `low` and `high` at full deflection, `rest` when released, in the input's unit.

    `kind`: hold, or press for Booleans. `stick`: x, y, x2 or y2 of the joysticks on the screen, or nothing. `keys`, `buttons`:
    towards the upper end, then towards the lower one. `axis`, `reverse`, `buttons`: of a gamepad. `along`: inputs that are set
    while it is held.
    """

    name: str
    input: str
    label: str
    description: str
    low: float
    high: float
    rest: float
    dead_zone: float  # part of the deflection
    unit: str
    display_unit: str
    factor: float
    offset: float
    kind: str
    stick: str = ""
    keys: tuple[str, ...] = ()
    axis: int | None = None
    reverse: bool = False
    buttons: tuple[int, ...] = ()
    along: tuple[str, ...] = ()

    def value(self, deflection: float) -> float | bool:
        """Return the value of the input at a deflection from -1 to 1."""
        if self.kind == "press":
            return deflection > 0.5
        travel = max(abs(min(max(deflection, -1.0), 1.0)) - self.dead_zone, 0.0) / (1.0 - self.dead_zone)
        return self.rest + travel * ((self.high if deflection > 0.0 else self.low) - self.rest)


@dataclass(frozen=True)
class CatalogEvent:
    """An event of the scenario. `own`: of this variant, and happens by itself at `at` [s]; the others are of other variants."""

    key: str
    kind: str
    text: str
    description: str = ""
    at: float | None = None
    own: bool = True


@dataclass(frozen=True)
class Catalog:
    """Everything a page can show or do. `every`: time between recorded rows [s]; `wall_clock`: real drives determine the time."""

    scenario: str
    title: str
    description: str
    path: str
    variant: str
    seed: int
    step: float
    common_step: float  # between communication points common to all members [s]
    start: float
    every: float
    hardware: bool
    wall_clock: bool
    members: Mapping[str, str]  # name -> its component's class, or an FMU's file
    signals: Mapping[str, CatalogSignal]
    controls: tuple[CatalogControl, ...]
    events: tuple[CatalogEvent, ...]
    plots: tuple[tuple[str, str, tuple[str, ...]], ...]  # title, unit, signals
    bands: Mapping[str, tuple[float, float]]  # of plots
    variants: Mapping[str, str] = field(default_factory=dict)  # all of the scenario: name -> title
    stop: float = 0.0  # end of the scenario [s]; the session may go on
    parameters: Mapping[str, tuple[float, float] | None] = field(default_factory=dict)  # listed first -> slider ends
    targets: Mapping[str, Any] = field(default_factory=dict)  # of an operator: signal, tolerance, points by name
    warnings: tuple[Mapping[str, Any], ...] = ()  # signal, above, text
    scenes: tuple[Mapping[str, Any], ...] = ()  # title; walls [mm]; motions, lines, points, arrows by names of signals
    spaces: tuple[Mapping[str, Any], ...] = ()  # title, axes; specification of a `Space` and parameters of its path
    lines: Mapping[str, Sequence[float]] = field(default_factory=dict)  # of plots
    labels: Mapping[str, str] = field(default_factory=dict)  # of the signals of plots

    @property
    def judged_until(self) -> float:
        """End of the judged time [s]: that of the scenario; infinite where an operator has controls and may continue."""
        return math.inf if self.controls else self.stop

    @property
    def fastest_rate(self) -> float:
        """Largest ratio of simulated to wall-clock time: real time where an operator has controls, whose dead-man times are the wall clock's."""
        return 1.0 if self.controls or self.wall_clock else math.inf

    def plain(self) -> dict[str, Any]:
        """Return the catalog as plain data for JSON."""
        return {attribute.name: getattr(self, attribute.name) for attribute in fields(self)} | {
            "signals": [asdict(signal) for signal in self.signals.values()],
            "controls": [asdict(control) for control in self.controls],
            "events": [asdict(event) for event in self.events],
        }

    @classmethod
    def of(cls, data: dict[str, Any]) -> Catalog:
        """Create a catalog from plain data."""
        signals = [CatalogSignal(**{**signal, "shape": tuple(signal["shape"])}) for signal in data["signals"]]
        controls = [
            CatalogControl(**{**control, **{key: tuple(control[key]) for key in ("keys", "buttons", "along")}})
            for control in data["controls"]
        ]
        return cls(
            **{
                **data,
                "signals": {signal.name: signal for signal in signals},
                "controls": tuple(controls),
                "events": tuple(CatalogEvent(**event) for event in data["events"]),
                "warnings": tuple(data["warnings"]),
                "scenes": tuple(data["scenes"]),
                "spaces": tuple(data["spaces"]),
                "plots": tuple((title, unit, tuple(names)) for title, unit, names in data["plots"]),
                "bands": {title: (low, high) for title, (low, high) in data["bands"].items()},
                "parameters": {name: ends and (ends[0], ends[1]) for name, ends in data["parameters"].items()},
            }
        )
