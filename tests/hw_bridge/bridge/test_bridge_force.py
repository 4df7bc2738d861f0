"""Scenarios on a bus in simulated time: the same verdicts as without it, and what the bus changes."""

import re
from pathlib import Path

import numpy as np
import pytest

from hw_bridge.bridge.entry import load
from tests.hw_bridge.axis import Rig, node
from twin.component import catalog
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario, parse_scenario

ROOT = Path(__file__).parents[3]
SCENARIO = ROOT / "scenarios/heart_wall_replay.yaml"
BENCH = ROOT / "hw_bridge/benches/simulated_force.yaml"


@pytest.fixture(scope="module")
def outcome(tmp_path_factory, build):
    """Run the scenario with the hardware file's text changed, or without hardware."""

    def outcome(text, scenario=SCENARIO, options=(), **more):
        tmp_path = tmp_path_factory.mktemp("outcome")
        path = tmp_path / "bench.yaml"
        path.write_text(text)
        hardware = load(path, build=build) if text else None
        return run_scenario(
            load_scenario(scenario, options),
            RunOptions(root=tmp_path, build=build, report=False, **more),
            hardware=hardware,
        )

    return outcome


def figures(outcome, metric):
    return {one.variant: one.mean for one in outcome.evaluation.metric_results if one.metric.name == metric}


def verdicts(outcome):
    found = {(one.metric.name, one.variant): one.verdict for one in outcome.evaluation.metric_results}
    return found | {one.name: one.verdict for one in outcome.evaluation.expectation_results}


@pytest.mark.slow
def test_the_bus_changes_little(outcome):
    """PI waits for the sensor anyway; what is fed forward comes up to 1.6 ms later."""
    without = figures(outcome("", seeds=[1]), "force_error_std")
    with_bus = figures(outcome(BENCH.read_text(), seeds=[1]), "force_error_std")
    ratios = {name: with_bus[name] / without[name] for name in without}
    assert ratios["PI"] == pytest.approx(1.0, abs=0.002)
    assert 1.0 < ratios["PI+FF"] < 1.03
    assert 1.0 < ratios["PI+FF+BW"] < 1.06


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["faulhaber_v3", "mclm"])
def test_the_same_verdicts(outcome, profile):
    without, with_bus = outcome(""), outcome(BENCH.read_text().replace("faulhaber_v3", profile))
    assert verdicts(with_bus) == verdicts(without)
    assert with_bus.passed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "bench"),
    [
        ("regripping", "regripping"),
        ("racs", "racs"),
        ("hysteresis_identification", "hysteresis"),
        ("hysteresis_identification", "hysteresis_csv"),
        ("hysteresis_identification", "hysteresis_epos4"),
    ],
)
def test_the_same_verdicts_of_others(outcome, name, bench):
    """Two carriages; with racs the rotation too, on an EPOS4 behind its gear; positions instead of speeds."""
    scenario = ROOT / f"scenarios/{name}.yaml"
    bench = (BENCH.with_name(f"simulated_{bench}.yaml")).read_text()
    without, with_bus = outcome("", scenario, seeds=[1]), outcome(bench, scenario, seeds=[1])
    assert verdicts(with_bus) == verdicts(without)
    assert with_bus.passed


@pytest.mark.slow
def test_a_gear_between_drive_and_member(build):
    """The EPOS4 turns the rotation's frame: 5 turns of its motor are one."""
    hardware = load(BENCH.with_name("simulated_racs.yaml"), build=build)
    axis = hardware._component("rotation", catalog.component("rotary_drive"))()
    hardware.present.axes = {"rotation": axis}
    hardware.keys.nodes = {"rotation": hardware.keys.nodes["rotation"]}
    axis.start()
    axis.views["mode_of_operation"][...] = 9
    axis.views["target_velocity"][...] = 2.0
    for step in range(1000):
        axis.advance(step / 1000, 1e-3)
    assert float(axis.views["angle"]) == pytest.approx(2.0, rel=0.05)
    assert float(axis.views["motor_angle"]) == pytest.approx(10.0, rel=0.05)
    assert float(axis.views["position_actual_value"]) == pytest.approx(2.0, rel=0.05)


TOUCHED = """extends: ../tests/conformance/short_force.yaml
stop_time: 3 s
events: [{at: 0.3 s, override: {sensor.measured_force: EVENT}}]
"""


@pytest.mark.slow
@pytest.mark.parametrize(("event", "reason"), [("0.5 N", "is 0.500 N, above 0.4 N"), ("0.2 N", "has not changed for")])
def test_too_much_force_or_a_dead_sensor_ends_a_run_away_from_the_wall(tmp_path, build, event, reason):
    scenario = parse_scenario(TOUCHED.replace("EVENT", event), ROOT / "scenarios/touched.yaml")
    hardware = load(BENCH, build=build)
    outcome = run_scenario(
        scenario, RunOptions(root=tmp_path, build=build, report=False, variants=["PI"], seeds=[1]), hardware=hardware
    )
    assert outcome.run.status == "failed"
    assert f"servomotor: sensor.measured_force {reason}" in outcome.run.reason
    assert re.search(r"Retracted 30\.\d\d mm\. All drives stop\.", outcome.run.reason)
    assert "\n" not in outcome.run.reason
    recorded = outcome.tables["PI", 1].values
    assert recorded["servomotor.position"][-1] < recorded["servomotor.position"][60] - 0.025
    assert recorded["wall.force"][-1] < 0.02
    (session,) = hardware.sessions
    assert not session.bench.plants["servomotor"].motor.powered


@pytest.mark.slow
def test_it_is_the_same_every_time(outcome):
    """Whatever ran before it."""
    short = {"scenario": ROOT / "tests/conformance/short_force.yaml", "options": ["stop_time=1.5 s"], "seeds": [1]}
    one, other = outcome(BENCH.read_text(), **short), outcome(BENCH.read_text(), variants=["PI+FF"], **short)
    assert one.tables["PI+FF", 1].values.keys() == other.tables["PI+FF", 1].values.keys()
    for name, values in one.tables["PI+FF", 1].values.items():
        assert np.array_equal(values, other.tables["PI+FF", 1].values[name], equal_nan=True), name


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("bit_rate", "longest"), [(1_000_000, 1.5), (250_000, 3.0)])
def test_delay_from_target_to_motor(build, bit_rate, longest):
    """Frames of targets, SYNC, then the drive's own cycle of 1 ms."""
    rig = Rig(build, {"servomotor": node()}, bit_rate=bit_rate)
    rig.go(50)
    acted = []
    follow = rig.drive.axis.follow_velocity

    def noted(velocity, *more):
        if velocity and not acted:
            acted.append(rig.drive.port.event_queue.now)
        follow(velocity, *more)

    rig.drive.axis.follow_velocity = noted
    given = rig.session.origin + rig.t * 1_000_000
    rig.set(target_velocity=0.01)
    rig.go(5)
    delay = (acted[0] - given) / 1e6
    print(f"{bit_rate}: {delay:.3f} ms, load {rig.session.bench.bus.load:.3f}")
    assert 0.3 < delay < longest
