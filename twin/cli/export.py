"""`twin export`: a component, or any part of a scenario's system, as one FMU."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli import completion
from twin.cli.terminal import say
from twin.errors import TwinError

if TYPE_CHECKING:
    from twin.component import Component

PLATFORMS = ("x86_64-linux", "aarch64-linux", "x86_64-windows", "x86_64-darwin", "aarch64-darwin")


@click.command(name="export")
@click.argument("what", metavar="NAME|SCENARIO", shell_complete=completion.anything)
@click.option("--members", help="Members of the scenario to put into one FMU, separated by commas.")
@click.option("--group", "named", help="Or a group that the scenario names under `groups`.")
@click.option("--variant", help="Variant of the scenario; the first one if not given.")
@click.option("--ssp", "as_ssp", is_flag=True, help="All of the scenario as an SSP: a system that other tools run.")
@click.option("--fmi", type=click.Choice(("2.0", "3.0")), help="FMI version.  [default: 3.0; 2.0 with --ssp]")
@click.option(
    "--platform",
    "platforms",
    multiple=True,
    type=click.Choice((*PLATFORMS, "all")),
    metavar="PLATFORM",
    help=f"{', '.join(PLATFORMS)} or all; may be repeated. This machine's if not given.",
)
@click.option(
    "--target",
    type=click.Choice(("fmu", "c")),
    default="fmu",
    show_default=True,
    help="An FMU, or C: source, header, and static libraries for Linux, Cortex-M7 and Cortex-A53.",
)
@click.option("--sources", is_flag=True, help="Put the C into the FMU, for importers that compile it for their target.")
@click.option("--line-directives", is_flag=True, help="C with #line, so that a debugger shows the Python.")
@click.option("--needs-python", is_flag=True, help="Of a Python-side component: an FMU that needs Python and twin.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="File, or folder for C [NAME.fmu, NAME].")
@click.option("--force", is_flag=True, help="Replace the file if it is there.")
@click.option(
    "--build",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("build"),
    show_default=True,
    help="Folder for compiled objects.",
)
def command(
    what: str,
    members: str | None,
    named: str | None,
    variant: str | None,
    as_ssp: bool,
    fmi: str | None,
    platforms: tuple[str, ...],
    target: str,
    sources: bool,
    line_directives: bool,
    needs_python: bool,
    output: Path | None,
    force: bool,
    build: Path,
) -> None:
    """Write a component of fmus/, a module:Class, or part of a scenario as an FMU without Python inside.

    Python-side components, such as pymunk's, can only be FMUs that need Python, twin and PythonFMU: --needs-python.

    \b
    twin export sheath --platform all -o sheath.fmu
    twin export pi_control --sources -o pi_control.fmu
    twin export pi_control --target c -o firmware
    twin export heart_wall_force --variant PI+FF --members estimate,controller
    twin export heart_wall_force --group plant --fmi 2.0 -o plant.fmu
    twin export heart_wall_force --variant PI --ssp -o force.ssp
    """
    from twin import compiler

    part, is_c = bool(members or named), target == "c"
    refuse_together(as_ssp, part, is_c, sources, needs_python, bool(platforms), line_directives)
    if as_ssp:
        platforms = tuple(PLATFORMS) if "all" in platforms else platforms
        write_ssp(what, variant or "", fmi or "2.0", platforms, needs_python, output, force, build)
        return
    fmi = fmi or "3.0"
    cls = component(what, members, named, variant)
    if is_c:
        write_c(cls, output, build, force, line_directives)
        return
    path = output or Path(f"{compiler.model_name(cls)}.fmu")
    if path.exists() and not force:
        raise TwinError(f"{path} is there already. Give --force to replace it, or another name with -o.")
    begin = time.perf_counter()
    from twin.fmi import exporter, pythonfmu_export

    if needs_python:
        pythonfmu_export.export(cls, fmi, path)
        say(f"{path}: FMI {fmi}, {path.stat().st_size / 1000:.0f} kB. It needs Python with twin wherever it runs.")
        return
    exporter.export(cls, fmi, path, build, tuple(PLATFORMS) if "all" in platforms else platforms, sources=sources)
    say(f"{path}: FMI {fmi}, {path.stat().st_size / 1000:.0f} kB, {time.perf_counter() - begin:.1f} s")


def refuse_together(
    as_ssp: bool, part: bool, is_c: bool, sources: bool, needs_python: bool, platforms: bool, line_directives: bool
) -> None:
    """Options that mean nothing together."""
    if as_ssp:
        if part or is_c or sources or line_directives:
            raise TwinError("--ssp is for all of a scenario: drop --members, --group, --target and --sources.")
        return
    if is_c and sources:
        raise TwinError("--sources is for FMUs: --target c writes the C anyway. Drop one of them.")
    if needs_python and (is_c or sources or platforms):
        raise TwinError("--needs-python makes an FMU of Python: drop --target c, --sources and --platform.")
    if not is_c and line_directives:
        raise TwinError("--line-directives is for C. Add --target c.")


def write_c(cls: type[Component], output: Path | None, build: Path, force: bool, line_directives: bool) -> None:
    """The C of a component with its libraries."""
    from twin import compiler
    from twin.compiler import library

    name, targets = compiler.model_name(cls), tuple(library.TRIPLES)
    paths = library.export(cls, name, output or Path(name), build, targets, force, line_directives=line_directives)
    for path in paths:
        say(f"{path}: {path.stat().st_size / 1000:.0f} kB")


def write_ssp(
    what: str,
    variant: str,
    fmi: str,
    platforms: tuple[str, ...],
    needs_python: bool,
    output: Path | None,
    force: bool,
    build: Path,
) -> None:
    """Write a scenario as an SSP, and say what others will not do with it."""
    from twin.scenario import load_scenario, pack, scenario_paths, ssp_reader

    if not what.endswith((".yaml", ".yml", ".ssp")) and what not in scenario_paths.scenarios():
        raise TwinError(f"{what}: --ssp writes a scenario. Give SCENARIO.yaml.")
    path = output or Path(Path(what).with_suffix(".ssp").name)
    if path.exists() and not force:
        raise TwinError(f"{path} is there already. Give --force to replace it, or another name with -o.")
    begin = time.perf_counter()
    ssp_reader.BUILD.set(build)
    notes = pack(
        load_scenario(what), path, build, variant=variant, version=fmi, platforms=platforms, needs_python=needs_python
    )
    for note in notes:
        say(f"note: {note}", err=True)
    say(f"{path}: {path.stat().st_size / 1000:.0f} kB, {time.perf_counter() - begin:.1f} s")


def component(what: str, members: str | None, named: str | None, variant: str | None) -> type[Component]:
    """The component to export."""
    from twin.component import catalog
    from twin.scenario import load_scenario, part, scenario_paths

    of_scenario = bool(members or named or variant)
    if not what.endswith((".yaml", ".yml", ".ssp")) and not (of_scenario and what in scenario_paths.scenarios()):
        if of_scenario:
            raise TwinError(f"{what}: --members, --group and --variant belong to a scenario. Give SCENARIO.yaml.")
        return catalog.component(what)

    chosen = [name.strip() for name in (members or "").split(",") if name.strip()]
    return part(load_scenario(what), chosen, named, variant)
