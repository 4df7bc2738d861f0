"""Finding components by name: a folder of `fmus`, or `module:Class`."""

from __future__ import annotations

import difflib
import importlib
import inspect
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from twin.component.component import Component
from twin.errors import DeclarationError, TwinError, described

if TYPE_CHECKING:
    from types import ModuleType


def _folders() -> list[Path]:
    """Folders of the `fmus` package: that of the current directory first, then those on the path, then the project's.

    All of them count, with or without `__init__.py`: a person's own components stand beside the project's. So do folders
    in them that hold components of one kind.
    """
    here = Path.cwd()
    roots = [here, *(Path(entry or here) for entry in sys.path), Path(__file__).parents[2]]
    found = list(dict.fromkeys(str(place) for root in roots if (place := root.absolute() / "fmus").is_dir()))
    try:
        if found and "fmus" not in sys.modules and str(Path(found[-1]).parent) not in sys.path:
            sys.path.append(str(Path(found[-1]).parent))
        package = importlib.import_module("fmus")
    except ModuleNotFoundError:
        raise DeclarationError(f"There is no folder `fmus` in {here}. Run this from the project's folder.") from None
    kinds = [str(model.parents[1]) for root in found for model in sorted(Path(root).glob("*/*/model.py"))]
    package.__path__ = list(dict.fromkeys([*found, *kinds, *package.__path__]))
    return [Path(place) for place in package.__path__]


def names() -> list[str]:
    """Names of all components: folders of `fmus` with a model.py."""
    return sorted({place.parent.name for folder in _folders() for place in folder.glob("*/model.py")})


def component(name: str) -> type[Component]:
    """Import the component class of a folder of `fmus`, or of `module:Class`."""
    module_name, colon, class_name = name.partition(":")
    if colon:
        if (here := str(Path.cwd())) not in sys.path:
            sys.path.append(here)  # a person's own module, where the command is run
        return _named(_imported(module_name, name), class_name, name)
    known = names()
    if name not in known:
        raise DeclarationError(f"There is no component {name!r} in fmus/.{_hint(name, known)}")
    module = _imported(f"fmus.{name}.model", name)
    place = next(folder / name for folder in _folders() if (folder / name / "model.py").exists())
    if not (place / "model.py").samefile(module.__file__ or ""):
        raise DeclarationError(
            f"{place}: is hidden by {module.__file__}. Add an empty __init__.py to it, or rename it."
        )
    found = _defined(module)
    if len(found) != 1:
        listed = ", ".join(sorted(found)) or "none"
        raise DeclarationError(f"{module.__name__}: one Component was expected, found {listed}. Move others elsewhere.")
    return next(iter(found.values()))


def _imported(module: str, name: str) -> ModuleType:
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name and (module == error.name or module.startswith(error.name + ".")):
            raise DeclarationError(f"{name}: there is no module {error.name}. Write `module:Class`.") from None
        raise DeclarationError(f"{name}: cannot be imported: {described(error)}. Correct it there.") from None
    except (TwinError, KeyboardInterrupt):
        raise
    except BaseException as error:  # a person's module may fail in any way, also by SystemExit
        raise DeclarationError(f"{name}: cannot be imported: {described(error)}. Correct it there.") from None


def _defined(module: ModuleType) -> dict[str, type[Component]]:
    """Component classes that a module defines itself; names that begin with an underscore are its own affair."""
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
    known = sorted(_defined(module))
    raise DeclarationError(f"{name}: {module.__name__} has no component {class_name!r}.{_hint(class_name, known)}")


def _hint(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name, known, 1, cutoff=0.4)
    if near:
        return f" Did you mean {near[0]!r}?"
    return f" There are: {', '.join(known)}." if known else ""
