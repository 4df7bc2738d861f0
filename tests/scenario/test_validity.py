"""A scenario says until when it is valid."""

import pytest

from twin.errors import ScenarioError
from twin.scenario import lint, load_scenario, parse_scenario

TEXT = """
stop_time: 2 s
valid_until: {stop_time: 2 s, reason: the tank is empty then.}
members: {heart: {component: heart}}
"""


def test_a_stop_time_within_is_accepted_and_a_later_one_refused_with_the_reason():
    assert parse_scenario(TEXT, "tank.yaml").variants[0].stop_ns == 2e9
    with pytest.raises(ScenarioError) as error:
        parse_scenario(TEXT, "tank.yaml", ["stop_time=3 s"])
    assert str(error.value).endswith(
        "stop_time 3 s is later than 2 s, until which this scenario is valid: the tank is empty then."
    )


def test_a_scenario_that_extends_it_may_lift_the_limit(tmp_path):
    (tmp_path / "tank.yaml").write_text(TEXT)
    path = tmp_path / "larger.yaml"
    path.write_text("extends: tank.yaml\nstop_time: 5 s\n")
    with pytest.raises(ScenarioError, match="until which this scenario is valid"):
        load_scenario(path)
    path.write_text("extends: tank.yaml\nvalid_until: null\nstop_time: 5 s\n")
    assert load_scenario(path).variants[0].stop_ns == 5e9


@pytest.mark.slow  # imports and checks whole scenarios
@pytest.mark.parametrize(
    ("scenario", "interval", "expected"),
    [("heart_wall_force", "10 ms", "5 ms"), ("injection_sequence", "5 ms", "10 ms"), ("rotation", "5 ms", "25 ms")],
)
def test_an_analysis_that_counts_rows_refuses_another_interval(tmp_path, scenario, interval, expected):
    """Windows would last 20 s, contact times twice as long, averages of 16 samples 80 ms."""
    path = tmp_path / "copy.yaml"
    path.write_text(f"extends: {scenario}\nrecord: {{every: {interval}}}\n")
    problems = lint(path)[1]
    assert problems
    assert all(f"expects rows every {expected}, and the record has one every {interval}." in line for line in problems)


ROWS = """
start_time: 5 s
stop_time: 6 s
members: {heart: {component: heart}}
record: {every: 5 ms, variables: [heart.position]}
analyses: {windows: {function: "fmus.wall_tracking.windows:analysis", inputs: {force: heart.position}}}
"""


@pytest.mark.parametrize(
    ("keys", "time"),
    [("", "5 s"), ("start_time: 0 s", ""), ("start_time: 0 s\nanalyses: {windows: {from: 1 s}}", "1 s")],
)
def test_an_analysis_that_counts_from_zero_refuses_another_first_row(tmp_path, keys, time):
    """The window from 12 s would begin at 17 s."""
    (tmp_path / "base.yaml").write_text(ROWS)
    path = tmp_path / "mine.yaml"
    path.write_text(f"extends: base.yaml\n{keys}\n")
    problems = lint(path)[1]
    assert len(problems) == bool(time)
    assert all(f"expects its first row at 0 s, and gets it at {time}. Change start_time" in line for line in problems)


def test_the_paper_s_estimate_is_refused_for_a_minute():
    with pytest.raises(ScenarioError, match="use heart_wall_force"):
        load_scenario("heart_wall_replay", ["stop_time=60 s"])
