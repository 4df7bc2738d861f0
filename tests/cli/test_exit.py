"""How a command ends the process: exit codes and the last lines, for whatever ends it."""

import errno
import os
import sys

import click
import pytest

from twin import cli
from twin.errors import TwinError

STOPPED = "interrupted\n"


@pytest.fixture
def run(monkeypatch, capsys):
    """Exit code and stderr of a command that raises something."""
    monkeypatch.setattr(sys, "argv", ["twin"])
    monkeypatch.setattr(cli, "memory_is_limited", lambda: False)

    def run_with(error):
        def command(prog_name, standalone_mode):
            assert (prog_name, standalone_mode) == ("twin", False)
            if error is not None:
                raise error

        return cli.run_command(command, "twin"), capsys.readouterr().err

    return run_with


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (None, 0, ""),
        (SystemExit(0), 0, ""),
        (SystemExit(3), 3, ""),
        (click.UsageError("no option \x1b[31m."), 2, "Error: no option \\x1b[31m.\n"),
        (click.ClickException("no."), 1, "Error: no.\n"),
        (TwinError("a.yaml: one\na.yaml: two"), 1, "error: a.yaml: one\nerror: a.yaml: two\n"),
        (
            OSError(errno.ENOENT, "not there", "f"),
            1,
            "error: f: not there. Check the path, its permissions and the disk.\n",
        ),
        (MemoryError(), 1, "error: not enough memory. Record less, or raise the limit (ulimit -v).\n"),
        (click.Abort(), 130, STOPPED),
        (KeyboardInterrupt(), 130, STOPPED),
    ],
)
def test_an_expected_end(run, error, code, text):
    assert run(error) == (code, text)


@pytest.mark.parametrize(
    "error",
    [SystemExit("text"), BrokenPipeError(), ImportError("x"), RuntimeError("x"), SystemError("x"), ValueError("x")],
)
def test_what_is_not_expected_is_raised(run, error):
    with pytest.raises(type(error)):
        run(error)


@pytest.mark.parametrize("error", [ImportError, RuntimeError, SystemError])
def test_what_fails_for_want_of_memory(run, monkeypatch, error):
    """Where it is limited; the end of the reason is shown, in one line."""
    monkeypatch.setattr(cli, "memory_is_limited", lambda: True)
    reason = f"{'x' * 200}\n  no room"
    text = f"error: not enough memory ({'x' * 112} no room). Record less, or raise the limit (ulimit -v).\n"
    assert run(error(reason)) == (1, text)
    with pytest.raises(ValueError, match="x"):
        run(ValueError("x"))


@pytest.fixture
def invoke(monkeypatch):
    """Exit code of a whole command; signals and streams of the test stay as they are."""
    for name in ("handle_signals", "open_streams", "command_line"):
        monkeypatch.setattr(cli, name, lambda: None)
    monkeypatch.setattr(cli, "handle_broken_pipe", lambda: 141)

    def ends(code):
        raise SystemExit(code)

    monkeypatch.setattr(cli, "end", ends)

    def invoke_with(result, *, interrupted=False):
        def command(*_):
            if isinstance(result, BaseException):
                raise result
            return result() if callable(result) else result

        monkeypatch.setattr(cli, "run_command", command)
        monkeypatch.setattr(cli, "is_interrupted", lambda: interrupted)
        with pytest.raises(SystemExit) as caught:
            cli.invoke("command", "twin")
        return caught.value.code

    return invoke_with


def test_the_end_of_the_process(invoke, monkeypatch, capsys):
    """Code that a signal interrupts may fail in any way."""
    assert [invoke(code) for code in (0, 1, 130)] == [0, 1, 130]
    assert invoke(BrokenPipeError()) == 141
    assert capsys.readouterr().err == ""
    assert invoke(ValueError("odd"), interrupted=True) == 130
    assert capsys.readouterr().err == STOPPED
    with pytest.raises(ValueError, match="odd"):
        invoke(ValueError("odd"))

    def close():
        monkeypatch.setattr(sys, "stdout", sys.stderr)  # as click does after a broken pipe
        return 0

    assert invoke(close) == 141


def test_a_name_that_is_not_text(monkeypatch, run):
    """It is refused before anything is done."""
    monkeypatch.setattr(sys, "argv", ["twin", "run", os.fsdecode(b"a\xff.yaml")])
    code, text = run(None)
    assert code == 2
    assert "a\\udcff.yaml: byte 0xff is not UTF-8 text. Rename the file or folder." in text
