"""`twin export`: export a component, a part of a scenario or an estimator as one FMU, as C or as SSP."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from twin.cli import completion
from twin.cli.options import PLATFORMS, build_option, force_option, platform_option, refuse_existing, variant_option
from twin.cli.terminal import say
from twin.errors import TwinError

if TYPE_CHECKING:
    from twin.component import Component


SCENARIO_FILES = (".yaml", ".yml", ".ssp")


@dataclass(frozen=True, kw_only=True, slots=True)
class ExportOptions:
    """Options of `twin export`."""

    members: str
    group: str | None
    variant: str | None
    as_ssp: bool
    fmi: str | None
    platforms: tuple[str, ...]
    target: str
    sources: bool
    clock: bool
    line_directives: bool
    needs_python: bool
    output: Path | None
    force: bool
    build: Path

    @property
    def is_part(self) -> bool:
        """Whether members or a group of a scenario are exported."""
        return bool(self.members or self.group)

    @property
    def target_platforms(self) -> tuple[str, ...]:
        """The platforms, with `all` resolved."""
        return PLATFORMS if "all" in self.platforms else self.platforms

    def check(self) -> None:
        """Refuse options that exclude each other."""
        is_c = self.target == "c"
        if self.as_ssp:
            if self.is_part or is_c or self.sources or self.clock or self.line_directives:
                raise TwinError(
                    "--ssp exports a whole scenario. Drop --members, --group, --target, --sources, --clock and --line-directives."
                )
            return
        if is_c and self.sources:
            raise TwinError("--sources is an option of FMUs; --target c always writes the C. Drop one of them.")
        if is_c and self.platforms:
            raise TwinError(
                "--platform is an option of FMUs; --target c writes its libraries for all its targets. Drop it."
            )
        if is_c and self.clock:
            raise TwinError("--clock is an option of FMUs. Drop it, or --target c.")
        if self.needs_python and (is_c or self.sources or self.clock or self.platforms):
            raise TwinError(
                "--needs-python writes an FMU with Python. Drop --target c, --sources, --clock and --platform."
            )
        if not is_c and self.line_directives:
            raise TwinError("--line-directives needs --target c.")


@click.command(name="export")
@click.argument("what", metavar="NAME|SCENARIO", shell_complete=completion.components_and_scenarios)
@click.option("--members", default="", metavar="NAME,...", help="Members of a scenario to combine into one FMU.")
@click.option("--group", metavar="NAME", help="Group of a scenario (section `groups`) to combine into one FMU.")
@variant_option
@click.option("--ssp", "as_ssp", is_flag=True, help="Write the whole scenario as an SSP for other tools.")
@click.option("--fmi", type=click.Choice(("2.0", "3.0")), help="FMI version.  [default: 3.0; with --ssp: 2.0]")
@platform_option
@click.option(
    "--target",
    type=click.Choice(("fmu", "c")),
    default="fmu",
    show_default=True,
    help="FMU, or C: source, header and static libraries for Linux, Cortex-M7 and Cortex-A53.",
)
@click.option("--sources", is_flag=True, help="Include the C sources in the FMU.")
@click.option("--clock", is_flag=True, help="Offer the sample period as a clock, and Scheduled Execution (FMI 3.0).")
@click.option("--line-directives", is_flag=True, help="Add #line to the C, so that a debugger shows the Python source.")
@click.option("--needs-python", is_flag=True, help="Write an FMU of a Python-side component; it needs Python and twin.")
@click.option(
    "--output",
    "-o",
    type=click.Path(path_type=Path),
    metavar="PATH",
    help="File, or folder for C.  [default: NAME.fmu; NAME]",
)
@force_option
@build_option
def command(what: str, **options: Any) -> None:
    """Export a component (name or module:Class) or a part of a scenario as an FMU that contains native code only.

    Of a follow file (twin follow) it is the estimator: the filter with the model inside.

    Python-side components, e.g. those with pymunk, can only become FMUs that need Python, twin and PythonFMU: --needs-python.

    \b
    twin export sheath --platform all -o sheath.fmu
    twin export pi_control --sources -o pi_control.fmu
    twin export pi_control --target c -o firmware
    twin export heart_wall_force --variant PI+FF --members estimate,controller
    twin export heart_wall_force --group plant --fmi 2.0 -o plant.fmu
    twin export sheath_follow.yaml -o estimator.fmu
    twin export heart_wall_force --variant PI --ssp -o force.ssp
    """
    export_options = ExportOptions(**options)
    export_options.check()
    if export_options.as_ssp:
        write_ssp(what, export_options)
        return
    cls = component(what, export_options)
    if export_options.target == "c":
        write_c(cls, export_options)
    else:
        write_fmu(cls, export_options)


def write_fmu(cls: type[Component], options: ExportOptions) -> None:
    """Write a component as an FMU."""
    from twin import compiler

    fmi = options.fmi or "3.0"
    path = options.output or Path(f"{compiler.model_name(cls)}.fmu")
    refuse_existing(path, options.force)
    begin = time.perf_counter()
    from twin.fmi import exporter, pythonfmu_export

    if options.needs_python:
        pythonfmu_export.export(cls, fmi, path)
        say(f"{path}: FMI {fmi}, {path.stat().st_size / 1000:.0f} kB. It needs Python with twin wherever it runs.")
        return
    exporter.export(
        cls, fmi, path, options.build, options.target_platforms, sources=options.sources, has_clock=options.clock
    )
    say(f"{path}: FMI {fmi}, {path.stat().st_size / 1000:.0f} kB, {time.perf_counter() - begin:.1f} s")


def write_c(cls: type[Component], options: ExportOptions) -> None:
    """Write the C of a component with its libraries."""
    from twin import compiler
    from twin.compiler import library

    name, targets = compiler.model_name(cls), tuple(library.TRIPLES)
    folder = options.output or Path(name)
    paths = library.export(
        cls, name, folder, options.build, targets, options.force, line_directives=options.line_directives
    )
    for path in paths:
        say(f"{path}: {path.stat().st_size / 1000:.0f} kB")


def write_ssp(what: str, options: ExportOptions) -> None:
    """Write a scenario as an SSP; print what other tools do not support of it."""
    from twin.follow import is_follow_file
    from twin.scenario import load_scenario, pack, scenario_paths, ssp_reader

    if is_follow_file(what):
        raise TwinError(f"{what} is a follow file, and its estimator is one component. Drop --ssp.")
    if not what.endswith(SCENARIO_FILES) and what not in scenario_paths.scenarios():
        raise TwinError(f"{what}: --ssp needs a scenario, e.g. SCENARIO.yaml.")
    path = options.output or Path(Path(what).with_suffix(".ssp").name)
    refuse_existing(path, options.force)
    begin = time.perf_counter()
    ssp_reader.BUILD.set(options.build)
    notes = pack(
        load_scenario(what),
        path,
        options.build,
        variant=options.variant or "",
        version=options.fmi or "2.0",
        platforms=options.target_platforms,
        needs_python=options.needs_python,
    )
    for note in notes:
        say(f"note: {note}", err=True)
    say(f"{path}: {path.stat().st_size / 1000:.0f} kB, {time.perf_counter() - begin:.1f} s")


def component(what: str, options: ExportOptions) -> type[Component]:
    """Return the component to export."""
    from twin.component import catalog
    from twin.scenario import load_scenario, part, scenario_paths

    of_scenario = bool(options.is_part or options.variant)
    if not what.endswith(SCENARIO_FILES) and not (of_scenario and what in scenario_paths.scenarios()):
        if of_scenario:
            raise TwinError(f"{what}: --members, --group and --variant need a scenario, e.g. SCENARIO.yaml.")
        return catalog.component(what)
    from twin.follow import estimator, is_follow_file

    if is_follow_file(what):
        if of_scenario:
            raise TwinError(
                f"{what} is a follow file. Drop --members, --group and --variant: the file names its model."
            )
        exported = estimator(what)
        for note in exported.notes:
            say(f"note: {note}", err=True)
        return exported.component

    members = [name.strip() for name in options.members.split(",") if name.strip()]
    return part(load_scenario(what), members, options.group, options.variant)
