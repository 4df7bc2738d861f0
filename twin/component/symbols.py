"""Exact parser for units in common use, without loading pint.

`mm/(s*N)` is read here in microseconds, where pint takes a third of a second to load. Other units and spellings
are left to pint; units defined here mean the same there (tests/component/test_symbols.py).
"""

from __future__ import annotations

import math
import re
from fractions import Fraction

Exact = tuple[Fraction, tuple[int, ...]]  # size in base units, and exponents of kg, m, s, A, K, mol, cd, rad

TOKEN = re.compile(r"[A-Za-zµμ%]+|\*\*|\d+|\S")
LONGEST = 60  # characters of a unit
LARGEST = 10**100  # of a size's numerator and denominator
PREFIXES: dict[str, Fraction | int] = {
    "": 1,
    "p": Fraction(1, 10**12),
    "n": Fraction(1, 10**9),
    "u": Fraction(1, 10**6),
    "µ": Fraction(1, 10**6),
    "μ": Fraction(1, 10**6),
    "m": Fraction(1, 1000),
    "c": Fraction(1, 100),
    "k": 1000,
    "M": 10**6,
    "G": 10**9,
}
TURN = 2 * Fraction(math.pi)  # [rad]

# symbol: prefixes that it is used with, size, exponents
SYMBOLS: dict[str, tuple[str, Fraction | int, tuple[int, ...]]] = {
    "g": ("mk", Fraction(1, 1000), (1, 0, 0, 0, 0, 0, 0, 0)),
    "m": ("pnuµμmck", 1, (0, 1, 0, 0, 0, 0, 0, 0)),
    "s": ("pnuµμm", 1, (0, 0, 1, 0, 0, 0, 0, 0)),
    "min": ("", 60, (0, 0, 1, 0, 0, 0, 0, 0)),
    "h": ("", 3600, (0, 0, 1, 0, 0, 0, 0, 0)),
    "A": ("pnuµμm", 1, (0, 0, 0, 1, 0, 0, 0, 0)),
    "K": ("m", 1, (0, 0, 0, 0, 1, 0, 0, 0)),
    "mol": ("m", 1, (0, 0, 0, 0, 0, 1, 0, 0)),
    "rad": ("m", 1, (0, 0, 0, 0, 0, 0, 0, 1)),
    "deg": ("", TURN / 360, (0, 0, 0, 0, 0, 0, 0, 1)),
    "rpm": ("", TURN / 60, (0, 0, -1, 0, 0, 0, 0, 1)),
    "Hz": ("kMG", 1, (0, 0, -1, 0, 0, 0, 0, 0)),
    "N": ("uµμmk", 1, (1, 1, -2, 0, 0, 0, 0, 0)),
    "Pa": ("mkMG", 1, (1, -1, -2, 0, 0, 0, 0, 0)),
    "bar": ("m", 10**5, (1, -1, -2, 0, 0, 0, 0, 0)),
    "J": ("mk", 1, (1, 2, -2, 0, 0, 0, 0, 0)),
    "W": ("mk", 1, (1, 2, -3, 0, 0, 0, 0, 0)),
    "C": ("", 1, (0, 0, 1, 1, 0, 0, 0, 0)),
    "V": ("mk", 1, (1, 2, -3, -1, 0, 0, 0, 0)),
    "ohm": ("mkM", 1, (1, 2, -3, -2, 0, 0, 0, 0)),
    "H": ("uµμm", 1, (1, 2, -2, -2, 0, 0, 0, 0)),
    "F": ("pnuµμm", 1, (-1, -2, 4, 2, 0, 0, 0, 0)),
    "T": ("m", 1, (1, 0, -2, -1, 0, 0, 0, 0)),
    "l": ("uµμm", Fraction(1, 1000), (0, 3, 0, 0, 0, 0, 0, 0)),
    "L": ("uµμm", Fraction(1, 1000), (0, 3, 0, 0, 0, 0, 0, 0)),
    "%": ("", Fraction(1, 100), (0, 0, 0, 0, 0, 0, 0, 0)),
    "1": ("", 1, (0, 0, 0, 0, 0, 0, 0, 0)),
}


def exactly(text: str) -> Exact | None:
    """Parse a unit such as `N/mm` or `mm/(s^2*N)`; None if pint must parse it."""
    tokens = TOKEN.findall(text[: LONGEST + 1])[::-1]
    try:
        unit = _product(tokens) if len(text) <= LONGEST else None
    except (KeyError, IndexError, ValueError):
        return None
    return unit if not tokens else None


def _product(tokens: list[str]) -> Exact:
    """Factors from left to right; `tokens` are taken from the end of the list."""
    unit = _power(tokens)
    while tokens and tokens[-1] in ("*", "/"):
        sign = 1 if tokens.pop() == "*" else -1
        unit = _times(unit, _raised(_power(tokens), sign))
    return unit


def _power(tokens: list[str]) -> Exact:
    """A symbol or a product in parentheses, with a whole power of one digit."""
    if (token := tokens.pop()) == "(":
        unit = _product(tokens)
        if tokens.pop() != ")":
            raise ValueError(token)
    else:
        unit = _symbol(token)
    if tokens and tokens[-1] in ("^", "**"):
        tokens.pop()
        sign = -1 if tokens[-1] == "-" and tokens.pop() else 1
        power = tokens.pop()
        if len(power) != 1:
            raise ValueError(power)
        unit = _raised(unit, sign * int(power))
    return unit


def _symbol(token: str) -> Exact:
    """A symbol, maybe with a prefix that it is used with."""
    if token in SYMBOLS:
        return Fraction(SYMBOLS[token][1]), SYMBOLS[token][2]
    prefixes, size, exponents = SYMBOLS[token[1:]]
    if token[0] not in prefixes:
        raise KeyError(token)
    return PREFIXES[token[0]] * Fraction(size), exponents


def _times(first: Exact, second: Exact) -> Exact:
    """The product of two units."""
    return first[0] * second[0], tuple(a + b for a, b in zip(first[1], second[1], strict=True))


def _raised(base: Exact, power: int) -> Exact:
    """A whole power of a unit."""
    size = base[0] ** power
    if max(abs(size.numerator), size.denominator) > LARGEST:
        raise ValueError(power)  # a power of a power of a power would be computed forever
    return size, tuple(power * exponent for exponent in base[1])
