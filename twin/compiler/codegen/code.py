"""Text of C: how tightly it binds, literals, names, lines that are not too long."""

from __future__ import annotations

from dataclasses import dataclass
from math import isnan

from twin.compiler.builtins import NAMED
from twin.compiler.names import BUILTIN, safe

ATOM, UNARY, PRODUCT, SUM, SHIFT, RELATION, EQUALITY, BIT_AND, BIT_XOR, BIT_OR, AND, OR, CHOICE = range(16, 3, -1)
BREAK = 116  # longest line


@dataclass(frozen=True, slots=True)
class ExpressionCode:
    """Text of an expression, and how tightly it binds."""

    text: str
    level: int = ATOM

    def at(self, level: int) -> str:
        """With parentheses unless it binds at least so tightly."""
        return self.text if self.level >= level else f"({self.text})"


def number(value: float) -> ExpressionCode:
    """A literal."""
    if isinstance(value, bool):
        return ExpressionCode("true" if value else "false")
    if isinstance(value, int):
        if value == -(2**63):
            return ExpressionCode("(-9223372036854775807 - 1)")
        return ExpressionCode(str(int(value)), ATOM if value >= 0 else UNARY)
    if isnan(value):
        return ExpressionCode("(0.0 / 0.0)")
    if value in (float("inf"), float("-inf")):
        return ExpressionCode("(1.0 / 0.0)" if value > 0.0 else "(-1.0 / 0.0)")
    text = repr(float(value))
    return ExpressionCode(text if "." in text or "e" in text else f"{text}.0", UNARY if text.startswith("-") else ATOM)


def local_name(name: str) -> str:
    """A local variable's name in C; it must not hide a function that its own function may call."""
    name = f"{name}_" if name in BUILTIN or name in NAMED else safe(name)
    return name.replace("__", "_") if not name.startswith("_") else f"own{name}"


def wrapped(line: str) -> list[str]:
    """A line of code in lines that are not too long; comments and text in quotes are left as they are."""
    if "\n" in line:
        return [part for text in line.split("\n") for part in wrapped(text)]
    if len(line) <= BREAK or '"' in line:
        return [line]
    indent = " " * (len(line) - len(line.lstrip()) + 4)
    for sign in (" || ", " && ", ", ", " ? ", " : ", " + ", " - ", " * ", " = "):
        at = line.rfind(sign, len(indent) + 8, BREAK - 1)
        if at > 0:
            cut = at + (len(sign) - 1 if sign in (", ", " = ") else 0)
            return [line[:cut].rstrip(), *wrapped(indent + line[cut:].lstrip())]
    return [line]
