"""`twin profile`: the computing time of each member of a scenario."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli import completion
from twin.cli.graph import load_case
from twin.cli.options import (
    backend_option,
    build_option,
    overrides_option,
    picture_option,
    seed_option,
    variant_option,
)
from twin.cli.progress import ProgressBar
from twin.cli.terminal import say, show_elapsed, show_table

if TYPE_CHECKING:
    from twin.structure import CostProfile


@click.command("profile")
@click.argument("scenario", metavar="SCENARIO", shell_complete=completion.scenarios)
@overrides_option
@variant_option
@seed_option
@backend_option
@build_option
@picture_option
def command(
    scenario: str,
    variant: str | None,
    seed: int | None,
    overrides: tuple[str, ...],
    backend: str,
    build: Path,
    output: Path | None,
) -> None:
    """Run a variant of a scenario and measure the computing time of each member.

    The loop reads the clock between its calls, in a sample of the communication steps. No results are written. Load of
    other programs is measured too: close them, and repeat the measurement.
    """
    from twin.run import measure_profile
    from twin.scenario import Backend

    with show_elapsed(f"reading {scenario}"):
        case, catalog = load_case(scenario, overrides, variant)
    case = case if seed is None else replace(case, seed=seed)
    with ProgressBar(case.name) as display:
        result = measure_profile(
            case, catalog, Backend(backend), build, lambda _, fraction: display.show(case.name, fraction)
        )
    show(result)
    if output is not None:
        from twin.results import plotting, write_text

        values = {cost.name: cost.per_tick * 1e6 for cost in result.costs}
        write_text(output, plotting.bar_chart(values, "time of a communication step [us]") + "\n")
        say(f"{output}")


def show(profile: CostProfile) -> None:
    """Print the table of computing times."""
    rows = [
        [
            cost.name,
            cost.what,
            f"{cost.step * 1e6:.3f} us" if cost.step else "-",
            f"{cost.per_tick * 1e6:.3f} us",
            f"{100 * cost.share:.1f} %",
        ]
        for cost in profile.costs
    ]
    show_table(["member", "component", "per own step", "per communication step", "share"], rows, 2)
    say(
        f"A communication step of {profile.step * 1e3:g} ms takes {profile.per_tick * 1e6:.2f} us: "
        f"{profile.real_time_factor:.0f} times real time. {profile.sampled_steps} steps measured; {profile.overhead * 1e9:.0f} ns per "
        "reading of the clock are subtracted."
    )
