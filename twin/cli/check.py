"""`twin check`: find every mistake in scenario files without running them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli.terminal import say, working
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
@click.option(
    "--no-import", is_flag=True, help="Import no Python: check what the file and its FMUs tell by themselves."
)
def command(files: tuple[str, ...], overrides: tuple[str, ...], hardware_file: Path | None, no_import: bool) -> None:
    """Check scenario files: keys, units, names, times, connections.

    Each problem is one line, `file:line: what is wrong and what to do`. Nothing is compiled or simulated. The modules
    of components and analyses are imported, though, and importing Python runs what stands in it: for files of
    strangers there is --no-import.
    The keys of faults among the events are the hardware's: name its file with --hardware.
    """
    from twin.cli.run import load_hardware

    if no_import and hardware_file is not None:
        raise click.UsageError("--hardware fits what the components say: they have to be imported. Drop --no-import.")
    hardware = load_hardware(hardware_file, True, Path("build")) if hardware_file is not None else None
    count = 0
    for file in files:
        with working(f"checking {file}"):
            problems, good = examine(file, overrides, hardware, not no_import)
        for problem in problems:
            say(problem)
        if not problems:
            say(f"{file}: ok ({good}{'; what only Python tells was not checked' * no_import})")
        count += len(problems)
    if count:
        say(f"{counted(count, 'problem')}", err=True)
        sys.exit(1)


def examine(
    file: str, overrides: tuple[str, ...] = (), hardware: Hardware | None = None, imports: bool = True
) -> tuple[list[str], str]:
    """(problems of a file, or what it has)."""
    from twin import scenario as scenarios

    try:
        scenario, problems = scenarios.examine(file, overrides, imports=imports)
        if hardware is not None and not problems:
            _, problems = scenarios.look_up(hardware.apply(scenario))
    except ScenarioError as error:
        return error.problems, ""
    return problems, extent(scenario)


def extent(scenario: Scenario) -> str:
    """`3 variants, 3 seeds, 8 members, 12 connections`."""
    members = max(len(case.members) for case in scenario.variants)
    connections = max(len(case.connections) for case in scenario.variants)
    numbers = {
        "variant": len(scenario.variants),
        "seed": len(scenario.seeds),
        "member": members,
        "connection": connections,
    }
    return ", ".join(counted(number, word) for word, number in numbers.items())


def counted(number: int, word: str) -> str:
    """`1 seed`, `3 seeds`."""
    return f"{number} {word}" + ("" if number == 1 else "s")
