"""Expressions as C, a function per construct, with the parentheses that C needs and those that compilers ask for."""

from __future__ import annotations

import ast
from typing import Any

from twin.compiler.builtins import NAMED
from twin.compiler.codegen.code import (
    AND,
    ATOM,
    BIT_AND,
    BIT_OR,
    BIT_XOR,
    CHOICE,
    EQUALITY,
    OR,
    PRODUCT,
    RELATION,
    SHIFT,
    SUM,
    UNARY,
    ExpressionCode,
    local_name,
    number,
)
from twin.compiler.codegen.lines import LineWriter
from twin.compiler.infer import OPERATORS, NotStaticError, element
from twin.compiler.structs import SIZES
from twin.compiler.types import BOOLEAN, INTEGER, REAL, Array, Record, Scalar, StaticObject, Tuple, Type

SYMBOLS: dict[type[ast.operator], tuple[str, int]] = {
    ast.Add: ("+", SUM),
    ast.Sub: ("-", SUM),
    ast.Mult: ("*", PRODUCT),
    ast.Div: ("/", PRODUCT),
    ast.BitOr: ("|", BIT_OR),
    ast.BitAnd: ("&", BIT_AND),
    ast.BitXor: ("^", BIT_XOR),
}
WORDS: dict[type[ast.operator], dict[Scalar, str]] = {
    ast.Mod: {REAL: "real_mod", INTEGER: "int_mod"},
    ast.FloorDiv: {REAL: "real_floor_div", INTEGER: "int_floor_div"},
    ast.Pow: {REAL: "power", INTEGER: "int_power"},
    ast.LShift: {INTEGER: "shift_left"},
    ast.RShift: {INTEGER: "shift_right"},
}
COMPARED: dict[type[ast.cmpop], tuple[str, int]] = {
    ast.Eq: ("==", EQUALITY),
    ast.NotEq: ("!=", EQUALITY),
    ast.Lt: ("<", RELATION),
    ast.LtE: ("<=", RELATION),
    ast.Gt: (">", RELATION),
    ast.GtE: (">=", RELATION),
}


class ExpressionWriter(LineWriter, ast.NodeVisitor):
    """Expressions of one function."""

    def expression(self, node: ast.expr) -> ExpressionCode:
        """An expression; in an ordered statement its reads and calls are kept in lines before it."""
        code: ExpressionCode = self.visit(node)
        if self.ordered and isinstance(self.type(node), Scalar):
            is_read = isinstance(node, ast.Attribute | ast.Subscript) and not isinstance(self.type(node), StaticObject)
            is_call = isinstance(node, ast.Call) and id(node) in self.function.calls
            if is_call or (is_read and not code.text.isidentifier()):
                return self.keep(code, self.type(node))
        return code

    def integer(self, node: ast.expr) -> ExpressionCode:
        """Return an expression converted to integer."""
        return self.convert(self.expression(node), self.type(node), INTEGER)

    def real(self, node: ast.expr) -> ExpressionCode:
        """Return an expression converted to real."""
        return self.convert(self.expression(node), self.type(node), REAL)

    def convert(self, code: ExpressionCode, kind: Type, wanted: Type) -> ExpressionCode:
        """A value as another type of number."""
        if kind == wanted:
            return code
        if isinstance(kind, Tuple) and isinstance(wanted, Tuple):
            values = self.keep(code, kind).text
            pairs = zip(kind.items, wanted.items, strict=True)
            parts = [self.convert(ExpressionCode(f"{values}.v{i}"), a, b).text for i, (a, b) in enumerate(pairs)]
            return ExpressionCode(f"({self.needs.c_type(wanted)}){{{', '.join(parts)}}}")
        if not isinstance(kind, Scalar):
            return code
        if wanted == REAL:
            if code.text.lstrip("-").isdigit():
                return ExpressionCode(f"{code.text}.0", code.level)
            return ExpressionCode(f"(double){code.at(UNARY)}", UNARY)
        if wanted == BOOLEAN:
            return ExpressionCode(f"{code.at(RELATION)} != {'0.0' if kind == REAL else '0'}", EQUALITY)
        if kind == REAL:
            return ExpressionCode(f"(int64_t){code.at(UNARY)}", UNARY)
        if code.text in ("true", "false"):
            return ExpressionCode("1" if code.text == "true" else "0")
        return ExpressionCode(f"(int64_t){code.at(UNARY)}", UNARY)

    def condition(self, node: ast.expr) -> ExpressionCode:
        """The truth of an expression."""
        if isinstance(node, ast.BoolOp):
            if not (self.ordered and any(map(self.has_effect, node.values[1:]))):
                return self._joined(node)
            return self._stepwise(node)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return self.visit_UnaryOp(node)
        return self.convert(self.expression(node), self.type(node), BOOLEAN)

    def _joined(self, node: ast.BoolOp) -> ExpressionCode:
        symbol, level = ("&&", AND) if isinstance(node.op, ast.And) else ("||", OR)
        parts = []
        for value in node.values:
            code = self.condition(value)
            parts.append(code.at(EQUALITY) if code.level != level else f"({code.text})")
        return ExpressionCode(f" {symbol} ".join(parts), level)

    def _stepwise(self, node: ast.BoolOp) -> ExpressionCode:
        """`and`, `or` with calls that have effects: one after the other, as long as it is open."""
        name = self.temporary()
        self.emit(f"bool {name} = {self.condition(node.values[0]).text};")
        for value in node.values[1:]:
            with self.block_of(f"if ({'' if isinstance(node.op, ast.And) else '!'}{name}) {{"):
                self.emit(f"{name} = {self.condition(value).text};")
        return ExpressionCode(name)

    def visit_Constant(self, node: ast.Constant) -> ExpressionCode:
        assert isinstance(node.value, bool | int | float)
        return number(node.value)

    def visit_Name(self, node: ast.Name) -> ExpressionCode:
        if node.id in self.source.locals:
            return ExpressionCode(local_name(node.id))
        return self.global_value(node, node.id, self.source.value(node.id))

    def global_value(self, node: ast.expr, name: str, value: Any) -> ExpressionCode:
        """A constant of a module by its name."""
        kind = self.type(node)
        if isinstance(kind, StaticObject):
            return ExpressionCode("")
        return ExpressionCode(self.needs.constant(self.source, name, value))

    def visit_Attribute(self, node: ast.Attribute) -> ExpressionCode:
        base = self.type(node.value)
        if isinstance(base, Record):
            return self.field(node, base)
        value = self.inference.static(node)
        return self.global_value(node, ast.unparse(node).replace(".", "_"), value)

    def field(self, node: ast.Attribute, base: Record) -> ExpressionCode:
        record = self.expression(node.value)
        overlay = base.struct.overlays.get(node.attr)
        if overlay is not None:
            is_const = self.inference.root(node.value) not in self.function.mutable
            return ExpressionCode(f"{self.needs.overlay(base.struct, overlay, is_const)}({record.text})")
        own = base.struct.fields[node.attr]
        # a member of a group is held by its address
        inside = record.text[2:-1] if record.text.startswith("(&") else None
        member = f"{inside}.{own.name}" if inside else f"{record.at(ATOM)}->{own.name}"
        return ExpressionCode(f"(&{member})") if own.struct is not None else ExpressionCode(member)

    def lvalue(self, node: ast.expr) -> ExpressionCode:
        """Return the C lvalue of a target."""
        if isinstance(node, ast.Name):
            return ExpressionCode(local_name(node.id))
        code: ExpressionCode = self.visit(node)
        return code

    def visit_Subscript(self, node: ast.Subscript) -> ExpressionCode:
        base = self.type(node.value)
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if isinstance(base, Tuple):
            return self._item(node, base, indices)
        if isinstance(base, StaticObject):
            value = self.inference.static(node)
            name = "".join(c if c.isalnum() else "_" for c in ast.unparse(node)).strip("_")
            return self.global_value(node, name, value)
        assert isinstance(base, Array)
        text = self.expression(node.value).at(ATOM)
        for index, size in zip(indices, base.shape, strict=False):
            text += f"[{self.index(index, size).text}]"
        return ExpressionCode(text)

    def _item(self, node: ast.Subscript, base: Tuple, indices: list[ast.expr]) -> ExpressionCode:
        """One of several values: a field of their struct, or a choice among all."""
        values = self.expression(node.value).at(ATOM)
        try:
            return ExpressionCode(f"{values}.v{self.inference.position(node, indices, len(base.items))}")
        except NotStaticError:
            index, kind = self.index(indices[0], len(base.items)), self.type(node)
        items = [self.convert(ExpressionCode(f"{values}.v{i}"), own, kind) for i, own in enumerate(base.items)]
        text = items[-1].text
        for i in range(len(items) - 2, -1, -1):
            text = f"{index.at(SHIFT)} == {i} ? {items[i].at(OR)} : {text if i == len(items) - 2 else f'({text})'}"
        return ExpressionCode(text, CHOICE)

    def index(self, node: ast.expr, size: int) -> ExpressionCode:
        """Return an array index; one that may be negative counts from the end, as in Python."""
        try:
            value = self.inference.static(node)
        except NotStaticError:
            code = self.integer(node)
            if self.is_nonnegative(node):
                return code
            return ExpressionCode(f"{self.needs.word(NAMED['from_end'])}({code.text}, {size})")
        if isinstance(node, ast.Name) and value >= 0:
            return self.integer(node)
        return ExpressionCode(str(value % size))

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

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ExpressionCode:
        if isinstance(node.op, ast.Not):
            kind = self.type(node.operand)
            if isinstance(kind, Scalar) and kind != BOOLEAN and not isinstance(node.operand, ast.BoolOp):
                return ExpressionCode(
                    f"{self.expression(node.operand).at(RELATION)} == {'0.0' if kind == REAL else '0'}", EQUALITY
                )
            return ExpressionCode(f"!{self.condition(node.operand).at(UNARY)}", UNARY)
        kind = self.type(node)
        inner = self.convert(self.expression(node.operand), self.type(node.operand), kind)
        if isinstance(node.op, ast.UAdd):
            return inner
        symbol = "-" if isinstance(node.op, ast.USub) else "~"
        if kind == INTEGER and self.is_narrow(node.operand) and not isinstance(node.operand, ast.Constant):
            inner = ExpressionCode(f"(int64_t){inner.at(UNARY)}", UNARY)
        text = inner.at(UNARY)
        return ExpressionCode(f"{symbol}({text})" if text.startswith("-") else f"{symbol}{text}", UNARY)

    def visit_BinOp(self, node: ast.BinOp) -> ExpressionCode:
        kind = self.type(node)
        assert isinstance(kind, Scalar)
        folded = self._folded(node, kind)
        if folded is not None:
            return folded
        if type(node.op) in WORDS:
            word = NAMED[WORDS[type(node.op)][kind]]
            parts = [self.convert(self.expression(side), self.type(side), kind) for side in (node.left, node.right)]
            return ExpressionCode(f"{self.needs.word(word)}({', '.join(part.text for part in parts)})")
        symbol, level = SYMBOLS[type(node.op)]
        left = self.convert(self.expression(node.left), self.type(node.left), kind)
        if kind == INTEGER and self.is_narrow(node.left) and self.is_narrow(node.right):
            left = ExpressionCode(f"(int64_t){left.at(UNARY)}", UNARY)  # C would compute in 32 bits
        right = self.convert(self.expression(node.right), self.type(node.right), kind)
        if level < SUM:  # bits: compilers ask for parentheses
            same = left.level == level
            return ExpressionCode(f"{left.text if same else left.at(UNARY)} {symbol} {right.at(UNARY)}", level)
        return ExpressionCode(f"{left.at(level)} {symbol} {right.at(level + 1)}", level)

    def is_narrow(self, node: ast.expr) -> bool:
        """Whether C sees a whole number of less than 64 bits: a small field, a literal, a Boolean."""
        if isinstance(node, ast.Constant):
            return isinstance(node.value, int) and -(2**31) <= node.value < 2**31
        if self.type(node) == BOOLEAN:
            return True
        if isinstance(node, ast.Attribute | ast.Subscript) and not self.ordered:
            if isinstance(node, ast.Subscript) and isinstance(self.type(node.value), Tuple | StaticObject):
                return False
            if isinstance(node, ast.Attribute) and not isinstance(self.type(node.value), Record):
                return False
            return SIZES[self.storage(node)] < 8
        if isinstance(node, ast.UnaryOp):
            return isinstance(node.operand, ast.Constant)
        return isinstance(node, ast.IfExp) and self.is_narrow(node.body) and self.is_narrow(node.orelse)

    def _folded(self, node: ast.BinOp, kind: Scalar) -> ExpressionCode | None:
        """Whole numbers and powers that are known: C would compute the first in 32 bits, the second otherwise."""
        if kind == REAL and not isinstance(node.op, ast.Pow | ast.Mod | ast.FloorDiv):
            return None
        literals = all(isinstance(side, ast.Constant | ast.UnaryOp) for side in (node.left, node.right))
        if kind != REAL and not literals and not isinstance(node.op, ast.LShift):
            return None
        try:
            value = OPERATORS[type(node.op)](self.inference.static(node.left), self.inference.static(node.right))
        except (NotStaticError, ArithmeticError, TypeError, ValueError):
            return None
        return number(float(value) if kind == REAL else value)

    def visit_BoolOp(self, node: ast.BoolOp) -> ExpressionCode:
        """`and`, `or` as a value: the first that decides."""
        kind = self.type(node)
        if kind == BOOLEAN:
            return self.condition(node)
        is_and = isinstance(node.op, ast.And)
        if self.ordered and self.has_effect(node):
            name = self.temporary()
            self.emit(f"{self.needs.declare(kind, name, False)} = {self._value(node.values[0], kind).text};")
            for value in node.values[1:]:
                with self.block_of(f"if ({name} {'!=' if is_and else '=='} {'0.0' if kind == REAL else '0'}) {{"):
                    self.emit(f"{name} = {self._value(value, kind).text};")
            return ExpressionCode(name)
        result = self._value(node.values[-1], kind)
        for value in reversed(node.values[:-1]):
            test, own = self.condition(value), self._value(value, kind)
            a, b = (result, own) if is_and else (own, result)
            result = ExpressionCode(f"{test.at(OR)} ? {a.at(OR)} : {b.at(OR)}", CHOICE)
        return result

    def _value(self, node: ast.expr, kind: Type) -> ExpressionCode:
        return self.convert(self.expression(node), self.type(node), kind)

    def visit_Compare(self, node: ast.Compare) -> ExpressionCode:
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
        return ExpressionCode(" && ".join(part.at(EQUALITY) for part in parts), AND)

    def _compare_two(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> ExpressionCode:
        a, b = self.type(left), self.type(right)
        assert isinstance(a, Scalar)
        assert isinstance(b, Scalar)
        both = Scalar(max(a.kind, b.kind))
        symbol, level = COMPARED[type(op)]
        first, second = self.convert(self.expression(left), a, both), self.convert(self.expression(right), b, both)
        return ExpressionCode(f"{first.at(SHIFT)} {symbol} {second.at(SHIFT)}", level)

    def _membership(self, node: ast.Compare) -> ExpressionCode:
        """`x in (a, b)`: one comparison each."""
        sought, right = node.left, node.comparators[0]
        if isinstance(right, ast.Tuple):
            parts = [self._compare_two(sought, ast.Eq(), element) for element in right.elts]
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
                ExpressionCode(
                    f"{value} == {self.convert(ExpressionCode(f'{text}[{i}]'), item, both).at(SHIFT)}", EQUALITY
                )
                for i in range(kind.shape[0])
            ]
        joined = ExpressionCode(" || ".join(part.at(EQUALITY) for part in parts), OR) if len(parts) > 1 else parts[0]
        return ExpressionCode(f"!({joined.text})", UNARY) if isinstance(node.ops[0], ast.NotIn) else joined

    def visit_IfExp(self, node: ast.IfExp) -> ExpressionCode:
        kind = self.type(node)
        if self.ordered and (self.has_effect(node.body) or self.has_effect(node.orelse)):
            name = self.temporary()
            self.emit(f"{self.needs.declare(kind, name, False)};")
            with self.block_of(f"if ({self.condition(node.test).text}) {{", "} else {"):
                self.emit(f"{name} = {self._value(node.body, kind).text};")
            self.depth += 1
            self.emit(f"{name} = {self._value(node.orelse, kind).text};")
            self.depth -= 1
            self.emit("}")
            return ExpressionCode(name)
        test = self.condition(node.test)
        a, b = self._value(node.body, kind), self._value(node.orelse, kind)
        return ExpressionCode(f"{test.at(OR)} ? {a.at(OR)} : {b.at(OR)}", CHOICE)

    def visit_Tuple(self, node: ast.Tuple) -> ExpressionCode:
        kind = self.type(node)
        parts = [self.expression(element).text for element in node.elts]
        return ExpressionCode(f"({self.needs.c_type(kind)}){{{', '.join(parts)}}}")
