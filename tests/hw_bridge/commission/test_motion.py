"""A person's hand on a drive in simulated time: armed or not at all, within limits, one stop."""

import math
from itertools import pairwise

import pytest
import yaml
from click.testing import CliRunner

from hw_bridge import hardware
from hw_bridge.command import hil
from hw_bridge.commission.direction import pushes
from hw_bridge.commission.limits import Row, wider
from hw_bridge.commission.ramp import Ramp
from hw_bridge.commission.single_axis_session import SingleAxisSession, check_bounded, restrict_to_node
from hw_bridge.dictionary import State
from hw_bridge.plant import bench_network
from twin.errors import SimulationError

LIMITS = {
    "position": ["-45 mm", "45 mm"],
    "velocity": "200 mm/s",
    "force": "8 N",
    "following_error": "3 mm",
    "acceleration": "3 m/s^2",
}
TURNS = {
    "position": ["-400 deg", "400 deg"],
    "velocity": "200 deg/s",
    "force": "0.3 N*m",
    "following_error": "20 deg",
    "acceleration": "2000 deg/s^2",
}
HOMING = {"method": -3, "at": "-40 mm", "speed": "50 mm/s"}


def written(tmp_path, profile="faulhaber_v3", **more):
    own = {"limits": TURNS if profile == "epos4" else LIMITS, **more}
    keys = {"simulated": True, "nodes": {"axis": {"node": 1, "profile": profile, **own}}}
    keys |= keys["nodes"]["axis"].pop("file", {})
    file = tmp_path / "bench.yaml"
    file.write_text(yaml.safe_dump(keys))
    return file


@pytest.fixture
def run(build):
    def run(*words, code=0):
        done = CliRunner().invoke(hil.command, [*map(str, words), "--build", str(build)])
        assert done.exit_code == code, f"{done.output}\n{done.exception}"
        return done.output + (str(done.exception) if code else "")

    return run


@pytest.fixture
def hand(build, tmp_path):
    """An enabled axis of a profile, and its simulated drive."""

    def made(profile="faulhaber_v3", forced=False, **more):
        keys = hardware.load(written(tmp_path, profile, **more))
        network = bench_network(keys, build)
        found = SingleAxisSession(restrict_to_node(keys, "axis"), "axis", network, profile == "epos4", forced)
        found.drive = next(port.station for port in network.bus._ports if hasattr(port.station, "axis"))
        return found

    return made


@pytest.mark.parametrize(("speed", "rate", "way"), [(0.1, 1.0, 0.05), (0.1, 1.0, 1e-4), (0.01, 3.0, -0.02)])
def test_ramps_end_where_they_should(speed, rate, way):
    ramp, h = Ramp(0.0, rate, rate), 5e-3
    places, velocity = [0.0], 0.0
    while ramp.position != way:
        places.append(ramp.approach(way, speed, h))
        assert abs(ramp.velocity) <= speed * (1 + 1e-9)
        assert abs(ramp.velocity - velocity) <= rate * h * 1.01 + 1e-12
        velocity = ramp.velocity
        assert len(places) < 5000
    steps = [b - a for a, b in pairwise(places)]
    assert all(math.copysign(1, way) * one >= 0 for one in steps)


def test_a_ramp_stays_inside_its_bounds_whatever_is_asked():
    ramp = Ramp(0.0, 0.5, 2.0, low=-0.01, high=0.02)
    for speed, count in ((0.3, 200), (-0.3, 300), (0.0, 50), (0.05, 10), (-0.05, 500)):
        for _ in range(count):
            ramp.follow(speed, 5e-3)
            assert -0.01 - 1e-12 <= ramp.position <= 0.02 + 1e-12
    assert ramp.position == pytest.approx(-0.01, abs=1e-6)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("profile", ["faulhaber_v3", "mclm", "epos4"])
def test_it_moves_and_is_disabled_afterwards(hand, profile):
    """A way of 1 mm, or of 20 deg; the MCLM has no csp and gets set-points of pp."""
    held = hand(profile)
    way, speed = (1e-3, 5e-3) if profile != "epos4" else (math.radians(20), math.radians(60))
    with held.enabled():
        begin = held.drive.axis.motor.position
        there = held.move(way, speed, 100 * speed)
        assert there == pytest.approx(way, rel=0.03)
        assert held.drive.axis.motor.position - begin == pytest.approx(way, rel=0.1)  # backlash of the gear
        assert held.drive.state is State.ENABLED
    assert held.drive.state is State.DISABLED
    assert held.master.notes == []
    fastest = max(abs(b.target - a.target) / (b.time - a.time) for a, b in pairwise(held.samples))
    assert fastest == pytest.approx(speed, rel=1e-3)


def test_a_failure_on_the_way_ends_in_the_one_stop(hand):
    held = hand()

    def move():
        with held.enabled():
            held.drive.port.event_queue.at(held.network.now + 100_000_000, lambda: held.drive.inject(0x7300))
            held.move(10e-3, 20e-3, 1.0)

    with pytest.raises(
        SimulationError,
        match=r"EMCY 7300h, encoder \(1001h 21h generic, device profile; .*\)\. It stops\. .* 603Fh: 7300h encoder",
    ):
        move()
    assert held.drive.state is State.FAULT
    assert not held.master.running


def test_a_jam_ends_it_by_the_following_error(hand):
    held = hand()
    with pytest.raises(SimulationError, match=r"following error|force|velocity"), held.enabled():
        held.drive.axis.motor.load(-60.0)
        held.move(20e-3, 50e-3, 1.0)
    assert held.drive.state in (State.DISABLED, State.FAULT)


@pytest.mark.slow
@pytest.mark.parametrize("inverted", [False, True])
def test_the_direction_is_that_of_the_encoder(hand, inverted):
    held = hand(forced=True, inverted=inverted)
    with held.enabled():
        found = pushes(held, 4.0)
        assert held.samples[-1].time - held.samples[0].time > 0.6, "it rests after each push until it stands"
    assert [one.agrees for one in found] == [True, True]
    assert [one.direction for one in found] == [1, -1]
    assert max(abs(one.moved) for one in found) < 0.3e-3


@pytest.mark.slow
def test_an_encoder_that_counts_backwards_is_noticed(hand, monkeypatch):
    held = hand(forced=True)
    motor = type(held.drive.axis.motor)
    measured, speed = motor.measured_position.fget, motor.measured_velocity.fget
    monkeypatch.setattr(motor, "measured_position", property(lambda self: -measured(self)))
    monkeypatch.setattr(motor, "measured_velocity", property(lambda self: -speed(self)))
    with held.enabled():
        found = pushes(held, 4.0)
    assert [one.agrees for one in found] == [False, False]
    assert all(one.moved for one in found)


def test_nothing_moves_unless_it_is_armed(run, tmp_path):
    file = written(tmp_path, file={"simulated": False, "interface": "socketcan", "channel": "can0"})
    for words in (["move", "axis", "--by", "1 mm"], ["enable", "axis"], ["direction", "axis"]):
        assert "may move real drives. Add --arm" in run(*words, "-f", file, code=1)


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--by", "1"], "has no unit"),
        (["--by", "1 N"], "does not convert to m"),
        (["--by", "1 deg"], "does not convert to m"),
        (["--by", "1 mm", "--velocity", "1 deg/s"], "does not convert to m/s"),
        ([], "Say how far"),
        (["--to", "1 mm", "--from-start"], "counts from the reference"),
        (
            ["--by", "50 mm", "--distance", "50 mm"],
            "is outside of limits.position, -45 mm to 45 mm. Nothing was enabled.",
        ),
        (["--by", "11 mm"], "from where it stands is more than 10 mm, and an end stop may be nearer"),
        (["--by", "1 mm", "--velocity", "300 mm/s"], "must be above 0 and at most 160 mm/s"),
        (["--by", "1 mm", "--acceleration", "4 m/s^2"], "at most 3 m/s^2"),
        (["--to", "1 mm", "--homed"], "has no `homing`, so that"),
    ],
)
def test_what_is_refused_before_it_moves(run, tmp_path, words, problem):
    code = 2 if problem in ("Say how far", "counts from the reference") else 1
    assert problem in " ".join(run("move", "axis", *words, "-f", written(tmp_path), code=code).split())


@pytest.mark.slow
def test_the_commands(run, tmp_path):
    file = written(tmp_path, homing=HOMING)
    told = run("move", "axis", "--by", "1 mm", "-f", file)
    assert "is at 1.00 mm" in told
    assert "stopped and disabled" in told
    assert "and motor have the same sign" in run("direction", "axis", "-f", file)
    assert "push of +0.08 N: 0 mm, not moved" in run("direction", "axis", "--share", "0.01", "-f", file, code=1)
    assert "Operation enabled at" in run("enable", "axis", "--for", "0.1", "-f", file)
    assert "Switch on disabled" in run("disable", "axis", "-f", file)
    told = run("home", "axis", "--explain", "-f", file)
    assert "slowly to negative positions of the drive until it stands against" in told
    assert "homed at -40 mm. It is at -39.00 mm; 6064h is 1000." in run("home", "axis", "-f", file)
    assert "needs a terminal" in run("jog", "axis", "-f", file, code=1)
    assert "no cst to push with" in run("direction", "axis", "-f", written(tmp_path, "mclm"), code=1)


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        (
            {"homing": {**HOMING, "at": "40 mm"}},
            "method -3 goes to the negative end, but `at` 40 mm is at the positive end",
        ),
        ({"homing": HOMING, "inverted": True}, "method -3 goes to the positive end, but `at` -40 mm"),
        ({"homing": {**HOMING, "speed": "250 mm/s"}}, "homing: speed 250 mm/s is above limits.velocity 200 mm/s"),
        ({}, "has no `homing`"),
    ],
)
def test_homing_that_would_pass_a_limit_is_refused(run, tmp_path, more, problem):
    assert problem in run("home", "axis", "-f", written(tmp_path, **more), code=1)


def test_a_search_that_finds_nothing_is_stopped(hand, tmp_path, build):
    """The switch is missing: it is stopped once it went farther than the limits are apart."""
    narrow = {**LIMITS, "position": ["-5 mm", "5 mm"], "velocity": "80 mm/s"}
    keys = hardware.load(written(tmp_path, homing={**HOMING, "at": "-5 mm"}, limits=narrow))
    held = SingleAxisSession(restrict_to_node(keys, "axis", homes=True), "axis", bench_network(keys, build))
    with pytest.raises(SimulationError, match="and found nothing; the limits are 10"), held.enabled():
        pass
    assert held.node.state is not State.ENABLED


@pytest.mark.parametrize("homes", [False, True])
def test_what_nobody_watches_any_more_is_stopped(tmp_path, build, homes):
    """At the cycle in which that is noticed, while it moves and while it homes."""
    keys = hardware.load(written(tmp_path, homing=HOMING))
    held = SingleAxisSession(restrict_to_node(keys, "axis", homes=homes), "axis", bench_network(keys, build))
    moved, homing_then = [], []

    def attend():
        moved.append(abs(held.node.velocity))
        if len(moved) > 60 and moved[-1] > 5e-3:
            homing_then.append(held.node.homing)
            raise SimulationError("nobody watches.")

    held.master.attend = attend
    with pytest.raises(SimulationError, match="nobody watches"), held.enabled():
        held.move(30e-3, 10e-3, 1.0)
    assert held.node.state is not State.ENABLED
    assert not held.master.running
    assert homing_then == [homes]
    count = len(moved)
    held.master.stop()  # nothing goes on behind
    assert len(moved) == count


def test_limits_beside_the_drives_own(run, tmp_path):
    file = written(
        tmp_path,
        limits={
            **LIMITS,
            "velocity": "3 m/s",
            "force": "25 N",
            "position": ["-2 m", "2 m"],
            "following_error": "20 mm",
        },
    )
    told = " ".join(run("check", "-f", file).split())
    assert "note: axis: limits.velocity 3000 mm/s is above the drive's own 2000 mm/s (6080h)." in told
    assert "note: axis: limits.force 25 N is above the drive's own 18.39 N (its peak current)." in told
    rows = [Row("velocity", 25.0, 2.0, "6080h", "m/s"), Row("velocity", 1.0, 2.0, "6080h", "m/s")]
    found = list(wider(type("N", (), {"name": "axis"})(), rows))
    assert len(found) == 1
    assert found[0][1]


@pytest.mark.parametrize(
    ("limits", "problem"),
    [
        ({"velocity": "300 m/s"}, "300 m/s is no limit: the motor reaches 1 m/s. Correct the unit"),
        ({"force": "800 N"}, "800 N is no limit: the motor's peak current gives 27.6 N"),
        ({"following_error": "90 mm"}, "0.09 m is no limit: the whole way is 0.09 m"),
        ({"velocity": 300}, "300 has no unit"),
        ({"acceleration": 10}, "10 has no unit"),
        ({"position": [-5, 5]}, "-5 has no unit"),
        ({"force": 15}, "15 has no unit"),
        ({"following_error": 5}, "5 has no unit"),
    ],
)
def test_absurd_limits_are_refused_with_both_numbers(tmp_path, limits, problem):
    with pytest.raises(Exception, match=problem):
        hardware.load(written(tmp_path, limits={**LIMITS, **limits}))


def test_speeds_of_a_person():
    assert check_bounded(1.0, 2.0, "--velocity", "limits.velocity", str) == 1.0
    for value in (0.0, -1.0, 2.1, math.nan):
        with pytest.raises(SimulationError, match="must be above 0 and at most 2"):
            check_bounded(value, 2.0, "--velocity", "limits.velocity", str)
