"""Cycles that come late: the host stands still while the drives go on, in simulated time."""

import re

import numpy as np
import pytest

from hw_bridge.bus import MILLISECOND, Disturbance, Kind
from hw_bridge.dictionary import State
from hw_bridge.hardware import HardwareKeys, stall_bounds
from tests.hw_bridge.axis import Rig, node
from twin.errors import SimulationError

SPEED, CSV, CSP = 0.03, 9, 8  # the motor's stroke is 80 mm
CYCLE = 5  # [ms]


def rig(build, vendor="faulhaber_v3", policy="hold", **more):
    """A drive that has moved at 30 mm/s for 50 ms."""
    keys = {"limits": {"velocity": "0.3 m/s", "position": ["-1 m", "1 m"], "force": "100 N"}}  # steps of speed
    if vendor == "epos4":  # its motor turns
        keys["scale"] = 0.01
    late_cycle = {"policy": policy, **more}
    made = Rig(build, {"axis": node(vendor, **keys)}, late_cycle=late_cycle)
    made.set(mode_of_operation=CSV, target_velocity=SPEED)
    made.go(50)
    return made


def stall(made, milliseconds):
    """This program gets no processor; the drives do not wait for it."""
    bus = made.session.bench.bus
    bus.advance(bus.now + milliseconds * MILLISECOND)


def place(made):
    return made.plant.position()


@pytest.mark.parametrize("policy", ["hold", "slow_down", "stop"])
def test_up_to_a_cycle_nothing_is_late(build, policy):
    made = rig(build, policy=policy)
    stall(made, CYCLE)
    made.go(50)
    report = made.session.report()
    assert (report["late_cycle"], report["overruns"], report["slow_cycles"]) == (policy, 0, 0)


@pytest.mark.parametrize("late", [2, CYCLE, CYCLE + 1])
def test_what_was_late_is_caught_up_with_step_by_step(build, late):
    """Two SYNCs at once would tell a drive without interpolation twice the way in one step."""
    made = rig(build)
    stall(made, late)
    made.go(50)
    periods = np.diff(made.master.timing.sent[-11:]) / MILLISECOND
    assert min(periods) >= 0.75 * CYCLE
    assert periods[-2:] == pytest.approx(CYCLE)
    assert max(periods) == pytest.approx(CYCLE + late)


def test_hold_goes_on_from_there(build):
    """In csv the drive has gone on meanwhile, at its last speed: that is the way that `max_displacement` bounds."""
    made = rig(build)
    before = place(made)
    stall(made, 40)
    assert place(made) - before == pytest.approx(SPEED * 0.040, rel=0.05)
    assert place(made) - before < stall_bounds.max_displacement(made.session.keys, made.session.keys.nodes["axis"])[0]
    made.go(50)
    report = made.session.report()
    assert (report["overruns"], report["longest_overrun"]) == (1, 0.040)
    assert place(made) - before == pytest.approx(SPEED * 0.090, rel=0.05)
    assert made.drive.state is State.ENABLED


def test_later_than_at_most_is_the_end(build):
    made = rig(build, at_most="30 ms")
    stall(made, 31)
    with pytest.raises(
        SimulationError, match=r"came 31\.0 ms late, more than the 30 ms of late_cycle\. All drives stop"
    ):
        made.go(1)
    assert made.session.outcome.termination().unsafe == ""
    assert made.drive.state is State.DISABLED


def test_stop_ends_the_run_at_the_first_one(build):
    made = rig(build, policy="stop")
    stall(made, CYCLE + 1)
    with pytest.raises(SimulationError, match=r"came 6\.0 ms late, and late_cycle is stop\. All drives stop"):
        made.go(1)
    assert made.drive.state is State.DISABLED


def test_a_program_that_dies_is_not_hidden(build):
    """Whatever the policy, the drive misses the heartbeat and stands, within the bound that is told."""
    made = rig(build)
    made.set(target_velocity=0.24)  # as much as a target may ask for
    made.go(100)
    keys, before = made.session.keys, place(made)
    stall(made, 500)
    assert made.drive.state is State.DISABLED
    assert 0x8130 in made.drive.active
    assert abs(made.plant.motor.measured_velocity) < 1e-3
    assert 0.5 * 0.24 * 0.06 < place(made) - before < stall_bounds.max_displacement(keys, keys.nodes["axis"])[1]
    with pytest.raises(SimulationError, match=r"came 500\.0 ms late, more than the 60 ms"):
        made.go(1)


@pytest.mark.parametrize(("watched", "ends"), [(True, True), (False, False)])
def test_a_drive_that_watches_for_targets(build, watched, ends):
    """8250h of an EPOS4 ends a stall of four cycles, unless the file does without; the heartbeat stays."""
    made = rig(build, "epos4", rpdo_timeout=watched)
    assert made.drive.dictionary.get(0x60C2, 1) == (CYCLE if watched else 0)
    stall(made, 4 * CYCLE)
    if ends:
        with pytest.raises(SimulationError, match=r"8250h"):
            made.go(10)
        return
    made.go(50)
    assert made.drive.state is State.ENABLED
    stall(made, 200)
    assert made.drive.state is State.DISABLED
    assert 0x8130 in made.drive.active


@pytest.mark.parametrize(("given", "ends"), [({}, True), ({"at_most": "60 ms"}, False)])
def test_process_data_may_stay_away_as_long_if_the_file_says_so(build, given, ends):
    made = rig(build, **given)
    made.session.bench.bus.disturbances = [Disturbance(Kind.DROP, 0x181, 0x181, count=8)]
    if ends:
        with pytest.raises(SimulationError, match=r"no process data for 5 cycles"):
            made.go(60)
    else:
        made.go(60)
        assert made.session.report()["nodes"]["axis"]["lost_pdos"] == 8


@pytest.mark.parametrize("mode", [CSV, CSP])
def test_slow_down_goes_the_same_way_at_half_speed(build, mode):
    """For a second; no target is left out and none is doubled."""
    made = rig(build, policy="slow_down")
    here = place(made)
    if mode == CSP:
        here = made.get("position_actual_value")
        made.set(mode_of_operation=CSP, target_position=here, target_velocity=0.0)
        made.go(20)
    stall(made, 12)
    begin, now, speeds = place(made), made.master.network.now, []
    for k in range(200):
        if mode == CSP:
            made.set(target_position=here + SPEED * k / 1000)
        made.go(1)
        speeds.append(abs(made.plant.motor.measured_velocity))
    report = made.session.report()
    assert report["slow_cycles"] == 40
    assert made.master.network.now - now == pytest.approx(400 * MILLISECOND, abs=20 * MILLISECOND)
    assert place(made) - begin == pytest.approx(SPEED * 0.200, rel=0.15)
    assert max(speeds[60:]) == pytest.approx(SPEED / 2, rel=0.25)
    if mode == CSV:
        made.go(500)  # the second is over
        assert made.session.report()["slow_cycles"] < 110
        assert abs(made.plant.motor.measured_velocity) == pytest.approx(SPEED, rel=0.1)


def test_what_is_told_before_a_run():
    keys = HardwareKeys.model_validate(
        {
            "simulated": True,
            "late_cycle": {"policy": "slow_down", "at_most": "20 ms", "stiffness": "200 N/m"},
            "nodes": {
                "a": node(limits={"velocity": "0.1 m/s", "acceleration": "10 m/s^2", "force": "5 N"}),
                "b": node(number=2, follow={"mode": "csp"}, limits={"velocity": "0.1 m/s"}),
            },
        }
    )
    one, other = stall_bounds.bounds(keys, {"a": False, "b": False})
    assert one == (
        "a: late_cycle slow_down, up to 20 ms: at 100 mm/s at most 2 mm; a program that dies: 6.5 mm until it misses the "
        "heartbeat and stands, 0.4 N and 1.3 N more against 200 N/m. Above 5 N this program stops it; "
        "without it the drive's current limit does, 18.39 N as its profile has it."
    )
    assert re.search(r"at most 0\.5 mm; a program that dies: 1 mm", other), "csp stands where its last target was"
