"""Hardware files and `twin run --hardware`."""

import importlib
import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hw_bridge.bridge.entry import load
from hw_bridge.commission import axis
from hw_bridge.hardware import file as hardware
from hw_bridge.profiles import profile
from hw_bridge.session.targets import unknown_mode
from twin.errors import ScenarioError
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario

run = importlib.import_module("twin.cli.run")  # the package has a function of this name
ROOT = Path(__file__).parents[3]
BENCHES = sorted((ROOT / "hw_bridge/benches").glob("*.yaml"))
SCENARIO = ROOT / "scenarios/heart_wall_force.yaml"
SHORT = ROOT / "tests/conformance/short_force.yaml"
SIMULATED = "hw_bridge/benches/simulated_force.yaml"

GOOD = """simulated: true
nodes:
  servomotor: {node: 1, profile: faulhaber_v3}
"""


@cache
def shipped(name):
    """A scenario of the project, read once: hardware makes another of it."""
    return load_scenario(ROOT / f"scenarios/{name}.yaml")


FOR = {
    "force": "heart_wall_force",
    "regripping": "regripping",
    "racs": "racs",
    "hysteresis": "hysteresis_identification",
    **dict.fromkeys(
        ("first", "faulhaber", "mclm", "epos4", "epos2"), "heart_wall_force"
    ),  # of the first motion: any with a servomotor
}  # second word of a bench: its scenario


@pytest.mark.slow
@pytest.mark.parametrize("path", BENCHES, ids=lambda path: path.stem)
def test_every_bench_is_well_formed_and_fits_its_scenario(path):
    name = FOR[path.stem.split("_")[1]]
    scenario = load(path, arm=True).apply(shipped(name))
    for case in scenario.variants:
        for name in hardware.load(path).nodes:
            assert case.members[name].made.__name__ == f"Drive_{name}"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("simulated: true", "interface: socketcan", "bench.yaml:1: interface and channel are missing."),
        ("simulated", "simulate", "bench.yaml:1: simulate: unknown key. Did you mean 'simulated'?"),
        ("faulhaber_v3", "faulhaber", "bench.yaml:3: nodes.servomotor.profile: `faulhaber` is no drive profile. Did you mean"),
        ("node: 1", "node: 200", "bench.yaml:3: nodes.servomotor.node: input should be less than or equal to 126, not 200."),
        ("node: 1, ", "", "bench.yaml:3: nodes.servomotor.node: is missing. Add it."),
        ("true", "true\ncycle: 2.5 ms", "bench.yaml:2: cycle: expected whole milliseconds above zero, such as 5 ms"),
        ("true", "true\nbit_rate: 123", "bench.yaml:2: bit_rate: 123 is none of CANopen's."),
        ("true", "true\ncycle: 1 ms\nbit_rate: 500000", "bench.yaml:2: cycle: process data fills 133 % of 1 ms at 500000 bit/s."),
        ("true", "true\nmaster: 1", "bench.yaml:4: nodes.servomotor: node 1 is this program already."),
        ("node: 1", "node: 1, limits: {force: 5 mm}", "nodes.servomotor.limits.force: `5 mm` does not convert to N."),
        ("node: 1", "node: 1, limits: {velocity: 300}", "servomotor.limits.velocity: 300 has no unit. Write it with one, such as 300 mm/s."),
        ("node: 1", "node: 1, limits: {position: [0, 30]}", "limits.position[2]: 30 has no unit. Write it with one, such as 30 mm."),
        ("node: 1", "node: 1, limits: {force: '15'}", "limits.force: 15 has no unit. Write it with one, such as 15 N."),
        ("node: 1", "node: 1, homing: {method: 37, speed: 20}", "homing.speed: 20 has no unit."),
        ("node: 1", "node: 1, force_constant: 11.64", "force_constant: 11.64 has no unit. Write it with one, such as 11.64 N/A."),
        ("node: 1", "node: 1, heartbeat: {lost_after: 60}", "heartbeat.lost_after: 60 has no unit. Write it with one, such as 60 ms."),
        ("node: 1", "node: 1, contact: {signal: a.b, silent_for: 100}", "contact.silent_for: 100 has no unit."),
        ("node: 1", "node: 1, contact: {signal: a.b, silent_for: 0 s}", "contact.silent_for: expected a time above zero"),
        ("true", "true\ncycle: 5", "bench.yaml:2: cycle: 5 has no unit."),
        ("node: 1", "node: 1, product: 0x6150g", "product: expected a number such as 11601 or 0x61500000, not 0x6150g."),
        ("node: 1", "node: 1, product: 1.5", "product: expected a number such as 11601 or 0x61500000, not 1.5."),
        ("node: 1", "node: 1, product: 0x100000000", "product: input should be less than 4294967296"),
        ("node: 1", "node: 1, limits: {forces: 5 N}", "limits.forces: unknown key. Did you mean 'force'?"),
        ("node: 1", "node: 1, limits: {position: [1 mm, -1 mm]}", "limits.position: the first limit is not below"),
        ("node: 1", "node: 1, heartbeat: {every: 60 ms}", "heartbeat: lost_after is not longer than every."),
        ("node: 1", "node: 1, objects: {speed: 3}", "expected an object such as '3001h.1': 2410, not speed: 3"),
        ("node: 1", "node: 1, objects: 3", "nodes.servomotor.objects: expected objects such as"),
        ("node: 1", "node: 1, limits: {velocity: .inf}", "limits.velocity: expected a number of at most 1e+06, not inf."),
        ("node: 1", "node: 1, limits: {force: .nan}", "limits.force: expected a number of at most 1e+06, not nan."),
        ("node: 1", "node: 1, scale: .inf", "nodes.servomotor.scale: input should be less than or equal to"),
        ("node: 1", "node: 1, heartbeat: {lost_after: 70 s}", "heartbeat: more than 65535 ms, which 1016h and 1017h can count."),
        ("node: 1", "node: 1, homing: {method: 99}", "homing.method: FAULHABER Motion Control V3.0 has no method 99."),
        ("node: 1", "node: 1, objects: {'9999h': 1}", "objects: 9999h.0: FAULHABER Motion Control V3.0 has no such object."),
        ("node: 1", "node: 1, objects: {'6041h': 1}", "objects: 6041h.0: Statusword cannot be written."),
        ("node: 1", "node: 1, objects: {'6083h': 99999999999}", "objects: 6083h.0: 99999999999 is no UNSIGNED32."),
        ("node: 1", "node: 1, objects: {'6083h': 1.5}", "expected an object such as '3001h.1': 2410, not 6083h: 1.5"),
        ("node: 1", "node: 1, objects: {'6083h': .inf}", "expected an object such as '3001h.1': 2410, not 6083h: inf"),
        ("node: 1, profile: faulhaber_v3", "node: 1, profile: mclm, safe_outputs: 1", "CO has no digital outputs 60FEh."),
        ("true", "true\ncycle: 1 s", "cycle: 1000 ms is more than 255 ms, which drives can count."),
        ("true", "true\nfaults: [{at: 1 s, fault: fire}]", "faults[1].fault: `fire` is no fault. Known: "),
        ("true", "true\nfaults: [{at: -1 s, fault: sync, node: master}]", "faults[1]: a time is below zero."),
        ("true", "true\nfaults: [{at: 1 s, fault: drop, node: master, identifiers: [-5, 100000000000]}]", "faults[1]: identifiers are (-5, 100000000000): expected two of"),
        (GOOD, "- 1\n", "bench.yaml:1: expected keys with values, such as `node: 1`, not a list."),
        ("node: 1", "node: 1, follow: {mode: pv}", "bench.yaml:3: nodes.servomotor.follow.mode: input should be 'csp' or 'csv', not `pv`."),
        ("node: 1", "node: 1, follow: {feedforward: 1.5}", "follow.feedforward: input should be less than or equal to 1, not 1.5."),
        ("node: 1", "node: 1, safe_output: 1", "nodes.servomotor.safe_output: unknown key. Did you mean 'safe_outputs'?"),
        ("node: 1", "node: 1, invertet: true", "nodes.servomotor.invertet: unknown key. Did you mean 'inverted'?"),
        ("node: 1", "node: 1, follow: {feedforwards: 1}", "follow.feedforwards: unknown key. Did you mean 'feedforward'?"),
        ("node: 1", "node: 1, follow: {mode: csv, gain: 50}", "follow.gain: 50 has no unit. Write it with one, such as 50 1/s."),
        ("node: 1", "node: 1, follow: {gain: 50 1/s}", "follow.gain: in csp the position loop is the drive's. Leave it out, or add `mode: csv`."),
        ("node: 1, profile: faulhaber_v3", "node: 1, profile: mclm, follow: {feedforward: 1}", "follow.feedforward: FAULHABER MCLM 300x CO has no velocity offset 60B1h in csp. Add `mode: csv`, or use another drive."),
        ("true\nnodes:\n  servomotor: {", "false\ninterface: socketcan\nchannel: can0\nnodes:\n  servomotor: {motor: member, ", "motor: a real drive has the motor that is wired to it. Name it: lm2070, lm1247, ec_i_40."),
        ("node: 1", "node: 1, inverted: maybe", "nodes.servomotor.inverted: input should be a valid boolean"),
    ],
)  # fmt: skip
def test_mistakes_are_named_with_their_line(write, old, new, message):
    with pytest.raises(ScenarioError) as caught:
        hardware.load(write(GOOD.replace(old, new, 1)))
    (line,) = caught.value.problems
    assert message in line
    assert "\n" not in line


def test_values_are_in_si(write):
    keys = hardware.load(write(GOOD.replace("node: 1", "node: 1, limits: {velocity: 50 mm/s, force: 3 N}")))
    assert keys.nodes["servomotor"].limits.velocity == pytest.approx(0.05)
    assert keys.nodes["servomotor"].limits.force == 3.0
    assert keys.cycle == 5_000_000


def test_zero_needs_no_unit(write):
    keys = hardware.load(write(GOOD.replace("node: 1", "node: 1, limits: {position: [0, 30 mm]}")))
    assert keys.nodes["servomotor"].limits.position == [0.0, pytest.approx(0.03)]


@pytest.mark.parametrize("text", ["0x61500000", "61500000h", "1632632832"])
def test_codes_as_data_sheets_print_them(write, text):
    more = f"node: 1, product: {text}, serial: 0x1A, objects: {{2344h.4: 0x96}}, safe_outputs: 0x3"
    one = hardware.load(write(GOOD.replace("node: 1", more))).nodes["servomotor"]
    assert (one.product, one.serial, one.objects, one.safe_outputs) == (0x61500000, 26, {(0x2344, 4): 150}, 3)


def test_identifiers_of_a_fault_as_the_documents_have_them(write):
    fault = "faults: [{at: 1 s, fault: drop, node: master, identifiers: [0x180, 0x1FF]}]"
    assert hardware.load(write(f"{GOOD}{fault}\n")).faults[0].identifiers == [0x180, 0x1FF]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD.replace("servomotor", "servo"), "nodes.servo: no such member. Did you mean 'servomotor'?"),
        (GOOD.replace("servomotor", "wall"), "nodes.wall: Wall has no target_velocity, position_actual_value."),
        (
            GOOD.replace("node: 1", "node: 1, limits: {velocity: 5 deg/s}"),
            "bench.yaml:3: nodes.servomotor.limits.velocity: `5 deg/s` does not convert to m/s. The member moves along a line.",
        ),
        (GOOD.replace("node: 1", "node: 1, contact: {signal: sensr.force}"), "contact: no member for sensr.force"),
        (
            GOOD.replace("node: 1", "node: 1, follow: {feedforward: 1}"),
            "follow: feedforward: the member is told speeds, which csv has no offset for. Add `mode: csp`, or leave it out.",
        ),
    ],
)
def test_what_does_not_fit_the_scenario(write, text, message):
    with pytest.raises(ScenarioError) as caught:
        load(write(text)).apply(shipped("heart_wall_force"))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("name", "member", "profile", "unit"),
    [("servomotor", "servomotor", "epos4", "rad"), ("frame", "rotary_drive", "mclm", "m")],
)
def test_a_gear_between_kinds_has_to_be_told(tmp_path, write, name, member, profile, unit):
    """Else a meter would be a radian."""
    scenario = tmp_path / "one.yaml"
    scenario.write_text(f"title: one\nstop_time: 1 s\nmembers: {{{name}: {{component: {member}}}}}\n")
    text = f"simulated: true\nnodes:\n  {name}: {{node: 1, profile: {profile}}}\n"
    with pytest.raises(ScenarioError, match=f"nodes.{name}: the motor of .* Add `scale`, .* for 1 {unit} of the motor"):
        load(write(text)).apply(load_scenario(scenario))
    assert load(write(text.replace("node: 1", "node: 1, scale: 2.5"))).apply(load_scenario(scenario)).variants


def test_only_a_linear_motor_can_be_taken_over(tmp_path, write):
    scenario = tmp_path / "one.yaml"
    scenario.write_text("title: one\nstop_time: 1 s\nmembers: {frame: {component: rotary_drive}}\n")
    text = "simulated: true\nnodes:\n  frame: {node: 1, profile: epos4, motor: member}\n"
    with pytest.raises(
        ScenarioError, match=r"nodes\.frame\.motor: RotaryDrive is no linear motor that a drive could take"
    ):
        load(write(text)).apply(load_scenario(scenario))


@pytest.mark.slow
def test_a_sampling_time_that_a_drive_cannot_have_is_the_cause_that_is_named(write):
    scenario = load_scenario(SCENARIO, ["servomotor.drive_period=0.3 ms"])
    with pytest.raises(ScenarioError) as caught:
        load(write(GOOD)).apply(scenario)
    (line,) = caught.value.problems
    assert line == (
        "--set servomotor.drive_period=0.3 ms: servomotor is a drive: drive_period 0.3 ms does not divide the drive's "
        "control cycle of 1 ms. Use 0.5 ms or 0.25 ms."
    )


@pytest.mark.slow
def test_forces_are_followed_as_they_are(write):
    text = GOOD.replace("node: 1", "node: 1, follow: {mode: csp}")
    with pytest.raises(ScenarioError, match=r"follow: the member is told forces, which cst follows\. Leave it out."):
        load(write(text)).apply(load_scenario(SCENARIO, ["servomotor.mode_of_operation=10"]))


def test_a_real_drive_may_have_objects_that_the_profile_has_not(write):
    text = (
        "interface: socketcan\nchannel: can0\nnodes: {servomotor: {node: 1, profile: mclm, objects: {2FFFh.1: 15}}}\n"
    )
    assert hardware.load(write(text)).nodes["servomotor"].objects == {(0x2FFF, 1): 15}


@pytest.mark.slow
def test_a_force_for_a_drive_without_cst(write):
    scenario = load_scenario(SCENARIO, ["servomotor.mode_of_operation=10"])
    load(write(GOOD)).apply(scenario)
    with pytest.raises(
        ScenarioError, match=r"servomotor is a drive: mode_of_operation 10: FAULHABER MCLM 300x CO has no"
    ):
        load(write(GOOD.replace("faulhaber_v3", "mclm"))).apply(scenario)


def test_a_force_for_a_member_that_has_none():
    with_force, without = ("target_velocity", "target_torque"), ("target_velocity", "target_position")
    assert unknown_mode(10, profile("epos4"), with_force) == ""
    assert "cst needs a member with target_force or target_torque" in unknown_mode(10, profile("epos4"), without)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("interface", "channel", "free"),
    [
        ("socketcan", "can0", False),
        ("slcan", "/dev/ttyACM0", False),
        ("pcan", "PCAN_USBBUS1", False),
        ("socketcan", "vcan0", True),
        ("virtual", "here", True),
        ("udp_multicast", "239.74.163.2", True),
        ("slcan", "/dev/pts/3", True),
    ],
)
def test_real_interfaces_have_to_be_armed(write, interface, channel, free):
    path = write(GOOD.replace("simulated: true", f"interface: {interface}\nchannel: {channel}"))
    scenario = shipped("heart_wall_force")
    if free:
        load(path).apply(scenario)
    else:
        with pytest.raises(ScenarioError, match=r"may move real drives\. Add --arm"):
            load(path).apply(scenario)
        load(path, arm=True).apply(scenario)


def test_the_contact_force_is_watched_by_default(write):
    for text, signal in (
        (GOOD, "sensor.measured_force"),
        (GOOD.replace("node: 1", "node: 1, watch_contact: false"), None),
    ):
        scenario = load(write(text)).apply(shipped("heart_wall_force"))
        found = [one.source for one in scenario.variants[0].connections if one.target == "servomotor.contact_force"]
        assert found == ([signal] if signal else [])


@pytest.mark.slow
def test_a_step_that_does_not_fit_the_cycle(write):
    path = write(GOOD + "cycle: 1 ms\n")
    with pytest.raises(ScenarioError, match=r"cycle: 1 ms is not a multiple of the scenario's step, 5 ms"):
        load(path).apply(load_scenario(SCENARIO, ["step=5 ms"]))


@pytest.mark.slow
def test_the_command_runs_a_scenario_on_drives(tmp_path, build, monkeypatch):
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr("twin.run.load_hardware", load)
    arguments = [str(SHORT), "--hardware", SIMULATED, "--variant", "PI", "--runs", str(tmp_path), "--build", str(build)]
    done = CliRunner().invoke(run.command, [*arguments, "--json"])
    assert done.exit_code == 0, done.output
    summary = json.loads(done.stdout)
    (case,) = summary["hardware"]["cases"]
    assert case["cycles"] == 30
    servomotor = case["nodes"]["servomotor"]
    assert 0.004 < servomotor.pop("oldest_actual_value") <= 0.006  # the first cycle waits for one of the drive's, 1 ms
    assert servomotor == {
        "limited_targets": 0,
        "late_pdos": 0,
        "lost_pdos": 0,
        "emergencies": [],
        "emergency_messages": [],
    }
    assert 0.05 < case["bus_load"] < 0.3
    assert summary["hardware"]["simulated"] is True


@pytest.mark.slow
def test_every_case_gets_drives_of_its_own(tmp_path, build):
    found = load(ROOT / SIMULATED, build=build)
    outcome = run_scenario(load_scenario(SHORT), RunOptions(root=tmp_path, build=build, report=False), hardware=found)
    assert outcome.run.status == "completed", outcome.run.reason
    assert len([one for one in found.sessions if one.is_started]) == len(outcome.scenario.cases())
    assert found.notes() == []


@pytest.mark.slow
def test_the_report_shows_the_jitter(build):
    found = load(ROOT / SIMULATED, build=build)
    assert found.pictures() == []
    found.jitter = lambda: np.array([1e-4, -1e-4, 2e-4])
    (picture,) = found.pictures()
    assert picture["svg"].startswith("<svg ")
    assert "3 of them" in picture["note"]


def test_a_bench_that_came_with_the_project_by_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert hardware.load(Path("simulated_force")).nodes.keys() == hardware.load(ROOT / SIMULATED).nodes.keys()
    with pytest.raises(ScenarioError, match="no_bench: cannot be read"):
        hardware.load(Path("no_bench"))
    keys = hardware.load(Path("simulated_force"))
    assert axis(Path("simulated_force"), keys, "servomotor").rotary is False
    with pytest.raises(ScenarioError, match=r"force\.yaml: is not there\. .* give the name alone, simulated_force\.$"):
        hardware.load(Path(SIMULATED))


def test_an_age_that_no_value_can_have(tmp_path):
    file = tmp_path / "bench.yaml"
    file.write_text("simulated: true\nnodes:\n  axis: {node: 1, profile: mclm, limits: {actual_value_age: 5 ms}}\n")
    with pytest.raises(ScenarioError, match=r"bench\.yaml:3: .*actual_value_age: 5 ms is not more than a cycle"):
        hardware.load(file)
