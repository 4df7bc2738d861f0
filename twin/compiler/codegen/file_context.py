"""Declarations that precede the functions of a C file: helpers, prototypes, constants, structs of several results."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twin.compiler.builtins import HELPERS, LIBM, NAMED, Word
from twin.compiler.codegen.code import number, wrapped
from twin.compiler.names import Names, safe_global
from twin.compiler.resolve import FunctionSource, remark
from twin.compiler.structs import block_comment, clean
from twin.compiler.types import (
    C_NAMES,
    LETTERS,
    Array,
    Field,
    Nothing,
    Record,
    Scalar,
    Struct,
    Tuple,
    Type,
    as_table,
    of_constant,
)

if TYPE_CHECKING:
    import numpy as np

OVERLAID = {"state_array": "All states", "derivative_array": "The derivatives of all states"}


class FileContext:
    """Collects what the functions of a file use; each name is given once."""

    def __init__(self, structs: list[Struct], *, line_directives: bool = False) -> None:
        self.structs, self.line_directives = structs, line_directives
        self.names = Names()
        for struct in structs:
            self.names.take(struct.name)
            for own in OVERLAID:
                name = f"{struct.prefix}_{own}" if len(structs) > 1 else own
                self.names.taken |= {name, f"{name}_read"}
        for word in (*HELPERS, *LIBM.values()):
            self.names.take(word.name)
        self.constants: dict[tuple[str, str], tuple[str, str]] = {}  # name and value -> name in C, text
        self.used: dict[str, Word] = {}
        self.tuples: dict[str, str] = {}
        self.overlays: dict[str, str] = {}

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

    def constant(self, source: FunctionSource, name: str, value: Any) -> str:
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
            first = next(field.name for field in struct.fields.values() if field.offset == own.offset)
            self.overlays[name] = (
                f"/* {OVERLAID[own.name]}, which lie one after another, as one array. */\n"
                f"static inline {constant}double *{name}({constant}{struct.name} *self)\n{{\n"
                f"    return ({constant}double *)({constant}void *)(({constant}unsigned char *)self + "
                f"offsetof({struct.name}, {first}));\n}}"
            )
        return name


def letters(kind: Type) -> str:
    """A letter per value, for the name of a struct."""
    return "".join(LETTERS[item] if isinstance(item, Scalar) else f"_{letters(item)}_" for item in kind.items)  # type: ignore[union-attr]


def braces(values: Any) -> str:
    """Nested lists as an initializer."""
    return f"{{{', '.join(map(braces, values))}}}" if isinstance(values, list) else number(values).text
