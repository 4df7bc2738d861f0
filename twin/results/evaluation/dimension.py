"""Dimensional analysis of expressions: consistency of sums and comparisons, and the unit of a value.

Every signal is in SI, so a bare number is too: in a sum, a difference, `min` or `max` it takes the unit of the other
operand; in a product it is dimensionless.
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
from twin.results.evaluation.expression import evaluate, node_signal

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.results.evaluation.expression import Expression

MAX_POWER = 99  # power of a unit
FACTOR = re.compile(r"\s*([^\W\d_]+|%|°C?|1)(?:\^(-?\d))?\s*")

Factors = tuple[tuple[str, Fraction], ...]


@dataclass(frozen=True)
class Measure:
    """Product of units with their powers; `factors` is None if the unit is unknown."""

    factors: Factors | None = ()

    @cached_property
    def exponents(self) -> tuple[Fraction, ...] | None:
        """Exponents of the SI base units without radian; None if unknown."""
        if self.factors is None:
            return None
        unit_exponents = [(unit.describe(symbol).exponents[:-1], power) for symbol, power in self.factors]
        return tuple(
            sum((exponents[i] * power for exponents, power in unit_exponents), Fraction())
            for i in range(len(unit.BASE) - 1)
        )

    @property
    def unit(self) -> str:
        """Unit such as `N*m`, in base units if a power is fractional; empty if dimensionless or unknown.

        A power that `twin.component.unit` cannot read is in coherent SI, as `N^0.5` of a value in N or mN.
        """
        factors = self.factors or ()
        base_factors = tuple(pair for pair in zip(unit.BASE, self.exponents or (), strict=False) if pair[1])
        text = format_product(base_factors if any(power.denominator != 1 for _, power in factors) else factors)
        if is_readable(text):
            return text
        is_coherent = all((u.factor, u.offset) == (1.0, 0.0) for u in (unit.describe(symbol) for symbol, _ in factors))
        return format_product(factors if is_coherent else base_factors)

    @property
    def text(self) -> str:
        """Predicate for a message: `is in N`, or `is a plain number`."""
        return f"is in {self.unit or format_product(self.factors)}" if self.factors else "is a plain number"

    def is_compatible(self, other: Measure) -> bool:
        """Whether values of both may be added and converted; true if either is unknown."""
        if self.factors == other.factors:
            return True
        return None in (self.exponents, other.exponents) or self.exponents == other.exponents

    def converts_to(self, symbol: str, is_scaled: bool) -> bool:
        """Whether a value converts to a unit; cycles to angles only if the expression has a factor, `is_scaled`."""
        if not self.is_compatible(unit_measure(symbol)):
            return False
        return is_scaled or not self.unit or not unit.cycles_or_angles(self.unit, symbol)

    def raise_to(self, power: Fraction) -> Measure:
        """Return the measure of a power of the value."""
        if self.factors is None or abs(power) > MAX_POWER:
            return UNKNOWN
        return Measure(tuple((symbol, exponent * power) for symbol, exponent in self.factors if power))

    def multiply(self, other: Measure) -> Measure:
        """Return the measure of a product of two values."""
        if self.factors is None or other.factors is None:
            return UNKNOWN
        powers = dict(self.factors)
        for symbol, power in other.factors:
            powers[symbol] = powers.get(symbol, Fraction()) + power
        if any(abs(power) > MAX_POWER for power in powers.values()):
            return UNKNOWN
        return Measure(tuple((symbol, power) for symbol, power in powers.items() if power))


UNKNOWN = Measure(None)
DIMENSIONLESS = Measure()


def format_product(factors: Factors) -> str:
    """Format units with their powers as one unit: `N*m/s^2`."""
    if len(factors) == 1 and factors[0][1] == 1:
        return factors[0][0]
    numerator = [format_factor(symbol, power) for symbol, power in factors if power > 0]
    denominator = [format_factor(symbol, -power) for symbol, power in factors if power < 0]
    denominator_text = "*".join(denominator) if len(denominator) == 1 else f"({'*'.join(denominator)})"
    return ("*".join(numerator) or "1" * bool(denominator)) + (f"/{denominator_text}" if denominator else "")


def format_factor(symbol: str, power: Fraction) -> str:
    """Format a unit with its power: `N`, `N^2`, `(N/m)^2`."""
    if any(operator in symbol for operator in "*/^. "):
        symbol = f"({symbol})"
    exponent = f"{float(power):g}"
    return symbol if power == 1 else f"{symbol}^{exponent if Fraction(exponent) == power else f'({power})'}"


def is_readable(text: str) -> bool:
    """Whether a unit can be read and converted: `N`, not `N^0.5`."""
    try:
        unit.describe(text)
    except CouplingError:
        return False
    return True


def unit_measure(text: str | None) -> Measure:
    """Return the measure of a variable by its unit; unknown without a unit, or with one that is not in any table."""
    if text in ("", "1", "-"):
        return DIMENSIONLESS
    return Measure(split_unit(str(text))) if is_readable(text or "?") else UNKNOWN


def split_unit(text: str) -> Factors:
    """Split a unit into its factors: `N/m^2` into N and 1/m^2; the entire text is one factor if it has another form."""
    numerator, _, denominator = text.replace("**", "^").partition("/")
    sides = [
        (numerator, 1),
        (denominator.removeprefix("(").removesuffix(")") if denominator.startswith("(") else denominator, -1),
    ]
    powers: dict[str, Fraction] = {}
    for side, sign in sides:
        for factor in side.split("*") if side else ():
            match = FACTOR.fullmatch(factor)
            if match is None:
                return ((text, Fraction(1)),)
            powers[match[1]] = powers.get(match[1], Fraction()) + sign * int(match[2] or 1)
    return tuple((symbol, power) for symbol, power in powers.items() if power and symbol != "1")


def preferred_unit(value_measure: Measure, units: Mapping[str, str], display_units: Mapping[str, str]) -> str:
    """Return the unit in which to show a value: that of the first signal with the same unit, or the value's own."""
    if not value_measure.unit:
        return ""
    same_unit = (
        name
        for name, symbol in units.items()
        if dict(unit_measure(symbol).factors or ()) == dict(value_measure.factors or ())
    )
    name = next(same_unit, "")
    return display_units.get(name) or units.get(name) or value_measure.unit


def expression_measure(expression: Expression, units: Mapping[str, str | None]) -> Measure:
    """Return the measure of an expression. ScenarioError for sums or comparisons of different kinds.

    `units`: unit of each signal.
    """
    return node_measure(expression.tree, units) or UNKNOWN


def node_measure(node: ast.expr, units: Mapping[str, str | None]) -> Measure | None:
    """Return the measure of a checked node; None if it consists of numbers only."""
    match node:
        case ast.Constant():
            return None
        case ast.UnaryOp(operand=operand):
            return node_measure(operand, units)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            return common_measure([left, right], node, units)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return power_measure(left, right, units)
        case ast.BinOp(left=left, op=operator, right=right):
            first, second = node_measure(left, units), node_measure(right, units)
            if first is None and second is None:
                return None
            sign = Fraction(-1 if isinstance(operator, ast.Div) else 1)
            return (first or DIMENSIONLESS).multiply((second or DIMENSIONLESS).raise_to(sign))
        case ast.Call(func=ast.Name(id="sqrt"), args=[argument]):
            inner = node_measure(argument, units)
            return inner and inner.raise_to(Fraction(1, 2))
        case ast.Call(args=arguments):
            return common_measure(arguments, node, units)
    return unit_measure(units[node_signal(node).name])


def common_measure(operands: Sequence[ast.expr], node: ast.expr, units: Mapping[str, str | None]) -> Measure | None:
    """Return the common measure of all operands except numbers; ScenarioError if they differ."""
    measures = {
        ast.unparse(operand): operand_measure
        for operand in operands
        if (operand_measure := node_measure(operand, units)) is not None
    }
    unit_measures = [
        (text, operand_measure) for text, operand_measure in measures.items() if operand_measure.factors is not None
    ]
    for text, operand_measure in unit_measures[1:]:
        if not operand_measure.is_compatible(unit_measures[0][1]):
            verb = "Compare" if isinstance(node, ast.Call) else "Add and subtract"
            first_text = f"`{unit_measures[0][0]}` {unit_measures[0][1].text}"
            raise ScenarioError(f"{first_text}, `{text}` {operand_measure.text}. {verb} quantities of one kind.")
    return next(
        (operand_measure for operand_measure in measures.values() if operand_measure.factors is None),
        unit_measures[0][1] if unit_measures else None,
    )


def power_measure(base: ast.expr, exponent: ast.expr, units: Mapping[str, str | None]) -> Measure | None:
    """Return the measure of a power; ScenarioError if the exponent has a unit, or varies while the base has a unit."""
    base_measure, exponent_measure = node_measure(base, units), node_measure(exponent, units)
    if exponent_measure is not None and exponent_measure.exponents is not None and any(exponent_measure.exponents):
        raise ScenarioError(f"the exponent `{ast.unparse(exponent)}` {exponent_measure.text}, expected a plain number.")
    if base_measure is None:
        return exponent_measure and DIMENSIONLESS
    if exponent_measure is None:
        value = constant_value(exponent)
        return base_measure.raise_to(Fraction(value).limit_denominator(MAX_POWER)) if math.isfinite(value) else UNKNOWN
    if base_measure.exponents is not None and any(base_measure.exponents):
        text = f"`{ast.unparse(base)}` {base_measure.text}, so its exponent must be a number"
        raise ScenarioError(f"{text}, not `{ast.unparse(exponent)}`. Divide by a unit first.")
    return base_measure


def constant_value(node: ast.expr) -> float:
    """Evaluate a node that consists of numbers only."""
    with np.errstate(all="ignore"):
        return float(evaluate(node, {}))


def is_difference(expression: Expression) -> bool:
    """Whether a value is a difference, for which a unit's offset does not matter: 5 K more are 5 degC more."""
    count = zero_count(expression.tree)
    return count is not None and not math.isclose(count, 1.0)


def zero_count(node: ast.expr) -> float | None:
    """Count the zeros of a scale in a value: 1 in a temperature, 0 in a difference; None in a number."""
    match node:
        case ast.Constant():
            return None
        case ast.UnaryOp(op=operator, operand=operand):
            inner = zero_count(operand)
            return -inner if inner is not None and isinstance(operator, ast.USub) else inner
        case ast.BinOp(left=left, op=operator, right=right):
            return combine_zero_counts(left, operator, right)
        case ast.Call(args=arguments):
            counts = {count for argument in arguments if (count := zero_count(argument)) is not None}
            return abs(counts.pop()) if len(counts) == 1 else 1.0 if counts else None
    return 1.0


def combine_zero_counts(left: ast.expr, operator: ast.operator, right: ast.expr) -> float | None:
    """Count the zeros of a scale in a binary operation; `motor.temperature - 310` is a difference."""
    first, second = zero_count(left), zero_count(right)
    if first is None and second is None:
        return None
    match operator:
        case ast.Sub():
            return 0.0 if first is None or second is None else first - second
        case ast.Add():
            return (first or 0.0) + (second or 0.0)
        case ast.Mult() | ast.Div() if first is None or second is None:
            value = constant_value(left if first is None else right)
            if isinstance(operator, ast.Mult):
                return (first or second or 0.0) * value
            return first / value if first is not None and value else 1.0
        case ast.Mult():
            return (first or 0.0) * (second or 0.0)
    return 1.0 if first is None else first
