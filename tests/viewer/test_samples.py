"""What is drawn is what was recorded: columns, extremes, differences, spectra, in the units that are shown."""

from dataclasses import replace

import numpy as np
import pytest
from pyarrow import parquet
from scipy.signal import welch

from tests.viewer.recorded import COUNT, FORCE, PLACE, SHAPE, TOUCH, folder_of, runs, wave
from twin.errors import TwinError
from twin.results import RecordedVariable
from twin.viewer.curve_data import KINDS, statistics, values_at
from twin.viewer.requests import lines
from twin.viewer.runs import ViewedCurve

ALL = (-np.inf, np.inf)


def over_time(opened, curve, window=ALL, points=4000):
    return KINDS["time"](opened, curve, window, points)


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    """A: two cases at 1 kHz, of which one lacks `tip`; B: one of them again, other values, at 300 Hz."""
    folder = tmp_path_factory.mktemp("runs")
    time, force = wave(1000.0, 2.0)
    other, weaker = wave(300.0, 1.5, amplitude=1.5)
    own = {
        "tip.position": 1e-3 * force,
        "tip.shape": np.stack([force, -force], 1),
        "tip.touches": force > 1,
        "tip.count": np.arange(len(time)) // 100,
    }
    columns = [FORCE, PLACE, SHAPE, TOUCH, COUNT]
    first = {("PI", 1): (time, {"sensor.force": force, **own}), ("PI", 2): (time, {"sensor.force": 2 * force})}
    return runs(
        folder_of(folder / "first", first, columns),
        folder_of(folder / "second", {("PI", 1): (other, {"sensor.force": weaker})}, [FORCE]),
    )


def test_a_column_is_what_was_recorded(opened):
    time, force = wave(1000.0, 2.0)
    line = over_time(opened, ViewedCurve("sensor.force", 1))
    assert (line.unit, line.count) == ("N", len(time))
    np.testing.assert_array_equal(line.x, time)
    np.testing.assert_array_equal(line.y, 2 * force)
    np.testing.assert_array_equal(over_time(opened, ViewedCurve("tip.shape[2]", 0)).y, -force)


def test_values_are_shown_in_the_unit_that_is_shown(opened):
    _, force = wave(1000.0, 2.0)
    line = over_time(opened, ViewedCurve("tip.position", 0))
    assert line.unit == "mm"
    np.testing.assert_allclose(line.y, force, rtol=1e-15)
    line = over_time(opened, ViewedCurve("abs(tip.position) - 0.001", 0))
    assert line.unit == "mm"
    np.testing.assert_allclose(line.y, np.abs(force) - 1, rtol=1e-12, atol=1e-12)


def test_what_is_no_real_number_stays_until_the_next_sample(opened):
    assert values_at(opened, ViewedCurve("tip.count", 0), [0.1999, 0.2]) == [1.0, 2.0]
    touches = over_time(opened, ViewedCurve("tip.touches", 0))
    assert touches.is_boolean
    assert set(touches.y) == {0.0, 1.0}
    half = values_at(opened, ViewedCurve("sensor.force", 0), [0.0005, 7.0])
    assert half == [pytest.approx(np.sin(2 * np.pi * 3e-3)), None]


def test_an_array_and_a_missing_signal_are_refused_in_words(opened):
    for signal, told in (
        ("tip.shape", "tip.shape is an array of 2"),
        ("tip.shap", "'tip.shap' was not recorded. Did you mean"),
        ("tip.shape[3]", "tip.shape[3] has no such element"),
        ("sensor.force + tip.position", "`sensor.force` is in N, `tip.position` is in m"),
        ("import os", "is not an expression"),
    ):
        with pytest.raises(TwinError, match="^.*" + told.replace("[", r"\[").replace("+", r"\+")):
            over_time(opened, ViewedCurve(signal, 0))
    with pytest.raises(TwinError, match=r"PI, seed 2 has not recorded tip\.position"):
        over_time(opened, ViewedCurve("tip.position", 1))


def test_runs_differ_at_the_times_of_the_first(opened):
    time, force = wave(1000.0, 2.0)
    other, weaker = wave(300.0, 1.5, amplitude=1.5)
    line = over_time(opened, ViewedCurve("sensor.force", 0, minus=2))
    both = time <= other[-1]
    np.testing.assert_array_equal(line.x, time[both])
    np.testing.assert_allclose(line.y, force[both] - np.interp(time[both], other, weaker), atol=1e-12)
    later = over_time(opened, ViewedCurve("sensor.force", 0, minus=2, shift=0.25))
    assert (later.x[0], later.x[-1]) == (0.25, pytest.approx(0.25 + other[-1], abs=1e-3))
    np.testing.assert_allclose(later.y[0], np.interp(0.25, time, force) - weaker[0])
    assert not over_time(opened, ViewedCurve("sensor.force", 0, minus=0)).y.any()


def test_differences_of_seeds_are_a_mean_between_lowest_and_highest(opened):
    _, force = wave(1000.0, 2.0)
    both = ViewedCurve("sensor.force", 1, minus=0, seeds=(1, 0), partners=(0, 1))  # force and -force
    np.testing.assert_allclose(over_time(opened, both).y, np.zeros(len(force)), atol=1e-12)
    parts = [over_time(opened, replace(both, part=part)).y for part in ("low", "high")]
    np.testing.assert_allclose(parts, [-np.abs(force), np.abs(force)], atol=1e-12)


def test_seeds_are_a_mean_between_lowest_and_highest(opened):
    time, force = wave(1000.0, 2.0)
    seeds = (0, 1)  # once and twice the same
    for part, factor in (
        ("mean", 1.5 * force),
        ("low", np.minimum(force, 2 * force)),
        ("high", np.maximum(force, 2 * force)),
    ):
        line = over_time(opened, ViewedCurve("sensor.force", 0, seeds=seeds, part=part))
        np.testing.assert_array_equal(line.x, time)
        np.testing.assert_allclose(line.y, factor, atol=1e-15)
    longer = over_time(opened, ViewedCurve("sensor.force", 0, seeds=(0, 2)))  # of two runs, one shorter
    np.testing.assert_array_equal(longer.y[time > 1.5], force[time > 1.5])


def test_statistics_are_those_of_the_samples_in_the_window(opened):
    time, force = wave(1000.0, 2.0)
    inside = 1e3 * 1e-3 * force[(time >= 0.1) & (time <= 0.35)]
    found = statistics(opened, ViewedCurve("tip.position", 0), (0.1, 0.35))
    assert (found["unit"], found["count"], found["rate"]) == ("mm", 251, pytest.approx(1000.0))
    expected = {"mean": np.mean, "std": np.std, "low": np.min, "high": np.max, "peak_to_peak": np.ptp}
    for name, reduce in expected.items():
        assert found[name] == pytest.approx(reduce(inside))
    assert found["rms"] == pytest.approx(np.sqrt(np.mean(inside**2)))
    assert found["slope"] == pytest.approx(np.polyfit(time[(time >= 0.1) & (time <= 0.35)], inside, 1)[0])
    assert statistics(opened, ViewedCurve("tip.position", 0), (7.0, 8.0)) == {"count": 0}


def test_statistics_of_many_blocks_leave_out_what_is_no_number(tmp_path):
    time = np.arange(20_000) / 1e3
    force = 1e6 + np.random.default_rng(1).standard_normal(len(time))
    force[[5000, 9000]] = np.nan, np.inf
    opened = runs(folder_of(tmp_path / "run", {("a", 1): (time, {"sensor.force": force})}, [FORCE]))
    for begin, end in ((0, 20_000), (3000, 14_001), (4096, 8192), (10, 300)):
        found = statistics(opened, ViewedCurve("sensor.force", 0), (time[begin], time[end - 1]))
        inside = force[begin:end][np.isfinite(force[begin:end])]
        assert (found["count"], found["low"], found["high"]) == (len(inside), inside.min(), inside.max())
        assert (found["mean"], found["std"]) == (pytest.approx(inside.mean()), pytest.approx(inside.std(), rel=1e-9))
        line = np.polyfit(time[begin:end][np.isfinite(force[begin:end])] - time[begin], inside - 1e6, 1)
        assert found["slope"] == pytest.approx(line[0], rel=1e-6)


def test_the_slope_is_that_of_the_line_whatever_the_phase_of_the_beat(tmp_path):
    """At irregular times: 0.1 N/s below a beat of 2 N, which first and last sample would make ten times as steep."""
    time = np.sort(np.random.default_rng(1).uniform(0.0, 10.25, 9000))
    force = 0.1 * time + 2.0 * np.sin(2 * np.pi * time)
    opened = runs(folder_of(tmp_path / "run", {("a", 1): (time, {"sensor.force": force})}, [FORCE]))
    found = statistics(opened, ViewedCurve("sensor.force", 0), ALL)
    assert found["slope"] == pytest.approx(np.polyfit(time, force, 1)[0])
    assert found["slope"] == pytest.approx(0.1, abs=0.06)
    assert statistics(opened, ViewedCurve("0 * sensor.force", 0), ALL)["slope"] == 0.0
    assert statistics(opened, ViewedCurve("sensor.force", 0), (time[7], time[7]))["slope"] is None


def test_points_of_many_samples_are_samples(tmp_path):
    time = np.arange(100_000) / 1e3
    force = np.random.default_rng(1).standard_normal(len(time))
    opened = runs(folder_of(tmp_path / "run", {("a", 1): (time, {"sensor.force": force})}, [FORCE]))
    line = over_time(opened, ViewedCurve("sensor.force", 0), ALL, 500)
    assert len(line.x) <= 500
    np.testing.assert_array_equal(line.y, force[np.searchsorted(time, line.x)])
    assert (line.y.min(), line.y.max()) == (force.min(), force.max())


@pytest.mark.parametrize("window", [ALL, (0.5, 2.0)])
def test_a_spectrum_holds_the_power(opened, window):
    """Parseval: the area below the density of a sine of amplitude 2 N is its mean square, 2 N²; its peak is at 3 Hz."""
    line = KINDS["spectrum"](opened, ViewedCurve("sensor.force", 0), window, 4000)
    assert line.x[-1] == pytest.approx(500.0, rel=0.01)  # half the sampling rate
    assert (line.unit, line.x_unit) == ("N²/Hz", "Hz")
    assert np.trapezoid(line.y, line.x) == pytest.approx(2.0, rel=0.05)
    assert line.x[np.argmax(line.y)] == pytest.approx(3.0, abs=1.3)
    with pytest.raises(TwinError, match=r"3 samples in the window; a spectrum needs 16\. Show more time\."):
        KINDS["spectrum"](opened, ViewedCurve("sensor.force", 0), (0.001, 0.0035), 4000)


def test_one_quantity_over_another(opened):
    line = KINDS["xy"](opened, ViewedCurve("sensor.force", 0, x="tip.position"), (0.0, 0.3), 4000)
    assert (line.x_unit, line.unit) == ("mm", "N")
    np.testing.assert_allclose(line.x, line.y, atol=1e-12)


def test_a_difference_is_drawn_over_a_quantity_of_its_own_case(tmp_path):
    time, force = wave(1000.0, 1.0)
    cases = {("PI", k): (time, {"sensor.force": k * force, "tip.position": k * time}) for k in (1, 3)}
    opened = runs(folder_of(tmp_path / "run", cases, [FORCE, PLACE]))
    line = KINDS["xy"](opened, ViewedCurve("sensor.force", 1, minus=0, x="tip.position"), ALL, 4000)
    np.testing.assert_allclose(line.x, 3e3 * time)
    np.testing.assert_allclose(line.y, 2 * force)


def test_a_spectrum_is_of_the_samples_in_the_window(tmp_path):
    time = np.concatenate([np.arange(500) / 1000.0, [5.0]])  # then a gap
    force = np.random.default_rng(1).standard_normal(501)
    opened = runs(folder_of(tmp_path / "run", {("PI", 1): (time, {"sensor.force": force})}, [FORCE]))
    line = KINDS["spectrum"](opened, ViewedCurve("sensor.force", 0), (0.1, 0.6), 4000)
    frequency, density = welch(force[100:500], 1000.0, nperseg=266)
    assert line.count == 400
    np.testing.assert_allclose(line.x, frequency[1:])
    np.testing.assert_allclose(line.y, density[1:])


@pytest.mark.parametrize("order", [1, -1])
def test_a_name_with_a_blank_is_the_same_signal(tmp_path, order):
    time = np.arange(100) / 100.0
    temperature = RecordedVariable("motor.temperature", unit="degC")
    opened = runs(folder_of(tmp_path / "run", {("PI", 1): (time, {temperature.name: 20 + time})}, [temperature]))
    for name in [" motor.temperature", "motor.temperature"][::order]:
        np.testing.assert_allclose(over_time(opened, ViewedCurve(name, 0)).y, 20 + time)


def test_statistics_of_a_difference_follow_the_recording_that_grows(tmp_path):
    """What is subtracted goes on: the moments of its blocks are no longer those of the difference."""
    time, force = wave(1000.0, 9.0)
    folders = [
        folder_of(tmp_path / name, {("PI", 1): (time, {"sensor.force": own})}, [FORCE])
        for name, own in (("first", force), ("second", 0 * force), ("later", 0 * force + 1.0))
    ]
    opened, curve = runs(*folders[:2]), ViewedCurve("sensor.force", 0, minus=1)
    assert statistics(opened, curve, ALL)["mean"] == pytest.approx(force.mean())
    opened.cache.forget(opened.runs[1].recording.path)
    opened.runs[1].recording.file = runs(folders[2]).runs[0].recording.file
    assert statistics(opened, curve, ALL)["mean"] == pytest.approx(force.mean() - 1.0)


@pytest.mark.slow
def test_no_peak_is_lost(tmp_path):
    """A single sample among a million is seen at every zoom, and what is not a number is a gap."""
    time = np.arange(1_000_000) / 1e4
    force = 0.01 * np.sin(time)
    force[777_777], force[123_456] = 5.0, -5.0
    force[400_000:500_000] = np.nan
    opened = runs(folder_of(tmp_path / "long", {("base", 1): (time, {"sensor.force": force})}, [FORCE]))
    for window in (ALL, (77.0, 78.5)):
        line = over_time(opened, ViewedCurve("sensor.force", 0), window, 1000)
        assert len(line.x) <= 1000
        assert (np.nanmax(line.y), abs(line.x[np.nanargmax(line.y)] - 77.7777) < 0.11) == (5.0, True)
    whole = over_time(opened, ViewedCurve("sensor.force", 0), ALL, 1000)
    assert whole.y[np.isfinite(whole.y)].min() == -5.0
    assert np.isnan(whole.y[(whole.x > 40.2) & (whole.x < 49.8)]).all()


def test_nothing_is_read_before_it_is_looked_at_and_nothing_twice(tmp_path, monkeypatch):
    time, force = wave(1000.0, 2.0)
    opened = runs(
        folder_of(
            tmp_path / "lazy",
            {("a", 1): (time, {"sensor.force": force}), ("a", 2): (time, {"sensor.force": force})},
            [FORCE],
        )
    )
    read = []
    file = opened.runs[0].recording.file

    class Counted:
        def __getattr__(self, name):
            return getattr(file, name)

        def read_row_group(self, group, columns):
            read.append((group, *columns))
            return file.read_row_group(group, columns=columns)

    monkeypatch.setattr(opened.runs[0].recording, "file", Counted())
    assert [(one.begin, one.end, one.samples) for one in opened.cases] == [(0.0, time[-1], len(time))] * 2
    assert read == []
    for window in (ALL, (0.5, 0.6)):
        over_time(opened, ViewedCurve("sensor.force", 1), window)
    assert sorted(read) == [(1, "sensor.force"), (1, "time")]


def test_cases_that_share_a_row_group_are_told_apart(tmp_path):
    time, force = wave(100.0, 1.0)
    cases = {("a", 1): (time, {"sensor.force": force}), ("b", 1): (time[:50], {"sensor.force": -force[:50]})}
    opened = runs(folder_of(tmp_path / "mixed", cases, [FORCE], together=True))
    assert parquet.ParquetFile(tmp_path / "mixed/signals.parquet").num_row_groups == 1
    assert [(one.variant, one.samples, one.end) for one in opened.cases] == [("a", 100, 0.99), ("b", 50, 0.49)]
    np.testing.assert_array_equal(over_time(opened, ViewedCurve("sensor.force", 1)).y, -force[:50])


def test_what_does_not_fit_is_read_again(tmp_path):
    time, force = wave(1000.0, 2.0)
    opened = runs(folder_of(tmp_path / "cache", {("a", 1): (time, {"sensor.force": force})}, [FORCE]))
    opened.cache.capacity = time.nbytes + 1
    for _ in range(3):
        np.testing.assert_array_equal(over_time(opened, ViewedCurve("sensor.force", 0)).y, force)
    assert len(opened.cache.arrays) == 1


def test_a_curve_that_cannot_be_had_leaves_the_others(opened):
    told = {
        "points": 100,
        "curves": [{"signal": name, "case": 0, "window": [0, 2]} for name in ("no.such", "sensor.force")],
    }
    answer = lines(told, opened)
    assert b"'no.such' was not recorded" in answer
    assert b'"counts": [0, 100]' in answer


@pytest.mark.parametrize("size", [7, 64, 1000])
def test_a_case_may_be_in_several_parts_of_a_file(tmp_path, size):
    """As other writers do it: a part may hold the end of one case and the begin of the next."""
    time, force = wave(100.0, 0.5)
    cases = {
        (variant, seed): (time, {"sensor.force": k * force})
        for k, (variant, seed) in enumerate([("PI", 1), ("PI", 2), ("PI+FF", 1)], 1)
    }
    folder = folder_of(tmp_path / "run", cases, [FORCE])
    table = parquet.read_table(folder / "signals.parquet")
    parquet.write_table(table, folder / "signals.parquet", row_group_size=size)
    recording = runs(folder).runs[0].recording
    assert list(recording.cases) == list(cases)
    for k, case in enumerate(cases, 1):
        np.testing.assert_array_equal(recording.column(case, "time"), time)
        np.testing.assert_array_equal(recording.column(case, "sensor.force"), k * force)
        assert (recording.samples(case), recording.span(case)) == (50, (0.0, time[-1]))
        assert recording.has(case, "sensor.force")
        assert not recording.has(case, "tip.position")
