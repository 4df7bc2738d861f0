"""Figures of a prediction by hand: errors, quantiles, bands, limits of the consistency test, and where they are left."""

import numpy as np
import pytest
from scipy import stats

from tests.every_case import every_case
from twin.validation import figures
from twin.validation.figures import Disagreement, Limits


def test_summary_of_an_error():
    assert figures.summary(np.array([1.0, -5.0, 1.0, 3.0])) == {"rmse": 3.0, "mean_error": 0.0, "largest": 5.0}


def test_means_of_twentieths():
    assert figures.block_means(np.array([3.0, -1.0, 4.0])).tolist() == [3.0, -1.0, 4.0]  # of a short run each row
    assert figures.block_means(np.arange(20.0)).tolist() == list(range(20))
    assert figures.block_means(np.arange(40.0)).tolist() == [2 * k + 0.5 for k in range(20)]
    error = np.arange(45.0) ** 2  # parts of two and three rows, none left out
    parts = [error[k * 45 // 20 : (k + 1) * 45 // 20] for k in range(20)]
    assert figures.block_means(error) == pytest.approx([float(np.mean(part)) for part in parts])
    assert figures.statistics(error)[:3] == pytest.approx((44 * 89 / 6, 0.5, (42**2 + 43**2 + 44**2) / 3))
    assert figures.statistics(-error)[1:3] == pytest.approx((-0.5, (42**2 + 43**2 + 44**2) / 3))
    assert figures.statistics(np.zeros(30)) == (0.0, 0.0, 1e-12, 1e-12)  # have logarithms


def test_change_of_the_mean_error_at_a_time():
    """Six parts; the first and the last alone are no side."""
    assert figures.changes(np.array([9.0, 1.0, 1.0, 4.0, 4.0, 0.0])) == pytest.approx([0, 0, -2.75, -1, -1.75, 0])
    assert figures.changes(np.array([0.0, 0.0, 5.0])).tolist() == [0.0, 0.0, 0.0]
    assert figures.statistics(np.repeat([-1.0, 3.0], 50))[3] == pytest.approx(4.0)


def test_band_of_one_fold_is_its_quantile():
    own = figures.band([np.linspace(0, 2, 1001)], 0.9)
    assert own.half_width == pytest.approx(1.8, rel=1e-3)
    assert own.coverages == []


def test_band_holds_the_share_of_folds_on_average():
    """Errors up to 1 and up to 2: at level L the band of the other fold holds 2 L, at most all, and L / 2 of a fold.

    For 70 % of both L is 0.8; of all errors 80 % are below 1.2.
    """
    own = figures.band([np.linspace(0, 1, 2001), np.linspace(0, 2, 2001)], 0.7)
    assert own.half_width == pytest.approx(1.2, rel=5e-3)
    assert own.coverages == pytest.approx([1.0, 0.4], abs=5e-3)


def test_band_counts_folds_and_samples_alike():
    """As above, but the fold with errors up to 2 is three times as long: (1 + L / 2) / 2 of folds, (1 + 3 L / 2) / 4 of samples.

    The mean of both is 65 % at L = 0.88.
    """
    own = figures.band([np.linspace(0, 1, 2001), np.linspace(0, 2, 6003)], 0.65)
    assert own.coverages == pytest.approx([1.0, 0.44], abs=5e-3)


def test_deviation_of_a_new_run_is_students_prediction_interval():
    values = np.array([[1.0], [2.0], [6.0], [3.0]])
    expected = stats.t.ppf(0.975, 3) * np.std(values, ddof=1) * np.sqrt(1 + 1 / 4)
    assert figures.deviation(values, 0.975) == pytest.approx(expected)


def test_deviation_of_a_part_has_variance_between_and_within_folds():
    """Means 2 and 4: 1.5 times 2 between. Variances 2 and 8: half of 5 within. Freedom: 5.5^2 / (3^2 / 1 + 2.5^2 / 2)."""
    expected = stats.t.ppf(0.9, 5.5**2 / (9 + 3.125)) * np.sqrt(5.5)
    assert figures.deviation(np.array([[1.0, 3.0], [2.0, 6.0]]), 0.9) == pytest.approx(expected)
    assert figures.deviation(np.array([[1.0, 3.0], [1.0, 3.0]]), 0.9) == pytest.approx(stats.t.ppf(0.9, 2))


STATISTICS = np.array(
    [
        [[[1.0, 4.0, 2.0, 3.0], [0.1, 0.0, 1.0, 0.2]]],
        [[[3.0, 0.0, 8.0, 12.0], [0.3, 0.4, 1.0, 0.2]]],
        [[[2.0, 2.0, 4.0, 6.0], [0.2, 0.8, 1.0, 0.2]]],
    ]
)


def test_limits_are_each_at_a_quarter_of_the_rate_of_an_output():
    """Three folds, one part each, two outputs. Mean and start deviate on both sides, the largest ones on one."""
    center, limit = figures.center_and_limit(STATISTICS, 0.08)
    assert center == pytest.approx(np.array([[2.0, 2.0, 0.0, 0.0], [0.2, 0.4, 0.0, 0.0]]))
    both, one = stats.t.ppf(1 - 0.005, 2), stats.t.ppf(1 - 0.01, 2)
    width = np.sqrt(4 / 3)
    largest = np.exp(np.log(4) + one * np.log(2) * width)
    assert limit == pytest.approx(
        np.array(
            [
                [both * width, 2 * both * width, largest, 1.5 * largest],
                [0.1 * both * width, 0.4 * both * width, 1, 0.2],
            ]
        )
    )


def test_limits_that_do_not_scatter_are_not_zero():
    _, limit = figures.center_and_limit(np.tile([0.0, 0.0, 1e-12, 1e-12], (3, 1, 1, 1)), 0.05)
    assert limit == pytest.approx(np.full((1, 4), 1e-12))


@every_case(
    ("lengths", "rows"),
    [
        ([64, 40, 33], [33, 16, 8]),
        ([64, 32, 90], [32, 16, 8]),
        ([31, 64, 64], [31, 15]),
        ([7, 20, 20], [7]),
        ([2100, 2060, 2050], [2050, 1025, 512, 256, 128, 64, 32, 16]),  # eight lengths at most
        ([64, 64], []),
    ],
)
def test_lengths_of_runs_with_own_limits(lengths, rows):
    generator = np.random.default_rng(1)
    every = figures.limits([generator.normal(0, 1, (length, 1)) for length in lengths], 0.05)
    assert [[own.rows for own in output] for output in every] == [rows]


def limits_of(own):
    return [own.offset_limit, own.start_limit, own.peak_limit, own.change_limit]


def constant_folds(values, rows=40):
    return [np.stack([np.full(rows, x), np.full(rows, 10 * x + 1)], 1) for x in values]


def test_limits_from_three_folds_are_not_widened():
    folds = constant_folds([1.0, 2.0, 4.0])
    values = np.array([[[(x, x, x, 1e-12), (*(10 * x + 1,) * 3, 1e-12)]] for x in (1.0, 2.0, 4.0)])
    center, limit = figures.center_and_limit(values, 0.5)
    for i, own in enumerate(figures.limits_of_parts(folds, 1, 40, 0.5)):
        assert (own.rows, own.offset, own.start) == (40, pytest.approx(center[i, 0]), pytest.approx(center[i, 1]))
        assert limits_of(own) == pytest.approx(limit[i])


@every_case(("rate", "rank"), [(0.5, 3), (0.34, 4), (0.33, 5), (0.17, 5), (0.16, None)])
def test_limits_are_widened_to_the_stated_rate_of_left_out_folds(rate, rank):
    """Five folds, the last one far off: the `rank`-th of six equally likely places is the first at this rate."""
    offsets = (1.0, 1.3, 0.9, 1.2, 30.0)
    values = np.array([[[(x, x, x, 1e-12), (*(10 * x + 1,) * 3, 1e-12)]] for x in offsets])
    scores = []
    for k in range(5):
        center, limit = figures.center_and_limit(np.delete(values, k, axis=0), rate)
        scores.append(float(np.max(np.abs(values[k, 0] - center) / limit)))
    widening = 1.0 if rank is None else max(1.0, sorted(scores)[rank - 1])
    assert sorted(scores)[4] > 1.0
    center, limit = figures.center_and_limit(values, rate)
    for i, own in enumerate(figures.limits_of_parts(constant_folds(offsets), 1, 40, rate)):
        assert limits_of(own) == pytest.approx(widening * limit[i])
        assert [own.offset, own.start] == pytest.approx(center[i, :2])


def test_limits_of_halves_have_the_statistics_of_halves():
    folds = [np.repeat([[x], [x + y]], 20, axis=0) for x, y in ((0.0, 1.0), (1.0, 2.0), (2.0, 4.0))]
    (own,) = figures.limits_of_parts(folds, 2, 20, 0.1)
    halves = [[(x, x, max(x, 1e-12), 1e-12), (*(x + y,) * 3, 1e-12)] for x, y in ((0, 1), (1, 2), (2, 4))]
    values = np.array(halves, float)[:, :, None]
    center, limit = figures.center_and_limit(values, 0.1)
    assert own.offset == pytest.approx(13 / 6) == center[0, 0]
    assert limits_of(own) == pytest.approx(limit[0])


def of_rows(rows, **values):
    return Limits(
        **{
            "rows": rows,
            "offset": 1.0,
            "offset_limit": 2.0,
            "start": 0.5,
            "start_limit": 3.0,
            "peak_limit": 6.0,
            "change_limit": 4.5,
            **values,
        }
    )


@every_case(("rows", "chosen"), [(100, 40), (40, 40), (39, 20), (20, 20), (10, 10), (3, 10)])
def test_limits_are_those_of_the_longest_parts_that_are_not_longer(rows, chosen):
    assert figures.limits_for(rows, [of_rows(40), of_rows(20), of_rows(10)]).rows == chosen


def errors(*changes, base=1.0):
    """An error over 40 rows, twentieths of two rows each; `changes`: rows, value."""
    error = np.full(40, base)
    for rows, value in changes:
        error[rows] = value
    return error


@every_case(
    ("error", "failure"),
    [
        (errors(base=1.0), None),
        (errors(base=3.0), None),  # 2 from the center: at the limit
        (errors(base=3.25), (0.0, -3.25, 2.0)),
        (errors(base=-1.5), (0.0, 1.5, 2.0)),
        (errors((slice(20, 40), 5.25)), (10.0, -3.125, 2.0)),  # the mean is off, from the middle on
        (errors((slice(20, 40), 5.0)), None),
        (errors((slice(20, 40), -3.75)), (10.0, 3.75, 4.5)),  # changes in the middle
        (errors((slice(20, 40), -1.25), base=3.25), None),  # a change at the limit
        (errors((slice(0, 2), 3.5)), None),  # the start is 3 from its center
        (errors((slice(0, 2), 4.0)), (0.0, -4.0, 3.0)),  # a deviation that ends with the start
        (errors((slice(0, 2), -2.75)), (0.0, 2.75, 3.0)),
        (errors(base=3.75), (0.0, -3.75, 3.0)),  # the start is off, as all that follows
        (errors((slice(10, 12), 6.0)), None),  # a part at the limit
        (errors((slice(10, 12), 7.0), (slice(20, 22), -8.0)), (5.0, 0.5, 6.0)),
        (errors((slice(38, 40), -7.0)), (19.0, 7.0, 6.0)),
    ],
)
def test_where_a_run_leaves_its_limits(error, failure):
    found = figures.disagreement("angle", error, 0.5 * np.arange(40), [of_rows(20)])
    assert found == (failure and Disagreement("angle", *failure))


def test_a_short_run_has_the_limits_of_short_runs():
    every = [of_rows(20), of_rows(10, offset_limit=5.0, start_limit=9.0)]
    assert figures.disagreement("angle", np.full(19, 5.5), np.arange(19.0), every) is None
    assert figures.disagreement("angle", np.full(20, 5.5), np.arange(20.0), every) == Disagreement(
        "angle", 0.0, -5.5, 3.0
    )


def test_parts_of_all_outputs_are_counted(monkeypatch):
    """Runs of 40, 40, 40 and 95 rows of two outputs; parts of the longest that are left over do not count."""
    folds = [np.stack([np.zeros(n), np.full(n, x)], 1) for n, x in ((40, 0.0), (40, 1.0), (40, 7.0), (95, 0.0))]
    limits = {0: [of_rows(40), of_rows(20)], 1: [of_rows(40, offset=0.0, peak_limit=90.0), of_rows(20, offset=0.0)]}
    monkeypatch.setattr(figures, "limits", lambda others, _rate: [limits[0], limits[1]] if len(others) == 3 else None)
    assert figures.false_alarms(folds, 0.05) == [
        {"rows": 40, "parts": 3 + 2, "alarms": 1},
        {"rows": 20, "parts": 3 * 2 + 4, "alarms": 2},
    ]
