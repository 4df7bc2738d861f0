"""`twin new NAME`: a component folder that builds and passes its tests as it stands."""

from __future__ import annotations

import keyword
import re
from importlib import resources, util
from pathlib import Path
from typing import Any

import click

from twin.cli.terminal import say
from twin.errors import TwinError

NAME = re.compile(r"[a-z][a-z0-9_]*")


@click.command(name="new")
@click.argument("name")
@click.option("--in", "folder", type=click.Path(file_okay=False, path_type=Path), default=Path("fmus"),
              show_default=True, help="Folder of components.")  # fmt: skip
def command(name: str, folder: Path) -> None:
    """Write fmus/NAME/ with model.py, README.md and expected.csv: a first-order lag to start from.

    \b
    twin new my_part          then edit fmus/my_part/model.py
    twin test my_part         interpreted, compiled and FMU agree to the bit, and with expected.csv
    twin build my_part        build/3.0/my_part.fmu and build/2.0/my_part.fmu
    """
    if not NAME.fullmatch(name) or keyword.iskeyword(name):
        raise TwinError(f"{name!r} cannot be a component's name. Use lower case with underscores, such as my_part.")
    place = folder / name
    if place.exists():
        raise TwinError(f"{place} exists already. Choose another name, or remove it first.")
    among = "fmus" in (folder.name, folder.parent.name)  # beside the others, or in a kind of its own
    if among and not folder.is_absolute() and name in known():
        raise TwinError(f"{name!r} is a component already. Choose another name, or it would hide that one here.")
    title = name.replace("_", " ").capitalize()
    class_name = "".join(part.capitalize() for part in name.split("_"))
    templates = resources.files("twin.cli") / "templates"
    files = {
        "__init__.py": "",
        "model.py": (templates / "model.py.txt").read_text().format(title=title, class_name=class_name),
        "README.md": (templates / "component.md").read_text().format(title=title),
    }
    place.mkdir(parents=True)
    for file, text in files.items():
        (place / file).write_text(text)

    from twin.conformance import reference

    reference.regenerate(written(place, class_name), place / "expected.csv")
    shown = name if among or place.is_absolute() else f"{'.'.join(place.parts)}.model:{class_name}"
    say(f"{place}: written. Edit {place / 'model.py'}, then: twin test {shown}")


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
