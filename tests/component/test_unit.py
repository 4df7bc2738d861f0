"""Units: one door for every text, whoever wrote it."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.every_case import every_case
from twin.component import unit
from twin.component.unit import Unit
from twin.errors import CouplingError, TwinError

NONE = (0,) * 8
BOMBS = (
    "m**9**9**9",
    "m^9^9^9^9",
    "((((m^9)^9)^9)^9)^9",
    "(" * 29 + "m" + ")^9" * 10,
    "9**9**9**9 m",
    "m**99999999",
    "m" * 10**6,
    "m⁹⁹⁹⁹⁹⁹⁹",
    "m9" * 30,
    "m**9.9e9",
    "(GPa^9)^9",
    "a" * 59 + "!",
    "x {1e999 m + 0}",
    "x {1 m**9**9**9 + 0}",
    "x {" * 99,
)


@every_case(
    ("text", "factor", "exponents"),
    [
        ("N", 1.0, (1, 1, -2, 0, 0, 0, 0, 0)),
        ("mm/(s^2*N)", 1e-3, (-1, 0, 0, 0, 0, 0, 0, 0)),
        ("m/s²", 1.0, (0, 1, -2, 0, 0, 0, 0, 0)),
        ("m ** -2", 1.0, (0, -2, 0, 0, 0, 0, 0, 0)),
        ("N.m", 1.0, (1, 2, -2, 0, 0, 0, 0, 0)),
        ("J/(kg.K)", 1.0, (0, 2, -2, 0, -1, 0, 0, 0)),
        ("kg.m2/s2", 1.0, (1, 2, -2, 0, 0, 0, 0, 0)),
        ("kg.m2.s-2.mol-1", 1.0, (1, 2, -2, 0, 0, -1, 0, 0)),
        ("N·m", 1.0, (1, 2, -2, 0, 0, 0, 0, 0)),
        ("s-1", 1.0, (0, 0, -1, 0, 0, 0, 0, 0)),
        ("cmH2O", 98.0665, (1, -1, -2, 0, 0, 0, 0, 0)),
        ("W/degC", 1.0, (1, 2, -3, 0, -1, 0, 0, 0)),
        ("%", 0.01, NONE),
        ("-", 1.0, NONE),
    ],
)
def test_what_a_text_means(text: str, factor: float, exponents: tuple[int, ...]) -> None:
    assert unit.describe(text) == Unit(factor, 0.0, exponents)


@every_case("text", [*BOMBS, "a -> b", "2*m", "m^1.5", "dB", "bit", "nan", "(", "m > s", "\x00", "\ud800"])
def test_what_is_no_unit_is_told_in_one_line(text: str) -> None:
    with pytest.raises(CouplingError, match=r"^unit '.{0,42}' (is|has) no") as caught:
        unit.describe(text)
    assert len(str(caught.value)) < 150


@pytest.mark.slow
@given(st.one_of(st.text(), st.text("mkNs0129^*/(){}+-. e⁹°%", max_size=80)))
@example("m**9**9**9")
@example("(mm^9)^9")
def test_any_text_is_little_work(text: str) -> None:
    """What is let through has few, small powers: there is nothing to compute for long."""
    try:
        let_through = unit.spelled(text)
    except TwinError:
        pass
    else:
        powers = [int(power) for power in unit.POWER.findall(let_through)]
        assert len(let_through) <= 2 * len(text) <= 120
        assert math.prod(abs(power) or 1 for power in powers) <= unit.HIGHEST
    try:
        found = unit.describe(text)
    except TwinError:
        return
    assert 0.0 < found.factor < math.inf
    assert math.isfinite(found.offset)


@pytest.mark.slow
@given(
    st.text(max_size=40),
    st.floats(1e-30, 1e30),
    st.floats(-1e6, 1e6),
    st.lists(st.integers(-4, 4), min_size=8, max_size=8),
)
def test_what_an_fmu_defines_means_that(name: str, factor: float, offset: float, exponents: list[int]) -> None:
    meant = Unit(factor, offset, tuple(exponents))
    text = unit.defined(name, meant)
    if text == name:
        return  # too many powers, or the name means the same
    found = unit.describe(text)
    assert (found.offset, found.exponents) == (offset, meant.exponents)
    assert math.isclose(found.factor, factor, rel_tol=1e-14)


def test_an_unknown_unit_is_told_with_its_place() -> None:
    with pytest.raises(CouplingError, match=r"^in.csv: column 'u': unit 'fork' is not known"):
        unit.conversion("fork", "m", "in.csv: column 'u'")


def test_a_unit_in_the_wrong_case_and_a_common_name_are_recognized() -> None:
    for text, hint in {
        "hz": "Did you mean Hz?",
        "mm/(s*n)": "Did you mean mm/(s*N)?",
        "kpa": "Did you mean kPa?",
        "mpa": "Did you mean mPa or MPa?",
        "bpm": "Write 84 /min.",
        "fork": unit.ADVICE,
        "fork/hz": unit.ADVICE,
    }.items():
        assert unit.advice(text, "84") == hint
    with pytest.raises(CouplingError, match=r"unit 'hz' is not known\. Did you mean Hz\?"):
        unit.describe("hz")


def test_a_name_that_means_the_same_stays() -> None:
    celsius = Unit(1.0, 273.15, (0, 0, 0, 0, 1, 0, 0, 0))
    assert unit.defined("degC", celsius) == "degC"
    assert unit.defined("C", celsius) == "C {1.0 K + 273.15}"
    assert unit.describe("C {1.0 K + 273.15}") == celsius
    assert unit.shown("C {1.0 K + 273.15}") == "C"
    assert unit.defined("x", Unit(0.0, 0.0, NONE)) == "x"


@every_case("text", ["pond", "mil", "N/pond", "m^2*mil", "quarters", "degRe", "ch", "mHg", "kpond"])
def test_what_versions_of_pint_differ_about_is_refused(text: str) -> None:
    """Found by comparing every name that pint 0.24.4, 0.25.3 and 0.26.2 know."""
    with pytest.raises(CouplingError, match=r"^unit .*: versions of pint differ about its size\. Write it like"):
        unit.describe(text)


# sizes by their definitions: international yard and pound of 1959, standard gravity, conventional mercury
POUND, INCH, GRAVITY = 0.45359237, 0.0254, 9.80665


@every_case(
    ("text", "size"),
    [
        ("kgf", GRAVITY),
        ("gf", GRAVITY / 1000),
        ("lb", POUND),
        ("oz", POUND / 16),
        ("lbf", POUND * GRAVITY),
        ("ozf", POUND / 16 * GRAVITY),
        ("inch", INCH),
        ("ft", 12 * INCH),
        ("yd", 36 * INCH),
        ("mile", 5280 * 12 * INCH),
        ("psi", POUND * GRAVITY / INCH**2),
        ("mmHg", 13.5951 * GRAVITY),
        ("inHg", 13595.1 * GRAVITY * INCH),
        ("atm", 101325.0),
        ("torr", 101325.0 / 760),
        ("cal", 4.184),
        ("hp", 550 * 12 * INCH * POUND * GRAVITY),
        ("knot", 1852 / 3600),
        ("dyn", 1e-5),
        ("erg", 1e-7),
        ("poise", 0.1),
        ("arcmin", math.pi / 10800),
        ("turn", 2 * math.pi),
    ],
)
def test_sizes_do_not_depend_on_the_version_of_pint(text: str, size: float) -> None:
    assert unit.describe(text).factor == pytest.approx(size, rel=1e-6 if "Hg" in text else 1e-12)


@pytest.mark.parametrize(
    ("size", "known"), [("1.1e-99", True), ("0.9e-99", False), ("0.9e99", True), ("1.1e99", False)]
)
def test_units_have_sizes_that_can_be_computed_with(size: str, known: bool) -> None:
    text = f"x {{{size} m + 0}}"
    if known:
        assert unit.describe(text).factor == float(size)
    else:
        with pytest.raises(CouplingError, match="has no size that can be computed with"):
            unit.describe(text)


@every_case(
    ("source", "target"),
    [
        ("rpm", "Hz"),
        ("Hz", "rpm"),
        ("Hz", "rad/s"),
        ("deg/s", "kHz"),
        ("rpm", "1/s"),
        ("1/s", "rpm"),
        ("hertz", "rad/s"),
        ("kilohertz", "deg/s"),
        ("turn/s", "1/s"),
        ("1/s", "revolution/min"),
        ("cycle/s", "1/min"),
        ("rpm/s", "Hz/s"),
        ("Hz/s", "rad/s^2"),
        ("rpm/s", "1/s^2"),
    ],
)
def test_cycles_are_no_angles(source, target):
    """Radian counts as a number: 60 rpm would be 6.28 Hz."""
    with pytest.raises(CouplingError, match=r"one counts cycles, the other an angle"):
        unit.conversion(source, target, "")


@every_case(("source", "target"), [("%", "rad"), ("%", "deg"), ("%/s", "rad/s"), ("rad", "%")])
def test_an_angle_has_no_percent(source, target):
    with pytest.raises(CouplingError, match=f"{source} does not convert to {target}: an angle has no percent"):
        unit.conversion(source, target, "")
    assert unit.conversion("%", "1", "") == (0.01, 0.0)


@every_case(
    ("source", "target", "factor"),
    [
        ("1/min", "Hz", 1 / 60),
        ("rpm", "rad/s", math.tau / 60),
        ("kHz", "1/s", 1000.0),
        ("1/s", "rad/s", 1.0),
        ("turn/s", "rpm", 60.0),
        ("rpm/s", "rad/s^2", math.tau / 60),
        ("N*m/rpm", "N*m*s", 30 / math.pi),
    ],
)
def test_cycles_convert_to_cycles_and_angles_to_angles(source, target, factor):
    assert unit.conversion(source, target, "") == (pytest.approx(factor), 0.0)


@every_case(
    ("header", "name", "symbol"),
    [
        ("tip", "tip", ""),
        ("tip [mm]", "tip", "mm"),
        ("tip (mm)", "tip", "mm"),
        ("tip (left)", "tip (left)", ""),
        ("tip (left) [mm]", "tip (left)", "mm"),
    ],
)
def test_a_header_has_a_unit_in_brackets_or_in_parentheses_if_it_is_one(header, name, symbol):
    assert unit.split_header(header) == (name, symbol)
