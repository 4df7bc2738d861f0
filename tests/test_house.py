"""The house rules that a machine can keep: format, lint, types, import contracts."""

import ast
import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.public_names import public_names

ROOT = Path(__file__).parent.parent
EARLIER = ("variable.py", "solver.py", "noise.py")  # modules of the engine under the names they had once
COMMAND_LINES = (("twin", "cli"), ("hw_bridge", "command"))  # entered by name: a command is a file

COMMANDS = {
    "format": ["-m", "ruff", "format", "--check", "."],
    "lint": ["-m", "ruff", "check", "."],
    "types": ["-m", "mypy"],
    "imports": ["-c", "from importlinter.cli import lint_imports_command as c; c()", "--no-cache"],
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name == "types" else name for name in COMMANDS]
)
def test_house(name):
    done = subprocess.run([sys.executable, *COMMANDS[name]], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"


@pytest.mark.slow
def test_scripts_use_names_that_exist():
    """Scripts that draw figures and measure run by hand only: a renamed method would be noticed too late."""
    scripts = [*ROOT.glob("docs/*.py"), *ROOT.glob("benchmarks/*.py")]
    lenient = ("--config-file=", "--ignore-missing-imports", "--follow-imports=silent")
    command = [sys.executable, "-m", "mypy", *lenient, *map(str, scripts)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert "checked" in done.stdout or "Success" in done.stdout, done.stdout + done.stderr
    assert not re.findall(r".*\[(?:attr-defined|call-arg|name-defined)\]", done.stdout)


@pytest.mark.slow
def test_only_the_supervisor_forks():
    """It does so while its process has one thread; all else is started anew. No warning about forks is silenced."""
    forking = re.compile(r"\bfork(pty)?\(|[\"']fork(server)?[\"']|multiprocessing.*\bProcess\b")
    found = {
        str(path.relative_to(ROOT))
        for tree in ("twin", "hw_bridge", "fmus")
        for path in ROOT.glob(f"{tree}/**/*.py")
        if any(forking.search(line) and "hasattr" not in line for line in path.read_text().splitlines())
    }
    assert found == {"twin/process/supervisor.py"}


def statements(nodes):
    """All statements, also those inside others: a tenth of the nodes of a tree."""
    for node in nodes:
        yield node
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            yield from statements(getattr(node, part, ()))


def imports(path):
    """Line, module and names of each import in a file; no names where it is of a module."""
    for node in statements(ast.parse(path.read_text()).body):
        if isinstance(node, ast.ImportFrom):
            yield node.lineno, node.module or "", [alias.name for alias in node.names]
        elif isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name, []) for alias in node.names)


@pytest.mark.slow
def test_rooms_are_entered_by_their_doors():
    """Outside a room of the engine or of the bridge, only the names of its face are imported, from its face; inside, its modules."""
    places = [
        place.parent.relative_to(ROOT) for tree in ("twin", "hw_bridge") for place in ROOT.glob(f"{tree}/*/__init__.py")
    ]
    rooms = {".".join(place.parts): public_names(ROOT / place) for place in places if place.parts not in COMMAND_LINES}
    assert {"twin.coupling", "hw_bridge.bus"} <= rooms.keys()
    wrong = []
    for path in [*ROOT.glob("twin/**/*.py"), *ROOT.glob("hw_bridge/**/*.py"), *ROOT.glob("fmus/**/*.py")]:
        own = ".".join(path.relative_to(ROOT).parts[:2])
        if path.name in EARLIER and path.parent == ROOT / "twin":
            continue
        for line, module, names in imports(path):
            room, rest = ".".join(module.split(".")[:2]), module.split(".")[2:]
            strange = []
            if room in rooms and room != own:
                strange = rest or [name for name in names if name not in rooms[room]]
            elif module == own:  # the import contracts do not see what a face imports lazily
                strange = [name for name in names if importlib.util.find_spec(f"{module}.{name}") is None]
            wrong += [f"{path.relative_to(ROOT)}:{line}: {module}: {name}" for name in strange]
    assert wrong == []
