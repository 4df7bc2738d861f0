"""`twin test NAME...`: run the conformance checks of components."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from twin.cli.options import build_option, timeout_option
from twin.cli.terminal import say
from twin.errors import TwinError, described
from twin.process import supervise

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from twin.component import Component
    from twin.process import CrashReport

SCOPE = (
    "Checked: source, units, texts; all forms agree with expected.csv to the bit.",
    "Physics is not judged: write a scenario with requirements (`expect:`).",
)


@click.command(name="test")
@click.argument("names", nargs=-1)
@build_option
@timeout_option("Time limit of a check [s]; 0: none.", 60.0, show_default=True)
def command(names: tuple[str, ...], build: Path, timeout: float) -> None:
    """Check components of fmus/: NAMES, or all without NAMES.

    Checks cover source, documentation and outputs, and that the interpreted, compiled, FMI 2.0 and FMI 3.0 forms all
    reproduce expected.csv to the bit. After an intended change of behavior, record it again with `twin reference NAME`.

    Whether the physics is right is not checked: state it as expectations of a scenario.
    """
    link = supervise(timeout)
    from twin.component import catalog
    from twin.conformance import agreement as conformance

    components = names or catalog.names()
    failed, begin = link.successor_values.get("failed", 0), link.successor_values.get("begin", 0)
    if link.crash_report is not None:  # the previous process died in a check
        failed += 1
        report(
            components[begin], [*link.crash_report.log.get(components[begin], []), describe_crash(link.crash_report)]
        )
        begin += 1
    for number, name in enumerate(components[begin:], begin):
        link.keep(resume=True, begun=True, begin=number, failed=failed)
        lines: dict[str, str] = {}  # lines by problem: one that blocks several checks is printed once
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
        report(name, lines.values())
    if failed:
        raise TwinError(f"{failed} component{'s' * (failed > 1)} failed.")
    for line in SCOPE:
        say(line)


def report(name: str, lines: Collection[str]) -> None:
    """Print the result of a component."""
    say(f"{name}: {'FAILED' if lines else 'ok'}")
    for line in lines:
        say(line, err=True)


def describe_crash(crash: CrashReport) -> str:
    """Return a line about a check that ended its process."""
    where = f", at {crash.location}" if crash.location else ""
    hint = "Correct it there, or raise --timeout." if crash.unresponsive_time else "Correct what it calls."
    return f"  {crash.note.partition(': ')[2]}: {crash.how}{where}. {hint}"


def problems(check: Callable[[type[Component], Path], None], cls: type[Component], build: Path) -> list[str]:
    """Return the problems of a check; a component may fail in any way."""
    try:
        check(cls, build)
    except TwinError as error:
        return str(error).split("\n")
    except Exception as error:
        return [f"{described(error)}. Correct it there."]
    return []
