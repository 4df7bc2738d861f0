"""Import of components from the text of their files, never from cached bytecode.

Python takes cached bytecode for current if the source has the same size and modification time, so that an edit of equal length
with a preserved time (`cp -p`, a container's layer) would go unseen. Applies to modules outside of the engine, the standard
library and installed packages; a person's `fmus` counts wherever it is.
"""

from __future__ import annotations

import re
import sys
from functools import lru_cache
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import decode_source
from typing import TYPE_CHECKING, Any

from twin import installed

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import CodeType, ModuleType

ENGINE = {"twin", "hw_bridge"}


@lru_cache(maxsize=256)
def compiled(path: str, text: str) -> CodeType:
    """Code of a text: for the import, and for the comparison of a function with what its file says."""
    return compile(text, path, "exec", dont_inherit=True)


class TextLoader(SourceFileLoader):
    """Compiles a module from its text at each import."""

    @staticmethod
    def source_to_code(data: Any, path: Any = "<string>") -> CodeType:  # type: ignore[override]
        """Compile the text of a file, once for each content."""
        return compiled(str(path), decode_source(data))

    def path_stats(self, path: Any) -> Any:  # noqa: ARG002 - importlib's signature
        """Refuse what bytecode would be compared with; importlib then neither reads nor writes any."""
        raise OSError("bytecode is not used")


class TextFinder(MetaPathFinder):
    """Finds the modules that `TextLoader` loads, where Python's own finder does."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """What Python's own finder finds, for a person's module with a loader that reads its text."""
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and type(spec.loader) is SourceFileLoader and is_of_person(name, spec.origin or ""):
            spec.loader = TextLoader(name, spec.origin or "")
        return spec


def is_of_person(name: str, origin: str) -> bool:
    """Whether a module is neither the engine's nor the standard library's nor an installed package's."""
    if name.partition(".")[0] in ENGINE or origin.startswith(installed.STANDARD_LIBRARY):
        return False
    folders = re.split(r"[/\\]", origin)
    return "fmus" in folders or not {"site-packages", "dist-packages"}.intersection(folders)


def find_user_file(name: str) -> ModuleSpec | None:
    """Find a module that `TextLoader` would load, without importing it or the packages that it is in; None if there is none."""
    package, _, last = name.rpartition(".")
    loaded = sys.modules.get(package)
    if loaded is not None and (last in vars(loaded) or not hasattr(loaded, "__path__")):
        return None  # an attribute
    spec, path = None, None
    for count in range(1, len(parts := name.split(".")) + 1):
        spec = TextFinder().find_spec(".".join(parts[:count]), path)
        if spec is None or type(spec.loader) is not TextLoader:
            return None
        if spec.submodule_search_locations is None and count < len(parts):
            return None
        path = spec.submodule_search_locations
    return spec


def install() -> None:
    """Put the finder before Python's own, behind those that others have put in front, such as pytest's."""
    if any(isinstance(finder, TextFinder) for finder in sys.meta_path):
        return
    positions = [number for number, finder in enumerate(sys.meta_path) if finder is PathFinder]
    sys.meta_path.insert(positions[0] if positions else len(sys.meta_path), TextFinder())
