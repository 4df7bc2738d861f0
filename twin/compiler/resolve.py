"""First stage: from a function object to its syntax tree, with what its names stand for.

Files are parsed once. Functions whose text the engine made (groups, tangents) are found as well: `generated` keeps it.
"""

from __future__ import annotations

import ast
import builtins
import contextlib
import io
import linecache
import sys
import tokenize
from dataclasses import dataclass
from functools import lru_cache
from types import CodeType, FunctionType
from typing import Any

from twin.compiler.syntax_tree import walk
from twin.errors import BuildError

SILENT = ("noqa", "type:", "fmt:", "pragma:", "!")  # comments for tools
STATEMENTS = ast.stmt | ast.ExceptHandler | ast.match_case


class TranslationError(BuildError):
    """What cannot become C: the place, the construct, why, and what to write instead."""


@dataclass(frozen=True, eq=False, slots=True)
class File:
    """A parsed file: its functions by first line, its top-level assignments by name."""

    name: str
    text: str
    functions: dict[int, ast.FunctionDef]
    assignments: dict[str, int]
    imports: dict[str, tuple[str, str]]
    is_made: bool  # text of the engine's, which nobody has as a file

    @property
    def above(self) -> dict[int, str]:
        """Comments that have a line of their own, by line."""
        return _comments(self.text)[0]

    @property
    def trailing(self) -> dict[int, str]:
        """Comments behind code, by line."""
        return _comments(self.text)[1]


@lru_cache(maxsize=256)
def _comments(text: str) -> tuple[dict[int, str], dict[int, str]]:
    above: dict[int, str] = {}
    trailing: dict[int, str] = {}
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            comment = token.string.lstrip("#").strip()
            if comment and not comment.startswith(SILENT):
                alone = token.line[: token.start[1]].strip() == ""
                (above if alone else trailing)[token.start[0]] = comment.partition("  #")[0]
    return above, trailing


@lru_cache(maxsize=256)
def _parse(path: str, text: str) -> File:
    tree = ast.parse(text)
    functions = {}
    statements: list[ast.AST] = [tree]
    for node in statements:  # grows; expressions hold no functions
        statements += [one for one in ast.iter_child_nodes(node) if isinstance(one, STATEMENTS)]
        if isinstance(node, ast.FunctionDef):
            functions[min([node.lineno, *(one.lineno for one in node.decorator_list)])] = node
    assignments, imports = {}, {}
    for statement in tree.body:
        if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            assignments[statement.targets[0].id] = statement.lineno
        elif isinstance(statement, ast.ImportFrom) and statement.module:
            imports.update({a.asname or a.name: (statement.module, a.name) for a in statement.names})
    is_made = path.startswith("<")
    short = path.rpartition(" ")[0] + ">" if is_made else "/".join(path.replace("\\", "/").split("/")[-2:])
    return File(short, text, functions, assignments, imports, is_made)


def file_of(path: str) -> File:
    """The parsed file at a path as it is now, or of text that `define` keeps."""
    text = "".join(linecache.getlines(path))
    if not path.startswith("<"):
        with (
            contextlib.suppress(OSError, SyntaxError, UnicodeError),
            tokenize.open(path) as file,
        ):  # linecache may hold an older text
            text = file.read()
    return _parse(path, text)


@lru_cache(maxsize=256)
def _codes(path: str, text: str) -> dict[tuple[str, int], CodeType]:
    """Code of all functions of a file by name and first line, as its text says now."""
    codes: dict[tuple[str, int], CodeType] = {}
    waiting = [compile(text, path, "exec", dont_inherit=True)]
    while waiting:
        inner = [one for one in waiting.pop().co_consts if isinstance(one, CodeType)]
        codes |= {(one.co_name, one.co_firstlineno): one for one in inner}
        waiting += inner
    return codes


def is_current(function: FunctionType) -> bool:
    """Whether a function is what the text of its file says now, and not one of an older text."""
    code = function.__code__
    file = file_of(code.co_filename)
    own = _codes(code.co_filename, file.text).get((code.co_name, code.co_firstlineno))
    return own is not None and (own.co_code, own.co_names) == (code.co_code, code.co_names) and _same(own, code)


def _same(one: CodeType, other: CodeType) -> bool:
    """Whether the constants of two pieces of code are the same, to the bit and with their types."""
    return repr(_constants(one)) == repr(_constants(other))


def _constants(code: CodeType) -> list[Any]:
    return [(one.co_code, _constants(one)) if isinstance(one, CodeType) else one for one in code.co_consts]


@dataclass(frozen=True, eq=False, slots=True)
class Source:
    """A function: tree, file, and the values its free names have."""

    function: FunctionType
    tree: ast.FunctionDef
    file: File
    scope: dict[str, Any]
    locals: frozenset[str]

    @property
    def parameters(self) -> list[str]:
        """Names of its arguments."""
        return [one.arg for one in self.tree.args.args]

    def error(self, node: ast.AST, reason: str, remedy: str) -> TranslationError:
        """The message for a construct."""
        code = ast.unparse(node).partition("\n")[0]
        code = code if len(code) <= 60 else f"{code[:57]}..."
        line = getattr(node, "lineno", self.tree.lineno)
        return TranslationError(f"({self.file.name}:{line}): `{code}` {reason}. {remedy}.")

    def value(self, name: str) -> Any:
        """What a free name stands for; KeyError if nothing does."""
        if name in self.scope:
            return self.scope[name]
        if name in self.function.__globals__:
            return self.function.__globals__[name]
        return vars(builtins)[name]

    def reached(self, node: ast.expr) -> Any:
        """What a free `name`, or an attribute of one, stands for; None if that is not known."""
        if isinstance(node, ast.Attribute):
            return getattr(self.reached(node.value), node.attr, None)
        if isinstance(node, ast.Name) and node.id not in self.locals:
            with contextlib.suppress(KeyError):
                return self.value(node.id)
        return None


_sources: dict[FunctionType, Source] = {}


def source_of(function: FunctionType) -> Source:
    """The source of a function; TranslationError if it is not there."""
    if function not in _sources:
        _sources[function] = _find(function)
    return _sources[function]


def _find(function: FunctionType) -> Source:
    code = function.__code__
    file = tree = None
    with contextlib.suppress(SyntaxError):  # somebody may be writing in the file by now
        file = file_of(code.co_filename)
        tree = file.functions.get(code.co_firstlineno)
    is_file = not code.co_filename.startswith("<")
    if file is None or tree is None or tree.name != code.co_name or (is_file and not is_current(function)):
        short = "/".join(code.co_filename.replace("\\", "/").split("/")[-2:])
        raise TranslationError(
            f"({short}:{code.co_firstlineno}): the source of `{function.__name__}` is not there. "
            "Define it with `def` in a file, and start anew if the file has changed since it was imported."
        )
    cells = zip(code.co_freevars, function.__closure__ or (), strict=True)
    scope = {name: cell.cell_contents for name, cell in cells}
    names = {n.id for n in walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    return Source(function, tree, file, scope, frozenset(names | {one.arg for one in tree.args.args}))


def remark(source: Source, name: str) -> str:
    """The comment beside a constant, where it is assigned."""
    file = source.file
    for _ in range(3):
        if name in file.assignments:
            return file.trailing.get(file.assignments[name], "")
        if name not in file.imports:
            return ""
        module, name = file.imports[name]
        path = getattr(sys.modules.get(module), "__file__", None)
        if not path:
            return ""
        file = file_of(path)
    return ""
