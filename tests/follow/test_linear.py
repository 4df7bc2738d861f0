"""A linear model from file to result: the estimates are those of the Kalman filter, and what is written of them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.face import open_run
from twin.follow import EstimateRecording, Follower, follow, in_band, load, remarks, summary_of, write_run
from twin.follow.changes import Alarm
from twin.follow.estimate_recording import judge
from twin.follow.follower import Estimate, nis_band
from twin.follow.forecast import Forecast
from twin.follow.problem import times_of
from twin.follow.records import signals_of

TEXT = """
title: A free mass
component: "tests.follow.parts:Mass"
step: 50 ms
data: data.csv
outputs: {"position [mm]": {signal: Mass.y, noise: 100 mm, delay: 50 ms, offset: 20 mm}}
estimate:
  Mass.x: {start: 0.5 m, deviation: 1 m, walk: 0.2 m}
  Mass.v: {start: -1, deviation: 2, walk: 0.5, from: -30, to: 30}
forecast: {horizon: 200 ms, every: 500 ms, interval: 100 ms, signals: [Mass.y], limits: {Mass.y: [-1 m, 1 m]}, draws: 400}
"""
TIMES = np.array([0.05, 0.1, 0.15, 0.3, 0.35, 0.4, 0.65, 0.7])  # [s] the first belongs to the start: it is left out
POSITIONS = np.array([0.4, 0.3, 0.35, 0.1, 0.05, -0.1, -0.2, -0.3])  # [m]


def kalman():
    """Mean, covariance, innovation, its deviation and its normalized square after each measurement."""
    mean, covariance = np.array([0.5, -1.0]), np.diag([1.0, 4.0])
    before = 0.0
    for time, position in zip(TIMES[1:] - 0.05, POSITIONS[1:] - 0.02, strict=True):
        h = time - before
        before = time
        move = np.array([[1.0, h], [0.0, 1.0]])
        mean, covariance = move @ mean, move @ (covariance + h * np.diag([0.04, 0.25])) @ move.T
        innovation, variance = position - mean[0], covariance[0, 0] + 0.01
        gain = covariance[:, 0] / variance
        mean, covariance = mean + gain * innovation, covariance - np.outer(gain, covariance[0])
        yield time, mean, covariance, innovation, np.sqrt(variance), innovation**2 / variance


def linear_problem(folder, method):
    rows = [f"{time},{1e3 * position}" for time, position in zip(TIMES, POSITIONS, strict=True)]
    (folder / "data.csv").write_text("\n".join(["time [s],position [mm]", *rows]) + "\n")
    (folder / "mass.yaml").write_text(f"{TEXT}method: {method}\n")
    return load(folder / "mass.yaml")


@pytest.fixture(scope="module", params=["unscented", "extended"])
def problem(request, tmp_path_factory):
    return linear_problem(tmp_path_factory.mktemp("linear"), request.param)


@pytest.fixture(scope="module")
def estimates(problem, build):
    return list(follow(problem, build))


def test_measurements_belong_to_steps_less_their_delay_and_offset(problem):
    assert times_of(problem) == {
        step: {0: pytest.approx(position)}
        for step, position in zip((1, 2, 5, 6, 7, 12, 13), POSITIONS[1:] - 0.02, strict=True)
    }
    assert problem.longest_interval == 5
    assert problem.title == "A free mass"
    assert problem.notes == (
        "1 measured values at the start, or in a communication step with another one, are not used.",
    )
    assert [(one.start, one.deviation, one.walk, one.low, one.high) for one in problem.estimates] == [
        (0.5, 1.0, 0.2, -np.inf, np.inf),
        (-1.0, 2.0, 0.5, -30.0, 30.0),
    ]


@pytest.mark.slow_repetitions
def test_the_estimates_are_those_of_the_kalman_filter(estimates):
    assert len(estimates) == 7
    for one, (time, mean, covariance, innovation, deviation, nis) in zip(estimates, kalman(), strict=True):
        assert one.time == pytest.approx(time)
        assert one.values == pytest.approx(mean, rel=1e-9)
        assert one.covariance == pytest.approx(covariance, rel=1e-8, abs=1e-12)
        assert one.deviations == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-8)
        assert one.innovation == pytest.approx([innovation], rel=1e-9)
        assert one.expected == pytest.approx([deviation], rel=1e-9)
        assert one.nis == pytest.approx(nis, rel=1e-8)
        assert one.predicted + one.innovation == pytest.approx(one.measured)
        assert one.band == nis_band(1)
        assert (one.changes, one.alarm) == (None, None)
    assert [one.forecast is not None for one in estimates] == [False] * 5 + [True, False]  # the first after 0.5 s


@pytest.mark.slow
def test_a_forecast_spreads_as_the_covariance_does(estimates):
    """The estimate's covariance, moved by 0.1 s twice, with process noise at the begin of both intervals, as in the filter."""
    one = estimates[5]
    forecast = one.forecast
    assert (forecast.start, forecast.time.tolist()) == (pytest.approx(0.6), pytest.approx([0.7, 0.8]))
    assert forecast.signals == ("Mass.y",)
    assert forecast.draws.shape == (2, 400, 1)
    move, noise = np.array([[1.0, 0.1], [0.0, 1.0]]), 0.1 * np.diag([0.04, 0.25])
    first = move @ (one.covariance + noise) @ move.T
    second = move @ (first + noise) @ move.T
    position = one.values[0] + np.array([0.1, 0.2]) * one.values[1]
    deviation = np.sqrt([first[0, 0], second[0, 0]])
    assert forecast.draws[:, :, 0].mean(axis=1) == pytest.approx(position, abs=0.2 * deviation.max())
    assert forecast.draws[:, :, 0].std(axis=1) == pytest.approx(deviation, rel=0.12)
    assert forecast.bands[:, :, 0] == pytest.approx(
        position + np.array([[-1.645], [0.0], [1.645]]) * deviation, abs=0.25 * deviation.max()
    )
    beyond = np.any(np.abs(forecast.draws[:, :, 0]) > 1.0, axis=0)
    assert forecast.chance.tolist() == [np.mean(beyond)]


@pytest.mark.slow_repetitions
def test_a_follower_forecasts_what_if(problem, build):
    with Follower(problem, build) as follower:
        tick, measured = next(iter(times_of(problem).items()))
        follower.advance(tick)
        before = follower.correct(measured)
        forecast = follower.forecast(3)
        assert forecast.time == pytest.approx([0.05 + 0.1, 0.05 + 0.15])
        assert follower.alarms == []
        follower.advance(2)
        assert follower.correct({}).values[0] == pytest.approx(before.values[0] + 0.05 * before.values[1])


def test_signals_and_summary_of_a_run(problem, estimates, tmp_path):
    signals, columns = signals_of(problem, estimates)
    assert [column.name for column in columns] == [
        *(f"{group}.Mass.{name}" for group in ("estimate", "deviation") for name in "xv"),
        *(f"{group}.Mass.y" for group in ("measured", "predicted", "innovation", "expected")),
        *(f"nis.{name}" for name in ("value", "low", "high")),
        *(f"forecast.Mass.y.{name}" for name in ("low", "median", "high", "chance")),
    ]
    assert signals.values["estimate.Mass.v"].tolist() == [one.values[1] for one in estimates]
    assert signals.values["deviation.Mass.x"].tolist() == [one.deviations[0] for one in estimates]
    assert signals.values["nis.low"].tolist() == [nis_band(1)[0]] * 7
    assert signals.values["nis.high"].tolist() == [nis_band(1)[1]] * 7
    assert signals.values["forecast.Mass.y.chance"][5] == estimates[5].forecast.chance[0]
    assert np.isnan(signals.values["forecast.Mass.y.median"]).all()  # it ends after the recording
    summary = summary_of(problem, estimates)
    assert summary["measurements"] == 7
    assert summary["nis_mean"] == pytest.approx(np.mean([row[-1] for row in kalman()]))
    low, high = nis_band(1)
    assert summary["nis_in_band"] == in_band(estimates) == np.mean([low <= row[-1] <= high for row in kalman()])
    assert summary["estimates"]["Mass.x"] == {
        "value": estimates[-1].values[0],
        "deviation": estimates[-1].deviations[0],
        "unit": "m",
    }
    folder = write_run(problem, estimates, tmp_path, 2.0)
    told = json.loads((folder / "summary.json").read_text())
    begin = problem.experiment.case.start_ns / 1e9
    assert told["status"] == "completed"
    assert (told["wall_time"], told["simulated_time"]) == (2.0, pytest.approx(estimates[-1].time - begin))
    assert [(case["samples"], case["complete"]) for case in told["cases"]] == [(7, True)]
    assert told["follow"] == json.loads(json.dumps(summary))
    assert open_run(folder)["estimate.Mass.x"].values.ravel().tolist() == signals.values["estimate.Mass.x"].tolist()


def test_estimates_that_change_are_written_in_place(problem, estimates, tmp_path):
    recording = EstimateRecording(problem, tmp_path)
    recording.write([])
    assert recording.count == 0
    assert np.isnan(recording.in_band)
    recording.write(estimates[:5])
    changed = [Estimate(**{**vars(one), "values": one.values + 1.0}) for one in estimates[2:4]]
    rows = recording.folder / ".recording" / "0.rows"
    size = rows.stat().st_size // 5
    recording.write(changed)  # the fifth is no longer there
    assert recording.count == 4
    assert rows.stat().st_size == 4 * size, "a run that is killed here is recovered without it"
    recording.write(estimates[4:])
    assert recording.count == 7
    assert recording.in_band == in_band(estimates)
    folder = recording.finish(estimates[-1], "interrupted", "Ctrl-C", 1.0, {"follow": {"a": 1}})
    values = open_run(folder)["estimate.Mass.x"].values.ravel().tolist()
    assert values == [one.values[0] + (1.0 if i in (2, 3) else 0.0) for i, one in enumerate(estimates)]
    told = json.loads((folder / "summary.json").read_text())
    assert (told["status"], told["reason"], told["follow"]) == ("interrupted", "Ctrl-C", {"a": 1})
    begin = problem.experiment.case.start_ns / 1e9
    assert (told["wall_time"], told["simulated_time"]) == (1.0, pytest.approx(estimates[-1].time - begin))
    assert not (folder / ".recording").exists()


def test_forecasts_are_written_at_their_end_that_comes_later(problem, estimates, tmp_path):
    """Of one write, or estimate by estimate with some that come again: the same rows."""
    whole, parts = EstimateRecording(problem, tmp_path), EstimateRecording(problem, tmp_path)
    own = [Estimate(**{**vars(one), "time": 0.05 * (k + 1)}) for k, one in enumerate(estimates)]
    own[1] = Estimate(
        **{**vars(own[1]), "forecast": replace(estimates[5].forecast, start=0.1, time=np.array([0.2, 0.3]))}
    )
    whole.write(own)
    for one in own[:6]:
        parts.write([one])
    parts.write(own[4:])
    values = [
        open_run(recording.finish(own[-1], "completed", "", 1.0, {}))["forecast.Mass.y.median"].values.ravel()
        for recording in (whole, parts)
    ]
    assert np.isfinite(values[0]).tolist() == [False] * 5 + [True, False]
    np.testing.assert_array_equal(*values)


def estimate(time=0.0, nis=1.0, band=(0.5, 2.0), covariance=None, values=(0.0, 0.0), **options):
    nothing = np.zeros(1)
    covariance = np.eye(2) if covariance is None else covariance
    return Estimate(time, np.array(values), covariance, nothing, nothing, nothing, nothing, nis, band, **options)


@every_case(
    ("nis", "band", "inside", "judged"),
    [
        (0.5, (0.5, 2.0), True, 1),
        (2.0, (0.5, 2.0), True, 1),
        (0.49, (0.5, 2.0), False, 0),
        (2.01, (0.5, 2.0), False, 0),
        (0.0, (0.0, 0.0), True, -1),  # nothing was measured
    ],
)
def test_an_innovation_is_in_its_band_or_not(nis, band, inside, judged):
    assert estimate(nis=nis, band=band).is_in_band is inside
    assert judge(estimate(nis=nis, band=band)) == judged


def test_bands_are_those_of_chi_square():
    assert nis_band(0) == (0.0, 0.0)
    assert nis_band(1) == pytest.approx((0.000982, 5.0239), rel=1e-3)  # tables: 97.5 and 2.5 %
    assert nis_band(3) == pytest.approx((0.2158, 9.3484), rel=1e-3)


def remarks_of(problem, correlation=0.0, values=(0.0, 0.0), inside=1.0):
    covariance = np.array([[4.0, 6.0 * correlation], [6.0 * correlation, 9.0]])
    good = round(10 * inside)
    own = [estimate(nis=1.0 if k < good else 3.0, covariance=covariance, values=values) for k in range(10)]
    return [line.partition(":")[0] for line in remarks(problem, own)]


def test_remarks(problem):
    together = "Mass.v cannot be separated from Mass.x (correlation "
    assert remarks_of(problem, 0.94) == []
    assert remarks_of(problem, 0.96) == [f"{together}0.96)"]
    assert remarks_of(problem, -0.96) == [f"{together}-0.96)"]
    assert remarks_of(problem, values=(30.0, 29.9)) == []
    assert remarks_of(problem, values=(0.0, -30.0)) == ["Mass.v is at its bound"]
    assert remarks_of(problem, values=(0.0, 30.0)) == ["Mass.v is at its bound"]
    assert remarks_of(problem, inside=0.8) == []
    assert remarks_of(problem, inside=0.7) == ["the model does not represent the recording"]


@pytest.mark.parametrize(("nis", "advice"), [(3.0, "are too small. Check noise"), (0.1, "are too large. Lower noise")])
def test_it_is_told_which_side_of_the_band_is_left(problem, nis, advice):
    (line,) = remarks(problem, [estimate(nis=nis, band=(0.5, 2.0))] * 10)
    assert advice in line


def test_a_forecast_is_recorded_at_the_time_that_it_is_for(problem):
    draws = np.arange(20.0).reshape(2, 10, 1)
    forecast = Forecast(0.1, np.array([0.2, 0.3]), ("Mass.y",), draws, np.array([0.25]))
    alarm = Alarm("x", 0.1, 0.0, 0.99)
    own = [estimate(0.1, forecast=forecast, alarm=alarm), estimate(0.2), estimate(0.29), estimate(0.4)]
    signals, _ = signals_of(problem, own)
    values = signals.values
    assert values["forecast.Mass.y.median"][3] == 14.5  # of 10 to 19, the last point
    assert values["forecast.Mass.y.low"][3] == pytest.approx(10.45)
    assert values["forecast.Mass.y.high"][3] == pytest.approx(18.55)
    assert np.isnan(values["forecast.Mass.y.median"]).tolist() == [True, True, True, False]
    assert values["forecast.Mass.y.chance"][0] == 0.25
    assert np.isnan(values["forecast.Mass.y.chance"][1:]).all()
    exact, _ = signals_of(problem, [own[0], estimate(0.3)])
    assert exact.values["forecast.Mass.y.median"][1] == 14.5
    early, _ = signals_of(problem, own[:3])
    assert np.isnan(early.values["forecast.Mass.y.median"]).all()  # the recording ends before
