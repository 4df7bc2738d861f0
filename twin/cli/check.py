"""`twin check`: find every mistake in scenario files without running them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.errors import ScenarioError

if TYPE_CHECKING:
    from twin.run import Hardware
    from twin.scenario import Scenario


@click.command("check", short_help="Find every mistake in scenario files without running them.")
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
@click.option(
    "--set", "overrides", multiple=True, metavar="PATH=VALUE", help='As of `twin run`: `heart.rate="1.4 Hz"`.'
)
@click.option(
    "--hardware", "hardware_file", type=click.Path(path_type=Path), metavar="FILE",
    help="Also check that this hardware file fits: members, outputs, faults.",
)  # fmt: skip
def command(files: tuple[str, ...], overrides: tuple[str, ...], hardware_file: Path | None) -> None:
    """Check scenario files: keys, units, names, times, connections.

    Each problem is one line, `file:line: what is wrong and what to do`. Nothing is compiled or run.
    The keys of faults among the events are the hardware's: name its file with --hardware.
    """
    from twin.cli.run import load_hardware

    hardware = load_hardware(hardware_file, True, Path("build")) if hardware_file is not None else None
    count = 0
    for file in files:
        problems, good = examine(file, overrides, hardware)
        for problem in problems:
            click.echo(problem)
        if not problems:
            click.echo(f"{file}: ok ({good})")
        count += len(problems)
    if count:
        click.echo(f"{counted(count, 'problem')}", err=True)
        sys.exit(1)


def examine(file: str, overrides: tuple[str, ...] = (), hardware: Hardware | None = None) -> tuple[list[str], str]:
    """(problems of a file, or what it has)."""
    from twin.scenario import load_scenario, look_up

    try:
        scenario = load_scenario(file, overrides)
        _, problems = look_up(scenario if hardware is None else hardware.apply(scenario))
    except ScenarioError as error:
        return error.problems, ""
    return problems, extent(scenario)


def extent(scenario: Scenario) -> str:
    """`3 variants, 3 seeds, 8 members, 12 connections`."""
    members = max(len(case.members) for case in scenario.variants)
    connections = max(len(case.connections) for case in scenario.variants)
    numbers = {
        "variant": len(scenario.variants), "seed": len(scenario.seeds), "member": members, "connection": connections,
    }  # fmt: skip
    return ", ".join(counted(number, word) for word, number in numbers.items())


def counted(number: int, word: str) -> str:
    """`1 seed`, `3 seeds`."""
    return f"{number} {word}" + ("" if number == 1 else "s")
