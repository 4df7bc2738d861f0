"""Targets followed in another mode than the member's, with their speed fed forward: `follow` of the hardware file."""

import struct

import pytest
from fmus.servomotor.model import Servomotor

from hw_bridge.dictionary import Mode
from hw_bridge.hardware import HardwareKeys
from hw_bridge.session.targets import tracking_problem
from tests.every_case import every_case
from tests.hw_bridge.axis import Rig, node
from twin.errors import SimulationError

CYCLE = 5
OFFSET = 0x60B1


@pytest.fixture
def rig(build):
    def make(profile="faulhaber_v3", mode=8, **more):
        made = Rig(build, {"servomotor": node(profile, **more)}, cycle="5 ms")
        made.set(mode_of_operation=mode)
        return made

    return make


def ramp(rig, speed, cycles, start=0.0):
    """A target position that goes on in every cycle."""
    for cycle in range(cycles):
        rig.set(target_position=start + speed * cycle * 0.005)
        rig.go(CYCLE)
    return start + speed * cycles * 0.005


def late(rig, speed, cycles=100):
    """How long after its target the rod comes by [s]."""
    end = ramp(rig, speed, cycles)
    return (end - rig.get("position")) / speed


EPOS4 = {
    "profile": "epos4",
    "motor": "member",
    "scale": 24e-3 / 6.283185307,
    "force_constant": "11.64 N/A",
    "objects": {"3001h.1": 790, "3001h.2": 2370, "3010h.1": 750},
}


@every_case(
    ("follow", "mode", "problem"),
    [
        ({}, 8, ""),
        ({}, 9, ""),
        ({}, 10, ""),
        ({"mode": "csp"}, 10, "the member is told forces"),
        ({"mode": "csv", "gain": "20 1/s"}, 10, "the member is told forces"),
        ({"mode": "csp"}, 9, ""),
        ({"feedforward": True}, 9, "feedforward: "),
        ({"feedforward": True}, 8, ""),
        ({"mode": "csp", "feedforward": True}, 9, ""),
        ({"mode": "csv", "gain": "20 1/s"}, 8, ""),
        ({"mode": "csv", "gain": "900 1/s"}, 8, "gain: "),
        ({"mode": "csv", "gain": "900 1/s"}, 9, ""),
    ],
)
def test_keys_that_have_no_effect_in_a_mode(follow, mode, problem):
    keys = HardwareKeys.model_validate({"simulated": True, "nodes": {"axis": node(follow=follow)}})
    found = tracking_problem(keys.nodes["axis"], Servomotor, mode, 5_000_000)
    assert found.startswith(problem)
    assert bool(found) == bool(problem)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("drive", [{}, {"inverted": True}, EPOS4], ids=["faulhaber_v3", "inverted", "epos4"])
@pytest.mark.parametrize("feedforward", [0.0, 0.3, 1.0])
def test_what_is_fed_forward_makes_up_for_the_position_loop_and_the_bus(rig, drive, feedforward):
    """Without it: 20 ms of the loop, 5 of interpolation, 1 until targets act; of the loop's it takes its part away."""
    found = late(rig(follow={"feedforward": feedforward}, **drive), 0.05)
    assert found == pytest.approx(0.026 - 0.020 * feedforward, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["faulhaber_v3", "mclm"])
def test_positions_in_csv_are_followed_by_this_program(rig, profile):
    """In pv where there is no csv. The error is that of the cycle before: interpolation costs nothing."""
    found = {part: late(rig(profile, follow={"mode": "csv", "feedforward": part}), 0.05) for part in (0.0, 1.0)}
    assert found[0.0] == pytest.approx(0.020, abs=2e-3)
    assert found[1.0] == pytest.approx(0.0, abs=2e-3)


@pytest.mark.slow
def test_speeds_in_csp_become_positions_with_the_speed_as_offset(rig):
    made = rig(mode=9, follow={"mode": "csp", "feedforward": 1.0})
    made.set(target_velocity=0.04)
    made.go(500)
    assert made.drive.dictionary.get(0x6061) == Mode.CSP
    assert made.drive.dictionary.get(OFFSET) == 40
    assert made.get("position") == pytest.approx(0.04 * 0.5, abs=0.5e-3)
    made.set(target_velocity=0.0)
    made.go(300)
    assert made.drive.dictionary.get(OFFSET) == 0
    assert made.get("velocity") == pytest.approx(0.0, abs=1e-3)


def test_the_offset_is_the_speed_of_the_target_and_ends_with_it(rig):
    made = rig(follow={"feedforward": 1.0})
    end = ramp(made, 0.0404, 50)
    told = []
    for cycle in range(20):  # FAULHABER's unit is 1 mm/s: what rounding leaves over is carried on
        made.set(target_position=end + 0.0404 * cycle * 0.005)
        made.go(CYCLE)
        told.append(made.drive.dictionary.get(OFFSET))
    assert set(told) == {40, 41}
    assert sum(told) / len(told) == pytest.approx(40.4, abs=0.1)
    made.go(CYCLE)  # a target that stays has no speed
    assert made.drive.dictionary.get(OFFSET) == 0


def test_no_offset_in_another_mode_nor_when_positions_begin_anew(rig):
    """In csv it would be added to the speed; and the way from an old target to a new one is no speed."""
    made = rig(follow={"feedforward": 1.0})
    end = ramp(made, 0.05, 20)
    assert made.drive.dictionary.get(OFFSET) == 50
    made.set(mode_of_operation=9, target_velocity=-0.02)
    made.go(CYCLE)
    assert made.drive.dictionary.get(OFFSET) == 0
    made.go(40)
    made.set(mode_of_operation=8, target_position=end - 3e-3)
    made.go(CYCLE)
    assert made.drive.dictionary.get(OFFSET) == 0


def test_the_offset_is_cut_at_the_limit_of_velocity(rig):
    made = rig(follow={"feedforward": 1.0}, limits={"velocity": "100 mm/s"})
    with pytest.raises(SimulationError, match="above 100"):
        for cycle in range(100):
            made.set(target_position=0.12 * cycle * 0.005)
            made.go(CYCLE)
            assert abs(made.drive.dictionary.get(OFFSET)) <= 80
    assert made.drive.dictionary.get(OFFSET) == 0


def test_offsets_that_another_program_left_are_forgotten(rig):
    made = rig(mode=9)
    made.session.network = keep(made.session.network, made)
    made.set(target_velocity=0.0)
    made.go(200)
    assert [made.drive.dictionary.get(index) for index in (0x60B0, OFFSET, 0x60B2)] == [0, 0, 0]
    assert made.get("position") == pytest.approx(0.0, abs=1e-4)


def keep(network, rig):
    """Offsets are in the drive before it is brought up."""

    def begun():
        made = network()
        for index, value in ((0x60B0, 500), (OFFSET, 20), (0x60B2, 50)):
            rig.drive.dictionary.put(index, value)
        return made

    return begun


def test_every_stop_ends_the_offset(rig):
    made = rig(follow={"feedforward": 1.0})
    ramp(made, 0.05, 20)
    assert made.drive.dictionary.get(OFFSET) == 50
    made.axis.close()
    assert made.drive.dictionary.get(OFFSET) == 0
    assert not made.session.outcome.notes


def test_a_retraction_is_told_speeds_without_offset(rig):
    made = rig(follow={"feedforward": 1.0})
    ramp(made, 0.05, 20)
    give = made.session.orders.set_targets
    made.session.orders.set_targets = lambda master, _: give(master, {"servomotor": Retracting()})
    for _ in range(10):
        made.go(CYCLE)
        assert made.drive.dictionary.get(OFFSET) == 0
    assert made.get("velocity") == pytest.approx(-0.05, abs=5e-3)


class Retracting:
    """A contact that has to be left."""

    reason = "too much"

    def velocity(self):
        return -0.05

    def done(self):
        return False


def test_outputs_beside_an_offset_have_their_own_process_data(rig):
    made = rig(follow={"feedforward": 1.0}, outputs={0: "a.b"}, safe_outputs=2)
    made.go(20)
    get = made.drive.dictionary.get
    assert [get(0x1600, n) for n in range(3)] == [2, 0x607A0020, 0x60B10020]
    assert [get(0x1603, n) for n in range(2)] == [1, 0x60FE0120]
    made.set(output_0=True)
    made.go(10)
    assert made.drive.outputs == 3
    ramp(made, 0.05, 10)
    assert made.drive.dictionary.get(OFFSET) == 50
    frames = made.master.nodes["servomotor"].frames()
    assert [len(frame.data) for frame in frames] == [8, 7, 4]
    assert struct.unpack("<I", frames[-1].data) == (3,)


def test_process_data_of_an_offset_count_for_the_bus():
    from hw_bridge.hardware.file import bus_load

    plain, fed, both = (
        bus_load(HardwareKeys.model_validate({"simulated": True, "nodes": {"a": node(**more)}}))
        for more in ({}, {"follow": {"feedforward": 1.0}}, {"follow": {"feedforward": 1.0}, "outputs": {0: "a.b"}})
    )
    assert plain < fed < both


def test_the_members_motor_feels_what_the_member_feels(rig):
    """An EPOS4 with the linear motor: force, load and limits in the member's units."""
    made = rig(**EPOS4)
    made.set(load_force=3.0)
    made.go(300)
    assert made.get("position") == pytest.approx(0.0, abs=0.1e-3)
    assert made.get("force") == pytest.approx(-3.0, abs=1.6)  # dry friction takes 1.5 N
    assert made.get("current") * 11.64 == pytest.approx(made.get("force"), rel=0.05)
