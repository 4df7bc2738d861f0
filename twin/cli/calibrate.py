"""`twin calibrate`: readings of a bench, as CSV files, to the parameters of a component."""

from __future__ import annotations

import math
from pathlib import Path

import click

from twin.cli.terminal import say
from twin.errors import TwinError


@click.command(name="calibrate")
@click.argument("name")
@click.argument("tables", nargs=-1, metavar="[TABLE=FILE.csv]...")
@click.option("-o", "--output", type=click.Path(dir_okay=False, path_type=Path), help="File to write [NAME.yaml].")
@click.option("--force", is_flag=True, help="Replace the file if it is there.")
def command(name: str, tables: tuple[str, ...], output: Path | None, force: bool) -> None:
    """Fit a component's parameters to recorded readings and write them as YAML. Without tables: list them.

    \b
    twin calibrate coordinate_feedforward
    twin calibrate coordinate_feedforward linear=moves.csv \\
        deflection=pulls.csv -o my_catheter.yaml
    """
    from twin.component import catalog
    from twin.results import calibration, write_text

    cls = catalog.component(name)
    if not tables:
        say(f"{name} is calibrated from these tables; give some of them as TABLE=FILE.csv:")
        for table, columns in calibration.calibration_module(cls, name).TABLES.items():
            say()
            say(table)
            for column, meaning in columns.items():
                say(f"  {column:<14}{meaning}")
        return
    files = {}
    for one in tables:
        table, equals, path = one.partition("=")
        if not equals or not path:
            raise TwinError(f"{one}: expected TABLE=FILE.csv, such as linear=moves.csv.")
        if table in files:
            raise TwinError(f"{one}: the table {table} is given twice. Put its readings into one file.")
        files[table] = Path(path)
    target = output or Path(f"{name}.yaml")
    if target.exists() and not force:
        raise TwinError(f"{target} is there already. Give --force to replace it, or another name with -o.")
    parameters, fits = calibration.calibrate(cls, name, files)
    for label, fit in fits.items():
        values = ", ".join(f"{value:.4g}" for value in fit.coefficients)
        quality = "" if math.isnan(fit.r_squared) else f"R2 {fit.r_squared:.4f}, "
        say(f"{label}: {values}; {quality}residual {fit.residual:.3g}, {len(fit.used)} readings")
    write_text(target, calibration.to_yaml(name, files, parameters, fits))
    say(f"{target}: {len(parameters)} parameters. Put them under `parameters:` of the member.")
