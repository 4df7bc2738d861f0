"""What a command imports before it works, and what it needs of the home folder: nothing."""

import os
import subprocess
import sys
from importlib.metadata import EntryPoint

import pytest

from tests.matrix import some
from twin.cli.plugins import WIDTH, plugin_commands, summary

MODULES = "import sys; from twin.cli import group; group(sys.argv[1:], standalone_mode=False); print(*sys.modules, file=sys.stderr)"


def modules(*arguments):
    done = subprocess.run([sys.executable, "-c", MODULES, *arguments], capture_output=True, text=True, check=True)
    return set(done.stderr.split())


@pytest.mark.slow
def test_help_imports_no_command():
    assert modules("--help").isdisjoint({"numpy", "hw_bridge", "twin.cli.run", "pydantic"})


@pytest.mark.slow
def test_a_command_of_ours_asks_for_no_others():
    found = modules("run", "--help")
    assert found.isdisjoint({"numpy", "hw_bridge", "pydantic"})


@pytest.mark.parametrize("name", plugin_commands())
def test_the_line_of_another_command_is_its_own(name):
    assert summary(name) == plugin_commands()[name].load().get_short_help_str(limit=WIDTH)


def test_a_command_that_does_not_show_is_asked(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "odd_commands.py").write_text("import click\ncommand = click.Command('odd', help='Odd one. More.')\n")
    monkeypatch.setitem(plugin_commands(), "odd", EntryPoint("odd", "odd_commands:command", "twin.commands"))
    assert summary("odd") == "Odd one."


SCENARIO = """
stop_time: 1 s
members: {heart: {component: heart}}
metrics: {reach: {signal: heart.position, reduce: max, unit: inch}}
"""


@pytest.mark.slow
@pytest.mark.parametrize("home", some(["missing", "a file", "a damaged cache", "none"], ["a damaged cache", "none"]))
def test_no_home_is_needed(tmp_path, home):
    """A unit that only pint knows: it keeps nothing in the home folder, and reads nothing there."""
    place = tmp_path / "home"
    if home == "a file":
        place.touch()
    if home == "a damaged cache":
        (place / ".cache" / "pint").mkdir(parents=True)
        (place / ".cache" / "pint" / "x.pickle").write_bytes(b"\x80")
    (tmp_path / "one.yaml").write_text(SCENARIO)
    environment = {**os.environ, "HOME": str(place), "XDG_CACHE_HOME": str(place / ".cache")}
    if home == "none":
        del environment["HOME"], environment["XDG_CACHE_HOME"]
    before = sorted(place.rglob("*")) if place.is_dir() else None
    command = [sys.executable, "-c", "from twin.cli import main; main()", "check", str(tmp_path / "one.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    assert (sorted(place.rglob("*")) if place.is_dir() else None) == before


INTERRUPTED = """
import signal, sys

module = sys.argv.pop(1)

class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == module:
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Interrupt())
from twin.__main__ import main
main()
"""


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("module", ["twin.process", "click", "twin.cli.run"])
def test_an_interrupted_import_ends_the_command_in_one_line(module):
    words = [sys.executable, "-c", INTERRUPTED, module, "run", "--help"]
    done = subprocess.run(words, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "\ninterrupted\n")
