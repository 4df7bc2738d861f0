"""Where the local variables of a function are declared in C: as late and as deep as Python's meaning allows.

A Python variable lives until its function ends. In C it is declared where it gets its first value if nothing outside of
that block needs it; a loop's counter in the loop; what is set in both branches of an `if` before it; and at the top of
the function, as zero, what one cannot tell so.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass, field

from twin.compiler.syntax_tree import walk


@dataclass(slots=True)
class Block:
    """A list of statements, and the blocks around it."""

    statements: list[ast.stmt]
    outer: Block | None
    holder: ast.stmt | None  # the statement it belongs to
    is_loop: bool

    def around(self) -> list[Block]:
        """The block and all around it, outermost first."""
        return [*(self.outer.around() if self.outer else []), self]


@dataclass(slots=True)
class DeclarationSites:
    """`at`: statement that declares a name; `before`: names declared before a statement; `top`: at the function's top."""

    counters: set[str] = field(default_factory=set)
    at: dict[int, set[str]] = field(default_factory=dict)
    before: dict[int, list[str]] = field(default_factory=dict)
    top: list[str] = field(default_factory=list)
    once: set[str] = field(default_factory=set)  # assigned by one statement only
    read: set[str] = field(default_factory=set)


@dataclass(slots=True)
class _Use:
    """Where a name stands: its block, its statement, and all statements around it."""

    block: Block
    statement: ast.stmt
    around: frozenset[int]


def stored(node: ast.AST) -> set[str]:
    """Names an expression or statement assigns."""
    return {n.id for n in walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}


def inner_blocks(statement: ast.stmt) -> list[tuple[list[ast.stmt], bool]]:
    """The blocks of a compound statement, and whether they are repeated."""
    if isinstance(statement, ast.If):
        return [(statement.body, False), (statement.orelse, False)]
    if isinstance(statement, ast.For | ast.While):
        return [(statement.body, True)]
    return []


def heads(statement: ast.stmt) -> list[ast.AST]:
    """What of a statement is not in a block of its own."""
    if isinstance(statement, ast.If | ast.While):
        return [statement.test]
    if isinstance(statement, ast.For):
        return [statement.iter, statement.target]
    return [statement]


class DeclarationSiteFinder:
    """Decides for all local names of a function."""

    def __init__(self, tree: ast.FunctionDef, parameters: list[str], ranges: set[int]) -> None:
        self.tree, self.parameters, self.ranges = tree, set(parameters), ranges
        self.uses: dict[str, list[_Use]] = {}
        self.sites = DeclarationSites()
        self.stored = stored(tree)
        self._collect(Block(tree.body, None, None, is_loop=False))

    def _collect(self, block: Block) -> None:
        for statement in block.statements:
            inside = Block(statement.body, block, statement, True) if isinstance(statement, ast.For) else block
            around = frozenset(id(statement.holder) for statement in block.around()) | {id(statement)}
            for head in heads(statement):
                for node in walk(head):
                    if isinstance(node, ast.Name):
                        # the target of a loop over elements is set in the loop's body
                        target = isinstance(statement, ast.For) and isinstance(node.ctx, ast.Store)
                        here = inside if target else block
                        self.uses.setdefault(node.id, []).append(_Use(here, statement, around))
                        if isinstance(node.ctx, ast.Load):
                            self.sites.read.add(node.id)
            for body, is_loop in inner_blocks(statement):
                self._collect(inside if isinstance(statement, ast.For) else Block(body, block, statement, is_loop))

    def find(self) -> DeclarationSites:
        """The decisions."""
        loops = [n for n in walk(self.tree) if isinstance(n, ast.For) and id(n) in self.ranges]
        names = [name for name in self.uses if name in self.stored and name not in self.parameters]
        for name in names:
            own = [n for n in loops if isinstance(n.target, ast.Name) and n.target.id == name]
            if own and name not in self.sites.read and len(own) == len(self.uses[name]):
                continue  # a counter that is never read outside its loops
            if own and self._is_counter(name, own):
                self.sites.counters.add(name)
            else:
                self._assign_site(name)
        return self.sites

    def _is_counter(self, name: str, own: list[ast.For]) -> bool:
        """Whether a name is only a loop counter and is never read outside of its loops."""
        inside: set[int] = set()
        for loop in own:
            body = {id(n) for statement in loop.body for n in walk(statement)}
            if any(id(other) in body for other in own):
                return False
            inside |= body | {id(loop.target)}
        targets = {id(loop.target) for loop in own}
        for node in walk(self.tree):
            if isinstance(node, ast.Name) and node.id == name:
                if id(node) not in inside or (isinstance(node.ctx, ast.Store) and id(node) not in targets):
                    return False
        return True

    def _assign_site(self, name: str) -> None:
        uses = self.uses[name]
        writers = {id(use.statement) for use in uses if name in stored_by(use.statement)}
        if len(writers) == 1:
            self.sites.once.add(name)
        spots = self._spots(name, uses)
        if spots is not None:
            for spot in spots:
                self.sites.at.setdefault(spot, set()).add(name)
            if len(writers) == len(spots):
                self.sites.once.add(name)
            return
        block = self._common(uses)
        first = next(s for s in block.statements if any(self._contains(s, use) for use in uses))
        if assigns(first, name) or not any(statement.is_loop for statement in block.around()):
            self.sites.before.setdefault(id(first), []).append(name)
        else:
            self.sites.top.append(name)

    @staticmethod
    def _common(uses: list[_Use]) -> Block:
        """The innermost block that has all uses."""
        paths = [use.block.around() for use in uses]
        common = paths[0]
        for path in paths[1:]:
            common = [a for a, b in zip(common, path, strict=False) if a is b]
        return common[-1]

    def _spots(self, name: str, uses: list[_Use]) -> list[int] | None:
        """Statements that give the name its value and can declare it, each for a part of the uses; None if there are none."""
        block = self._common(uses)
        loop = next((use.statement for use in uses if isinstance(use.statement, ast.For)), None)
        if loop is not None and name in stored(loop.target) and block.statements is loop.body:
            return [id(loop)]  # set at the begin of the body, each time
        holders = [s for s in block.statements if any(self._contains(s, use) for use in uses)]
        first = holders[0]
        if isinstance(first, ast.Assign | ast.AnnAssign):
            return [id(first)] if is_plain(first, name) else None
        statement_ids: list[int] = []
        for holder in holders:
            inner = [use for use in uses if self._contains(holder, use)]
            if any(use.statement is holder and use.block is block for use in inner) or len(inner) == len(uses):
                return None
            spots = self._spots(name, inner)
            if spots is None:
                return None
            statement_ids += spots
        return statement_ids

    @staticmethod
    def _contains(statement: ast.stmt, use: _Use) -> bool:
        return id(statement) in use.around


def stored_by(statement: ast.stmt) -> set[str]:
    """Names a statement itself assigns, its blocks left out."""
    return set().union(*(stored(head) for head in heads(statement)))


def is_plain(statement: ast.Assign | ast.AnnAssign, name: str) -> bool:
    """Whether an assignment gives a name its value from others."""
    if statement.value is None or any(isinstance(n, ast.Name) and n.id == name for n in walk(statement.value)):
        return False
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    if len(targets) > 1:
        return False
    flat = targets[0].elts if isinstance(targets[0], ast.Tuple) else targets
    return [node.id for node in flat if isinstance(node, ast.Name)].count(name) == 1


def assigns(statement: ast.stmt, name: str) -> bool:
    """Whether a statement surely gives a name a value before anybody reads it."""
    if isinstance(statement, ast.Assign | ast.AnnAssign):
        return is_plain(statement, name)
    if isinstance(statement, ast.If):
        if any(isinstance(n, ast.Name) and n.id == name for n in walk(statement.test)):
            return False
        return all(block_assigns(block, name) for block in (statement.body, statement.orelse))
    return False


def block_assigns(statements: list[ast.stmt], name: str) -> bool:
    """The same for a block: its first statement that has the name assigns it."""
    for statement in statements:
        if isinstance(statement, ast.Return | ast.Break | ast.Continue):
            return True
        if any(isinstance(n, ast.Name) and n.id == name for n in walk(statement)):
            return assigns(statement, name)
    return False
