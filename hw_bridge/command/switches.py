"""Parse switches of a simulated drive: `twin drive --switch NAME=PLACE`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from hw_bridge.commission import parse_quantity
from hw_bridge.device import Switches
from twin.errors import SimulationError, nearest

if TYPE_CHECKING:
    from collections.abc import Sequence

LIMITS = ("negative", "positive")
RANGES = ("home", "probe1", "probe2")
EXAMPLE = {"m": "positive=35mm or home=4mm:6mm", "rad": "positive='30 rad' or home=90deg:180deg"}


def parse_switches(words: Sequence[str], unit: str) -> Switches:
    """Parse the switches, in the motor's own coordinate [`unit`: m or rad], whose zero is its start position.

    click.UsageError names the wrong word, and the expected form.
    """
    positions: dict[str, tuple[float, ...]] = {}
    for word in words:
        name, _, text = word.partition("=")
        expected = f"--switch {word}: expected NAME=PLACE, such as {EXAMPLE[unit]}"
        if name not in LIMITS + RANGES:
            raise click.UsageError(f"{expected}. {nearest(name, [*LIMITS, *RANGES])}")
        if name in positions:
            raise click.UsageError(f"--switch {word}: {name} is named twice. Name it once.")
        ends = text.split(":")
        if not text or len(ends) != (1 if name in LIMITS else 2):
            raise click.UsageError(f"{expected}.")
        try:
            converted = tuple(parse_quantity(end, unit, f"--switch {name}") for end in ends)
        except SimulationError as error:
            raise click.UsageError(str(error)) from None
        if converted[0] > converted[-1]:
            raise click.UsageError(f"--switch {word}: the lower end comes first.")
        positions[name] = converted
    if "negative" in positions and "positive" in positions and positions["negative"] >= positions["positive"]:
        raise click.UsageError("--switch: the negative limit switch lies above the positive one. Exchange them.")
    home, first, second = (ends_of(positions.get(name)) for name in RANGES)
    negative, positive = (positions[name][0] if name in positions else None for name in LIMITS)
    return Switches(negative, positive, home, (first, second))


def ends_of(position: tuple[float, ...] | None) -> tuple[float, float] | None:
    """Lower and upper end of a range."""
    return None if position is None else (position[0], position[1])
