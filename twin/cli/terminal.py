"""Output to the terminal: all that a command prints passes through this module.

Titles, names and log lines come from files of any origin. They are escaped: they cannot control the terminal, and a letter
that the terminal lacks does not end the command.
"""

from __future__ import annotations

import logging
import os
import re
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TextIO

import click

from twin.errors import printable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from rich.console import Console
    from rich.progress import Progress
    from rich.table import Table
    from rich.text import Text

UNLIMITED = 10_000  # columns
GAP = 3  # columns between those of a table
MAX_NAME = 40  # letters of a name that a table does not break
NO_BREAK_SPACE = "\N{NO-BREAK SPACE}"
SECOND = 1.0
SHORTEST_BAR = 24  # columns of a bar with its percentage and clock, beside a long title
LABELS = ("note: ", "warning: ")  # before a remark
BROKEN_PIPE = 141  # exit code of shells for SIGPIPE


def say(line: str = "", *, err: bool = False) -> None:
    """Print one line."""
    click.echo(printable(line), err=err)


def open_console(*, err: bool = False) -> Console:
    """Return a rich console for tables and colors: wrapped on a terminal or at COLUMNS, else whole lines in a file or pipe."""
    from rich.console import Console
    from rich.segment import Segment
    from rich.text import Text

    class EscapingConsole(Console):
        """A console that escapes control characters of the texts it prints."""

        def render(self, renderable, options=None):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
            """Escape line breaks of a text, but keep those of wrapping."""
            if isinstance(renderable, Text) and not renderable.plain.isprintable():
                renderable = Text(printable(renderable.plain), renderable.style, end=renderable.end)
            for segment in super().render(renderable, options):
                lines = segment.text.split("\n")
                yield segment if segment.control else Segment("\n".join(map(printable, lines)), segment.style)

        def print(self, *objects: Any, **options: Any) -> None:
            """Print; in a file or pipe without the spaces that fill up table cells."""
            if stream.isatty():
                super().print(*objects, **options)
                return
            with self.capture() as captured:
                super().print(*objects, **options)
            self.file.write("\n".join(line.rstrip() for line in captured.get().split("\n")))
            self.file.flush()  # else lines on stderr overtake it

    stream = sys.stderr if err else sys.stdout
    width = None if stream.isatty() else line_width(stream)
    return EscapingConsole(file=stream, markup=False, emoji=False, highlight=False, width=width)


def line_width(stream: TextIO) -> int:
    """Return the columns of a stream: of its terminal, or COLUMNS, else no limit."""
    columns = os.environ.get("COLUMNS", "")
    if stream.isatty():
        return os.get_terminal_size(stream.fileno()).columns or UNLIMITED
    return int(columns) if columns.isdecimal() and int(columns) else UNLIMITED


def show_text(text: str, label: str = "", style: str = "") -> None:
    """Print a text after a label; on a terminal its words are wrapped, and later lines begin under its first word.

    Lines are not broken at a NO_BREAK_SPACE.
    """
    from rich.text import Text

    console = open_console()
    for begin, words in wrap_text(text, label, console.width):
        console.print(Text.assemble((begin, style), words), soft_wrap=True)


def show_error(text: str, label: str = "error: ") -> None:
    """Print a line to stderr, on a terminal or at COLUMNS wrapped as by `show_text`."""
    for begin, words in wrap_text(text, label, line_width(sys.stderr)):
        say(begin + words, err=True)


class NoteHandler(logging.Handler):
    """Print each note of the log `twin` to stderr, once, as by `show_error`."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record."""
        text = record.getMessage()
        if text not in self.texts:
            self.texts.add(text)
            label = next(filter(text.startswith, LABELS), "")
            show_error(text.removeprefix(label), label)


def wrap_text(text: str, label: str, columns: int) -> Iterator[tuple[str, str]]:
    """Iterate over the lines of a text, each with the label, or blanks of its length, before it."""
    from textwrap import wrap

    # a path longer than a line stays whole, so that it can be copied
    width = max(columns - len(label), 20)
    lines = wrap(printable(text), width, break_long_words=False, break_on_hyphens=False) or [""]
    for i, line in enumerate(lines):
        yield " " * len(label) if i else label, line.replace(NO_BREAK_SPACE, " ")


def show_outcome(word: str, sentence: str, file: Path, command: str, *, prefix: str = "", end: str = " ") -> None:
    """Print the last line of a run: a word in its color, a sentence, and where to look: a report or results, and a command."""
    label = "Report" if file.suffix == ".html" else "Results"
    locations = [text.replace(" ", NO_BREAK_SPACE) for text in (f"{label}: {file}", f"Look: {command}" * bool(command))]
    style = {"PASS": "bold green", "DONE": "bold"}.get(word, "bold red")
    show_text(f"{sentence} {'  '.join(filter(None, locations))}", f"{prefix}{word}{end}", style)


def make_table(*titles: str, left: int) -> Table:
    """Return an empty table whose first `left` columns are aligned to the left, the others to the right."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="bold")
    for i, title in enumerate(titles):
        table.add_column(title, justify="left" if i < left else "right", overflow="fold")
    return table


def show_table(titles: Iterable[str], rows: Iterable[Iterable[str | Text]], left: int, *, texts: int = 0) -> bool:
    """Print a table whose first `left` columns, and last `texts` ones, are aligned to the left; return whether it has rows, nothing is printed without."""
    from rich.text import Text

    titles = list(titles)
    table = make_table(*titles, left=left)
    cell_rows = [[Text(cell) if isinstance(cell, str) else cell for cell in row] for row in rows]
    others = [max(map(len, cells)) for cells in zip(titles, *cell_rows, strict=True)][1:]
    room = open_console().width - sum(others) - GAP * len(titles)  # of the first column
    for row in cell_rows if room > max(others, default=0) else ():
        row[0] = Text(" ".join(break_name(word, room) for word in row[0].plain.split(" ")), row[0].style)
    for row in cell_rows:
        table.add_row(*row)
    for column, cells in zip(table.columns[:left], zip(*cell_rows, strict=True), strict=False):  # names stay whole
        column.no_wrap = all(" " not in cell.plain and len(cell) <= MAX_NAME for cell in cells)
    for column in table.columns[len(table.columns) - texts :]:
        column.justify = "left"
    if table.row_count:
        open_console().print(table)
    return bool(cell_rows)


def break_name(name: str, width: int) -> str:
    """Return a name that is longer than a line of its column with blanks where it breaks: after a point or underscore."""
    lines = [""]
    for part in re.findall(r"[^._]*[._]+|[^._]+", name):
        if lines[-1] and len(lines[-1] + part) > width:
            lines.append("")
        lines[-1] += part
    return " ".join(lines)


def make_bar(*, err: bool = False) -> Progress:
    """Return a progress bar that vanishes at its end."""
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.table import Column

    console = open_console(err=err)
    width = max(console.width - SHORTEST_BAR, 20)
    title = TextColumn("{task.description}", markup=False, table_column=Column(max_width=width, no_wrap=True))
    percentage = TaskProgressColumn("{task.percentage:3.0f} %", markup=False)
    clock = TimeElapsedColumn(table_column=Column(no_wrap=True))
    return Progress(title, BarColumn(), percentage, clock, console=console, transient=True)


@contextmanager
def show_elapsed(what: str) -> Iterator[None]:
    """Show on a terminal what is being done and for how many seconds, after the first second; remove the line at the end."""
    finished = threading.Event()

    def update() -> None:
        seconds = 0
        while not finished.wait(SECOND):
            seconds += 1
            sys.stderr.write(f"\r\033[K{printable(what)} {seconds} s")
            sys.stderr.flush()
        if seconds:
            sys.stderr.write("\r\033[K")
            sys.stderr.flush()

    if not sys.stderr.isatty():
        yield
        return
    thread = threading.Thread(target=update, name=what, daemon=True)
    try:
        thread.start()
    except RuntimeError:  # no memory for a thread
        yield
        return
    try:
        yield
    finally:
        finished.set()
        thread.join()


def open_streams() -> None:
    """Open stdout and stderr if the parent process closed them, and let them accept any letter."""
    while (spare := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass  # else the first file that is opened would receive what is printed
    os.close(spare)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def handle_broken_pipe() -> int:
    """Return the exit code after the reader of the output has closed; redirect the rest, so that no flush fails at exit."""
    null_device = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(null_device, stream.fileno())
    return BROKEN_PIPE
