"""Bands and the consistency test keep the rates that they state."""

import numpy as np
import pytest

from twin.validation.figures import area, band, deviation, disagreement, false_alarms, limits, pooled_quantile

TIME = np.linspace(0, 10, 400)


def errors(generator, count):
    """Errors of runs of one population: an offset per run, a slow wave, and noise."""
    return [
        generator.normal(0, 0.3) + 0.2 * np.sin(TIME + generator.uniform(0, 6)) + generator.normal(0, 0.3, len(TIME))
        for _ in range(count)
    ]


@pytest.mark.slow
def test_rate_of_false_alarms():
    """At a stated rate of 5 %, of 300 good runs; power against an offset of six times the spread."""
    alarms = misses = 0
    for seed in range(300):
        generator = np.random.default_rng(seed)
        *folds, run = errors(generator, 6)
        (own,) = limits([fold[:, None] for fold in folds], 0.05)
        alarms += disagreement("angle", run, TIME, own) is not None
        misses += disagreement("angle", run + 5, TIME, own) is None
    assert alarms / 300 < 0.07
    assert misses / 300 < 0.05


def test_folds_weigh_equally_in_a_pooled_quantile():
    """Errors of 0 to 1 in a short fold, of 1 to 2 in a long one: half of them are below 1."""
    folds = [np.linspace(0, 1, 11), np.linspace(1, 2, 1001)]
    assert [pooled_quantile(folds, level) for level in (0.0, 0.25, 0.5, 1.0)] == pytest.approx([0, 0.5, 1, 2], abs=1e-2)


@pytest.mark.parametrize("parts", [1, 4])
def test_a_part_of_another_fold_deviates_less_as_often_as_stated(parts):
    """Offsets of 5 folds and scatter of their parts; with one part it is Student's t of a new observation."""
    generator, inside = np.random.default_rng(2), []
    for _ in range(1000):
        values = generator.normal(0, 0.5, (6, 1)) + generator.normal(0, 1, (6, parts))
        bound = deviation(values[:5], 0.95)
        inside.append(values[5, 0] - values[:5].mean() < bound)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.02)
    assert deviation(1e3 * values, 0.95) == pytest.approx(1e3 * deviation(values, 0.95))
    assert deviation(np.ones((5, parts)), 0.95) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("rows", [200, 60, 20])
def test_rate_of_false_alarms_of_parts_of_runs(rows):
    """Shorter runs scatter more; their limits are those of parts of the known runs."""
    alarms = 0
    for seed in range(100):
        *folds, run = errors(np.random.default_rng(seed), 6)
        begin = seed % (len(run) - rows)
        part = slice(begin, begin + rows)
        (own,) = limits([fold[:, None] for fold in folds], 0.05)
        alarms += disagreement("angle", run[part], TIME[part], own) is not None
    assert alarms / 100 <= 0.08


def test_false_alarms_are_counted_for_parts_of_each_fold():
    """The last of five runs is off by six times the spread: all of its parts are flagged, hardly any other."""
    folds = [run[:, None] for run in errors(np.random.default_rng(3), 5)]
    folds[4] = folds[4] + 6
    whole, halves, *_ = false_alarms(folds, 0.05)
    assert whole == {"rows": 400, "parts": 5, "alarms": 1}
    assert halves == {"rows": 200, "parts": 10, "alarms": 2}


def test_too_few_runs_give_no_limits():
    assert limits([run[:, None] for run in errors(np.random.default_rng(1), 2)], 0.05) == [[]]


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
