"""The I/O module of CiA 401 as the valves of the rig: what they become when something fails, its file, its process."""

import signal
import subprocess
import sys
import threading
import time
import uuid
from pathlib import Path

import can
import numpy as np
import pytest

from benchmarks import hil
from hw_bridge import eds
from hw_bridge.bridge.entry import load
from hw_bridge.bus import MILLISECOND, Disturbance, Kind, never
from hw_bridge.command.control import Control, request
from hw_bridge.command.hil import compare_bus
from hw_bridge.device import Module
from hw_bridge.fault import Cause, Fault
from hw_bridge.hardware import file as hardware
from hw_bridge.profiles import device
from hw_bridge.session import Session
from hw_bridge.trace import Decoder
from hw_bridge.wire import Wire, WireNetwork, read
from tests.hw_bridge import program
from tests.hw_bridge.multicast import needed, own
from tests.matrix import some
from twin.errors import ScenarioError, SimulationError
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, load_scenario, parse_scenario

ROOT = Path(__file__).parents[3]
BENCHES = ROOT / "hw_bridge/benches"
NODE, MASTER = 9, 127
SHORT = """extends: racs.yaml
stop_time: 2 s
members: {command: {parameters: {speed: 40 mm/s, begin: 0.3 s}}}  # the other gripper takes over at 1.44 s
record: {every: 1 ms, variables: ["sequencer.valve", "sequencer.violation", "instrument.tip_position"]}
plots: []
"""
FORCE = """simulated: true
nodes: {servomotor: {node: 1, profile: faulhaber_v3}}
modules: {valves: {node: 9, outputs: {0: servomotor.limited, 9: servomotor.limited}, safe_outputs: 5}}
"""


def rig_run(tmp_path, build, bench, at=0, event=None):
    """A short run of the rig: its outcome, the session, and levels of both valves at each step."""
    seen = []
    advance = Session.advance

    def watched(self, t, h):
        if event is not None and round(t / 1e6) == at:
            event(self)
        advance(self, t, h)
        drives = [self.bench.plants[name].drive.outputs for name in ("servomotor_1", "servomotor_2")]
        word = self.bench.modules["valves"].outputs if self.bench.modules else drives[0] | drives[1] << 1
        seen.append([word & 1, word >> 1])

    found = load(BENCHES / bench, build=build)
    scenario = parse_scenario(
        SHORT + "expect: null\n", ROOT / "scenarios/short_racs.yaml"
    )  # its limits are of a longer run
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Session, "advance", watched)
        outcome = run_scenario(
            scenario, RunOptions(backend=Backend.compiled, root=tmp_path, build=build, report=False), hardware=found
        )
    (session,) = found.sessions
    return outcome, session, np.array(seen)


@pytest.mark.slow
def test_the_same_verdict_as_with_outputs_of_the_drives(tmp_path, build):
    """And the valves switch in the same milliseconds, within a cycle of the sequencer."""
    runs = [rig_run(tmp_path, build, name) for name in ("simulated_racs.yaml", "simulated_racs_module.yaml")]
    (at_drives, _, drives), (at_module, session, module) = runs
    verdicts = [[(one.name, one.verdict) for one in outcome.evaluation.expectation_results] for outcome, _, _ in runs]
    assert verdicts[0] == verdicts[1]
    assert at_drives.run.status == at_module.run.status == "completed"
    assert max(at_module.tables["base", 0].values["sequencer.violation"]) == 0
    for number in (0, 1):
        (table,) = at_module.tables.values()
        valve = table.values["sequencer.valve"][1:, number].astype(int)
        switched, answered = (np.flatnonzero(np.diff(one)) + 1 for one in (valve, module[:, number]))
        assert len(answered) == len(switched) >= 1
        assert np.all((answered - switched >= 0) & (answered - switched <= 6))
        assert np.array_equal(np.flatnonzero(np.diff(drives[:, number])) + 1, answered)
    assert session.bench.modules["valves"].outputs == 3
    assert session.report()["nodes"]["valves"]["lost_pdos"] == 0


def raised(_session):
    raise RuntimeError("a member failed")


def interrupted(_session):
    raise KeyboardInterrupt


def plug_pulled(session):
    """The program is gone in a moment, as by SIGKILL: nothing of it is on the bus any more."""
    session.bench.bus.detach(session.master.network.terminal)


def encoder_failed(session):
    session.bench.plants["servomotor_2"].drive.inject(0x7300)


def module_lost(session):
    session.bench.bus.disturbances.append(Disturbance(Kind.DROP, 0x709, 0x709))


@pytest.mark.slow
@pytest.mark.parametrize(
    "event", some([raised, interrupted, encoder_failed, plug_pulled, module_lost], [interrupted, module_lost])
)
def test_both_valves_are_safe_after_every_stop(tmp_path, build, event):
    """While one of them is open in a regrip."""
    outcome, session, seen = rig_run(tmp_path, build, "simulated_racs_module.yaml", 1300, event)
    assert outcome.run.status == ("interrupted" if event is interrupted else "failed")
    assert [0, 1] in seen[-200:].tolist() or [1, 0] in seen[-200:].tolist()
    session.bench.bus.advance(session.bench.bus.now + 200 * MILLISECOND)
    assert session.bench.modules["valves"].outputs == 3
    assert session.outcome.unsafe == []


@pytest.mark.slow
@pytest.mark.parametrize("bench", ["simulated_racs.yaml", "simulated_racs_module.yaml"])
def test_only_a_module_is_safe_without_a_master(tmp_path, build, bench):
    """Outputs of drives stay as they were, which the run tells; the module closes the gripper that was open."""
    text = (
        SHORT
        + "events: [{at: 1.3 s, fault: bus_off, node: master}]\nexpect: [{ends: stopped, from: 1.3 s, to: 1.4 s}]\n"
    )
    scenario = parse_scenario(text, ROOT / "scenarios/short_racs.yaml")
    outcome = run_scenario(
        scenario,
        RunOptions(backend=Backend.compiled, root=tmp_path, build=build, report=False),
        hardware=load(BENCHES / bench, build=build),
    )
    (one,) = [one for one in outcome.evaluation.expectation_results if one.name.startswith("ends with")]
    print(one.detail)
    assert one.verdict == ("pass" if "module" in bench else "fail")
    assert ("outputs 0, not 1" in one.detail) == ("module" not in bench)


@pytest.mark.slow
def test_grippers_hold_until_the_drives_stand(tmp_path, build):
    """The module's outputs become safe after the quick stop."""
    switched = []

    def event(session):
        module, drives = session.bench.modules["valves"], [plant.drive for plant in session.bench.plants.values()]
        module.dictionary.effects[0x6200] = lambda _: switched.append(
            (module.outputs, max(abs(drive.axis.velocity) for drive in drives[:2]))
        )
        session.bench.plants["servomotor_2"].drive.inject(0x7300)

    rig_run(tmp_path, build, "simulated_racs_module.yaml", 1300, event)
    first = next(speed for word, speed in switched if word == 3)
    assert first < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ("heartbeat", "valves: no heartbeat for"),
        ("reset", "valves: no process data for 5 cycles|valves: started anew"),
        ("drop", "valves: no process data for 5 cycles"),
        ("bus_off", "valves: EMCY 8140h, recovered from bus-off"),
    ],
)
def test_faults_of_a_module_stop_everything(tmp_path, build, fault, text):
    path = tmp_path / "bench.yaml"
    path.write_text(FORCE + f"faults: [{{at: 0.2 s, fault: {fault}, node: valves}}]\n")
    scenario = parse_scenario(FORCE_SHORT, ROOT / "scenarios/short.yaml")
    outcome = run_scenario(
        scenario,
        RunOptions(backend=Backend.compiled, root=tmp_path, build=build, report=False),
        hardware=load(path, build=build),
    )
    assert outcome.run.status == "failed"
    with pytest.raises(SimulationError, match=text):
        raise SimulationError(outcome.run.reason)


FORCE_SHORT = """extends: heart_wall_force.yaml
stop_time: 0.5 s
seeds: [1]
variants: {PI+FF: null, PI+FF+BW: null, "PI+FF, replayed": null, "PI+FF+BW, replayed": null}
metrics: {force_error_std: null, force_error_max: null, force_error_mean: null, estimate_error_std: null,
  true_force_mean: null, force_lateness: null, commanded_speed: null, estimated_rate: null}
expect: []
plots: []
"""


@pytest.mark.slow
def test_a_trace_names_its_outputs_and_can_be_replayed(tmp_path, build):
    path, trace = tmp_path / "bench.yaml", tmp_path / "run.log"
    path.write_text(FORCE)
    for more in ({"trace": trace}, {"replay": str(trace)}):
        outcome = run_scenario(
            parse_scenario(FORCE_SHORT, ROOT / "scenarios/short.yaml"),
            RunOptions(backend=Backend.compiled, root=tmp_path, build=build, report=False),
            hardware=load(path, build=build, **more),
        )
        assert outcome.run.status == "completed", outcome.run.reason
    decoder = Decoder.of_bench(hardware.load(path))
    said = [decoder.decode(time, frame) for time, frame, _ in read(trace) if frame is not None]
    text = {line.text for line in said if line.frame.id == 0x209}
    # neither output of the two is limited: of the safe 5 bit 2 is left
    assert "valves RPDO1: Write output 8-bit: Outputs 1 to 8 4; Write output 8-bit: Outputs 9 to 16 0" in text


def test_its_dictionary_is_an_eds_file(tmp_path):
    path = tmp_path / "cia401.eds"
    path.write_text(eds.export(device("cia401")))
    assert {(one.index, one.sub) for one in eds.load(path)} == {
        (one.index, one.sub) for one in device("cia401").objects
    }


def test_it_takes_faults_of_frames_while_it_runs():
    """Those of a motor are refused."""
    with can.Bus(uuid.uuid4().hex, interface="virtual") as bus:
        module = Module(device("cia401"), NODE)
        wire = Wire(module, bus)
        control = Control(0, module, wire)
        try:
            for fault, answer in (
                (Fault(Cause.ENCODER), "encoder is a fault of a drive"),
                (Fault(Cause.HEARTBEAT), None),
            ):
                asked = threading.Thread(target=control_asks, args=(control.port, fault, told := []))
                asked.start()
                while asked.is_alive():
                    control.look()
                    time.sleep(0.01)
                assert (answer in told[0]) if answer else told == [None]
        finally:
            control.close()
        assert [one.only for one in wire.disturbances] == [frozenset({0x700 + NODE})]


def control_asks(port, fault, told):
    try:
        told.append(request(port, fault))
    except SimulationError as error:
        told.append(str(error))


# ------------------------------------------------------------------------------------------------------ hardware file


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("node: 9, ", "node: 1, ", "bench.yaml:3: modules.valves: node 1 is `servomotor` already."),
        (", safe_outputs: 5", "", "bench.yaml:3: modules.valves.safe_outputs: is missing. Add it."),
        ("node: 9, ", "node: 9, prodct: 3, ", "modules.valves.prodct: unknown key. Did you mean 'product'?"),
        ("{0: servomotor.limited, 9: servomotor.limited}", "{}", "modules.valves.outputs: "),
        ("valves:", "servomotor:", "modules.servomotor: something else has this name."),
        (
            "node: 9, ",
            "node: 9, heartbeat: {lost_after: 10 ms}, ",
            "modules.valves.heartbeat: lost_after is not longer",
        ),
        ("safe_outputs: 5", "safe_outputs: 5, profile: epos4", "modules.valves.profile: `epos4` is no"),
    ],
)
def test_mistakes_are_named_with_their_line(tmp_path, old, new, message):
    path = tmp_path / "bench.yaml"
    path.write_text(FORCE.replace(old, new))
    with pytest.raises(ScenarioError) as caught:
        hardware.load(path)
    (line,) = caught.value.problems
    assert message in line
    assert "\n" not in line


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("fault: encoder", "faults[1]: encoder is a fault of a drive. Name a drive."),
        ("fault: emcy, code: 8130h", "faults[1]: emcy is a fault of a drive."),
    ],
)
def test_a_module_has_no_motor(tmp_path, text, message):
    path = tmp_path / "bench.yaml"
    path.write_text(FORCE + f"faults: [{{at: 1 s, node: valves, {text}}}]\n")
    with pytest.raises(ScenarioError) as caught:
        hardware.load(path)
    assert message in str(caught.value)


@pytest.mark.slow
def test_the_scenario_has_to_fit(tmp_path):
    path = tmp_path / "bench.yaml"
    path.write_text(FORCE.replace("valves:", "sheath:").replace("0: servomotor.limited", "0: sensor.measured_force"))
    with pytest.raises(ScenarioError) as caught:
        load(path).apply(load_scenario(ROOT / "scenarios/heart_wall_force.yaml"))
    assert "modules.sheath: the scenario has a member of this name." in str(caught.value)
    assert "modules.sheath.outputs.0: sensor.measured_force is Float64, an output needs one Boolean." in str(
        caught.value
    )


@pytest.mark.slow
def test_check_tells_another_device(tmp_path, build, monkeypatch):
    path = tmp_path / "bench.yaml"
    path.write_text(FORCE.replace("node: 9, ", "node: 9, product: 7, "))
    assert compare_bus(hardware.load(path), build).problems == [
        "valves: node 9: product code is 191h, expected 7h. Correct the hardware file or the wiring."
    ]
    begin = Module.__init__

    def other(self, *words):
        begin(self, *words)
        self.dictionary.put(0x1000, 0x00010191)

    monkeypatch.setattr(Module, "__init__", other)
    (text,) = compare_bus(hardware.load(path), build).problems
    assert text == "valves: node 9 is no module with digital outputs: 1000h is 00010191h. Check the node-ID."


# ------------------------------------------------------------------------------------------------- its own process


@pytest.mark.slow
@pytest.mark.real_time
def test_valves_are_safe_when_the_program_is_killed(tmp_path, build):
    """SIGKILL: the module's own outputs, told by its process, are the safe ones soon after."""
    channel = needed(own(76), **hil.options("udp_multicast"))
    network = WireNetwork("udp_multicast", channel, 1_000_000, hil.options("udp_multicast"))
    words = ["-p", "cia401", "-n", "9", "-i", "udp_multicast", "-c", channel, "--option", f"port={hil.PORT}"]
    line = [sys.executable, "-u", "-c", "from hw_bridge.command.drive import main; main()", *words]
    valves = subprocess.Popen(line, stdout=subprocess.PIPE, text=True)
    try:
        assert "CiA 401" in valves.stdout.readline()
        with hil.drive("faulhaber_v3", "udp_multicast", channel, build):
            path = hil.bench(tmp_path, "faulhaber_v3", "udp_multicast", channel)
            path.write_text(
                path.read_text() + "modules:\n  valves: {node: 9, outputs: {0: servomotor.limited}, "
                "safe_outputs: 1, heartbeat: {every: 20 ms, lost_after: 100 ms}}\n"
            )
            run = program.begun(
                hil.run_line(path, 20.0, tmp_path / "runs", build), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            try:
                heard = []
                network.hear = heard.append
                network.advance(
                    network.now + 60_000_000_000, lambda: sum(one.id == 0x080 for one in heard[-(10**6) :]) > 400
                )
                program.send(run, signal.SIGKILL)
                run.wait()
                network.advance(network.now + 500_000_000, never)
            finally:
                run.kill()
    finally:
        network.close()
        valves.terminate()
        told = valves.communicate(timeout=20)[0].splitlines()
    print(*told, sep="\n")
    levels = [one.partition("outputs ")[2] for one in told if "outputs" in one]
    assert levels[-3:] == ["00000001h", "00000000h", "00000001h"]  # the first line may have been read with the title
    assert any(one.id == 0x089 and one.data[:2] == b"\x30\x81" for one in heard)
