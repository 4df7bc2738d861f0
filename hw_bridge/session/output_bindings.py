"""Outputs of members, bound to actual values of their drives."""

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
DRIVE_OUTPUTS: dict[str, Callable[[Node], float]] = {  # actual values by names of outputs
    "position_actual_value": lambda node: node.position,
    "position": lambda node: node.position,
    "angle": lambda node: node.position,
    "motor_angle": lambda node: node.position / node.keys.scale,
    "velocity_actual_value": lambda node: node.velocity,
    "velocity": lambda node: node.velocity,
    "angular_velocity": lambda node: node.velocity,
    "current": lambda node: node.current,
    "force": lambda node: node.force,
    "torque": lambda node: node.force * node.keys.scale,
    "limited": lambda node: bool(node.word & cia402.INTERNAL_LIMIT),
    AGE: lambda node: node.age / 1e9,
}


def bind_outputs(
    nodes: Mapping[str, Node], axes: Mapping[str, Component], bench: Bench
) -> list[tuple[Any, Callable[[], float]]]:
    """Pairs of an output's view and the function that provides its value, for all members."""
    bindings: list[tuple[Any, Callable[[], float]]] = []
    for name, node in nodes.items():
        values: dict[str, Callable[[], float]] = {key: partial(value, node) for key, value in DRIVE_OUTPUTS.items()}
        values |= bench.shown(name)
        views = axes[name].views
        bindings += [(views[key], value) for key, value in values.items() if key in views]
    return bindings
