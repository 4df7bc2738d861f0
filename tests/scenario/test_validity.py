"""A scenario says until when it is valid, metrics judge every span of a length, and verdicts about the patient judge the true force."""

import numpy as np
import pytest

from twin.errors import ScenarioError
from twin.results import Metric, Signals, evaluate
from twin.results.expression import parse
from twin.run import run_scenario
from twin.scenario import Form, load_scenario, parse_scenario

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


def test_the_force_experiment_refuses_a_minute():
    with pytest.raises(ScenarioError, match="For longer runs take heart_wall_ten_minutes"):
        load_scenario("heart_wall_force", ["stop_time=60 s"])


@pytest.mark.parametrize(
    ("reduce", "expected"), [("max", 9.0), ("min", -3.0), ("std", 6.0), ("mean", 3.0), ("peak_to_peak", 12.0)]
)
def test_the_worst_span_counts(reduce, expected):
    """Zero, but from 40 s to 50 s a square wave between -3 and 9."""
    time = np.arange(0.0, 100.0, 0.1)
    y = np.where((time >= 40.0) & (time < 50.0), 3.0 + 6.0 * np.where(np.round(time * 10) % 2, 1.0, -1.0), 0.0)
    signals = {("base", 1): Signals(time, {"a.y": y}, {"a.y": ""})}
    metric = Metric("m", parse("a.y"), reduce, sliding=10.0)
    (figure,) = evaluate({"m": metric}, [], signals).figures
    assert figure.values[1] == pytest.approx(expected, rel=1e-2)
    (short,) = evaluate({"m": Metric("m", parse("a.y"), reduce, sliding=200.0)}, [], signals).figures
    assert short.values[1] is None


def test_a_zero_that_is_off_fails_the_clinical_range(tmp_path, build):
    """The sensor says what it should: only the true force shows that 0.15 N too much press on the wall."""
    text = (
        "extends: heart_wall_force.yaml\n"
        "connections: [{from: null, to: sensor.force}, {from: wall.force, to: sensor.force, offset: -0.15}]\n"
    )
    scenario = parse_scenario(text, load_scenario("heart_wall_force").path.with_name("off.yaml"))
    outcome = run_scenario(
        scenario, Form.compiled, variants=["PI"], seeds=[1], root=tmp_path, build=build, report=False
    )
    verdicts = {one.name: one for one in outcome.evaluation.outcomes}
    assert verdicts["clinical range"].verdict == "fail"
    assert "wall.force" in verdicts["clinical range"].detail
    measured = outcome.tables["PI", 1].values["sensor.measured_force"][2400:]
    assert 0.1 < measured.min() < measured.max() < 0.4
