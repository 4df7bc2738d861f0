"""Connector to a tracked tip."""

from __future__ import annotations

from twin.component import Component, Int32, input, local, terminal


class TrackedTip(Component):
    """An estimator that reads a tracked tip."""

    tip_position = input("m", "tracked tip in the universal frame", shape=(3,), display_unit="mm", nominal=5e-3)
    tip_status = input("", "0 valid, 1 degraded, 2 lost", type=Int32, minimum=0, maximum=2)
    tip_age = input(
        "s",
        "time since the tip was where it is said to be, when that was published",
        minimum=0.0,
        display_unit="ms",
        nominal=1e-2,
    )

    tip = terminal("the tracked tip", rule="bus", position=tip_position, status=tip_status, age=tip_age)

    last_position = local(0.0, "m", "tip of the tick before", shape=(3,))


def changed(self: TrackedTip) -> bool:
    """Return whether the position has changed: a sample that is held, or read twice, counts once."""
    new = False
    for i in range(3):
        new = new or self.tip_position[i] != self.last_position[i]
        self.last_position[i] = self.tip_position[i]
    return new
