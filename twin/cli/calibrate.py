"""`twin calibrate`: calibrate a component from bench measurements (CSV)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli.options import force_option, refuse_existing
from twin.cli.terminal import say, show_table, show_text
from twin.errors import ScenarioError, TwinError

if TYPE_CHECKING:
    from twin.results import calibration


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
@click.option(
    "--columns",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.yaml",
    help="Names and units of the columns in your files.",
)
@force_option
def command(name: str, tables: tuple[str, ...], output: Path | None, columns: Path | None, force: bool) -> None:
    """Fit the parameters of component NAME to bench measurements and write them as YAML, and a picture as SVG.

    Each TABLE is a set of measurements in a CSV file. Without tables, list those of the component with their columns.
    A unit may stand in the header, `handle [in]` or `handle (in)`; else --columns names a file such as `columns: {linear: {handle_mm: {name: Handle, unit: cm}}}`.

    \b
    twin calibrate coordinate_feedforward
    twin calibrate coordinate_feedforward linear=moves.csv \\
        deflection=pulls.csv -o my_catheter.yaml
    """
    from twin.component import catalog
    from twin.results import calibration, calibration_report, write_text

    cls = catalog.component(name)
    if not tables:
        say(f"{name} is calibrated from these tables; name one or more as TABLE=FILE.csv:")
        for table, meanings in calibration.calibration_module(cls, name).TABLES.items():
            say()
            say(table)
            for column, meaning in meanings.items():
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
    picture = target.with_suffix(".svg")
    for file in (target, picture):
        refuse_existing(file, force)
    result = calibration.calibrate(cls, name, files, read_aliases(columns) if columns else {})
    write_text(target, calibration_report.to_yaml(name, files, result))
    write_text(picture, calibration_report.to_svg(result))
    show(result)
    for text in calibration_report.warnings(result):
        say(text, err=True)
    say(f"{target}: {len(result.parameters)} parameters. Copy them to `parameters:` of the member.")
    say(f"{picture}: measured over fitted values.")


def show(result: calibration.Calibration) -> None:
    """Print how well each form fits, and the parameters with their standard errors."""
    from twin.results import calibration_report

    titles = ["fit", "error", "RMSE\n[mm]", "range\n[mm]", "noise\n[mm]", "rows\nused", "R2"]
    show_table(titles, [(name, *calibration_report.fit_cells(fit)) for name, fit in result.fits.items()], 2)
    show_text(calibration_report.TERMS)
    show_table(["parameter", "value", "standard error"], calibration_report.parameter_rows(result), 1)


def read_aliases(path: Path) -> dict[str, dict[str, tuple[str, str]]]:
    """Read the names and units that files have for the columns of tables; ScenarioError lists all problems."""
    from twin.identify import ColumnsKeys
    from twin.scenario import read, validate

    problems: list[str] = []
    keys, _, more = validate(read(path, str(path), problems), ColumnsKeys)
    if problems + more:
        raise ScenarioError(problems + more)
    return {
        table: {column: (alias.name, alias.unit) for column, alias in columns.items()}
        for table, columns in keys.columns.items()
    }
