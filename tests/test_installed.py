"""What is installed, read from folders, is what importlib.metadata says; and faces of rooms that import late."""

import importlib
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from twin import installed

ROOT = Path(__file__).parent.parent
ROOMS = [place.parent.name for place in ROOT.glob("twin/*/__init__.py")]


def test_versions():
    for name in ("numpy", "ziglang", "fmpy", "pyarrow", "pint", "pydantic", "python-can", "Python.CAN"):
        assert installed.version(name) == metadata.version(name)
    with pytest.raises(metadata.PackageNotFoundError):
        installed.version("no-such-package")


def test_what_the_project_needs_has_its_version_in_the_constraints():
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    kept = {canonicalize_name(name): version for name, version in (line.split("==") for line in lines)}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    wanted = [Requirement(text) for text in (*project["dependencies"], *extras["python"], *extras["test"])]
    wanted = [one for one in wanted if one.name != project["name"]]
    assert len(wanted) > 20
    assert [str(one) for one in wanted if kept.get(canonicalize_name(one.name), "0") not in one.specifier] == []


@pytest.mark.parametrize("group", ["twin.commands", "twin.hardware", "console_scripts", "pytest11", "nothing"])
def test_entry_points(group):
    expected = {one.name: one.value.partition("[")[0].strip() for one in metadata.entry_points(group=group)}
    assert installed.entry_points(group) == dict(sorted(expected.items()))


def test_an_entry_point_is_loaded():
    assert installed.load("os:path.join") is importlib.import_module("os").path.join


@pytest.mark.parametrize("room", ROOMS)
def test_a_face_has_what_it_promises(room):
    package = importlib.import_module(f"twin.{room}")
    assert [name for name in getattr(package, "__all__", ()) if not hasattr(package, name)] == []
    assert not hasattr(package, "no_such_name")


def test_a_function_named_as_its_module_is_the_function():
    fmi = importlib.import_module("twin.fmi")
    assert callable(fmi.plan)
    assert callable(fmi.simulate)
    assert fmi.csv_tables.__name__ == "twin.fmi.csv_tables"
