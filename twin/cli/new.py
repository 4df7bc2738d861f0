"""`twin new NAME`: a component folder that builds and passes its tests as it stands."""

from __future__ import annotations

import keyword
import re
from importlib import resources
from pathlib import Path

import click

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
    title = name.replace("_", " ").capitalize()
    class_name = "".join(part.capitalize() for part in name.split("_"))
    templates = resources.files("twin") / "templates"
    files = {
        "__init__.py": "",
        "model.py": (templates / "model.py.txt").read_text().format(title=title, class_name=class_name),
        "README.md": (templates / "component.md").read_text().format(title=title),
    }
    place.mkdir(parents=True)
    if not (folder / "__init__.py").exists():
        (folder / "__init__.py").write_text('"""Components, one folder each."""\n')
    for file, text in files.items():
        (place / file).write_text(text)

    from twin import catalog, reference

    reference.regenerate(catalog.component(name), place / "expected.csv")
    click.echo(f"{place}: written. Edit {place / 'model.py'}, then: twin test {name}")
