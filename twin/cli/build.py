"""`twin build`: components become FMUs in `build/<FMI version>/`; what has not changed is left alone."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import click

from twin.cli.terminal import say
from twin.component import catalog
from twin.errors import TwinError

VERSIONS = {"2.0": ("2.0",), "3.0": ("3.0",), "all": ("2.0", "3.0")}


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one FMU; `problem` says why there is none."""

    path: Path | None = None
    size: int = 0
    seconds: float = 0.0
    is_new: bool = False
    problem: str = ""


def build_all(name: str, versions: tuple[str, ...], folder: Path, platforms: tuple[str, ...]) -> list[Outcome]:
    """Build a component's FMUs; the second one finds the first one's C and object file."""
    return [build_one(name, version, folder, platforms) for version in versions]


def build_one(name: str, version: str, folder: Path, platforms: tuple[str, ...]) -> Outcome:
    """Build one FMU; every failure of the component comes back as a text."""
    from twin.component import PythonComponent
    from twin.fmi import exporter

    begin = time.perf_counter()
    try:
        cls = catalog.component(name)
        if issubclass(cls, PythonComponent):
            return Outcome()
        wanted = tuple(exporter.TARGETS) if "all" in platforms else platforms
        is_new = not exporter.is_built(cls, folder, version, wanted)
        path = exporter.build(cls, version, folder, wanted)
    except TwinError as error:
        return Outcome(problem=str(error))
    except Exception as error:  # a component's module may fail in any way; the others are built all the same
        return Outcome(problem=f"{name}: {type(error).__name__}: {error}")
    return Outcome(path, path.stat().st_size, time.perf_counter() - begin, is_new)


def report(name: str, version: str, outcome: Outcome) -> None:
    """Print one line for one FMU."""
    label = f"{name:24} FMI {version}  "
    if outcome.problem:
        say(f"{label}failed", err=True)
    elif outcome.path is None:
        say(f"{label}Python-side, never an FMU")
    else:
        state = "built" if outcome.is_new else "unchanged"
        say(f"{label}{state:9} {outcome.seconds:6.2f} s {outcome.size / 1000:6.1f} kB  {outcome.path}")


@click.command("build")
@click.argument("names", nargs=-1)
@click.option("--fmi", "version", type=click.Choice(list(VERSIONS)), default="all", show_default=True)
@click.option("--build", "folder", type=click.Path(path_type=Path), default=Path("build"), show_default=True)
@click.option(
    "--platform", "platforms", multiple=True, help="x86_64-windows and the like, or all; this machine if none."
)
def command(names: tuple[str, ...], version: str, folder: Path, platforms: tuple[str, ...]) -> None:
    """Build components into FMUs: NAMES are folders of fmus/ or `module:Class`; all of fmus/ if none are given.

    Their C, which people read, is kept in build/c/.
    """
    from twin import compiler

    try:
        wanted = list(names) or catalog.names()
    except TwinError as error:
        raise click.ClickException(str(error)) from None
    problems: list[str] = []
    tasks = (partial(build_all, name, VERSIONS[version], folder, platforms) for name in wanted)
    for name, outcomes in zip(wanted, compiler.in_order(tasks), strict=True):
        for one, outcome in zip(VERSIONS[version], outcomes, strict=True):
            report(name, one, outcome)
            if outcome.problem and outcome.problem not in problems:
                problems.append(outcome.problem)
    for line in "\n".join(problems).split("\n") if problems else ():
        say(line, err=True)
    if problems:
        sys.exit(1)
