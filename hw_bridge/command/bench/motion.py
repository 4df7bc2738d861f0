"""`twin hil jog`, `move`, `direction`: a person moves one drive."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from hw_bridge.command.bench.hands import ARM, HOMED, attendance, hand, meant
from hw_bridge.command.bench.options import NODE, on_a_bus
from twin.cli import say
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hw_bridge.command.bench.options import BusChoice
    from hw_bridge.commission import Attendance, Axis, Hand, HeldKey

SLOW, GENTLE = 0.02, 0.1  # of the limits of velocity and acceleration, where nothing is said
LOOK = 100_000_000  # between two lines of the display [ns]
ROUND = {"m": 10e-3, "rad": 0.2}  # how far a jog goes at most, where nothing is said: 10 mm, 11 deg
READY = "hold a button"  # what a page is told once it would move

RAMP = (
    click.option("--velocity", metavar="V", help="Such as '5 mm/s'; by default 2 % of limits.velocity."),
    click.option("--acceleration", metavar="A", help="Such as '0.5 m/s^2'; by default 10 % of the limit."),
)  # fmt: skip


def ramp(axis: Axis, velocity: str | None, acceleration: str | None) -> tuple[float, float]:
    """Speed and acceleration of a person, within the limits of the hardware file."""
    from hw_bridge.commission import SHARE, bounded

    limits = axis.keys.limits
    speed = SLOW * limits.velocity if velocity is None else axis.si(velocity, "--velocity", "/s")
    rate = GENTLE * limits.acceleration if acceleration is None else axis.si(acceleration, "--acceleration", "/s^2")
    bounded(speed, SHARE * limits.velocity, "--velocity", lambda one: axis.told(one, "/s"))
    bounded(rate, limits.acceleration, "--acceleration", lambda one: axis.told(one, "/s^2"))
    return speed, rate


@click.command("move", context_settings={"ignore_unknown_options": True})
@NODE
@click.option("--by", metavar="WAY", help="So far from where it stands: --by '1 mm', --by '-5 deg'.")
@click.option("--to", metavar="PLACE", help="To this position; needs --homed.")
@RAMP[0]
@RAMP[1]
@ARM
@HOMED
@on_a_bus
def move_command(
    bus: BusChoice, node: str, by: str | None, to: str | None, velocity: str | None, acceleration: str | None,
    arm: bool, homed: bool,
) -> None:  # fmt: skip
    """Move NODE with a ramp, then stop and disable it. Without --by or --to it is refused.

    Positions go out every cycle with bounded velocity and acceleration, and every cycle is watched: following error,
    velocity, force and position limits of the hardware file. Ctrl-C stops it.

    \b
    twin hil move servomotor --by "1 mm" -f my_bench.yaml --arm
    twin hil move servomotor --to "-20 mm" --homed -f my_bench.yaml --arm
    """
    if (by is None) == (to is None):
        raise click.UsageError("Say how far: --by '1 mm', or to where: --to '10 mm' with --homed.")
    if to is not None and not homed:
        raise click.UsageError("--to needs a reference: twin hil home first, then --homed. Or use --by.")
    axis = meant(bus, node)
    speed, rate = ramp(axis, velocity, acceleration)
    place = axis.si(to, "--to") if to is not None else axis.si(by or "0", "--by")
    with hand(bus, axis, arm, homed=homed) as held:
        begin = held.node.position
        goal = place if to is not None else begin + place
        within(held, goal)
        say(
            f"{held.node.name}: from {held.node.format_length(begin)} to {held.node.format_length(goal)} at {held.node.format_length(speed)}/s."
        )
        there = held.move(goal, speed, rate)
        furthest = max(abs(sample.target - sample.position) for sample in held.samples)
        say(
            f"{held.node.name}: is at {held.node.format_length(there)}, largest following error {held.node.format_length(furthest)}."
        )


def within(held: Hand, goal: float) -> None:
    """SimulationError for a place outside of the limits, before anything moves."""
    low, high = held.keys.limits.position
    if not low <= goal <= high:
        way = held.node.format_length
        raise SimulationError(
            f"{held.node.name}: {way(goal)} is outside of limits.position, {way(low)} to {way(high)}."
        )


@click.command("jog")
@NODE
@RAMP[0]
@RAMP[1]
@click.option("--distance", metavar="WAY", help="So far from where it stands at most, to both sides; by default "
              "10 mm, or 11 deg.")  # fmt: skip
@ARM
@HOMED
@on_a_bus
def jog_command(
    bus: BusChoice, node: str, velocity: str | None, acceleration: str | None, distance: str | None, arm: bool,
    homed: bool,
) -> None:  # fmt: skip
    """Move NODE for as long as an arrow key is held: right to positive positions, left to negative ones. q ends it.

    A terminal does not tell that a key was released, only that it repeats: motion begins with the first repeat (0.25 to
    0.7 s after the key goes down) and ends when no repeat came for 0.12 s. It stands at most 0.2 s after the last one. Any
    other key stops it at once. It stops as well when the terminal is closed, and when this program ends, hangs or is
    killed: then the drive misses its heartbeat. Over a slow network repeats may come late: jog where you see the drive.

    \b
    twin hil jog servomotor --distance "5 mm" -f my_bench.yaml --arm
    """
    from hw_bridge.commission import SLOWEST_STOP

    axis = meant(bus, node)
    speed, rate = ramp(axis, velocity, acceleration)
    reach = ROUND[axis.unit] if distance is None else abs(axis.si(distance, "--distance"))
    hardest = axis.keys.limits.acceleration
    if speed / hardest > SLOWEST_STOP:
        raise SimulationError(
            f"--velocity {axis.told(speed, '/s')} takes {1e3 * speed / hardest:.0f} ms to stop at limits.acceleration, "
            f"{axis.told(hardest, '/s^2')}; a jog has {1e3 * SLOWEST_STOP:.0f} ms. Go slower."
        )
    with button() as held_button, hand(bus, axis, arm, homed=homed, paced=True) as held:
        here, (low, high) = held.node.position, held.keys.limits.position
        held.ramp.acceleration = rate
        held.ramp.low = min(max(low, here - reach), here)
        held.ramp.high = max(min(high, here + reach), here)
        ends = f"{held.node.format_length(held.ramp.low)} to {held.node.format_length(held.ramp.high)}"
        terminal = attendance() is None
        say(f"{held.node.name}: {f'hold an arrow key; {ends}. q ends it.' if terminal else f'{READY}; {ends}.'}")
        due = 0
        while True:
            way = held_button.way()
            if held_button.over:
                break
            held.go(held.ramp.follow(way * speed, held.h))
            if held.network.now >= due:
                due = held.network.now + LOOK
                show(held)
        say()


@contextmanager
def button() -> Iterator[Attendance | HeldKey]:
    """What a person holds: a button of the page that shows this, else a key of the terminal."""
    from hw_bridge.commission import HeldKey, Keyboard

    if (page := attendance()) is not None:
        yield page
        return
    with Keyboard.open() as keyboard:
        yield HeldKey(keyboard)


def show(held: Hand) -> None:
    """Where it is, on one line of the terminal."""
    node = held.node
    mark = {1: ">", -1: "<"}.get((held.ramp.velocity > 0) - (held.ramp.velocity < 0), " ")
    sys.stdout.write(
        f"\r{mark} {node.format_length(node.position):>14} {node.format_length(node.velocity):>12}/s {node.current:8.2f} A   "
    )
    sys.stdout.flush()
