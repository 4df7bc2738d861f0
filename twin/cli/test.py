"""`twin test NAME...`: what every component must pass."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli.terminal import say
from twin.errors import TwinError, described
from twin.process import supervise

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from twin.component import Component
    from twin.process import CrashReport


@click.command(name="test")
@click.argument("names", nargs=-1)
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build"), show_default=True,
              help="Folder for compiled objects and FMUs.")  # fmt: skip
@click.option("--timeout", type=click.FloatRange(0.0), default=60.0, show_default=True, metavar="S",
              help="A check that takes longer has failed [s]; 0: wait for ever.")  # fmt: skip
def command(names: tuple[str, ...], build: Path, timeout: float) -> None:
    """Check components: all of fmus/, or those named.

    Source, documentation, outputs written, and that interpreted, compiled, FMI 2.0 and FMI 3.0 FMU all reproduce
    expected.csv to the bit. After a wanted change of behavior: twin reference NAME writes it anew.
    """
    link = supervise(timeout)
    from twin.component import catalog
    from twin.conformance import agreement as conformance

    every = names or catalog.names()
    failed, begin = link.successor_values.get("failed", 0), link.successor_values.get("begin", 0)
    if link.crash_report is not None:  # of the process before this one
        failed += 1
        tell(every[begin], [*link.crash_report.log.get(every[begin], []), died(link.crash_report)])
        begin += 1
    for number, name in enumerate(every[begin:], begin):
        link.keep(resume=True, begun=True, begin=number, failed=failed)
        lines: dict[str, str] = {}  # what is wrong, told once if it keeps several checks from their work -> check
        try:
            cls = catalog.component(name)
            for title, check in conformance.checks(cls).items():
                link.note(f"{name}: {title}")
                for line in problems(check, cls, build):
                    lines.setdefault(line, f"  {title}: {line}")
                    link.log(name, lines[line])
        except TwinError as error:
            lines[str(error)] = f"  {error}"
        link.note("")
        failed += bool(lines)
        tell(name, lines.values())
    if failed:
        raise TwinError(f"{failed} component{'s' * (failed > 1)} failed.")


def tell(name: str, lines: Collection[str]) -> None:
    """What became of a component."""
    say(f"{name}: {'FAILED' if lines else 'ok'}")
    for line in lines:
        say(line, err=True)


def died(death: CrashReport) -> str:
    """What a check did to its process."""
    where = f", at {death.location}" if death.location else ""
    hint = (
        "Correct it there, or allow it more time with --timeout."
        if death.unresponsive_time
        else "Correct what it calls."
    )
    return f"  {death.note.partition(': ')[2]}: {death.how}{where}. {hint}"


def problems(check: Callable[[type[Component], Path], None], cls: type[Component], build: Path) -> list[str]:
    """What a check finds; a component may fail in any way."""
    try:
        check(cls, build)
    except TwinError as error:
        return str(error).split("\n")
    except Exception as error:
        return [f"{described(error)}. Correct it there."]
    return []
