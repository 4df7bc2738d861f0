"""Whatever comes as a scenario loads, or is refused with a message."""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.scenario.texts import BASE, catalog
from twin.errors import ScenarioError, TwinError
from twin.scenario import lint, parse_scenario
from twin.scenario.check import check_against
from twin.scenario.keys import quantities


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.text(max_size=200))
def test_any_text_loads_or_says_why(text: str) -> None:
    with contextlib.suppress(ScenarioError):
        parse_scenario(text)


PIECES = [
    "- ",
    "{",
    "}",
    "[",
    "]",
    ": ",
    "~",
    "null",
    "-1 s",
    "*",
    ".nan",
    "'",
    "&a ",
    "*a",
    "\t",
    "\n  ",
    "\n",
    "5",
    "->",
    "[[1]]",
]


@pytest.mark.slow
@settings(max_examples=250, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.integers(0, len(BASE)), st.integers(0, 30), st.sampled_from(PIECES))
def test_any_change_loads_or_says_why(start: int, length: int, piece: str) -> None:
    with contextlib.suppress(ScenarioError, KeyError):  # KeyError: a member that this catalog does not have
        scenario = parse_scenario(BASE[:start] + piece + BASE[start + length :])
        parse_scenario(scenario.frozen())
        check_against(scenario, {case.variant: catalog() for case in scenario.variants}, {})


SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
TREES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
)
KEYS = [
    "members",
    "connections",
    "variants",
    "events",
    "record",
    "metrics",
    "expect",
    "plots",
    "seeds",
    "seed",
    "step",
    "stop_time",
]


@pytest.mark.slow
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.dictionaries(st.sampled_from(KEYS), TREES, max_size=4))
def test_any_structure_loads_or_says_why(data: dict[str, Any]) -> None:
    import yaml

    text = yaml.safe_dump(yaml.safe_load(BASE) | data, allow_unicode=True)
    with contextlib.suppress(ScenarioError):
        parse_scenario(text)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.integers(0, len(BASE)), st.integers(0, 30), st.sampled_from(PIECES))
def test_every_problem_is_found_whatever_else_is_wrong(start: int, length: int, piece: str) -> None:
    text = BASE[:start] + piece + BASE[start + length :]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "s.yaml"
        path.write_text(text)
        try:
            found = lint(path, imports=False)[1]
        except ScenarioError as error:
            found = error.problems
    with contextlib.suppress(ScenarioError):
        parse_scenario(text, path)
        return
    assert found


@given(st.text(max_size=30))
def test_any_value_resolves_or_says_why(text: str) -> None:
    with contextlib.suppress(TwinError):
        quantities.number(text, "N", "x")
