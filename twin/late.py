"""Names of a package whose files are imported when somebody asks for them first: what a run does not need costs it nothing."""

from __future__ import annotations

import importlib
import sys
import threading
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping


def names(package: str, places: Mapping[str, str]) -> Callable[[str], Any]:
    """`__getattr__` of a package: its names, each with the module that has it, or "" if it is one."""

    def __getattr__(name: str) -> Any:  # noqa: N807 - so that tracebacks show what it is
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if not places[name]:
            return importlib.import_module(f"{package}.{name}")
        module = importlib.import_module(f"{package}.{places[name]}")

        # all of it: the import itself put the module there, maybe in its function's place
        for one in (one for one, place in places.items() if place == places[name]):
            setattr(sys.modules[package], one, getattr(module, one))
        return getattr(module, name)

    return __getattr__


@contextmanager
def beside(*tasks: Callable[[], object]) -> Iterator[None]:
    """Do what nobody waits for on another core, while native code runs here or a disk is waited for."""

    def work() -> None:
        for task in tasks:
            task()

    thread = threading.Thread(target=work, name="beside", daemon=True)
    with suppress(RuntimeError):  # no memory for it
        if tasks:
            thread.start()
    try:
        yield
    finally:
        if thread.ident is not None:
            thread.join()  # none is on its way when a process is forked


def ahead(*modules: str) -> AbstractContextManager[None]:
    """Import modules beside; whoever needs one that fails is told then."""

    def take(name: str) -> None:
        with suppress(ImportError):
            importlib.import_module(name)

    return beside(*(partial(take, name) for name in modules if name not in sys.modules))
