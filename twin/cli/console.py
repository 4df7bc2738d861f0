"""`twin console`: operate a scenario live in the browser."""

from __future__ import annotations

from pathlib import Path

import click

from twin.cli import completion
from twin.cli.options import (
    arm_option,
    backend_option,
    build_option,
    hardware_option,
    no_open_option,
    overrides_option,
    port_option,
    runs_option,
    seed_option,
    variant_option,
)
from twin.cli.terminal import say
from twin.errors import TwinError
from twin.installed import import_optional

COMMISSIONING = "/bench"  # page of the drives, provided by their package


@click.command(name="console")
@click.argument(
    "file",
    type=click.Path(path_type=Path),
    metavar="[SCENARIO|FMU]",
    required=False,
    shell_complete=completion.scenarios,
)
@overrides_option
@variant_option
@seed_option
@backend_option
@runs_option
@build_option
@hardware_option
@arm_option
@click.option(
    "--rate",
    type=click.FloatRange(0.1, 10.0),
    default=1.0,
    show_default=True,
    metavar="FACTOR",
    help="Speed relative to real time; at most 1 for scenarios with controls.",
)
@port_option(1024)
@no_open_option
def command(
    file: Path | None,
    overrides: tuple[str, ...],
    variant: str | None,
    seed: int | None,
    backend: str,
    runs: Path,
    build: Path,
    hardware_file: Path | None,
    arm: bool,
    rate: float,
    port: int | None,
    no_open: bool,
) -> None:
    """Run a scenario, or an FMU alone, live on a page of the browser: watch, operate, stop.

    Without SCENARIO the page lists them. The printed URL contains a token: every browser that has it may watch, the first
    one operates. Only this machine is served.

    Motion lasts while a control is held. STOP stops drives or a rig under controls, End ends any other simulation,
    and Ctrl-C in the terminal does both; Esc stops drives. The run's folder records it; `operated.yaml` there repeats it.

    \b
    twin console teleoperation
    twin console injection_sequence --variant normal --rate 2
    twin console my.fmu                             one FMU: parameters, outputs
    twin console --hardware bench.yaml              commissioning, no scenario
    twin console racs --hardware bench.yaml         drives, simulated or real
    twin console racs --hardware can0.yaml --arm    real drives may move
    """
    from twin import web
    from twin.scenario import lint, load_scenario, scenario_paths

    import_optional("nicegui", "console", "twin console")
    if arm and hardware_file is None:
        raise click.UsageError("--arm needs --hardware FILE.")
    path = scenario_paths.located(file) if file is not None else None
    if path is not None and not path.is_file():
        raise TwinError(f"{path}: does not exist. Check the path, or see `twin list scenarios`.")
    if path is not None and variant:
        lint(path, imports=False)[0].cases([variant])  # before a page is served
    if path is not None and overrides:
        from twin.run import resolve_catalogs

        resolve_catalogs(load_scenario(path, overrides))  # raises an error for an unknown name, as `twin run` does
    if path is None and (variant or seed is not None or overrides):
        raise click.UsageError("--variant, --seed and --set need a SCENARIO.")

    from twin.console import Host, register

    host = Host(overrides=overrides, hardware=hardware_file, arm=arm, rate=rate, runs=runs, build=build)
    host.backend = backend
    if path is not None:
        host.begin(path, variant, seed)
    web.Site(
        "Catheter twin",
        lambda app: register(app, host),
        start="/" if path is not None or hardware_file is None else COMMISSIONING,
        stop=host.stop,
        announce=say,
        port=port,
        open_browser=not no_open,
        closing_message="The console is closed.",
    ).serve()
    host.close()
    if host.live is not None and host.live.state.folder:
        say(f"results: {host.live.state.folder}")
