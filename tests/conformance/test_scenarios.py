"""Every scenario runs, as FMUs, and what it expects holds; the forms give the same bits."""

from pathlib import Path

import numpy as np
import pytest

from twin.members import Form
from twin.run import run_scenario
from twin.scenario import Scenario

ROOT = Path(__file__).parent.parent.parent
SCENARIOS = sorted((ROOT / "scenarios").glob("*.yaml"))


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_scenario(path, build, tmp_path):
    outcome = run_scenario(Scenario.load(path), root=tmp_path, build=build, report=False)
    assert outcome.run.status == "completed", outcome.run.reason
    failed = [one.name for one in outcome.evaluation.outcomes if one.verdict == "fail"]
    failed += [f"{one.metric.name} of {one.variant}" for one in outcome.evaluation.figures if one.verdict == "fail"]
    assert not failed
    assert outcome.passed


@pytest.mark.parametrize(
    "overrides",
    [["heart.rate=0.8 Hz"], ["heart.rate=1.6 Hz"], ["heart.scale=0.7"], ["heart.scale=1.2"], ["controller.setpoint=0.3 N"]],
    ids=str,
)
def test_the_order_of_the_controllers_holds_elsewhere_too(overrides, build, tmp_path):
    scenario = Scenario.load(ROOT / "scenarios/heart_wall_force.yaml", [*overrides, "seeds=[1]"])
    outcome = run_scenario(scenario, root=tmp_path, build=build, report=False)
    assert outcome.run.status == "completed", outcome.run.reason
    verdicts = {one.name: one.verdict for one in outcome.evaluation.outcomes}
    assert verdicts["order of the controllers"] == "pass"
    assert {one.verdict for one in outcome.evaluation.figures} <= {"other", "info"}


def test_forms_agree_to_the_bit(build, tmp_path):
    recorded = {}
    for form in Form:
        scenario = Scenario.load(ROOT / "tests/conformance/short_force.yaml")
        outcome = run_scenario(scenario, form, root=tmp_path / form, build=build, report=False)
        assert outcome.run.status == "completed", outcome.run.reason
        recorded[form] = {
            f"{variant} {name}": values
            for (variant, _), table in outcome.tables.items()
            for name, values in table.values.items()
            if "stream" not in name
        }
    names = set.intersection(*(set(values) for values in recorded.values()))
    assert len(names) > 40
    for name in sorted(names):
        for form in (Form.compiled, Form.interpreted):
            assert np.asarray(recorded[form][name]).tobytes() == np.asarray(recorded[Form.fmu][name]).tobytes(), name
