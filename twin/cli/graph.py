"""`twin graph`: the coupling structure of a scenario, as tables and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli import completion
from twin.cli.options import overrides_option, picture_option, variant_option
from twin.cli.terminal import say, show_elapsed, show_table
from twin.errors import ScenarioError, nearest

if TYPE_CHECKING:
    from twin.coupling import Catalog
    from twin.scenario import Case
    from twin.structure import Structure

BUILD = Path("build")


@click.command("graph")
@click.argument("scenario", metavar="SCENARIO", shell_complete=completion.scenarios)
@overrides_option
@variant_option
@picture_option
def command(scenario: str, variant: str | None, overrides: tuple[str, ...], output: Path | None) -> None:
    """Show the coupling structure of a scenario without running it.

    Two tables list the members with order, period and direct feedthrough (outputs that depend on inputs at the same
    instant), and the connections with the delay that the coupling adds. Algebraic loops are named.

    \b
    twin graph racs
    twin graph racs --set algorithm=gauss_seidel -o racs.svg
    """
    with show_elapsed(f"reading {scenario}"):
        case, catalog = load_case(scenario, overrides, variant)
        structure = analyze(case, catalog)
    show(structure)
    if output is not None:
        from twin.results import write_text

        write_text(output, structure.svg(alone=True) + "\n")
        say(f"{output}")


def load_case(path: str, overrides: tuple[str, ...], variant: str | None) -> tuple[Case, Catalog]:
    """Return a variant of a scenario and the variables of its members."""
    from twin.run import resolve_catalogs
    from twin.scenario import load_scenario

    scenario = load_scenario(path, overrides)
    catalogs = resolve_catalogs(scenario)
    names = [case.variant for case in scenario.variants]
    if variant is not None and variant not in names:
        raise ScenarioError(f"{path}: there is no variant `{variant}`. {nearest(variant, names)}")
    case = scenario.cases([variant or names[0]], ())[0]
    return case, catalogs[case.variant]


def analyze(case: Case, catalog: Catalog) -> Structure:
    """Return the coupling structure of a case."""
    from twin.run import build_simulation, case_structure
    from twin.scenario import Backend

    master = build_simulation(case, catalog, Backend.interpreted, BUILD)
    try:
        return case_structure(case, master)
    finally:
        master.terminate()


def show(structure: Structure) -> None:
    """Print members and connections."""
    from twin import clock

    members = [
        [
            part.name,
            part.component,
            str(part.rank),
            clock.text(part.period),
            "; ".join(f"{output}: {', '.join(inputs)}" for output, inputs in part.feedthrough),
        ]
        for part in structure.parts
    ]
    show_table(["member", "component", "order", "period", "direct feedthrough"], members, 2, texts=1)
    wires = [[wire.source, wire.target, str(wire.values), wire.delay] for wire in structure.wires]
    show_table(["from", "to", "values", "delay"], wires, 2)
    say(structure.summary)
