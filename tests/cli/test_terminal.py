"""What commands print: whatever stands in files, whoever reads, whatever the terminal can show."""

import io
import logging
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from twin.cli import terminal

ROOT = Path(__file__).parents[2]
MAIN = [sys.executable, "-c", "from twin.cli import main; main()"]
HOSTILE = """\
title: "T [/b] [link=http://x]y[/link] \\e[31m \\u202E"
stop_time: 1 s
members: {heart: {component: heart}}
metrics: {"m[red] [/b]": {signal: heart.position, reduce: final}}
expect: [{name: "e[/b]\\e[31m", metric: "m[red] [/b]", at_least: 0 m}]
"""


@pytest.fixture
def hostile(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text(HOSTILE)
    return path


def run(words, folder, **options):
    return subprocess.run([*MAIN, *words], cwd=folder, capture_output=True, check=False, timeout=120, **options)


@pytest.mark.slow
def test_texts_of_files_are_shown_as_they_are(hostile, build):
    words = [
        "run",
        str(hostile),
        "--no-report",
        "--verbose",
        "--backend",
        "interpreted",
        "--runs",
        str(hostile.parent / "r"),
    ]
    done = run([*words, "--build", str(build)], hostile.parent, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("T [/b] [link=http://x]y[/link] \\x1b[31m \\u202e\n")
    assert "m[red] [/b]" in done.stdout
    assert "e[/b]\\x1b[31m" in done.stdout
    assert "\x1b" not in done.stdout + done.stderr


def test_also_on_a_terminal(hostile, monkeypatch):
    class Screen(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr(sys, "stdout", Screen())
    monkeypatch.setenv("TERM", "xterm")
    console = terminal.open_console()
    console.print("a[red]b[/b] :smile: \x1b[31m\x9b", style="bold")
    assert re.sub(r"\x1b\[[0-9;]*m", "", sys.stdout.getvalue()) == "a[red]b[/b] :smile: \\x1b[31m\\x9b\n"


@pytest.mark.parametrize(("is_terminal", "columns"), [(True, ""), (False, ""), (False, "40")])
def test_an_error_is_wrapped_on_a_terminal_and_at_columns(monkeypatch, capsys, is_terminal, columns):
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: is_terminal)
    monkeypatch.setattr(sys.stderr, "fileno", lambda: 2)
    monkeypatch.setattr(terminal.os, "get_terminal_size", lambda number: os.terminal_size((40, 20)))
    text = "/a/path/that/is/longer/than/a/line/and/stays/whole.yaml: there is no variant `PX`."
    terminal.show_error(text)
    lines = capsys.readouterr().err.splitlines()
    path, _, rest = text.partition(" ")
    assert lines == ([f"error: {path}", f"       {rest}"] if is_terminal or columns else [f"error: {text}"])


@pytest.mark.parametrize("is_terminal", [True, False])
def test_what_takes_long_is_said_on_a_terminal(monkeypatch, is_terminal):
    class Screen(io.StringIO):
        def isatty(self):
            return is_terminal

    monkeypatch.setattr(sys, "stderr", Screen())
    monkeypatch.setattr(terminal, "SECOND", 0.001)
    with terminal.show_elapsed("reading \x1b[31m.csv"):
        while is_terminal and "3 s" not in sys.stderr.getvalue():
            time.sleep(0.001)
    shown = sys.stderr.getvalue()
    assert not is_terminal or (shown.startswith("\r\x1b[Kreading \\x1b[31m.csv 1 s") and shown.endswith("\r\x1b[K"))
    assert is_terminal or not shown


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("words", [["--help"], ["check", "{file}"], ["run", "{file}"], ["nothing"]])
def test_who_reads_may_leave_at_any_time(hostile, words):
    read, write = os.pipe()
    os.close(read)
    words = [word.format(file=hostile) for word in words]
    done = subprocess.run(
        [*MAIN, *words, *(["--backend", "interpreted", "--no-report"] if words[0] == "run" else [])],
        cwd=hostile.parent,
        stdout=write,
        stderr=write,
        check=False,
        timeout=120,
    )
    os.close(write)
    assert done.returncode == terminal.BROKEN_PIPE


@pytest.mark.slow
def test_streams_may_be_closed(hostile):
    command = f'exec "$@" <&- >&- 2>"{hostile.parent / "err"}"'
    done = subprocess.run(["sh", "-c", command, "sh", *MAIN, "check", str(hostile)], check=False, timeout=120)
    assert (done.returncode, (hostile.parent / "err").read_text()) == (0, "")


@pytest.mark.slow
def test_a_terminal_may_lack_letters(hostile):
    hostile.write_text(HOSTILE.replace("members", "mжmbers"))
    done = run(["check", str(hostile)], hostile.parent, env={**os.environ, "PYTHONIOENCODING": "latin-1"})
    assert done.returncode == 1
    assert rb"unknown key `m\u0436mbers`" in done.stdout


@pytest.mark.slow
def test_nothing_else_prints():
    """Texts from files reach the terminal of a command through `twin.cli.terminal` alone."""
    wrong = [
        f"{path.relative_to(ROOT)}: {found}"
        for folder in ("twin", "hw_bridge")
        for path in (ROOT / folder).rglob("*.py")
        if path != Path(terminal.__file__) and not {"face", "process"} & set(path.parts)
        for found in re.findall(
            r"(?:click\.s?echo|(?<![\w.])print|(?<!\w)Console|(?<!\w)Progress)\(.*", path.read_text()
        )
    ]
    allowed = ("click.echo((outcome.folder", "click.echo(json.dumps(")  # JSON, which escapes by itself
    assert [one for one in wrong if not any(word in one for word in allowed)] == []


def test_a_note_of_the_log_is_wrapped_and_printed_once(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "24")
    log = logging.getLogger("a log of its own")
    log.addHandler(terminal.NoteHandler())
    for _ in range(2):
        log.warning("note: mine.yaml:5: no effect in fast")
    assert capsys.readouterr().err == "note: mine.yaml:5: no\n      effect in fast\n"


def test_a_long_name_breaks_after_a_point_or_underscore(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "44")
    name = "catheter.sequencer.instrument_target_velocity"
    terminal.show_table(["signal", "difference"], [[name, "15.62 mm/s"], ["short", "1 mm/s"]], 1)
    lines = [line.split("  ")[0].strip() for line in capsys.readouterr().out.splitlines()]
    assert [line for line in lines if line[:1].isalpha()] == [
        "signal",
        "catheter.sequencer.",
        "instrument_target_velocity",
        "short",
    ]
