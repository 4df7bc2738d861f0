"""What `symbols` knows means the same to pint, and is what nearly everybody writes."""

import itertools
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.every_case import every_case
from twin.component import symbols, unit

EVERY = [prefix + name for name, (prefixes, _, _) in symbols.SYMBOLS.items() for prefix in ("", *prefixes)]
DRAWN = st.sampled_from([one for one in EVERY if one != "%"])


def same(text):
    exact = symbols.exactly(text)
    assert exact is not None, text
    by_pint = unit.parse_with_pint(text)
    return (unit.round_trip(float(exact[0])), 0.0, exact[1]) == (
        unit.round_trip(by_pint.factor),
        by_pint.offset,
        by_pint.exponents,
    )


@every_case("text", EVERY)
def test_a_symbol_is_what_pint_says(text):
    assert all(map(same, (text, f"1/{text}", f"{text}^2")))


@pytest.mark.slow
@given(DRAWN, DRAWN, st.sampled_from(["{}/{}", "{}*{}", "{} / {}", "1/({}*{})", "({}*{})", "{}*{}^-1", "{}**1/{}"]))
def test_a_product_is_what_pint_says(first, second, form):
    assert same(form.format(first, second))


@every_case(
    "text",
    ["", " ", "m m", "m/", "(m", "m)", "m^", "m^12", "m^x", "2*m", "degC", "dBm", "kmm", "m^2^2", "/s", "m" * 61],
)
def test_what_is_written_otherwise_is_for_pint(text):
    assert symbols.exactly(text) is None


def test_powers_of_powers_end():
    text = "m/mm"
    for _ in range(9):
        text = f"({text})^9"
    assert len(text) < symbols.LONGEST
    assert symbols.exactly(text) is None


@pytest.mark.slow
def test_scenarios_of_the_project_need_no_pint():
    code = """
import sys
from pathlib import Path
from twin.run import resolve_catalogs
from twin.scenario import load_scenario
for name in ("heart_wall_force", "injection_sequence"):
    resolve_catalogs(load_scenario(Path("scenarios", f"{name}.yaml")))
    assert "pint" not in sys.modules, name
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_exponents_are_those_of_the_base_units():
    for name, exponents in itertools.product(["kg", "m", "s", "A", "K", "mol", "rad"], [unit.BASE]):
        assert symbols.exactly(name)[1] == tuple(int(one == name) for one in exponents)
