"""A drive of a hardware file: its name, and whether its member is rotary or linear."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hw_bridge.hardware import format_quantity, plausible, resolve_bench, without_unit
from twin.errors import CouplingError, SimulationError, nearest
from twin.scenario import number, read

if TYPE_CHECKING:
    from pathlib import Path

    from hw_bridge.hardware import HardwareKeys, NodeKeys

EXAMPLES = {
    "m": "1 mm",
    "m/s": "5 mm/s",
    "m/s^2": "0.5 m/s^2",
    "rad": "5 deg",
    "rad/s": "20 deg/s",
    "rad/s^2": "100 deg/s^2",
}


@dataclass(frozen=True)
class Axis:
    """One drive of a file. `rotary`: whether the member turns, by the units of its limits in the file."""

    name: str
    keys: NodeKeys
    rotary: bool

    @property
    def unit(self) -> str:
        """Unit of its positions."""
        return "rad" if self.rotary else "m"

    def format_quantity(self, value: float, suffix: str = "") -> str:
        """Format a position, or with `/s` a speed."""
        return format_quantity(value, f"{self.unit}{suffix}")

    def si(self, text: str, what: str, suffix: str = "") -> float:
        """Parse a quantity to SI; SimulationError without a unit or with that of the other kind of axis."""
        return parse_quantity(text, f"{self.unit}{suffix}", what)


def parse_quantity(text: str, unit: str, what: str) -> float:
    """Parse a quantity to SI in this unit; SimulationError without a unit or with another one."""
    if without_unit(text):
        raise SimulationError(f"{what}: {text} has no unit. Write it with one, such as {EXAMPLES[unit]!r}.")
    try:
        return number(text, unit, what)
    except CouplingError as error:
        raise SimulationError(str(error)) from None


def axis(path: Path, keys: HardwareKeys, word: str) -> Axis:
    """Select a drive by its name or node-ID."""
    name = next((name for name, node in keys.nodes.items() if word == str(node.node)), word)
    if name not in keys.nodes:
        raise SimulationError(f"{path}: no drive {word!r}. {nearest(word, list(keys.nodes))}")
    root = read(resolve_bench(path), str(path))
    turns, moves = (not plausible.units(root, name, rotary) for rotary in (True, False))
    own = keys.nodes[name]
    rotary = turns and (not moves or own.drive.motor.unit == "rad")
    if problem := plausible.gearing(own, rotary):
        raise SimulationError(f"{path}: nodes.{name}: {problem}")
    return Axis(name, own, rotary)
