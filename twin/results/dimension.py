"""Dimensions of expressions: which sums and comparisons make sense, and the unit that a value is in.

Every signal is taken in SI, so a bare number is too: in a sum, a difference, `min` or `max` it takes the unit of what
stands beside it; in a product it is a plain number.
"""

from __future__ import annotations

import ast
import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from twin.component import unit
from twin.errors import CouplingError, ScenarioError
from twin.results.expression import evaluate, name_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.results.expression import Expression

HIGHEST = 99  # power of a unit
FACTOR = re.compile(r"\s*([^\W\d_]+|%|°C?|1)(?:\^(-?\d))?\s*")

Factors = tuple[tuple[str, Fraction], ...]


@dataclass(frozen=True)
class Measure:
    """What a value measures: the units it is made of with their powers, or None if nobody knows."""

    factors: Factors | None = ()

    @cached_property
    def exponents(self) -> tuple[Fraction, ...] | None:
        """Exponents of SI's base units, radian left out; None: not known."""
        if self.factors is None:
            return None
        described = [(unit.describe(text).exponents[:-1], power) for text, power in self.factors]
        return tuple(sum((e[i] * power for e, power in described), Fraction()) for i in range(len(unit.BASE) - 1))

    @property
    def unit(self) -> str:
        """Its unit such as `N*m`, of base units where one has no whole power; nothing for plain numbers and sqrt(N)."""
        factors = self.factors or ()
        if any(power.denominator != 1 for _, power in factors):
            factors = tuple(zip(unit.BASE, self.exponents or (), strict=False))
        text = product(factors)
        try:
            unit.describe(text)
        except CouplingError:
            return ""
        return text

    @property
    def text(self) -> str:
        """`is in N`, or `is a plain number`."""
        return f"is in {self.unit or product(self.factors)}" if self.factors else "is a plain number"

    def fits(self, other: Measure) -> bool:
        """Whether values of both add up and convert, as far as one knows."""
        return None in (self.exponents, other.exponents) or self.exponents == other.exponents

    def raised(self, power: Fraction) -> Measure:
        """The measure of a power."""
        if self.factors is None or abs(power) > HIGHEST:
            return UNKNOWN
        return Measure(tuple((text, own * power) for text, own in self.factors if power))

    def times(self, other: Measure) -> Measure:
        """The measure of a product."""
        if self.factors is None or other.factors is None:
            return UNKNOWN
        powers = dict(self.factors)
        for text, power in other.factors:
            powers[text] = powers.get(text, Fraction()) + power
        if any(abs(power) > HIGHEST for power in powers.values()):
            return UNKNOWN
        return Measure(tuple((text, power) for text, power in powers.items() if power))


UNKNOWN = Measure(None)
PLAIN = Measure()


def product(factors: Factors) -> str:
    """Units with their powers as one: `N*m/s^2`."""
    if len(factors) == 1 and factors[0][1] == 1:
        return factors[0][0]
    above = [written(text, power) for text, power in factors if power > 0]
    below = [written(text, -power) for text, power in factors if power < 0]
    over = "*".join(below) if len(below) == 1 else f"({'*'.join(below)})"
    return ("*".join(above) or "1" * bool(below)) + (f"/{over}" if below else "")


def written(text: str, power: Fraction) -> str:
    """`N`, `N^2`, `(N/m)^2`."""
    if any(sign in text for sign in "*/^. "):
        text = f"({text})"
    return text if power == 1 else f"{text}^{power if power.denominator == 1 else f'({power})'}"


def of_unit(text: str | None) -> Measure:
    """The measure of a variable by its unit: unknown if it has None, or one that only its FMU knows."""
    if text in ("", "1", "-"):
        return PLAIN
    try:
        unit.describe(text or "?")
        return Measure(parts(str(text)))
    except CouplingError:
        return UNKNOWN


def parts(text: str) -> Factors:
    """What a unit's text is a product of: `N/m^2` is N and 1/m^2; the text itself if it is written in another way."""
    above, _, below = text.replace("**", "^").partition("/")
    sides = [(above, 1), (below.removeprefix("(").removesuffix(")") if below.startswith("(") else below, -1)]
    found: dict[str, Fraction] = {}
    for side, sign in sides:
        for one in side.split("*") if side else ():
            matched = FACTOR.fullmatch(one)
            if matched is None:
                return ((text, Fraction(1)),)
            found[matched[1]] = found.get(matched[1], Fraction()) + sign * int(matched[2] or 1)
    return tuple((symbol, power) for symbol, power in found.items() if power and symbol != "1")


def preferred(found: Measure, units: Mapping[str, str], display_units: Mapping[str, str]) -> str:
    """The unit to show a value in: that of the first signal that is in the value's unit, or the value's own."""
    if not found.unit:
        return ""
    same = (name for name, text in units.items() if dict(of_unit(text).factors or ()) == dict(found.factors or ()))
    name = next(same, "")
    return display_units.get(name) or units.get(name) or found.unit


def of(expression: Expression, units: Mapping[str, str | None]) -> Measure:
    """What an expression measures; `units`: of each signal. ScenarioError: it adds or compares what does not fit."""
    return measure(expression.tree, units) or UNKNOWN


def measure(node: ast.expr, units: Mapping[str, str | None]) -> Measure | None:
    """What a checked node measures; None: it is made of numbers alone."""
    match node:
        case ast.Constant():
            return None
        case ast.UnaryOp(operand=operand):
            return measure(operand, units)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            return joined([left, right], node, units)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return power(left, right, units)
        case ast.BinOp(left=left, op=operator, right=right):
            first, second = measure(left, units), measure(right, units)
            if first is None and second is None:
                return None
            sign = Fraction(-1 if isinstance(operator, ast.Div) else 1)
            return (first or PLAIN).times((second or PLAIN).raised(sign))
        case ast.Call(func=ast.Name(id="sqrt"), args=[argument]):
            inner = measure(argument, units)
            return inner and inner.raised(Fraction(1, 2))
        case ast.Call(args=arguments):
            return joined(arguments, node, units)
    return of_unit(units[name_of(node).name])


def joined(parts: Sequence[ast.expr], node: ast.expr, units: Mapping[str, str | None]) -> Measure | None:
    """What all parts but numbers measure."""
    found = {ast.unparse(part): one for part in parts if (one := measure(part, units)) is not None}
    known = [(text, one) for text, one in found.items() if one.factors is not None]
    for text, one in known[1:]:
        if not one.fits(known[0][1]):
            verb = "Compare" if isinstance(node, ast.Call) else "Add and subtract"
            first = f"`{known[0][0]}` {known[0][1].text}"
            raise ScenarioError(f"{first}, `{text}` {one.text}. {verb} quantities of one kind.")
    return next((one for one in found.values() if one.factors is None), known[0][1] if known else None)


def power(base: ast.expr, exponent: ast.expr, units: Mapping[str, str | None]) -> Measure | None:
    """What a power measures: its exponent must be a plain number, and of a quantity with a unit one that stays."""
    below, above = measure(base, units), measure(exponent, units)
    if above is not None and above.exponents is not None and any(above.exponents):
        raise ScenarioError(f"the exponent `{ast.unparse(exponent)}` {above.text}, expected a plain number.")
    if below is None:
        return above and PLAIN
    if above is None:
        value = number(exponent)
        return below.raised(Fraction(value).limit_denominator(HIGHEST)) if math.isfinite(value) else UNKNOWN
    if below.exponents is not None and any(below.exponents):
        text = f"`{ast.unparse(base)}` {below.text}, so its exponent must be a number"
        raise ScenarioError(f"{text}, not `{ast.unparse(exponent)}`. Divide by a unit first.")
    return below


def number(node: ast.expr) -> float:
    """The value of what is made of numbers alone."""
    with np.errstate(all="ignore"):
        return float(evaluate(node, {}))


def is_difference(expression: Expression) -> bool:
    """Whether a value has no place on a scale, so that a unit's offset does not matter: 5 K more are 5 degC more."""
    share = zeros(expression.tree)
    return share is not None and not math.isclose(share, 1.0)


def zeros(node: ast.expr) -> float | None:
    """How often a scale's zero is in a value: once in a temperature, not at all in a difference; None in a number."""
    match node:
        case ast.Constant():
            return None
        case ast.UnaryOp(op=operator, operand=operand):
            inner = zeros(operand)
            return -inner if inner is not None and isinstance(operator, ast.USub) else inner
        case ast.BinOp(left=left, op=operator, right=right):
            return combined(left, operator, right)
        case ast.Call(args=arguments):
            found = {one for argument in arguments if (one := zeros(argument)) is not None}
            return abs(found.pop()) if len(found) == 1 else 1.0 if found else None
    return 1.0


def combined(left: ast.expr, operator: ast.operator, right: ast.expr) -> float | None:
    """The same for two values: what is less a number, as in `motor.temperature - 310`, is a difference."""
    first, second = zeros(left), zeros(right)
    if first is None and second is None:
        return None
    match operator:
        case ast.Sub():
            return 0.0 if first is None or second is None else first - second
        case ast.Add():
            return (first or 0.0) + (second or 0.0)
        case ast.Mult() | ast.Div() if first is None or second is None:
            value = number(left if first is None else right)
            if isinstance(operator, ast.Mult):
                return (first or second or 0.0) * value
            return first / value if first is not None and value else 1.0
        case ast.Mult():
            return (first or 0.0) * (second or 0.0)
    return 1.0 if first is None else first
