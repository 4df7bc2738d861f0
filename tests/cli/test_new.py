"""`twin new` writes a folder that builds and passes its tests as it stands."""

import subprocess
import sys

import pytest

MAIN = [sys.executable, "-c", "from twin.cli import main; main()"]


@pytest.fixture
def twin(tmp_path, build):
    """Run the command in a folder of its own, as a person without this repository would."""

    def run(*arguments):
        return subprocess.run([*MAIN, *arguments], cwd=tmp_path, capture_output=True, text=True, check=False)

    return run


def test_a_new_component_passes_its_tests_and_builds(twin, tmp_path, build):
    made = twin("new", "my_part")
    assert made.returncode == 0, made.stderr
    assert sorted(path.name for path in (tmp_path / "fmus/my_part").iterdir() if path.is_file()) == [
        "README.md", "__init__.py", "expected.csv", "model.py",
    ]  # fmt: skip
    tested = twin("test", "my_part", "--build", str(build))
    assert (tested.returncode, tested.stdout) == (0, "my_part: ok\n"), tested.stderr
    built = twin("build", "my_part", "--build", "here")
    assert built.returncode == 0, built.stderr
    assert (tmp_path / "here/2.0/my_part.fmu").exists()
    assert (tmp_path / "here/3.0/my_part.fmu").exists()


@pytest.mark.parametrize("name", ["MyPart", "2nd", "a-b", "class", "../up"])
def test_a_bad_name_is_refused(twin, tmp_path, name):
    made = twin("new", name)
    assert made.returncode == 1
    assert made.stderr.startswith(f"error: {name!r} cannot be a component's name.")
    assert not (tmp_path / "fmus").exists()


def test_nothing_is_overwritten(twin, tmp_path):
    (tmp_path / "fmus/part").mkdir(parents=True)
    assert "exists already" in twin("new", "part").stderr
