"""`twin hil enable`, `disable`, `home`: power, and the homing reference."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from hw_bridge.command.bench.options import NODE, on_a_bus, paragraph, table
from hw_bridge.command.bench.single_axis import (
    ARM,
    ORIGIN,
    assert_armed,
    end_live,
    hardware,
    page_watchdog,
    select_axis,
    single_axis_session,
)
from twin.cli import say
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.command.bench.options import BusChoice


@click.command("enable")
@NODE
@click.option(
    "--for", "duration", type=click.FloatRange(0.0), metavar="S", help="End after this time [s].  [default: until q]"
)
@ARM
@ORIGIN
@on_a_bus
def enable_command(bus: BusChoice, node: str, duration: float | None, arm: bool, origin: str | None) -> None:
    """Switch NODE's power stage on and hold its position while this command runs.

    The drive never stays enabled: when this program ends, hangs or is killed, the drive misses its heartbeat and stops
    by itself. A drive in Fault is refused with the reason. Remove the cause, then use twin hil reset.
    """
    from hw_bridge.commission import Keyboard

    axis = select_axis(bus, node)
    with (
        Keyboard.open_if_terminal() as keyboard,
        single_axis_session(bus, axis, arm, origin=origin, paced=True) as session,
    ):
        page = page_watchdog()
        ends = " q or Ctrl-C ends it." if page is None else ""
        say(
            f"{session.node.name}: {session.node.state} at {session.node.format_length(session.node.position)} {session.origin}.{ends}"
        )
        begin = session.network.now
        while duration is None or session.network.now - begin < duration * 1e9:
            session.rest(session.cycle)
            if (page is not None and page.over) or (keyboard is not None and {"q", "quit"} & set(keyboard.pressed())):
                break


@click.command("disable")
@NODE
@on_a_bus
def disable_command(bus: BusChoice, node: str) -> None:
    """Stop NODE with its quick stop ramp and switch its power stage off, if another program left it enabled."""
    from hw_bridge.commission import power

    with bus.sdo_session() as sdo_session:
        drive = sdo_session.drive(node)
        say(f"{drive.name}: {power.disable(sdo_session, drive)}.")


@click.command("home")
@NODE
@click.option("--explain", is_flag=True, help="Describe the method; do not move.")
@ARM
@on_a_bus
def home_command(bus: BusChoice, node: str, explain: bool, arm: bool) -> None:
    """Home NODE by the method of the hardware file. The method is described before the drive moves.

    Refused if the method goes to one end while `at` is at the other, or if its speed is above the limit. If the drive has
    a torque limit, it is lowered while homing. Homing stops if force or velocity exceeds its limit, if the drive goes to
    the other end, or if it moves farther than the position limits are apart. A run homes in the same way. Afterwards the
    drive moves inside the position limits. It keeps its reference until it is switched off; the other commands
    count positions from it.

    \b
    twin hil home servomotor --explain -f my_bench.yaml
    twin hil home servomotor -f my_bench.yaml --arm
    """
    from hw_bridge.commission import homing
    from hw_bridge.master import Reference

    axis = select_axis(bus, node)
    own = axis.keys
    if own.homing is None:
        raise SimulationError(f"{bus.hardware}: {axis.name}: {homing.NO_HOMING}")
    end = Reference(hardware(bus), axis.name, axis.rotary).resting_position()
    say(f"{axis.name}: method {own.homing.method}, the reference position is {axis.format_quantity(own.homing.at)}:")
    steps, bounds = homing.explained(axis, hardware(bus))
    table([(f"{number}.", text) for number, text in enumerate(steps, 1)], 2)
    paragraph(bounds)
    if explain:
        return
    assert_armed(bus, arm)
    with single_axis_session(bus, axis, arm, homes=True, start=end) as session:
        drive = session.node
        end_live(session)
        say(
            f"{axis.name}: homed at {axis.format_quantity(own.homing.at)}. It is at "
            f"{drive.format_length(drive.position)}; 6064h is {drive.raw_position}."
        )
