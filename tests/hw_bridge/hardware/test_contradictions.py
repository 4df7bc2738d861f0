"""Values of a hardware file that contradict each other are refused when it is read."""

import numpy as np
import pytest

from hw_bridge.bridge.entry import load as load_bridge
from hw_bridge.hardware import HardwareKeys, gain_problem
from hw_bridge.hardware import file as hardware
from tests.hw_bridge.axis import Rig, node
from twin.errors import ScenarioError, SimulationError
from twin.scenario import load_scenario

LIMITS = "velocity: 120 mm/s, force: 9 N, following_error: 2 mm, acceleration: 4 m/s^2, position: [-25 mm, 30 mm]"
FILE = f"""simulated: true
nodes:
  carriage:
    node: 4
    profile: faulhaber_v3
    limits: {{{LIMITS}}}
"""


@pytest.fixture
def problems(tmp_path):
    """Problems of the file with more keys, or with a part of it replaced."""

    def problems(more="", **replaced):
        text = FILE + (f"    {more}\n" if more else "")
        for old, new in replaced.items():
            text = text.replace(old.replace("_", " "), new) if old not in text else text.replace(old, new)
        path = tmp_path / "bench.yaml"
        path.write_text(text)
        try:
            hardware.load(path)
        except ScenarioError as error:
            return error.problems
        return []

    return problems


def test_the_file_itself_is_accepted(problems):
    assert problems() == []


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("contact: {signal: a.b, speed: 100 mm/s}", "bench.yaml:7: nodes.carriage.contact.speed: 100 mm/s is more than 80 % of limits.velocity, 120 mm/s"),
        ("contact: {signal: a.b, above: 9 N}", "contact.above: 9 N is not below limits.force, 9 N: it would stop without retracting"),
        ("contact: {signal: a.b, distance: 55 mm}", "contact.distance: is not less than limits.position are apart"),
        ("contact: {signal: a.b, silent_for: 4 ms}", "contact.silent_for: 4 ms is not more than a cycle"),
        ("watch_contact: false\n    contact: {signal: a.b}", "bench.yaml:7: nodes.carriage.watch_contact: is false, and `contact`"),
        ("follow: {mode: csv, gain: 90 1/s}", "follow.gain: 90 1/s is too much at a cycle of 5 ms: the position loop is unstable from about 124 1/s. Use at most 61 1/s"),
        ("heartbeat: {lost_after: 480 ms}\n    follow: {mode: csv}", "nodes.carriage.limits: at 120 mm/s a drive that misses the heartbeat goes 59.4 mm until it stands, and limits.position are 55 mm apart"),
        ("heartbeat: {every: 2 ms, lost_after: 5 ms}", "heartbeat: lost_after is not more than a cycle"),
        ("homing: {method: -3, at: -26 mm, speed: 130 mm/s}", "homing: speed 130 mm/s is above limits.velocity 120 mm/s"),
        ("homing: {method: -4, at: -26 mm, speed: 20 mm/s}", "homing: method -4 goes to the positive end, but `at` -26 mm is at the negative end"),
        ("inverted: true\n    homing: {method: -3, at: -26 mm}", "homing: method -3 goes to the positive end"),
        ("homing: {method: -3, at: -85 mm}", "homing: `at` -85 mm is 60 mm outside of limits.position"),
        ("objects: {1400h.1: 513}", "objects: 1400h.1: a run writes it, as process data says. Leave it out."),
        ("homing: {method: -3, at: -26 mm, speed: 1 mm/s}", "homing.timeout: 30 s are less than the 55 s from one limit to the other"),
        ("homing: {method: -3, at: -26 deg}", "homing.at: `-26 deg` is of an axis that turns, `4 m/s^2` of one that moves along a line"),
        ("force_constant: 12 N*m/A", "force_constant: `12 N*m/A` is of an axis that turns"),
        ("shadow: {window: 3 ms}", "shadow.window: 3 ms is shorter than a cycle"),
        ("objects: {6084h: 7}", "objects: 6084h.0: a run writes it, as limits.acceleration says. Leave it out."),
        ("objects: {1A01h.1: 7}", "objects: 1A01h.1: a run writes it, as process data says"),
        ("objects: {2344h.4: 150, 2344.4: 151}", "objects: 2344h.4 is given twice. Keep one."),
        ("objects: {2344h.256: 1}", "expected an object such as '3001h.1': 2410, not 2344h.256: 1"),
        ("keep: [12344h]", "keep: expected an object such as 607Dh.1, not 12344h"),
        ("keep: everything", "keep: expected all, or objects such as [6083h, 607Dh.1], not everything"),
        ("scaling: {6079h: 24}", "scaling: 6079h.0: no length or current of a drive follows from it"),
        ("safe_outputs: 0\n    outputs: {1: a.b, '01': a.c}", "outputs: bit 1 is given twice. Keep one."),
    ],
)  # fmt: skip
def test_two_values_that_contradict_each_other(problems, more, message):
    (line,) = problems(more)
    assert message in line
    assert "\n" not in line


@pytest.mark.parametrize(
    ("profile", "address"),
    [
        ("epos4", "3151h.1"),
        ("epos4", "3150h.2"),
        ("epos2", "2079h.1"),
        ("mclm", "2315h.0"),
        ("faulhaber_v3", "2311h.4"),
    ],
)
def test_functions_of_outputs_are_no_objects_of_a_run(tmp_path, profile, address):
    """A brake would be switched before the run, and released at standstill when the object is restored."""
    path = tmp_path / "bench.yaml"
    limits = LIMITS.replace(" mm", " deg").replace(" m/s^2", " rad/s^2").replace("9 N", "0.2 N*m")
    limits = limits if profile.startswith("epos") else LIMITS
    node_text = f"{{node: 4, profile: {profile}, limits: {{{limits}}}, objects: {{{address}: 25}}}}"
    path.write_text(f"interface: socketcan\nchannel: can0\nnodes: {{carriage: {node_text}}}\n")
    with pytest.raises(ScenarioError) as refused:
        hardware.load(path)
    (line,) = refused.value.problems
    assert line == (
        f"{path}:3: nodes.carriage.objects: {address}: switches outputs, such as a brake, before a run and again when it is "
        f"restored after it. Set it once: twin hil set 4 {address} VALUE --arm --store."
    )


@pytest.mark.parametrize(
    ("address", "text"),
    [
        ("6202h.1", "switches outputs"),
        ("6200h.1", "a run writes it, as safe_outputs says"),
        ("1016h.1", "as heartbeat"),
    ],
)
def test_objects_of_a_module_that_switch_its_outputs_or_that_a_run_writes(problems, address, text):
    module = f"modules: {{valves: {{node: 9, outputs: {{0: a.b}}, safe_outputs: 0, objects: {{{address}: 1}}}}}}"
    (line,) = problems(**{"nodes:": f"{module}\nnodes:"})
    assert f"modules.valves.objects: {address}: " in line
    assert text in line


@pytest.mark.parametrize(
    "more",
    [
        "contact: {signal: a.b, speed: 96 mm/s}",
        "contact: {signal: a.b, above: 8.99 N}",
        "contact: {signal: a.b, above: 9 N}\n    watch_force: false",
        "contact: {signal: a.b, distance: 54.9 mm}",
        "contact: {signal: a.b, silent_for: 5.1 ms}",
        "follow: {mode: csv, gain: 61 1/s}",
        "heartbeat: {lost_after: 440 ms}\n    follow: {mode: csv}",  # 52.8 mm and 1.8 mm of braking, of 55 mm
        "heartbeat: {every: 2 ms, lost_after: 6 ms}",
        "homing: {method: -3, at: -80 mm, speed: 120 mm/s}",
        "homing: {method: -3, at: -26 mm, speed: 1.84 mm/s}",  # 55 mm in 29.9 s
        "homing: {method: 37, speed: 1 mm/s}",  # it does not search
        "shadow: {window: 5 ms}",
    ],
)
def test_values_at_their_limits_are_accepted(problems, more):
    assert problems(more) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("following_error: 2 mm", "following_error: 0.601 mm"),
        ("following_error: 2 mm", "following_error: 2 mm, actual_value_age: 60 ms"),
        ("following_error: 2 mm", "following_error: 2 mm, actual_value_age: 5.1 ms"),
        ("acceleration: 4 m/s^2", "acceleration: 0.132 m/s^2"),  # 54.5 mm of braking
    ],
)
def test_limits_that_just_fit_the_rest_are_accepted(problems, old, new):
    assert problems(**{old: new}) == []


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "simulated: true",
            "simulated: true\ninterface: slcan",
            "bench.yaml:1: simulated: with `true` there is no interface",
        ),
        ("carriage:", "master:", "bench.yaml:4: nodes.master: something else has this name"),
        (
            "following_error: 2 mm",
            "following_error: 0.6 mm",
            "limits.following_error: 0.6 mm is no more than a cycle of 5 ms takes",
        ),
        (
            "following_error: 2 mm",
            "following_error: 2 mm, actual_value_age: 70 ms",
            "limits.actual_value_age: 70 ms is more than heartbeat.lost_after",
        ),
        ("acceleration: 4 m/s^2", "acceleration: 0.1 m/s^2", "goes 72 mm until it stands"),
        (
            "velocity: 120 mm/s",
            "velocity: 120 deg/s",
            "limits.velocity: `120 deg/s` is of an axis that turns, `30 mm` of one that moves along a line",
        ),
    ],
)
def test_a_value_that_contradicts_the_rest_of_the_file(problems, old, new, message):
    (line,) = problems(**{old: new})
    assert message in line


def test_a_retraction_without_a_given_speed_keeps_to_the_limit(problems):
    assert problems("contact: {signal: a.b}", **{"velocity: 120 mm/s": "velocity: 20 mm/s"}) == []


def test_a_turning_axis_may_have_no_quantity_of_a_line(problems):
    turn = (
        "velocity: 90 deg/s, force: 0.2 N*m, following_error: 15 deg, acceleration: 900 deg/s^2, position: [0, 200 deg]"
    )
    assert problems(**{LIMITS: turn, "faulhaber_v3": "epos4"}) == []


def settles(build, profile, gain, cycle):
    """Whether a step of 0.4 mm in csv with this gain comes to rest."""
    keys = {"servomotor": node(profile, number=7, follow={"mode": "csv", "gain": f"{gain} 1/s"})}
    rig = Rig(build, keys, cycle=f"{cycle} ms")
    rig.set(mode_of_operation=8, target_position=0.0)
    rig.go(20 * cycle)
    rig.set(target_position=0.4e-3)
    positions = []
    try:
        for _ in range(120):
            rig.go(cycle)
            positions.append(rig.get("position"))
    except SimulationError:
        return False
    finally:
        rig.session.close()
    return bool(np.ptp(positions[-30:]) < 0.1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["faulhaber_v3", "mclm"])
@pytest.mark.parametrize(("cycle", "largest"), [(4, 70), (8, 45)])
def test_the_stable_range_is_that_of_simulated_drives(build, profile, cycle, largest):
    """A gain margin of 2 is left: 1.5 times the largest gain still settles, 2.6 times does not."""
    assert gain_problem(largest, cycle * 1_000_000) == ""
    assert f"Use at most {largest} 1/s" in gain_problem(largest + 1, cycle * 1_000_000)
    assert settles(build, profile, 1.5 * largest, cycle)
    assert not settles(build, profile, 2.6 * largest, cycle)


@pytest.mark.slow
def test_the_default_gain_counts_where_positions_are_followed(tmp_path):
    """A member that gets speeds does not use it."""
    path = tmp_path / "bench.yaml"
    path.write_text(
        "simulated: true\ncycle: 10 ms\nnodes:\n  servomotor: {node: 4, profile: mclm, follow: {mode: csv}}\n"
    )
    assert load_bridge(path).apply(load_scenario("scenarios/heart_wall_force.yaml")).variants
    with pytest.raises(ScenarioError, match=r"servomotor\.follow: gain: 50 1/s is too much at a cycle of 10 ms"):
        load_bridge(path).apply(load_scenario("scenarios/hysteresis_identification.yaml"))


@pytest.mark.parametrize(
    ("limits", "homing", "problem"),
    [
        ({"velocity": "0.3 mm/s"}, None, r"limits\.velocity is 0\.0003, less than one unit of the drive, 0\.001"),
        (
            {},
            {"method": -3, "at": "-40 mm", "speed": "0.3 mm/s"},
            r"homing\.speed 0\.30 mm/s is less than the drive can count, 1\.00 mm/s",
        ),
    ],
)
def test_less_than_a_unit_of_the_drive_is_refused(build, limits, homing, problem):
    """It would be rounded up: homing at 0.3 mm/s would run at 1 mm/s."""
    keys = HardwareKeys.model_validate({"simulated": True, "nodes": {"servomotor": node(limits=limits, homing=homing)}})
    rig = Rig(build, keys)
    with pytest.raises(SimulationError, match=problem):
        rig.go(1)
    assert rig.drive.dictionary.get(0x6060) != 6


def test_a_retraction_is_as_fast_as_the_limit_allows(build):
    """50 mm/s of a `contact` without a speed would exceed 30 mm/s, and end the retraction where it began."""
    limits = {"velocity": "30 mm/s", "position": ["-30 mm", "30 mm"]}
    rig = Rig(build, {"servomotor": node(contact={"signal": "a.b", "distance": "7 mm"}, limits=limits)})
    rig.set(target_velocity=0.0, contact_force=0.2)
    rig.go(50)
    before = rig.get("position")
    rig.set(contact_force=0.7)
    with pytest.raises(SimulationError, match=r"is 0\.700 N, above 0\.4 N\. Retracted 7\.\d\d mm\. All drives stop"):
        rig.go(2000)
    assert rig.get("position") - before == pytest.approx(-0.007, abs=1e-3)
