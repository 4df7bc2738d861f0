"""`twin hil jog`, `move`: manual motion of one drive."""

from __future__ import annotations

from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

import click

from hw_bridge.command.bench.options import NODE, OptionError, on_a_bus, paragraph
from hw_bridge.command.bench.single_axis import (
    ARM,
    ORIGIN,
    REFERENCE,
    START,
    end_live,
    page_watchdog,
    select_axis,
    show_live,
    shows_live,
    single_axis_session,
)
from twin.cli import say
from twin.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hw_bridge.command.bench.options import BusChoice
    from hw_bridge.commission import Axis, HeldKey, PageWatchdog, SingleAxisSession

SLOW, GENTLE = 0.02, 0.1  # of the limits of velocity and acceleration, where nothing is said
ROUNDING = 1e-9  # relative
NEAR_END = 1e-5  # distance from the end of a jog at which it is reached [m or rad]
ROUND = {"m": 10e-3, "rad": 0.2}  # how far a jog goes at most, where nothing is said: 10 mm, 11 deg
READY = "hold a button"  # tells the page that the drive is ready to move
EXPIRED = "dead-man switch"  # behind the live values: why the drive stands although the button is held

RAMP = (
    click.option("--velocity", metavar="V", help="Velocity, such as '5 mm/s'.  [default: 2 % of limits.velocity]"),
    click.option(
        "--acceleration", metavar="A", help="Acceleration, such as '0.5 m/s^2'.  [default: 10 % of the limit]"
    ),
)


def ramp(axis: Axis, velocity: str | None, acceleration: str | None) -> tuple[float, float]:
    """Speed and acceleration of a motion, within the limits of the hardware file."""
    from hw_bridge.commission import check_bounded
    from hw_bridge.hardware import TARGET_SHARE

    limits = axis.keys.limits
    speed = SLOW * limits.velocity if velocity is None else axis.si(velocity, "--velocity", "/s")
    rate = GENTLE * limits.acceleration if acceleration is None else axis.si(acceleration, "--acceleration", "/s^2")
    path = f"nodes.{axis.name}.limits"
    speed_to_text, rate_to_text = (partial(axis.format_quantity, suffix=suffix) for suffix in ("/s", "/s^2"))
    share = f"{100 * TARGET_SHARE:.0f} % of {path}.velocity"
    check_bounded(speed, TARGET_SHARE * limits.velocity, "--velocity", share, speed_to_text)
    check_bounded(rate, limits.acceleration, "--acceleration", f"{path}.acceleration", rate_to_text)
    return speed, rate


@click.command("move", context_settings={"ignore_unknown_options": True})
@NODE
@click.option("--by", metavar="DISTANCE", help="Distance from the present position: --by '1 mm', --by '-5 deg'.")
@click.option("--to", metavar="POSITION", help="Target position; needs a reference (twin hil home).")
@RAMP[0]
@RAMP[1]
@click.option(
    "--distance",
    metavar="DISTANCE",
    help="Greatest --by of a drive that counts from its present position.  [default: 10 mm or 11 deg]",
)
@ARM
@ORIGIN
@on_a_bus
def move_command(
    bus: BusChoice,
    node: str,
    by: str | None,
    to: str | None,
    velocity: str | None,
    acceleration: str | None,
    distance: str | None,
    arm: bool,
    origin: str | None,
) -> None:
    """Move NODE with a ramp, then stop and disable it. Give --by or --to.

    A target with bounded velocity and acceleration is sent in each cycle. Following error, velocity, force and position
    are checked against the limits of the hardware file in each cycle. Ctrl-C stops the drive. Before homing the limits
    count from where each command begins, so that several commands may leave the stroke: --distance bounds each.

    \b
    twin hil move servomotor --by "1 mm" -f my_bench.yaml --arm
    twin hil move servomotor --to "-20 mm" -f my_bench.yaml --arm
    """
    if (by is None) == (to is None):
        raise OptionError("Say how far: --by '1 mm', or to where: --to '10 mm'.")
    if to is not None:
        if origin == START:
            raise OptionError("--to counts from the reference: use --by with --from-start.")
        origin = REFERENCE
    axis = select_axis(bus, node)
    speed, rate = ramp(axis, velocity, acceleration)
    length = axis.si(to, "--to") if to is not None else axis.si(by or "0", "--by")
    reach = ROUND[axis.unit] if distance is None else abs(axis.si(distance, "--distance"))

    def check(position: float | None) -> None:
        if position is None and abs(length) > reach * (1.0 + ROUNDING):
            raise SimulationError(
                f"{axis.name}: --by {axis.format_quantity(length)} from where it stands is more than "
                f"{axis.format_quantity(reach)}, and an end stop may be nearer. Home it first, take a smaller --by, or "
                f"allow it by --distance '{axis.format_quantity(abs(length))}'."
            )
        assert_inside(axis, length if to is not None else (position or 0.0) + length, position)

    with single_axis_session(bus, axis, arm, origin=origin, check=check) as session:
        begin = session.node.position
        goal = length if to is not None else begin + length
        check_target(session, goal)
        travel = abs(goal - begin)
        duration = travel / speed + speed / rate if travel * rate > speed**2 else 2.0 * (travel / rate) ** 0.5
        paragraph(
            f"{session.node.name}: from {session.node.format_length(begin)} to {session.node.format_length(goal)}: "
            f"{session.node.format_length(travel)} at {axis.format_quantity(speed, '/s')}, {duration:.2g} s (--velocity); "
            f"positions count {session.origin}."
        )
        if shows_live():
            session.master.attend = partial(show_live, session)
        there = session.move(goal, speed, rate)
        end_live(session)
        furthest = max(abs(sample.target - sample.position) for sample in session.samples)
        say(
            f"{session.node.name}: is at {session.node.format_length(there)}, largest following error "
            f"{session.node.format_length(furthest)}."
        )


def assert_inside(axis: Axis, goal: float, here: float | None) -> None:
    """Raise SimulationError for a goal outside of limits.position, before power. `here`: None for positions from start."""
    (low, high), to_text = axis.keys.limits.position, axis.format_quantity
    if not low <= goal <= high:
        origin, stands = "start", ""
        if here is not None:
            origin, stands = "reference", f"it is at {to_text(round(here, 5))}. "
        raise SimulationError(
            f"{axis.name}: {to_text(round(goal, 5))} from {origin} is outside of limits.position, {to_text(low)} to "
            f"{to_text(high)}. {stands.capitalize()}Nothing was enabled."
        )


def check_target(session: SingleAxisSession, goal: float) -> None:
    """Raise SimulationError for a position outside of the limits, before anything moves."""
    low, high = session.keys.limits.position
    if not low <= goal <= high:
        to_text = session.node.format_length
        raise SimulationError(
            f"{session.node.name}: {to_text(goal)} {session.origin} is outside of limits.position, {to_text(low)} to "
            f"{to_text(high)}."
        )


@click.command("jog")
@NODE
@RAMP[0]
@RAMP[1]
@click.option(
    "--distance",
    metavar="DISTANCE",
    help="Greatest distance from the present position, to both sides.  [default: 10 mm or 11 deg]",
)
@ARM
@ORIGIN
@on_a_bus
def jog_command(
    bus: BusChoice,
    node: str,
    velocity: str | None,
    acceleration: str | None,
    distance: str | None,
    arm: bool,
    origin: str | None,
) -> None:
    """Move NODE for as long as an arrow key is held: right to positive positions, left to negative ones. q ends it.

    A terminal does not report the release of a key, only its repeats. Motion begins with the first repeat (0.25 to 0.7 s
    after the key goes down) and ends when no repeat came for 0.12 s. The drive stands at most 0.2 s after the last repeat.
    Any other key stops it at once. It also stops when the terminal is closed, and when this program ends, hangs or is
    killed, because it then misses its heartbeat. Over a slow network repeats may come late: jog only a drive that you see.

    \b
    twin hil jog servomotor --distance "5 mm" -f my_bench.yaml --arm
    """
    from hw_bridge.commission import SLOWEST_STOP

    axis = select_axis(bus, node)
    speed, rate = ramp(axis, velocity, acceleration)
    reach = ROUND[axis.unit] if distance is None else abs(axis.si(distance, "--distance"))
    hardest = axis.keys.limits.acceleration
    if speed / hardest > SLOWEST_STOP:
        raise SimulationError(
            f"--velocity {axis.format_quantity(speed, '/s')} takes {1e3 * speed / hardest:.0f} ms to stop at "
            "limits.acceleration, "
            f"{axis.format_quantity(hardest, '/s^2')}; a jog has {1e3 * SLOWEST_STOP:.0f} ms. Go slower."
        )
    with button() as held_button, single_axis_session(bus, axis, arm, origin=origin, paced=True) as session:
        here, (low, high) = session.node.position, session.keys.limits.position
        session.ramp.acceleration = rate
        session.ramp.low = min(max(low, here - reach), here)
        session.ramp.high = max(min(high, here + reach), here)
        to_text = session.node.format_length
        ends = f"{to_text(session.ramp.low)} to {to_text(session.ramp.high)} {session.origin}"
        page = page_watchdog()
        say(f"{session.node.name}: {f'{READY}; {ends}.' if page else f'hold an arrow key; {ends}. q ends it.'}")
        while True:
            deflection = held_button.deflection()
            if held_button.over:
                break
            was_moving = bool(session.ramp.velocity)
            session.go(session.ramp.follow(deflection * speed, session.h))
            session.note = reached_end(session, here, reach)
            if page is None:
                show_live(session)
            else:
                session.note = EXPIRED if page.expired else session.note
                if was_moving and not session.ramp.velocity:
                    rest = session.node.format_length(session.ramp.position)
                    say(f"{axis.name}: stopped at {rest}: {session.note or 'released'}.")
        say()


@contextmanager
def button() -> Iterator[PageWatchdog | HeldKey]:
    """The held button: of the page that shows this command, else a key of the terminal."""
    from hw_bridge.commission import HeldKey, Keyboard

    if (page := page_watchdog()) is not None:
        yield page
        return
    with Keyboard.open() as keyboard:
        yield HeldKey(keyboard)


def reached_end(session: SingleAxisSession, here: float, reach: float) -> str:
    """Return which end of a jog is reached, and what limits it; empty in between. It began `here` and may go `reach` [m or rad]."""
    ramp = session.ramp
    for name, end, distance in (("upper", ramp.high, here + reach), ("lower", ramp.low, here - reach)):
        if abs(end - ramp.position) < NEAR_END:
            return f"{name} end ({'--distance' if end == distance else 'limits.position'})"
    return ""
