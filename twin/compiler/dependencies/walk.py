"""One function, statement by statement, and the helpers it calls."""

from __future__ import annotations

import ast
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from twin.compiler.dependencies.flows import LOCAL, RESULT, Flows, own
from twin.compiler.dependencies.reader import DependencyReader, UnsureError
from twin.compiler.resolve import TranslationError, source_of
from twin.compiler.syntax_tree import walk

if TYPE_CHECKING:
    from collections.abc import Mapping

PURE_MODULES = {"math", "numpy", "cmath"}
OPAQUE = (ast.Try, ast.With, ast.FunctionDef, ast.Lambda, ast.Match, ast.Global, ast.ListComp)


def followed(
    function: FunctionType, me: int | None, arrays: Mapping[str, bool], call_chain: tuple[FunctionType, ...] = ()
) -> Flows:
    """Return the data flow of a function whose argument `me` (index) is the component; UnsureError if it is undecidable."""
    try:
        source = source_of(function)
        reader = DependencyReader(source, None if me is None else source.parameters[me], arrays)
    except (TranslationError, IndexError):
        raise UnsureError from None
    visitor = _Visitor(reader, (*call_chain, function))
    for statement in source.tree.body:
        visitor.visit(statement)
    visitor.flows.settle()
    return visitor.flows


class _Visitor(ast.NodeVisitor):
    """Record the data flow of each statement in `flows`; `call_chain`: this function and its callers."""

    def __init__(self, reader: DependencyReader, call_chain: tuple[FunctionType, ...]) -> None:
        self.reader, self.call_chain, self.flows = reader, call_chain, Flows()

    def generic_visit(self, node: ast.AST) -> None:
        """Record the calls and assignments in an expression, or in a statement that contains no other."""
        for part in walk(node):
            if isinstance(part, OPAQUE) or (isinstance(part, ast.stmt) and part is not node):
                raise UnsureError
            if isinstance(part, ast.Call):
                self._call(part)
            elif isinstance(part, ast.NamedExpr):
                self._write(part.target, self.reader.reads(part.value))

    def visit_Assign(self, node: ast.Assign) -> None:
        self.generic_visit(node)
        for target in node.targets:
            for item, value in _pairs(target, node.value):
                self._write(item, self.reader.reads(value))
            self._alias(target, node.value)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit_Assign(ast.Assign([node.target], node.value))

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.generic_visit(node)
        self._write(node.target, self.reader.reads(node.value) | self.reader.reads(node.target))

    def visit_If(self, node: ast.If | ast.While) -> None:
        self.generic_visit(node.test)
        self._block(node, self.reader.reads(node.test))

    def visit_While(self, node: ast.While) -> None:
        self.visit_If(node)

    def visit_For(self, node: ast.For) -> None:
        self.generic_visit(node.iter)
        self.generic_visit(node.target)
        self._write(node.target, self.reader.reads(node.iter))
        self._alias(node.target, node.iter)
        self._block(node, self.reader.reads(node.iter))

    def visit_Return(self, node: ast.Return) -> None:
        self.generic_visit(node)
        self.flows.leave()
        if node.value is not None:
            self.flows.write(RESULT, self.reader.reads(node.value))

    def visit_Break(self, _: ast.Break) -> None:
        self.flows.leave()

    def visit_Continue(self, _: ast.Continue) -> None:
        self.flows.leave()

    def _block(self, node: ast.If | ast.While | ast.For, condition: set[str]) -> None:
        with self.flows.under(condition):
            for statement in (*node.body, *node.orelse):
                self.visit(statement)

    def _write(self, target: ast.AST, sources: set[str]) -> None:
        if isinstance(target, ast.Tuple | ast.List):
            for element in target.elts:
                self._write(element, sources)
            return
        name = self.reader.name(target)
        if name is None:
            raise UnsureError
        while isinstance(target, ast.Subscript):
            self.flows.mutated.add(name)
            sources = sources | self.reader.reads(target.slice)
            target = target.value
        self.flows.write(name, sources)

    def _alias(self, target: ast.AST, value: ast.AST) -> None:
        """A local name may stand for an array from now on."""
        for item, source in _pairs(target, value):
            if isinstance(source, ast.IfExp):
                self._alias(item, source.body)
                self._alias(item, source.orelse)
            elif isinstance(item, ast.Name) and isinstance(source, ast.Name | ast.Attribute | ast.Subscript):
                base = self.reader.array(source)
                if base:
                    self.flows.aliases.append((f"{LOCAL}{item.id}", base))

    # -------------------------------------------------------------------------------------------------- calls

    def _call(self, node: ast.Call) -> None:
        """A helper may write the arrays it is given; what it writes hangs on all it is given."""
        component_index = self.reader.component_index(node)
        if component_index is not None:
            self._follow(node, component_index)
        for index, argument in enumerate(node.args):
            if index == component_index or not isinstance(
                argument, ast.Name | ast.Attribute | ast.Subscript | ast.Starred
            ):
                continue
            name = self.reader.array(argument)
            if name and self._mutates(node.func, index):
                self.flows.mutated.add(name)
                self.flows.write(name, self.reader.reads(node))

    def _follow(self, call: ast.Call, component_index: int) -> None:
        """What a helper that gets the component reads and writes of it is read and written here."""
        helper = self.reader.helper(call)
        if helper in self.call_chain:
            raise UnsureError
        for target, sources in followed(helper, component_index, self.reader.arrays, self.call_chain).within(
            helper.__name__
        ):
            self.flows.write(target, sources)
        for index, (name, argument) in enumerate(zip(source_of(helper).parameters, call.args, strict=False)):
            if index != component_index:
                self.flows.write(own(f"{LOCAL}{name}", helper.__name__), self.reader.reads(argument))

    def _mutates(self, called: ast.expr, index: int) -> bool:
        """Whether a called function may write its argument of this index."""
        source = self.reader.source
        if isinstance(called, ast.Attribute):
            module = source.reached(called.value)
            if isinstance(module, ModuleType) and module.__name__ in PURE_MODULES:
                return False
        helper = source.reached(called)
        if isinstance(helper, FunctionType):
            return helper in self.call_chain or index in _mutated_arguments(helper, self.call_chain)
        return helper is None or getattr(helper, "__module__", None) not in {*PURE_MODULES, "builtins"}


def _pairs(target: ast.AST, value: ast.AST) -> list[tuple[ast.AST, ast.AST]]:
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
        return [pair for element, other in zip(target.elts, value.elts, strict=True) for pair in _pairs(element, other)]
    return [(target, value)]


# cached for the life of the process, in which sources do not change
_mutated_cache: WeakKeyDictionary[FunctionType, set[int]] = WeakKeyDictionary()


def _mutated_arguments(helper: FunctionType, call_chain: tuple[FunctionType, ...]) -> set[int]:
    if helper not in _mutated_cache:
        mutated = followed(helper, None, {}, call_chain).mutated
        _mutated_cache[helper] = {
            p for p, name in enumerate(source_of(helper).parameters) if f"{LOCAL}{name}" in mutated
        }
    return _mutated_cache[helper]
