"""`twin check`: find every mistake in scenario files without running them."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from twin.errors import ScenarioError

if TYPE_CHECKING:
    from twin.scenario import Scenario


@click.command("check", short_help="Find every mistake in scenario files without running them.")
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
@click.option(
    "--set", "overrides", multiple=True, metavar="PATH=VALUE", help='As of `twin run`: `heart.rate="1.4 Hz"`.'
)
def command(files: tuple[str, ...], overrides: tuple[str, ...]) -> None:
    """Check scenario files: keys, units, names, times, connections.

    Each problem is one line, `file:line: what is wrong and what to do`. Nothing is compiled or run.
    """
    count = 0
    for file in files:
        problems, good = examine(file, overrides)
        for problem in problems:
            click.echo(problem)
        if not problems:
            click.echo(f"{file}: ok ({good})")
        count += len(problems)
    if count:
        click.echo(f"{counted(count, 'problem')}", err=True)
        sys.exit(1)


def examine(file: str, overrides: tuple[str, ...] = ()) -> tuple[list[str], str]:
    """(problems of a file, or what it has)."""
    from twin.scenario import Scenario
    from twin.scenario.lookup import look_up

    try:
        scenario = Scenario.load(file, overrides)
        _, problems = look_up(scenario)
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
