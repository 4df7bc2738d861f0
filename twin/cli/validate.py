"""`twin validate`: predict measured data with frozen parameters and compare."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli.options import build_option, force_option, no_report_option, refuse_existing, restart_options
from twin.cli.progress import ProgressBar
from twin.cli.terminal import open_console, say, show_table

if TYPE_CHECKING:
    from twin.validation import FrozenSet, Prediction


@click.command(name="validate")
@click.argument("name", metavar="NAME")
@click.option(
    "--data",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Folder of the measured data.  [default: TWIN_VALIDATION_DATA]",
)
@click.option(
    "--files",
    "patterns",
    multiple=True,
    metavar="PATTERN",
    help="Files relative to the folder, such as 'robot/*.csv'. Repeatable.  [default: all]",
)
@click.option("--window", type=click.IntRange(0), metavar="N", help="Rows of a roll-out; 0: whole files.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
@click.option("--fit", "is_fit", is_flag=True, help="Fit to the training files, cross-validate, and freeze.")
@click.option("--only", multiple=True, metavar="SET", help="With --fit: fit this set only. Repeatable.")
@restart_options
@click.option(
    "--output",
    "-o",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.html",
    help="Report to write.  [default: NAME_validation.html; none with --json]",
)
@no_report_option
@force_option
@build_option
def command(
    name: str,
    data: Path | None,
    patterns: tuple[str, ...],
    window: int | None,
    as_json: bool,
    is_fit: bool,
    only: tuple[str, ...],
    starts: int,
    seed: int,
    output: Path | None,
    no_report: bool,
    force: bool,
    build: Path,
) -> None:
    """Predict measured data with the frozen parameters of validation/NAME.yaml, and compare.

    With --fit, fit to the training files first, cross-validate, and write NAME.parameters.yaml. Without it nothing is
    fitted.

    \b
    twin validate tendon_robot --data FOLDER
    twin validate tendon_robot --data FOLDER --files '*/sine/*.mat' --json
    twin validate tendon_robot --data FOLDER --fit
    """
    from twin.results import write_text
    from twin.scenario import scenario_paths
    from twin.validation import fit_and_freeze, frozen_path, frozen_text, html, load, validate

    path = scenario_paths.located(name, "validation")
    page = output or (None if no_report or as_json or is_fit else Path(f"{path.stem}_validation.html"))
    for target in ([frozen_path(path)] if is_fit else []) + ([page] if page else []):
        refuse_existing(target, force)
    own = load(path, data, build)
    refused: dict[str, str] = {}
    with ProgressBar(own.title) as bar:
        if is_fit:
            frozen = fit_and_freeze(own, only, starts=starts, seed=seed, progress=bar.show)
        else:
            predictions = validate(own, patterns, window, bar.show, refused)
    if is_fit:
        write_text(frozen_path(path), frozen_text(own.title, frozen))
        show_fit(own.title, frozen)
        say(f"{frozen_path(path)}: frozen.")
        return
    if page:
        write_text(page, html(own, predictions))
    if as_json:
        rows = [row for prediction in predictions for row in prediction.rows]
        click.echo(json.dumps({"runs": rows, "refused": refused}, indent=1, allow_nan=False))
    else:
        show(own.title, predictions)
        if page:
            say(str(page))
    for text in refused.values():
        say(f"error: {text} The file was left out.", err=True)
    if refused:
        sys.exit(1)


def show_fit(title: str, frozen: dict[str, FrozenSet]) -> None:
    """Print the parameters with their intervals and the cross-validated figures."""
    console = open_console()
    for name, current in frozen.items():
        console.print(f"{title}: {name}, {current.seconds:.0f} s", style="bold")
        parameters = [
            [key, f"{each['value']:.6g}", each["unit"], "{:.4g} to {:.4g}".format(*each["interval"])]
            for key, each in current.parameters.items()
        ]
        show_table(["parameter", "value", "unit", "95 % interval"], parameters, 1)
        names = list(current.baselines)
        rows = [
            [
                row["fold"],
                row["quantity"],
                f"{row['rmse']:.3g}",
                row["unit"],
                f"{row.get('coverage', 0):.0%}",
                *(f"{row.get('baselines', {}).get(key, float('nan')):.3g}" for key in names),
            ]
            for row in current.cross_validation
        ]
        show_table(["left out", "quantity", "RMSE", "unit", "coverage", *names], rows, 2)


def show(title: str, predictions: list[Prediction]) -> None:
    """Print a row per file and quantity, and where the model does not agree."""
    console = open_console()
    console.print(title, style="bold")
    names = list(
        dict.fromkeys(key for prediction in predictions for row in prediction.rows for key in row["baselines"])
    )
    titles = ["file", "quantity", "RMSE", "mean", "largest", "unit", "coverage", "consistent", "rezeroed", *names]
    rows = []
    for prediction in predictions:
        for row in prediction.rows:
            rivals = [f"{row['baselines'].get(key) or float('nan'):.3g}" for key in names]
            coverage = "-" if row["coverage"] is None else f"{row['coverage']:.0%}"
            verdict = {None: "-", True: "yes", False: "NO"}[row["consistent"]]
            numbers = [f"{row[key]:.3g}" for key in ("rmse", "mean_error", "largest")]
            rezeroed = f"{row['rezeroed_rmse']:.3g}"
            rows.append([row["file"], row["quantity"], *numbers, row["unit"], coverage, verdict, rezeroed, *rivals])
    show_table(titles, rows, 2)
    for prediction in predictions:
        for row in prediction.rows:
            for text in row["remarks"]:
                console.print(f"{row['file']}: {text}", soft_wrap=True)
