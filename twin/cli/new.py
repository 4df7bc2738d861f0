"""`twin new NAME`: a component folder, or a project, that builds and passes its tests as it stands."""

from __future__ import annotations

import keyword
import re
import shutil
from contextlib import contextmanager
from importlib import resources, util
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from twin.cli.terminal import say
from twin.errors import TwinError
from twin.files import write_atomically

if TYPE_CHECKING:
    from collections.abc import Iterator

NAME = re.compile(r"[a-z][a-z0-9_]*")


PROJECT = {  # files of a project, and their templates
    "README.md": "README.md",
    ".gitignore": "gitignore",
    ".github/workflows/test.yml": "test.yml",
    "scenarios/{name}.yaml": "scenario.yaml",
    "scenarios/command.csv": "command.csv",
    "tests/test_scenario.py": "test_scenario.py.txt",
}


@click.command(name="new")
@click.argument("name")
@click.option("--in", "folder", type=click.Path(file_okay=False, path_type=Path), default=Path("fmus"),
              show_default=True, help="Folder of components.")  # fmt: skip
@click.option("--project", is_flag=True, help="A folder NAME with a component, a scenario, its test and a CI file.")
def command(name: str, folder: Path, project: bool) -> None:
    """Write fmus/NAME/ with model.py, README.md and expected.csv: a first-order lag to start from.

    \b
    twin new my_part          then edit fmus/my_part/model.py
    twin test my_part         as Python, compiled and as FMU the same, to the bit
    twin build my_part        build/3.0/my_part.fmu and build/2.0/my_part.fmu
    twin new my_rig --project
    """
    if not NAME.fullmatch(name) or keyword.iskeyword(name):
        raise TwinError(f"{name!r} cannot be a component's name. Use lower case with underscores, such as my_part.")
    if project:
        made = new_project(name)
        say(f"{made}: written. Then: cd {made}; twin run {name}; python -m pytest")
        return
    among = "fmus" in (folder.name, folder.parent.name)  # beside the others, or in a kind of its own
    if among and not folder.is_absolute() and name in known():
        raise TwinError(f"{name!r} is a component already. Choose another name, or it would hide that one here.")
    place, class_name = new_component(folder / name)
    shown = name if among or place.is_absolute() else f"{'.'.join(place.parts)}.model:{class_name}"
    say(f"{place}: written. Edit {place / 'model.py'}, then: twin test {shown}")


def refuse_existing(place: Path) -> None:
    """TwinError if something is there already: nothing is written over."""
    if place.exists():
        raise TwinError(f"{place} exists already. Choose another name, or remove it first.")


def template(file: str, /, **words: str) -> str:
    """A template with its words filled in."""
    return (resources.files("twin.cli") / "templates" / file).read_text().format(**words)


def titled(name: str) -> str:
    """A name as a title."""
    return name.replace("_", " ").capitalize()


def new_component(place: Path) -> tuple[Path, str]:
    """Write the folder of a component; its class's name too."""
    refuse_existing(place)
    title, class_name = titled(place.name), "".join(part.capitalize() for part in place.name.split("_"))
    files = {
        "__init__.py": "",
        "model.py": template("model.py.txt", title=title, class_name=class_name),
        "README.md": template("component.md", title=title),
    }
    with whole(place):
        for file, text in files.items():
            write_atomically(place / file, text)

        from twin.conformance import reference

        reference.regenerate(written(place, class_name), place / "expected.csv")
    return place, class_name


@contextmanager
def whole(place: Path) -> Iterator[None]:
    """Make a folder that stays only if all is written into it."""
    place.mkdir(parents=True)
    try:
        yield
    except BaseException:
        shutil.rmtree(place, ignore_errors=True)
        raise


def new_project(name: str) -> Path:
    """Write the folder of a project."""
    place, part = Path(name), f"{name}_plant"
    refuse_existing(place)
    with whole(place):
        new_component(place / "fmus" / part)
        for file, source in PROJECT.items():
            path = place / file.format(name=name)
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(path, template(f"project/{source}", name=name, part=part, title=titled(name)))
    return place


def known() -> list[str]:
    """Components that there are."""
    from twin.component import catalog
    from twin.errors import DeclarationError

    try:
        return catalog.names()
    except DeclarationError:
        return []


def written(place: Path, class_name: str) -> Any:
    """The component class of a folder, wherever that is."""
    spec = util.spec_from_file_location(f"{place.name}.model", place / "model.py")
    assert spec is not None
    assert spec.loader is not None
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, class_name)
