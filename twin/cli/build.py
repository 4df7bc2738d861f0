"""`twin build`: build components as FMUs in `build/FMI-VERSION/`; unchanged FMUs are skipped."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import click

from twin.cli.options import build_option, platform_option
from twin.cli.progress import ProgressBar
from twin.cli.terminal import say
from twin.component import catalog
from twin.errors import TwinError
from twin.files import write_atomically

VERSIONS = {"2.0": ("2.0",), "3.0": ("3.0",), "all": ("2.0", "3.0")}


@dataclass(frozen=True, slots=True)
class BuildResult:
    """Result of building one FMU; `problem` is the error, if any."""

    path: Path | None = None
    size: int = 0
    seconds: float = 0.0
    is_new: bool = False
    problem: str = ""


def build_versions(name: str, versions: tuple[str, ...], folder: Path, platforms: tuple[str, ...]) -> list[BuildResult]:
    """Build a component for several FMI versions, which share C and object file."""
    return [build_version(name, version, folder, platforms) for version in versions]


def build_version(name: str, version: str, folder: Path, platforms: tuple[str, ...]) -> BuildResult:
    """Build one FMU; return any failure of the component as a text."""
    from twin import compiler
    from twin.component import PythonComponent
    from twin.fmi import exporter
    from twin.store import Store

    begin = time.perf_counter()
    try:
        cls = catalog.component(name)
        if issubclass(cls, PythonComponent):
            return BuildResult()
        targets = tuple(compiler.PLATFORMS) if "all" in platforms else platforms
        is_new = not exporter.is_built(cls, folder, version, targets)
        path = folder / version / f"{compiler.model_name(cls)}.fmu"
        with Store(folder).shared():
            content = exporter.build(cls, version, folder, targets).read_bytes()
        if not path.is_file() or path.read_bytes() != content:
            write_atomically(path, content)
    except TwinError as error:
        return BuildResult(problem=str(error))
    except Exception as error:  # a component's module may fail in any way; the other components are built
        return BuildResult(problem=f"{name}: {type(error).__name__}: {error}")
    return BuildResult(path, path.stat().st_size, time.perf_counter() - begin, is_new)


def report(name: str, version: str, result: BuildResult) -> None:
    """Print one line about an FMU."""
    label = f"{name:24} FMI {version}  "
    if result.problem:
        say(f"{label}failed", err=True)
    elif result.path is None:
        say(f"{label}Python-side component, not an FMU")
    else:
        state = "built" if result.is_new else "unchanged"
        say(f"{label}{state:9} {result.seconds:6.2f} s {result.size / 1000:6.1f} kB  {result.path}")


@click.command("build")
@click.argument("names", nargs=-1)
@click.option(
    "--fmi", "version", type=click.Choice(list(VERSIONS)), default="all", show_default=True, help="FMI version."
)
@build_option
@platform_option
def command(names: tuple[str, ...], version: str, build: Path, platforms: tuple[str, ...]) -> None:
    """Build components as FMUs.

    NAMES are folders of fmus/ or `module:Class`; without NAMES all of fmus/ is built. The generated C is in the cache (`twin cache path`).
    """
    from twin import compiler

    try:
        components = list(names) or catalog.names()
    except TwinError as error:
        raise click.ClickException(str(error)) from None
    problems: list[str] = []
    tasks = (partial(build_versions, name, VERSIONS[version], build, platforms) for name in components)
    # lines on stdout pass through the bar's console, which is stderr: only where both are one terminal
    with ProgressBar("building", enabled=sys.stdout.isatty()) as bar:
        for number, results in enumerate(compiler.in_order(tasks), 1):
            for fmi, result in zip(VERSIONS[version], results, strict=True):
                report(components[number - 1], fmi, result)
                if result.problem and result.problem not in problems:
                    problems.append(result.problem)
            bar.show(f"building ({number} of {len(components)})", number / len(components))
    for line in "\n".join(problems).split("\n") if problems else ():
        say(line, err=True)
    if problems:
        sys.exit(1)
