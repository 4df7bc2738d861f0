"""Rows of the result, cross-validation and frozen files, on predictions whose errors are known."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from tests.validation.arrays import data_of
from tests.validation.model import REST, Formula
from twin.errors import ScenarioError, TwinError
from twin.validation import runner
from twin.validation.frozen import FrozenSet, frozen_path, frozen_text, read_frozen
from twin.validation.model import Quantity
from twin.validation.schema import ValidationKeys

DEGREE = np.pi / 180
U = np.arange(9.0)
LIMITS = {
    "rows": 9,
    "offset": 0.0,
    "offset_limit": 1.5,
    "start": 0.0,
    "start_limit": 9.0,
    "peak_limit": 9.0,
    "change_limit": 9.0,
}


def with_errors(errors, **keys):
    """A run whose angle [rad] is measured at 1 + u plus errors [deg], its tip 3 and 4 mm beside the model."""
    measured = np.stack([1 + U + DEGREE * np.asarray(errors), U + 3e-3, -U - 4e-3], 1)
    return data_of([U[:, None]], [measured], **keys)


def frozen_set(**fields):
    return FrozenSet({"rest": {"value": 1.0, "unit": "rad", "interval": [0.9, 1.1]}}, source_sha256="now", **fields)


def test_errors_of_an_angle_and_of_a_distance():
    angle, tip = Formula().quantities
    predicted, measured = np.array([[1.0, 2.0, 3.0]] * 2), np.array([[0.0, 2.003, 2.996], [1.5, 2.0, 3.0]])
    assert angle.error(predicted, measured) == pytest.approx([180 / np.pi, -90 / np.pi])
    assert tip.error(predicted, measured) == pytest.approx([5.0, 0.0])
    assert (angle.is_distance, tip.is_distance) == (False, True)
    assert Quantity("z", "mm", (2,), 1e3).error(predicted, measured) == pytest.approx([4.0, 0.0])
    mixed = Quantity("tip", "mm", (1, 2), (1e3, 1.0))  # an output in m and one in mm
    assert mixed.error(predicted, np.array([[0.0, 2.003, -1.0], [1.5, 2.0, 3.0]])) == pytest.approx([5.0, 0.0])
    assert Quantity("t", "degC", (0,), 1.0, -273.15).shown(np.array([[300.0]])) == pytest.approx(np.array([[26.85]]))


def test_rows_of_a_file():
    """The first third is off by -1 degree, the rest by 2: rezeroed it is off by 3 there."""
    errors = np.where(U < 3, 1.0, -2.0)
    limits = {"bending": {"a": [LIMITS | {"offset_limit": 0.75}]}}
    baseline = {"line": {"spans": [8.0], "coefficients": [[1.0, 1.0], [3e-3, 1.0], [0.0, -1.0]]}}
    frozen = frozen_set(limits=limits, band={"bending": {"half_width": 1.5}}, baselines=baseline)
    prediction = runner.predict_file(Formula(), frozen, with_errors(errors))
    assert (prediction.file, prediction.predicted[:, 0].tolist()) == ("run 0", (1 + U).tolist())
    assert prediction.rezeroed[:, 0] == pytest.approx(1 + U + DEGREE)
    angle, tip = prediction.rows
    assert {key: angle[key] for key in ("file", "quantity", "unit", "set", "consistent", "band", "rezeroed")} == {
        "file": "run 0",
        "quantity": "bending",
        "unit": "deg",
        "set": "sines",
        "consistent": False,
        "band": 1.5,
        "rezeroed": {},
    }
    assert [angle[key] for key in ("rmse", "mean_error", "largest")] == pytest.approx([np.sqrt(3), 1.0, 2.0])
    assert angle["coverage"] == pytest.approx(1 / 3)
    assert angle["rezeroed_rmse"] == pytest.approx(3.0)
    assert angle["area"] == pytest.approx(5 / 3)
    assert angle["baselines"] == {"line": pytest.approx(np.sqrt(3))}
    (failure,) = angle["disagreements"]
    assert failure == {"column": "a", "time": 0.0, "offset": pytest.approx(-1.0), "limit": 0.75}
    assert angle["remarks"] == [
        "this run does not agree with the model from t = 0 s on: a is off by about -1 deg (limit 0.75 deg)."
    ]
    assert {
        key: tip[key] for key in ("quantity", "unit", "coverage", "consistent", "band", "disagreements", "remarks")
    } == {
        "quantity": "tip",
        "unit": "mm",
        "coverage": None,
        "consistent": None,
        "band": None,
        "disagreements": [],
        "remarks": [],
    }
    assert [tip[key] for key in ("rmse", "mean_error", "largest", "area")] == pytest.approx([5.0] * 4)
    assert tip["rezeroed_rmse"] == pytest.approx(0.0, abs=1e-9)
    assert tip["baselines"] == {"line": pytest.approx(4.0)}


def test_an_error_as_large_as_the_band_is_in_it():
    frozen = frozen_set(band={"tip": {"half_width": 5.0 + 1e-9}, "bending": {"half_width": 0.5}})
    angle, tip = runner.predict_file(Formula(), frozen, with_errors(0 * U)).rows
    assert (angle["coverage"], tip["coverage"]) == (1.0, 1.0)


def test_a_corrected_value_is_told_beside_the_frozen_one():
    """The limits of both outputs of a distance count; of an output without limits nothing is known."""
    limits = {"tip": {"x": [LIMITS], "y": [LIMITS]}, "bending": {"a": [LIMITS]}}
    data = with_errors(10 + 0 * U)
    angle, tip = runner.predict_file(Formula(rezero=[REST]), frozen_set(limits=limits), data).rows
    assert angle["rezeroed"] == {"rest": {"frozen": 1.0, "corrected": pytest.approx(1 + 10 * DEGREE), "unit": "rad"}}
    assert angle["remarks"][1] == "the first third of the run suggests rest = 67.3 deg instead of 57.3 deg."
    assert [(one["column"], one["offset"], one["limit"]) for one in tip["disagreements"]] == [
        ("x", pytest.approx(3.0), 1.5),
        ("y", pytest.approx(-4.0), 1.5),
    ]
    del limits["tip"]["x"]
    _, tip = runner.predict_file(Formula(), frozen_set(limits=limits), data).rows
    assert [one["column"] for one in tip["disagreements"]] == ["y"]
    assert tip["consistent"] is False
    unknown = FrozenSet(limits=limits)  # nothing fitted: the start value
    angle, _ = runner.predict_file(Formula(rezero=[REST]), unknown, data).rows
    assert angle["rezeroed"]["rest"]["frozen"] == 0.5


FAILURE = {"column": "a", "time": 0.0, "offset": 3.14159, "limit": 1.0}


@pytest.mark.parametrize(("corrected", "is_told"), [(1.0039, False), (1.0041, True), (0.9959, True), (0.9961, False)])
def test_a_correction_counts_from_a_thousandth_of_its_bounds(corrected, is_told):
    row = {"unit": "deg", "disagreements": [FAILURE], "rezeroed": {"rest": {"frozen": 1.0, "corrected": corrected}}}
    texts = runner.remarks(row, Formula(rezero=[REST]), frozen_set(), with_errors(0 * U))
    assert (
        texts[0] == "this run does not agree with the model from t = 0 s on: a is off by about 3.14 deg (limit 1 deg)."
    )
    assert len(texts) == 1 + is_told
    assert runner.remarks(row | {"disagreements": []}, Formula(rezero=[REST]), frozen_set(), with_errors(0 * U)) == []


@pytest.mark.parametrize(("train_window", "is_longer"), [(None, False), (9, False), (8, True)])
def test_remarks_on_windows_and_the_source(train_window, is_longer):
    row = {"unit": "deg", "disagreements": [], "rezeroed": {}}
    data = data_of([U[:5, None], U[:, None]], [np.zeros((5, 3)), np.zeros((9, 3))], jumps=2)
    frozen = FrozenSet(source_sha256="then")
    jumps, *longer, source = runner.remarks(row, Formula(train_window=train_window), frozen, data)
    assert jumps == "the measurements jump in 2 places, where windows of the file join: roll-outs begin anew there."
    expected = "roll-outs of 9 rows are longer than the 8 of the fit: band and limit of the consistency test "
    assert longer == [f"{expected}come from shorter ones and may be too narrow."] * is_longer
    assert source == "the source of formula has changed since the fit; fit again or restore it."


@every_case(
    ("folds", "names", "index"),
    [
        ({"by": "file"}, ["run 0", "run 1"], [0] * 4 + [1] * 6),
        ({"by": "column", "column": "who"}, ["a", "b", "c"], [2, 2, 0, 0, 1, 1, 0, 0, 2, 2]),
        ({"by": "column", "column": "who", "count": 2}, ["fold 1", "fold 2"], [0, 0, 0, 0, 1, 1, 0, 0, 0, 0]),
        ({"by": "column", "column": "who", "count": 4}, ["fold 1", "fold 2", "fold 3"], [2, 2, 0, 0, 1, 1, 0, 0, 2, 2]),
        ({"by": "block", "count": 2}, ["block 1", "block 2"], [0, 0, 1, 1, 0, 0, 0, 1, 1, 1]),
        ({"by": "block"}, [f"block {k}" for k in range(1, 6)], [0, 1, 2, 3, 0, 0, 1, 2, 3, 4]),
    ],
)
def test_folds(folds, names, index):
    """Two files of four and six rows; blocks are parts of each file."""
    data = data_of(
        [np.zeros((n, 1)) for n in (4, 6)], [np.zeros((n, 1)) for n in (4, 6)], files=[0, 1], labels=list("ccaabbaacc")
    )
    found, of_rows = runner.fold_labels(Formula(folds=folds), data)
    assert (found, of_rows.tolist()) == (names, index)


def test_folds_by_a_column_that_is_missing():
    own = Formula(folds={"by": "column", "column": "who"})
    with pytest.raises(TwinError, match=r"^run 0: have no complete column 'who', which `folds` names\.$"):
        runner.fold_labels(own, with_errors(0 * U))


def cross_validated(offsets):
    """Cross-validation of files that are off by angles [deg], with nothing to fit."""
    parts = [with_errors(offset + 0 * U).measured for offset in offsets]
    data = data_of([U[:, None]] * len(parts), parts, files=list(range(len(parts))))
    frozen, steps = frozen_set(baselines={"line": {}}), []
    keys = ValidationKeys(band=0.9, false_alarms=0.1)
    runner.cross_validate(Formula(), data, {"rest": 1.0}, frozen, keys, lambda *step: steps.append(step))
    return frozen, steps


def test_cross_validation_of_nothing_to_fit(monkeypatch):
    """Without unknowns the model's own start value 0.5 rad counts: errors are its distance, and those of the files."""
    monkeypatch.setattr(Formula, "start", lambda *_: 1.0)
    frozen, steps = cross_validated([0.0, 1.0, 2.0, 4.0])
    base = 0.5 / DEGREE
    assert [(row["fold"], row["quantity"], row["unit"]) for row in frozen.cross_validation] == [
        *((f"run {k}", "bending", "deg") for k in range(4)),
        *((f"run {k}", "tip", "mm") for k in range(4)),
    ]
    assert [row["mean_error"] for row in frozen.cross_validation[:4]] == pytest.approx(
        [-base - x for x in (0, 1, 2, 4)]
    )
    assert [row["rmse"] for row in frozen.cross_validation[4:]] == pytest.approx([5.0] * 4)
    # the line through the other files is off by the mean of their offsets
    means = [x - np.mean(np.delete([0.0, 1.0, 2.0, 4.0], k)) for k, x in enumerate((0, 1, 2, 4))]
    assert [row["baselines"]["line"] for row in frozen.cross_validation[:4]] == pytest.approx(np.abs(means), rel=1e-3)
    assert [row["coverage"] for row in frozen.cross_validation[:4]] == frozen.band["bending"]["coverages"]
    assert frozen.band["bending"]["half_width"] == pytest.approx(base + 4)
    (own,) = frozen.limits["bending"]["a"]
    assert own["offset"] == pytest.approx(-base - 7 / 4)
    assert list(frozen.limits["tip"]) == ["x", "y"]
    assert frozen.limits["tip"]["y"][0]["offset"] == pytest.approx(4.0)
    assert frozen.false_alarms["bending"] == [
        {"rows": 9, "parts": 4, "alarms": frozen.false_alarms["bending"][0]["alarms"]}
    ]
    assert steps == [(f"sines: cross-validation without run {k}", pytest.approx(0.6 + 0.1 * k)) for k in range(4)]


def test_two_folds_have_bands_and_no_limits():
    frozen, _ = cross_validated([0.0, 1.0])
    assert frozen.limits == {}
    assert frozen.band["tip"]["half_width"] == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("folds", "message"),
    [
        (
            {"by": "file"},
            "cross-validation needs two folds, and there is only run 0. Add training files, or divide them",
        ),
        ({"by": "block", "count": 1}, "cross-validation needs two folds, and there is only block 1. Add"),
        ({"by": "block", "count": 10}, "block 10 has no samples. Reduce folds.count."),
    ],
)
def test_data_that_cannot_be_divided(folds, message):
    with pytest.raises(TwinError, match=rf"^set sines: {re.escape(message)}"):
        runner.fold_labels(Formula(folds=folds), with_errors(0 * U))


def fitted_set(monkeypatch, **keys):
    """The frozen set of two files, with a fit that finds a rest angle of 1 rad; what is told on the way."""
    own = Formula(train=["train/*.csv"], files=["*.csv"], baselines=["line", "cubic"], **keys)
    data = replace(
        data_of([U[:, None]] * 2, [with_errors(x + 0 * U).measured for x in (0.0, 1.0)], files=[0, 1]),
        changes={"q": 0.5},
    )
    own.reader = lambda training: SimpleNamespace(
        read=lambda _folder, names: data if training and names == ["a", "b"] else None
    )
    fitted = {"rest": {"value": 1.0, "unit": "rad", "interval": [0.9, 1.1]}}
    steps = []

    def fit(_own, _data, rows, *, starts, seed, progress):
        assert (rows.all(), starts, seed) == (True, 3, 7)
        progress("start 1 of 3", 0.4, "residual 2")
        return fitted

    monkeypatch.setattr(runner, "fit", fit)
    monkeypatch.setattr(runner, "cross_validate", lambda *arguments: arguments[3].files.update(crossed="yes"))
    matching = {("train/*.csv",): ["a", "b"], ("*.csv",): []}
    file = SimpleNamespace(
        open_set=lambda _: own, names=lambda patterns: matching[tuple(patterns)], folder="data", keys=None
    )
    return runner.fit_set(file, "sines", 3, 7, lambda *step: steps.append(step)), steps, own, file


def test_a_set_is_fitted_to_its_training_files(monkeypatch):
    frozen, steps, own, file = fitted_set(monkeypatch)
    assert frozen.parameters == {"rest": {"value": 1.0, "unit": "rad", "interval": [0.9, 1.1]}}
    assert frozen.files == {"run 0": "0", "run 1": "0", "crossed": "yes"}
    assert frozen.source_sha256 == "now"
    assert np.array(frozen.baselines["line"]["coefficients"]) == pytest.approx(
        np.array([[1 + DEGREE / 2, 1], [3e-3, 1], [-4e-3, -1]]), abs=1e-6
    )
    assert list(frozen.baselines) == ["line", "cubic"]
    assert [(row["fold"], row["quantity"], round(row["mean_error"], 6)) for row in frozen.training] == [
        ("run 0", "bending", 0.0),
        ("run 1", "bending", -1.0),
        ("run 0", "tip", 5.0),
        ("run 1", "tip", 5.0),
    ]
    assert frozen.changes == {}  # of roll-outs that are as long as those of the fit
    assert 0.0 <= frozen.seconds < 600.0
    assert steps == [
        ("sines: start 1 of 3 residual 2", 0.2),
        ("sines: baseline line", 0.5),
        ("sines: baseline cubic", 0.55),
    ]
    own.keys.train = own.keys.files
    with pytest.raises(TwinError, match=r"^set sines: no training file in data fits \*\.csv\. Correct --data\.$"):
        runner.fit_set(file, "sines", 3, 7, lambda *_: None)


def test_shorter_windows_of_a_fit_keep_the_largest_changes(monkeypatch):
    frozen, *_ = fitted_set(monkeypatch, train_window=5)
    assert frozen.changes == {"q": 0.5}


TEXT = """# A robot: frozen by `twin validate --fit`; do not edit.
# sines: rest = 1 rad, 95 % interval 0.9 to 1.1
# sines: cross-validated tip, run 1: 2.346 mm
"""


def test_frozen_parameters_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "robot.yaml"
    rows = [{"fold": "run 1", "quantity": "tip", "unit": "mm", "rmse": 2.34567}]
    frozen = {
        "sines": frozen_set(limits={"tip": {"x": [LIMITS]}}, cross_validation=rows, seconds=1.5, changes={"q": 0.1})
    }
    frozen_path(path).write_text(frozen_text("A robot", frozen))
    assert frozen_path(path).name == "robot.parameters.yaml"
    assert frozen_path(path).read_text().startswith(TEXT + "sines:\n")
    assert read_frozen(path) == frozen
    assert frozen["sines"].values == {"rest": 1.0}
    frozen_path(path).write_text(frozen_path(path).read_text().replace("peak_limit", "peek_limit"))
    with pytest.raises(ScenarioError, match=r"is damaged \(.*peek_limit.*\)\. Fit again: twin validate .* --fit\.$"):
        read_frozen(path)
    frozen_path(path).unlink()
    with pytest.raises(TwinError, match=r"robot\.parameters\.yaml: is missing\. Fit first: twin validate .* --fit\.$"):
        read_frozen(path)
