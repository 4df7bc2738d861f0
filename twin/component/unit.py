"""Units: SI inside, display units at the interfaces. Pint, imported only here, parses what `symbols` does not know.

A unit's text may come from anybody: a scenario, an FMU, the header of a table, an analysis. `spelled` is the one door:
pint would compute `m**9**9**9` forever.
"""

from __future__ import annotations

import math
import re
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from twin.component import symbols
from twin.errors import CouplingError
from twin.files import split_unit

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")  # the order in which FMI lists exponents
CYCLES = re.compile(r"Hz|hertz|rpm|rps|per_minute|per_second|turn|revolution|cycle|circle")
NAMES = {"kilogram": 0, "meter": 1, "second": 2, "ampere": 3, "kelvin": 4, "mole": 5, "candela": 6, "radian": 7}

SMALLEST = 1e-99  # and 1e99 the largest size of a unit that can be computed with
HIGHEST = 100  # product of all powers in a unit's text: bounds nested ones, too
ADVICE = "Write it like N, mm/s, mm/(s*N), deg."

# Symbols, powers of one digit, products and quotients, and no other numbers: all of it is quickly computed.
LETTER = "A-Za-zµμΩΩ°%_"
TOKEN = re.compile(
    rf"[{LETTER}](?:[\w°%]*[{LETTER}])?|(?<![\w.])1(?![\w.])|(?:\^|\*\*)[+-]?\d(?![\w.])|(?<!\*)\*(?!\*)|[/·.() ]"
)
NUMBER = r"\d{1,25}(?:\.\d{1,25})?(?:e[+-]?\d{1,3})?"
DEFINED = re.compile(rf".{{0,30}} \{{(?P<factor>{NUMBER}) (?P<unit>[^{{}}]{{1,60}}?) \+ (?P<offset>-?{NUMBER})\}}")
POWER = re.compile(r"\s*(?:\^|\*\*)\s*([+-]?\d)")
WORD = re.compile(rf"[{LETTER}](?:[\w°%]*[{LETTER}])?")
# names whose size or kind is another one in another version of pint from 0.24.4 to 0.26.2: a pond was 1 kgf and is 1 gf
UNSTABLE = frozenset(
    [
        "pond",
        "kpond",
        "kilopond",
        "mil",
        "quarter",
        "drachm",
        "ch",
        "reaumur",
        "réaumur",
        "degRe",
        "degreeRe",
        "°Re",
        "degree_Reaumur",
        "degree_Réaumur",
        "delta_reaumur",
        "delta_réaumur",
        "delta_degRe",
        "delta_degreeRe",
        "delta_degree_Reaumur",
        "delta_degree_Réaumur",
        "mH2O",
        "mHg",
        "mHg_0C",
        "mHg_32F",
        "mHg_60F",
        "acre",
        "acre_foot",
        "acre_feet",
        "cables_length",
        "chain",
        "fathom",
        "fur",
        "furlong",
        "league",
        "li",
        "link",
        "perch",
        "pole",
        "rd",
        "rod",
        "sq_perch",
        "sq_pole",
        "sq_rod",
        "square_league",
        "square_rod",
    ]
)
PRODUCT = re.compile(rf"(?<=[{LETTER})\d])[.·](?=[{LETTER}(])")  # `N.m`, which pint knows up to 0.25
SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
IN_PARENTHESES = re.compile(r"(.*\S)\s*\(\s*([^()]+?)\s*\)")  # `tip (mm)`
ATTACHED = re.compile(rf"(?<=[{LETTER}])([+-]?\d)(?![\w.])")  # `m2`, `s-1`: so Modelica writes powers


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit as FMI describes it: value in base units = factor * value + offset, and exponents of `BASE`."""

    factor: float
    offset: float
    exponents: tuple[int, ...]


@lru_cache(maxsize=1)
def registry() -> Any:
    """Pint's registry, made on first use: with pint's import it takes 0.35 s.

    Nothing of it is kept on disk: pint stores pickles, and write access to them would allow running code here.
    """
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


def short(text: str) -> str:
    """A unit's text for a message: never long."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


def advice(text: str, amount: str = "") -> str:
    """How to write a unit that is not known: in another case or by another name, if that is clear; else examples."""
    if text.casefold() in ("bpm", "beats/min"):
        return f"Write {f'{amount} /min'.strip()}."
    names = [f"{prefix}{symbol}" for symbol, (prefixes, *_) in symbols.SYMBOLS.items() for prefix in ("", *prefixes)]
    texts = [""]
    for piece in re.split(f"({WORD.pattern})", text[: symbols.LONGEST]):
        similar = [] if piece in names else [name for name in names if name.casefold() == piece.casefold()]
        texts = [begin + name for begin in texts for name in similar or [piece]][:3]
    valid = [other for other in texts if other != text and symbols.exactly(other)]
    return f"Did you mean {' or '.join(valid)}?" if valid else ADVICE


def spelled(text: str) -> str:
    """A unit's text with its powers as `^2`; CouplingError if it is no product of symbols, or too much work."""
    plain = text.translate(SUPERSCRIPTS) if len(text) <= symbols.LONGEST else ""
    normalized = ATTACHED.sub(r"^\1", PRODUCT.sub("*", plain))
    normalized = POWER.sub(r"^\1", normalized)
    powers = [max(abs(int(power)), 1) for power in POWER.findall(normalized)]
    if not normalized or TOKEN.sub("", normalized) or math.prod(powers) > HIGHEST:
        raise CouplingError(f"unit {short(text)} is not known. {ADVICE}")
    return normalized


@lru_cache(maxsize=1024)
def describe(unit: str) -> Unit:
    """FMI description of a unit such as `N/mm` or `mm/(s*N)`; `""`, `-` and `1` are dimensionless.

    CouplingError: it is not known, or no multiple of SI's base units.
    """
    if unit in ("", "1", "-"):
        return Unit(1.0, 0.0, (0,) * len(BASE))
    try:
        described = read(unit)
    except CouplingError:
        raise
    except Exception:  # pint raises exceptions of many types at invalid input
        raise CouplingError(f"unit {short(unit)} is not known. {advice(unit)}") from None
    if not SMALLEST < described.factor < 1.0 / SMALLEST:
        raise CouplingError(f"unit {short(unit)} has no size that can be computed with. {ADVICE}")
    return Unit(round_trip(described.factor), described.offset, described.exponents)


def split_header(name: str) -> tuple[str, str]:
    """Split the header of a column into name and unit: `tip [mm]`, or `tip (mm)` if that is a unit; else "" as unit."""
    base, symbol = split_unit(name)
    if symbol or not (matched := IN_PARENTHESES.fullmatch(name)):
        return base, symbol
    try:
        describe(matched[2])
    except CouplingError:
        return name, ""
    return matched[1], matched[2]


def read(unit: str) -> Unit:
    """Parse a unit by its definition, by its symbols, or with pint."""
    if matched := DEFINED.fullmatch(unit):
        size = describe(matched["unit"])
        return Unit(float(matched["factor"]) * size.factor, float(matched["offset"]), size.exponents)
    text = spelled(unit)
    exact = symbols.exactly(text)
    return parse_with_pint(text) if exact is None else Unit(float(exact[0]), 0.0, exact[1])


def defined(name: str, meant: Unit) -> str:
    """The text of a unit as an FMU defines it: its name, and `{1.5 kg/s + 3}` behind it if that is not what it is here.

    A name whose definition cannot be computed with is returned unchanged.
    """
    with suppress(CouplingError):
        described = describe(name)
        near = math.isclose(described.factor, meant.factor, rel_tol=1e-6)
        level = math.isclose(described.offset, meant.offset, rel_tol=1e-6, abs_tol=1e-9 * meant.factor)
        if described.exponents == meant.exponents and near and level:
            return name
    powers = "*".join(
        f"{base}^{power}".removesuffix("^1") for base, power in zip(BASE, meant.exponents, strict=True) if power
    )
    plain = "".join(letter if letter.isprintable() and letter not in "{}" else "?" for letter in name[:30])
    text = f"{plain} {{{meant.factor!r} {powers or '1'} + {meant.offset!r}}}"
    with suppress(CouplingError):
        describe(text)
        return text
    return name


def shown(unit: str) -> str:
    """A unit's name for people, without a definition behind it."""
    return unit.partition(" {")[0]


def label(unit: str) -> str:
    """A unit as it stands after a number, in a title and on an axis: `/min` for `1/min`."""
    text = shown(unit)
    return text.removeprefix("1") if text.startswith("1/") or text == "1" else text


def declaration(role: str, name: str, shape: tuple[int, ...], symbol: str, description: str) -> str:
    """A variable in one line: `<output position[3] [m]: tip of the catheter>`."""
    size = f"[{','.join(map(str, shape))}]" if shape else ""
    label = f" [{shown(symbol)}]" if symbol not in ("", "1") else ""
    text = f": {description}" if description else ""
    return f"<{role} {name}{size}{label}{text}>"


def parse_with_pint(text: str) -> Unit:
    """Parse with pint a text that `spelled` accepted."""
    if unstable := [word for word in WORD.findall(text) if word in UNSTABLE or word.removesuffix("s") in UNSTABLE]:
        raise CouplingError(f"unit {short(unstable[0])}: versions of pint differ about its size. {ADVICE}")
    units = registry()
    origin, single, double = (units.Quantity(value, units.Unit(text)).to_base_units() for value in (0.0, 1.0, 2.0))
    exponents = [0] * len(BASE)
    for name, power in single.unit_items():
        if name not in NAMES or int(power) != power:
            raise CouplingError(
                f"unit {short(text)} has no SI base units ({single.units}). Use N, mm, deg and the like."
            )
        exponents[NAMES[name]] = int(power)
    factor = float(single.magnitude - origin.magnitude)
    if not math.isclose(double.magnitude - single.magnitude, factor, rel_tol=1e-9):
        raise CouplingError(f"unit {short(text)} is no multiple of SI's units. Use N, mm, deg and the like.")
    return Unit(factor, float(origin.magnitude), tuple(exponents))


def round_trip(factor: float) -> float:
    """A factor without the noise of pint's products: the 15-digit decimal if that is what was meant."""
    return float(f"{factor:.15g}")


def same_kind(first: Unit, second: Unit) -> bool:
    """Whether values convert; radian counts as dimensionless, as in SI."""
    return first.exponents[:-1] == second.exponents[:-1]


def cycles_or_angles(source: str, target: str) -> str:
    """Why cycles and angles per time do not convert: 60 rpm are 6.28 rad/s, which radian as a number would make 6.28 Hz; else ""."""
    first, second = describe(source), describe(target)
    is_rate = first.exponents[2] < 0 and not any((*first.exponents[:2], *first.exponents[3:-1]))
    if first.exponents == second.exponents or not is_rate or not CYCLES.search(f"{source} {target}"):
        return ""
    return f"{source} does not convert to {target}: one counts cycles, the other an angle. 60 rpm are 1 Hz, 60 /min or 6.28 rad/s."


def conversion(source: str, target: str, what: str) -> tuple[float, float]:
    """(factor, offset) with target value = factor * source value + offset; (1, 0) where one side has no unit."""
    if source == target or not source or not target:
        return 1.0, 0.0
    try:
        a, b = describe(source), describe(target)
    except CouplingError as error:
        raise CouplingError(f"{what}: {error}".removeprefix(": ")) from None
    if not same_kind(a, b):
        raise CouplingError(f"{what}: {source} does not convert to {target}. Connect quantities of one kind.")
    if "%" in source + target and a.exponents != b.exponents:
        raise CouplingError(
            f"{what}: {source} does not convert to {target}: an angle has no percent.".removeprefix(": ")
        )
    if turns := cycles_or_angles(source, target):
        raise CouplingError(f"{what}: {turns}".removeprefix(": "))
    return round_trip(a.factor / b.factor), (a.offset - b.offset) / b.factor
