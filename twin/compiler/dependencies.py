"""Which variables an output is computed from: a data-flow analysis of a component's source.

It errs on the side of more: order is ignored, an array is one thing, and where the source cannot be followed every
variable is said to depend on every other. A dependency that is named may not exist; one that is not named does not.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import textwrap
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

from twin.component import Role
from twin.graph import reached

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from twin.component import Component

PURE_MODULES = {"math", "numpy", "cmath"}
SET_FROM_OUTSIDE = (Role.input, Role.parameter)


class _UnsureError(Exception):
    """The source cannot be followed."""


class _Analysis(ast.NodeVisitor):
    """One function: `edges` from what is written to what is read for it; `mutated`, names written in place.

    Nodes are variables by name, and local names of the function as `local:name`.
    """

    def __init__(
        self, function: FunctionType, arrays: dict[str, bool] | None, seen: tuple[FunctionType, ...], me: int = 0
    ) -> None:
        try:
            tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
        except (OSError, SyntaxError, IndexError):
            raise _UnsureError from None
        if not isinstance(tree, ast.FunctionDef):
            raise _UnsureError
        self.function = function
        self.arrays = arrays or {}
        self.seen = (*seen, function)
        self.parameters = [argument.arg for argument in tree.args.args]
        self.me = self.parameters[me] if arrays is not None else None
        self.edges: dict[str, set[str]] = {}
        self.aliases: list[tuple[str, str]] = []
        self.mutated: set[str] = set()
        self.escape: set[str] = set()  # conditions under which the function is left early: all it writes hangs on them
        self.control: list[set[str]] = [set()]
        for statement in tree.body:
            self.visit(statement)
        self._settle()

    def _settle(self) -> None:
        """A name that stands for an array, and is written in place, writes the array."""
        for _ in range(len(self.aliases) + 1):
            for name, base in self.aliases:
                if name in self.mutated:
                    self.mutated.add(base)
                    self.edges.setdefault(base, set()).add(name)
        for sources in self.edges.values():
            sources.update(self.escape)

    # -------------------------------------------------------------------------------------------- expressions

    def _node(self, node: ast.AST) -> str | None:
        """The variable or local name at the bottom of `a`, `self.a`, `a[i][j]`."""
        while isinstance(node, ast.Subscript | ast.Starred):
            node = node.value
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == self.me:
            return node.attr
        if isinstance(node, ast.Name):
            if node.id == self.me:
                raise _UnsureError
            return f"local:{node.id}"
        return None

    def _reads(self, node: ast.AST) -> set[str]:
        found: set[str] = set()
        owners = {id(n.value) for n in ast.walk(node) if isinstance(n, ast.Attribute)}
        for call in (n for n in ast.walk(node) if isinstance(n, ast.Call)):
            place = self._whole(call)
            if place is not None:
                owners.add(id(call.args[place]))
                found.add(f"local:{self._helper(call).__name__}:return")
        for part in ast.walk(node):
            if isinstance(part, ast.Attribute) or (isinstance(part, ast.Name) and id(part) not in owners):
                name = self._node(part)
                if name:
                    found.add(name)
        return found

    def _write(self, target: ast.AST, sources: set[str]) -> None:
        if isinstance(target, ast.Tuple | ast.List):
            for element in target.elts:
                self._write(element, sources)
            return
        name = self._node(target)
        if name is None:
            raise _UnsureError
        place = target
        while isinstance(place, ast.Subscript):
            self.mutated.add(name)
            sources = sources | self._reads(place.slice)
            place = place.value
        self.edges.setdefault(name, set()).update(sources, self.control[-1])

    def _alias(self, target: ast.AST, value: ast.AST) -> None:
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
            for one, other in zip(target.elts, value.elts, strict=True):
                self._alias(one, other)
        elif isinstance(value, ast.IfExp):
            self._alias(target, value.body)
            self._alias(target, value.orelse)
        elif isinstance(target, ast.Name) and isinstance(value, ast.Name | ast.Attribute | ast.Subscript):
            base = self._node(value)
            if base and (base.startswith("local:") or self.arrays.get(base, True)):
                self.aliases.append((f"local:{target.id}", base))

    # --------------------------------------------------------------------------------------------- statements

    def visit_Assign(self, node: ast.Assign) -> None:
        self.generic_visit(node)
        for target in node.targets:
            paired = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
            if paired and len(target.elts) == len(node.value.elts):  # type: ignore[attr-defined]
                for one, other in zip(target.elts, node.value.elts, strict=True):  # type: ignore[attr-defined]
                    self._write(one, self._reads(other))
            else:
                self._write(target, self._reads(node.value))
            self._alias(target, node.value)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.generic_visit(node)
        self._write(node.target, self._reads(node.value) | self._reads(node.target))

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit_Assign(ast.Assign([node.target], node.value))

    def visit_NamedExpr(self, node: ast.NamedExpr) -> None:
        self.generic_visit(node)
        self._write(node.target, self._reads(node.value))

    def _conditional(self, node: ast.If | ast.While) -> None:
        self.visit(node.test)
        self.control.append(self.control[-1] | self._reads(node.test))
        for statement in (*node.body, *node.orelse):
            self.visit(statement)
        self.control.pop()

    def visit_If(self, node: ast.If) -> None:
        self._conditional(node)

    def visit_While(self, node: ast.While) -> None:
        self._conditional(node)

    def visit_For(self, node: ast.For) -> None:
        self.visit(node.iter)
        self.control.append(self.control[-1] | self._reads(node.iter))
        self._write(node.target, set())
        self._alias(node.target, node.iter)
        for statement in (*node.body, *node.orelse):
            self.visit(statement)
        self.control.pop()

    def visit_Return(self, node: ast.Return) -> None:
        self.generic_visit(node)
        self.escape |= self.control[-1]
        if node.value is not None:
            self.edges.setdefault("local:return", set()).update(self._reads(node.value), self.control[-1])

    def visit_Break(self, _: ast.Break) -> None:
        self.escape |= self.control[-1]

    def visit_Continue(self, _: ast.Continue) -> None:
        self.escape |= self.control[-1]

    def visit_Call(self, node: ast.Call) -> None:
        """A helper may write the arrays it is given; what it writes hangs on all it is given."""
        self.generic_visit(node)
        whole = self._whole(node)
        if whole is not None:
            self._follow(node, whole)
        for place, argument in enumerate(node.args):
            if place == whole or not isinstance(argument, ast.Name | ast.Attribute | ast.Subscript | ast.Starred):
                continue
            name = self._node(argument)
            scalar = name is None or (not name.startswith("local:") and not self.arrays.get(name, True))
            if not scalar and self._mutates(node.func, place):
                assert name is not None
                self.mutated.add(name)
                self.edges.setdefault(name, set()).update(self._reads(node), self.control[-1])

    def _whole(self, call: ast.Call) -> int | None:
        """Which argument of a call is the component itself, as in `publish(self)`."""
        places = [i for i, one in enumerate(call.args) if isinstance(one, ast.Name) and one.id == self.me]
        return places[0] if self.me is not None and places else None

    def _helper(self, call: ast.Call) -> FunctionType:
        """The function of the component's module that is called by its name."""
        found = self.function.__globals__.get(call.func.id) if isinstance(call.func, ast.Name) else None
        if not isinstance(found, FunctionType) or found in self.seen or call.keywords:
            raise _UnsureError
        return found

    def _follow(self, call: ast.Call, whole: int) -> None:
        """What a helper that gets the component reads and writes of it is read and written here."""
        helper = self._helper(call)
        inner = _Analysis(helper, self.arrays, self.seen, whole)

        def own(name: str) -> str:
            return name.replace("local:", f"local:{helper.__name__}:", 1)

        for target, sources in inner.edges.items():
            self.edges.setdefault(own(target), set()).update(map(own, sources), self.control[-1])
        for name, argument in zip(inner.parameters, call.args, strict=False):
            if name != inner.me:
                place = own(f"local:{name}")
                self.edges.setdefault(place, set()).update(self._reads(argument), self.control[-1])

    def _mutates(self, called: ast.AST, place: int) -> bool:
        """Whether a called function may write its argument at a place."""
        scope = {**self.function.__globals__, **inspect.getclosurevars(self.function).nonlocals}
        if isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name):
            module = scope.get(called.value.id)
            if isinstance(module, ModuleType) and module.__name__ in PURE_MODULES:
                return False
            helper = getattr(module, called.attr, None)
        elif isinstance(called, ast.Name):
            helper = scope.get(called.id, getattr(builtins, called.id, None))
        else:
            return True
        if not isinstance(helper, FunctionType):
            return helper is None or getattr(helper, "__module__", None) not in {*PURE_MODULES, "builtins"}
        return helper in self.seen or place in _mutated_places(helper, self.seen)

    def generic_visit(self, node: ast.AST) -> None:
        if isinstance(node, ast.Try | ast.With | ast.FunctionDef | ast.Lambda | ast.Match | ast.Global | ast.ListComp):
            raise _UnsureError
        super().generic_visit(node)


# what was found before: sources do not change while a process lives
_places: WeakKeyDictionary[FunctionType, set[int]] = WeakKeyDictionary()
_flows: WeakKeyDictionary[type[Component], dict[tuple[str, ...], dict[str, frozenset[str]]]] = WeakKeyDictionary()


def _mutated_places(helper: FunctionType, seen: tuple[FunctionType, ...]) -> set[int]:
    if helper not in _places:
        analysis = _Analysis(helper, None, seen)
        _places[helper] = {p for p, name in enumerate(analysis.parameters) if f"local:{name}" in analysis.mutated}
    return _places[helper]


def _edges(cls: type[Component], names: Iterable[str]) -> Iterator[tuple[str, set[str]]]:
    """What is written and what is read for it, over several functions of a class; locals are kept apart."""
    arrays = {variable.name: bool(variable.shape) for variable in cls.variables}
    for name in names:
        function: Any = getattr(cls, name, None)
        if function is None:
            continue
        if not isinstance(function, FunctionType):
            raise _UnsureError
        for target, sources in _Analysis(function, arrays, ()).edges.items():
            own = {s.replace("local:", f"local:{name}:", 1) for s in sources}
            yield target.replace("local:", f"local:{name}:", 1), own


def flow(cls: type[Component], names: Iterable[str]) -> dict[str, frozenset[str]]:
    """For each variable that the named functions may write, all variables it may be computed from."""
    known: dict[str, frozenset[str]] | None = getattr(cls, "flows", None)
    if known is not None:  # a group of components: its members were followed when it was made
        return known if "initialize" in names else {}
    found = _flows.setdefault(cls, {})
    if tuple(names) not in found:
        found[tuple(names)] = _followed(cls, names)
    return found[tuple(names)]


def _followed(cls: type[Component], names: Iterable[str]) -> dict[str, frozenset[str]]:
    variables = {variable.name: variable for variable in cls.variables}
    writable = [name for name, variable in variables.items() if variable.role not in SET_FROM_OUTSIDE]
    graph: dict[str, set[str]] = {}
    try:
        for target, sources in _edges(cls, names):
            graph.setdefault(target, set()).update(sources)
    except _UnsureError:
        return dict.fromkeys(writable, frozenset(variables))
    result = {}
    for name in writable:
        if name in graph:
            result[name] = frozenset(reached(graph, {name}) & variables.keys())
    return result


def dependencies(cls: type[Component]) -> dict[str, tuple[str, ...]]:
    """For each output, the inputs it may depend on in InitializationMode."""
    written = flow(cls, ("initialize", "derivatives"))
    inputs = [variable.name for variable in cls.variables if variable.role is Role.input]
    return {
        variable.name: tuple(name for name in inputs if name in written.get(variable.name, ()))
        for variable in cls.variables
        if variable.role is Role.output
    }
