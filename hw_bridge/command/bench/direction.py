"""`twin hil direction`: check the counting direction of the encoder, and `inverted` of the hardware file."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from hw_bridge.command.bench.options import NODE, on_a_bus, paragraph
from hw_bridge.command.bench.single_axis import ARM, ORIGIN, select_axis, single_axis_session
from twin.cli import say
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.command.bench.options import BusChoice
    from hw_bridge.commission import Axis

WRONG = (
    "The encoder counts against the motor: a closed loop would run away. Swap the encoder's A and B (or two motor phases "
    "with the Hall sensors), or its polarity in the drive, with the vendor's software. Do not enable it before."
)


@click.command("direction")
@NODE
@click.option(
    "--by-hand",
    "is_manual",
    is_flag=True,
    help="Without power: you move the axis by hand to positive positions; the command shows the counts.",
)
@click.option(
    "--within",
    "timeout",
    type=click.FloatRange(1.0, 600.0),
    default=20.0,
    show_default=True,
    metavar="S",
    help="With --by-hand: time to wait for motion [s].",
)
@click.option(
    "--share",
    type=click.FloatRange(0.01, 1.0),
    default=0.4,
    show_default=True,
    help="Greatest force, as a fraction of limits.force.",
)
@ARM
@ORIGIN
@on_a_bus
def direction_command(
    bus: BusChoice, node: str, is_manual: bool, timeout: float, share: float, arm: bool, origin: str | None
) -> None:
    """Push NODE with a slowly growing force to positive, then to negative positions, until it moved a few increments.

    No position or velocity loop is closed, so a wrong sign cannot make the drive run away. Nothing holds the axis
    meanwhile: do not use it on a vertical axis that would fall. With --by-hand nothing is powered: move the axis in the
    direction in which the member's position grows. This shows whether `inverted` in the hardware file is right.

    \b
    twin hil direction servomotor --by-hand -f my_bench.yaml
    twin hil direction servomotor -f my_bench.yaml --arm
    """
    axis = select_axis(bus, node)
    if is_manual:
        check_manually(bus, axis, timeout)
        return
    from hw_bridge.commission import direction

    keys = axis.keys
    if not direction.can_push(keys.drive):
        raise SimulationError(f"{keys.drive.title} has no cst to push with. Use --by-hand, then a short jog.")
    with single_axis_session(bus, axis, arm, origin=origin, forced=True) as session:
        results = direction.pushes(session, share * keys.limits.force)
        unit = "N m" if session.node.rotary else "N"
        for item in results:
            verdict = "correct direction" if item.agrees else "wrong direction" if item.moved else "not moved"
            coasts = item.moved and abs(item.farthest) > abs(item.moved)
            coast = f"; coasted to {axis.format_quantity(item.farthest)}" if coasts else ""
            paragraph(
                f"{session.node.name}: push of {item.direction * item.force:+.2f} {unit}: "
                f"{axis.format_quantity(item.moved)}, {verdict}{coast}."
            )
    if any(item.moved and not item.agrees for item in results):
        paragraph(WRONG)
        sys.exit(1)
    if not all(item.moved for item in results):
        paragraph("It did not move: is it blocked, or is the brake on? A larger --share pushes harder.")
        sys.exit(1)
    paragraph(
        "The encoder and motor have the same sign. Check with --by-hand or a short jog that the member has it too."
    )


def check_manually(bus: BusChoice, axis: Axis, timeout: float) -> None:
    """Report the counted motion while the operator moves the axis."""
    from hw_bridge.commission import direction, identity_text, objects

    with bus.sdo_session() as sdo_session:
        node = sdo_session.drive(axis.name)
        objects.learn(node)
        say(identity_text(node))
        enough = 20 * node.profile.motor.resolution * node.keys.scale
        say(f"{node.name}: power is off. Move it by hand to positive positions of the member, within {timeout:g} s.")
        moved = direction.measure_manual_motion(sdo_session, node, enough, round(timeout * 1e9))
    text = axis.format_quantity(moved)
    if not moved:
        raise SimulationError(
            f"{node.name}: nothing was counted. Check the encoder's cable and type, or move it farther."
        )
    if moved < 0.0:
        now, then = ("true", "false") if node.keys.inverted else ("false", "true")
        paragraph(f"It counted {text}: against the hardware file. Change `inverted: {now}` to `inverted: {then}`.")
        sys.exit(1)
    say(f"It counted {text}: the hardware file is right.")
