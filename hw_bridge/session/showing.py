"""What members show: what their drives tell, by what members call it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from hw_bridge.dictionary import cia402

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from hw_bridge.master import Node
    from hw_bridge.plant import Bench
    from twin.component import Component

AGE = "actual_value_age"
TOLD: dict[str, Callable[[Node], float]] = {  # what a drive tells of itself
    "position_actual_value": lambda node: node.position,
    "position":              lambda node: node.position,
    "angle":                 lambda node: node.position,
    "motor_angle":           lambda node: node.position / node.keys.scale,
    "velocity_actual_value": lambda node: node.velocity,
    "velocity":              lambda node: node.velocity,
    "angular_velocity":      lambda node: node.velocity,
    "current":               lambda node: node.current,
    "force":                 lambda node: node.force,
    "torque":                lambda node: node.force * node.keys.scale,
    "limited":               lambda node: bool(node.word & cia402.INTERNAL_LIMIT),
    AGE:                     lambda node: node.age / 1e9,
}  # fmt: skip


def shown(
    nodes: Mapping[str, Node], axes: Mapping[str, Component], bench: Bench
) -> list[tuple[Any, Callable[[], float]]]:
    """Outputs of all members, and what stands in them."""
    found: list[tuple[Any, Callable[[], float]]] = []
    for name, node in nodes.items():
        values: dict[str, Callable[[], float]] = {key: partial(value, node) for key, value in TOLD.items()}
        values |= bench.shown(name)
        views = axes[name].views
        found += [(views[key], value) for key, value in values.items() if key in views]
    return found
