"""Compensated tracking of the heart through a drive at 5 ms, in csp and csv: the tip follows as without a bus."""

from pathlib import Path

import pytest

from hw_bridge.bridge import load
from tests.matrix import some
from twin.run import RunOptions, run_scenario
from twin.scenario import parse_scenario

ROOT = Path(__file__).parents[3]
BENCHES = ROOT / "hw_bridge" / "benches"
# the identification's last variant, some beats of it instead of twenty
SCENARIO = """extends: hysteresis_identification.yaml
stop_time: 3.025 s
metrics: {tracking_error_std: {from: 1.025 s}, tracking_error_max: {from: 1.025 s}}
"""


@pytest.fixture(scope="module")
def error(tmp_path_factory, build):
    """Standard deviation of tip minus heart [mm], with drives of this file, or without any."""

    def error(text=""):
        folder = tmp_path_factory.mktemp("follow")
        hardware = None
        if text:
            path = folder / "bench.yaml"
            path.write_text(text)
            hardware = load(path, build=build)
        outcome = run_scenario(
            parse_scenario(SCENARIO, ROOT / "scenarios/few_beats.yaml"),
            RunOptions(root=folder, build=build, report=False, variants=["compensated"], seeds=[1]),
            hardware=hardware,
        )
        assert outcome.run.status == "completed", outcome.run.reason
        return next(one.mean for one in outcome.evaluation.metric_results if one.metric.name == "tracking_error_std")

    return error


@pytest.fixture(scope="module")
def without(error):
    return error()


def bench(name):
    return (BENCHES / f"simulated_{name}.yaml").read_text()


@pytest.mark.slow
def test_interpolation_alone_costs_a_fifth(error, without):
    assert error(bench("hysteresis").replace("follow: {feedforward: 0.3}", "")) > 1.15 * without


@pytest.mark.slow
@pytest.mark.parametrize("name", some(["hysteresis", "hysteresis_csv", "hysteresis_epos4"], ["hysteresis_csv"]))
def test_the_tip_follows_as_without_a_bus(error, without, name):
    assert error(bench(name)) == pytest.approx(without, rel=0.04)


@pytest.mark.slow
def test_all_of_the_speed_leaves_half_of_the_error(error, without):
    assert error(bench("hysteresis").replace("0.3}", "1}")) < 0.6 * without
