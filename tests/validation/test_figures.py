"""Bands and the consistency test keep the rates that they state."""

import numpy as np
import pytest

from twin.validation.figures import area, band, disagreement, limits

TIME = np.linspace(0, 10, 400)


def errors(generator, count):
    """Errors of runs of one population: an offset per run, a slow wave, and noise."""
    return [
        generator.normal(0, 0.3) + 0.2 * np.sin(TIME + generator.uniform(0, 6)) + generator.normal(0, 0.3, len(TIME))
        for _ in range(count)
    ]


@pytest.mark.slow
def test_rate_of_false_alarms():
    """At a stated rate of 5 %, of 600 good runs; power against an offset of six times the spread."""
    alarms = misses = 0
    for seed in range(600):
        generator = np.random.default_rng(seed)
        *folds, run = errors(generator, 6)
        own = limits(folds, 0.05)
        alarms += disagreement("angle", run, TIME, own) is not None
        misses += disagreement("angle", run + 5, TIME, own) is None
    assert alarms / 600 < 0.07
    assert misses / 600 < 0.05


def test_too_few_runs_give_no_limits():
    assert limits(errors(np.random.default_rng(1), 2), 0.05) is None


@pytest.mark.slow
@pytest.mark.parametrize("count", [5, 12])
def test_band_holds_its_share_of_new_runs(count):
    shares = []
    for seed in range(100):
        *folds, run = errors(np.random.default_rng(seed), count + 1)
        own = band([np.abs(fold) for fold in folds], 0.9)
        assert np.mean(own.coverages) == pytest.approx(0.9, abs=0.02)
        shares.append(np.mean(np.abs(run) <= own.half_width))
    assert 0.85 <= np.mean(shares) <= 0.95


def test_area_of_a_shift_is_the_shift():
    values = np.random.default_rng(0).normal(0, 1, 500)
    assert area(values + 0.7, values) == pytest.approx(0.7)
