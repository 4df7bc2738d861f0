"""What a scenario says of a patient is said of the true contact force: a sensor that is wrong must not hide it."""

from pathlib import Path

import pytest
import yaml

from twin.run import run_scenario
from twin.scenario import load_scenario

SCENARIOS = Path(__file__).parents[2] / "scenarios"


@pytest.mark.parametrize("path", sorted(SCENARIOS.rglob("*.yaml")), ids=lambda path: path.stem)
def test_no_expectation_limits_the_measured_force(path):
    """Published figures, which are metrics, stay with the measured force, as the paper measured."""
    expect = (yaml.safe_load(path.read_text()) or {}).get("expect") or []
    limits = [entry["name"] for entry in expect if "measured_force" in str(entry.get("signal"))]
    assert not limits, f"{limits}: judge the true force, such as wall.force"


@pytest.mark.parametrize(("zero", "holds"), [("0 mN", True), ("-150 mN", False), ("150 mN", False)])
def test_clinical_range_fails_if_the_zero_is_off(zero, holds, build, tmp_path):
    """A zero off by -150 mN makes the controller hold 0.35 N and show 0.2 N."""
    scenario = load_scenario(SCENARIOS / "heart_wall_force.yaml", (f'sensor.zero_offset="{zero}"', "seeds=[1]"))
    outcome = run_scenario(scenario, variants=("PI",), root=tmp_path, build=build, report=False)
    (verdict,) = [one for one in outcome.evaluation.outcomes if one.name == "clinical range"]
    assert (verdict.verdict == "pass") == holds, verdict
