"""Slopes of the functions and operators that a component may use: the table `tangent` differentiates with.

In a rule `v` is the value, `a` and `b` are the operands, `d` is the tangent of the operand that the rule is for.
"""

from __future__ import annotations

import ast
import builtins
import math
from math import copysign, cos, cosh, exp, floor, log, sin, sinh, sqrt, trunc
from typing import Any

import numpy as np

from twin.compiler.builtins import NUMPY

OPERATORS: dict[type[ast.operator], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
    ast.Mod: "%",
    ast.FloorDiv: "//",
}

# slope of one operand's function, times its tangent
UNARY = {
    "abs": "_slope_sign({a}) * {d}",
    "float": "{d}",
    "sqrt": "_slope_root({v}) * {d}",
    "exp": "{v} * {d}",
    "expm1": "_slope_exp({a}) * {d}",
    "log": "{d} / {a}",
    "log1p": "{d} / (1.0 + {a})",
    "log2": "{d} / ({a} * 0.6931471805599453)",
    "log10": "{d} / ({a} * 2.302585092994046)",
    "sin": "_slope_cos({a}) * {d}",
    "cos": "-_slope_sin({a}) * {d}",
    "tan": "(1.0 + {v} * {v}) * {d}",
    "asin": "{d} / _slope_sqrt((1.0 - {a}) * (1.0 + {a}))",
    "acos": "-{d} / _slope_sqrt((1.0 - {a}) * (1.0 + {a}))",
    "atan": "{d} / (1.0 + {a} * {a})",
    "sinh": "_slope_cosh({a}) * {d}",
    "cosh": "_slope_sinh({a}) * {d}",
    "tanh": "_slope_bell({a}) * {d}",
    "asinh": "{d} / _slope_sqrt(1.0 + {a} * {a})",
    "acosh": "{d} / _slope_sqrt(({a} - 1.0) * ({a} + 1.0))",
    "atanh": "{d} / ((1.0 - {a}) * (1.0 + {a}))",
    "erf": "1.1283791670955126 * _slope_exp(-{a} * {a}) * {d}",
    "erfc": "-1.1283791670955126 * _slope_exp(-{a} * {a}) * {d}",
    "radians": "0.017453292519943295 * {d}",
    "degrees": "57.29577951308232 * {d}",
}

# slopes of both operands; empty: none
BINARY = {
    "+": ("{d}", "{d}"),
    "-": ("{d}", "(-{d})"),
    "*": ("{d} * {b}", "{a} * {d}"),
    "/": ("{d} / {b}", "(-{v} * {d} / {b})"),
    "**": ("_slope_power({a}, {b}) * {d}", "_slope_exponent({a}, {v}) * {d}"),
    "%": ("{d}", "(-_slope_floor({a} / {b}) * {d})"),
    "//": ("", ""),
    "pow": ("_slope_power({a}, {b}) * {d}", "_slope_exponent({a}, {v}) * {d}"),
    "fmod": ("{d}", "(-_slope_trunc({a} / {b}) * {d})"),
    "min": ("_slope_first({b} >= {a}) * {d}", "_slope_first({b} < {a}) * {d}"),
    "max": ("_slope_first({b} <= {a}) * {d}", "_slope_first({b} > {a}) * {d}"),
    "atan2": ("{b} / ({a} * {a} + {b} * {b}) * {d}", "(-{a} / ({a} * {a} + {b} * {b}) * {d})"),
    "hypot": ("{a} / {v} * {d}", "{b} / {v} * {d}"),
    "copysign": ("_slope_same({a}, {v}) * {d}", ""),
}

# piecewise constant: tangent zero
FLAT = {
    "floor",
    "ceil",
    "trunc",
    "rint",
    "round",
    "int",
    "bool",
    "len",
    "range",
    "sign",
    "isfinite",
    "isnan",
    "isinf",
}

OTHER_NAMES = {
    "fabs": "abs",
    "absolute": "abs",
    **NUMPY,
    "minimum": "min",
    "maximum": "max",
    "power": "pow",
    "deg2rad": "radians",
    "rad2deg": "degrees",
    "float64": "float",
}


def _names() -> dict[Any, str]:
    """Function -> name in the tables, for `math`, numpy and the built-in functions."""
    names = {}
    for name in (*UNARY, *BINARY, *FLAT, *OTHER_NAMES):
        for module in (math, np, builtins):
            function = getattr(module, name, None)
            if function is not None:
                names[function] = OTHER_NAMES.get(name, name)
    return names


NAMES = _names()


def sign(a: float) -> float:
    """Slope of |a|; 0 in the kink."""
    if a > 0.0:
        return 1.0
    return -1.0 if a < 0.0 else 0.0


def root(v: float) -> float:
    """Slope of a square root with value v; 0 for the infinite one at its start."""
    return 0.5 / v if v != 0.0 else 0.0


def bell(a: float) -> float:
    """Slope of tanh: 1 / cosh^2."""
    e = exp(-2.0 * abs(a))
    return 4.0 * e / ((1.0 + e) * (1.0 + e))


def power(a: float, b: float) -> float:
    """Slope of a^b along a."""
    return b * a ** (b - 1.0) if b != 0.0 else 0.0


def exponent(a: float, v: float) -> float:
    """Slope of v = a^b along b."""
    return v * log(a) if a > 0.0 else 0.0


def first(chosen: bool) -> float:
    """Share of an operand in a minimum or maximum."""
    return 1.0 if chosen else 0.0


def same(a: float, v: float) -> float:
    """Whether copysign kept the sign."""
    return copysign(1.0, a) * copysign(1.0, v)


# what the rules call, by the names they use
CALLED: dict[str, Any] = {
    f"_slope_{function.__name__}": function
    for function in (
        sign,
        root,
        bell,
        power,
        exponent,
        first,
        same,
        cos,
        cosh,
        exp,
        floor,
        log,
        sin,
        sinh,
        sqrt,
        trunc,
    )
}
