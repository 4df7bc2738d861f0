"""`twin profile`: which member of a scenario costs what."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli import completion
from twin.cli.graph import chosen
from twin.cli.terminal import bar, paper, say, working

if TYPE_CHECKING:
    from twin.structure import Profile

BUILD = Path("build")


@click.command("profile", short_help="Which member of a scenario costs what.")
@click.argument("scenario", metavar="SCENARIO", shell_complete=completion.scenarios)
@click.option("--variant", metavar="NAME", help="[default: the first]")
@click.option("--seed", type=int, help="[default: the first]")
@click.option("--set", "overrides", multiple=True, metavar="PATH=VALUE", help="As of `twin run`.")
@click.option("--form", type=click.Choice(["fmu", "compiled", "interpreted"]), default="fmu", show_default=True)
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE.svg", help="Draw it there."
)
def command(
    scenario: str, variant: str | None, seed: int | None, overrides: tuple[str, ...], form: str, output: Path | None
) -> None:
    """Run a variant of a scenario and measure what each member costs.

    The loop reads the clock between its calls, every few communication steps; nothing is written but the picture. A
    machine that is busy with other things measures those, too: close them, and run it twice.
    """
    if output is not None and output.suffix != ".svg":
        raise click.UsageError(f"-o {output}: the picture is an .svg. Name it {output.stem}.svg.")
    from dataclasses import replace

    from twin.run import measure_profile
    from twin.scenario import Backend

    with working(f"reading {scenario}"):
        case, catalog = chosen(scenario, overrides, variant)
    case = case if seed is None else replace(case, seed=seed)
    with bar(err=True) as shown:
        task = shown.add_task(case.name, total=1.0)
        found = measure_profile(case, catalog, Backend(form), BUILD, lambda _, part: shown.update(task, completed=part))
    show(found)
    if output is not None:
        from twin.results import plotting, write_text

        values = {cost.name: cost.per_tick * 1e6 for cost in found.costs}
        write_text(output, plotting.bar_chart(values, "time of a communication step [us]") + "\n")
        say(f"{output}")


def show(found: Profile) -> None:
    """Print the costs."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
    for title in ("member", "component"):
        grid.add_column(title, overflow="fold")
    for title in ("its step", "per step of the loop", "share"):
        grid.add_column(title, justify="right")
    for cost in found.costs:
        step = f"{cost.step * 1e6:.3f} us" if cost.step else "-"
        texts = (cost.name, cost.what, step, f"{cost.per_tick * 1e6:.3f} us", f"{cost.share:.1%}".replace("%", " %"))
        grid.add_row(*map(Text, texts))
    paper().print(grid)
    say(
        f"a communication step of {found.step * 1e3:g} ms takes {found.per_tick * 1e6:.2f} us, {found.real_time_factor:.0f} "
        f"times real time ({found.sampled_steps} were looked at; reading the clock, {found.overhead * 1e9:.0f} ns, is taken off)"
    )
