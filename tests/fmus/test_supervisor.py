import itertools

import pytest
from fmus.supervisor.model import (
    AIR,
    BACK_ONLY,
    BUCKLED,
    CARRYING,
    DRIVE_1,
    DRIVE_2,
    FREE,
    HOLD,
    OVERLOAD,
    REACTIONS,
    SLIP,
    Supervisor,
)
from hypothesis import given, settings
from hypothesis import strategies as st

H = 5e-3
SPEED = 0.02


def started(make=Supervisor, **values):
    watch = make(**values)
    watch.target_velocity = SPEED
    watch.step_number = 4
    watch.gripper_velocity[0] = watch.gripper_target_velocity[0] = SPEED
    watch.start(0.0)
    watch._steps = 0
    run(watch, 0.1)
    assert watch.state == FREE
    return watch


def run(watch, seconds):
    for _ in range(round(seconds / H)):
        assert watch.advance(watch._steps * H, H) == 0
        watch._steps += 1


def air(watch, bad):
    watch.air_ok = not bad


def drive(k):
    def fail(watch, bad):
        watch.gripper_target_velocity[k] = SPEED
        watch.gripper_velocity[k] = 0.0 if bad else SPEED

    return fail


def overload(watch, bad):
    watch.limited[1] = bad


def slip(watch, bad):
    watch.instrument_position = 4e-3 if bad else 0.0


def buckled(watch, bad):
    watch.buckled = bad


FAILURES = {AIR: air, DRIVE_1: drive(0), DRIVE_2: drive(1), OVERLOAD: overload, SLIP: slip, BUCKLED: buckled}


@pytest.mark.parametrize(("cause", "motion", "air", "drive"), REACTIONS)
def test_each_row_of_the_table(native, cause, motion, air, drive):
    watch = started(lambda **values: native(Supervisor, **values))
    FAILURES[cause](watch, True)
    run(watch, 0.35)
    assert watch.cause == cause
    assert watch.state == motion
    assert watch.velocity == 0.0
    assert watch.pressure_ok == (air == 0)
    lost = watch.leading if drive == CARRYING else drive
    assert [bool(ok) for ok in watch.drive_ok] == [lost != 1, lost != 2]

    # kept after it is over
    FAILURES[cause](watch, False)
    run(watch, 1.0)
    assert watch.cause == cause
    assert watch.velocity == 0.0

    # until the operator lets go
    watch.target_velocity = 0.0
    run(watch, 0.01)
    watch.target_velocity = SPEED
    run(watch, 0.01)
    assert watch.state == FREE
    assert watch.velocity == SPEED
    assert watch.pressure_ok
    assert watch.drive_ok.all()


def test_letting_go_does_not_help_while_the_cause_is_there():
    watch = started()
    air(watch, True)
    run(watch, 0.1)
    watch.target_velocity = 0.0
    run(watch, 0.1)
    watch.target_velocity = SPEED
    run(watch, 0.1)
    assert watch.state == HOLD
    assert not watch.pressure_ok


def test_what_has_buckled_may_be_pulled_back():
    watch = started()
    buckled(watch, True)
    watch.target_velocity = -SPEED
    run(watch, 0.1)
    assert watch.state == BACK_ONLY
    assert watch.velocity == -SPEED


def test_an_elastic_grip_is_no_slip():
    watch = started()
    watch.instrument_position = 3.4e-3
    run(watch, 1.0)
    assert watch.state == FREE
    assert watch.slip == pytest.approx(3.4e-3)


def test_slip_counts_from_the_change_of_the_lead():
    watch = started()
    watch.instrument_position = 3e-3
    run(watch, 0.1)
    watch.leading = 2
    run(watch, 0.1)
    assert watch.slip == 0.0
    watch.instrument_position = -1e-3
    watch.gripper_position[1] = -0.2e-3
    run(watch, 0.1)
    assert watch.slip == pytest.approx(-3.8e-3)
    assert watch.cause == SLIP
    assert list(watch.drive_ok) == [True, False]


def test_acceleration_is_no_lost_drive():
    watch = started()
    watch.gripper_target_velocity[1] = 0.2
    run(watch, 0.28)
    watch.gripper_velocity[1] = 0.2
    run(watch, 1.0)
    assert watch.state == FREE


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.sampled_from(list(FAILURES)), st.booleans(), st.sampled_from([SPEED, 0.0, -SPEED])), max_size=20
    )
)
def test_never_more_speed_than_wanted_and_none_in_a_hold(events):
    watch = started()
    for cause, bad, wanted in events:
        FAILURES[cause](watch, bad)
        watch.target_velocity = wanted
        run(watch, 0.05)
        assert watch.velocity in (0.0, wanted)
        if watch.state == HOLD:
            assert watch.velocity == 0.0
        if watch.state == FREE:
            assert watch.velocity == wanted
            assert watch.pressure_ok
            assert watch.drive_ok.all()


def test_the_bits_are_distinct():
    bits = [row[0] for row in REACTIONS]
    assert sorted(bits) == sorted(FAILURES)
    assert all(a & b == 0 for a, b in itertools.combinations(bits, 2))
