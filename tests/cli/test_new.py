"""`twin new` writes a folder that builds and passes its tests as it stands."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.matrix import some

ROOT = Path(__file__).parents[2]
MAIN = [sys.executable, "-c", "from twin.cli import main; main()"]


@pytest.fixture
def twin(tmp_path, command_line):
    """Run the command in a folder of its own."""
    return lambda *words: command_line.run(list(words), tmp_path)


def as_a_person(folder, *words):
    """Run the command as a person without this repository would: in a process of its own, with no path but the folder."""
    return subprocess.run([*MAIN, *words], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_new_component_passes_its_tests_and_builds(twin, tmp_path, build):
    made = as_a_person(tmp_path, "new", "my_part")
    assert made.returncode == 0, made.stderr
    assert sorted(path.name for path in (tmp_path / "fmus/my_part").iterdir() if path.is_file()) == [
        "README.md",
        "__init__.py",
        "expected.csv",
        "model.py",
    ]
    tested = twin("test", "my_part", "--build", str(build))
    assert (tested.returncode, tested.stdout.splitlines()[0]) == (0, "my_part: ok"), tested.stderr
    built = twin("build", "my_part", "--build", "here")
    assert built.returncode == 0, built.stderr
    assert (tmp_path / "here/2.0/my_part.fmu").exists()
    assert (tmp_path / "here/3.0/my_part.fmu").exists()


@pytest.mark.slow
def test_a_new_project_runs_and_its_tests_pass(twin, tmp_path, command_line):
    assert twin("new", "my_rig", "--project").returncode == 0
    place = tmp_path / "my_rig"
    ran = command_line.run(["run", "my_rig"], place)
    assert ran.returncode == 0, ran.stderr
    assert "pass    2 requirements (--verbose lists them)." in ran.stdout
    tested = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"],
        cwd=place,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "2 passed" in tested.stdout, tested.stdout
    assert "exists already" in twin("new", "my_rig", "--project").stderr


@pytest.mark.parametrize("name", ["MyPart", "2nd", "a-b", "class", "../up"])
def test_a_bad_name_is_refused(twin, tmp_path, name):
    made = twin("new", name)
    assert made.returncode == 1
    assert made.stderr.startswith(f"error: {name!r} cannot be a component's name.")
    assert not (tmp_path / "fmus").exists()


def test_nothing_is_overwritten(twin, tmp_path):
    (tmp_path / "fmus/part").mkdir(parents=True)
    assert "exists already" in twin("new", "part").stderr


SHIPPED = "from fmus.mine.model import Mine; from fmus.servomotor.model import Servomotor; print(Mine.__name__, Servomotor.__name__)"


@pytest.mark.slow
@pytest.mark.parametrize("text", some([None, "", '"""Mine."""\n'], [None, ""]))
def test_own_and_shipped_components_stand_side_by_side(twin, tmp_path, text, build):
    """In plain Python; and with the twin commands also where an older `fmus/__init__.py` hides the shipped ones."""
    assert twin("new", "mine").returncode == 0
    assert not (tmp_path / "fmus/__init__.py").exists()
    if text is None:
        python = subprocess.run(
            [sys.executable, "-c", SHIPPED],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "PYTHONPATH": str(ROOT)},  # as installed: an editable install is found last
        )
        assert (python.returncode, python.stdout) == (0, "Mine Servomotor\n"), python.stderr
    else:
        (tmp_path / "fmus/__init__.py").write_text(text)
    (tmp_path / "s.yaml").write_text("stop_time: 1 s\nmembers: {a: {component: mine}, b: {component: servomotor}}\n")
    checked = as_a_person(tmp_path, "check", "s.yaml")
    assert (checked.returncode, checked.stdout[:11]) == (0, "s.yaml: ok ")


@pytest.mark.slow
def test_each_fault_of_a_component_is_told_once(twin, tmp_path, build):
    assert twin("new", "mine").returncode == 0
    model = tmp_path / "fmus/mine/model.py"
    text = model.read_text()
    begin = text.index("    def ")
    model.write_text(
        text[:begin].replace("state(", "local(").replace("rk4, state", "rk4, local")
        + '    z = output("m", "a second output")\n\n    def step(self, t, h):\n        self.z = t\n'
    )
    tested = twin("test", "mine", "--build", str(build))
    assert tested.returncode == 1
    assert tested.stderr.count("columns are not the variables") == 1
    assert "initialization does not write z. Write `def initialize(self):` with `self.z = ...`" in tested.stderr
    assert "a step does not write" in tested.stderr
