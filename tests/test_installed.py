"""What is installed, read from folders, is what importlib.metadata says; and faces of rooms that import late."""

import importlib
from importlib import metadata
from pathlib import Path

import pytest

from twin import installed, late

ROOMS = [place.parent.name for place in Path("twin").glob("*/__init__.py")]


def test_versions():
    for name in ("numpy", "ziglang", "fmpy", "pyarrow", "pint", "pydantic", "python-can", "Python.CAN"):
        assert installed.version(name) == metadata.version(name)
    with pytest.raises(metadata.PackageNotFoundError):
        installed.version("no-such-package")


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
    found = late.names("twin.fmi", {"plan": "simulate", "simulate": "simulate", "tables": ""})
    assert callable(found("plan"))
    assert callable(importlib.import_module("twin.fmi").simulate)
    assert found("tables").__name__ == "twin.fmi.tables"
    with pytest.raises(AttributeError, match=r"'twin\.fmi' has no attribute 'x'"):
        found("x")
