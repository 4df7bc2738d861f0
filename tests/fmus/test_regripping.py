"""The regripping sequencer against a fast model of carriages and grips, judged from the truth."""

from itertools import product

import numpy as np
import pytest
from fmus.regripping_sequencer.model import RegrippingSequencer
from fmus.regripping_sequencer.rules import FAULT, IDLE, RUNNING, STANDING
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from tests.fmus.rails import make
from tests.matrix import covering
from twin.component import ERROR

SPEEDS = [0.005, 0.01, 0.02, 0.03, 0.04]
IDLE_STEP, LAST_STEP = 1, 9


def travelled(rig, velocity, distance):
    """Speeds of the instrument, over that commanded, while it goes a distance; the start is left out."""
    rig.run(0.3, velocity)
    first = len(rig.log)
    rig.run(distance / abs(velocity), velocity)
    return rig.table[first:, 0] / velocity


CASES = [(h, sign * speed) for h in (1e-3, 5e-3) for speed in SPEEDS for sign in (1, -1)]
LONG = [(h, v) for h, v in CASES if abs(v) < 0.02]  # up to 100 s


@pytest.mark.parametrize(
    ("h", "velocity"), [pytest.param(*one, marks=[pytest.mark.slow] * (one in LONG)) for one in CASES]
)
def test_speed_is_constant_through_the_regrips(native, velocity, h):
    rig = make(native, seed=3, h=h)
    speeds = travelled(rig, velocity, 0.5)
    assert speeds.min() > 0.98
    assert speeds.max() < 1.02
    assert 11 <= rig.sequencer.regrip_count <= 13
    assert rig.sequencer.violation == 0
    assert not rig.judge.seen


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("velocity", [0.06, -0.1])
def test_too_high_a_speed_is_lowered_and_nothing_dropped(native, velocity):
    rig = make(native, seed=4)
    speeds = travelled(rig, velocity, 0.5)
    assert speeds.mean() > 0.6
    assert speeds.min() > 0.2  # it never stands
    changes = np.diff(rig.table[:, 2]) / rig.h
    assert np.abs(changes).max() <= 3.0 + 1e-9
    assert not rig.judge.seen


def test_slow_grips_are_waited_for(native):
    rig = make(native, seed=5, delay=(0.4, 0.5))
    speeds = travelled(rig, 0.04, 0.3)
    assert speeds.min() < 0.01
    assert rig.sequencer.regrip_count >= 4
    assert not rig.judge.seen


def test_a_gripper_that_never_closes_ends_in_holding_at_the_end_of_the_stroke(native):
    rig = make(native, seed=6)
    rig.run(0.2, 0.0)
    rig.rail.delay = (1e3, 1e3)
    rig.run(4.0, 0.03)
    assert rig.sequencer.step_number == 6
    assert rig.sequencer.leading == 1
    assert rig.speed == pytest.approx(0.0, abs=1e-6)
    assert 0.049 < rig.rail.position[0] + 0.025 < 0.05
    assert not rig.judge.seen


def at_step(number):
    return lambda rig: rig.places["step_number"][0] == number


THEN = ("stop", "reverse", "slow", "fast", "air", "drive 1", "drive 2", "release")


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("case", "velocity"), covering(product(range(IDLE_STEP, LAST_STEP + 1), THEN), [0.04, -0.013]))
def test_anything_may_happen_in_each_of_the_nine_steps(native, case, velocity):
    number, then = case
    rig = make(native, seed=number, delay=(15e-3, 60e-3))
    assert rig.run(20.0, velocity, until=at_step(number)) or number == IDLE_STEP
    drives = [then != "drive 1", then != "drive 2"]
    changed = {"stop": 0.0, "reverse": -velocity, "slow": 0.1 * velocity, "fast": 2.5 * velocity}.get(then, velocity)
    rig.run(
        4.0 if then == "release" else 1.0, changed, enable=then != "release", pressure_ok=then != "air", drive_ok=drives
    )
    if then == "stop":
        assert rig.speed == pytest.approx(0.0, abs=1e-6)
        assert rig.sequencer.state == STANDING
    if then in ("air", "drive 1", "drive 2"):
        assert rig.sequencer.state == FAULT
        assert np.abs(rig.sequencer.gripper_target_velocity).max() == 0.0

    # and it goes on, in the direction wanted
    begin = rig.instrument
    wanted = changed or velocity
    rig.run(3.0, wanted, enable=True, pressure_ok=True, drive_ok=[True, True])
    assert rig.sequencer.state == RUNNING
    assert np.sign(rig.instrument - begin) == np.sign(wanted)
    assert abs(rig.instrument - begin) > 0.5 * 3.0 * min(abs(wanted), 0.04)
    assert not rig.judge.seen
    assert rig.sequencer.violation == 0


def test_all_steps_come_in_their_order(native):
    rig = make(native, seed=7)
    rig.run(4.0, 0.04)
    steps = rig.table[:, 1]
    shown = [int(a) for a, b in zip(steps[1:], steps[:-1], strict=True) if a != b]
    assert [int(steps[0]), *shown][:17] == [1, 2, 3, 4, 5, 6, 7, 8, 9, 5, 6, 7, 8, 9, 5, 6, 7]


def test_release_is_explicit_and_goes_home(native):
    rig = make(native, seed=8)
    rig.run(2.0, 0.04)
    rig.run(6.0, enable=False)
    assert rig.sequencer.state == IDLE
    assert rig.sequencer.step_number == IDLE_STEP
    assert rig.rail.position == pytest.approx([-0.025, 0.025], abs=1e-3)
    assert max(rig.rail.extension) == 0.0


def test_without_air_valves_stay_and_motion_waits_for_a_grip(native):
    rig = make(native, seed=9, leak=0.05)
    rig.run(20.0, 0.03, until=at_step(9))
    valves = rig.sequencer.valve.copy()
    rig.run(0.5, pressure_ok=False)  # the sleeves open: nobody can hold now
    assert (rig.sequencer.valve == valves).all()
    assert "not held" in rig.judge.seen
    assert rig.sequencer.violation == 1  # the flag tells it
    rig.judge.seen.clear()
    rig.judge.held_before = False

    rig.rail.delay = (0.2, 0.2)
    held = rig.run(1.0, pressure_ok=True, until=lambda rig: rig.speed != 0.0)
    assert held
    assert max(rig.rail.extension) > 4e-3


def test_a_lost_drive_is_replaced_by_the_other(native):
    rig = make(native, seed=10)
    rig.run(20.0, 0.03, until=at_step(4))
    assert rig.sequencer.leading == 1
    rig.run(1.0, drive_ok=[False, True])
    assert rig.sequencer.valve.all()
    assert min(rig.rail.extension) > 4e-3
    assert rig.sequencer.situation == 2
    assert not rig.judge.seen


def test_a_rail_too_short_is_an_error(native):
    sequencer = native(RegrippingSequencer, home_distance=0.15)
    sequencer.start(0.0)
    assert sequencer.advance(0.0, 1e-3) == ERROR


def test_carriages_share_a_short_rail(native):
    """Strokes overlap by 4 mm: only the rule of distance keeps the carriages apart."""
    rig = make(native, seed=11, home_distance=0.16, distance_minimum=2e-3)
    rig.judge.gap_minimum = 2e-3
    for velocity in (0.04, -0.02, 0.03, -0.04):
        rig.run(3.0, velocity)
    assert rig.judge.gap < 10e-3
    assert not rig.judge.seen


@pytest.mark.parametrize("name", ["held", "collision", "stroke", "dragged"])
def test_the_flag_tells_what_it_sees(native, name):
    rig = make(native, seed=12)
    s = rig.sequencer
    rig.run(20.0, 0.03, until=at_step(7))
    assert s.violation == 0
    s.position[:], s.extension[:] = rig.rail.position, rig.rail.extension
    if name == "held":
        s.extension[:] = 0.0
    elif name == "collision":
        s.position[:] = [0.1, -0.1]
    elif name == "stroke":
        s.position[:] = [-0.026, 0.0]
    elif name == "dragged":
        s.position[0] -= 2e-3
    s.advance(rig.t, 1e-3)
    assert s.violation & {"held": 1, "collision": 2, "stroke": 4, "dragged": 8}[name]


action = st.one_of(
    st.tuples(st.just("velocity"), st.floats(-0.06, 0.06)),
    st.tuples(st.just("velocity"), st.sampled_from([0.0, 0.04, -0.04, 0.1, -0.1, 1e-4])),
    st.tuples(st.just("air"), st.booleans()),
    st.tuples(st.just("drives"), st.tuples(st.booleans(), st.booleans())),
    st.tuples(st.just("repair"), st.just(0)),
    st.tuples(st.just("enable"), st.sampled_from([True, True, False])),
)
script = st.lists(st.tuples(action, st.floats(0.005, 1.5)), min_size=3, max_size=25)


@pytest.mark.slow
@settings(
    max_examples=25, deadline=None, derandomize=True, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)
@given(
    script=script,
    seed=st.integers(0, 1000),
    lag=st.tuples(st.floats(3e-3, 10e-3), st.floats(3e-3, 10e-3)),
    h=st.sampled_from([1e-3, 1e-3, 5e-3]),
    home_distance=st.sampled_from([0.18, 0.165]),
)
def test_random_commands_and_faults_break_no_invariant(native, script, seed, lag, h, home_distance):
    rig = make(native, seed=seed, lag=lag, delay=(10e-3, 60e-3), h=h, home_distance=home_distance)
    for (name, value), seconds in script:
        if name == "velocity":
            rig.run(seconds, value)
        elif name == "air":
            rig.run(seconds, pressure_ok=value)
        elif name == "drives":
            rig.run(seconds, drive_ok=list(value))
        elif name == "repair":
            rig.run(seconds, pressure_ok=True, drive_ok=[True, True])
        else:
            rig.run(seconds, enable=value)
        assert not rig.judge.seen
        assert rig.sequencer.violation == 0
    begin = rig.instrument
    rig.run(12.0, 0.03, enable=True, pressure_ok=True, drive_ok=[True, True])
    assert rig.instrument - begin > 0.1
    assert not rig.judge.seen
