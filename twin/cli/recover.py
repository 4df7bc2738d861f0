"""`twin recover RUN`: recover the results of an interrupted run."""

from __future__ import annotations

from pathlib import Path

import click

from twin.cli.options import no_report_option, verbose_option


@click.command(name="recover")
@click.argument("folder", type=click.Path(path_type=Path), metavar="RUN")
@verbose_option
@no_report_option
def command(folder: Path, verbose: bool, no_report: bool) -> None:
    """Recover the results of a run whose processes were all killed: signals.parquet, summary.json, report.html.

    RUN is its folder, runs/SCENARIO/TIME. The next `twin run` does the same for all such runs in its folder of results.

    Exit code 0 if the results were written, for any outcome of the run.
    """
    from twin.cli.run import show
    from twin.run import recover

    outcome = recover(folder, report=not no_report)
    show(outcome, (folder / "report.html").exists(), verbose)
