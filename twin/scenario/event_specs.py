"""Events of a scenario: at a time, with a condition, and faults of the hardware."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from twin import clock
    from twin.scenario.keys.conditions import ConditionExpression
    from twin.scenario.yaml_files.yaml_node import Node


@dataclass(frozen=True)
class EventSpec:
    """An event on one variable. `kind`: set, override or release (`value` is None)."""

    time_ns: clock.Time
    kind: str
    variable: str
    value: Any = None
    where: str = field(default="", compare=False)

    @property
    def text(self) -> str:
        """Text for messages and plots: `set controller.setpoint = 0.25 N`."""
        return f"{self.kind} {self.variable}" + ("" if self.kind == "release" else f" = {self.value}")


@dataclass(frozen=True)
class ConditionSpec:
    """An event that happens when a condition is met. `actions`: with a time of 0; `tree`: all its keys as written.

    `hold_ns`: time for which the condition must be true without interruption; `after_ns`: time before which it is not
    evaluated. `repeats`: it acts again after the condition was false. `stops`: it ends the run.
    """

    condition: ConditionExpression
    actions: tuple[EventSpec, ...]
    tree: Node = field(repr=False, compare=False)
    hold_ns: clock.Time = 0
    after_ns: clock.Time | None = None
    repeats: bool = False
    stops: bool = False
    description: str = ""

    @property
    def where(self) -> str:
        """file:line."""
        return str(self.tree.find(("when",)).location)

    @property
    def sources(self) -> set[str]:
        """Members whose outputs it reads."""
        signals = (signal for item in self.condition.comparisons for signal in item.expression.signals)
        return {signal.name.partition(".")[0] for signal in signals}

    @property
    def targets(self) -> set[str]:
        """Members that it changes."""
        return {action.variable.partition(".")[0] for action in self.actions}

    @property
    def text(self) -> str:
        """What happens, for messages and plots: `set controller.setpoint = 0.25 N, stop (when sensor.force > 0.3 N)`."""
        parts = [action.text for action in self.actions] + ["stop"] * self.stops
        return f"{', '.join(parts) or self.description or 'nothing changes'} (when {self.condition.text})"


@dataclass(frozen=True)
class FaultSpec:
    """A hardware fault at a time. `tree`: all its keys as written, which the hardware interprets."""

    time_ns: clock.Time
    tree: Node = field(repr=False)

    @property
    def where(self) -> str:
        """file:line."""
        return str(self.tree.location)

    @property
    def text(self) -> str:
        """Text for messages: `heartbeat, node servomotor, duration 500 ms`."""
        keys = self.tree.plain()
        return ", ".join(
            [str(keys["fault"]), *(f"{key} {value}" for key, value in keys.items() if key not in ("at", "fault"))]
        )
