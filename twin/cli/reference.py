"""`twin reference NAME...`: record the reference trajectory of a component."""

from __future__ import annotations

import click

from twin.cli.terminal import say


@click.command(name="reference")
@click.argument("names", nargs=-1, required=True)
def command(names: tuple[str, ...]) -> None:
    """Record expected.csv again after an intended change of behavior.

    NAMES are folders of fmus/ or `module:Class`. The stimulus in the file is reused. Review the differences, then run
    `twin test`.
    """
    from twin.component import catalog
    from twin.conformance import reference

    for cls in [catalog.component(name) for name in names]:
        say(str(reference.regenerate(cls)))
