"""Values of single keys of a scenario: as written, or with the reason why not."""

from __future__ import annotations

from typing import Any

import pytest

from tests.every_case import every_case
from twin.scenario import parse_scenario
from twin.scenario.keys.key_types import parse_scales, reference_figures


@every_case(
    ("value", "reason"),
    [
        ({"wall.force": "0.2 N", "a.x": 3}, ""),
        ({}, ""),
        ("0.2 N", "expected scales such as {wall.force: 0.2 N}, not 0.2 N"),
        (["wall.force"], "expected scales such as {wall.force: 0.2 N}, not a list"),
        ({"force": 1}, "expected member.variable"),
        ({"wall.force": None}, "expected a value or a list of values, not nothing"),
    ],
)
def test_scales_of_variables(value: Any, reason: str) -> None:
    if not reason:
        assert parse_scales(value) == value
        return
    with pytest.raises(ValueError, match=r".") as caught:
        parse_scales(value)
    assert str(caught.value).startswith(reason)


def test_reference_values_of_all_or_of_each_variant() -> None:
    for value in ("36 mN", 0.5, {"PI": "36 mN", "FF": 2}):
        assert reference_figures(value) == value
    for wrong in (None, {"PI": None}, {"PI": [1]}):
        with pytest.raises(ValueError, match="expected a value"):
            reference_figures(wrong)


def test_a_fault_may_come_at_once() -> None:
    text = (
        "stop_time: 2 s\nmembers: {a: {component: b}}\nevents: [{at: AT, fault: heartbeat, node: a, description: x}]\n"
    )
    for at, time in (("0 s", 0), ("1.5 s", 1_500_000_000)):
        (fault,) = parse_scenario(text.replace("AT", at)).variants[0].faults
        assert (fault.time_ns, fault.text) == (time, "heartbeat, node a")
