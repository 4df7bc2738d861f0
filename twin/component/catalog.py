"""Finding components by name: a folder of `fmus`, or `module:Class`."""

from __future__ import annotations

import ast
import importlib
import inspect
import os
import sys
from glob import glob
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from twin.component import source_import
from twin.component.component import Component
from twin.errors import DeclarationError, TwinError, described, nearest

if TYPE_CHECKING:
    from types import ModuleType


source_import.install()


def fmus_folders() -> list[str]:
    """Folders called `fmus`: that of the current directory first, then those on the path, then the project's."""
    here = os.getcwd()  # noqa: PTH109 - called for each component: paths of pathlib take ten times as long
    roots = [here, *(entry or here for entry in sys.path), str(Path(__file__).parents[2])]
    folders = dict.fromkeys(os.path.join(here, root, "fmus") for root in roots)  # noqa: PTH118
    return [folder for folder in folders if os.path.isdir(folder)]  # noqa: PTH112


def _kinds(roots: list[str]) -> list[str]:
    """Folders in them that hold components of one kind."""
    return list(
        dict.fromkeys(
            f"{root}{os.sep}{os.path.dirname(os.path.dirname(model))}"  # noqa: PTH120
            for root in roots
            for model in sorted(glob("*/*/model.py", root_dir=root))  # noqa: PTH207 - that of pathlib is slower
        )
    )


def _folders() -> list[Path]:
    """Folders of the `fmus` package, as it is then imported.

    All of them count, with or without `__init__.py`: user components are added to the project's. So do folders
    in them that hold components of one kind.
    """
    here, folders = Path.cwd(), fmus_folders()
    try:
        if folders and "fmus" not in sys.modules and str(Path(folders[-1]).parent) not in sys.path:
            sys.path.append(str(Path(folders[-1]).parent))
        package = importlib.import_module("fmus")
    except ModuleNotFoundError:
        raise DeclarationError(f"There is no folder `fmus` in {here}. Run this from the project's folder.") from None
    package.__path__ = list(dict.fromkeys([*folders, *_kinds(folders), *package.__path__]))
    return [Path(folder) for folder in package.__path__]


def names() -> list[str]:
    """Names of all components: folders of `fmus` with a model.py. Nothing is imported."""
    roots = fmus_folders()
    if not roots:
        raise DeclarationError(f"There is no folder `fmus` in {Path.cwd()}. Run this from the project's folder.")
    folders = dict.fromkeys([*roots, *_kinds(roots), *getattr(sys.modules.get("fmus"), "__path__", ())])
    return sorted({os.path.dirname(model) for folder in folders for model in glob("*/model.py", root_dir=folder)})  # noqa: PTH120, PTH207


def summary(name: str) -> str:
    """Return the first docstring line of a component's file, or an empty string. Nothing is imported."""
    folder = component_folder(name)
    try:
        said = ast.get_docstring(ast.parse((folder / "model.py").read_text(encoding="utf-8"))) if folder else None
    except (OSError, SyntaxError, ValueError):
        return ""
    return (said or "").partition("\n")[0]


def component_folder(name: str) -> Path | None:
    """Return the folder of a component without listing all components; None if there is none in the usual folders."""
    roots = fmus_folders() if name.isidentifier() else []
    kinds = (f"{root}/{kind}" for root in roots for kind in sorted(os.listdir(root)))  # noqa: PTH208 - quicker
    looked = (folder for folder in chain(roots, kinds) if os.path.isfile(f"{folder}/{name}/model.py"))  # noqa: PTH113
    return next((Path(folder, name) for folder in looked), None)


def component(name: str) -> type[Component]:
    """Import the component class of a folder of `fmus`, or of `module:Class`."""
    module_name, colon, class_name = name.partition(":")
    if colon:
        return _named(module(module_name, name), class_name, name)
    folder = component_folder(name)
    if folder is None or str(folder.parent) not in getattr(sys.modules.get("fmus"), "__path__", ()):
        refuse_unknown(name, names())
        folder = next(root / name for root in _folders() if (root / name / "model.py").exists())
    model = _imported(f"fmus.{name}.model", name)
    if not (folder / "model.py").samefile(model.__file__ or ""):
        raise DeclarationError(
            f"{folder}: is hidden by {model.__file__}. Add an empty __init__.py to it, or rename it."
        )
    classes = _defined(model)
    if len(classes) != 1:
        listed = ", ".join(sorted(classes)) or "none"
        raise DeclarationError(f"{model.__name__}: one Component was expected, found {listed}. Move others elsewhere.")
    return next(iter(classes.values()))


def refuse_unknown(name: str, every: list[str]) -> None:
    """Raise DeclarationError if there is no component with this name."""
    if name not in every:
        searched = f"{Path.cwd() / 'fmus'} or the project's"
        advice = "One of your own must be in `fmus` of the folder where you run this."
        raise DeclarationError(f"There is no component {name!r} in {searched}.{_hint(name, every)} {advice}")


def module(path: str, name: str) -> ModuleType:
    """Import a person's own module, also from the folder where the command is run; messages call it `name`."""
    if (here := str(Path.cwd())) not in sys.path:
        sys.path.append(here)
    return _imported(path, name)


def _imported(module: str, name: str) -> ModuleType:
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name and (module == error.name or module.startswith(error.name + ".")):
            raise DeclarationError(
                f"{name}: there is no module {error.name}. Write `module:name`, and run this where it is, or install it."
            ) from None
        raise DeclarationError(f"{name}: cannot be imported: {described(error)}. Correct it there.") from None
    except (TwinError, KeyboardInterrupt):
        raise
    except BaseException as error:  # a person's module may fail in any way, also by SystemExit
        raise DeclarationError(f"{name}: cannot be imported: {described(error)}. Correct it there.") from None


def _defined(module: ModuleType) -> dict[str, type[Component]]:
    """Component classes that a module defines itself; names that begin with an underscore are private."""
    return {
        key: value
        for key, value in vars(module).items()
        if inspect.isclass(value)
        and issubclass(value, Component)
        and value.__module__ == module.__name__
        and not key.startswith("_")
    }


def _named(module: ModuleType, class_name: str, name: str) -> type[Component]:
    value = getattr(module, class_name, None)
    if inspect.isclass(value) and issubclass(value, Component):
        return value
    class_names = sorted(_defined(module))
    raise DeclarationError(
        f"{name}: {module.__name__} has no component {class_name!r}.{_hint(class_name, class_names)}"
    )


def _hint(name: str, class_names: list[str]) -> str:
    return f" {nearest(name, class_names)}" if class_names else ""
