"""`twin calibrate`: calibrate a component from bench measurements (CSV)."""

from __future__ import annotations

import math
from pathlib import Path

import click

from twin.cli.options import force_option, refuse_existing
from twin.cli.terminal import say
from twin.errors import TwinError


@click.command(name="calibrate")
@click.argument("name")
@click.argument("tables", nargs=-1, metavar="[TABLE=FILE.csv]...")
@click.option(
    "--output",
    "-o",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.yaml",
    help="Parameter file to write.  [default: NAME.yaml]",
)
@force_option
def command(name: str, tables: tuple[str, ...], output: Path | None, force: bool) -> None:
    """Fit the parameters of component NAME to bench measurements and write them as YAML.

    Each TABLE is a set of measurements in a CSV file. Without tables, list those of the component with their columns.

    \b
    twin calibrate coordinate_feedforward
    twin calibrate coordinate_feedforward linear=moves.csv \\
        deflection=pulls.csv -o my_catheter.yaml
    """
    from twin.component import catalog
    from twin.results import calibration, write_text

    cls = catalog.component(name)
    if not tables:
        say(f"{name} is calibrated from these tables; name one or more as TABLE=FILE.csv:")
        for table, columns in calibration.calibration_module(cls, name).TABLES.items():
            say()
            say(table)
            for column, meaning in columns.items():
                say(f"  {column:<14}{meaning}")
        return
    files = {}
    for argument in tables:
        table, equals, path = argument.partition("=")
        if not equals or not path:
            raise TwinError(f"{argument}: expected TABLE=FILE.csv, such as linear=moves.csv.")
        if table in files:
            raise TwinError(f"{argument}: table {table} is given twice. Merge its measurements into one file.")
        files[table] = Path(path)
    target = output or Path(f"{name}.yaml")
    refuse_existing(target, force)
    parameters, fits = calibration.calibrate(cls, name, files)
    for label, fit in fits.items():
        values = ", ".join(f"{value:.4g}" for value in fit.coefficients)
        quality = "" if math.isnan(fit.r_squared) else f"R2 {fit.r_squared:.4f}, "
        say(f"{label}: {values}; {quality}residual {fit.residual:.3g}, {len(fit.used)} measurements")
    write_text(target, calibration.to_yaml(name, files, parameters, fits))
    say(f"{target}: {len(parameters)} parameters. Copy them to `parameters:` of the member.")
