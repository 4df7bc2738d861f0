"""Numbers of curves from samples that are known, and the description of runs for a page."""

import numpy as np
import pytest

from tests.every_case import every_case
from tests.viewer.recorded import COUNT, FORCE, PLACE, SHAPE, folder_of, runs
from twin.errors import TwinError
from twin.viewer import curve_data, page_data
from twin.viewer.curve_data import BLOCK, KINDS, MAX_LOOP, statistics, values_at
from twin.viewer.runs import CurveSamples, ViewedCurve, interpolate

TIME = np.array([0.0, 1.0, 2.0, 3.0])


@every_case(
    ("window", "expected"),
    [
        ((0.5, 2.5), slice(0, 4)),
        ((1.0, 2.0), slice(0, 4)),
        ((1.1, 1.9), slice(1, 3)),
        ((-9.0, 0.0), slice(0, 2)),
        ((3.0, 9.0), slice(2, 4)),
        ((4.0, 9.0), slice(3, 4)),
        ((-9.0, -4.0), slice(0, 1)),
    ],
)
def test_samples_in_a_window_and_one_more_on_both_sides(window, expected):
    assert curve_data.inside(TIME, window) == expected


def test_infinite_values_become_gaps():
    x, y = curve_data.decimate(TIME, np.array([1.0, np.inf, -np.inf, 4.0]), 4)
    assert (x.tolist(), np.isnan(y).tolist(), y[[0, 3]].tolist()) == (
        TIME.tolist(),
        [False, True, True, False],
        [1.0, 4.0],
    )
    whole = np.arange(1000) % 7
    x, y = curve_data.decimate(np.arange(1000.0), whole, 100)
    assert (len(x) <= 100, set(y.tolist()) <= set(range(7)), y.min(), y.max()) == (True, True, 0, 6)
    gaps = np.sin(np.arange(1000.0))
    gaps[500:600] = np.nan
    x, y = curve_data.decimate(np.arange(1000.0), gaps, 100)
    assert len(x) <= 100
    assert np.isnan(y[(x > 520) & (x < 580)]).all()
    assert np.isfinite(y[x < 480]).all()


@pytest.mark.parametrize(("unit", "text"), [("N", "N²/Hz"), ("", "1/Hz"), ("m/s", "(m/s)²/Hz"), ("N²", "(N²)²/Hz")])
def test_units_of_densities(unit, text):
    assert curve_data.density_unit(unit) == text


def samples(time, y, **more):
    return CurveSamples(np.asarray(time, float), np.asarray(y), "m", **more)


def test_equidistant_samples():
    """Those that are, within 1 %, stay; others are interpolated; what is no number is bridged."""
    every = slice(None)
    time, y = curve_data.resample(samples([0, 1, 2.005, 3], [1.0, 2.0, 3.0, 4.0]), every)
    assert time.tolist() == [0, 1, 2.005, 3]
    time, y = curve_data.resample(samples([0, 1, 2, 4], [0.0, 10.0, 20.0, 40.0]), every)
    assert (time.tolist(), y.tolist()) == ([0, 1, 2, 3, 4], [0, 10, 20, 30, 40])
    time, y = curve_data.resample(samples([0, 1, 2, 3], [0.0, np.nan, np.inf, 30.0]), every)
    assert (time.tolist(), y.tolist()) == ([0.0, 3.0], [0.0, 30.0])
    time, y = curve_data.resample(samples([0, 1], [np.nan, 1.0]), every)
    assert (time.tolist(), y.tolist()) == ([1.0], [1.0])
    time, _ = curve_data.resample(samples([0, 1e-6, 2e-6, 1.0], [0.0] * 4), every)
    assert len(time) == 4 * 4 + 1  # no more than four times as many


def test_values_between_samples():
    real = samples(TIME, [0.0, 10.0, 20.0, 30.0])
    assert interpolate(np.array([0.5, 3.0, 9.0]), real).tolist() == [5.0, 30.0, 30.0]
    counts = samples(TIME, np.array([5, 6, 7, 8]), is_real=False)
    assert interpolate(np.array([-1.0, 0.0, 0.999, 1.0, 9.0]), counts).tolist() == [5, 5, 5, 6, 8]
    assert np.isnan(interpolate(np.array([0.0, 1.0]), samples([], []))).all()


def test_moments_of_blocks_together():
    """Whole blocks and a rest, merged, are those of all samples; what is no number is left out."""
    y = np.random.default_rng(2).standard_normal(2 * BLOCK + 10) + 3.0
    time = np.sort(np.random.default_rng(3).uniform(0.0, 9.0, len(y)))
    y[7], y[BLOCK + 1], y[-1] = np.nan, np.inf, -np.inf
    parts = curve_data.moments(time, y)
    finite = y[np.isfinite(y)]
    assert parts.shape == (3, 8)
    assert parts[:, 0].tolist() == [BLOCK - 1, BLOCK - 1, 9]
    merged = curve_data.merge_moments(parts)
    assert merged == pytest.approx(
        {
            "count": len(finite),
            "mean": finite.mean(),
            "std": finite.std(),
            "rms": np.sqrt(np.mean(finite**2)),
            "low": finite.min(),
            "high": finite.max(),
            "peak_to_peak": np.ptp(finite),
            "slope": np.polyfit(time[np.isfinite(y)], finite, 1)[0],
        }
    )
    assert curve_data.merge_moments(curve_data.moments(TIME[:3], np.full(3, np.nan))) == {"count": 0}
    assert curve_data.moments(time[:BLOCK], y[:BLOCK]).shape == (1, 8)
    nothing = [0.0, 0.0, 0.0, np.inf, -np.inf, 0.0, 0.0, 0.0]
    assert curve_data.moments_of_finite(np.zeros(1), np.array([np.nan])).tolist() == nothing
    pair = curve_data.moments_of_finite(np.array([0.0, 4.0]), np.array([1.0, 3.0]))
    assert pair.tolist() == [2.0, 2.0, 2.0, 1.0, 3.0, 2.0, 8.0, 4.0]


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    """A: two seeds of four samples, of which the second lacks `tip`; B: three samples, from 1 s on."""
    folder = tmp_path_factory.mktemp("data")
    first = {
        ("PI", 1): (
            TIME,
            {
                "sensor.force": TIME * 2.0,
                "tip.position": 1e-3 * TIME,
                "tip.shape": np.stack([TIME, -TIME], 1),
                "tip.count": np.arange(4),
            },
        ),
        ("PI", 2): (TIME, {"sensor.force": TIME * 4.0}),
    }
    second = {("FF", 1): (TIME[1:], {"sensor.force": TIME[1:] * 3.0})}
    return runs(
        folder_of(folder / "one", first, [FORCE, PLACE, SHAPE, COUNT]), folder_of(folder / "two", second, [FORCE])
    )


ALL = (-np.inf, np.inf)


def drawn(opened, kind, curve, window=ALL, points=100):
    line = KINDS[kind](opened, curve, window, points)
    return line.x.tolist(), line.y.tolist()


def test_curves_of_few_samples(opened):
    assert drawn(opened, "time", ViewedCurve("tip.position", 0)) == (TIME.tolist(), [0, 1, 2, 3])
    assert drawn(opened, "time", ViewedCurve("sensor.force", 0, minus=2)) == ([1, 2, 3], [-1, -2, -3])
    assert drawn(opened, "time", ViewedCurve("sensor.force", 0, minus=2, shift=1.0)) == ([2, 3], [1, 0])
    for part, values in (("mean", [0, 3, 6, 9]), ("low", [0, 2, 4, 6]), ("high", [0, 4, 8, 12])):
        assert drawn(opened, "time", ViewedCurve("sensor.force", 0, seeds=(0, 1), part=part))[1] == values
    x, y = drawn(opened, "xy", ViewedCurve("sensor.force", 0, x="tip.position"))
    assert (x, y) == ([0, 1, 2, 3], [0, 2, 4, 6])
    line = KINDS["xy"](opened, ViewedCurve("sensor.force", 0, x="tip.position"), (0.5, 0.6), 10)
    assert (line.x.tolist(), line.count, line.unit, line.x_unit) == ([0, 1], 2, "N", "mm")


@every_case(("samples", "revolutions"), [(10_000, 250), (200_000, 250)])
def test_the_drawn_loop_is_the_recorded_one(tmp_path, samples, revolutions):
    """Extremes of x and y alone are chords of a loop; all samples are drawn as long as a browser is fluent."""
    time = np.arange(samples) / 1000
    angle = 2 * np.pi * revolutions * np.arange(samples) / samples
    force, position = np.cos(angle) + 0.3 * np.sin(2 * angle), np.sin(angle)
    force[777], position[3333] = 5.0, -4.0
    case = {("base", 1): (time, {"sensor.force": force, "tip.position": position})}
    opened = runs(folder_of(tmp_path / f"loop{samples}", case, [FORCE, PLACE]))
    line = KINDS["xy"](opened, ViewedCurve("sensor.force", 0, x="tip.position"), ALL, 100)
    assert (line.y.max(), line.x.min() / 1e3, line.count) == (5.0, -4.0, samples)
    assert len(line.x) == samples if samples <= MAX_LOOP else len(line.x) <= MAX_LOOP
    begins = np.searchsorted(line.time, time, "right") - 1
    ends = np.minimum(begins + 1, len(line.time) - 1)
    a, b, point = (
        values[0] + 1j * values[1]
        for values in ((line.x[begins] / 1e3, line.y[begins]), (line.x[ends] / 1e3, line.y[ends]), (position, force))
    )
    along = np.clip(np.real((point - a) * np.conj(b - a)) / np.maximum(np.abs(b - a) ** 2, 1e-300), 0, 1)
    far = np.abs(a + along * (b - a) - point)
    far[[*range(737, 818), *range(3293, 3374)]] = 0.0  # both peaks
    assert np.max(far) < 0.03


def test_statistics_of_few_samples(opened):
    found = statistics(opened, ViewedCurve("sensor.force", 0), (1.0, 3.0))
    assert found == pytest.approx(
        {
            "count": 3,
            "mean": 4.0,
            "std": np.sqrt(8 / 3),
            "rms": np.sqrt(56 / 3),
            "low": 2.0,
            "high": 6.0,
            "peak_to_peak": 4.0,
            "unit": "N",
            "slope": 2.0,
            "rate": 1.0,
        }
    )
    one = statistics(opened, ViewedCurve("sensor.force", 0), (0.9, 1.1))
    assert (one["count"], one["slope"], one["rate"], one["std"]) == (1, None, None, 0.0)
    assert statistics(opened, ViewedCurve("sensor.force", 0), (1.1, 1.9)) == {"count": 0}
    assert values_at(opened, ViewedCurve("sensor.force", 2), [0.999, 1.0, 2.5, 3.0, 3.001]) == [
        None,
        3.0,
        7.5,
        9.0,
        None,
    ]


def test_spectra_need_sixteen_samples(tmp_path):
    time = np.arange(16.0)
    few = runs(folder_of(tmp_path / "few", {("a", 1): (time, {"sensor.force": np.sin(np.pi * time / 2)})}, [FORCE]))
    line = KINDS["spectrum"](few, ViewedCurve("sensor.force", 0), ALL, 100)
    assert (line.x.tolist(), line.count) == ((np.arange(1, 9) / 16).tolist(), 16)
    assert line.x[np.argmax(line.y)] == 0.25
    with pytest.raises(TwinError, match="14 samples in the window"):
        KINDS["spectrum"](few, ViewedCurve("sensor.force", 0), (0.0, 13.5), 100)


def test_runs_in_words(opened):
    """As a page gets them: letters, cases, and signals with the cases that recorded them."""
    about = page_data.about(opened)
    assert [(run["letter"], run["name"], run["title"], run["status"]) for run in about["runs"]] == [
        ("A", "one", "one", "completed"),
        ("B", "two", "two", "completed"),
    ]
    assert [case["label"] for case in about["cases"]] == ["A: PI, seed 1", "A: PI, seed 2", "B: FF, seed 1"]
    assert [(case["begin"], case["end"], case["samples"]) for case in about["cases"]] == [
        (0, 3, 4),
        (0, 3, 4),
        (1, 3, 3),
    ]
    assert about["signals"] == [
        {"name": "sensor.force", "unit": "N", "about": "contact <force>", "cases": "all"},
        {"name": "tip.position", "unit": "mm", "about": "", "cases": [0]},
        {"name": "tip.shape[1]", "unit": "m", "about": "", "cases": [0]},
        {"name": "tip.shape[2]", "unit": "m", "about": "", "cases": [0]},
        {"name": "tip.count", "unit": "", "about": "", "cases": [0]},
    ]
    assert (about["growing"], about["expectations"], about["metrics"], about["events"], about["plots"]) == (
        False,
        [],
        [],
        [],
        [],
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page_data, "MAX_SIGNALS", 2)
        assert [signal["name"] for signal in page_data.signals(opened)] == ["sensor.force", "tip.position"]
    assert (opened.growing, opened.refresh(), opened.progress()["over"]) == ([], False, False)
    assert opened.progress()["cases"] == [[0, 3, 4], [0, 3, 4], [1, 3, 3]]


@pytest.mark.parametrize("count", [7, 3 * BLOCK + 5])
def test_a_constant_has_no_deviation(tmp_path, count):
    """The mean of equal numbers, as a sum over their count, differs from them: the deviation was 1.8e-15."""
    time = np.arange(count) * 1e-3
    place = folder_of(tmp_path / "run", {("PI", 1): (time, {"sensor.force": np.full(count, 6.767)})}, [FORCE])
    found = statistics(runs(place), ViewedCurve("sensor.force", 0), (0.0, 100.0))
    assert (found["mean"], found["std"], found["peak_to_peak"]) == (6.767, 0.0, 0.0)
