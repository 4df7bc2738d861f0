"""Fixed-lag smoothing: that of Rauch, Tung and Striebel where the model is linear; smaller errors than the filter's where a parameter drifts."""

from __future__ import annotations

import numpy as np
import pytest

from tests.follow import parts
from tests.follow.test_filters import DEVIATION, FREE, MEAN, NOISE, WALK, F, H
from tests.follow.test_follow import VAN_DER_POL, recording, write
from tests.follow.test_linear import POSITIONS, TIMES, linear_problem
from twin.errors import ScenarioError
from twin.follow import Follower, follow, load
from twin.follow.filters import Ensemble, Extended, Unscented
from twin.follow.problem import times_of
from twin.follow.records import signals_of
from twin.follow.smoother import FixedLagSmoother

LAG = 4


def smoothed_means(measurements):
    """Mean and covariance of each time with the measurements to `LAG` later: filter, then the recursion of Rauch, Tung and Striebel."""
    mean, covariance, rows = MEAN, np.diag(DEVIATION**2), []
    for measured in measurements:
        before = covariance
        mean, covariance = F @ mean, F @ (covariance + np.diag(WALK**2)) @ F.T
        predicted, gain = (mean, covariance), before @ F.T @ np.linalg.inv(covariance)
        weight = covariance @ H.T @ np.linalg.inv(H @ covariance @ H.T + np.diag(NOISE**2))
        mean, covariance = mean + weight @ (measured - H @ mean), covariance - weight @ H @ covariance
        rows.append((mean, covariance, predicted, gain))
        if len(rows) > LAG:
            end = rows[-1][:2]
            for (own, spread, *_), (_, _, ahead, gain) in zip(
                rows[-2 : -LAG - 2 : -1], rows[: -LAG - 1 : -1], strict=True
            ):
                end = own + gain @ (end[0] - ahead[0]), spread + gain @ (end[1] - ahead[1]) @ gain.T
            yield end


def smoothed_by(filter_, measurements):
    smoother = FixedLagSmoother(LAG, filter_.low, filter_.high)
    for tick, measured in enumerate(measurements):
        points = filter_.spread(WALK)
        past = filter_.past_deviations(points)
        moved = points @ F.T
        filter_.update(moved, moved @ H.T, measured, NOISE)
        smoothed = smoother.correct(filter_, tick, 0.1 * tick, past, moved)
        assert (smoothed is None) == (tick < LAG)
        if smoothed is not None:
            assert smoothed.time == pytest.approx(0.1 * (tick - LAG))
            yield smoothed.values, smoothed.covariance


@pytest.mark.parametrize("make", [Unscented, Extended])
def test_smoothing_of_a_linear_model_is_that_of_rauch_tung_and_striebel(make):
    measurements = np.random.default_rng(1).normal(size=(30, 2))
    found = list(smoothed_by(make(MEAN, DEVIATION, -FREE, FREE), measurements))
    assert len(found) == 30 - LAG
    for one, other in zip(found, smoothed_means(measurements), strict=True):
        assert one[0] == pytest.approx(other[0], rel=1e-9, abs=1e-9)
        assert one[1] == pytest.approx(other[1], rel=1e-8, abs=1e-10)


def test_smoothing_with_a_large_ensemble_tends_to_it():
    measurements = np.random.default_rng(1).normal(size=(12, 2))
    found = list(smoothed_by(Ensemble(MEAN, DEVIATION, -FREE, FREE, 20_000, 0), measurements))[-1]
    wanted = list(smoothed_means(measurements))[-1]
    deviation = np.sqrt(np.diag(wanted[1]))
    assert np.all(abs(found[0] - wanted[0]) < 0.12 * deviation)
    assert np.sqrt(np.diag(found[1])) == pytest.approx(deviation, rel=0.03)


def test_a_parameter_without_walk_is_the_same_at_all_times():
    """Its smoothed estimate is the present one, also where a state of no uncertainty is beside it."""
    low, deviation = -FREE[:2], np.array([0.5, 0.0])
    filter_ = Unscented(np.zeros(2), deviation, low, -low)
    smoother = FixedLagSmoother(3, low, -low)
    for tick in range(8):
        points = filter_.spread(np.zeros(2))
        past = filter_.past_deviations(points)
        filter_.update(points, points[:, :1], np.array([0.3 + 0.1 * tick]), np.array([0.2]))
        smoothed = smoother.correct(filter_, tick, float(tick), past, points)
    assert smoothed.time == 4.0
    assert smoothed.values == pytest.approx(filter_.mean, rel=1e-12)
    assert smoothed.deviations == pytest.approx(filter_.deviation, rel=1e-9)


def analytic(count):
    """Mean and covariance of the position and speed of a free mass at each of its times, with the first `count` measurements."""
    times = TIMES[1:] - 0.05
    joint = np.zeros((2 * count, 2 * count))  # of all states, by the moves from the start
    means, moves, before, move_before = [], [], 0.0, np.eye(2)
    noises = [np.diag([1.0, 4.0])]
    for time in times[:count]:
        h = time - before
        move = np.array([[1.0, h], [0.0, 1.0]])
        moves.append(move)
        noises.append(h * np.diag([0.04, 0.25]))
        move_before, before = move @ move_before, time
        means.append(move_before @ np.array([0.5, -1.0]))
    covariance = noises[0]
    for k in range(count):
        covariance = moves[k] @ (covariance + noises[k + 1]) @ moves[k].T
        block = covariance
        for j in range(k, count):
            block = block if j == k else moves[j] @ block
            joint[2 * j : 2 * j + 2, 2 * k : 2 * k + 2] = block
            joint[2 * k : 2 * k + 2, 2 * j : 2 * j + 2] = block.T
    seen = joint[::2, ::2] + 0.01 * np.eye(count)
    cross = joint[:, ::2]
    mean = np.concatenate(means)
    measured = POSITIONS[1 : count + 1] - 0.02
    mean = mean + cross @ np.linalg.solve(seen, measured - mean[::2])
    joint = joint - cross @ np.linalg.solve(seen, cross.T)
    return [
        (time, mean[2 * i : 2 * i + 2], joint[2 * i : 2 * i + 2, 2 * i : 2 * i + 2])
        for i, time in enumerate(times[:count])
    ]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("method", ["unscented", "extended"])
def test_a_file_with_a_lag(tmp_path, build, method):
    """Smoothed estimates are those of the joint distribution of all states and measurements; they are signals of the run."""
    problem = linear_problem(tmp_path, f"{method}\nsmooth: 170 ms")
    assert problem.lag == 3
    estimates = list(follow(problem, build))
    for count, one in enumerate(estimates, start=1):
        due = [row for row in analytic(count) if row[0] <= one.time - 0.15 + 1e-9]
        if not due:
            assert one.smoothed is None
            continue
        time, mean, covariance = due[-1]
        assert one.smoothed.time == pytest.approx(time)
        assert one.smoothed.values == pytest.approx(mean, rel=1e-8)
        assert one.smoothed.covariance == pytest.approx(covariance, rel=1e-7, abs=1e-10)
        assert np.all(
            one.smoothed.deviations <= estimates[[e.time for e in estimates].index(one.smoothed.time)].deviations
        )
    signals, columns = signals_of(problem, estimates)
    assert [c.name for c in columns if "smoothed" in c.name] == [
        "smoothed.time",
        *(f"{group}.Mass.{name}" for group in ("smoothed", "smoothed_deviation") for name in "xv"),
    ]
    assert np.isnan(signals.values["smoothed.Mass.v"]).tolist() == [one.smoothed is None for one in estimates]
    last = estimates[-1].smoothed
    assert signals.values["smoothed.time"][-1] == last.time
    assert signals.values["smoothed.Mass.v"][-1] == last.values[1]
    assert signals.values["smoothed_deviation.Mass.x"][-1] == last.deviations[0]


def test_a_restored_follower_smooths_as_before(tmp_path, build):
    problem = linear_problem(tmp_path, "unscented\nsmooth: 200 ms")
    with Follower(problem, build) as follower:
        ends = []
        for tick, measured in times_of(problem).items():
            if tick == 6:
                saved = follower.save()
            follower.advance(tick)
            ends.append(follower.correct(measured).smoothed)
        follower.restore(saved)
        for tick, measured in [row for row in times_of(problem).items() if row[0] >= 6]:
            follower.advance(tick)
            last = follower.correct(measured).smoothed
        assert last.values.tolist() == ends[-1].values.tolist()
        assert last.covariance.tolist() == ends[-1].covariance.tolist()


def test_smoothing_begins_anew_with_a_changed_model(tmp_path, build):
    text = (
        VAN_DER_POL.partition("  VanDerPol.mu")[0] + "changes: {damping: {set: {VanDerPol.mu: x2}}}\nsmooth: 100 ms\n"
    )
    problem = load(write(tmp_path, recording(1, 9)[0], text))
    times = []
    with Follower(problem, build) as follower:
        for number, (tick, measured) in enumerate(times_of(problem).items()):
            follower.advance(tick)
            if number == 4:
                follower.bank._named = 0  # as a change that was noticed at this measurement
            smoothed = follower.correct(measured).smoothed
            times.append(smoothed and round(smoothed.time, 6))
    assert times == [None, None, 0.05, 0.1, 0.15, None, None, 0.3, 0.35]


def test_a_lag_shorter_than_a_step_is_refused(tmp_path):
    with pytest.raises(ScenarioError) as error:
        linear_problem(tmp_path, "unscented\nsmooth: 20 ms")
    (line,) = error.value.problems
    assert line.endswith("smooth: 20 ms is shorter than the communication step of 50 ms. Give a longer lag.")


DRIFT = """
component: "tests.follow.parts:VanDerPol"
step: 10 ms
data: data.csv
outputs: {"position [mm]": {signal: VanDerPol.y, noise: 20 mm}}
estimate:
  VanDerPol.x: {start: 1 m, deviation: 0.1 m, walk: 1 mm}
  VanDerPol.v: {start: 0, deviation: 0.1, walk: 0.001}
  VanDerPol.mu: {start: 1.0, deviation: 0.3, walk: 0.2, from: 0, to: 5}
smooth: 2 s
"""


def drifting(seed):
    """Rows of an oscillator whose damping makes a random walk, and the damping after each of them."""
    random, oscillator = np.random.default_rng(seed), parts.VanDerPol(mu=1.0)
    oscillator.start(0.0)
    rows, true = [(0.0, 0.0, 1e3)], [1.0]
    for i in range(400):
        oscillator.mu = min(max(float(oscillator.mu) + 0.2 * np.sqrt(0.05) * random.standard_normal(), 0.2), 4.0)
        for k in range(5):
            oscillator.advance(0.05 * i + 0.01 * k, 0.01)
        rows.append((0.05 * (i + 1), 0.0, 1e3 * (float(oscillator.y) + 0.02 * random.standard_normal())))
        true.append(float(oscillator.mu))
    return rows, np.array(true)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["unscented", "extended", "{name: ensemble, size: 100}"])
def test_smoothed_errors_of_a_drifting_parameter_are_smaller(tmp_path, build, method):
    ratios, inside = [], []
    for seed in range(1, 7):
        rows, true = drifting(seed)
        estimates = list(follow(load(write(tmp_path, rows, f"{DRIFT}method: {method}\n")), build))
        pairs = [(one, true[round(one.smoothed.time / 0.05)]) for one in estimates if one.smoothed is not None]
        filtered = {round(one.time, 6): one.values[2] for one in estimates}
        errors = np.array(
            [[one.smoothed.values[2] - mu, filtered[round(one.smoothed.time, 6)] - mu] for one, mu in pairs]
        )
        ratios.append(np.sqrt(np.mean(errors**2, axis=0)))
        inside += [abs(one.smoothed.values[2] - mu) < 2.0 * one.smoothed.deviations[2] for one, mu in pairs]
    smoothed, plain = np.array(ratios).T
    assert np.all(smoothed < 0.7 * plain)  # docs/how-to/follow.md
    assert np.mean(inside) > 0.85
