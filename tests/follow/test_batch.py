"""Batch: a saved state continues to the bit, and copies take over all memory of the first one."""

from __future__ import annotations

import numpy as np
import pytest

from tests.follow.test_follow import SAMPLED, SCENARIO, recording, write
from twin.follow import Follower, follow, load
from twin.follow.problem import times_of


@pytest.mark.slow
@pytest.mark.parametrize("method", ["unscented", "{name: ensemble, size: 7, seed: 1}"])
def test_a_restored_follower_repeats_its_estimates_to_the_bit(tmp_path, build, method):
    rows, _ = recording(2, count=60)
    (tmp_path / "system.yaml").write_text(SCENARIO)
    problem = load(write(tmp_path, rows, f"scenario: system.yaml\n{SAMPLED}method: {method}\n"))

    def run(follower, times):
        for tick, measurements in times:
            follower.advance(tick)
            yield follower.correct(measurements)

    times = list(times_of(problem).items())
    with Follower(problem, build) as follower:
        list(run(follower, times[:20]))
        saved = follower.save()
        wanted = list(run(follower, times[20:]))
        follower.restore(saved)
        found = list(run(follower, times[20:]))
    assert len(found) == len(times) - 20 > 30
    for one, other in zip(wanted, found, strict=True):
        assert np.array_equal(one.values, other.values)
        assert np.array_equal(one.covariance, other.covariance)
        assert one.nis == other.nis


@pytest.mark.slow
def test_copies_take_over_the_memory_of_the_first_one(tmp_path, build):
    rows, _ = recording(2, count=20)
    (tmp_path / "system.yaml").write_text(SCENARIO)
    problem = load(write(tmp_path, rows, f"scenario: system.yaml\n{SAMPLED}"))
    with Follower(problem, build) as follower:
        batch, first = follower.batch, np.array([0.3, -0.2, 1.5])
        batch.write(np.vstack([first, np.full((6, 3), 2.0)]), sharing=0)
        batch.advance(7)
        assert np.ptp(batch.outputs([0])) > 0.1  # published by the sampler 50 ms after it sampled
        batch.copy_memory(range(1, 7))
        assert np.ptp(batch.outputs([0])) == 0.0
        assert np.array_equal(batch.read(), np.tile(batch.read()[0], (7, 1)))


FEEDBACK = """
stop_time: 30 s
step: 10 ms
members:
  oscillator: {component: "tests.follow.parts:VanDerPol"}
  controller: {component: "tests.follow.parts:Controller"}
connections: [oscillator.y -> controller.u, controller.y -> oscillator.u]
"""


@pytest.mark.slow
def test_a_member_that_cannot_act_back_in_time_is_shared_with_the_same_estimates(tmp_path, build, monkeypatch):
    rows, _ = recording(2, count=60)
    (tmp_path / "system.yaml").write_text(FEEDBACK)
    text = SAMPLED.replace("signal: sampler.y", "signal: oscillator.y").replace("delay: -50 ms", "delay: 0 ms")
    text = "\n".join(line for line in text.splitlines() if not line.startswith("inputs"))
    problem = load(write(tmp_path, rows, f"scenario: system.yaml\n{text}"))
    with Follower(problem, build) as follower:
        assert follower.batch.shared == {"controller"}
    wanted = list(follow(problem, build))
    monkeypatch.setattr(type(problem), "longest_interval", np.inf)
    with Follower(problem, build) as follower:
        assert follower.batch.shared == set()
    for one, other in zip(wanted, follow(problem, build), strict=True):
        assert np.array_equal(one.values, other.values)
        assert np.array_equal(one.covariance, other.covariance)
