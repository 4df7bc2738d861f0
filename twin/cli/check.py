"""`twin check`: find every mistake in scenario files without running them."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli import completion
from twin.cli.terminal import say, working
from twin.errors import CouplingError, ScenarioError

if TYPE_CHECKING:
    from twin.run import Hardware
    from twin.scenario import Scenario


@click.command("check", short_help="Find every mistake in scenario files without running them.")
@click.argument("files", nargs=-1, required=True, metavar="FILE...", shell_complete=completion.scenarios)
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
@click.option(
    "--coupling",
    is_flag=True,
    help="Also say whether algorithm and step are stable; compiles components, runs to half.",
)
def command(
    files: tuple[str, ...], overrides: tuple[str, ...], hardware_file: Path | None, no_import: bool, coupling: bool
) -> None:
    """Check scenario files: keys, units, names, times, connections.

    Each problem is one line, `file:line: what is wrong and what to do`. Nothing is compiled or simulated. The modules
    of components and analyses are imported, though, and importing Python runs what stands in it: for files of
    strangers there is --no-import.
    Where the algorithm takes steps back, FMUs of others are started and made to step, go back and step again.
    The keys of faults among the events are the hardware's: name its file with --hardware.

    With --coupling each variant is linearized at its start and in the middle of its run: what grows from step to step,
    though it does not in the model itself, is a problem, and a step or an algorithm with which it does not is proposed.
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
        for note in [*notes(file), *(hardware.bounds() if hardware is not None and not problems else ())]:
            say(f"note: {note}")
        if coupling and not problems:
            problems = unstable(file, overrides)
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
        scenario, problems = scenarios.lint(file, overrides, imports=imports)
        if hardware is not None and not problems:
            _, problems = scenarios.resolve_variables(hardware.apply(scenario))
        if imports and not problems and any(case.algorithm.rolls_back for case in scenario.variants):
            problems = unable(scenario)
    except ScenarioError as error:
        return error.problems, ""
    return problems, extent(scenario)


def unable(scenario: Scenario) -> list[str]:
    """Members that cannot go back to the begin of a step where the algorithm needs that."""
    from twin.run import resolve_catalogs, rollback_check

    catalogs = resolve_catalogs(scenario)
    return list(
        dict.fromkeys(one for case in scenario.variants for one in rollback_check(case, catalogs[case.variant]))
    )


def unstable(file: str, overrides: tuple[str, ...]) -> list[str]:
    """What is wrong with the coupling of a scenario's variants, printed too; one line for each that is stable."""
    from twin import clock
    from twin.cli.terminal import working
    from twin.run import check_stability, resolve_catalogs
    from twin.scenario import load_scenario

    scenario = load_scenario(file, overrides)
    catalogs = resolve_catalogs(scenario)
    problems = []
    for case in scenario.cases((), scenario.seeds[:1]):
        with working(f"{file}: {case.variant}"):
            try:
                found = check_stability(case, catalogs[case.variant], Path("build"))
            except CouplingError as error:
                for problem in error.problems:
                    say(f"note: {file}: {case.variant}: {problem}")
                continue
        how = f"{case.algorithm} at {clock.text(case.step_ns)}"
        if found.is_stable:
            say(f"{file}: {case.variant}: {how} is stable")
            continue
        grown = found.growth
        cures = (
            f"Use {' or '.join(found.stable_settings)}."
            if found.stable_settings
            else "No step or algorithm that was tried is better."
        )
        problems.append(
            f"{file}: {case.variant}: {how} is unstable at t = {clock.text(found.at)}: a deviation grows {grown.factor:.4g} "
            f"times in {grown.cycle * 1e3:g} ms, mostly {', '.join(grown.share[:3])}. {cures}"
        )
        say(problems[-1])
    return problems


def notes(file: str) -> list[str]:
    """What an SSP leaves open, and what is left out of it; nothing of other files, or where it cannot be read."""
    if not file.endswith(".ssp"):
        return []
    from twin.scenario import ssp_reader

    with suppress(ScenarioError):
        return ssp_reader.notes(Path(file), file)
    return []


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
