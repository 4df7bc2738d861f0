"""Controllers that learn the beat, on a simulated drive behind a CAN bus at 5 ms: the same verdicts, and lost SYNC."""

from pathlib import Path

import pytest

from hw_bridge.bridge.entry import load
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario, parse_scenario

ROOT = Path(__file__).parents[3]
SCENARIO = ROOT / "scenarios/beyond_paper.yaml"
BENCH = (ROOT / "hw_bridge/benches/simulated_force.yaml").read_text()
LOST = "\nfaults: [{at: AT, fault: sync, node: master, count: COUNT}]\n"
SEED = 2001
SHORT = """title: The controller behind a bus that loses SYNC
stop_time: 0.7 s
seeds: [1]
members:
  heart:      {component: heart}
  controller: {component: phase_locked_control}
  servomotor: {component: servomotor}
  sheath:     {component: sheath}
  wall:       {component: wall}
  sensor:     {component: force_sensor}
connections:
  - heart.position -> wall.heart_position
  - sensor.measured_force -> controller.force
  - controller.target_velocity -> servomotor.target_velocity
  - servomotor.position -> sheath.gripper_position
  - sheath.reaction_force -> servomotor.load_force
  - sheath.tip_position -> wall.tip_position
  - {from: wall.force, to: [sheath.contact_force, sensor.force]}
"""


@pytest.fixture
def run(tmp_path, build):
    """Run a scenario with the text of a hardware file, or without hardware."""

    def run(scenario, text="", **only):
        path = tmp_path / "bench.yaml"
        path.write_text(text)
        hardware = load(path, build=build) if text else None
        return run_scenario(scenario, RunOptions(root=tmp_path, build=build, report=False, **only), hardware=hardware)

    return run


def without_sync(at, count):
    return BENCH + LOST.replace("AT", at).replace("COUNT", str(count))


def verdicts(outcome):
    return {one.name: one.verdict for one in outcome.evaluation.expectation_results}


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["locked", "ectopic", "observer"])
def test_the_same_verdicts(run, variant):
    only = {"variants": [variant], "seeds": [SEED]}
    with_bus = run(load_scenario(SCENARIO), BENCH, **only)
    assert verdicts(with_bus) == verdicts(run(load_scenario(SCENARIO), **only))
    assert with_bus.passed


@pytest.mark.slow
def test_the_same_verdicts_where_four_syncs_are_lost(run):
    only = {"variants": ["locked"], "seeds": [SEED]}
    outcome = run(load_scenario(SCENARIO), without_sync("15 s", 4), **only)
    assert verdicts(outcome) == verdicts(run(load_scenario(SCENARIO), **only))
    assert outcome.passed


@pytest.mark.slow
def test_four_syncs_may_be_lost(run):
    outcome = run(parse_scenario(SHORT, ROOT / "scenarios/short.yaml"), without_sync("0.5 s", 4))
    assert outcome.run.status == "completed", outcome.run.reason


@pytest.mark.slow
def test_more_lost_syncs_end_the_run_with_the_drive_at_rest(run):
    outcome = run(parse_scenario(SHORT, ROOT / "scenarios/short.yaml"), without_sync("0.5 s", 20))
    assert outcome.run.status == "failed"
    assert "no process data for 5 cycles. Check the bus. All drives stop." in outcome.run.reason
