"""`twin run --dry-run`: the bus without power, then the scenario on simulated drives."""

from pathlib import Path

import pytest

from hw_bridge.bridge import load
from hw_bridge.bridge.dry import CYCLES, rehearse, switching
from hw_bridge.bus import Bus, SimulatedNetwork
from hw_bridge.device import Drive, Module, Motor
from hw_bridge.dictionary import State
from hw_bridge.hardware import HardwareKeys
from hw_bridge.hardware import load as load_keys
from hw_bridge.profiles import device, profile
from tests.hw_bridge.values import each_write, held
from twin.cli.run import show_verdict
from twin.errors import ScenarioError, SimulationError
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario

SETTLED = 1_500_000_000  # all are in Switched on by then [ns]
ROTARY = {"servomotor_1": False, "servomotor_2": False, "rotation": True}
ROOT = Path(__file__).parents[3]
SCENARIO = """
title: one
stop_time: 1 s
step: 1 ms
members:
  command: {{component: travel_command, parameters: {{distance: {distance}, speed: {speed}, acceleration: 0.1 m/s^2}}}}
  servomotor: {{component: servomotor, parameters: {{mode_of_operation: 8}}}}
connections:
  - command.reference_position -> servomotor.target_position
"""


@pytest.fixture
def bus(build):
    """Three drives and a module, and everything that they were ever told to be."""
    keys = load_keys(ROOT / "hw_bridge/benches/simulated_racs_module.yaml")
    found = Bus()
    drives = [
        Drive(profile(one.profile), one.node, Motor(profile(one.profile).motor, build=build))
        for one in keys.nodes.values()
    ]
    states = set()
    for one in drives:
        enter = one._enter
        one._enter = lambda state, enter=enter: (states.add(state), enter(state))[1]
    for one in (*drives, Module(device("cia401"), 9)):
        found.attach(one)
    return keys, SimulatedNetwork(found), drives, states


@pytest.mark.slow
def test_everything_but_power(bus):
    keys, network, drives, states = bus
    written = {}
    for number, one in enumerate(drives):
        each_write(
            one, lambda index, sub, data, n=number: written.setdefault((n, index, sub), int.from_bytes(data, "little"))
        )
    before = [held(one) for one in drives]
    told = rehearse(keys, network, ROTARY, writes=(lines := []))
    assert "    6007h.0 Abort connection option code: 1 -> 3" in "\n".join(f"  {line}" for line in lines)
    assert "servomotor_1: 3" in lines[-4]
    assert lines[-4].endswith("objects were changed for the run and are as before")
    assert told[4] == "servomotor_1: limits.force 25 N is above the drive's own 18.39 N (its peak current)."
    assert told[0] == f"servomotor_1: Switched on, no power; 0 of {CYCLES} process data lost"
    assert told[3] == f"valves: outputs safe; 0 of {CYCLES} process data lost"
    assert State.SWITCHED_ON in states
    assert State.ENABLED not in states
    assert {one.state for one in drives} == {State.DISABLED}
    assert written[0, 0x6007, 0] == written[1, 0x6007, 0] == 3  # parameters were those of a run
    assert [held(one) for one in drives] == before  # and are as they were
    assert [one.axis.motor.position for one in drives] == [0.0] * 3


def test_what_would_end_a_run_ends_it(bus):
    keys, network, drives, states = bus
    drives[1].inject(0x7300, lasting=True)
    with pytest.raises(SimulationError, match=r"servomotor_2: is in Fault, 603Fh: 7300h encoder"):
        rehearse(keys, network, ROTARY)
    assert State.SWITCHED_ON not in states


def test_an_absurd_limit_is_refused_before_anything_is_switched_on(bus):
    keys, network, drives, states = bus
    drives[0].dictionary.values[0x6080, 0] = 20  # mm/s, the drive's own
    with pytest.raises(SimulationError, match=r"limits.velocity 300 mm/s is above the drive's own 20 mm/s \(6080h\)"):
        rehearse(keys, network, ROTARY)
    assert State.SWITCHED_ON not in states


@pytest.mark.slow
def test_what_the_stop_could_not_confirm_is_told_with_what_failed(bus, monkeypatch):
    keys, network, drives, _ = bus
    network.bus.event_queue.at(SETTLED, lambda: monkeypatch.setattr(drives[0].sdo, "answer", lambda _: None))
    with pytest.raises(SimulationError) as failure:
        rehearse(keys, network, ROTARY)
    first, second = failure.value.problems
    assert first.startswith("servomotor_1: node 1: no answer on 6041h.0.")
    assert second.startswith("servomotor_1: did not confirm that it is disabled (last state: Switch on disabled).")
    assert drives[0].state is State.DISABLED


def dry(tmp_path, build, **values):
    file = tmp_path / "one.yaml"
    file.write_text(SCENARIO.format(**values))
    bench = tmp_path / "bench.yaml"
    bench.write_text(
        "simulated: true\nnodes: {servomotor: {node: 1, profile: faulhaber_v3, limits: {velocity: 20 mm/s}}}\n"
    )
    hardware = load(bench, build=build, trace=tmp_path / "sent.log", dry=True)
    outcome = run_scenario(load_scenario(file), RunOptions(root=tmp_path, build=build, report=False), hardware=hardware)
    return outcome, hardware.notes()


@pytest.mark.slow
def test_what_would_have_been_sent_and_how_near_the_limits(tmp_path, build, capsys):
    outcome, notes = dry(tmp_path, build, distance="1 mm", speed="5 mm/s")
    assert outcome.run.status == "completed", outcome.run.reason
    assert outcome.summary["hardware"]["dry_run"]
    show_verdict(outcome, report=False)
    assert capsys.readouterr().out.startswith("DRY RUN, drives have not moved: ")
    assert (
        notes[0]
        == f"dry run on simulated bus, power never on: servomotor: Switched on, no power; 0 of {CYCLES} process data lost."
    )
    bound = "servomotor: late_cycle hold, up to 60 ms: at 20 mm/s at most 1.2 mm; a program that dies: "
    assert notes[1].startswith(f"dry run on simulated bus, power never on: {bound}")
    assert (
        "current limit does, 18.39 N as it is set. Apart from that, actual values" in notes[1]
    )  # as `hil check` reads it
    assert "servomotor in csp: target_position 0.00 mm to " in notes[2]
    assert "of 20.00 mm/s (" in notes[2]
    assert 20 < float(notes[2].partition("20.00 mm/s (")[2].partition(" %")[0]) < 60
    assert (tmp_path / "sent.log").read_text().count(" 201#") > 150  # targets, every 5 ms


@pytest.mark.slow
def test_a_limit_that_would_be_met(tmp_path, build):
    outcome, _ = dry(tmp_path, build, distance="20 mm", speed="50 mm/s")
    assert outcome.run.status == "failed"
    assert "is above" in outcome.run.reason


def real(tmp_path, monkeypatch, bus, arm, outputs):
    """A dry run of a scenario on drives that take themselves for real."""
    from hw_bridge.bridge import dry as module

    _, network, drives, states = bus
    monkeypatch.setattr(module, "bench_network", lambda *_: network)
    bench = tmp_path / "real.yaml"
    more = ", safe_outputs: 1" if outputs else ""
    bench.write_text(
        f"interface: socketcan\nchannel: can0\nnodes: {{servomotor: {{node: 1, profile: faulhaber_v3{more}}}}}\n"
    )
    file = tmp_path / "one.yaml"
    file.write_text(SCENARIO.format(distance="1 mm", speed="5 mm/s"))
    hardware = load(bench, arm=arm, build=tmp_path / "build", dry=True)
    hardware.apply(load_scenario(file))
    return hardware, drives[0], states


@pytest.mark.slow
@pytest.mark.parametrize("arm", [False, True])
def test_real_drives_are_switched_on_only_if_it_is_armed(tmp_path, monkeypatch, bus, arm):
    hardware, drive, states = real(tmp_path, monkeypatch, bus, arm, outputs=False)
    assert (State.SWITCHED_ON in states) is arm
    assert (State.READY in states) is arm
    expected = "Switched on" if arm else "Switch on disabled"
    assert hardware.rehearsal_results[0] == f"servomotor: {expected}, no power; 0 of {CYCLES} process data lost"
    assert drive.dictionary.get(0x1017) == 0, "it was set up, and released"


@pytest.mark.slow
def test_outputs_of_real_drives_are_set_only_if_it_is_armed(tmp_path, monkeypatch, bus):
    with pytest.raises(ScenarioError, match=r"sets the outputs of servomotor to their safe levels.*Add --arm"):
        real(tmp_path, monkeypatch, bus, False, outputs=True)
    assert bus[2][0].outputs == 0
    _, drive, _ = real(tmp_path, monkeypatch, bus, True, outputs=True)
    assert drive.outputs == 1


@pytest.mark.parametrize(
    ("objects", "names"),
    [
        ({}, []),
        ({"6067h": 50}, []),
        ({"60C4h.1": 1}, []),
        ({"2FFFh.1": 1}, ["axis"]),
        ({"6067h": 50, "5000h": 1}, ["axis"]),
    ],
)
def test_unknown_objects_of_the_vendor_may_switch_outputs(objects, names):
    """A dry run writes them too, and needs --arm for it."""
    drive = {"node": 1, "profile": "epos4", "objects": objects}
    keys = HardwareKeys.model_validate({"interface": "socketcan", "channel": "can0", "nodes": {"axis": drive}})
    assert switching(keys) == names
