"""Changes are named, what is not listed is called so, and forecasts do not disturb what is followed."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.follow import parts
from tests.follow.test_follow import VAN_DER_POL, write
from twin.errors import ScenarioError
from twin.follow import Follower, follow, load, write_run
from twin.follow.changes import UNKNOWN
from twin.follow.problem import times_of

CHANGES = """
changes:
  damping: {set: {VanDerPol.mu: [x0.4, x2.5]}, rate: 1}
  offset of the sensor: {set: {VanDerPol.y: [+0.2 m, -0.2 m]}}
forecast: {horizon: 1 s, every: 2 s, interval: 200 ms, signals: [VanDerPol.v], limits: {VanDerPol.v: [-1 m/s, 1 m/s]}, planned: ["force [m/s2]"]}
"""
KNOWN = VAN_DER_POL.replace("  VanDerPol.mu: {start: 1.0, deviation: 0.5, walk: 0.01, from: 0, to: 5}\n", "")
# A model that starts at a wrong state must reach the right one within a second or so.
KNOWN = KNOWN.replace("walk: 1 mm", "walk: 20 mm").replace("walk: 0.001", "walk: 0.1")
AT = 15.0  # time of the change [s]


def changed(change, seed=1, count=600, every=0.05):
    """Rows of a recording of an oscillator, of which something changes at `AT`."""
    random, oscillator = np.random.default_rng(seed), parts.VanDerPol()
    oscillator.start(0.0)
    rows = [(0.0, 0.0, 1e3)]
    for i in range(count):
        for k in range(5):
            t = i * every + k * every / 5
            oscillator.u = 0.5 * np.sin(0.9 * t) + (1.0 if change == "push" and t >= AT else 0.0)
            oscillator.mu = 2.5 if change == "damping" and t >= AT else 1.0
            oscillator.advance(t, every / 5)
        t = (i + 1) * every
        measured = float(oscillator.y) + 0.02 * random.standard_normal()
        rows.append((t, 0.5 * np.sin(0.9 * t), 1e3 * (measured + (0.2 if change == "offset" and t >= AT else 0.0))))
    return rows


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "name"),
    [("none", None), ("damping", "damping"), ("offset", "offset of the sensor"), ("push", UNKNOWN)],
)
def test_a_change_is_named(tmp_path, build, change, name):
    problem = load(write(tmp_path, changed(change, seed=4), KNOWN + CHANGES))
    estimates = list(follow(problem, build))
    alarms = [estimate.alarm for estimate in estimates if estimate.alarm]
    assert [alarm.name for alarm in alarms[:1]] == ([name] if name else [])
    if alarms:
        assert alarms[0].probability > 0.95
        assert AT < alarms[0].time < AT + 14.0
        assert alarms[0].onset == pytest.approx(AT, abs=2.0)
    folder = write_run(problem, estimates, tmp_path / "runs", 1.0)
    summary = json.loads((folder / "summary.json").read_text())
    assert [alarm["name"] for alarm in summary["follow"]["changes"]] == [alarm.name for alarm in alarms]


@pytest.mark.slow
@pytest.mark.parametrize("planned", [False, True])
def test_a_forecast_knows_the_future_of_planned_inputs_only(tmp_path, build, planned):
    """A force that begins after the forecast was made."""
    rows = [(time, 50.0 * (time > 5.0), position) for time, _, position in changed("none", count=120)]
    text = KNOWN + (CHANGES if planned else CHANGES.replace(', planned: ["force [m/s2]"]', ""))
    problem = load(write(tmp_path, rows, text))
    assert problem.forecast.planned == (("force [m/s2]",) if planned else ())
    with Follower(problem, build) as follower:
        for tick, measurements in list(times_of(problem).items())[:100]:
            follower.advance(tick)
            follower.correct(measurements)
        assert follower.tick == 500
        median = follower.forecast().bands[1, :, 0]
    assert bool(median.max() > 5.0) is planned


@pytest.mark.slow
def test_forecasts_leave_the_estimate_alone_and_follow_overrides(tmp_path, build):
    problem = load(write(tmp_path, changed("none", count=200), KNOWN + CHANGES))
    times = list(times_of(problem).items())
    with Follower(problem, build) as follower:
        for tick, measurements in times[:100]:
            follower.advance(tick)
            follower.correct(measurements)
        saved = follower.save()
        forecast = follower.forecast()
        other = follower.forecast(overrides={"VanDerPol.mu": 3.0})
        later = [
            (follower.advance(tick), follower.correct(measurements).values)[1] for tick, measurements in times[100:]
        ]
        follower.restore(saved)
        again = [
            (follower.advance(tick), follower.correct(measurements).values)[1] for tick, measurements in times[100:]
        ]
    assert np.array_equal(later, again)
    assert forecast.time == pytest.approx(5.0 + 0.2 * np.arange(1, 6))
    assert forecast.bands.shape == (3, 5, 1)
    assert np.ptp(forecast.bands, axis=0).min() > 0.0
    assert abs(other.bands[1] - forecast.bands[1]).max() > 0.1
    assert 0.0 <= forecast.chance[0] <= 1.0


def test_bad_changes_and_forecasts_are_told_in_one_line(tmp_path):
    cases = {
        "changes: {a: {set: {VanDerPol.nu: x2}}}": "VanDerPol has no variable 'nu'",
        "changes: {a: {set: {VanDerPol.x: x2}}}": "VanDerPol.x is no tunable parameter and no measured signal.",
        "changes: {a: {set: {VanDerPol.y: x2}}}": "a measured signal gets an offset, such as +5 mN.",
        "changes: {a: {set: {VanDerPol.mu: [x2, x3], VanDerPol.y: +1 mm}}}": "lists in `set` differ in length.",
        "changes: {a: {rate: 1}}": "`set` is missing. Add what changes",
        "changes: {no change: {set: {VanDerPol.mu: x2}}}": "is what no listed change is called.",
        "forecast: {horizon: 15 ms, signals: [VanDerPol.v]}": "15 ms is no multiple of the communication step of 10 ms.",
        "forecast: {horizon: 1 s}": "`signals` is missing. Add them",
        "forecast: {horizon: 1 s, signals: [VanDerPol.v], planned: [a]}": "a is none of `inputs`. Name one of them.",
    }
    rows = changed("none", count=20)
    for line, expected in cases.items():
        with pytest.raises(ScenarioError) as error:
            load(write(tmp_path, rows, f"{KNOWN}{line}\n"))
        assert len(error.value.problems) == 1, error.value.problems
        assert expected in error.value.problems[0]


MEASURED_SLOWLY = """
scenario: rig.yaml
step: 1 ms
data: rig.csv
inputs: {"way [mm]": sheath.gripper_position}
outputs: {"tracked [mm]": {signal: tracker.measured_position, noise: 0.2 mm}}
estimate: {"sheath.play[3]": {start: 0.2 mm, deviation: 0.2 mm}}
forecast: {horizon: 100 ms, interval: 50 ms, signals: [sheath.tip_position], draws: 10}
"""


def test_a_signal_is_forecast_beside_a_slow_sensor_that_the_forecast_does_not_read(tmp_path, build):
    """The filter keeps what the sensor has published, the forecast does not."""
    rig = "stop_time: 1 s\nmembers: {sheath: {component: sheath}, tracker: {component: em_tracker}}\n"
    (tmp_path / "rig.yaml").write_text(f"{rig}connections: [sheath.tip_position -> tracker.position]\n")
    rows = [(0.025 * i, 5 * np.sin(0.5 * i), 4 * np.sin(0.5 * i)) for i in range(9)]
    (tmp_path / "rig.csv").write_text(
        "time [s],way [mm],tracked [mm]\n" + "".join(f"{t},{x},{y}\n" for t, x, y in rows)
    )
    (tmp_path / "follow.yaml").write_text(MEASURED_SLOWLY)
    problem = load(tmp_path / "follow.yaml")
    with Follower(problem, build) as follower:
        for tick, measurements in times_of(problem).items():
            follower.advance(tick)
            follower.correct(measurements)
        forecast = follower.forecast()
    assert forecast.signals == ("sheath.tip_position",)
    assert np.isfinite(forecast.bands).all()
