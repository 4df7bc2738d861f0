"""A C translation unit: the functions reachable from its entries, preceded by the declarations that they use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from twin.compiler.builtins import HELPERS, LIBM, NAMED, Word
from twin.compiler.codegen import FileContext, FunctionWriter, NonnegativeAnalysis, local_name
from twin.compiler.infer import TypedFunction, program
from twin.compiler.names import safe_global
from twin.compiler.resolve import TranslationError
from twin.compiler.structs import layout_checks, nested, struct_text
from twin.compiler.types import BOOLEAN, Nothing, Record, Scalar, Struct
from twin.errors import BuildError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


@dataclass(frozen=True, slots=True)
class Entry:
    """A function that others call: its symbol, and the types of its arguments after the record: REAL, or the record."""

    symbol: str
    function: Callable[..., Any]
    arguments: tuple[Scalar | str, ...]
    names: tuple[str, ...] = ()


RECORD = "record"  # an argument of an entry: one more record of its kind


class TranslationUnit:
    """Puts functions and what they need in order. `public`: the struct that others see, if not that of the record."""

    def __init__(self, struct: Struct, public: Struct | None, *, line_directives: bool = False) -> None:
        self.struct, self.public = struct, public or struct
        self.program = program()
        self.structs = nested(struct)
        self.needs = FileContext(self.structs, line_directives=line_directives)
        self.needs.names.taken.add(self.public.name)

    def infer(self, entry: Entry) -> TypedFunction:
        """The function of an entry, with all that it calls."""
        record = Record(self.struct)
        return self.program.infer(entry.function, (record, *(record if a == RECORD else a for a in entry.arguments)))  # type: ignore[misc,arg-type]

    def text(self, entries: Sequence[Entry], head: str, includes: Sequence[str], more: Sequence[str] = ()) -> str:
        """The file. `head`: the comment at its begin; `more`: functions after all others."""
        for entry in entries:
            self.needs.names.take(entry.symbol)
        called = [self.infer(entry) for entry in entries]
        if self.program.problems:
            raise TranslationError("\n".join(self.program.problems))
        # a local variable would hide a function or constant of its name
        self.needs.names.taken |= {
            local_name(name) for function in self.program.order for name in function.source.locals
        }
        for function in self.program.order:
            function.name = self.needs.names.take(self._name(function))
        for function in reversed(self.program.order):  # callers first
            NonnegativeAnalysis(self.program, function).propagate_to_callees()
        functions = [FunctionWriter(self.needs, self.program, function).text() for function in self.program.order]
        ends = [self._entry(entry, function) for entry, function in zip(entries, called, strict=True)]
        libm = [declare_libm(word) for name, word in sorted(self.needs.used.items()) if name in LIBM]
        own = self.structs if self.public is not self.struct else []
        parts = [
            head,
            "\n".join(includes),
            "\n".join(["/* of the mathematical library */", *libm] if libm else []),
            "\n".join(text for _, text in self.needs.constants.values()),
            *map(struct_text, own),
            "\n".join(check for struct in self.structs for check in layout_checks(struct)),
            *self.needs.tuples.values(),
            *(word.text for word in HELPERS if word.name in self.needs.used),
            *(word.text for name, word in self.needs.used.items() if name not in LIBM and name not in NAMED),
            *self.needs.overlays.values(),
            *functions,
            *more,
            *ends,
        ]
        return "\n\n".join(part for part in parts if part) + "\n"

    def _name(self, function: TypedFunction) -> str:
        """A function's own name; where a file has several records, behind that of its record."""
        name = function.source.function.__name__.strip("_") or "function"
        first = function.arguments[0] if function.arguments else None
        if len(self.structs) > 1 and isinstance(first, Record):
            name = f"{first.struct.prefix}_{name}"
        return safe_global(name)

    def _entry(self, entry: Entry, function: TypedFunction) -> str:
        """What others call: a status, from a typed record."""
        record = self.public.name
        inner = f"({self.struct.name} *)(void *)" if self.public is not self.struct else ""
        parameters, arguments = [f"{record} *self"], [f"{inner}self"]
        for name, kind in zip(entry.names, entry.arguments, strict=True):
            parameters.append(f"{record} *{name}" if kind == RECORD else f"double {name}")
            arguments.append(f"{inner}{name}" if kind == RECORD else name)
        call = f"{function.name}({', '.join(arguments)})"
        body = f"return (int32_t){call};"
        if isinstance(function.result, Nothing):
            body = f"{call};\n    return 0;"
        elif not isinstance(function.result, Scalar):
            raise BuildError(
                f"({function.where}): `{function.source.function.__name__}` must return a status or nothing."
            )
        elif function.result == BOOLEAN:
            body = f"return {call} ? 1 : 0;"
        return f"int32_t {entry.symbol}({', '.join(parameters)})\n{{\n    {body}\n}}"


def declare_libm(word: Word) -> str:
    """The prototype of a function of libm."""
    return f"double {word.name}({', '.join(['double'] * len(word.arguments))});"
