"""operated.yaml: right at any length."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.live.operator import operation_log
from twin.live.operator.operation_log import OperationLog, time_text
from twin.scenario import EventSpec, duration, parse_scenario

HEAD = "members:\n  wall: {component: wall}\n"
PLACE = "wall.tip_position"


@given(st.one_of(st.integers(-(10**15), 10**15), st.builds(Fraction, st.integers(1, 10**9), st.integers(1, 300))))
def test_a_moment_is_exact(time):
    whole = Fraction(time)
    if whole.denominator > 1:
        whole = Fraction(whole.numerator % 10**8, 3) * 10**8  # as a multiple of a step such as 1/300 s
    time = int(whole) if whole.denominator == 1 else whole
    assert duration(time_text(time)) == time


def test_at_any_length(tmp_path):
    path = tmp_path / "operated.yaml"
    file = OperationLog(path, HEAD, 10**6)
    assert parse_scenario(path.read_text()).variants[0].stop_ns == 10**6
    values = [0.1, 1e-7, -2.5e-310, 123456789.123456789, "3 mm"]
    for count, value in enumerate(values, 1):
        file.add(EventSpec(count * 10**6, "set", PLACE, value))
        file.commit((count + 1) * 10**6)
        case = parse_scenario(path.read_text()).variants[0]
        assert [event.value for event in case.events] == values[:count]
        assert case.stop_ns == (count + 1) * 10**6
    file.add(EventSpec(6 * 10**6, "override", "wall.force", 0.1))
    file.add(EventSpec(6 * 10**6, "release", "wall.force"))
    before = path.read_text()
    file.close()  # nothing came of the last two
    assert path.read_text() == before


def test_is_full_before_a_scenario_is_too_large(tmp_path, monkeypatch):
    monkeypatch.setattr(operation_log, "MAX_VALUES", 20)
    file = OperationLog(tmp_path / "operated.yaml", HEAD, 10**6)
    assert not file.is_full
    for count in range(1, 6):
        file.add(EventSpec(count * 10**6, "set", PLACE, 0.0))
    assert file.is_full
    file.close()


@pytest.mark.parametrize("text", ["with: colon", "quote ' and \" both", "# hash", "[1"])
def test_text_survives(tmp_path, text):
    path = tmp_path / "operated.yaml"
    file = OperationLog(path, HEAD, 10**6)
    file.add(EventSpec(10**6, "set", PLACE, text))
    file.commit(2 * 10**6)
    file.close()
    assert parse_scenario(path.read_text()).variants[0].events[0].value == text
