"""The tangents of a component: its functions and their helpers, each rewritten once."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass, field
from types import FunctionType
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

from twin.compiler.autodiff.derivative_rules import CALLED
from twin.compiler.autodiff.function import ACTIVE, PLAIN, RECORD, GeneratedLines, UnknownError, dot
from twin.compiler.autodiff.statements import FunctionTangents
from twin.compiler.introspection import names_in
from twin.compiler.resolve import TranslationError, source_of
from twin.component import Float64, define

if TYPE_CHECKING:
    from twin.component import Component


@dataclass(frozen=True, slots=True)
class Tangents:
    """`(self, dot, t, dot_t)`: tangents of the derivatives and outputs `at` a point, and of `first`, initialization."""

    at: Callable[..., Any]
    first: Callable[..., Any]


# functions that the tangents of a component were made from, with what their free names stood for
_origins: WeakKeyDictionary[type[Component], list[tuple[FunctionType, tuple[Any, ...]]]] = WeakKeyDictionary()


def tangents(cls: type[Component]) -> Tangents | str:
    """Tangents of a continuous component, or the reason why there are none; made anew if a value has changed in memory."""
    cached: Tangents | str | None = cls.__dict__.get("_tangents")
    if cached is None or not all(is_same(values, free_values(origin)) for origin, values in _origins.get(cls, ())):
        cached = build(cls)
        cls._tangents = cached  # type: ignore[attr-defined]
    return cached


def free_values(function: FunctionType) -> tuple[Any, ...]:
    """Code of a function, and what its free names stand for now."""
    named = [function.__globals__.get(name) for name in names_in(function.__code__)]
    return function.__code__, *named, *(cell.cell_contents for cell in function.__closure__ or ())


def is_same(values: tuple[Any, ...], others: tuple[Any, ...]) -> bool:
    """Whether these are the same objects."""
    return len(values) == len(others) and all(map(operator.is_, values, others))


def build(cls: type[Component]) -> Tangents | str:
    """Rewrite `derivatives` and `initialize`."""
    derivatives, initialize = getattr(cls, "derivatives", None), getattr(cls, "initialize", None)
    if not isinstance(derivatives, FunctionType):
        return "the component is not continuous"
    library = _Library(frozenset(variable.name for variable in cls.variables if variable.type is Float64))
    try:
        at, _ = library.rewrite(derivatives, (RECORD, ACTIVE))
        start = library.rewrite(initialize, (RECORD,))[0] if isinstance(initialize, FunctionType) else None
    except UnknownError as reason:
        return str(reason)
    finally:
        _origins[cls] = [(function, free_values(function)) for function, _ in library.made]
    return Tangents(*composed(at, start))


def composed(at: Callable[..., Any], start: Callable[..., Any] | None) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """What native code calls: both return a status; initialization is `initialize`, then `derivatives`."""

    def nothing(self: Any, dot: Any) -> None:
        pass

    begin = start or nothing

    def tangent_at(self: Any, dot: Any, t: float, dot_t: float) -> int:
        at(self, t, dot, dot_t)
        return 0

    def tangent_first(self: Any, dot: Any, t: float, dot_t: float) -> int:
        begin(self, dot)
        at(self, t, dot, dot_t)
        return 0

    return tangent_at, tangent_first


@dataclass(slots=True)
class _Library:
    """The rewritten functions of one component."""

    reals: frozenset[str]  # names of its variables that have a tangent
    made: dict[tuple[FunctionType, tuple[str, ...]], tuple[Any, bool] | None] = field(default_factory=dict)

    def rewrite(self, function: FunctionType, kinds: tuple[str, ...]) -> tuple[Any, bool]:
        """A function with tangents for arguments of these kinds, and whether it returns (value, tangent)."""
        key = function, kinds
        if key in self.made:
            cached = self.made[key]
            if cached is None:
                raise UnknownError(f"`{function.__name__}` calls itself")
            return cached
        self.made[key] = None
        opened = self._open(function, kinds)
        self.made[key] = result = defined(opened), opened.returns
        return result

    def _open(self, function: FunctionType, kinds: tuple[str, ...]) -> FunctionTangents:
        name = function.__name__
        try:
            source = source_of(function)
        except TranslationError:
            raise UnknownError(f"the source of `{name}` is not there") from None
        if any(local.startswith(("dot_", "_v", "_d")) for local in source.locals):
            raise UnknownError(f"`{name}` has local names that begin with dot_, _v or _d")
        if len(source.parameters) != len(kinds):
            raise UnknownError(f"`{name}` is called with {len(kinds)} of {len(source.parameters)} arguments")
        kind_of = dict(zip(source.parameters, kinds, strict=True))
        return FunctionTangents(
            source, kind_of, self.reals, self.rewrite, {name for name, kind in kind_of.items() if kind == ACTIVE}
        )


def defined(f: FunctionTangents) -> Any:
    """The rewritten function; its text is written again until it is known which names carry a tangent."""
    before = None
    while before != (len(f.active), f.returns):
        before = len(f.active), f.returns
        f.lines = GeneratedLines()
        f.block(f.source.tree.body)
    function = f.source.function
    dots = [dot(name) for name, kind in f.kinds.items() if kind != PLAIN]
    name = f"{function.__name__.strip('_')}_tangent"
    text = "\n".join([f"def {name}({', '.join([*f.kinds, *dots])}):", *f.lines.text, "    pass", ""])
    scope = {**function.__globals__, **f.source.scope, **f.helpers, **CALLED}
    return define(name, text, scope, f"tangent of {function.__qualname__}")
