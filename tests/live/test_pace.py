"""Pace on a clock of its own."""

from math import inf

import pytest

from twin.live.pacing import BLOCK, MAX_CATCH_UP, Pace


def driven(pace, cost, seconds):
    """Simulated and wall-clock time after blocks whose steps cost so much wall-clock time [s]."""
    now, time = 100.0, 0.0
    pace.begin(now, time)
    while now < 100.0 + seconds:
        now = max(now, pace.due(time)) if pace.rate < inf else now
        count = pace.count()
        begin, before = now, time
        now, time = now + count * cost, time + count * pace.step
        pace.record_block(begin, now, before, time, count)
    return time, now - 100.0


@pytest.mark.parametrize("rate", [0.1, 1.0, 3.0, 10.0])
def test_keeps_the_rate(rate):
    pace = Pace(rate, 1e-3)
    time, passed = driven(pace, 1e-6, 4.0)
    assert time == pytest.approx(rate * passed, abs=rate * BLOCK + 1e-3)
    assert pace.achieved == pytest.approx(rate, rel=0.05)
    assert (pace.lag, pace.jitter) == (0.0, pytest.approx(0.0, abs=1e-9))


def test_as_fast_as_possible_still_listens_every_block():
    pace = Pace(inf, 1e-3)
    time, passed = driven(pace, 2e-6, 2.0)
    assert time == pytest.approx(passed / 2e-6 * 1e-3, rel=0.01)
    assert pace.count() == pytest.approx(BLOCK / 2e-6, rel=0.01)


def test_what_is_too_slow_is_not_made_good_but_listens():
    pace = Pace(1.0, 1e-3)
    time, passed = driven(pace, 4e-3, 10.0)
    assert time == pytest.approx(passed / 4.0, rel=0.05)
    assert pace.count() * 4e-3 <= BLOCK
    assert 0.0 < pace.lag < 2 * MAX_CATCH_UP
    assert pace.achieved == pytest.approx(0.25, rel=0.05)


def test_a_step_longer_than_a_block_is_one():
    assert Pace(0.1, 0.5).count() == 1
