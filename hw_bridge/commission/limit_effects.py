"""Effect of each limit of a hardware file: on targets, in the drive, or as a monitor that ends the run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hw_bridge.dictionary import Mode
from hw_bridge.hardware import stall_bounds

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from hw_bridge.hardware import HardwareKeys, NodeKeys

WATCHED = "each cycle, else it stops"


def rows(keys: HardwareKeys, node: NodeKeys, absent: Collection[int] = ()) -> list[tuple[str, str]]:
    """Name of a limit and its effect, for one drive. `absent`: objects that it does not have."""
    chosen = node.drive
    has = {entry.index for entry in chosen.objects}.difference(absent)
    position, velocity = ("csp", "csv") if Mode.CSP in chosen.modes else ("pp", "pv, instead of csp and csv")

    def own(*indices: int) -> str:
        present = [f"{index:04X}h" for index in indices if index in has]
        return f"; the drive's {', '.join(present)}" if present else ""

    cst = Mode.CST in chosen.modes
    force = f"{'targets of cst, to 80 %; ' if cst else ''}{WATCHED}; while it homes too"
    oldest = node.limits.actual_value_age or stall_bounds.value_age(keys)
    missed, lateness = stall_bounds.missed_cycles(keys), stall_bounds.tolerated_lateness(keys)
    own_lateness = f"a late cycle of this program is not counted, and may last {lateness / 1e6:.4g} ms (late_cycle)"
    return [
        ("position", f"{WATCHED}{own(0x607D)}, a tenth of the range beyond"),
        ("velocity", f"targets of {velocity}, to 80 %; {WATCHED}{own(0x607F, 0x6080)}"),
        (
            "force",
            force if node.watch_force else "nowhere in this program: watch_force is false, the drive tells no current",
        ),
        ("following_error", f"{WATCHED}{own(0x6065)}"),
        (
            "acceleration",
            f"targets of {position} and {velocity.partition(',')[0]}"
            + ("; in cst the measured one over 4 cycles, else it stops" if cst else "")
            + f"{own(0x6083, 0x6084, 0x6085)}: profile modes and quick stop. From limits.velocity it takes "
            + f"{1e3 * node.limits.velocity / node.limits.acceleration:.3g} ms to stop",
        ),
        (
            "actual_value_age",
            f"{oldest / 1e6:.4g} ms at SYNC: {WATCHED}; missing values end a run after {missed} cycles; {own_lateness}",
        ),
    ]


def grouped(keys: HardwareKeys, absent: Mapping[str, Collection[int]]) -> list[tuple[list[str], list[tuple[str, str]]]]:
    """Rows shared by drives with equal effects, with their names. `absent`: by drive, as for `rows`."""
    groups: list[tuple[list[str], list[tuple[str, str]]]] = []
    for name, node in keys.nodes.items():
        own = rows(keys, node, absent.get(name, ()))
        names = next((names for names, other in groups if other == own), None)
        if names is None:
            groups.append(([name], own))
        else:
            names.append(name)
    return groups
