"""Tables and texts in a narrow terminal: nothing is lost where lines are broken, and nothing from outside breaks them."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator

import click
import pytest
from rich.table import Table
from rich.text import Text

from twin.cli import COMMANDS, HARDWARE, group, run_command
from twin.cli.terminal import open_console

WORDS = "one two three four five six seven eight nine ten eleven twelve"


def printed(what: object, width: int = 24) -> list[str]:
    console = open_console()
    console.file, console.width = io.StringIO(), width
    console.print(what)
    return [line.rstrip() for line in console.file.getvalue().splitlines()]


def test_cells_are_wrapped_and_whole() -> None:
    table = Table()
    table.add_column("a title that is longer than its column", overflow="fold")
    table.add_column("b")
    table.add_row(Text(WORDS), Text("y"))
    text = " ".join(printed(table)).replace("│", " ").replace("┃", " ")
    assert " ".join(text.split()).count("nine ten eleven twelve".partition(" ")[0]) == 1
    for word in (*WORDS.split(), "longer", "column"):
        assert word in text.split()


def test_a_text_is_wrapped_at_words() -> None:
    assert printed(WORDS)[:2] == ["one two three four five", "six seven eight nine ten"]


def test_breaks_from_outside_are_seen() -> None:
    assert printed(Text("a\nb\x1b[31m"), 80) == [r"a\nb\x1b[31m"]
    assert printed("name\nerror: forged", 80) == [r"name\nerror: forged"]


def commands(command: click.Command, path: tuple[str, ...], context: click.Context) -> Iterator[tuple[str, str]]:
    """Each command's help at 80 columns, by what one types."""
    yield " ".join(path), command.get_help(click.Context(command, info_name=" ".join(path), terminal_width=80))
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            one = command.get_command(context, name)
            assert one is not None
            yield from commands(one, (*path, name), context)


def test_help_has_80_columns() -> None:
    found = dict(commands(group, ("twin",), click.Context(group)))
    assert {"twin run", "twin hil scan", "twin drive inject"} <= found.keys()
    wide = [f"{path}: {line}" for path, text in found.items() for line in text.splitlines() if len(line) > 80]
    assert not wide


def test_commands_are_listed_by_task_one_line_each() -> None:
    context = click.Context(group, terminal_width=80)
    lines = group.get_help(context).partition("\nRun and look:")[2].splitlines()
    headings = [line for line in lines if line and not line.startswith(" ")]
    assert headings == [f"{name}:" for name in [*list(COMMANDS)[1:-1], HARDWARE, "Housekeeping"]]
    named = [line.split()[0] for line in lines if line.startswith("  ")]
    assert sorted(named) == sorted(group.list_commands(context))


def test_a_group_without_a_command_prints_its_help(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["twin", "cache"])
    assert run_command(group, "twin") == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "Usage: twin cache [OPTIONS] COMMAND [ARGS]..."
    assert "Commands:" in lines
