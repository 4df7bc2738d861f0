"""Which modules are imported from the text of their files."""

import importlib
import sys
from importlib.machinery import PathFinder
from types import ModuleType

import pytest

from twin.component import source_import
from twin.component.source_import import TextFinder, TextLoader


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with modules: a person's own, an installed one, and a component in an installed package."""
    packages = tmp_path / "lib" / "site-packages"
    for path in (tmp_path, packages, packages / "fmus" / "spring"):
        path.mkdir(parents=True, exist_ok=True)
        (path / f"own_{path.name.replace('-', '_')}.py").write_text("VALUE = 1\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path), str(packages), str(packages / "fmus" / "spring"), *sys.path])
    sys.path_importer_cache.clear()
    return tmp_path


def test_modules_of_people_are_read_from_their_text_and_no_others(folder):
    finder = TextFinder()
    for name in ("twin.errors", "hw_bridge", "json", "sys", "numpy", "pytest", "own_site_packages", "own_nothing"):
        assert type(getattr(finder.find_spec(name), "loader", None)) is not TextLoader, name
    for name in (f"own_{folder.name}", "own_spring"):
        spec = finder.find_spec(name)
        assert (type(spec.loader), spec.loader.path) == (TextLoader, spec.origin)


def test_an_edit_of_equal_size_and_time_is_seen(folder):
    finder, path = TextFinder(), folder / f"own_{folder.name}.py"
    before = path.stat()
    for value in (1, 2):
        path.write_text(f"VALUE = {value}\n")
        importlib.invalidate_caches()
        spec = finder.find_spec(path.stem)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        assert value == module.VALUE
        assert path.stat().st_size == before.st_size
    assert not (folder / "__pycache__").exists()
    with pytest.raises(OSError, match="bytecode is not used"):
        spec.loader.path_stats(str(path))


def test_the_finder_stands_before_that_of_python_once(monkeypatch):
    other = object()
    monkeypatch.setattr(sys, "meta_path", [other, PathFinder])
    for _ in range(2):
        source_import.install()
    first, finder, last = sys.meta_path
    assert (first, type(finder), last) == (other, TextFinder, PathFinder)
    sys.meta_path[:] = [other]
    source_import.install()
    assert [type(one) for one in sys.meta_path] == [object, TextFinder]


def test_modules_that_a_function_will_import_are_found_without_importing_them(folder, monkeypatch):
    package = folder / "own_package"
    for path in (package, package / "inner"):
        path.mkdir()
        (path / "__init__.py").write_text("raise RuntimeError")
    (package / "inner" / "leaf.py").write_text("raise RuntimeError")
    file = f"own_{folder.name}"
    paths = {
        file: folder / f"{file}.py",
        "own_package": package / "__init__.py",
        "own_package.inner": package / "inner" / "__init__.py",
        "own_package.inner.leaf": package / "inner" / "leaf.py",
        "own_package.none": None,
        "own_package.inner.leaf.value": None,  # a variable
        f"{file}.value": None,
        "json.decoder": None,
        "own_site_packages": None,
    }
    found = {name: source_import.find_user_file(name) for name in paths}
    assert {name: spec and spec.origin for name, spec in found.items()} == {
        name: path and str(path) for name, path in paths.items()
    }
    loaded = ModuleType("own_package")
    monkeypatch.setitem(sys.modules, "own_package", loaded)
    assert source_import.find_user_file("own_package.inner") is None, "a loaded module that is no package"
    loaded.__path__ = [str(package)]
    assert source_import.find_user_file("own_package.inner").origin == str(package / "inner" / "__init__.py")
    loaded.inner = 1.0
    assert source_import.find_user_file("own_package.inner") is None, "a variable of the loaded package"
