"""The page of a followed rig: plots with bands, gaps of signals that are measured now and then, status."""

import json

import numpy as np
import pytest

from tests.viewer.recorded import folder_of, runs
from twin.results import RecordedVariable
from twin.viewer import embedded_page, following, select_signals
from twin.viewer.page_data import about

NAN = np.nan


def test_values_now_and_then_are_a_line_with_gaps():
    time, y = following.compact(np.arange(7.0), np.array([NAN, 1.0, NAN, 3.0, NAN, 5.0, NAN]))
    assert (time.tolist(), y.tolist()) == ([1.0, 3.0, 5.0], [1.0, 3.0, 5.0])
    times = np.array([0.0, 1.0, 2.0, 3.0, 20.0, 21.0])
    time, y = following.compact(times, np.array([0.0, NAN, 2.0, 3.0, 4.0, 5.0]))
    assert time.tolist() == [0.0, 2.0, 3.0, 3.0, 20.0, 21.0]
    assert np.isnan(y).tolist() == [False, False, False, True, False, False]
    whole = np.arange(3.0)
    assert following.compact(whole, whole)[0] is whole
    assert len(following.compact(whole, np.full(3, NAN))[0]) == 0


def followed(place, status):
    """The folder of a run with estimates of one parameter from two measured signals."""
    time = np.arange(0.0, 10.0, 0.1)
    values = {
        "measured.arm.tip": np.sin(time),
        "predicted.arm.tip": np.sin(time),
        "expected.arm.tip": np.full(len(time), 0.1),
        "innovation.arm.tip": np.zeros(len(time)),
        "estimate.arm.play": np.linspace(1.0, 2.0, len(time)),
        "deviation.arm.play": np.full(len(time), 0.2),
        "smoothed.time": np.where(time < 1.95, NAN, time - 2.0),
        "smoothed.arm.play": np.where(time < 1.95, NAN, np.linspace(1.0, 2.0, len(time))),
        "smoothed_deviation.arm.play": np.where(time < 1.95, NAN, 0.1),
        "nis.value": np.ones(len(time)),
        "nis.low": np.full(len(time), 0.001),
        "nis.high": np.full(len(time), 5.0),
        "change.no_change": np.ones(len(time)),
        "forecast.arm.tip.low": np.where(time % 1.0 < 0.05, -1.0, NAN),
        "forecast.arm.tip.median": np.where(time % 1.0 < 0.05, 0.0, NAN),
        "forecast.arm.tip.high": np.where(time % 1.0 < 0.05, 1.0, NAN),
    }
    units = {name: ("m", "mm") if ".arm." in name else ("", "") for name in values}
    columns = [RecordedVariable(name, unit=unit, display_unit=shown) for name, (unit, shown) in units.items()]
    folder = folder_of(place, {("base", 0): (time, values)}, columns)
    (folder / "following.json").write_text(json.dumps(STATUS | status))
    return folder


STATUS = {
    "time": 9.9,
    "represents": True,
    "since": None,
    "reason": "",
    "nis_in_band": 0.95,
    "estimates": {"arm.play": {"value": 2.0e-3, "deviation": 1.0e-4}},
    "looks_for_changes": True,
    "changes": [],
    "forecast": {
        "start": 9.9,
        "time": [10.4, 10.9],
        "signals": {
            "arm.tip": {
                "low": [0.0, 0.0],
                "median": [0.001, 0.002],
                "high": [0.002, 0.004],
                "chance": 0.25,
                "limits": [-0.01, 0.01],
            }
        },
    },
}
LOST = {"represents": False, "since": 4.2, "reason": "NIS was in its 95 % band at 40 % of the last 100 times."}
CHANGE = {"changes": [{"name": "wear of the arm", "onset": 4.0, "time": 5.0, "probability": 0.99}]}


def test_plots_and_status_of_a_followed_rig(tmp_path):
    content = about(runs(followed(tmp_path / "run", CHANGE)))
    first = [plot for plot in content["plots"] if plot["first"]]
    assert [plot["title"] for plot in first] == [
        "arm.tip",
        "arm.tip: forecast",
        "arm.play",
        "Innovations",
        "Probabilities of changes",
    ]
    edges = first[0]["bands"]["predicted.arm.tip"]
    assert edges == ["predicted.arm.tip - 1.96 * expected.arm.tip", "predicted.arm.tip + 1.96 * expected.arm.tip"]
    assert first[3]["range"] == [0.0, 15.0]
    assert content["events"] == [{"time": 4.0, "name": "wear of the arm", "variants": [], "run": 0}]
    known = content["following"]
    assert (known["lost"], known["run"]) == ("", 0)
    assert known["estimates"]["arm.play"]["text"] == "2 mm \N{PLUS-MINUS SIGN} 0.1 mm"
    assert known["forecast"]["signals"]["arm.tip"]["median"] == pytest.approx([1.0, 2.0])
    assert known["forecast"]["signals"]["arm.tip"]["limits"] == pytest.approx([-10.0, 10.0])
    lost = about(runs(followed(tmp_path / "lost", LOST)))["following"]
    assert lost["lost"] == "The twin no longer represents the rig."


def test_bands_are_expressions_over_signals_with_gaps(tmp_path):
    viewed = runs(followed(tmp_path / "run", {})).runs[0]
    case = ("base", 0)
    assert viewed.samples(case, "forecast.arm.tip.median").time == pytest.approx(np.arange(10.0))
    upper = viewed.samples(case, "predicted.arm.tip + 1.96 * expected.arm.tip")
    assert upper.shown(upper.y) == pytest.approx(1e3 * (np.sin(upper.time) + 0.196))
    assert upper.unit == "mm"


def test_a_page_of_one_file_has_the_plots_with_their_bands(tmp_path):
    opened = runs(followed(tmp_path / "run", {}))
    signals = select_signals(opened, ())
    assert {"nis.value", "nis.high", "estimate.arm.play - 1.96 * deviation.arm.play"} <= set(signals)
    assert not any(name.startswith("innovation") for name in signals)
    page = embedded_page(opened, signals, [0])
    assert page.curves == len(signals) == 17


def test_smoothed_estimates_stand_at_their_own_times(tmp_path):
    viewed = runs(followed(tmp_path / "run", {})).runs[0]
    (estimate,) = (each for each in following.plots(viewed) if each["title"] == "arm.play")
    assert estimate["signals"] == ["estimate.arm.play", "smoothed.arm.play"]
    edges = estimate["bands"]["smoothed.arm.play"]
    low, smoothed = (viewed.samples(("base", 0), text) for text in (edges[0], "smoothed.arm.play"))
    for samples, first in ((smoothed, 1202.0), (low, 1006.0)):
        assert samples.time == pytest.approx(np.arange(0.0, 7.95, 0.1))
        assert samples.shown(samples.y)[0] == pytest.approx(first, abs=0.1)


def test_other_runs_have_no_status(tmp_path):
    time = np.arange(3.0)
    folder = folder_of(tmp_path / "run", {("base", 0): (time, {"a.x": time})}, [RecordedVariable("a.x")])
    assert about(runs(folder))["following"] is None
    (folder / "following.json").write_text("{")
    assert about(runs(folder))["following"] is None
    assert following.read_json(folder / "following.json") is None
