"""Faults among the events of a scenario: checked by the hardware, in their variant only, and judged by how the run ends."""

import re
from functools import cache
from pathlib import Path

import pytest

from hw_bridge.bridge.entry import load
from hw_bridge.fault import Cause
from twin.errors import ScenarioError, SimulationError
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, load_scenario, parse_scenario

ROOT = Path(__file__).parents[3]
SCENARIO = ROOT / "scenarios/drive_faults.yaml"
BENCH = ROOT / "hw_bridge/benches/simulated_force.yaml"
WIRE = ROOT / "hw_bridge/benches/multicast_force.yaml"
SHORT = """extends: drive_faults.yaml
stop_time: 0.4 s
variants: {variants}
record: [wall.force]
metrics: {{force_max: null}}
expect: {expect}
plots: []
"""


@cache
def names():
    """The variants of the scenario, which others take the place of."""
    return tuple(case.variant for case in load_scenario(SCENARIO).variants)


@pytest.fixture
def run(tmp_path, build):
    """Run variants of the force experiment on the simulated bench."""

    def run(variants, expect="[]", hardware=BENCH, only=()):
        gone = dict.fromkeys(names(), "null")
        text = ", ".join(f'"{name}": {one}' for name, one in (gone | variants).items())
        scenario = parse_scenario(SHORT.format(variants=f"{{{text}}}", expect=expect), SCENARIO.with_name("short.yaml"))
        found = load(hardware, build=build) if hardware is not None else None
        outcome = run_scenario(
            scenario,
            RunOptions(backend=Backend.compiled, root=tmp_path, build=build, report=False, variants=only),
            hardware=found,
        )
        return outcome, found

    return run


def event(**keys):
    text = ", ".join(f"{key}: {one}" for key, one in {"at": "0.2 s", "node": "servomotor", **keys}.items())
    return f"{{events: [{{{text}}}]}}"


def early():
    """The scenario with its faults at 0.5 s, but a lost loop, which shows when the gripper moves; without its plots."""
    text = SCENARIO.read_text().partition("\nplots:")[0] + "\nplots: []\n"
    text = re.sub(r"(at|from): 7 s(?!, fault: slow)", r"\1: 0.5 s", text).replace("to: 7.1 s", "to: 0.6 s")
    text = text.replace("stop_time: 8 s", "stop_time: 2 s").replace("  slow:", "  slow:\n    stop_time: 8 s")
    return parse_scenario(text.replace('["*.*"]', "[wall.force, sensor.measured_force]"), SCENARIO)


@pytest.mark.slow
def test_every_cause_ends_at_rest(tmp_path, build):
    """The scenario that shows them all: what is noticed stops the run, everything at rest, and is told."""
    scenario = early()
    shown = {fault.text.partition(",")[0] for case in scenario.variants for fault in case.faults}
    assert shown == set(Cause)
    hardware = load(BENCH, build=build)
    outcome = run_scenario(
        scenario, RunOptions(backend=Backend.compiled, root=tmp_path, build=build), hardware=hardware
    )
    assert outcome.passed, [one.detail for one in outcome.evaluation.expectation_results]
    page = (outcome.folder / "report.html").read_text()
    for case in scenario.variants:
        ending = outcome.terminations[case.variant, 1]
        assert not ending.unsafe
        for fault in case.faults:
            name = fault.text.partition(",")[0]
            assert any(f"FAULT {name} of " in line for line in ending.log)
            assert any("STOP" in line for line in ending.log) == (name != Cause.GRIP)
        assert len(ending.log) > 2
        assert ending.log[0].partition(" s: ")[2].split()[0] in page
    assert "8611h following error" in page
    (silent,) = (one for one in outcome.summary["cases"] if one["variant"] == "heartbeat")
    assert 0.5 < silent["stopped"] <= 0.565  # lost_after, 60 ms, and the cycle in which it is seen
    assert "no heartbeat" in silent["reason"]


OTHERS = {
    "mclm": "profile: mclm",
    "epos4": "profile: epos4, scale: 0.002, limits: {force: 300 N}",
}  # a screw, and its motor's rig


@pytest.mark.slow
@pytest.mark.parametrize("vendor", ["faulhaber_v3", *OTHERS])
def test_every_cause_ends_at_rest_on_each_drive(tmp_path, build, vendor):
    """The scenario as it is: all faults while the gripper moves with the heart."""
    bench = BENCH
    if vendor in OTHERS:
        bench = tmp_path / "bench.yaml"
        bench.write_text(f"simulated: true\nnodes: {{servomotor: {{node: 7, {OTHERS[vendor]}}}}}\n")
    hardware = load(bench, build=build)
    outcome = run_scenario(
        load_scenario(SCENARIO),
        RunOptions(backend=Backend.compiled, root=tmp_path, build=build, report=False),
        hardware=hardware,
    )
    assert outcome.passed, [one.detail for one in outcome.evaluation.expectation_results]
    assert not [ending for ending in outcome.terminations.values() if ending.unsafe]


@pytest.mark.slow
def test_a_fault_acts_in_its_variant_only(run):
    outcome, hardware = run(
        {"a": "{}", "b": event(fault="sync"), "c": event(fault="heartbeat"), "d": "{}"},
        "[{ends: stopped, variants: [b, c], from: 0.2 s, to: 0.3 s}, {ends: completed, variants: [a, d]}]",
    )
    assert outcome.passed, [one.detail for one in outcome.evaluation.expectation_results]
    assert [len(session.faults) for session in hardware.sessions] == [0, 1, 1, 0]
    assert [len(one.time) < 81 for one in outcome.tables.values()] == [False, True, True, False]


@pytest.mark.slow
@pytest.mark.parametrize("fault", [{"fault": "sync"}, {"fault": "heartbeat", "node": "master"}])
def test_a_stop_does_not_wait_for_process_data_that_cannot_come(run, fault):
    """Without SYNC, or in Pre-operational, a drive is asked for its state by SDO."""
    outcome, _ = run({"a": event(**fault)}, "[{ends: stopped}]")
    log = outcome.terminations["a", 1].log
    stop, end = (next(float(line.split()[0]) for line in log if word in line) for word in ("STOP", "enter pre-op"))
    assert end - stop < 0.4


@pytest.mark.slow
def test_a_stop_that_nobody_expects_ends_the_run(run):
    outcome, _ = run({"a": event(fault="sync"), "b": "{}"}, "[{ends: completed, variants: [b]}]")
    assert outcome.run.status == "failed"
    assert "no process data" in outcome.run.reason
    assert ("b", 1) not in outcome.tables


@pytest.mark.slow
def test_a_run_that_was_to_be_stopped_and_is_not_fails(run):
    outcome, _ = run({"a": "{}"}, "[{ends: stopped}]")
    (one,) = outcome.evaluation.expectation_results
    assert (outcome.run.status, one.verdict) == ("completed", "fail")
    assert one.detail == "a, seed 1 ran to its end. Expected a stop, everything at rest."


@pytest.mark.slow
def test_a_stop_outside_its_time_fails(run):
    outcome, _ = run({"a": event(fault="heartbeat")}, "[{ends: stopped, to: 0.21 s}]")
    (one,) = outcome.evaluation.expectation_results
    assert "stopped at 255 ms" in one.detail
    assert one.verdict == "fail"


@pytest.mark.slow
def test_what_does_not_come_to_rest_fails(run, monkeypatch):
    """A drive that goes on when its master is gone."""
    monkeypatch.setattr("hw_bridge.device.drive.Drive.abort_connection", lambda _: None)
    monkeypatch.setattr("hw_bridge.device.drive.Drive.master_lost", lambda _: None)
    outcome, _ = run({"a": event(fault="drop", node="master")}, "[{ends: stopped}]")
    (one,) = outcome.evaluation.expectation_results
    assert one.verdict == "fail"
    assert "Not at rest: node 1: Operation enabled" in one.detail


@pytest.mark.slow
def test_a_bench_that_cannot_be_watched_afterwards_is_not_at_rest(run, monkeypatch):
    """And what ended the run stays the reason."""

    def failing(self, speed):
        raise SimulationError("motor: its step failed.")

    monkeypatch.setattr("hw_bridge.plant.plant.Plant.faults_at_rest", failing)
    outcome, _ = run({"a": event(fault="sync")})
    assert "no process data" in outcome.run.reason
    assert outcome.terminations["a", 1].unsafe == "motor: its step failed."


@pytest.mark.slow
@pytest.mark.parametrize("hardware", [None, WIRE], ids=["no hardware", "no simulated hardware"])
def test_faults_need_simulated_drives(run, hardware):
    variants = {"a": "{}", "b": event(fault="sync")}
    with pytest.raises(
        ScenarioError, match="fault `sync, node servomotor` in variant `b` happens to simulated drives"
    ) as e:
        run(variants, hardware=hardware)
    assert len(e.value.problems) == 1
    if hardware is None:
        assert run(variants, hardware=None, only=["a"])[0].passed


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"fault": "heartbeat", "cuont": 3}, "cuont: unknown key. Did you mean 'count'?"),
        ({"fault": "heartbeet"}, "fault: `heartbeet` is no fault. Did you mean 'heartbeat'?"),
        ({"fault": "emcy", "code": "1234h"}, "FAULHABER Motion Control V3.0 has no error 1234h"),
        ({"fault": "reset", "node": "moter"}, "no node 'moter'"),
        ({"fault": "reset", "node": "master"}, "reset is a fault of a drive. Name a drive."),
        ({"fault": "drop", "duration": "5 N"}, "duration: "),
    ],
)
def test_mistakes_are_those_of_a_hardware_file(run, keys, text):
    with pytest.raises(ScenarioError) as caught:
        run({"a": event(**keys)})
    (line,) = caught.value.problems
    assert line.startswith(str(SCENARIO.with_name("short.yaml")))
    assert text in line


@pytest.mark.slow
def test_a_fault_leaves_with_its_member():
    text = """extends: heart_wall_force.yaml
events: [{at: 1 s, fault: sync, node: servomotor}, {at: 1 s, fault: drop, node: master}]
variants: {no servo: {members: {servomotor: null}}}
"""
    scenario = parse_scenario(text, SCENARIO.with_name("short.yaml"))
    faults = {case.variant: [fault.text for fault in case.faults] for case in scenario.variants}
    assert faults["PI"] == ["sync, node servomotor", "drop, node master"]
    assert faults["no servo"] == ["drop, node master"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("at: 1 s", "at: 30 s", "short.yaml:2: fault at 30 s is outside the run, 0 s to 22 s."),
        ("node: master", "set: {heart.rate: 1}", "short.yaml:2: events[1]: `fault` and `set` in one event. Make two"),
        ("ends: stopped", "ends: stopped, at_most: 3", "short.yaml:3: expect: `ends` has no at_most."),
        ("ends: stopped", "ends: completed, from: 1 s", "short.yaml:3: expect: a run is completed at stop_time."),
        (
            "ends: stopped",
            "signal: wall.force, ends: stopped",
            "short.yaml:3: expect: give either `metric` or `signal`,",
        ),
    ],
)
def test_what_the_scenario_itself_checks(old, new, text):
    good = """extends: heart_wall_force.yaml
events: [{at: 1 s, fault: sync, node: master}]
expect: [{ends: stopped}]
"""
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(good.replace(old, new), SCENARIO.with_name("short.yaml"))
    (line,) = caught.value.problems
    assert text in line
