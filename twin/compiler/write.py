"""Third stage: the text of a function in C, from its tree and the types that were inferred.

Expressions are written with the parentheses that C needs, and those that compilers ask for. Where calls with effects
meet other reads in one expression, C leaves the order open and Python does not: the parts then get lines of their own.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from twin.compiler.infer import OPERATORS, Function, Inference, NotStaticError, Program, element, is_range
from twin.compiler.locals import Finder, Places
from twin.compiler.names import BUILTIN, safe
from twin.compiler.structs import SIZES, WIDTH, block_comment, clean
from twin.compiler.types import (
    BOOLEAN,
    C_NAMES,
    COMPUTED,
    INTEGER,
    REAL,
    Array,
    Known,
    Nothing,
    Record,
    Scalar,
    Tuple,
    Type,
    of_constant,
)
from twin.compiler.words import NAMED, WHOLE, Word

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from twin.compiler.unit import Unit

ATOM, UNARY, PRODUCT, SUM, SHIFT, RELATION, EQUALITY, BIT_AND, BIT_XOR, BIT_OR, AND, OR, CHOICE = range(16, 3, -1)

SYMBOLS: dict[type[ast.operator], tuple[str, int]] = {
    ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT), ast.Div: ("/", PRODUCT),
    ast.BitOr: ("|", BIT_OR), ast.BitAnd: ("&", BIT_AND), ast.BitXor: ("^", BIT_XOR),
}  # fmt: skip
WORDS: dict[type[ast.operator], dict[Scalar, str]] = {
    ast.Mod: {REAL: "real_mod", INTEGER: "int_mod"}, ast.FloorDiv: {REAL: "real_floor_div", INTEGER: "int_floor_div"},
    ast.Pow: {REAL: "power", INTEGER: "int_power"}, ast.LShift: {INTEGER: "shift_left"},
    ast.RShift: {INTEGER: "shift_right"},
}  # fmt: skip
COMPARED: dict[type[ast.cmpop], tuple[str, int]] = {
    ast.Eq: ("==", EQUALITY), ast.NotEq: ("!=", EQUALITY), ast.Lt: ("<", RELATION), ast.LtE: ("<=", RELATION),
    ast.Gt: (">", RELATION), ast.GtE: (">=", RELATION),
}  # fmt: skip
EXTREMES: dict[Any, dict[Scalar, str]] = {
    min: {REAL: "real_min", INTEGER: "int_min"}, max: {REAL: "real_max", INTEGER: "int_max"},
}  # fmt: skip
BREAK = 116  # longest line


@dataclass(frozen=True, slots=True)
class Code:
    """Text of an expression, and how tightly it binds."""

    text: str
    level: int = ATOM

    def at(self, level: int) -> str:
        """With parentheses unless it binds at least so tightly."""
        return self.text if self.level >= level else f"({self.text})"


def number(value: float) -> Code:
    """A literal."""
    if isinstance(value, bool):
        return Code("true" if value else "false")
    if isinstance(value, int):
        if value == -(2**63):
            return Code("(-9223372036854775807 - 1)")
        return Code(str(value), ATOM if value >= 0 else UNARY)
    if value != value:
        return Code("(0.0 / 0.0)")
    if value in (float("inf"), float("-inf")):
        return Code("(1.0 / 0.0)" if value > 0.0 else "(-1.0 / 0.0)")
    text = repr(float(value))
    return Code(text if "." in text or "e" in text else f"{text}.0", UNARY if text.startswith("-") else ATOM)


class Writer:
    """One function as C."""

    def __init__(self, unit: Unit, program: Program, function: Function) -> None:
        self.unit, self.function, self.source = unit, function, function.source
        self.inference = Inference(program, function)
        self.lines: list[str] = []
        self.depth = 1
        self.ordered = False  # whether the parts of the present expression get lines of their own
        self.count = 0
        ranges = {
            id(node) for node in ast.walk(self.source.tree) if isinstance(node, ast.For) and is_range(node.iter, self.source)
        }
        self.places: Places = Finder(self.source.tree, self.source.parameters, ranges).find()
        self.nonnegative: set[str] = set()
        self.nonnegative = self._nonnegative_names()
        self.last_line = 0
        self.made: list[ast.AST] = []  # nodes of our own: kept, since types are noted by identity

    # ---------------------------------------------------------------------------------------------------- the whole

    def text(self) -> str:
        """Head, declarations and body."""
        tree = self.source.tree
        self._unused_parameters()
        for name in self.places.top:
            self.emit(self.declaration(name, None))
        body = tree.body
        if body and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
            body = body[1:]
        self.last_line = tree.lineno
        self.block(body)
        return "\n".join([*self._comment(), self.head(), "{", *self.lines, "}"])

    def head(self) -> str:
        """`static double name(const sheath_t *self, double t)`."""
        return "\n".join(wrapped(f"static {self.unit.c_type(self.function.result)} {self.function.name}({self._parameters()})"))

    def _parameters(self) -> str:
        parts = []
        for name, kind in zip(self.source.parameters, self.function.arguments, strict=True):
            if isinstance(kind, Known):
                continue
            is_const = name not in self.function.mutable
            if isinstance(kind, Array):
                sizes = "".join(f"[{size}]" for size in kind.shape)
                is_const = kind.constant or (is_const and len(kind.shape) == 1)
                parts.append(f"{'const ' if is_const else ''}{kind.storage} {local_name(name)}{sizes}")
            else:
                parts.append(self.unit.declare(kind, local_name(name), is_const))
        return ", ".join(parts) or "void"

    def _comment(self) -> list[str]:
        """The docstring, and where the function stands in Python."""
        text = ast.get_docstring(self.source.tree) or ""
        file = self.source.file
        place = file.name.strip("<>") if file.is_made else f"{file.name}:{self.source.tree.lineno}"
        lines = [clean(line).rstrip() for line in text.splitlines()]
        if not lines:
            return [f"/* {place} */"]
        if len(lines) == 1 and len(lines[0]) + len(place) < BREAK - 12:
            return [f"/* {lines[0]} ({place}) */"]
        return [f"/* {lines[0]}", *(f"   {line}".rstrip() for line in lines[1:]), f"   ({place}) */"]

    def _unused_parameters(self) -> None:
        used = {n.id for n in ast.walk(self.source.tree) if isinstance(n, ast.Name)}
        for name, kind in zip(self.source.parameters, self.function.arguments, strict=True):
            if name not in used and not isinstance(kind, Known):
                self.emit(f"(void){local_name(name)};")

    def emit(self, line: str) -> None:
        """A line at the present depth, broken where it is too long."""
        self.lines += wrapped("    " * self.depth + line)

    def emit_head(self, line: str, node: ast.AST) -> None:
        """The head of a block, with its line in Python."""
        self.emit(line)
        if self.source.file.is_made:
            return
        marked = f"{self.lines[-1]} /* line {getattr(node, 'lineno', 0)} */"
        if len(marked) <= WIDTH:
            self.lines[-1] = marked

    def temporary(self) -> str:
        """A fresh name."""
        self.count += 1
        return f"part_{self.count}"

    # --------------------------------------------------------------------------------------------------- statements

    def block(self, statements: Sequence[ast.stmt]) -> None:
        """Statements at the present depth."""
        for statement in statements:
            self.statement(statement)

    def statement(self, node: ast.stmt) -> None:
        """One statement, with the comments that stand above it and beside it, and what has to be declared before it."""
        if isinstance(node, ast.Pass):
            return
        for name in self.places.before.get(id(node), []):
            self.emit(self.declaration(name, None))
        self._remarks(node)
        if self.unit.line_directives and not self.source.file.is_made:
            self.lines.append(f'#line {node.lineno} "{self.source.file.name}"')
        self.ordered = False
        STATEMENTS[type(node)](self, node)

    def _remarks(self, node: ast.stmt) -> None:
        """Comments of the source between the last statement and the end of this one's first line."""
        file = self.source.file
        head = node.body[0].lineno - 1 if isinstance(node, ast.If | ast.For | ast.While) else node.end_lineno
        found = []
        for line in range(self.last_line + 1, (head or node.lineno) + 1):
            text = file.above.get(line) or file.beside.get(line)
            if text:
                found.append(text)
        self.last_line = max(self.last_line, head or node.lineno)
        if found:
            self.lines += block_comment(clean(" ".join(found)), "    " * self.depth)

    def declaration(self, name: str, value: str | None, *, constant: bool = False) -> str:
        """`double x = value;`."""
        kind = self.function.locals[name]
        declared = self.unit.declare(kind, local_name(name), self._is_const(name, kind))
        if constant:
            star = declared.rfind("*")
            if isinstance(kind, Array):
                declared = f"{declared[: star + 1]}const {declared[star + 1 :]}"
            else:
                declared = f"const {declared}"
        zero = "{0}" if isinstance(kind, Tuple) else "0.0" if kind == REAL else "false" if kind == BOOLEAN else "0"
        text = f"{declared} = {zero if value is None else value};"
        return text if name in self.places.read else f"{text}\n{'    ' * self.depth}(void){local_name(name)};"

    def _is_const(self, name: str, kind: Type) -> bool:
        """Whether a local name of an array only reads it."""
        return isinstance(kind, Array) and (kind.constant or self.function.roots.get(name) not in self.function.mutable)

    def assign(self, node: ast.Assign | ast.AnnAssign) -> None:
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        if node.value is None:
            return
        self.order([node.value, *targets], node)
        if len(targets) == 1 and isinstance(targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple):
            self.assign_each(targets[0].elts, node.value.elts, node)
            return
        kind = self.type(node.value)
        if len(targets) > 1 or isinstance(targets[0], ast.Tuple):
            whole = self.keep(self.expression(node.value), kind)
            for target in targets:
                self.store(target, whole, kind, node)
            return
        self.store(targets[0], self.expression(node.value), kind, node)

    def assign_each(self, targets: list[ast.expr], values: list[ast.expr], node: ast.stmt) -> None:
        """Several to several: through names of their own where a value reads what was set before it."""
        names = {n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)}
        plain = all(isinstance(target, ast.Name) for target in targets)
        crossed = any(isinstance(n, ast.Name) and n.id in names for value in values[1:] for n in ast.walk(value))
        if plain and not crossed:
            for target, value in zip(targets, values, strict=True):
                self.store(target, self.expression(value), self.type(value), node)
            return
        kept = [(self.keep(self.expression(value), self.type(value)), self.type(value)) for value in values]
        for target, (code, kind) in zip(targets, kept, strict=True):
            self.store(target, code, kind, node)

    def keep(self, code: Code, kind: Type) -> Code:
        """Give a value a name of its own."""
        name = self.temporary()
        if isinstance(kind, Array):
            self.emit(f"{self.unit.declare(kind, name, True)} = {code.text};")
        else:
            self.emit(f"const {self.unit.declare(kind, name, False)} = {code.text};")
        return Code(name)

    def store(self, target: ast.expr, code: Code, kind: Type, node: ast.stmt) -> None:
        """A value goes to its place."""
        if isinstance(target, ast.Name):
            wanted = self.function.locals[target.id]
            text = self.convert(code, kind, wanted).text
            if target.id in self.places.at.get(id(node), ()):
                self.emit(self.declaration(target.id, text, constant=target.id in self.places.once))
            else:
                self.emit(f"{local_name(target.id)} = {text};")
        elif isinstance(target, ast.Tuple):
            for i, place in enumerate(target.elts):
                if isinstance(kind, Tuple):
                    self.store(place, Code(f"{code.at(ATOM)}.v{i}"), kind.items[i], node)
                else:
                    assert isinstance(kind, Array)
                    self.store(place, Code(f"{code.at(ATOM)}[{i}]"), element(kind, 1), node)
        else:
            place = self.place(target)
            self.emit(f"{place.text} = {self.stored(code, kind, target)};")

    def stored(self, code: Code, kind: Type, target: ast.expr) -> str:
        """A value as the field's type."""
        storage = self.storage(target)
        wanted = COMPUTED[storage]
        converted = self.convert(code, kind, wanted)
        if SIZES[storage] < 8 and wanted == INTEGER:
            if kind == BOOLEAN:
                return f"({storage}){code.at(UNARY)}"
            return converted.text if converted.text.isdigit() else f"({storage}){converted.at(UNARY)}"
        return converted.text

    def storage(self, target: ast.expr) -> str:
        """How a variable or element lies in memory."""
        base = target
        while isinstance(base, ast.Subscript):
            base = base.value
        kind = self.inference.expression(base) if isinstance(base, ast.Attribute) else self.type(base)
        if isinstance(kind, Array):
            return kind.storage
        assert isinstance(base, ast.Attribute)
        record = self.type(base.value)
        assert isinstance(record, Record)
        return record.struct.fields[base.attr].storage

    def augmented(self, node: ast.AugAssign) -> None:
        value = ast.copy_location(ast.BinOp(node.target, node.op, node.value), node)
        self.made.append(value)
        kind = self.inference.expression(value)
        wanted = self.type(node.target)
        symbol, _ = SYMBOLS.get(type(node.op), ("", 0))
        wide = isinstance(node.target, ast.Name) or SIZES[self.storage(node.target)] == 8
        effect = self.has_effect(node.value)
        if symbol and kind == wanted and kind != BOOLEAN and wide and not effect:
            right = self.convert(self.expression(node.value), self.type(node.value), kind)
            self.emit(f"{self.place(node.target).text} {symbol}= {right.text};")
            return
        self.ordered = effect
        self.store(node.target, self.expression(value), kind, node)

    def branch(self, node: ast.If) -> None:
        chosen = self.inference.chosen(node)
        if chosen is not None:
            self.block(chosen)
            return
        self.order([node.test], node)
        self.emit_head(f"if ({self.condition(node.test).text}) {{", node)
        self.inside(node.body)
        rest = node.orelse
        while rest:
            other = rest[0]
            is_chain = len(rest) == 1 and isinstance(other, ast.If) and self._is_simple_chain(other)
            if not is_chain:
                self.emit("} else {")
                self.inside(rest)
                break
            assert isinstance(other, ast.If)
            self._remarks(other)
            self.emit_head(f"}} else if ({self.condition(other.test).text}) {{", other)
            self.inside(other.body)
            rest = other.orelse
        self.emit("}")

    def _is_simple_chain(self, node: ast.If) -> bool:
        """Whether `elif` can be `else if`: nothing has to stand before it."""
        if self.inference.chosen(node) is not None or self.places.before.get(id(node)):
            return False
        return not self.needs_order([node.test])

    def inside(self, statements: Sequence[ast.stmt]) -> None:
        """A block."""
        self.depth += 1
        self.block(statements)
        self.depth -= 1

    def loop_while(self, node: ast.While) -> None:
        if self.needs_order([node.test]):
            self.emit_head("while (true) {", node)
            self.depth += 1
            self.ordered = True
            stop = self.condition(node.test)
            self.emit(f"if (!{stop.at(UNARY)}) {{")
            self.emit("    break;")
            self.emit("}")
            self.depth -= 1
        else:
            self.emit_head(f"while ({self.condition(node.test).text}) {{", node)
        self.inside(node.body)
        self.emit("}")

    def loop_for(self, node: ast.For) -> None:
        if not is_range(node.iter, self.source):
            self._loop_over(node)
            return
        assert isinstance(node.iter, ast.Call)
        assert isinstance(node.target, ast.Name)
        bounds = node.iter.args
        low, high = (None, bounds[0]) if len(bounds) == 1 else (bounds[0], bounds[1])
        step = self.inference.static(bounds[2]) if len(bounds) == 3 else 1
        self.order(bounds[:2], node)
        name = node.target.id
        is_counter = name in self.places.counters
        is_read = name in self.places.read
        counter = local_name(name) if is_counter else self.temporary()
        begin = Code("0") if low is None else self.whole(low)
        end = self.whole(high)
        if not self._is_steady(high, node):
            end = self.keep(end, INTEGER)
        symbol = "<" if step > 0 else ">"
        if step < 0 and end.text == "-1":
            symbol, end = ">=", Code("0")
        onward = {1: f"{counter}++", -1: f"{counter}--"}.get(step, f"{counter} += {step}")
        self.emit_head(f"for (int64_t {counter} = {begin.text}; {counter} {symbol} {end.at(SHIFT)}; {onward}) {{", node)
        if not is_counter and is_read:
            self.depth += 1
            self.store(node.target, Code(counter), INTEGER, node)
            self.depth -= 1
        self.inside(node.body)
        self.emit("}")

    def _is_steady(self, node: ast.expr, loop: ast.For) -> bool:
        """Whether a bound stays the same while the loop runs, so that it may be asked for each time."""
        try:
            self.inference.static(node)
        except NotStaticError:
            changed = {n.id for n in ast.walk(loop) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
            simple = (ast.Name, ast.Constant, ast.BinOp, ast.UnaryOp, ast.operator, ast.unaryop, ast.expr_context)
            parts = list(ast.walk(node))
            names = {n.id for n in parts if isinstance(n, ast.Name)}
            return all(isinstance(one, simple) for one in parts) and not names & changed
        return True

    def _loop_over(self, node: ast.For) -> None:
        """`for x in table`, `for a, b in table`."""
        kind = self.type(node.iter)
        assert isinstance(kind, Array)
        self.order([node.iter], node)
        array = self.expression(node.iter)
        counter = self.temporary()
        self.emit_head(f"for (int64_t {counter} = 0; {counter} < {kind.shape[0]}; {counter}++) {{", node)
        self.depth += 1
        self.store(node.target, Code(f"{array.at(ATOM)}[{counter}]"), element(kind, 1), node)
        self.depth -= 1
        self.inside(node.body)
        self.emit("}")

    def give(self, node: ast.Return) -> None:
        result = self.function.result
        if node.value is None or isinstance(result, Nothing):
            value_type = None if node.value is None else self.type(node.value)
            if node.value is not None and isinstance(value_type, Nothing):
                self.order([node.value], node)
                self.emit(f"{self.expression(node.value).text};")
            self.emit("return;")
            return
        self.order([node.value], node)
        if isinstance(node.value, ast.Tuple) and isinstance(result, Tuple):
            items = zip(node.value.elts, result.items, strict=True)
            parts = [self.convert(self.expression(one), self.type(one), kind).text for one, kind in items]
            self.emit(f"return ({self.unit.c_type(result)}){{{', '.join(parts)}}};")
            return
        self.emit(f"return {self.convert(self.expression(node.value), self.type(node.value), result).text};")

    def call_statement(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant):
            return
        assert isinstance(node.value, ast.Call)
        inner = [*node.value.args, *(one.value for one in node.value.keywords)]
        self.ordered = self.needs_order(inner)
        text = self.call_text(node.value).text
        is_empty = isinstance(self.type(node.value), Nothing)
        self.emit(f"{text};" if is_empty else f"(void){text};")

    def leave(self, node: ast.stmt) -> None:
        self.emit("break;" if isinstance(node, ast.Break) else "continue;")

    # ------------------------------------------------------------------------------------------------------- order

    def has_effect(self, node: ast.AST) -> bool:
        """Whether an expression calls a function that changes something."""
        return self.inference.has_effect(node)

    def order(self, nodes: Sequence[ast.expr | None], _: ast.stmt) -> None:
        """Decide whether the parts of a statement's expressions need lines of their own."""
        self.ordered = self.needs_order([one for one in nodes if one is not None])

    def needs_order(self, nodes: Sequence[ast.expr]) -> bool:
        """Whether a call with an effect meets another call or a read of memory that is not its argument."""
        calls = [n for one in nodes for n in ast.walk(one) if id(n) in self.function.calls and self._acts(n)]
        if not calls:
            return False
        if len(calls) > 1:
            return True
        own = {id(n) for n in ast.walk(calls[0])}
        for one in nodes:
            for n in ast.walk(one):
                called = self.function.calls.get(id(n))
                is_read = (isinstance(n, ast.Attribute | ast.Subscript) and isinstance(n.ctx, ast.Load)) or (
                    called is not None and self._reads(called)
                )
                if is_read and id(n) not in own and not isinstance(self.function.types.get(id(n)), Known):
                    return True
        return isinstance(self.function.calls[id(calls[0])], Function) and self._reads_between(calls[0])

    def _acts(self, node: ast.AST) -> bool:
        return self.function.calls[id(node)].acts

    @staticmethod
    def _reads(called: Function | Word) -> bool:
        """Whether the result of a call may depend on memory."""
        if isinstance(called, Word):
            return called.reads
        return any(isinstance(kind, Array | Record) for kind in called.arguments)

    def _reads_between(self, call: ast.AST) -> bool:
        """Whether an argument of a call with an effect is itself one."""
        return any(id(n) in self.function.calls and self._acts(n) for n in ast.walk(call) if n is not call)

    # -------------------------------------------------------------------------------------------------- expressions

    def type(self, node: ast.expr) -> Type:
        """What was inferred; for parts that were made since, what follows from theirs."""
        kind = self.function.types.get(id(node))
        return self.inference.expression(node) if kind is None else kind

    def expression(self, node: ast.expr) -> Code:
        """An expression; in an ordered statement its reads and calls are kept in lines before it."""
        code = EXPRESSIONS[type(node)](self, node)
        if self.ordered and isinstance(self.type(node), Scalar):
            is_read = isinstance(node, ast.Attribute | ast.Subscript) and not isinstance(self.type(node), Known)
            is_call = isinstance(node, ast.Call) and id(node) in self.function.calls
            if is_call or (is_read and not code.text.isidentifier()):
                return self.keep(code, self.type(node))
        return code

    def whole(self, node: ast.expr) -> Code:
        """A whole number."""
        return self.convert(self.expression(node), self.type(node), INTEGER)

    def real(self, node: ast.expr) -> Code:
        """A real number."""
        return self.convert(self.expression(node), self.type(node), REAL)

    def convert(self, code: Code, kind: Type, wanted: Type) -> Code:
        """A value as another type of number."""
        if kind == wanted or not isinstance(kind, Scalar):
            return code
        if wanted == REAL:
            if code.text.lstrip("-").isdigit():
                return Code(f"{code.text}.0", code.level)
            return Code(f"(double){code.at(UNARY)}", UNARY)
        if wanted == BOOLEAN:
            return Code(f"{code.at(RELATION)} != {'0.0' if kind == REAL else '0'}", EQUALITY)
        if kind == REAL:
            return Code(f"(int64_t){code.at(UNARY)}", UNARY)
        if code.text in ("true", "false"):
            return Code("1" if code.text == "true" else "0")
        return Code(f"(int64_t){code.at(UNARY)}", UNARY)

    def condition(self, node: ast.expr) -> Code:
        """The truth of an expression."""
        if isinstance(node, ast.BoolOp):
            if not (self.ordered and any(map(self.has_effect, node.values[1:]))):
                return self._joined(node)
            return self._stepwise(node)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return self.unary(node)
        return self.convert(self.expression(node), self.type(node), BOOLEAN)

    def _joined(self, node: ast.BoolOp) -> Code:
        symbol, level = ("&&", AND) if isinstance(node.op, ast.And) else ("||", OR)
        parts = []
        for value in node.values:
            code = self.condition(value)
            parts.append(code.at(EQUALITY) if code.level != level else f"({code.text})")
        return Code(f" {symbol} ".join(parts), level)

    def _stepwise(self, node: ast.BoolOp) -> Code:
        """`and`, `or` with calls that have effects: one after the other, as long as it is open."""
        name = self.temporary()
        self.emit(f"bool {name} = {self.condition(node.values[0]).text};")
        for value in node.values[1:]:
            self.emit(f"if ({'' if isinstance(node.op, ast.And) else '!'}{name}) {{")
            self.depth += 1
            self.emit(f"{name} = {self.condition(value).text};")
            self.depth -= 1
            self.emit("}")
        return Code(name)

    def constant(self, node: ast.Constant) -> Code:
        return number(node.value)

    def name(self, node: ast.Name) -> Code:
        if node.id in self.source.locals:
            return Code(local_name(node.id))
        return self.global_value(node, node.id, self.source.value(node.id))

    def global_value(self, node: ast.expr, name: str, value: Any) -> Code:
        """A constant of a module by its name."""
        kind = self.type(node)
        if isinstance(kind, Known):
            return Code("")
        return Code(self.unit.constant(self.source, name, value))

    def attribute(self, node: ast.Attribute) -> Code:
        base = self.type(node.value)
        if isinstance(base, Record):
            return self.field(node, base)
        value = self.inference.static(node)
        return self.global_value(node, ast.unparse(node).replace(".", "_"), value)

    def field(self, node: ast.Attribute, base: Record) -> Code:
        record = self.expression(node.value)
        overlay = base.struct.overlays.get(node.attr)
        if overlay is not None:
            is_const = self.inference.root(node.value) not in self.function.mutable
            return Code(f"{self.unit.overlay(base.struct, overlay, is_const)}({record.text})")
        own = base.struct.fields[node.attr]
        # a member of a group is held by its address
        inside = record.text[2:-1] if record.text.startswith("(&") else None
        place = f"{inside}.{own.name}" if inside else f"{record.at(ATOM)}->{own.name}"
        return Code(f"(&{place})") if own.struct is not None else Code(place)

    def place(self, node: ast.expr) -> Code:
        """Where a value is stored."""
        if isinstance(node, ast.Name):
            return Code(local_name(node.id))
        return EXPRESSIONS[type(node)](self, node)

    def subscript(self, node: ast.Subscript) -> Code:
        base = self.type(node.value)
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if isinstance(base, Tuple):
            return self._item(node, base, indices)
        if isinstance(base, Known):
            value = self.inference.static(node)
            name = "".join(c if c.isalnum() else "_" for c in ast.unparse(node)).strip("_")
            return self.global_value(node, name, value)
        assert isinstance(base, Array)
        text = self.expression(node.value).at(ATOM)
        for index, size in zip(indices, base.shape, strict=False):
            text += f"[{self.index(index, size).text}]"
        return Code(text)

    def _item(self, node: ast.Subscript, base: Tuple, indices: list[ast.expr]) -> Code:
        """One of several values: a field of their struct, or a choice among all."""
        whole = self.expression(node.value).at(ATOM)
        try:
            return Code(f"{whole}.v{self.inference.position(node, indices, len(base.items))}")
        except NotStaticError:
            index, kind = self.index(indices[0], len(base.items)), self.type(node)
        items = [self.convert(Code(f"{whole}.v{i}"), own, kind) for i, own in enumerate(base.items)]
        text = items[-1].text
        for i in range(len(items) - 2, -1, -1):
            text = f"{index.at(SHIFT)} == {i} ? {items[i].at(OR)} : {text if i == len(items) - 2 else f'({text})'}"
        return Code(text, CHOICE)

    def index(self, node: ast.expr, size: int) -> Code:
        """A place in an array; one that may be negative counts from the end, as in Python."""
        try:
            value = self.inference.static(node)
        except NotStaticError:
            code = self.whole(node)
            if self.is_nonnegative(node):
                return code
            return Code(f"{self.unit.word(NAMED['from_end'])}({code.text}, {size})")
        if isinstance(node, ast.Name) and value >= 0:
            return self.whole(node)
        return Code(str(value % size))

    def unary(self, node: ast.UnaryOp) -> Code:
        if isinstance(node.op, ast.Not):
            kind = self.type(node.operand)
            if isinstance(kind, Scalar) and kind != BOOLEAN and not isinstance(node.operand, ast.BoolOp):
                return Code(f"{self.expression(node.operand).at(RELATION)} == {'0.0' if kind == REAL else '0'}", EQUALITY)
            return Code(f"!{self.condition(node.operand).at(UNARY)}", UNARY)
        kind = self.type(node)
        inner = self.convert(self.expression(node.operand), self.type(node.operand), kind)
        if isinstance(node.op, ast.UAdd):
            return inner
        symbol = "-" if isinstance(node.op, ast.USub) else "~"
        if kind == INTEGER and self.is_narrow(node.operand) and not isinstance(node.operand, ast.Constant):
            inner = Code(f"(int64_t){inner.at(UNARY)}", UNARY)
        text = inner.at(UNARY)
        return Code(f"{symbol}({text})" if text.startswith("-") else f"{symbol}{text}", UNARY)

    def binary(self, node: ast.BinOp) -> Code:
        kind = self.type(node)
        assert isinstance(kind, Scalar)
        folded = self._folded(node, kind)
        if folded is not None:
            return folded
        if type(node.op) in WORDS:
            word = NAMED[WORDS[type(node.op)][kind]]
            parts = [self.convert(self.expression(one), self.type(one), kind) for one in (node.left, node.right)]
            return Code(f"{self.unit.word(word)}({', '.join(one.text for one in parts)})")
        symbol, level = SYMBOLS[type(node.op)]
        left = self.convert(self.expression(node.left), self.type(node.left), kind)
        if kind == INTEGER and self.is_narrow(node.left) and self.is_narrow(node.right):
            left = Code(f"(int64_t){left.at(UNARY)}", UNARY)  # C would compute in 32 bits
        right = self.convert(self.expression(node.right), self.type(node.right), kind)
        if level < SUM:  # bits: compilers ask for parentheses
            same = left.level == level
            return Code(f"{left.text if same else left.at(UNARY)} {symbol} {right.at(UNARY)}", level)
        return Code(f"{left.at(level)} {symbol} {right.at(level + 1)}", level)

    def is_narrow(self, node: ast.expr) -> bool:
        """Whether C sees a whole number of less than 64 bits: a small field, a literal, a Boolean."""
        if isinstance(node, ast.Constant) or self.type(node) == BOOLEAN:
            return not isinstance(node, ast.Constant) or -(2**31) <= node.value < 2**31
        if isinstance(node, ast.Attribute | ast.Subscript) and not self.ordered:
            if isinstance(node, ast.Subscript) and isinstance(self.type(node.value), Tuple | Known):
                return False
            if isinstance(node, ast.Attribute) and not isinstance(self.type(node.value), Record):
                return False
            return SIZES[self.storage(node)] < 8
        if isinstance(node, ast.UnaryOp):
            return isinstance(node.operand, ast.Constant)
        return isinstance(node, ast.IfExp) and self.is_narrow(node.body) and self.is_narrow(node.orelse)

    def _folded(self, node: ast.BinOp, kind: Scalar) -> Code | None:
        """Whole numbers and powers that are known: C would compute the first in 32 bits, the second otherwise."""
        if kind == REAL and not isinstance(node.op, ast.Pow | ast.Mod | ast.FloorDiv):
            return None
        literals = all(isinstance(one, ast.Constant | ast.UnaryOp) for one in (node.left, node.right))
        if kind != REAL and not literals and not isinstance(node.op, ast.LShift):
            return None
        try:
            value = OPERATORS[type(node.op)](self.inference.static(node.left), self.inference.static(node.right))
        except (NotStaticError, ArithmeticError, TypeError, ValueError):
            return None
        return number(float(value) if kind == REAL else value)

    def logic(self, node: ast.BoolOp) -> Code:
        """`and`, `or` as a value: the first that decides."""
        kind = self.type(node)
        if kind == BOOLEAN:
            return self.condition(node)
        is_and = isinstance(node.op, ast.And)
        if self.ordered and self.has_effect(node):
            name = self.temporary()
            self.emit(f"{self.unit.declare(kind, name, False)} = {self._value(node.values[0], kind).text};")
            for value in node.values[1:]:
                self.emit(f"if ({name} {'!=' if is_and else '=='} {'0.0' if kind == REAL else '0'}) {{")
                self.depth += 1
                self.emit(f"{name} = {self._value(value, kind).text};")
                self.depth -= 1
                self.emit("}")
            return Code(name)
        result = self._value(node.values[-1], kind)
        for value in reversed(node.values[:-1]):
            test, own = self.condition(value), self._value(value, kind)
            a, b = (result, own) if is_and else (own, result)
            result = Code(f"{test.at(OR)} ? {a.at(OR)} : {b.at(OR)}", CHOICE)
        return result

    def _value(self, node: ast.expr, kind: Type) -> Code:
        return self.convert(self.expression(node), self.type(node), kind)

    def compare(self, node: ast.Compare) -> Code:
        if any(isinstance(op, ast.Is | ast.IsNot) for op in node.ops):
            return number(self.inference.static(node))
        if isinstance(node.ops[0], ast.In | ast.NotIn):
            return self._membership(node)
        parts, left = [], node.left
        for op, right in zip(node.ops, node.comparators, strict=True):
            parts.append(self._compare_two(left, op, right))
            left = right
        if len(parts) == 1:
            return parts[0]
        return Code(" && ".join(part.at(EQUALITY) for part in parts), AND)

    def _compare_two(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> Code:
        a, b = self.type(left), self.type(right)
        assert isinstance(a, Scalar)
        assert isinstance(b, Scalar)
        both = Scalar(max(a.kind, b.kind))
        symbol, level = COMPARED[type(op)]
        one, other = self.convert(self.expression(left), a, both), self.convert(self.expression(right), b, both)
        return Code(f"{one.at(SHIFT)} {symbol} {other.at(SHIFT)}", level)

    def _membership(self, node: ast.Compare) -> Code:
        """`x in (a, b)`: one comparison each."""
        sought, right = node.left, node.comparators[0]
        if isinstance(right, ast.Tuple):
            parts = [self._compare_two(sought, ast.Eq(), one) for one in right.elts]
        else:
            kind = self.type(right)
            assert isinstance(kind, Array)
            text, own = self.expression(right).at(ATOM), self.type(sought)
            item = element(kind, 1)
            assert isinstance(item, Scalar)
            assert isinstance(own, Scalar)
            both = Scalar(max(item.kind, own.kind))
            value = self.convert(self.expression(sought), own, both).at(SHIFT)
            parts = [
                Code(f"{value} == {self.convert(Code(f'{text}[{i}]'), item, both).at(SHIFT)}", EQUALITY)
                for i in range(kind.shape[0])
            ]
        joined = Code(" || ".join(part.at(EQUALITY) for part in parts), OR) if len(parts) > 1 else parts[0]
        return Code(f"!({joined.text})", UNARY) if isinstance(node.ops[0], ast.NotIn) else joined

    def choice(self, node: ast.IfExp) -> Code:
        kind = self.type(node)
        if self.ordered and (self.has_effect(node.body) or self.has_effect(node.orelse)):
            name = self.temporary()
            self.emit(f"{self.unit.declare(kind, name, False)};")
            self.emit(f"if ({self.condition(node.test).text}) {{")
            for arm, end in ((node.body, "} else {"), (node.orelse, "}")):
                self.depth += 1
                self.emit(f"{name} = {self._value(arm, kind).text};")
                self.depth -= 1
                self.emit(end)
            return Code(name)
        test = self.condition(node.test)
        a, b = self._value(node.body, kind), self._value(node.orelse, kind)
        return Code(f"{test.at(OR)} ? {a.at(OR)} : {b.at(OR)}", CHOICE)

    def several(self, node: ast.Tuple) -> Code:
        kind = self.type(node)
        parts = [self.expression(one).text for one in node.elts]
        return Code(f"({self.unit.c_type(kind)}){{{', '.join(parts)}}}")

    # -------------------------------------------------------------------------------------------------------- calls

    def call_text(self, node: ast.Call) -> Code:
        """A call, without keeping its result."""
        called = self.function.calls.get(id(node))
        if isinstance(called, Function):
            return self.user(node, called)
        if isinstance(called, Word):
            folded = self._folded_call(node)
            if folded is not None:
                return folded
            kinds = zip(node.args, called.arguments, strict=True)
            parts = [self.convert(self.expression(one), self.type(one), wanted).text for one, wanted in kinds]
            return Code(f"{self.unit.word(called)}({', '.join(parts)})")
        return self.special(node)

    def _folded_call(self, node: ast.Call) -> Code | None:
        """A function of known numbers: Python's value, since compilers have a mathematical library of their own."""
        if self.type(node) != REAL:
            return None
        try:
            return number(float(self.inference.static(node)))
        except NotStaticError:
            return None

    def user(self, node: ast.Call, called: Function) -> Code:
        parts = []
        for one, kind in zip(self.function.bound[id(node)], called.arguments, strict=True):
            if isinstance(kind, Known):
                continue
            if not isinstance(one, ast.expr):
                parts.append(self._default(one, kind, called))
            elif isinstance(kind, Scalar):
                parts.append(self.convert(self.expression(one), self.type(one), kind).text)
            else:
                code = self.expression(one)
                parts.append(code.text[1:-1] if code.text.startswith("(&") else code.text)
        return Code(f"{called.name}({', '.join(parts)})")

    def _default(self, value: Any, kind: Type, called: Function) -> str:
        """A default value as an argument."""
        if isinstance(kind, Scalar):
            return self.convert(number(value), of_constant(value), kind).text
        return self.unit.constant(called.source, f"{called.name}_default", value)

    def special(self, node: ast.Call) -> Code:
        called = self.inference.static(node.func)
        kind = self.type(node)
        if called in EXTREMES:
            return self._extreme(node, called)
        if called is pow:
            made = ast.copy_location(ast.BinOp(node.args[0], ast.Pow(), node.args[1]), node)
            self.made.append(made)
            return self.expression(made)
        if called is len:
            return number(self.inference.static(node))
        (argument,) = node.args
        code, own = self.expression(argument), self.type(argument)
        if called in WHOLE and own == INTEGER and self.is_narrow(argument):
            return Code(f"(int64_t){code.at(UNARY)}", UNARY)
        if called in WHOLE:
            return self._rounded(code, own, WHOLE[called])
        if kind == BOOLEAN:
            return self.condition(argument)
        if called is float or getattr(called, "__name__", "") == "float64":
            return self.convert(code, own, REAL)
        if kind == REAL:
            return Code(f"{self.unit.libm('fabs')}({code.text})")
        return Code(f"{self.unit.word(NAMED['int_abs'])}({self.convert(code, own, INTEGER).text})")

    def _rounded(self, code: Code, own: Type, function: str) -> Code:
        if own != REAL:
            return self.convert(code, own, INTEGER)
        if not function:
            return Code(f"(int64_t){code.at(UNARY)}", UNARY)
        if function in NAMED:
            return Code(f"{self.unit.word(NAMED[function])}({code.text})")
        return Code(f"(int64_t){self.unit.libm(function)}({code.text})", UNARY)

    def _extreme(self, node: ast.Call, called: Any) -> Code:
        """`min`, `max` from left to right."""
        kind = self.type(node)
        assert isinstance(kind, Scalar)
        kind = REAL if kind == REAL else INTEGER
        name = self.unit.word(NAMED[EXTREMES[called][kind]])
        result = self.convert(self.expression(node.args[0]), self.type(node.args[0]), kind)
        for one in node.args[1:]:
            result = Code(f"{name}({result.text}, {self.convert(self.expression(one), self.type(one), kind).text})")
        return self.convert(result, kind, self.type(node))

    # ------------------------------------------------------------------------------------------------------ indices

    def _nonnegative_names(self) -> set[str]:
        """Local whole numbers that are never negative: all they are set to is not, given that the others are not."""
        values: dict[str, list[ast.expr | None]] = {}
        for node in ast.walk(self.source.tree):
            if isinstance(node, ast.Assign):
                for target in node.targets:
                    if isinstance(target, ast.Name):
                        values.setdefault(target.id, []).append(node.value)
                    elif isinstance(target, ast.Tuple):
                        inner = node.value.elts if isinstance(node.value, ast.Tuple) else [None] * len(target.elts)
                        for one, value in zip(target.elts, inner, strict=False):
                            if isinstance(one, ast.Name):
                                values.setdefault(one.id, []).append(value)
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                values.setdefault(node.target.id, []).append(node.value)
            elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
                made = ast.copy_location(ast.BinOp(ast.Name(node.target.id, ast.Load()), node.op, node.value), node)
                values.setdefault(node.target.id, []).append(made)
            elif isinstance(node, ast.For) and isinstance(node.target, ast.Name):
                values.setdefault(node.target.id, []).append(node.iter if is_range(node.iter, self.source) else None)
            elif isinstance(node, ast.For):
                values.update({name: [None] for name in names_of(node.target)})
        given = self.function.nonnegative
        names = {name for name in values if name not in self.source.parameters or name in given} | given
        while True:
            self.nonnegative = names
            kept = {name for name in names if all(v is not None and self.is_nonnegative(v) for v in values.get(name, ()))}
            if kept == names:
                return names
            names = kept

    def tell_callees(self) -> None:
        """Take from the functions called here the arguments that may be negative."""
        for node in ast.walk(self.source.tree):
            called = self.function.calls.get(id(node))
            if isinstance(called, Function):
                for name, one in zip(called.source.parameters, self.function.bound[id(node)], strict=True):
                    sure = self.is_nonnegative(one) if isinstance(one, ast.expr) else isinstance(one, int) and one >= 0
                    if not sure:
                        called.nonnegative.discard(name)

    def is_nonnegative(self, node: ast.expr) -> bool:
        """Whether a whole number is surely not negative."""
        try:
            return bool(self.inference.static(node) >= 0)
        except (NotStaticError, TypeError):
            pass
        if isinstance(node, ast.Name):
            return node.id in self.nonnegative
        if isinstance(node, ast.BinOp):
            both = self.is_nonnegative(node.left) and self.is_nonnegative(node.right)
            if isinstance(node.op, ast.Mod):
                return self.is_nonnegative(node.right)
            if isinstance(node.op, ast.BitAnd):
                return self.is_nonnegative(node.left) or self.is_nonnegative(node.right)
            return both and isinstance(node.op, ast.Add | ast.Mult | ast.FloorDiv | ast.RShift)
        if isinstance(node, ast.IfExp):
            return self.is_nonnegative(node.body) and self.is_nonnegative(node.orelse)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            inner = [self.is_nonnegative(one) for one in node.args]
            if node.func.id == "range":
                low = inner[0] if len(inner) > 1 else True
                return low and (len(inner) < 3 or self._falls_to_zero(node))
            return any(inner) if node.func.id == "max" else all(inner) if node.func.id in ("min", "abs") else False
        return False

    def _falls_to_zero(self, node: ast.Call) -> bool:
        """Whether a range with a step stays at or above 0."""
        try:
            step, stop = self.inference.static(node.args[2]), self.inference.static(node.args[1])
        except NotStaticError:
            return False
        return bool(step > 0 or stop >= -1)


def local_name(name: str) -> str:
    """A local variable's name in C."""
    name = f"{name}_" if name in BUILTIN else safe(name)
    return name.replace("__", "_") if not name.startswith("_") else f"own{name}"


def names_of(node: ast.AST) -> set[str]:
    """All names in a target."""
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}


def wrapped(line: str) -> list[str]:
    """A line of code in lines that are not too long; comments and text in quotes are left as they are."""
    if "\n" in line:
        return [part for one in line.split("\n") for part in wrapped(one)]
    if len(line) <= BREAK or '"' in line:
        return [line]
    indent = " " * (len(line) - len(line.lstrip()) + 4)
    for sign in (" || ", " && ", ", ", " ? ", " : ", " + ", " - ", " * ", " = "):
        at = line.rfind(sign, len(indent) + 8, BREAK - 1)
        if at > 0:
            cut = at + (len(sign) - 1 if sign in (", ", " = ") else 0)
            return [line[:cut].rstrip(), *wrapped(indent + line[cut:].lstrip())]
    return [line]


STATEMENTS: dict[type[ast.stmt], Callable[[Writer, Any], None]] = {
    ast.Assign: Writer.assign, ast.AnnAssign: Writer.assign, ast.AugAssign: Writer.augmented, ast.If: Writer.branch,
    ast.While: Writer.loop_while, ast.For: Writer.loop_for, ast.Return: Writer.give, ast.Expr: Writer.call_statement,
    ast.Break: Writer.leave, ast.Continue: Writer.leave,
}  # fmt: skip

EXPRESSIONS: dict[type[ast.expr], Callable[[Writer, Any], Code]] = {
    ast.Constant: Writer.constant, ast.Name: Writer.name, ast.Attribute: Writer.attribute,
    ast.Subscript: Writer.subscript, ast.UnaryOp: Writer.unary, ast.BinOp: Writer.binary, ast.BoolOp: Writer.logic,
    ast.Compare: Writer.compare, ast.IfExp: Writer.choice, ast.Tuple: Writer.several, ast.Call: Writer.call_text,
}  # fmt: skip

__all__ = ["C_NAMES", "Code", "Writer", "number", "wrapped"]
