"""Linter for components: report code that cannot be compiled, with its line and what to write instead.

A component never raises: an exception in native code would be lost. It writes no input and no parameter. It allocates
nothing: arrays are declared, and loops go over their elements.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

from twin.component import unit
from twin.component.variable import Role
from twin.errors import CouplingError, nearest
from twin.files import shown_path

if TYPE_CHECKING:
    from collections.abc import Iterator

    from twin.component.component import Component

IMPORT = "Import at the top of the module; for NumPy and other packages derive from PythonComponent"
# construct: why it cannot be, and what to write instead
FORBIDDEN: dict[type[ast.AST], tuple[str, str]] = {
    ast.Raise: ("`raise` is lost in native code", "Return a status (`-> int`, ERROR of twin.solver) instead"),
    ast.Try: ("`try` cannot be compiled", "Test for the case before it happens"),
    ast.With: ("`with` cannot be compiled", "Components do no I/O; use a PythonComponent"),
    ast.Assert: ("`assert` is lost in native code", "Return a status instead"),
    ast.Import: ("`import` inside a function cannot be compiled", IMPORT),
    ast.ImportFrom: ("`import` inside a function cannot be compiled", IMPORT),
    ast.Global: ("`global` cannot be compiled", "Declare a local() variable"),
    ast.Lambda: ("`lambda` cannot be compiled", "Write a function in the module"),
    ast.ListComp: ("a list allocates", "Declare an array with shape=... and loop over its elements"),
    ast.List: ("a list allocates", "Declare an array with shape=..., or use a tuple of the module"),
    ast.Dict: ("a dict allocates", "Declare variables instead"),
    ast.Set: ("a set allocates", "Declare variables instead"),
    ast.DictComp: ("a dict allocates", "Declare variables instead"),
    ast.SetComp: ("a set allocates", "Declare variables instead"),
    ast.GeneratorExp: ("a generator cannot be compiled", "Write the loop"),
    ast.JoinedStr: ("a string cannot be compiled", "Publish a number instead"),
    ast.Yield: ("`yield` cannot be compiled", "Use step(self, t, h)"),
    ast.Await: ("`await` cannot be compiled", "Use a PythonComponent"),
}

CALLS = {
    "print": "do I/O",
    "open": "do I/O",
    "input": "do I/O",
    "eval": "be compiled",
    "exec": "be compiled",
    "list": "allocate",
    "dict": "allocate",
    "set": "allocate",
    "str": "be compiled",
    "sorted": "allocate",
}
ARRAYS = {"zeros", "ones", "empty", "array", "arange", "linspace", "full", "concatenate", "dot", "eye", "copy"}
_checked: WeakKeyDictionary[type[Component], list[str]] = WeakKeyDictionary()  # asked for with each form and version

FUNCTIONS = ("initialize", "step", "derivatives")
METHODS = {"max", "min", "copy", "astype", "dot", "reshape", "tolist", "mean", "sort"}


def check(cls: type[Component]) -> list[str]:
    """Problems of a component's functions and of the helpers they call, one line each; empty if there are none."""
    if cls not in _checked:
        _checked[cls] = _check(cls)
    return list(_checked[cls])


def _check(cls: type[Component]) -> list[str]:
    problems: list[str] = list(declaration_problems(cls))
    visited: set[str] = set()
    for name in FUNCTIONS:
        function = getattr(cls, name, None)
        if isinstance(function, FunctionType):
            problems += _check_function(cls, function, visited, owner=True)
    return problems


def never_set(cls: type[Component]) -> Iterator[str]:
    """Derivatives that are never set, and outputs for which only a local variable of their name is."""
    slopes = list(_reachable(getattr(cls, "derivatives", None), set()))
    functions = [function for name in FUNCTIONS for function in _reachable(getattr(cls, name, None), set())]
    for variable in cls.variables:
        name = variable.name
        if (
            variable.role is Role.derivative
            and "." not in name
            and not any(name in function.__code__.co_names for function in slopes)
        ):
            yield f"{cls.__name__}.{name}: is never set. Write self.{name} = ... in derivatives(self, t)."
        if variable.role is Role.output and not any(name in function.__code__.co_names for function in functions):
            for function in functions:
                if name in function.__code__.co_varnames:
                    yield f"{cls.__name__}.{name}: is never set; {function.__name__} sets a local variable `{name}`. Write self.{name} = ..."


def location(cls: type) -> str:
    """Return `file:line: Name` of a class, or its name if its source is not there."""
    try:
        return f"{shown_path(inspect.getsourcefile(cls) or '?')}:{inspect.getsourcelines(cls)[1]}: {cls.__name__}"
    except (OSError, TypeError):
        return cls.__name__


def declaration_problems(cls: type[Component]) -> Iterator[str]:
    """Problems of the declarations: unknown units, states without a derivative, outputs that are never set."""
    yield from never_set(cls)
    for variable in cls.variables:
        try:
            unit.describe(variable.unit)
        except CouplingError as error:
            yield f"{cls.__name__}.{variable.name}: {error}"


def _check_function(cls: type[Component], function: FunctionType, visited: set[str], owner: bool) -> Iterator[str]:
    key = f"{function.__module__}.{function.__qualname__}"
    if key in visited:
        return
    visited.add(key)
    try:
        lines, first = inspect.getsourcelines(function)
    except OSError:
        return
    tree = ast.parse(textwrap.dedent("".join(lines)))
    where = f"{cls.__name__} ({shown_path(inspect.getsourcefile(function) or '?')}:%d)"
    for node, message in _problems(cls, function, tree, owner):
        yield f"{where % (first + getattr(node, 'lineno', 1) - 1)}: {message}."
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            helper = function.__globals__.get(node.func.id)
            if isinstance(helper, FunctionType) and not helper.__module__.startswith("numpy"):
                yield from _check_function(cls, helper, visited, owner=False)


def _problems(
    cls: type[Component], function: FunctionType, tree: ast.AST, owner: bool
) -> Iterator[tuple[ast.AST, str]]:
    variables = {variable.name: variable for variable in cls.variables}
    me = function.__code__.co_varnames[0] if function.__code__.co_argcount else "self"
    nodes = list(ast.walk(tree))
    for node in [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)] or nodes:
        if type(node) in FORBIDDEN:
            yield node, ". ".join(FORBIDDEN[type(node)])
        elif isinstance(node, ast.Call):
            yield from _call_problems(node, function)
        elif owner and isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == me:
            if node.attr not in variables and not node.attr.startswith("_"):
                hint = f" {nearest(node.attr, variables, '`')} Else declare" if variables else " Declare"
                yield node, f"`self.{node.attr}` is not declared.{hint} it"
        elif owner and isinstance(node, ast.Subscript):
            yield from _index_problems(node, me, variables)
        if owner and isinstance(node, ast.Assign | ast.AugAssign | ast.AnnAssign):
            yield from _write_problems(node, me, variables)


def _index_problems(node: ast.Subscript, me: str, variables: dict[str, Any]) -> Iterator[tuple[ast.AST, str]]:
    """A constant index outside of its array: native code would read or write out of bounds."""
    array = node.value
    if not (isinstance(array, ast.Attribute) and isinstance(array.value, ast.Name) and array.value.id == me):
        return
    variable = variables.get(array.attr)
    indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    for index, size in zip(indices, variable.shape if variable is not None else (), strict=False):
        if isinstance(index, ast.Constant) and type(index.value) is int and index.value >= size:
            yield node, f"`{ast.unparse(node)}` is outside of {array.attr}, whose indices end at {size - 1}. Correct it"


def _call_problems(node: ast.Call, function: FunctionType) -> Iterator[tuple[ast.AST, str]]:
    called = node.func
    if isinstance(called, ast.Name) and called.id in CALLS and called.id not in function.__globals__:
        yield (
            node,
            f"`{called.id}()` would {CALLS[called.id]} and cannot stand in a component. Use a PythonComponent for that",
        )
    if isinstance(called, ast.Attribute):
        base = called.value
        module = isinstance(base, ast.Name) and isinstance(function.__globals__.get(base.id), ModuleType)
        if module and called.attr in ARRAYS:
            yield (
                node,
                f"`{ast.unparse(called)}()` allocates an array. Declare a local() with shape=... and loop over it, or derive from PythonComponent",
            )
        elif isinstance(base, ast.Attribute) and base.attr in ("random", "linalg"):
            instead = (
                "normal of twin.component"
                if base.attr == "random"
                else "a loop over the elements, or derive from PythonComponent"
            )
            yield node, f"`{ast.unparse(called)}()` has no form in C. Use {instead}"
        elif not module and called.attr in METHODS:
            yield (
                node,
                f"`.{called.attr}()` of an array has no form in C. Write the loop over its elements, or derive from PythonComponent",
            )


def _write_problems(
    node: ast.Assign | ast.AugAssign | ast.AnnAssign, me: str, variables: dict[str, Any]
) -> Iterator[tuple[ast.AST, str]]:
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    for target in targets:
        for item in target.elts if isinstance(target, ast.Tuple) else [target]:
            inner = item
            while isinstance(inner, ast.Subscript):
                inner = inner.value
            if not (isinstance(inner, ast.Attribute) and isinstance(inner.value, ast.Name) and inner.value.id == me):
                continue
            variable = variables.get(inner.attr)
            if variable is not None and variable.role in (Role.input, Role.parameter):
                yield (
                    node,
                    f"writes {variable.role} `self.{inner.attr}`, which is set from outside. Use a local() for it",
                )
            if variable is not None and variable.shape and not isinstance(item, ast.Subscript):
                yield (
                    node,
                    f"assigns the whole array `self.{inner.attr}`. Loop over its elements: self.{inner.attr}[i] = ...",
                )


def _reachable(function: Any, visited: set[int]) -> Iterator[FunctionType]:
    if not isinstance(function, FunctionType) or id(function) in visited:
        return
    visited.add(id(function))
    yield function
    scope = dict(function.__globals__)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        scope[name] = cell.cell_contents
    for name in (*function.__code__.co_names, *function.__code__.co_freevars):
        yield from _reachable(scope.get(name), visited)
