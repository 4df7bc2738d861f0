"""The lines of a function, and when the parts of an expression need lines of their own.

Where calls with effects meet other reads in one expression, C leaves the order open and Python does not.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from twin.compiler.builtins import Word
from twin.compiler.codegen.code import ExpressionCode, wrapped
from twin.compiler.codegen.file_context import FileContext
from twin.compiler.codegen.nonnegative_analysis import NonnegativeAnalysis
from twin.compiler.infer import Program, TypedFunction
from twin.compiler.structs import WIDTH
from twin.compiler.syntax_tree import walk
from twin.compiler.types import Array, Record, StaticObject, Type


class LineWriter(NonnegativeAnalysis):
    """Lines, temporary names, order."""

    def __init__(self, needs: FileContext, program: Program, function: TypedFunction) -> None:
        super().__init__(program, function)
        self.needs = needs
        self.lines: list[str] = []
        self.depth = 1
        self.ordered = False  # whether the parts of the present expression get lines of their own
        self.count = 0
        self.made: list[ast.AST] = []  # nodes of our own: kept, since types are noted by identity

    def emit(self, line: str) -> None:
        """A line at the present depth, broken where it is too long."""
        self.lines += wrapped("    " * self.depth + line)

    @contextmanager
    def block_of(self, head: str, end: str = "}") -> Iterator[None]:
        """Emit the head of a block, the lines inside, and its end."""
        self.emit(head)
        self.depth += 1
        yield
        self.depth -= 1
        self.emit(end)

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

    def keep(self, code: ExpressionCode, kind: Type) -> ExpressionCode:
        """Give a value a name of its own."""
        name = self.temporary()
        if isinstance(kind, Array):
            self.emit(f"{self.needs.declare(kind, name, True)} = {code.text};")
        else:
            self.emit(f"const {self.needs.declare(kind, name, False)} = {code.text};")
        return ExpressionCode(name)

    def type(self, node: ast.expr) -> Type:
        """What was inferred; for parts that were made since, what follows from theirs."""
        kind = self.function.types.get(id(node))
        return self.inference.expression(node) if kind is None else kind

    def has_effect(self, node: ast.AST) -> bool:
        """Whether an expression calls a function that changes something."""
        return self.inference.has_effect(node)

    def order(self, nodes: Sequence[ast.expr | None], _: ast.stmt) -> None:
        """Decide whether the parts of a statement's expressions need lines of their own."""
        self.ordered = self.needs_order([node for node in nodes if node is not None])

    def needs_order(self, nodes: Sequence[ast.expr]) -> bool:
        """Whether a call with an effect meets another call or a read of memory that is not its argument."""
        calls = [n for node in nodes for n in walk(node) if id(n) in self.function.calls and self._acts(n)]
        if not calls:
            return False
        if len(calls) > 1:
            return True
        own = {id(n) for n in walk(calls[0])}
        for node in nodes:
            for n in walk(node):
                called = self.function.calls.get(id(n))
                is_read = (isinstance(n, ast.Attribute | ast.Subscript) and isinstance(n.ctx, ast.Load)) or (
                    called is not None and self._reads(called)
                )
                if is_read and id(n) not in own and not isinstance(self.function.types.get(id(n)), StaticObject):
                    return True
        return isinstance(self.function.calls[id(calls[0])], TypedFunction) and self._reads_between(calls[0])

    def _acts(self, node: ast.AST) -> bool:
        return self.function.calls[id(node)].acts

    @staticmethod
    def _reads(called: TypedFunction | Word) -> bool:
        """Whether the result of a call may depend on memory."""
        if isinstance(called, Word):
            return called.reads
        return any(isinstance(kind, Array | Record) for kind in called.arguments)

    def _reads_between(self, call: ast.AST) -> bool:
        """Whether an argument of a call with an effect is itself one."""
        return any(id(n) in self.function.calls and self._acts(n) for n in walk(call) if n is not call)
