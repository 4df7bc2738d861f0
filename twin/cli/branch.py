"""`twin branch RUN`: continue a run from a point in time with changed values."""

from __future__ import annotations

from pathlib import Path

import click

from twin.cli.options import (
    SET_EXAMPLE,
    build_option,
    duration_option,
    no_report_option,
    runs_option,
    timeout_option,
    verbose_option,
)
from twin.cli.resume import continue_from, json_option


@click.command(name="branch")
@click.argument("folder", type=click.Path(path_type=Path), metavar="RUN")
@duration_option("--at", "Simulated time at which the values change, e.g. 12.5s.", required=True)
@click.option(
    "--set",
    "overrides",
    multiple=True,
    required=True,
    metavar="PATH=VALUE",
    help=f"Set a tunable parameter or free input at that time, e.g. {SET_EXAMPLE}. Repeatable.",
)
@runs_option
@build_option
@json_option
@verbose_option
@no_report_option
@timeout_option("End a case when a step of a member takes longer [s].  [default: no limit]")
def command(
    folder: Path,
    at: int,
    overrides: tuple[str, ...],
    runs: Path,
    build: Path,
    as_json: bool,
    verbose: bool,
    no_report: bool,
    timeout: float,
) -> None:
    """Continue a run from a point in time with changed values, as a new run; what lies before it is not computed again.

    RUN is its folder, runs/SCENARIO/TIME; the run was started with `twin run --checkpoint DURATION`. Each case continues from
    its last checkpoint before the time; a case without one begins at its start. The values are events of the new run's scenario.yaml,
    which gives the same result to the bit.

    Exit code as of `twin run`.

    \b
    twin run heart_wall_force --checkpoint 5s
    twin branch runs/heart_wall_force/latest --at 12.5s --set heart.rate="1.6 Hz"
    """
    continue_from(folder, runs, build, as_json, no_report, timeout, verbose, at=at, overrides=overrides)
