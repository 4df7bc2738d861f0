"""The age of actual values is measured at every cycle, recorded, and has a limit."""

import random

import pytest

from hw_bridge.bus import MILLISECOND, Disturbance, Kind
from hw_bridge.dictionary import State
from hw_bridge.master.age import PATTERN, SHIFT, ValueAge
from tests.hw_bridge.axis import Rig, node
from twin.errors import SimulationError

CYCLE = 5 * MILLISECOND


def late(rig, delay, share=1.0, duration=2000):
    """Process data of the drive come later: it gets SYNC late, or its answers take long. Milliseconds."""
    now = rig.session.bench.bus.now
    rig.session.bench.bus.disturbances.append(
        Disturbance(
            Kind.DELAY,
            start=now,
            end=now + duration * MILLISECOND,
            share=share,
            delay=round(delay * MILLISECOND),
            only=frozenset({0x181, 0x281}),
        )
    )


@pytest.fixture
def rig(build):
    made = Rig(build, {"servomotor": node()})
    made.set(target_velocity=0.01)
    made.go(100)
    return made


def test_values_of_the_last_sync_are_a_cycle_old_at_most(rig):
    rig.go(100)
    assert 0.004 < rig.get("actual_value_age") <= 0.005
    report = rig.master.report()["nodes"]["servomotor"]
    assert (
        0.004 < report["oldest_actual_value"] <= 0.006
    )  # the first cycle begins with one of the drive's, up to 1 ms later


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("delay", [20, 22])
def test_values_that_stay_20_ms_old_end_the_run(rig, delay):
    """They come once in a cycle, each four cycles late: none is missing."""
    late(rig, delay)
    with pytest.raises(
        SimulationError, match=r"servomotor: its actual values are 2[45][\d.]* ms old, more than 21\.25 ms"
    ):
        rig.go(200)
    assert rig.drive.state is not State.ENABLED


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("delay", "age"), [(7, 0.0099), (10, 0.0149), (15, 0.0199), (16, 0.0199)])
def test_the_age_is_recorded(rig, delay, age):
    late(rig, delay)
    rig.go(200)
    assert rig.get("actual_value_age") == pytest.approx(age, abs=1e-3)
    assert rig.drive.state is State.ENABLED


def test_the_limit_of_the_file(build):
    made = Rig(build, {"servomotor": node(limits={"actual_value_age": "8 ms"})})
    made.go(100)
    late(made, 7)
    with pytest.raises(SimulationError, match=r"more than 8 ms"):
        made.go(100)


def test_a_program_that_is_late_itself_does_not_end_the_run(rig):
    """That is for `late_cycle`: what it acts on is as old, but it answers the last SYNC."""
    bus = rig.session.bench.bus
    bus.advance(bus.now + 40 * MILLISECOND)
    rig.go(50)
    assert rig.drive.state is State.ENABLED
    assert rig.master.report()["nodes"]["servomotor"]["oldest_actual_value"] > 0.04


def test_four_lost_answers_in_a_row_are_not_taken_for_late_ones(rig):
    bus = rig.session.bench.bus
    bus.disturbances.append(Disturbance(Kind.DROP, start=bus.now, count=8, only=frozenset({0x181, 0x281})))
    rig.go(500)
    assert rig.drive.state is State.ENABLED
    assert rig.get("actual_value_age") <= 0.005
    assert rig.master.report()["nodes"]["servomotor"]["oldest_actual_value"] > 0.02


@pytest.mark.slow
def test_lost_process_data_are_not_taken_for_late_ones(rig):
    bus = rig.session.bench.bus
    bus.disturbances.append(Disturbance(Kind.DROP, start=bus.now, share=0.05, only=frozenset({0x181, 0x281})))
    rig.go(2000)
    assert rig.drive.state is State.ENABLED
    bus.disturbances.clear()
    rig.go(10)
    assert rig.get("actual_value_age") <= 0.005


def answered(lost=(), late=0, drift=0, cycles=60, jitter=0):
    """The largest difference of the age from the true one at the end [cycles], of answers that are lost or late."""
    one, worst, number = ValueAge(CYCLE), 0, 0
    coming, chance = [], random.Random(1)
    for k in range(cycles):
        time = k * CYCLE
        for due, n in sorted(coming):
            if due < time:
                coming.remove((due, n))
                one.received(due)
                if k > 45:
                    worst = max(worst, abs(round(one.sampled_at / CYCLE - 0.05) - n))
        if one.in_doubt:
            number += 1
            time += PATTERN[number % len(PATTERN)] * round(SHIFT * CYCLE)
        one.synced(time)
        delay = 400_000 + (late if k >= 10 else 0) + drift * k + round(jitter * chance.random())
        if k not in lost:
            coming.append((time + delay, k))
    return worst


def test_which_sync_is_answered():
    for jitter in (0, 200_000):
        assert answered(jitter=jitter) == 0
        assert answered(lost=(7,), jitter=jitter) == 0
        assert answered(lost=(7, 8, 20), jitter=jitter) == 0
        assert answered(lost=(7, 8, 9, 10), jitter=jitter) == 0
        assert answered(late=7_000_000, jitter=jitter) == 0
        assert answered(late=22_000_000, jitter=jitter) == 0
        for whole in (2, 3, 4, 6):
            assert answered(late=whole * CYCLE, jitter=jitter) == 0
        assert answered(lost=(12, 30), drift=90_000, jitter=jitter) == 0
    assert answered(drift=300_000) == 0, "it grows to more than three cycles"
    assert answered(late=CYCLE) == 1, "by just one cycle, all at once: taken for a loss"
