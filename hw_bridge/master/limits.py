"""Limits stored in the drive itself: a run widens none of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hw_bridge.hardware import LimitKeys
    from hw_bridge.master.node import Node

Address = tuple[int, int]
FOLLOWING_ERROR = 0x6065
SPEED_LIMITS = (0x607F, 0x6080)
ACCELERATION_LIMITS = (0x60C5, 0x60C6)
POSITION_LIMITS = ((0x607D, 1), (0x607D, 2))
# other objects that bound what a drive does, and what of the units they count in
LIMITS: dict[Address, str] = {
    (0x607F, 0): "velocity",
    (0x6080, 0): "velocity",
    (0x6065, 0): "position",
    (0x60C5, 0): "acceleration",
    (0x60C6, 0): "acceleration",
    (0x6072, 0): "",
    (0x60E0, 0): "",
    (0x60E1, 0): "",
    (0x2333, 1): "",
    (0x2333, 2): "",
    (0x3001, 1): "",
    (0x3001, 2): "",
    (0x6410, 1): "",
    (0x6410, 2): "",
}

ROUNDING = 10  # device units by which a drive may stand outside of a limit
HOMING_FORCE_SHARE = 0.8  # of limits.force that the drive's own limit is lowered to while it homes: it overshoots
HOMING_FORCE_REASON = "limits.force while it homes; as before when it is homed"


@dataclass(frozen=True, slots=True)
class LoweredLimit:
    """A force-limiting object, its value during homing, and its previous value."""

    index: int
    sub: int
    value: int
    before: int


@dataclass
class OwnLimits:
    """Limits that a drive held before a run. `file`: limits of the hardware file.

    `values`: of `LIMITS`, in SI at the motor; `positions`: 607Dh in device units, None: no limit. `assumed`: a line for each
    scale that the drive does not provide.
    """

    file: LimitKeys
    values: dict[Address, float] = field(default_factory=dict)
    positions: tuple[int, int] | None = None
    assumed: list[str] = field(default_factory=list)

    def smallest(self, *addresses: Address) -> list[float]:
        """Those of these limits that the drive has [SI at the motor]."""
        return [self.values[address] for address in addresses if address in self.values]


def narrow(node: Node) -> None:
    """Apply the narrower of the hardware file's limits and the drive's own, except positions."""
    own, scale = node.own, node.keys.scale
    limits = own.file

    def narrower(value: float, *indices: int) -> float:
        return min([value, *(scale * limit for limit in own.smallest(*((index, 0) for index in indices)))])

    update = {
        "velocity": narrower(limits.velocity, *SPEED_LIMITS),
        "acceleration": narrower(limits.acceleration, *ACCELERATION_LIMITS),
        "following_error": narrower(limits.following_error, FOLLOWING_ERROR),
    }
    node.keys = node.keys.model_copy(update={"limits": limits.model_copy(update=update)})


def software_limits(node: Node) -> tuple[int, int]:
    """607Dh once the position reference is known: a tenth of its range beyond the hardware file's, within the drive's own.

    Never beyond the drive's position after homing: it would jump there as soon as it is enabled. The limits that
    are monitored in each cycle are narrowed too. SimulationError where both have no position in common.
    """
    low, high = node.own.file.position
    margin = 0.1 * (high - low)
    ends = sorted(
        node.device_position(end) for end in (min(low, node.position) - margin, max(high, node.position) + margin)
    )
    if node.own.positions is None:
        return ends[0], ends[1]
    own = node.own.positions
    ends = [max(ends[0], own[0]), min(ends[1], own[1])]
    inside = sorted(node.sign * value * node.units.position - node.origin for value in own)
    narrowed = [max(low, inside[0]), min(high, inside[1])]
    if narrowed[0] >= narrowed[1] or ends[0] >= ends[1]:
        raise SimulationError(
            f"{node.name}: limits.position {node.format_length(low)} to {node.format_length(high)} and the drive's own 607Dh, "
            f"{node.format_length(inside[0])} to {node.format_length(inside[1])}, have no position in common. Correct "
            "one of them."
        )
    tolerance = ROUNDING * abs(node.sign) * node.units.position
    if not inside[0] - tolerance <= node.position <= inside[1] + tolerance:
        raise SimulationError(
            f"{node.name}: stands at {node.format_length(node.position)}, outside of the drive's own 607Dh, "
            f"{node.format_length(inside[0])} to {node.format_length(inside[1])}: it would go there as soon as it is enabled. "
            "Move it there by hand, or correct 607Dh."
        )
    limits = node.keys.limits.model_copy(update={"position": narrowed})
    node.keys = node.keys.model_copy(update={"limits": limits})
    return ends[0], ends[1]


def lowered_for_homing(node: Node, read: Callable[[int, int], int | None]) -> Iterator[LoweredLimit]:
    """Yield the drive's own force limits that exceed what the hardware file allows for homing.

    `read` returns the value of an object, None where the drive does not have it; its force is monitored in any case.
    """
    most = HOMING_FORCE_SHARE * node.keys.limits.force / node.force_constant  # [A]
    for index, sub, unit in node.profile.homing_force:
        if not node.mirror.find(index, sub):
            continue
        before, value = read(index, sub), int(most / (unit or node.units.torque))
        if before is not None and value < before:
            yield LoweredLimit(index, sub, value, before)
