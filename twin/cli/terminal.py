"""The door to the terminal: whatever a command prints goes through here.

Titles, names and log lines come from files of anybody. Nothing in them controls the terminal, becomes a link or a color,
or ends the command because the terminal lacks a letter.
"""

from __future__ import annotations

import os
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from twin.errors import printable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Console
    from rich.progress import Progress

UNLIMITED = 10_000  # columns
SECOND = 1.0
CLOSED = 141  # exit code where nobody reads any more, as shells give it for SIGPIPE


def say(line: str = "", *, err: bool = False) -> None:
    """Print one line."""
    click.echo(printable(line), err=err)


def paper(*, err: bool = False) -> Console:
    """Where tables and colors are printed: a terminal wraps, a file or a pipe gets whole lines, to be searched."""
    from rich.console import Console
    from rich.segment import Segment
    from rich.text import Text

    class Paper(Console):
        """Prints texts as they are; of what controls a terminal, only its own."""

        def render(self, renderable, options=None):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
            """What is printed, piece by piece; a text's own line breaks are seen, those of wrapping it break lines."""
            if isinstance(renderable, Text) and not renderable.plain.isprintable():
                renderable = Text(printable(renderable.plain), renderable.style, end=renderable.end)
            for one in super().render(renderable, options):
                lines = one.text.split("\n")
                yield one if one.control else Segment("\n".join(map(printable, lines)), one.style)

    stream = sys.stderr if err else sys.stdout
    return Paper(file=stream, markup=False, emoji=False, highlight=False, width=None if stream.isatty() else UNLIMITED)


def bar(*, err: bool = False) -> Progress:
    """A progress bar that vanishes at its end."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    title = TextColumn("{task.description}", markup=False)
    part = TextColumn("{task.percentage:3.0f} %", markup=False)
    return Progress(title, BarColumn(), part, TimeElapsedColumn(), console=paper(err=err), transient=True)


@contextmanager
def working(what: str) -> Iterator[None]:
    """Say on a terminal what takes so long, from its first second on; the line vanishes at the end."""
    over = threading.Event()

    def tell() -> None:
        seconds = 0
        while not over.wait(SECOND):
            seconds += 1
            sys.stderr.write(f"\r\033[K{printable(what)} {seconds} s")
            sys.stderr.flush()
        if seconds:
            sys.stderr.write("\r\033[K")
            sys.stderr.flush()

    if not sys.stderr.isatty():
        yield
        return
    thread = threading.Thread(target=tell, name=what, daemon=True)
    try:
        thread.start()
    except RuntimeError:  # no memory for it
        yield
        return
    try:
        yield
    finally:
        over.set()
        thread.join()


def open_streams() -> None:
    """Make sure that there are streams, whatever whoever started us has closed, and that they bear any letter."""
    while (spare := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass  # else the first file that is opened would get what is printed
    os.close(spare)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def nobody_reads() -> int:
    """The exit code where the reader of our output is gone; nothing may be flushed into it at exit."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(nowhere, stream.fileno())
    return CLOSED
