"""Names of a package whose files are imported when somebody asks for them first: what a run does not need costs it nothing."""

from __future__ import annotations

import importlib
import sys
import threading
from contextlib import contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

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


T = TypeVar("T")

SWITCH = 0.5e-3  # [s] after which who works beside lets the others go on


@contextmanager
def beside(*tasks: Callable[[], object], at_once: bool = True) -> Iterator[Callable[[], None]]:
    """Do what nobody waits for on another core, while native code runs here or a disk is waited for.

    `at_once`: else it begins when what this gives is called first.
    """

    def work() -> None:
        for task in tasks:
            task()

    thread = threading.Thread(target=work, name="beside", daemon=True)
    interval = sys.getswitchinterval()

    def begin() -> None:
        if tasks and thread.ident is None:
            sys.setswitchinterval(SWITCH)
            with suppress(RuntimeError):  # no memory for it
                thread.start()

    try:
        if at_once:
            begin()
        yield begin
    finally:
        if thread.ident is not None:
            thread.join()  # none is on its way when a process is forked
        sys.setswitchinterval(interval)


@contextmanager
def ahead(*modules: str, then: Callable[[], object] | None = None, after: float = 0.0) -> Iterator[Callable[[], None]]:
    """Import modules beside, once what this gives is called, and `after` seconds; whoever needs one that fails is told then.

    To load a library keeps all of Python waiting: so not before native code runs for longer than that, or has ended. `then`:
    what to do with them; not again where they were there already.
    """

    def take(what: Callable[[], object]) -> None:
        with suppress(Exception):
            what()

    wanted: list[Callable[[], object]] = [
        partial(importlib.import_module, name) for name in modules if name not in sys.modules
    ]
    if wanted and then is not None:
        wanted.append(then)
    over = threading.Event()
    if wanted:
        wanted.insert(0, partial(over.wait, after))
    with beside(*(partial(take, one) for one in wanted), at_once=False) as begin:
        try:
            yield begin
        finally:
            over.set()


def meanwhile(task: Callable[[], object], here: Callable[[], T]) -> T:
    """What `here` gives, while `task` is done on another core, both to their ends; what fails is raised, the task's first."""
    ended: list[BaseException | None] = []

    def work() -> None:
        try:
            task()
        except BaseException as error:
            ended.append(error)
        else:
            ended.append(None)

    try:
        with beside(work):
            result = here()
    finally:
        if not ended:  # there was no memory for it
            work()
        if ended[0] is not None:
            raise ended[0]
    return result
