"""Digital outputs: they follow signals of the scenario, and are safe before the start and after every stop."""

import struct
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from hw_bridge.bridge.entry import load
from hw_bridge.bus import Disturbance, Frame, Kind
from hw_bridge.hardware import file as hardware
from hw_bridge.profiles import profile
from hw_bridge.session import Session
from hw_bridge.trace import Decoder, TracedNode
from tests.hw_bridge.axis import Rig, node
from twin.errors import ScenarioError, SimulationError
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario, parse_scenario

ROOT = Path(__file__).parents[3]
BENCH = ROOT / "hw_bridge/benches/simulated_racs.yaml"
SHORT = """extends: racs.yaml
stop_time: 2 s
members: {command: {parameters: {speed: 40 mm/s, begin: 0.3 s}}}  # the other gripper takes over at 1.44 s
record: {every: 1 ms, variables: ["sequencer.valve"]}
expect: []
plots: []
"""
GOOD = """simulated: true
nodes:
  servomotor_1: {node: 1, profile: faulhaber_v3, safe_outputs: 1, outputs: {0: "sequencer.valve[1]"}}
"""
GRIPPERS = ("servomotor_1", "servomotor_2")


@pytest.fixture
def switching(build):
    """An axis with three bits of its own among others that rest."""
    bits = {0: "a.b", 3: "a.c", 31: "a.d"}
    return Rig(build, {"servomotor": node(outputs=bits, safe_outputs=0b0110)})


def outputs(rig):
    return rig.drive.outputs


def test_bits_follow_signals(switching):
    """Bits that have no signal stay as they are safe."""
    switching.go(10)
    assert outputs(switching) == 0b0110
    switching.set(output_0=True, output_31=True)
    switching.go(5)
    assert outputs(switching) == 1 << 31 | 0b0111
    switching.set(output_0=False, output_3=True)
    switching.go(5)
    assert outputs(switching) == 1 << 31 | 0b1110


@pytest.mark.parametrize(("vendor", "bit_rate"), [("faulhaber_v3", 1_000_000), ("epos4", 250_000)])
def test_delay(build, vendor, bit_rate):
    """They act at SYNC, without the drive's control cycle: 0.44 ms after it began at 1 Mbit/s, 1.4 ms at 250 kbit/s."""
    bits = {"outputs": {0: "a.b"}, "safe_outputs": 0}
    rig = Rig(build, {"servomotor": node(vendor, limits={"force": "10 kN"}, **bits)}, bit_rate=bit_rate)
    rig.go(50)
    acted = []
    rig.drive.dictionary.effects[0x60FE] = lambda _: acted.append((rig.drive.port.event_queue.now, outputs(rig)))
    given = rig.session.origin + rig.t * 1_000_000
    rig.set(output_0=True)
    rig.go(10)
    assert [level for _, level in acted] == [1, 1]
    delay = (acted[0][0] - given) / 1e6
    print(f"{vendor} at {bit_rate}: {delay:.3f} ms")
    assert 0.2 < delay < (0.7 if bit_rate == 1_000_000 else 1.5)


def test_a_mask_that_hides_them_is_opened(build):
    """Only bits with a signal are unmasked, and not before they are safe."""
    rig = Rig(build, {"servomotor": node(outputs={1: "a.b"}, safe_outputs=0)})
    begin, seen = Session.network, []

    def masked(self):
        made, drive = begin(self), self.bench.plants["servomotor"].drive
        self.bench.bus.advance(200_000_000)
        drive.dictionary.put(0x60FE, 2, 2)
        drive.dictionary.put(0x60FE, 0xFF, 1)
        drive.dictionary.effects[0x60FE] = lambda _: seen.append(drive.outputs)
        return made

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Session, "network", masked)
        rig.set(output_1=True)
        rig.go(10)
    assert not any(seen[:2])
    assert rig.drive.dictionary.get(0x60FE, 2) == 2
    assert outputs(rig) == 2


def test_without_a_signal_nothing_is_mapped(build):
    rig = Rig(build, {"servomotor": node(safe_outputs=5)})
    rig.go(5)
    assert rig.drive.dictionary.get(0x1600) == 1


def interrupted(*_):
    raise KeyboardInterrupt


STOPS = {
    "end": (lambda rig: rig.axis.close(), None),
    "ctrl-c": (lambda rig: setattr(rig.master, "check", interrupted), KeyboardInterrupt),
    "emergency": (lambda rig: rig.drive.inject(0x7300), SimulationError),
    "exception": (lambda rig: setattr(rig.session.orders, "set_targets", interrupted), KeyboardInterrupt),
    "no sync": (
        lambda rig: rig.session.bench.bus.disturbances.append(Disturbance(Kind.DROP, 0x80, 0x80)),
        SimulationError,
    ),
    "no pdo": (lambda rig: rig.session.bench.bus.disturbances.append(Disturbance(Kind.DROP, 0x201, 0x201)), None),
}


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("cause", STOPS)
def test_safe_after_every_stop(switching, cause):
    switching.set(output_0=True, output_3=True, target_velocity=0.05)
    switching.go(100)
    assert outputs(switching) == 0b1111
    event, error = STOPS[cause]
    event(switching)
    if error is None:
        switching.axis.close()
    else:
        with pytest.raises(error):
            switching.go(100)
    assert outputs(switching) == 0b0110


@pytest.mark.slow
def test_grippers_hold_until_the_drive_stands(switching):
    """At a stop a gripper that holds does not let go while its carriage moves."""
    switching.set(output_0=True, target_velocity=0.1)
    switching.go(300)
    fast = []
    switching.drive.dictionary.effects[0x60FE] = lambda _: fast.append(
        (outputs(switching), switching.drive.axis.velocity)
    )
    switching.axis.close()
    assert abs(fast[0][1]) > 0.05
    changes = [speed for (old, _), (new, speed) in pairwise(fast) if old != new]
    assert len(changes) == 1
    assert abs(changes[0]) < 0.01


def test_they_stay_while_the_drive_retracts(build):
    contact = {"signal": "sensor.measured_force", "distance": "10 mm", "speed": "50 mm/s"}
    rig = Rig(build, {"servomotor": node(contact=contact, outputs={0: "a.b"}, safe_outputs=0)})
    rig.set(contact_force=0.1, output_0=True)
    rig.go(20)
    rig.set(contact_force=0.6, output_0=False)
    rig.go(50)
    assert outputs(rig) == 1
    with pytest.raises(SimulationError, match=r"Retracted 10\.\d\d mm"):
        rig.go(1000)
    assert outputs(rig) == 0


# ------------------------------------------------------------------------------------------------------ hardware file


@pytest.fixture
def write(tmp_path):
    def write(old="", new=""):
        path = tmp_path / "bench.yaml"
        path.write_text(GOOD.replace(old, new, 1))
        return path

    return write


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "faulhaber_v3",
            "mclm",
            "bench.yaml:3: nodes.servomotor_1.outputs: FAULHABER MCLM 300x CO has no digital outputs",
        ),
        (
            "safe_outputs: 1, ",
            "",
            "bench.yaml:3: nodes.servomotor_1.outputs: what are they after a stop? Add `safe_outputs`",
        ),
        ("{0: ", "{32: ", "bench.yaml:3: nodes.servomotor_1.outputs: expected a bit from 0 to 31, not 32"),
        ('{0: "sequencer.valve[1]"}', "valve", "nodes.servomotor_1.outputs: expected bits such as {0: "),
        ("outputs: {0", "output: {0", "nodes.servomotor_1.output: unknown key. Did you mean 'outputs'?"),
        ('"sequencer.valve[1]"', "5", "nodes.servomotor_1.outputs: expected"),
    ],
)
def test_mistakes_are_named_with_their_line(write, old, new, message):
    with pytest.raises(ScenarioError) as caught:
        hardware.load(write(old, new))
    (line,) = caught.value.problems
    assert message in line
    assert "\n" not in line


@pytest.mark.parametrize(
    ("signal", "message"),
    [
        ("sequenzer.valve[1]", "no member 'sequenzer'. Did you mean 'sequencer'?"),
        ("sequencer.valves[1]", "sequencer has no variable 'valves[1]'. Did you mean"),
        ("sequencer.valve[3]", "valve has shape [2], elements count from 1."),
        ("sequencer.valve", "sequencer.valve is 2 values, an output needs one Boolean."),
        ("sequencer.gripper_target_velocity[1]", "is Float64, an output needs one Boolean."),
        ("cylinder_1.valve", "cylinder_1.valve is an input. Name an output."),
    ],
)
def test_signals_that_cannot_switch_are_refused_when_the_file_is_applied(write, signal, message):
    path = write("sequencer.valve[1]", signal)
    with pytest.raises(ScenarioError) as caught:
        load(path).apply(load_scenario(ROOT / "scenarios/racs.yaml"))
    (line,) = caught.value.problems
    assert line.startswith(f"{path}: nodes.servomotor_1.outputs.0: ")
    assert message in line
    assert "\n" not in line


def test_the_bus_load_counts_them(write):
    with_outputs = hardware.load(write())
    without = with_outputs.model_copy(
        update={"nodes": {"x": with_outputs.nodes["servomotor_1"].model_copy(update={"outputs": {}})}}
    )
    assert hardware.bus_load(with_outputs) - hardware.bus_load(without) == pytest.approx(32 / 5000, rel=0.3)


# -------------------------------------------------------------------------------------------------------- the whole rig


def rig_run(tmp_path, build, at, event):
    """A short run of the rig; `event(session)` happens at a step [ms]. The outcome and both drives' outputs at each."""
    seen = []
    advance = Session.advance

    def watched(self, t, h):
        if round(t / 1e6) == at:
            event(self)
        advance(self, t, h)
        seen.append([self.bench.plants[name].drive.outputs for name in GRIPPERS])

    found = load(BENCH, build=build)
    scenario = parse_scenario(SHORT, ROOT / "scenarios/short_racs.yaml")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Session, "advance", watched)
        outcome = run_scenario(scenario, RunOptions(root=tmp_path, build=build, report=False), hardware=found)
    (session,) = found.sessions
    return outcome, np.array(seen), [session.bench.plants[name].drive.outputs for name in GRIPPERS]


def nothing(_session):
    pass


def raised(_session):
    raise RuntimeError("a member failed")


def encoder_failed(session):
    session.bench.plants["servomotor_2"].drive.inject(0x7300)


@pytest.mark.slow
def test_outputs_of_the_drives_follow_the_sequencer(tmp_path, build):
    """Within a cycle and the bus's delay, at every switching of both valves; at the end both grippers hold."""
    outcome, seen, last = rig_run(tmp_path, build, 0, nothing)
    assert outcome.run.status == "completed", outcome.run.reason
    (table,) = outcome.tables.values()
    for number in (0, 1):
        valve = table.values["sequencer.valve"][1:, number].astype(int)
        switched = np.flatnonzero(np.diff(valve)) + 1
        answered = np.flatnonzero(np.diff(seen[:, number])) + 1
        print(f"valve {number + 1}: {switched} -> {answered} ms")
        assert len(answered) == len(switched) >= 1
        assert np.all((answered - switched >= 0) & (answered - switched <= 6))
        assert np.array_equal(seen[answered, number], valve[switched])
    assert last == [1, 1]


@pytest.mark.slow
@pytest.mark.parametrize("event", [raised, encoder_failed])
def test_both_grippers_hold_after_a_failure(tmp_path, build, event):
    """While one of them is open in a regrip."""
    outcome, seen, last = rig_run(tmp_path, build, 1300, event)
    assert outcome.run.status == "failed"
    assert sorted(seen[-1]) == [0, 1]
    assert last == [1, 1]


# ------------------------------------------------------------------------------------------ traces, replay and shadow


def test_a_trace_names_them_without_its_beginning():
    keys = hardware.NodeKeys.model_validate(node(outputs={0: "a.b"}, safe_outputs=0))
    decoder = Decoder([TracedNode(1, profile("faulhaber_v3"), keys, "axis")])
    line = decoder.decode(0, Frame(0x201, struct.pack("<iI", 1000, 3)))
    assert line.values["target_position"] == pytest.approx(1e-3)
    assert line.values["digital_outputs_physical_outputs"] == 3


@pytest.mark.slow
def test_a_run_with_outputs_is_recorded_shadowed_and_replayed(tmp_path, build):
    """The inputs that switch are there in a replay too; the shadow hears the target beside the outputs."""
    path, trace = tmp_path / "bench.yaml", tmp_path / "run.log"
    path.write_text(GOOD.replace("node: 1, ", "node: 1, shadow: {}, limits: {position: [-39 mm, 39 mm]}, "))
    text = SHORT.replace("stop_time: 2 s", "stop_time: 0.5 s").replace(
        "sequencer.valve", "servomotor_1.position_actual_value"
    )
    tables = []
    for more in ({"trace": trace}, {"replay": str(trace)}):
        found = load(path, build=build, **more)
        scenario = parse_scenario(text, ROOT / "scenarios/short_racs.yaml")
        outcome = run_scenario(scenario, RunOptions(root=tmp_path, build=build, report=False), hardware=found)
        assert outcome.run.status == "completed", outcome.run.reason
        (table,) = outcome.tables.values()
        tables.append(table.values["servomotor_1.position_actual_value"])
        if "trace" in more:
            assert found.sessions[0].observers["servomotor_1"].warnings == []
    assert np.allclose(*tables, atol=1e-5)
    assert np.ptp(tables[0]) > 1e-4
