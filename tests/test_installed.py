"""Versions of installed packages and their entry points; and packages whose modules are imported lazily."""

import importlib
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.every_case import every_case
from twin import installed

ROOT = Path(__file__).parent.parent
ROOMS = [place.parent.name for place in ROOT.glob("twin/*/__init__.py")]


def test_what_the_project_needs_has_its_version_in_the_constraints():
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    kept = {canonicalize_name(name): version for name, version in (line.split("==") for line in lines)}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    wanted = [Requirement(text) for text in (*project["dependencies"], *extras["python"], *extras["test"])]
    wanted = [one for one in wanted if one.name != project["name"]]
    assert len(wanted) > 20
    assert [str(one) for one in wanted if kept.get(canonicalize_name(one.name), "0") not in one.specifier] == []


def test_entry_points_of_a_group_have_their_names_in_order():
    found = installed.entry_points("twin.commands")
    assert list(found) == sorted(found)
    assert callable(found["hil"].load())
    assert installed.entry_points("nothing") == {}


@every_case("room", ROOMS)
def test_a_face_has_what_it_promises(room):
    package = importlib.import_module(f"twin.{room}")
    assert [name for name in getattr(package, "__all__", ()) if not hasattr(package, name)] == []
    assert not hasattr(package, "no_such_name")


def test_a_function_named_as_its_module_is_the_function():
    fmi = importlib.import_module("twin.fmi")
    assert callable(fmi.plan)
    assert callable(fmi.simulate)
    assert fmi.csv_tables.__name__ == "twin.fmi.csv_tables"
