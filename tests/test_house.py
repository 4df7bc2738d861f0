"""The house rules that a machine can keep: format, lint, types, import contracts."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

COMMANDS = {
    "format": ["-m", "ruff", "format", "--check", "."],
    "lint":   ["-m", "ruff", "check", "."],
    "types":  ["-m", "mypy"],
    "imports": ["-c", "from importlinter.cli import lint_imports_command as c; c()", "--no-cache"],
}  # fmt: skip


@pytest.mark.parametrize("name", COMMANDS)
def test_house(name):
    done = subprocess.run([sys.executable, *COMMANDS[name]], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
