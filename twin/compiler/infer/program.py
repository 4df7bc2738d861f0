"""Functions as they are called: each once for a combination of argument types, before those that call it."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from types import FunctionType
from typing import TYPE_CHECKING, Any

from twin.compiler.resolve import FunctionSource, source_of
from twin.compiler.types import INTEGER, UNKNOWN, Type

if TYPE_CHECKING:
    from collections.abc import Callable

    from twin.compiler.builtins import Word


@dataclass(eq=False, slots=True)
class TypedFunction:
    """A function with the types it is called with; what inference found, and later its name in C."""

    source: FunctionSource
    arguments: tuple[Type, ...]
    types: dict[int, Type] = field(default_factory=dict)  # of expressions, by identity of their nodes
    locals: dict[str, Type] = field(default_factory=dict)
    calls: dict[int, TypedFunction | Word] = field(default_factory=dict)
    bound: dict[int, list[ast.expr | Any]] = field(default_factory=dict)  # arguments in the order of parameters
    roots: dict[str, str] = field(default_factory=dict)  # local name of an array -> argument it lies in
    writes: set[str] = field(default_factory=set)  # arguments whose memory it changes
    mutable: set[str] = field(default_factory=set)  # those, and arguments that C cannot show as const
    nonnegative: set[str] = field(default_factory=set)  # arguments that no caller gives a negative number
    result: Type = UNKNOWN
    acts: bool = False  # whether it does more than compute a result
    name: str = ""

    @property
    def where(self) -> str:
        """File and line."""
        return f"{self.source.file.shown}:{self.source.tree.lineno}"


class Program:
    """The functions that an entry reaches, each before those that call it. `infer` finds a function's types."""

    def __init__(self, infer: Callable[[Program, TypedFunction], object]) -> None:
        self.functions: dict[tuple[Any, ...], TypedFunction] = {}
        self.order: list[TypedFunction] = []
        self._infer = infer
        self._open: list[FunctionType] = []
        self.problems: dict[str, None] = {}  # what cannot become C, statement by statement

    def infer(self, function: FunctionType, arguments: tuple[Type, ...]) -> TypedFunction:
        """The function for these argument types."""
        key = (function, arguments)
        if key not in self.functions:
            source = source_of(function)
            if function in self._open:
                remedy = "Write a loop with known bounds"
                raise source.error(source.tree, f"calls itself, through {self._open[-1].__name__}", remedy)
            self._open.append(function)
            made = TypedFunction(source, arguments)
            try:
                self._infer(self, made)
            finally:
                self._open.pop()
            made.nonnegative = {n for n, kind in zip(source.parameters, arguments, strict=True) if kind == INTEGER}
            self.functions[key] = made
            self.order.append(made)
        return self.functions[key]
