"""`twin new NAME`: create a component folder or a project that builds and passes its tests unchanged."""

from __future__ import annotations

import keyword
import re
import shutil
from contextlib import contextmanager
from importlib import resources, util
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from twin.cli.options import folder_option
from twin.cli.terminal import say
from twin.errors import TwinError
from twin.files import write_atomically

if TYPE_CHECKING:
    from collections.abc import Iterator

NAME = re.compile(r"[a-z][a-z0-9_]*")


PROJECT = {  # templates of a project's files
    "README.md": "README.md",
    ".gitignore": "gitignore",
    ".github/workflows/test.yml": "test.yml",
    "scenarios/{name}.yaml": "scenario.yaml",
    "scenarios/command.csv": "command.csv",
    "tests/test_scenario.py": "test_scenario.py.txt",
}


@click.command(name="new")
@click.argument("name")
@folder_option("--in", "fmus", "Folder of components.", name="folder")
@click.option(
    "--project", is_flag=True, help="Create a folder NAME with a component, a scenario, a test and a CI file."
)
def command(name: str, folder: Path, project: bool) -> None:
    """Create fmus/NAME/ with model.py, README.md and expected.csv: a first-order lag as a starting point.

    \b
    twin new my_part            then edit fmus/my_part/model.py
    twin test my_part           check all forms of the component
    twin build my_part          build/3.0/my_part.fmu and build/2.0/my_part.fmu
    twin new my_rig --project
    """
    if not NAME.fullmatch(name) or keyword.iskeyword(name):
        raise TwinError(f"{name!r} cannot be a component's name. Use lower case with underscores, such as my_part.")
    if project:
        folder = new_project(name)
        say(f"{folder}: written. Then: cd {folder}; twin run {name}; python -m pytest")
        return
    in_catalog = "fmus" in (folder.name, folder.parent.name)  # directly in fmus/, or in a group of it
    if in_catalog and not folder.is_absolute() and name in component_names():
        raise TwinError(f"{name!r} is a component already, which the new one would hide. Choose another name.")
    path, class_name = new_component(folder / name)
    reference = name if in_catalog or path.is_absolute() else f"{'.'.join(path.parts)}.model:{class_name}"
    say(f"{path}: written. Edit {path / 'model.py'}, then: twin test {reference}")


def refuse_existing(path: Path) -> None:
    """Raise TwinError if a path exists: nothing is replaced."""
    if path.exists():
        raise TwinError(f"{path} exists already. Choose another name, or remove it first.")


def template(file: str, /, **values: str) -> str:
    """Return a template with its values filled in."""
    return (resources.files("twin.cli") / "templates" / file).read_text().format(**values)


def title_of(name: str) -> str:
    """Return a name as a title."""
    return name.replace("_", " ").capitalize()


def new_component(path: Path) -> tuple[Path, str]:
    """Create the folder of a component; return it with the name of the class."""
    refuse_existing(path)
    title, class_name = title_of(path.name), "".join(part.capitalize() for part in path.name.split("_"))
    files = {
        "__init__.py": "",
        "model.py": template("model.py.txt", title=title, class_name=class_name),
        "README.md": template("component.md", title=title),
    }
    with all_or_nothing(path):
        for file, text in files.items():
            write_atomically(path / file, text)

        from twin.conformance import reference

        reference.regenerate(load_class(path, class_name), path / "expected.csv")
    return path, class_name


@contextmanager
def all_or_nothing(folder: Path) -> Iterator[None]:
    """Create a folder, and remove it if its content cannot be written."""
    folder.mkdir(parents=True)
    try:
        yield
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def new_project(name: str) -> Path:
    """Create the folder of a project."""
    folder, component = Path(name), f"{name}_plant"
    refuse_existing(folder)
    with all_or_nothing(folder):
        new_component(folder / "fmus" / component)
        for file, source in PROJECT.items():
            path = folder / file.format(name=name)
            write_atomically(path, template(f"project/{source}", name=name, part=component, title=title_of(name)))
    return folder


def component_names() -> list[str]:
    """Return the names of all components."""
    from twin.component import catalog
    from twin.errors import DeclarationError

    try:
        return catalog.names()
    except DeclarationError:
        return []


def load_class(folder: Path, class_name: str) -> Any:
    """Import the component class of a folder, which need not be on the import path."""
    spec = util.spec_from_file_location(f"{folder.name}.model", folder / "model.py")
    assert spec is not None
    assert spec.loader is not None
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, class_name)
