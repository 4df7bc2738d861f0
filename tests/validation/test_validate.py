"""`twin validate` from raw files to figures: fit, freeze, predict, flag a run that does not agree."""

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from tests.validation.synthetic import ROBOT, TRUE, robot, run, write_csv, write_matlab
from twin.cli import group
from twin.errors import TwinError
from twin.validation import fit_and_freeze, frozen_path, frozen_text, html, load, runner, validate
from twin.validation.model import ValidationSet


@pytest.fixture(scope="module")
def frozen_robot(tmp_path_factory, build):
    folder = tmp_path_factory.mktemp("robot")
    path = robot(folder, slipped=-0.12)
    own = load(path, folder, build)
    frozen = fit_and_freeze(own, starts=2)
    frozen_path(path).write_text(frozen_text(own.title, frozen))
    return own, frozen["decaying"]


@pytest.mark.slow
def test_parameters_are_recovered(frozen_robot):
    _, frozen = frozen_robot
    for name, value in TRUE.items():
        assert frozen.values[name] == pytest.approx(value, rel=0.01), name
    assert frozen.files.keys() == {f"robot/train_{i}.txt" for i in range(5)}


@pytest.mark.slow
def test_model_beats_baselines_in_cross_validation(frozen_robot):
    _, frozen = frozen_robot
    rows = [row for row in frozen.cross_validation if row["quantity"] == "bending angle"]
    assert len(rows) == 5
    assert all(row["rmse"] < row["baselines"]["line"] / 2 for row in rows)


def test_band_holds_its_share_of_left_out_runs(frozen_robot):
    _, frozen = frozen_robot
    for band in frozen.band.values():
        assert 0.85 <= np.mean(band["coverages"]) <= 0.95


def rows_of(own, pattern):
    return [row for prediction in validate(own, [pattern]) for row in prediction.rows]


def test_good_run_agrees(frozen_robot):
    own, _ = frozen_robot
    angle, height = rows_of(own, "robot/good.txt")
    assert angle["quantity"] == "bending angle"
    assert angle["unit"] == "deg"
    assert angle["rmse"] < 0.6
    assert angle["consistent"] is height["consistent"] is True
    assert height["rmse"] == pytest.approx(angle["rmse"] * np.pi / 180 * 100, rel=0.2)


def test_slipped_run_is_flagged_and_corrected(frozen_robot):
    own, _ = frozen_robot
    angle, _ = rows_of(own, "robot/slipped.txt")
    assert angle["consistent"] is False
    (failure,) = angle["disagreements"]
    assert failure["time"] == 0.0
    assert failure["offset"] == pytest.approx(np.degrees(-0.12), abs=0.7)
    assert angle["rmse"] > 6
    assert angle["rezeroed_rmse"] < 0.3
    assert angle["rezeroed"]["rest"]["corrected"] == pytest.approx(TRUE["rest"] - 0.12, abs=0.02)


@pytest.mark.parametrize("slip", [0.15, 0.02])
def test_run_that_slips_later_is_flagged_from_there_on(frozen_robot, slip):
    """0.02 rad are three standard deviations of the rest angles of runs, but no run changes that much."""
    own, _ = frozen_robot
    time, tendon, angle = run(103)
    write_csv(own.folder / "robot/later.txt", time, tendon, np.where(time > 6, angle - slip, angle))
    angle = rows_of(own, "robot/later.txt")[0]
    (own.folder / "robot/later.txt").unlink()
    assert angle["consistent"] is False
    (failure,) = angle["disagreements"]
    assert failure["time"] == pytest.approx(6, abs=0.6)
    assert failure["offset"] == pytest.approx(-np.degrees(slip), abs=0.5)
    assert len(angle["remarks"]) == 1, "the first third says nothing about what happens later"


def test_frozen_files_are_only_read(frozen_robot):
    own, _ = frozen_robot
    before = frozen_path(own.path).read_bytes()
    assert rows_of(own, "robot/good.txt") == rows_of(own, "robot/good.txt")
    assert frozen_path(own.path).read_bytes() == before


def test_changed_source_is_reported(frozen_robot, tmp_path):
    own, frozen = frozen_robot
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT)
    frozen_path(path).write_text(frozen_path(own.path).read_text().replace(frozen.source_sha256, "0" * 64))
    (row, _) = rows_of(load(path, own.folder, own.build), "robot/good.txt")
    assert row["remarks"] == [
        "the source of tests.validation.bending:Bending has changed since the fit; fit again or restore it."
    ]


def test_source_of_a_component_includes_the_modules_that_it_imports(tmp_path, monkeypatch):
    """A change of a shared function is a change of the component; the standard library and the engine do not count."""
    monkeypatch.syspath_prepend(tmp_path)
    model = "import math\nfrom stiffness_of_a_part import stiffness\nfrom twin.component import Component\nclass Part(Component):\n    pass\n"
    (tmp_path / "part_of_a_robot.py").write_text(model)
    shared = tmp_path / "stiffness_of_a_part.py"
    shared.write_text("from modulus_of_a_part import E\ndef stiffness():\n    return E\n")
    (tmp_path / "modulus_of_a_part.py").write_text("E = 1.0\n")
    own = SimpleNamespace(keys=SimpleNamespace(component="part_of_a_robot:Part"))
    hashes = [ValidationSet.source_hash.fget(own)]
    for path, text in ((shared, "E = 1.0\n"), (tmp_path / "modulus_of_a_part.py", "E = 2.0\n")):
        path.write_text(path.read_text() + text if path == shared else text)
        hashes.append(ValidationSet.source_hash.fget(own))
    assert len(set(hashes)) == 3


def test_command_prints_json(frozen_robot):
    own, _ = frozen_robot
    words = ["validate", str(own.path), "--data", str(own.folder), "--build", str(own.build)]
    done = CliRunner().invoke(group, [*words, "--files", "robot/*d.txt", "--json"], catch_exceptions=False)
    rows = json.loads(done.stdout)["runs"]
    assert {row["file"] for row in rows} == {"robot/good.txt", "robot/slipped.txt"}
    wanted = "file quantity unit rmse mean_error largest coverage consistent rezeroed_rmse baselines"
    assert all(list(row)[:10] == wanted.split() for row in rows)


@pytest.mark.slow
def test_files_that_cannot_be_predicted_are_left_out_with_an_error(frozen_robot, tmp_path):
    own, _ = frozen_robot
    text = (own.folder / "robot/good.txt").read_text()
    lines = text.splitlines()
    (tmp_path / "robot").mkdir()
    (tmp_path / "elsewhere").mkdir()
    for name, content in {
        "elsewhere/good.txt": text,
        "robot/good.txt": text,
        "robot/lines.txt": "\r\n".join(lines[:300]),
        "robot/cut.txt": text[:2000],
        "robot/empty.txt": "",
        "robot/nul.txt": "\0" * 500,
        "robot/huge.txt": "\n".join([*lines[:-1], lines[-1].replace(lines[-1].split(",")[1], "1e308")]),
        "robot/column.txt": text.replace("Angle x", "Angle y"),
    }.items():
        (tmp_path / name).write_text(content, newline="")
    words = ["validate", str(own.path), "--data", str(tmp_path), "--build", str(own.build), "--json"]
    done = CliRunner().invoke(group, [*words, "--files", "*/*.txt"], catch_exceptions=False)
    result = json.loads(done.stdout)
    assert {row["file"] for row in result["runs"]} == {"robot/good.txt", "robot/lines.txt"}
    assert result["refused"].keys() == {f"robot/{name}.txt" for name in ("cut", "empty", "nul", "huge", "column")} | {
        "elsewhere/good.txt"
    }
    assert "there is no column `Angle x`" in result["refused"]["robot/column.txt"]
    assert result["refused"]["elsewhere/good.txt"].startswith("elsewhere/good.txt: fits no set's `files` in ")
    assert done.exit_code == 1
    assert sorted(done.stderr.splitlines()) == sorted(
        f"error: {text} The file was left out." for text in result["refused"].values()
    )
    with pytest.raises(TwinError, match=r"^elsewhere/good\.txt: fits no set's `files` .* Add a pattern there\.$"):
        validate(load(own.path, tmp_path, own.build), ["elsewhere/*.txt"])


def test_a_file_that_fits_several_sets_is_of_the_one_that_has_its_columns(frozen_robot, tmp_path):
    own, _ = frozen_robot
    path = tmp_path / "robot.yaml"
    other = ROBOT.partition("sets:\n")[2].replace("  decaying:", "  other:").replace("Tendon Disp.", "Stroke")
    path.write_text(ROBOT + other)
    for name, header in (("a", "Time,Stroke,Angle x,Pos z"), ("b", "Time,Tendon Disp.,Angle x,Height")):
        write_csv(tmp_path / f"robot/{name}.txt", *run(1), header=header)
    files, _ = load(path, tmp_path, own.build).assigned([])
    assert files == {"decaying": ["robot/b.txt"], "other": ["robot/a.txt"]}


MATLAB = ROBOT.replace("robot/*.txt", "robot/*.mat").replace(
    'columns: {tendon: {name: "Tendon Disp.", unit: mm}, angle: {name: "Angle x", unit: deg}, height: {name: Pos z, unit: mm}}',
    'columns: {tendon: {name: Stroke, unit: mm}, angle: {name: Bend, unit: deg}, height: {name: "tip_marker[3]", unit: mm}}',
)


def test_matlab_file_gives_the_same_figures(frozen_robot, tmp_path):
    own, _ = frozen_robot
    path = tmp_path / "robot.yaml"
    path.write_text(MATLAB)
    frozen_path(path).write_text(frozen_path(own.path).read_text())
    write_matlab(tmp_path / "robot/good.mat", *run(101))
    row = rows_of(load(path, tmp_path, own.build), "robot/*.mat")[0]
    assert row["rmse"] == pytest.approx(rows_of(own, "robot/good.txt")[0]["rmse"], rel=1e-6)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ({5: "0.03,abc,1,1"}, r"robot/bad.txt:5: Tendon Disp\. is 'abc', expected a number"),
        ({7: "0.05,2,,1"}, r"robot/bad.txt:7: Angle x is '', expected a number"),
        ({7: "0.05,2,nan,1"}, r"robot/bad.txt:7: Angle x is nan, expected a finite number"),
        ({7: "0.04,2,34,1"}, r"robot/bad.txt:7: time is the same as the row above"),
        ({7: "0.05,2,34"}, r"robot/bad.txt:7: Pos z is '', expected a number"),
        ({1: "Time,Tendon,Angle x,Pos z"}, r"robot/bad.txt: there is no column `Tendon Disp\.`"),
    ],
)
def test_bad_file_is_one_line(frozen_robot, lines, message):
    own, _ = frozen_robot
    path = own.folder / "robot/bad.txt"
    write_csv(path, *run(104))
    text = path.read_text().splitlines()
    for line, content in lines.items():
        text[line - 1] = content
    path.write_text("\n".join(text))
    try:
        with pytest.raises(TwinError, match=message) as caught:
            rows_of(own, "robot/bad.txt")
    finally:
        path.unlink()
    assert "\n" not in str(caught.value)


def test_a_network_without_scikit_learn_is_refused_before_the_fit(frozen_robot, tmp_path, monkeypatch):
    own, _ = frozen_robot
    monkeypatch.setitem(sys.modules, "sklearn", None)
    monkeypatch.setattr(runner, "fit", lambda *_, **__: pytest.fail("a fit takes long"))
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT.replace("play_cubic]", "narx]"))
    with pytest.raises(TwinError, match=r"^baseline narx needs sklearn"):
        fit_and_freeze(load(path, own.folder, own.build))


def test_missing_and_duplicate_samples_are_dropped_on_request(frozen_robot, tmp_path):
    own, _ = frozen_robot
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT.replace("time: Time", "time: Time\n    missing: drop\n    duplicates: mean"))
    frozen_path(path).write_text(frozen_path(own.path).read_text())
    write_csv(tmp_path / "robot/gaps.txt", *run(101))
    lines = (tmp_path / "robot/gaps.txt").read_text().splitlines()
    lines[50] = ",".join([lines[50].split(",")[0], "", "", ""])
    lines.insert(80, lines[80])
    (tmp_path / "robot/gaps.txt").write_text("\n".join(lines))
    row = rows_of(load(path, tmp_path, own.build), "robot/*")[0]
    assert row["rmse"] == pytest.approx(rows_of(own, "robot/good.txt")[0]["rmse"], rel=0.02)


def test_data_folder_is_missing(frozen_robot, monkeypatch):
    own, _ = frozen_robot
    monkeypatch.delenv("TWIN_VALIDATION_DATA", raising=False)
    with pytest.raises(TwinError, match=r"no data folder is named.*--data.*Ask the makers"):
        load(own.path, None, own.build)
    monkeypatch.setenv("TWIN_VALIDATION_DATA", str(own.folder))
    assert load(own.path, None, own.build).folder == own.folder


def test_no_file_fits(frozen_robot):
    own, _ = frozen_robot
    with pytest.raises(TwinError, match=r"no file in .* fits nothing/\*\.csv"):
        validate(own, ["nothing/*.csv"])


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("step: 10 ms", "", r"robot.yaml:5: sets.decaying: `step` is missing"),
        ("signal: angle", "signal: angel", r"sets.decaying.component: .*angel"),
        ("unit: deg, quantity", "unit: mm, quantity", r"sets.decaying.outputs.angle: .*mm"),
        ("gain: {from", "gian: {from", r"sets.decaying.fit.gian: .*gain"),
        ("baselines: [line", "baselines: [lime", r"robot.yaml:\d+: sets.decaying.baselines"),
    ],
)
def test_bad_validation_file_names_file_and_line(frozen_robot, tmp_path, before, after, message):
    own, _ = frozen_robot
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT.replace(before, after))
    with pytest.raises(TwinError, match=message):
        fit_and_freeze(load(path, own.folder, own.build), starts=1)


@pytest.mark.slow
def test_report_shows_figures_and_plots(frozen_robot):
    own, _ = frozen_robot
    page = html(own, validate(own, ["robot/*d.txt"]))
    assert page.count("<svg") == 8
    assert "1 of 2 runs not in agreement" in page
    assert "this run does not agree with the model from t = 0 s on" in page
