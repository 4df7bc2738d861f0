"""A function as C: its head, declarations and statements, a function per construct."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from twin.compiler.codegen.calls import CallWriter
from twin.compiler.codegen.code import ATOM, BREAK, SHIFT, UNARY, ExpressionCode, local_name, wrapped
from twin.compiler.codegen.expressions import SYMBOLS
from twin.compiler.codegen.file_context import FileContext
from twin.compiler.infer import NotStaticError, Program, TypedFunction, element, is_range
from twin.compiler.locals import DeclarationSiteFinder, DeclarationSites
from twin.compiler.structs import SIZES, block_comment, clean
from twin.compiler.syntax_tree import walk
from twin.compiler.types import BOOLEAN, COMPUTED, INTEGER, REAL, Array, Nothing, StaticObject, Tuple, Type


class FunctionWriter(CallWriter):
    """One function as C."""

    def __init__(self, needs: FileContext, program: Program, function: TypedFunction) -> None:
        super().__init__(needs, program, function)
        loops = (node for node in walk(self.source.tree) if isinstance(node, ast.For))
        ranges = {id(node) for node in loops if is_range(node.iter, self.source)}
        self.sites: DeclarationSites = DeclarationSiteFinder(self.source.tree, self.source.parameters, ranges).find()
        self.last_line = 0

    def text(self) -> str:
        """Head, declarations and body."""
        tree = self.source.tree
        self._unused_parameters()
        for name in self.sites.top:
            self.emit(self.declaration(name, None))
        body = tree.body
        if body and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
            body = body[1:]
        self.last_line = tree.lineno
        self.block(body)
        return "\n".join([*self._comment(), self.head(), "{", *self.lines, "}"])

    def head(self) -> str:
        """`static double name(const sheath_t *self, double t)`."""
        return "\n".join(
            wrapped(f"static {self.needs.c_type(self.function.result)} {self.function.name}({self._parameters()})")
        )

    def _parameters(self) -> str:
        parts = []
        for name, kind in zip(self.source.parameters, self.function.arguments, strict=True):
            if isinstance(kind, StaticObject):
                continue
            is_const = name not in self.function.mutable
            if isinstance(kind, Array):
                sizes = "".join(f"[{size}]" for size in kind.shape)
                is_const = kind.constant or (is_const and len(kind.shape) == 1)
                parts.append(f"{'const ' if is_const else ''}{kind.storage} {local_name(name)}{sizes}")
            else:
                parts.append(self.needs.declare(kind, local_name(name), is_const))
        return ", ".join(parts) or "void"

    def _comment(self) -> list[str]:
        """The docstring, and where the function stands in Python."""
        text = ast.get_docstring(self.source.tree) or ""
        file = self.source.file
        location = file.name.strip("<>") if file.is_made else f"{file.name}:{self.source.tree.lineno}"
        lines = [clean(line).rstrip() for line in text.splitlines()]
        if not lines:
            return [f"/* {location} */"]
        if len(lines) == 1 and len(lines[0]) + len(location) < BREAK - 12:
            return [f"/* {lines[0]} ({location}) */"]
        return [f"/* {lines[0]}", *(f"   {line}".rstrip() for line in lines[1:]), f"   ({location}) */"]

    def _unused_parameters(self) -> None:
        used = {n.id for n in walk(self.source.tree) if isinstance(n, ast.Name)}
        for name, kind in zip(self.source.parameters, self.function.arguments, strict=True):
            if name not in used and not isinstance(kind, StaticObject):
                self.emit(f"(void){local_name(name)};")

    def block(self, statements: Sequence[ast.stmt]) -> None:
        """Statements at the present depth."""
        for statement in statements:
            self.statement(statement)

    def statement(self, node: ast.stmt) -> None:
        """Emit a statement, its comments (above and trailing) and the declarations that must precede it."""
        if isinstance(node, ast.Pass):
            return
        for name in self.sites.before.get(id(node), []):
            self.emit(self.declaration(name, None))
        self._remarks(node)
        if self.needs.line_directives and not self.source.file.is_made:
            self.lines.append(f'#line {node.lineno} "{self.source.file.name}"')
        self.ordered = False
        self.visit(node)

    def _remarks(self, node: ast.stmt) -> None:
        """Comments of the source between the last statement and the end of this one's first line."""
        file = self.source.file
        head = node.body[0].lineno - 1 if isinstance(node, ast.If | ast.For | ast.While) else node.end_lineno
        comments = []
        for line in range(self.last_line + 1, (head or node.lineno) + 1):
            text = file.above.get(line) or file.trailing.get(line)
            if text:
                comments.append(text)
        self.last_line = max(self.last_line, head or node.lineno)
        if comments:
            self.lines += block_comment(clean(" ".join(comments)), "    " * self.depth)

    def declaration(self, name: str, value: str | None, *, constant: bool = False) -> str:
        """`double x = value;`."""
        kind = self.function.locals[name]
        declared = self.needs.declare(kind, local_name(name), self._is_const(name, kind))
        if constant:
            star = declared.rfind("*")
            if isinstance(kind, Array):
                declared = f"{declared[: star + 1]}const {declared[star + 1 :]}"
            else:
                declared = f"const {declared}"
        zero = "{0}" if isinstance(kind, Tuple) else "0.0" if kind == REAL else "false" if kind == BOOLEAN else "0"
        text = f"{declared} = {zero if value is None else value};"
        return text if name in self.sites.read else f"{text}\n{'    ' * self.depth}(void){local_name(name)};"

    def _is_const(self, name: str, kind: Type) -> bool:
        """Whether a local name of an array only reads it."""
        return isinstance(kind, Array) and (kind.constant or self.function.roots.get(name) not in self.function.mutable)

    def visit_Assign(self, node: ast.Assign | ast.AnnAssign) -> None:
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        if node.value is None:
            return
        self.order([node.value, *targets], node)
        if len(targets) == 1 and isinstance(targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple):
            self.assign_each(targets[0].elts, node.value.elts, node)
            return
        kind = self.type(node.value)
        if len(targets) > 1 or isinstance(targets[0], ast.Tuple):
            result = self.keep(self.expression(node.value), kind)
            for target in targets:
                self.store(target, result, kind, node)
            return
        self.store(targets[0], self.expression(node.value), kind, node)

    visit_AnnAssign = visit_Assign

    def assign_each(self, targets: list[ast.expr], values: list[ast.expr], node: ast.stmt) -> None:
        """Several to several: through names of their own where a value reads what was set before it."""
        names = {n.id for target in targets for n in walk(target) if isinstance(n, ast.Name)}
        plain = all(isinstance(target, ast.Name) for target in targets)
        crossed = any(isinstance(n, ast.Name) and n.id in names for value in values[1:] for n in walk(value))
        if plain and not crossed:
            for target, value in zip(targets, values, strict=True):
                self.store(target, self.expression(value), self.type(value), node)
            return
        temporaries = [(self.keep(self.expression(value), self.type(value)), self.type(value)) for value in values]
        for target, (code, kind) in zip(targets, temporaries, strict=True):
            self.store(target, code, kind, node)

    def store(self, target: ast.expr, code: ExpressionCode, kind: Type, node: ast.stmt) -> None:
        """Emit the assignment of a value to its target."""
        if isinstance(target, ast.Name):
            wanted = self.function.locals[target.id]
            text = self.convert(code, kind, wanted).text
            if target.id in self.sites.at.get(id(node), ()):
                self.emit(self.declaration(target.id, text, constant=target.id in self.sites.once))
            else:
                self.emit(f"{local_name(target.id)} = {text};")
        elif isinstance(target, ast.Tuple):
            for i, item_target in enumerate(target.elts):
                if isinstance(kind, Tuple):
                    self.store(item_target, ExpressionCode(f"{code.at(ATOM)}.v{i}"), kind.items[i], node)
                else:
                    assert isinstance(kind, Array)
                    self.store(item_target, ExpressionCode(f"{code.at(ATOM)}[{i}]"), element(kind, 1), node)
        else:
            self.emit(f"{self.lvalue(target).text} = {self.stored(code, kind, target)};")

    def stored(self, code: ExpressionCode, kind: Type, target: ast.expr) -> str:
        """A value as the field's type."""
        storage = self.storage(target)
        wanted = COMPUTED[storage]
        converted = self.convert(code, kind, wanted)
        if SIZES[storage] < 8 and wanted == INTEGER:
            if kind == BOOLEAN:
                return f"({storage}){code.at(UNARY)}"
            return converted.text if converted.text.isdigit() else f"({storage}){converted.at(UNARY)}"
        return converted.text

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        value = ast.copy_location(ast.BinOp(node.target, node.op, node.value), node)
        self.made.append(value)
        kind = self.inference.expression(value)
        wanted = self.type(node.target)
        symbol, _ = SYMBOLS.get(type(node.op), ("", 0))
        wide = isinstance(node.target, ast.Name) or SIZES[self.storage(node.target)] == 8
        effect = self.has_effect(node.value)
        if symbol and kind == wanted and kind != BOOLEAN and wide and not effect:
            right = self.convert(self.expression(node.value), self.type(node.value), kind)
            self.emit(f"{self.lvalue(node.target).text} {symbol}= {right.text};")
            return
        self.ordered = effect
        self.store(node.target, self.expression(value), kind, node)

    def visit_If(self, node: ast.If) -> None:
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
        if self.inference.chosen(node) is not None or self.sites.before.get(id(node)):
            return False
        return not self.needs_order([node.test])

    def inside(self, statements: Sequence[ast.stmt]) -> None:
        """A block."""
        self.depth += 1
        self.block(statements)
        self.depth -= 1

    def visit_While(self, node: ast.While) -> None:
        if self.needs_order([node.test]):
            self.emit_head("while (true) {", node)
            self.depth += 1
            self.ordered = True
            stop = self.condition(node.test)
            with self.block_of(f"if (!{stop.at(UNARY)}) {{"):
                self.emit("break;")
            self.depth -= 1
        else:
            self.emit_head(f"while ({self.condition(node.test).text}) {{", node)
        self.inside(node.body)
        self.emit("}")

    def visit_For(self, node: ast.For) -> None:
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
        is_counter = name in self.sites.counters
        is_read = name in self.sites.read
        counter = local_name(name) if is_counter else self.temporary()
        begin = ExpressionCode("0") if low is None else self.integer(low)
        end = self.integer(high)
        if not self._is_steady(high, node):
            end = self.keep(end, INTEGER)
        symbol = "<" if step > 0 else ">"
        if step < 0 and end.text == "-1":
            symbol, end = ">=", ExpressionCode("0")
        onward = {1: f"{counter}++", -1: f"{counter}--"}.get(step, f"{counter} += {step}")
        head = f"for (int64_t {counter} = {begin.text}; {counter} {symbol} {end.at(SHIFT)}; {onward}) {{"
        self.emit_head(head, node)
        if not is_counter and is_read:
            self.depth += 1
            self.store(node.target, ExpressionCode(counter), INTEGER, node)
            self.depth -= 1
        self.inside(node.body)
        self.emit("}")

    def _is_steady(self, node: ast.expr, loop: ast.For) -> bool:
        """Whether a bound is constant during the loop, so that it may be evaluated each time."""
        try:
            self.inference.static(node)
        except NotStaticError:
            changed = {n.id for n in walk(loop) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
            simple = (ast.Name, ast.Constant, ast.BinOp, ast.UnaryOp, ast.operator, ast.unaryop, ast.expr_context)
            parts = list(walk(node))
            names = {n.id for n in parts if isinstance(n, ast.Name)}
            return all(isinstance(part, simple) for part in parts) and not names & changed
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
        self.store(node.target, ExpressionCode(f"{array.at(ATOM)}[{counter}]"), element(kind, 1), node)
        self.depth -= 1
        self.inside(node.body)
        self.emit("}")

    def visit_Return(self, node: ast.Return) -> None:
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
            parts = [self.convert(self.expression(item), self.type(item), kind).text for item, kind in items]
            self.emit(f"return ({self.needs.c_type(result)}){{{', '.join(parts)}}};")
            return
        self.emit(f"return {self.convert(self.expression(node.value), self.type(node.value), result).text};")

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant):
            return
        assert isinstance(node.value, ast.Call)
        inner = [*node.value.args, *(keyword.value for keyword in node.value.keywords)]
        self.ordered = self.needs_order(inner)
        text = self.visit_Call(node.value).text
        is_empty = isinstance(self.type(node.value), Nothing)
        self.emit(f"{text};" if is_empty else f"(void){text};")

    def visit_Break(self, _: ast.Break) -> None:
        self.emit("break;")

    def visit_Continue(self, _: ast.Continue) -> None:
        self.emit("continue;")
