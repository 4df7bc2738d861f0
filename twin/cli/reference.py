"""`twin reference NAME...`: write the trajectory that every form of a component must reproduce."""

from __future__ import annotations

import click

from twin.cli.terminal import say


@click.command(name="reference")
@click.argument("names", nargs=-1, required=True)
def command(names: tuple[str, ...]) -> None:
    """Write expected.csv anew: NAMES are folders of fmus/ or `module:Class`.

    For a wanted change of behavior. The stimulus that stands in the file is kept; review what changed, then `twin test`.
    """
    from twin.component import catalog
    from twin.conformance import reference

    for cls in [catalog.component(name) for name in names]:
        say(str(reference.regenerate(cls)))
