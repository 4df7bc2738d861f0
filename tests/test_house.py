"""The house rules that a machine can keep: format, lint, types, import contracts."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
EARLIER = ("variable.py", "solver.py", "noise.py")  # modules of the engine under the names they had once

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


def test_rooms_are_entered_by_their_doors():
    """Outside a room of the engine, only the names of its face are imported, from its face."""
    rooms = {place.parent.name: importlib.import_module(f"twin.{place.parent.name}").__all__
             for place in ROOT.glob("twin/*/__init__.py") if place.parent.name != "cli"}  # fmt: skip
    wrong = []
    for path in [*ROOT.glob("twin/**/*.py"), *ROOT.glob("hw_bridge/**/*.py"), *ROOT.glob("fmus/**/*.py")]:
        own = path.relative_to(ROOT).parts[1]
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("twin."):
                continue
            _, room, *rest = node.module.split(".")
            if room in rooms and room != own and own not in EARLIER:
                strange = rest or [alias.name for alias in node.names if alias.name not in rooms[room]]
                wrong += [f"{path.relative_to(ROOT)}:{node.lineno}: {node.module}: {name}" for name in strange]
    assert wrong == []
