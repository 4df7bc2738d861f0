"""The wheel in an empty folder: what it holds, and that one works with it without the checkout."""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parent.parent
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", "build", "runs", "*.egg-info", "__pycache__", ".*_cache")


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """An environment that has the wheel; all that it depends on is taken from where the tests run."""
    folder = tmp_path_factory.mktemp("wheel")
    shutil.copytree(ROOT, folder / "source", ignore=LEFT_OUT)
    pip = [sys.executable, "-m", "pip", "--quiet"]
    built = subprocess.run(
        [*pip, "wheel", "--no-deps", "-w", folder, folder / "source"], check=False, capture_output=True, text=True
    )
    if built.returncode:
        assert "setuptools" in built.stderr, built.stderr
        pytest.skip("setuptools cannot be had to build with")
    shutil.rmtree(folder / "source")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "home"], check=True)
    python = folder / "home" / "bin" / "python"
    wheel = next(folder.glob("*.whl"))
    subprocess.run([*pip, "--python", python, "install", "--no-deps", wheel], check=True)
    packages = next((folder / "home" / "lib").glob("python*/site-packages"))
    (packages / "dependencies.pth").write_text(f"{sysconfig.get_path('purelib')}\n{sysconfig.get_path('platlib')}\n")
    return folder / "home"


@pytest.fixture
def twin(home, tmp_path):
    """A command in an empty folder: what it printed."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}

    def run(*words):
        done = subprocess.run(
            [home / "bin" / "twin", *words],
            check=False,
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,  # of a busy machine
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_it_is_the_wheel_that_runs(home, tmp_path):
    done = subprocess.run(
        [home / "bin" / "python", "-c", "import twin; print(twin.__file__)"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert Path(done.stdout.strip()).is_relative_to(home)


def test_it_holds_what_the_checkout_has(home):
    packages, share = next(home.glob("lib/python*/site-packages")), home / "share" / "catheter-twin"
    kept = [path for top in ("twin", "fmus", "hw_bridge") for path in (ROOT / top).rglob("*") if path.is_file()]
    kept = [path.relative_to(ROOT) for path in kept if path.suffix != ".pyc" and "__pycache__" not in path.parts]
    assert len(kept) > 600
    assert [str(path) for path in kept if not (packages / path).exists()] == []
    beside = [path.relative_to(ROOT) for top in ("scenarios", "docs") for path in (ROOT / top).rglob("*.*")]
    beside = [path for path in beside if path.suffix in (".yaml", ".md", ".csv", ".svg", ".png")]
    assert [str(path) for path in beside if not (share / path).exists()] == []
    assert (share / "README.md").exists()
    assert list(packages.glob("catheter_twin-*.dist-info/licenses/LICENSE"))


def test_what_is_shipped_is_found_by_name(twin):
    for kind, name in (("components", "servomotor"), ("scenarios", "heart_wall_force"), ("profiles", "epos4")):
        assert f" {name} " in twin("list", kind)
    assert "target_position" in twin("describe", "servomotor")
    assert "ok (" in twin("check", "racs", "in_vivo_navigation")


def test_a_shipped_scenario_runs(twin, tmp_path):
    assert "\nPASS " in twin("run", "heart_wall_force", "--variant", "PI", "--seed", "1")
    assert next(tmp_path.glob("runs/heart_wall_force/*/report.html")).stat().st_size > 10_000


def test_own_components_stand_beside_the_shipped_ones(twin, tmp_path):
    twin("new", "own_part")
    assert (tmp_path / "fmus" / "own_part" / "model.py").exists()
    listed = twin("list", "components")
    assert " own_part " in listed
    assert " servomotor " in listed
    assert "own_part: ok" in twin("test", "own_part")


def test_a_project_of_ones_own(twin, tmp_path):
    twin("new", "my_rig", "--project")
    (tmp_path / "fmus").symlink_to(tmp_path / "my_rig" / "fmus")
    (tmp_path / "scenarios").symlink_to(tmp_path / "my_rig" / "scenarios")
    assert " my_rig_plant " in twin("list", "components")
    assert "pass " in twin("run", "my_rig")
