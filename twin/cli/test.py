"""`twin test NAME...`: what every component must pass."""

from __future__ import annotations

from pathlib import Path

import click

from twin.errors import TwinError, described


@click.command(name="test")
@click.argument("names", nargs=-1)
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), show_default=True,
              help="Folder for compiled objects and FMUs.")  # fmt: skip
def command(names: tuple[str, ...], build: Path) -> None:
    """Check components: all of fmus/, or those named.

    Source, documentation, outputs written, and that interpreted, compiled, FMI 2.0 and FMI 3.0 FMU all reproduce
    expected.csv to the bit. After a wanted change of behavior: twin reference NAME writes it anew.
    """
    from twin.component import catalog
    from twin.conformance import agreement as conformance

    failed = 0
    for name in names or catalog.names():
        cls = catalog.component(name)
        lines = []
        for title, check in conformance.checks(cls).items():
            try:
                check(cls, build)
            except TwinError as error:
                lines += [f"  {title}: {line}" for line in str(error).splitlines()]
            except Exception as error:
                lines.append(f"  {title}: {described(error)}. Correct it there.")
        failed += bool(lines)
        click.echo(f"{name}: {'FAILED' if lines else 'ok'}")
        for line in lines:
            click.echo(line, err=True)
    if failed:
        raise TwinError(f"{failed} component{'s' * (failed > 1)} failed.")
