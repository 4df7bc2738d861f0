"""`twin graph`: the system that a scenario couples, as a table and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli import completion
from twin.cli.terminal import paper, say, working
from twin.errors import ScenarioError, nearest

if TYPE_CHECKING:
    from twin.coupling import Catalog
    from twin.scenario import Case
    from twin.structure import Structure

BUILD = Path("build")


@click.command("graph", short_help="The system that a scenario couples: order, periods, delays, loops.")
@click.argument("scenario", metavar="SCENARIO", shell_complete=completion.scenarios)
@click.option("--variant", metavar="NAME", help="[default: the first]")
@click.option("--set", "overrides", multiple=True, metavar="PATH=VALUE", help="As of `twin run`.")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE.svg", help="Draw it there."
)
def command(scenario: str, variant: str | None, overrides: tuple[str, ...], output: Path | None) -> None:
    """Show what a scenario couples, without running it.

    Members with their order and periods, which outputs depend on which inputs at the same instant, algebraic loops, and
    how late each value is where it is used: beyond what the source's own step says.

    \b
    twin graph racs
    twin graph racs --set algorithm=gauss_seidel -o racs.svg
    """
    if output is not None and output.suffix != ".svg":
        raise click.UsageError(f"-o {output}: the picture is an .svg. Name it {output.stem}.svg.")
    with working(f"reading {scenario}"):
        case, catalog = chosen(scenario, overrides, variant)
        found = described(case, catalog)
    show(found)
    if output is not None:
        from twin.results import write_text

        write_text(output, found.svg(alone=True) + "\n")
        say(f"{output}")


def chosen(path: str, overrides: tuple[str, ...], variant: str | None) -> tuple[Case, Catalog]:
    """A variant of a scenario with the variables of its members."""
    from twin.run import resolve_catalogs
    from twin.scenario import load_scenario

    scenario = load_scenario(path, overrides)
    catalogs = resolve_catalogs(scenario)
    names = [case.variant for case in scenario.variants]
    if variant is not None and variant not in names:
        raise ScenarioError(f"{path}: there is no variant `{variant}`. {nearest(variant, names)}")
    case = scenario.cases([variant or names[0]], ())[0]
    return case, catalogs[case.variant]


def described(case: Case, catalog: Catalog) -> Structure:
    """What a case couples."""
    from twin.run import build_simulation, case_structure
    from twin.scenario import Backend

    simulated = build_simulation(case, catalog, Backend.interpreted, BUILD)
    try:
        return case_structure(case, simulated)
    finally:
        simulated.terminate()


def show(found: Structure) -> None:
    """Print members and connections."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from twin import clock

    members = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
    for title in ("member", "component", "order", "period"):
        members.add_column(title, overflow="fold", justify="right" if title in ("order", "period") else "left")
    members.add_column("depends at one instant on", overflow="fold")
    for part in found.parts:
        on = "; ".join(f"{output}: {', '.join(inputs)}" for output, inputs in part.feedthrough)
        members.add_row(*map(Text, (part.name, part.component, str(part.rank), clock.text(part.period), on)))
    wires = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
    for title in ("from", "to", "values", "delay"):
        wires.add_column(title, overflow="fold", justify="left" if title in ("from", "to") else "right")
    for wire in found.wires:
        wires.add_row(*map(Text, (wire.source, wire.target, str(wire.values), wire.delay)))
    console = paper()
    console.print(members)
    console.print(wires)
    say(found.summary)
