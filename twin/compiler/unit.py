"""One C file: the functions that its entries reach, and before them all that they use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.compiler.infer import Function, Program
from twin.compiler.names import Names, safe_global
from twin.compiler.resolve import Source, remark
from twin.compiler.structs import Field, Struct, block_comment, clean, layout_checks, nested, struct_text
from twin.compiler.types import BOOLEAN, C_NAMES, LETTERS, Array, Nothing, Record, Scalar, Tuple, Type, as_table, of_constant
from twin.compiler.words import HELPERS, LIBM, NAMED, Word
from twin.compiler.write import Writer, local_name, number, wrapped
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


OVERLAID = {"state_array": "All states", "derivative_array": "The derivatives of all states"}
RECORD = "record"  # an argument of an entry: one more record of its kind


class Unit:
    """Collects what functions need, and puts it in order."""

    def __init__(self, struct: Struct, public: Struct | None, *, line_directives: bool = False) -> None:
        self.struct, self.public = struct, public or struct
        self.line_directives = line_directives
        self.program = Program()
        self.names = Names()
        self.structs = nested(struct)
        for one in (*self.structs, self.public):
            self.names.take(one.name)
        for one in self.structs:
            for own in OVERLAID:
                name = f"{one.prefix}_{own}" if len(self.structs) > 1 else own
                self.names.taken |= {name, f"{name}_read"}
        for word in (*HELPERS, *LIBM.values()):
            self.names.take(word.name)
        self.constants: dict[tuple[str, str], tuple[str, str]] = {}  # name and value -> name in C, text
        self.used: dict[str, Word] = {}
        self.tuples: dict[str, str] = {}
        self.overlays: dict[str, str] = {}

    # ------------------------------------------------------------------------------------------------ what is needed

    def word(self, word: Word) -> str:
        """The name of a C function, which the file then has or declares."""
        if word.name not in self.used:
            self.used[word.name] = word
            for name in word.needs:
                self.word(NAMED.get(name) or LIBM[name])
        return word.name

    def libm(self, name: str) -> str:
        """The name of a function of libm."""
        return self.word(LIBM[name])

    def constant(self, source: Source, name: str, value: Any) -> str:
        """A number or table of a module, by its name."""
        table = as_table(value)
        key = (name, f"{type(value).__name__} {value!r}" if table is None else f"{table.dtype} {table.tolist()!r}")
        if key not in self.constants:
            own = self.names.take(safe_global(name.replace("__", "_").lstrip("_")) or "constant")
            self.constants[key] = own, self._constant_text(own, value, table, clean(remark(source, name)))
        return self.constants[key][0]

    def _constant_text(self, name: str, value: Any, table: np.ndarray[Any, Any] | None, comment: str) -> str:
        if table is None:
            kind = of_constant(value)
            assert isinstance(kind, Scalar)
            line = f"static const {C_NAMES[kind]} {name} = {number(value.item() if hasattr(value, 'item') else value).text};"
        else:
            kind = of_constant(table)
            assert isinstance(kind, Array)
            shape = "".join(f"[{size}]" for size in table.shape)
            line = f"static const {kind.storage} {name}{shape} = {braces(table.tolist())};"
        if comment and len(line) + len(comment) < 113:
            return f"{line} /* {comment} */"
        lines = wrapped(line)
        if table is not None and table.ndim > 1 and len(lines) > 1:  # a row a line
            head = line.partition("{")[0]
            lines = [f"{head}{{", *(part for row in table.tolist() for part in wrapped(f"    {braces(row)},")), "};"]
        return "\n".join([*(block_comment(comment) if comment else []), *lines])

    def c_type(self, kind: Type) -> str:
        """The C type of a value."""
        if isinstance(kind, Scalar):
            return C_NAMES[kind]
        if isinstance(kind, Nothing):
            return "void"
        assert isinstance(kind, Tuple)
        name = f"tuple_{letters(kind)}_t"
        if name not in self.tuples:
            fields = "".join(f"    {self.c_type(item)} v{i};\n" for i, item in enumerate(kind.items))
            self.tuples[name] = f"typedef struct {{\n{fields}}} {name};"
        return name

    def declare(self, kind: Type, name: str, is_const: bool) -> str:
        """The declaration of a variable or argument."""
        constant = "const " if is_const else ""
        if isinstance(kind, Record):
            return f"{constant}{kind.struct.name} *{name}"
        if isinstance(kind, Array):
            rest = "".join(f"[{size}]" for size in kind.shape[1:])
            return f"{constant}{kind.storage} (*{name}){rest}" if rest else f"{constant}{kind.storage} *{name}"
        return f"{self.c_type(kind)} {name}"

    def overlay(self, struct: Struct, own: Field, is_const: bool) -> str:
        """The function that shows all states, or their derivatives, as one array."""
        constant = "const " if is_const else ""
        name = f"{struct.prefix}_{own.name}" if len(self.structs) > 1 else own.name
        name = f"{name}_read" if is_const else name
        if name not in self.overlays:
            first = next(one.name for one in struct.fields.values() if one.offset == own.offset)
            self.overlays[name] = (
                f"/* {OVERLAID[own.name]}, which lie one after another, as one array. */\n"
                f"static inline {constant}double *{name}({constant}{struct.name} *self)\n{{\n"
                f"    return ({constant}double *)({constant}void *)(({constant}unsigned char *)self + "
                f"offsetof({struct.name}, {first}));\n}}"
            )
        return name

    # --------------------------------------------------------------------------------------------------------- text

    def infer(self, entry: Entry) -> Function:
        """The function of an entry, with all that it calls."""
        record = Record(self.struct)
        return self.program.infer(entry.function, (record, *(record if a == RECORD else a for a in entry.arguments)))  # type: ignore[misc,arg-type]

    def text(self, entries: Sequence[Entry], head: str, includes: Sequence[str], more: Sequence[str] = ()) -> str:
        """The file. `head`: the comment at its begin; `more`: functions after all others."""
        for entry in entries:
            self.names.take(entry.symbol)
        called = [self.infer(entry) for entry in entries]
        # a local variable would hide a function or constant of its name
        self.names.taken |= {local_name(name) for one in self.program.order for name in one.source.locals}
        for function in self.program.order:
            function.name = self.names.take(self._name(function))
        for function in reversed(self.program.order):  # callers first
            Writer(self, self.program, function).tell_callees()
        functions = [Writer(self, self.program, function).text() for function in self.program.order]
        ends = [self._entry(entry, function) for entry, function in zip(entries, called, strict=True)]
        libm = [declare_libm(word) for name, word in sorted(self.used.items()) if name in LIBM]
        own = self.structs if self.public is not self.struct else []
        parts = [
            head,
            "\n".join(includes),
            "\n".join(["/* of the mathematical library */", *libm] if libm else []),
            "\n".join(text for _, text in self.constants.values()),
            *map(struct_text, own),
            "\n".join(check for one in self.structs for check in layout_checks(one)),
            *self.tuples.values(),
            *(word.text for word in HELPERS if word.name in self.used),
            *(word.text for name, word in self.used.items() if name not in LIBM and name not in NAMED),
            *self.overlays.values(),
            *functions,
            *more,
            *ends,
        ]
        return "\n\n".join(part for part in parts if part) + "\n"

    def _name(self, function: Function) -> str:
        """A function's own name; where a file has several records, behind that of its record."""
        name = function.source.function.__name__.strip("_") or "function"
        first = function.arguments[0] if function.arguments else None
        if len(self.structs) > 1 and isinstance(first, Record):
            name = f"{first.struct.prefix}_{name}"
        return safe_global(name)

    def _entry(self, entry: Entry, function: Function) -> str:
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
            raise BuildError(f"({function.where}): `{function.source.function.__name__}` must return a status or nothing.")
        elif function.result == BOOLEAN:
            body = f"return {call} ? 1 : 0;"
        return f"int32_t {entry.symbol}({', '.join(parameters)})\n{{\n    {body}\n}}"


def letters(kind: Type) -> str:
    """A letter per value, for the name of a struct."""
    return "".join(LETTERS[item] if isinstance(item, Scalar) else f"_{letters(item)}_" for item in kind.items)  # type: ignore[union-attr]


def braces(values: Any) -> str:
    """Nested lists as an initializer."""
    return f"{{{', '.join(map(braces, values))}}}" if isinstance(values, list) else number(values).text


def declare_libm(word: Word) -> str:
    """The prototype of a function of libm."""
    return f"double {word.name}({', '.join(['double'] * len(word.arguments))});"
