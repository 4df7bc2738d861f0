"""`twin console`: a scenario in the browser, live and in one's hands."""

from __future__ import annotations

from pathlib import Path

import click

from twin.cli import completion
from twin.cli.terminal import say
from twin.errors import TwinError

COMMISSIONING = "/bench"  # the page of the drives, of the package that knows about them


@click.command(name="console")
@click.argument(
    "file", type=click.Path(path_type=Path), metavar="[SCENARIO]", required=False, shell_complete=completion.scenarios
)
@click.option("--variant", metavar="NAME", help="Of the scenario: this variant. [default: the first]")
@click.option("--seed", type=int, metavar="N", help="Of the scenario: this seed. [default: the first]")
@click.option(
    "--set", "overrides", multiple=True, metavar="PATH=VALUE", help='Another value, such as heart.rate="1.4 Hz".'
)
@click.option("--rate", type=click.FloatRange(0.1, 10.0), default=1.0, show_default=True, help="Times real time.")
@click.option("--hardware", "hardware_file", type=click.Path(path_type=Path), metavar="FILE",
              help="Drives on a bus, simulated or real, for members of the scenario.")  # fmt: skip
@click.option("--arm", is_flag=True, help="Real drives may move. A page cannot say this.")
@click.option("--port", type=click.IntRange(1024, 65535), metavar="N", help="[default: a free one from 8300 on]")
@click.option("--no-open", is_flag=True, help="Print the address, open no browser.")
@click.option("--as", "form", type=click.Choice(("fmu", "compiled", "interpreted")), default="fmu", show_default=True,
              help="How the project's own components run.")  # fmt: skip
@click.option("--runs", type=click.Path(file_okay=False, path_type=Path), default=Path("runs"), show_default=True,
              help="Folder of results.")  # fmt: skip
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), show_default=True,
              help="Folder of FMUs and compiled code.")  # fmt: skip
def command(
    file: Path | None,
    variant: str | None,
    seed: int | None,
    overrides: tuple[str, ...],
    rate: float,
    hardware_file: Path | None,
    arm: bool,
    port: int | None,
    no_open: bool,
    form: str,
    runs: Path,
    build: Path,
) -> None:
    """Run a scenario live on a page of the browser: watch, operate, stop.

    Without SCENARIO the page lists them. The address that is printed has a token:
    whoever has it may watch, the first operates. Only this machine is served.
    Motion lasts while it is held; Esc or STOP ends everything, Ctrl-C here too.
    What was done is kept in the run's folder, and `operated.yaml` there does it again.

    \b
    twin console teleoperation
    twin console injection_sequence --variant normal --rate 2
    twin console --hardware bench.yaml              commissioning, no scenario
    twin console racs --hardware bench.yaml         drives, simulated or real
    twin console racs --hardware can0.yaml --arm    real ones may move
    """
    from twin import web
    from twin.scenario import scenario_paths

    web.needed("twin console")
    if arm and hardware_file is None:
        raise click.UsageError("--arm: there is no hardware to arm. Add --hardware FILE.")
    path = scenario_paths.located(file) if file is not None else None
    if path is not None and not path.is_file():
        raise TwinError(f"{path}: is not there. Check the path, or see `twin list scenarios`.")
    if path is None and (variant or seed is not None or overrides):
        raise click.UsageError("--variant, --seed and --set are of a scenario. Name one.")

    from twin.console import Host, register

    console = Host(overrides=overrides, hardware=hardware_file, arm=arm, rate=rate, runs=runs, build=build, form=form)
    if path is not None:
        console.begin(path, variant, seed)
    web.Site(
        "Catheter twin",
        lambda app: register(app, console),
        start="/" if path is not None or hardware_file is None else COMMISSIONING,
        stop=console.stop,
        said=say,
        port=port,
        opened=not no_open,
        over="The console is closed.",
    ).serve()
    console.close()
    if console.live is not None and console.live.state.folder:
        say(f"kept: {console.live.state.folder}")
