"""The heart motion estimator on hearts that wander, breathe, skip and stop; times in s, errors in m."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fmus.heart.model import Heart
from fmus.heart_motion.model import DEGRADED, LOST, VALID, HeartMotion

from tests.matrix import covering
from twin.scenario import load_scenario

H = 4e-3  # of the samples
DIRECTION = np.array([0.3, -0.5, 0.8]) / np.sqrt(0.98)
NOISE = 0.5e-3  # white, per axis
LEARNED = 8.0  # [s] by when every start is over


def beating(native, seconds, **heart):
    """Times, and the wall's position there."""
    part = native(Heart, blend_in=0.0, **heart)
    times = np.arange(round(seconds / H)) * H
    wall = np.empty(len(times))
    for k, t in enumerate(times):
        part.start(t)
        wall[k] = part.position
    return times, wall


def tracked(wall, seed=1, noise=NOISE):
    """Tip in space that moves with the wall, as a noisy tracker sees it."""
    return wall[:, None] * DIRECTION + noise * np.random.default_rng(seed).normal(size=(len(wall), 3))


def estimated(native, tip, *, status=None, age=0.0, change=None, **values):
    """Outputs after each step, and the errors of what was published for the time of the next sample."""
    part = native(HeartMotion, **values)
    part.start(0.0)
    names = ("position", "velocity", "rate", "status", "disturbed", "search_rate", "deviation", "innovation")
    found = {name: np.empty(len(tip)) for name in names}
    part.tip_age = age
    for k, place in enumerate(tip):
        part.tip_position[:] = place
        part.tip_status = 0 if status is None else status[k]
        if change is not None:
            change(part, k * H)
        assert part.advance(k * H, H) == 0
        for name, values_of in found.items():
            values_of[k] = getattr(part, name)
    return SimpleNamespace(part=part, **found)


def errors(times, wall, found, begin, end=np.inf, ahead=0.0):
    """Estimate minus truth, without its mean over the learned part: the zero is the estimator's own."""
    truth = np.interp(times + H + ahead, times, wall)
    off = found.position - truth
    off -= off[times > LEARNED].mean()
    return off[(times >= begin) & (times < end)]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("seed", "rate"), covering([1, 2, 3], [0.8, 1.0, 1.3, 1.6, 2.0]))
def test_a_rate_that_wanders_and_respiration(native, rate, seed):
    times, wall = beating(native, 40.0, rate=rate, wander=0.05, seed=seed, respiration=3e-3)
    found = estimated(native, tracked(wall, seed))
    off = errors(times, wall, found, LEARNED)
    assert off.std() < 0.2e-3
    assert np.abs(off).max() < 1e-3
    assert (found.status[times > LEARNED] == VALID).all()
    np.testing.assert_allclose(np.abs(found.part.direction @ DIRECTION), 1.0, atol=2e-3)


@pytest.mark.parametrize("rate", [0.8, 2.0])
def test_the_estimate_begins_from_nothing_within_six_seconds(native, rate):
    _, wall = beating(native, 7.0, rate=rate)
    found = estimated(native, tracked(wall))
    first = np.argmax(found.status != LOST) * H
    assert 5.0 < first < 6.0
    assert (found.position[: round(5.0 / H)] == 0.0).all()
    assert found.rate[-1] == pytest.approx(rate, rel=0.02)


@pytest.mark.slow
def test_nothing_is_found_in_a_tip_at_rest(native):
    found = estimated(native, tracked(np.zeros(round(15.0 / H))))
    assert (found.status == LOST).all()
    assert (found.position == 0.0).all()


def test_it_fades_in_without_a_jump(native):
    _, wall = beating(native, 12.0)
    found = estimated(native, tracked(wall))
    assert np.abs(np.diff(found.position)).max() < 0.5e-3  # 4 ms at 41 mm/s and the fade are 0.2 mm, samples the rest


@pytest.mark.slow
def test_it_predicts_over_age_and_horizon(native):
    times, wall = beating(native, 30.0, rate=1.2, wander=0.02)
    late = np.roll(wall, 5)  # 20 ms
    blind = estimated(native, tracked(late))
    aware = estimated(native, tracked(late), age=20e-3)
    ahead = estimated(native, tracked(wall), horizon=50e-3)
    assert errors(times, wall, blind, LEARNED, 29.0).std() > 0.5e-3
    assert errors(times, wall, aware, LEARNED, 29.0).std() < 0.2e-3
    assert errors(times, wall, ahead, LEARNED, 29.0, ahead=50e-3).std() < 0.25e-3


@pytest.mark.slow
def test_velocity_is_that_of_the_motion(native):
    times, wall = beating(native, 30.0, rate=1.2, wander=0.05)
    found = estimated(native, tracked(wall))
    truth = np.interp(times + H, times, np.gradient(wall, H))
    late = times > LEARNED
    assert (found.velocity - truth)[late].std() < 0.1 * truth[late].std()


@pytest.mark.slow
def test_outliers_and_lost_samples(native):
    times, wall = beating(native, 40.0, rate=1.3, wander=0.05, respiration=3e-3)
    chance = np.random.default_rng(5)
    tip = tracked(wall)
    wild = chance.random(len(tip)) < 0.05
    tip[wild] += 20e-3 * chance.normal(size=(wild.sum(), 3))
    lost = 2 * (chance.random(len(tip)) < 0.2)
    tip[chance.random(len(tip)) < 0.01] = np.nan
    found = estimated(native, tip, status=lost)
    off = errors(times, wall, found, LEARNED)
    assert off.std() < 0.3e-3
    assert np.abs(off).max() < 1.5e-3


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300])
def test_what_is_no_place_or_no_time_is_left_out(native, value):
    _, wall = beating(native, 12.0)
    tip = tracked(wall)
    tip[round(8.0 / H) :] = value
    found = estimated(native, tip)
    assert np.isfinite(found.position).all()
    assert found.status[-1] == DEGRADED
    aged = estimated(native, tracked(wall), age=value)
    assert (aged.position == 0.0).all()
    assert (aged.status == LOST).all()


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("coupling", "rate"), covering([0.5, 0.65, 0.8], [0.9, 1.2, 1.8]))
def test_an_ectopic_beat_is_over_after_two_beats(native, rate, coupling):
    times, wall = beating(native, 40.0, rate=rate, wander=0.02, ectopic_every=20, ectopic_coupling=coupling)
    _, usual = beating(native, 40.0, rate=rate, wander=0.02)
    found = estimated(native, tracked(wall))
    onset = times[(times > 12.0) & (np.abs(wall - usual) > 1e-6)].min()
    two = 2.0 / rate + 0.1
    assert np.abs(errors(times, wall, found, onset - 3.0, onset)).max() < 1e-3
    assert np.abs(errors(times, wall, found, onset + two, onset + two + 5.0)).max() < 1.2e-3


@pytest.mark.slow
def test_early_beats_are_measured_where_they_are_not_as_learned(native):
    """Every fifth beat comes early: the estimate follows its samples then. Without them this was 0.96 mm."""
    times, wall = beating(native, 60.0, rate=1.0, wander=0.05, ectopic_every=5)
    found = estimated(native, tracked(wall))
    off = errors(times, wall, found, LEARNED)
    assert off.std() < 0.6e-3
    assert not (found.status == LOST)[times > LEARNED].any()


@pytest.mark.slow
def test_a_beat_that_resets_the_rhythm_is_followed_after_two_beats(native):
    times, wall = beating(native, 40.0, rate=1.2)
    reset = np.interp(np.where(times < 20.0, times, times + 0.35 / 1.2), times, wall)  # 0.35 beats are left out
    found = estimated(native, tracked(reset))
    assert np.abs(errors(times, reset, found, 20.0 + 2.2 / 1.2, 38.0)).max() < 1.2e-3
    assert not (found.status == LOST)[times > LEARNED].any()


@pytest.mark.slow
def test_a_short_loss_is_bridged_a_long_one_is_told(native):
    times, wall = beating(native, 40.0, rate=1.0)
    gap = np.where((times > 12.0) & (times < 22.0), 2, 0)
    steady = {"rate_process_noise": 2e-3, "phase_process_noise": 1e-2}  # a motor that plays the beat
    found = estimated(native, tracked(wall), status=gap, **steady)
    off = errors(times, wall, found, 12.0, 22.0)
    assert np.abs(off).max() < 0.6e-3
    inside = (times > 12.2) & (times < 22.0)
    assert (found.status[inside] == DEGRADED).all()
    assert np.abs(off).max() < 4.0 * found.deviation[inside].max()

    short = estimated(native, tracked(wall), status=gap, hold=3.0, **steady)
    assert (short.status[(times > 15.2) & (times < 22.0)] == LOST).all()
    assert (short.position[(times > 16.2) & (times < 22.0)] == 0.0).all()
    assert np.abs(np.diff(short.position)).max() < 0.5e-3
    assert short.status[-1] == VALID


@pytest.mark.slow
def test_after_a_long_loss_of_a_wandering_heart_the_phase_is_found_anew(native):
    times, wall = beating(native, 40.0, rate=1.3, wander=0.05)
    gap = np.where((times > 12.0) & (times < 20.0), 2, 0)
    found = estimated(native, tracked(wall), status=gap)
    assert np.abs(errors(times, wall, found, 12.0, 20.0)).max() > 2e-3
    assert np.abs(errors(times, wall, found, 22.5, 40.0)).max() < 1.2e-3


def halve(part):
    """Put a filter at half the rate: harmonics 1 and 2 become 2 and 4 of it."""
    r, a, b = part.mean[6:9].copy()
    part.mean[4:6] *= 0.5
    part.mean[6:] = 0.2e-3, r, 0.0, 0.0, 0.0, a, b


def double(part):
    """Put a filter at twice the rate: harmonic 2 becomes 1 of it."""
    a, b = part.mean[7:9]
    part.mean[4:6] *= 2.0
    part.mean[5] += np.arctan2(b, a)
    part.mean[6:] = np.hypot(a, b), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("spoil", "factor"), [(halve, 0.5), (double, 2.0)])
def test_a_filter_at_half_or_twice_the_rate_is_told_and_corrected(native, spoil, factor):
    times, wall = beating(native, 45.0, rate=1.0)

    def change(part, t):
        if abs(t - 12.0) < 0.5 * H:
            spoil(part)

    found = estimated(native, tracked(wall), change=change)
    assert found.rate[round(12.1 / H)] == pytest.approx(factor, rel=0.2)
    assert times[(times > 12.0) & (found.status != VALID)].min() < 18.0
    assert found.rate[-1] == pytest.approx(1.0, rel=0.05)
    assert np.abs(errors(times, wall, found, 35.0, 45.0)).max() < 1e-3


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("second", [0.5e-3, 2e-3, 6e-3])
@pytest.mark.parametrize("rate", [0.75, 1.0, 1.5, 2.1])
def test_the_rate_is_not_taken_for_its_half_or_double(native, second, rate):
    _, wall = beating(native, 7.0, rate=rate, amplitude=(3e-3, second, 0.3e-3, 0, 0, 0, 0))
    assert estimated(native, tracked(wall)).search_rate[-1] == pytest.approx(rate, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [2.3, 2.5])
def test_a_fast_heart_that_wanders_is_not_followed_at_half_its_rate(native, rate):
    times, wall = beating(native, 40.0, rate=rate, wander=0.05, seed=53, respiration=3e-3)
    found = estimated(native, tracked(wall))
    assert (found.rate[times > LEARNED] > 0.75 * rate).all()


@pytest.mark.parametrize(("rate", "seed"), [(2.3, 50), (2.5, 51), (2.7, 52)])
def test_half_the_rate_in_the_search_is_no_doubt_while_the_filter_explains_more(native, rate, seed):
    times, wall = beating(native, 30.0, rate=rate, wander=0.05, seed=seed, respiration=3e-3, sinus_arrhythmia=0.05)
    found = estimated(native, tracked(wall))
    late = times > LEARNED
    assert (found.search_rate[late] < 0.6 * rate).any()
    assert (found.status[late] == VALID).all()


@pytest.mark.slow
def test_a_heart_beyond_the_range_that_is_followed_at_half_its_rate_is_in_doubt(native):
    times, wall = beating(native, 30.0, rate=3.4, wander=0.02)
    found = estimated(native, tracked(wall))
    late = times > LEARNED
    np.testing.assert_allclose(found.rate[late].mean(), 1.7, rtol=0.05)
    assert (found.status[late] == DEGRADED).all()


@pytest.mark.slow
def test_a_rate_that_ramps(native):
    times = np.arange(round(40.0 / H)) * H
    rate = np.interp(times, [10.0, 30.0], [0.8, 2.0])
    turns = 2 * np.pi * np.cumsum(rate) * H
    wall = 4e-3 * np.sin(turns) + 2e-3 * np.sin(2 * turns + 2.8) + 0.4e-3 * np.sin(3 * turns + 2.8)
    found = estimated(native, tracked(wall))
    assert np.abs(errors(times, wall, found, LEARNED, 39.0)).max() < 1e-3


def test_learning_and_publishing_are_switched(native):
    times, wall = beating(native, 24.0, rate=1.0)

    def switch(part, t):
        part.enable = t >= 10.0
        part.learn = t < 10.0

    found = estimated(native, tracked(wall), change=switch, rate_process_noise=2e-3, phase_process_noise=1e-2)
    assert (found.position[times < 10.0 - H] == 0.0).all()
    assert found.status[round(9.0 / H)] == VALID
    assert found.status[-1] == DEGRADED
    off = found.position - np.interp(times + H, times, wall)
    late = (times > 12.0) & (times < 23.0)
    assert (off[late] - off[late].mean()).std() < 0.3e-3


def test_a_lesson_ends_in_prediction_and_begins_again_when_that_is_worth_no_more(native):
    times, wall = beating(native, 50.0, rate=1.0)
    tip = tracked(wall)
    tip[(times > 10.1) & (times < 26.0)] = 5e-3  # the gripper moves the tip
    found = estimated(native, tip, training_time=10.0, hold=15.0, rate_process_noise=2e-3, phase_process_noise=1e-2)
    assert (found.position[times < 10.0 - H] == 0.0).all()
    off = found.position - np.interp(times + H, times, wall)
    late = (times > 11.1) & (times < 24.0)
    assert (off[late] - off[late].mean()).std() < 0.4e-3
    assert (found.position[(times > 26.5) & (times < 35.9)] == 0.0).all()
    again = (times > 39.0) & (times < 49.0)
    assert (off[again] - off[again].mean()).std() < 0.4e-3


def test_a_search_needs_samples_of_now(native):
    times, wall = beating(native, 20.0, rate=1.0)
    gap = np.where((times > 12.0) & (times < 18.0), 2, 0)
    found = estimated(native, tracked(wall), status=gap, hold=0.5)
    assert (found.status[(times > 12.7) & (times < 18.0)] == LOST).all()


def test_the_same_instant_counts_once(native):
    _, wall = beating(native, 10.0)
    tip = tracked(wall)
    tip[1::2] = tip[::2]
    part, other = native(HeartMotion), native(HeartMotion)
    for each in (part, other):
        each.start(0.0)
    for k, place in enumerate(tip):
        part.tip_position[:] = place
        part.tip_age = H * (k % 2)
        part.advance(k * H, H)
        other.tip_position[:] = place if k % 2 == 0 else 1.0
        other.tip_status = 2 * (k % 2)
        other.advance(k * H, H)
    assert part.rate == pytest.approx(other.rate, rel=1e-2)
    assert part.deviation == pytest.approx(other.deviation, rel=0.05)  # counted twice: a quarter less


@pytest.mark.slow
@pytest.mark.parametrize("name", ["heart_wall_force", "heart_wall_ahead", "drive_faults"])
def test_no_controller_sees_the_heart(name):
    scenario = load_scenario(Path(__file__).parents[2] / f"scenarios/{name}.yaml")
    for case in scenario.variants:
        seen = {one.target.partition(".")[0] for one in case.connections if one.source.startswith("heart.")}
        assert seen == {"wall"}
        assert not any(member.component == "heart_estimate" for member in case.members.values())
