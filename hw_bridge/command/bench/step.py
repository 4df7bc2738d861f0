"""`twin hil step`: step response of the loops, compared with the twin's."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from hw_bridge.command.bench.motion import assert_inside, check_target
from hw_bridge.command.bench.options import NODE, on_a_bus, paragraph, table
from hw_bridge.command.bench.single_axis import ARM, ORIGIN, hardware, select_axis, single_axis_session
from twin.cli import say
from twin.errors import SimulationError

if TYPE_CHECKING:
    from hw_bridge.command.bench.options import BusChoice
    from hw_bridge.commission import Axis, step

SHARE = 0.5  # of the limit of the following error that a step may have: all of it is one at once
SHOWN = {"m": ("mm", 1e3), "rad": ("deg", 57.29577951308232)}


@click.command("step")
@NODE
@click.option(
    "--by", metavar="DISTANCE", help="Size of the step, such as '0.2 mm'.  [default: a tenth of limits.following_error]"
)
@click.option(
    "--plot",
    type=click.Path(dir_okay=False, path_type=Path),
    default=Path("step.svg"),
    show_default=True,
    help="File of the plot with both responses.",
)
@click.option("--explain", is_flag=True, help="Fit the gains of the twin to the response; takes half a minute.")
@ARM
@ORIGIN
@on_a_bus
def step_command(
    bus: BusChoice, node: str, by: str | None, plot: Path, explain: bool, arm: bool, origin: str | None
) -> None:
    """Measure the step response of NODE, and draw it with that of the simulated drive of its profile.

    The target changes at limits.acceleration. A step at which the simulated drive exceeds a limit of the file is refused
    before anything moves. The twin has the motor and gains of the profile, so a difference means another load, friction
    or tuning. --explain fits the twin's gains to the response; only the vendor's software shows whether the drive's gains
    are the cause. A step that exceeds a limit ends the command: choose a smaller one.

    \b
    twin hil step servomotor --by "0.2 mm" -f my_bench.yaml --arm
    """
    from hw_bridge.commission import check_bounded, restrict_to_node
    from hw_bridge.commission import step as steps

    axis = select_axis(bus, node)
    limit = axis.keys.limits.following_error
    size = 0.1 * limit if by is None else axis.si(by, "--by")
    source = f"half of nodes.{axis.name}.limits.following_error"
    check_bounded(abs(size), SHARE * limit, "--by", source, axis.format_quantity)
    keys = restrict_to_node(hardware(bus), axis.name)
    try:
        expected = steps.simulated(keys, axis.name, size, bus.build, {})
    except SimulationError as error:
        raise SimulationError(
            f"--by {axis.format_quantity(size)}: the simulated drive meets a limit: {error} Take less."
        ) from None

    def check(position: float | None) -> None:
        assert_inside(axis, (position or 0.0) + size, position)

    with single_axis_session(bus, axis, arm, origin=origin, check=check) as session:
        check_target(session, session.node.position + size)
        real = steps.response(session, size)
    curves = {axis.name: real}
    if explain:
        twin, gains, (before, after) = steps.explain(real, keys, axis.name, bus.build)
        curves["twin"] = twin
        if before < session.node.profile.motor.resolution * axis.keys.scale:
            paragraph("The twin does the same, to within an increment of the sensor.")
        elif gains and after < steps.EXPLAINED * before:
            curves["twin with other gains"] = steps.simulated(keys, axis.name, size, bus.build, gains)
            factors = ", ".join(f"{name} x {factor:.2g}" for name, factor in gains.items())
            paragraph(
                f"Gains that would explain it: {factors}. Difference {axis.format_quantity(before)} rms, with them "
                f"{axis.format_quantity(after)}."
            )
        else:
            paragraph(
                f"No gains explain the difference of {axis.format_quantity(before)} rms: look at load, friction and scaling."
            )
    else:
        curves["twin"] = expected
    table(
        [("", "rise", "overshoot", "settled", "left"), *(figures(axis, name, curve) for name, curve in curves.items())],
        head=True,
    )
    steps.picture(plot, curves, *SHOWN[axis.unit])
    say(f"{plot}: position and current over time.")


def figures(axis: Axis, name: str, response: step.Response) -> tuple[str, ...]:
    """Row of the table: rise, overshoot, settling time, remaining error."""
    values = response.figures()
    ms = {key: "-" if values[key] != values[key] else f"{1e3 * values[key]:.0f} ms" for key in ("rise", "settled")}
    return name, ms["rise"], f"{100 * values['overshoot']:.0f} %", ms["settled"], axis.format_quantity(values["left"])
