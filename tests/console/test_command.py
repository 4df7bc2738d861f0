"""The command: what it refuses, what it needs, and that nothing else pays for it."""

import subprocess
import sys

import pytest
from click.testing import CliRunner

from tests.every_case import every_case
from twin.cli.console import command
from twin.errors import TwinError


def told(*arguments):
    """What the command says when it refuses."""
    result = CliRunner().invoke(command, list(arguments), prog_name="twin console")
    assert result.exit_code != 0
    return result.output + str(result.exception or "")


@every_case(
    ("arguments", "problem"),
    [
        (["racs", "--arm"], "--arm needs --hardware FILE."),
        (["--variant", "PI"], "need a SCENARIO"),
        (["no_such_scenario"], "There is no scenario 'no_such_scenario'"),
        (["nowhere.yaml"], "does not exist"),
        (["racs", "--rate", "11"], "0.1<=x<=10"),
        (["racs", "--port", "80"], "1024<=x<=65535"),
        (["heart_wall_force", "--variant", "nope", "--no-open"], "there is no variant `nope`. Known: "),
        (
            ["heart_wall_force", "--set", "heart.rte=1", "--no-open"],
            "heart has no variable `rte`. Did you mean `rate`?",
        ),
    ],
)
def test_what_is_refused(arguments, problem):
    assert problem in told(*arguments)


def test_without_its_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "nicegui", None)
    assert "pip install 'catheter-twin[console]'" in told("racs")


def test_a_port_that_is_taken():
    from twin.web.server import listening

    with listening(None) as sock, pytest.raises(TwinError, match="Take another, or none"):
        listening(sock.getsockname()[1])


def test_help_in_80_columns():
    text = CliRunner().invoke(command, ["--help"], terminal_width=80, prog_name="twin console").output
    assert max(map(len, text.splitlines())) <= 80
    assert "--arm" in text


@pytest.mark.slow
def test_nobody_else_imports_the_pages():
    code = "import sys, twin.cli.run, twin.cli.console, twin.run, twin.web, twin.console; assert 'nicegui' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
