"""`twin recover RUN`: finish a run of which every process was killed."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="recover")
@click.argument("folder", type=click.Path(path_type=Path), metavar="RUN")
@click.option("--no-report", is_flag=True, help="Write no report.html.")
def command(folder: Path, no_report: bool) -> None:
    """Finish a run that was killed, as far as it came: signals.parquet, summary.json, report.html.

    RUN is its folder, runs/<scenario>/<time>. The next `twin run` does the same with every run in its folder of results.
    Exit code 0 if the folder was written, whatever the end of the run was.
    """
    from twin.cli.run import show
    from twin.run import recover

    outcome = recover(folder, report=not no_report)
    show(outcome, (folder / "report.html").exists())
