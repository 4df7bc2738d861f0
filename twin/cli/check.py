"""`twin check`: validate scenario files without running them."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli import completion
from twin.cli.options import hardware_option, option, overrides_option
from twin.cli.terminal import LABELS, say, show_elapsed, show_text
from twin.errors import CouplingError, ScenarioError

if TYPE_CHECKING:
    from twin.run import Hardware
    from twin.scenario import ScenarioSpec


@click.command("check")
@click.argument("files", nargs=-1, required=True, metavar="FILE...", shell_complete=completion.scenarios)
@overrides_option
@hardware_option
@click.option("--no-import", is_flag=True, help="Do not import Python; check only what files and FMUs contain.")
@option(
    "--stability",
    former=("--coupling",),
    is_flag=True,
    help="Also analyze the stability of algorithm and step; compiles and runs half of each variant.",
)
@click.option("--strict", is_flag=True, help="Deviations of an SSP from the standard are problems, not notes.")
def command(
    files: tuple[str, ...],
    overrides: tuple[str, ...],
    hardware_file: Path | None,
    no_import: bool,
    stability: bool,
    strict: bool,
) -> None:
    """Check scenario and study files: keys, units, names, times, connections; of a study also factors and bounds.

    Each problem is one line, `file:line: what is wrong and what to do`. Components are translated to C, but nothing is
    compiled or simulated. Modules of components and analyses are imported, which executes their code: use --no-import
    for files from untrusted sources.

    If the algorithm repeats steps, third-party FMUs are started to verify that they support rollback. Faults among the
    events are keys of the hardware file: name it with --hardware.

    --stability linearizes each variant at its start and in the middle of its run. A deviation that grows from step to step
    because of the coupling is a problem; a step or algorithm without it is proposed.
    """
    from twin.run import load_hardware
    from twin.scenario import ssp_reader

    ssp_reader.STRICT.set(strict)
    if no_import and hardware_file is not None:
        raise click.UsageError("--hardware needs the imported components. Drop --no-import.")
    hardware = load_hardware(hardware_file, True, Path("build")) if hardware_file is not None else None
    count = 0
    for file in files:
        with show_elapsed(f"checking {file}"):
            problems, extent = check_file(file, overrides, hardware, not no_import, Path("build"))
        for problem in problems:
            show_text(problem)
        lines = [*notes(file), *(hardware.bounds() if hardware is not None and not problems else ())]
        remarks = remarks_of(file, overrides) if not problems and not no_import else []
        for line in [*remarks, *(f"note: {note}" for note in lines)]:
            label = next(filter(line.startswith, LABELS))
            show_text(line.removeprefix(label), label)
        if stability and not problems:
            problems = check_stability(file, overrides)
        if not problems:
            warnings = sum(remark.startswith(LABELS[1]) for remark in remarks)
            word = f"ok, {with_plural(warnings, 'warning')}" if warnings else "ok"
            say(f"{file}: {word} ({extent}{'; Python code was not checked' * no_import})")
        count += len(problems)
    if count:
        say(f"{with_plural(count, 'problem')}", err=True)
        sys.exit(1)


def check_file(
    file: str,
    overrides: tuple[str, ...] = (),
    hardware: Hardware | None = None,
    imports: bool = True,
    build: Path | None = None,
) -> tuple[list[str], str]:
    """Return the problems of a file and, if there are none, its extent; print notes on units that FMUs do not declare.

    `build`: of the C of components; None: not translated.
    """
    from twin import scenario as scenarios

    if is_study(file):
        return check_study(file)
    try:
        scenario, problems = scenarios.lint(file, overrides, imports=imports)
        if hardware is not None and not problems:
            _, problems = scenarios.resolve_variables(hardware.apply(scenario))
        if imports and not problems and any(case.algorithm.rolls_back for case in scenario.variants):
            problems = check_rollback(scenario)
        if imports and not problems and build is not None:
            problems = scenarios.members.translation_problems(scenario.variants, build)
        for note in scenarios.missing_units(scenario) if imports and not problems else ():
            say(f"note: {note}")
    except ScenarioError as error:
        return error.problems, ""
    return problems, describe_extent(scenario)


def is_study(file: str) -> bool:
    """Whether a file has the key `scenario` of a study, or a name is of a study only."""
    from twin.scenario import read, scenario_paths

    path = Path(file)
    if path.suffix in (".yaml", ".yml") and path.is_file():
        with suppress(ScenarioError):
            return "scenario" in read(path, file, []).plain()
    return file in scenario_paths.scenarios("study") and file not in scenario_paths.scenarios()


def check_study(file: str) -> tuple[list[str], str]:
    """Return the problems of a study file and, if there are none, its extent."""
    from twin.cli.study import extent
    from twin.study import load_study

    try:
        return [], extent(load_study(file))
    except ScenarioError as error:
        return error.problems, ""


def check_rollback(scenario: ScenarioSpec) -> list[str]:
    """Return a problem for each member without rollback where the algorithm needs it."""
    from twin.run import resolve_catalogs, rollback_check

    catalogs = resolve_catalogs(scenario)
    problems = (problem for case in scenario.variants for problem in rollback_check(case, catalogs[case.variant]))
    return list(dict.fromkeys(problems))


def check_stability(file: str, overrides: tuple[str, ...]) -> list[str]:
    """Print whether the coupling of each variant is stable; return the problems."""
    from twin import clock
    from twin.run import check_stability, resolve_catalogs
    from twin.scenario import load_scenario

    scenario = load_scenario(file, overrides)
    catalogs = resolve_catalogs(scenario)
    problems = []
    for case in scenario.cases((), scenario.seeds[:1]):
        with show_elapsed(f"{file}: {case.variant}"):
            try:
                result = check_stability(case, catalogs[case.variant], Path("build"))
            except CouplingError as error:
                for problem in error.problems:
                    say(f"note: {file}: {case.variant}: {problem}")
                continue
        method = f"{case.algorithm} at {clock.text(case.step_ns)}"
        if result.is_stable:
            say(f"{file}: {case.variant}: {method} is stable")
            continue
        growth = result.growth
        remedy = (
            f"Use {' or '.join(result.stable_settings)}."
            if result.stable_settings
            else "No other step or algorithm tried is better."
        )
        problems.append(
            f"{file}: {case.variant}: {method} is unstable at t = {clock.text(result.at)}: a deviation grows "
            f"{growth.factor:.{4 if growth.factor > 1.0005 else 7}g} times in {growth.cycle * 1e3:g} ms, mostly {', '.join(growth.share[:3])}. {remedy}"
        )
        say(problems[-1])
    return problems


def notes(file: str) -> list[str]:
    """Return what an SSP leaves open and what is not read of it, and what a study is too short for."""
    from twin.scenario import ssp_reader

    if is_study(file):
        from twin.study import load_study, unreached_windows

        with suppress(ScenarioError):
            return unreached_windows(load_study(file))
    if not ssp_reader.is_package(Path(file)):
        return []
    with suppress(ScenarioError):
        return ssp_reader.notes(Path(file), file)
    return []


def remarks_of(file: str, overrides: tuple[str, ...]) -> list[str]:
    """Return the remarks on the values of a scenario without problems, as `twin run` prints them."""
    from twin.run import remarks_on_values, resolve_catalogs
    from twin.scenario import load_scenario

    if is_study(file):
        return []
    scenario = load_scenario(file, overrides)
    return remarks_on_values(scenario, resolve_catalogs(scenario))


def describe_extent(scenario: ScenarioSpec) -> str:
    """Return `3 variants, 3 seeds, 8 members, 12 connections`."""
    numbers = {
        "variant": len(scenario.variants),
        "seed": len(scenario.seeds),
        "member": max(len(case.members) for case in scenario.variants),
        "connection": max(len(case.connections) for case in scenario.variants),
    }
    return ", ".join(with_plural(number, word) for word, number in numbers.items())


def with_plural(number: int, word: str) -> str:
    """Return `1 seed`, `3 seeds`."""
    return f"{number} {word}" + ("" if number == 1 else "s")
