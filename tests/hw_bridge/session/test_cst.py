"""Members that are told a force: cst on the drives that have it."""

from math import ceil
from pathlib import Path

import numpy as np
import pytest
from fmus.rotary_drive.model import RotaryDrive

from hw_bridge.bridge.entry import load
from hw_bridge.bus import MILLISECOND, SimulatedNetwork
from hw_bridge.dictionary import Mode, State
from hw_bridge.session import Session
from tests.hw_bridge.axis import Rig, node
from tests.hw_bridge.bridge.test_bridge import SCREW
from twin.errors import ScenarioError, SimulationError
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario

SPRING = Path(__file__).parents[1] / "spring.yaml"
BENCH = "simulated: true\ncycle: {cycle} ms\nnodes:\n  servomotor: {{node: 1, profile: {profile}}}\n"
UNIT = 0.79e-3 * 11.64  # of 6071h: a thousandth of the rated current, as a force [N]
CSV, CST = 9, 10


@pytest.fixture
def deflected(tmp_path, build):
    """Signals of the motor that deflects a spring: by itself, or as a drive on a bus; how many ms later that is."""

    def deflected(profile="", cycle=1):
        hardware, late = None, 0
        if profile:
            (tmp_path / "bench.yaml").write_text(BENCH.format(cycle=cycle, profile=profile))
            hardware = load(tmp_path / "bench.yaml", build=build)
        outcome = run_scenario(
            load_scenario(SPRING), RunOptions(root=tmp_path, build=build, report=False), hardware=hardware
        )
        assert outcome.run.status == "completed", outcome.run.reason
        if hardware is not None:
            # SYNC makes targets act, the next cycle of the drive takes them over, and shows where the motor was then
            session = hardware.sessions[0]
            late = ceil((session.origin % MILLISECOND + session.master.window) / MILLISECOND)
        (table,) = outcome.tables.values()
        return table.values, late

    return deflected


@pytest.mark.slow
def test_a_spring_is_deflected_as_without_a_bus(deflected):
    """At a cycle of 1 ms the same motion, later; force is rounded to a thousandth of the rated current."""
    (alone, _), (driven, late) = deflected(), deflected("faulhaber_v3")
    assert late in (1, 2)
    assert np.ptp(alone["servomotor.position"]) > 0.025
    difference = driven["servomotor.position"][late:] - alone["servomotor.position"][:-late]
    assert np.max(np.abs(difference)) < 1e-6
    difference = driven["servomotor.force"][late:] - alone["servomotor.force"][:-late]
    assert np.max(np.abs(difference)) < UNIT


@pytest.mark.slow
def test_a_slower_cycle_holds_the_force(deflected):
    """At 5 ms a target is two cycles of the drive older in the mean: 2 ms."""
    (alone, _), (driven, late) = deflected(), deflected("faulhaber_v3", cycle=5)
    position = driven["servomotor.position"]
    errors = [np.max(np.abs(position[n:] - alone["servomotor.position"][: len(position) - n])) for n in range(1, 8)]
    assert 1 + int(np.argmin(errors)) == late + 2
    assert min(errors) < 10e-6


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("loads", [{"load_force": -3.0}, {"load_force": 2.0, "recoil_force": -5.0}])
@pytest.mark.parametrize("inverted", [False, True])
def test_force_and_its_sign(build, inverted, loads):
    rig = Rig(build, {"servomotor": node(inverted=inverted)})
    rig.set(mode_of_operation=CST, target_force=4.0, **loads)
    rig.go(60)
    assert rig.drive.dictionary.get(0x6061) == Mode.CST
    assert rig.get("force") == pytest.approx(4.0, abs=UNIT)
    assert rig.plant.motor.current == pytest.approx((-1 if inverted else 1) * 4.0 / 11.64, rel=5e-3)
    assert rig.get("position") == pytest.approx(0.0, abs=1e-4)  # friction takes the rest


def test_small_forces_are_right_in_the_mean(build):
    """What rounding to 9 mN leaves over is carried on."""
    rig = Rig(build, {"servomotor": node()})
    rig.set(mode_of_operation=CST, target_force=0.4 * UNIT)
    rig.go(100)
    seen = []
    for _ in range(500):
        rig.go(1)
        seen.append(11.64 * rig.plant.motor.current)
    assert np.mean(seen) == pytest.approx(0.4 * UNIT, rel=0.02)


def test_a_screw_between_drive_and_member(build):
    """An EPOS4 that turns a screw of 20 mm: a force of the member is a torque of the motor."""
    rig = Rig(build, {"servomotor": node("epos4", **SCREW, limits={"force": "500 N", "velocity": "1 m/s"})})
    rig.set(mode_of_operation=CST, target_force=40.0)
    rig.go(50)
    assert rig.get("force") == pytest.approx(40.0, rel=0.02)
    assert rig.plant.motor.current * 0.091 == pytest.approx(40.0 * 0.02 / (2.0 * np.pi), rel=0.02)


def test_torque_of_a_motor_before_its_gear(build):
    """The member's target is the motor's torque, its limit that of the frame."""
    limits = {
        "force": "1 N*m",
        "velocity": "50 rad/s",
        "position": ["-10 turn", "10 turn"],
        "acceleration": "500 rad/s^2",
    }
    rig = Rig(build, {"rotation": node("epos4", scale=0.2, limits=limits)}, RotaryDrive)
    rig.set(mode_of_operation=CST, target_torque=0.13)
    rig.go(200)
    assert rig.get("torque") == pytest.approx(0.13, rel=0.01)
    speed = rig.get("angular_velocity")
    rig.go(100)
    joined = 0.0125 + 2.4e-5 * 25.0
    left = 5.0 * (0.13 - 14e-3) - 0.5 - 0.02 * 0.5 * (speed + rig.get("angular_velocity"))
    assert (rig.get("angular_velocity") - speed) / 0.1 == pytest.approx(left / joined, rel=0.03)
    rig.set(target_torque=2.0)
    rig.go(30)
    assert rig.get("torque") == pytest.approx(0.8 * 1.0 / 5.0, rel=0.01)


def test_no_jump_at_enable(build):
    """Forces that an earlier host left in the drive, and one that is there from the first step."""
    rig = Rig(build, {"servomotor": node()})
    seen = []
    advance, begin = SimulatedNetwork.advance, Session.network

    def watched(self, *given):
        advance(self, *given)
        seen.append((rig.drive.state, abs(rig.plant.motor.current), rig.drive.dictionary.get(0x6071)))

    def stale(self):
        made = begin(self)
        self.bench.bus.advance(200 * MILLISECOND)
        values = self.bench.plants["servomotor"].drive.dictionary.values
        values[0x6071, 0], values[0x6060, 0] = 900, Mode.CST
        return made

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SimulatedNetwork, "advance", watched)
        patch.setattr(Session, "network", stale)
        rig.set(mode_of_operation=CST, target_force=10.0)
        rig.go(1)
    enabled = [one for one in seen if one[0] is State.ENABLED]
    assert len(enabled) > 3
    assert max(current for _, current, _ in enabled[:-1]) < 1e-3
    assert {target for _, _, target in enabled[:-1]} == {0}
    rig.set(load_force=-10.0)
    rig.go(20)
    assert rig.get("force") == pytest.approx(10.0, abs=UNIT)


def test_the_force_limit_holds_and_the_velocity_is_watched(build):
    rig = Rig(build, {"servomotor": node(limits={"velocity": "200 mm/s"})})
    rig.set(mode_of_operation=CST, target_force=100.0, load_force=-12.0)
    rig.go(50)
    assert rig.get("force") == pytest.approx(0.8 * 15.0, abs=UNIT)
    rig.set(load_force=0.0)
    with pytest.raises(SimulationError, match=r"velocity .* mm/s is above 200\.00 mm/s"):
        rig.go(100)
    assert rig.drive.state is not State.ENABLED
    assert abs(rig.plant.motor.measured_velocity) < 5e-3
    assert not rig.plant.motor.powered


def test_modes_can_change_while_the_load_is_held(build):
    """Begun in cst: from it and into it without a jump of the force."""
    rig = Rig(build, {"servomotor": node()})
    rig.set(mode_of_operation=CST)
    rig.go(10)
    rig.set(target_force=8.0, load_force=-8.0)
    rig.go(100)
    place = rig.get("position")
    for mode in (CSV, CST, CSV):
        rig.set(mode_of_operation=mode)
        for _ in range(100):
            rig.go(1)
            assert rig.plant.motor.get("force") == pytest.approx(8.0, abs=0.1)
    assert rig.get("position") == pytest.approx(place, abs=1e-4)


def test_only_who_is_told_a_force_has_a_pdo_for_it(build):
    for mode, free in ((CST, 0), (CSV, 1)):
        rig = Rig(build, {"servomotor": node()})
        rig.set(mode_of_operation=mode)
        rig.go(10)
        get = rig.drive.dictionary.get
        assert get(0x1402, 1) >> 31 == free
        assert free or (get(0x1602), get(0x1602, 1)) == (1, 0x60710010)


@pytest.mark.slow
def test_a_connected_force_has_a_pdo_from_the_start(tmp_path, build):
    """Also where cst comes later."""
    (tmp_path / "bench.yaml").write_text(BENCH.format(cycle=5, profile="faulhaber_v3"))
    (tmp_path / "later.yaml").write_text(
        f"title: later\nextends: {SPRING}\nmembers: {{servomotor: {{parameters: {{mode_of_operation: 9}}}}}}\n"
        "events: [{at: 0.5 s, set: {servomotor.mode_of_operation: 10}}]\n"
    )
    hardware = load(tmp_path / "bench.yaml", build=build)
    scenario = load_scenario(tmp_path / "later.yaml")
    outcome = run_scenario(scenario, RunOptions(root=tmp_path, build=build, report=False), hardware=hardware)
    assert outcome.run.status == "completed", outcome.run.reason
    (table,) = outcome.tables.values()
    position = table.values["servomotor.position"]
    assert np.ptp(position[:490]) < 1e-4
    assert np.ptp(position[510:]) > 0.02


def test_a_drive_whose_firmware_has_no_cst(build):
    """The profile has it, 6502h of the drive that answers has not."""
    rig = Rig(build, {"servomotor": node()})
    begin = Session.network

    def older(self):
        made = begin(self)
        self.bench.plants["servomotor"].drive.dictionary.values[0x6502, 0] = 0x1A5
        return made

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Session, "network", older)
        rig.set(mode_of_operation=CST)
        with pytest.raises(SimulationError, match=r"servomotor: is told a force, but has no cst: 6502h is 1A5h"):
            rig.go(1)


def test_the_bus_has_to_have_time_for_it(tmp_path, build):
    """Two drives on a slower bus have: if one of them is told a force they have not."""
    bench, scenario = tmp_path / "bench.yaml", tmp_path / "two.yaml"
    bench.write_text(
        "simulated: true\nbit_rate: 800000\ncycle: 2 ms\n"
        "nodes: {servomotor: {node: 1, profile: epos4, scale: 0.003}, second: {node: 2, profile: epos4, scale: 0.003}}\n"
    )
    motors = "title: two\nmembers: {servomotor: {component: servomotor}, second: {component: servomotor}}\n"
    scenario.write_text(motors + "stop_time: 1 s\nstep: 1 ms\n")
    assert load(bench, build=build).apply(load_scenario(scenario)).variants
    scenario.write_text(motors + f"extends: {SPRING}\n")
    with pytest.raises(
        ScenarioError, match=r"bench.yaml: cycle: process data fills 80 % of 2 ms at 800000 bit/s\. Make"
    ):
        load(bench, build=build).apply(load_scenario(scenario))


@pytest.mark.slow
def test_a_supply_that_sags_is_noticed_by_the_drive(build):
    """The voltage of the member's motor is what its drive watches."""
    rig = Rig(build, {"servomotor": node()})
    rig.set(target_velocity=0.02)
    rig.go(100)
    assert rig.drive.supply == 24.0
    rig.set(supply_voltage=6.0)
    with pytest.raises(SimulationError, match="EMCY 3220h, undervoltage"):
        rig.go(50)
