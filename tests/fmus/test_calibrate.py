"""Calibration from readings: exact on exact readings, a catheter's own model from its own readings, clear errors."""

import csv
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from fmus.coordinate_feedforward import calibrate
from fmus.coordinate_feedforward.model import CoordinateFeedforward
from fmus.pull_wire_catheter.model import PullWireCatheter

from fmus import injection
from twin.cli.calibrate import command
from twin.cli.check import check_file
from twin.errors import TwinError

ROOT = Path(__file__).parent.parent.parent
MM = 1e-3
QUIET = {"deviation_y": 0.0, "deviation_z": 0.0, "deviation_needle": 0.0, "wire_play": 0.0}

# a catheter that is not the paper's: softer guide, another bend, more slack, other needle
OTHER = {
    "slope": 0.06,
    "reversal_offset": 2.4,
    "dead_band": 1.5,
    "bend_y": (-0.75, 0.05, 0.40, -0.025),
    "bend_z": (0.3, -0.3, 0.16, -0.007),
    "needle": (0.5, -0.9, 0.08),
}


def readings(**values):
    """Tables of a catheter's bench, as a person would record them [mm]."""
    catheter = PullWireCatheter(**{**QUIET, **values})
    catheter.start()
    place = np.zeros(3)

    def go(handle, wire, needle):
        target = np.array((handle, wire, needle), float)
        for part in np.linspace(0.0, 1.0, 21)[1:]:
            now = place + part * (target - place)
            catheter.handle_position, catheter.wire_position, catheter.needle_position = MM * now
            catheter.advance(0.0, 1e-3)
        place[:] = target
        return float(catheter.tip_y) / MM, float(catheter.tip_z) / MM, float(catheter.needle_length) / MM

    rng = np.random.default_rng(1)
    tables = {"linear": [(handle, go(handle, 0, 3)[1]) for handle in (0.0, *rng.uniform(0, 20, 150))]}
    go(0, 0, 3)
    tables["deflection"] = [(pull, *go(15, pull, 3)[:2]) for pull in np.arange(0.0, 9.1, 0.5)]
    go(0, 0, 3)
    tables["coupling"] = [
        (pull, handle, *go(handle, pull, 3)[:2])
        for pull in range(10)
        for handle in (*range(0, 21, 2), *range(19, -1, -2), 0)
    ]
    slides = (*np.arange(3.0, 11.6, 0.5), *np.arange(11.0, 2.9, -0.5))
    tables["needle"] = [(pull, slide, go(0, pull, slide)[2]) for pull in (0, 2, 4, 6, 8) for slide in slides]
    tables["steppers"] = [(sign * 1600, sign * way) for way in (7.65, 7.7, 7.75) for sign in (1, -1)]
    return tables


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """CSV files of the paper's and of another catheter."""
    place = tmp_path_factory.mktemp("readings")
    for label, values in (("paper", {}), ("other", OTHER)):
        for table, rows in readings(**values).items():
            with (place / f"{label}_{table}.csv").open("w", newline="") as file:
                writer = csv.writer(file)
                writer.writerow(calibrate.TABLES[table])
                writer.writerows(rows)
    return place


@pytest.fixture(autouse=True)
def no_picture(monkeypatch):
    """Leave out the picture, which takes longer than all else; tests/results/test_calibration.py draws one."""
    monkeypatch.setattr("twin.results.calibration_report.to_svg", lambda result: "<svg>")


def run(*arguments):
    return CliRunner().invoke(command, list(map(str, arguments)), catch_exceptions=False)


def calibrated(folder, label, tmp_path):
    files = [f"{table}={folder / f'{label}_{table}.csv'}" for table in calibrate.TABLES]
    result = run("coordinate_feedforward", *files, "-o", tmp_path / "model.yaml")
    assert result.exit_code == 0, result.output
    return yaml.safe_load((tmp_path / "model.yaml").read_text())["parameters"]


@pytest.mark.slow
def test_exact_readings_give_the_papers_coefficients(folder, tmp_path):
    found = calibrated(folder, "paper", tmp_path)
    assert found["lead"] == pytest.approx(7.7e-3)
    assert found["slope"] == pytest.approx(injection.SLOPE, abs=1e-9)
    assert found["reversal_offset"] == pytest.approx(injection.REVERSAL_OFFSET, abs=1e-9)
    assert found["dead_band"] == 1.0
    assert found["bend_z"] == pytest.approx(injection.BEND_Z, abs=0.01)
    assert found["needle"] == pytest.approx(injection.NEEDLE, abs=1e-9)
    assert found["needle_back"] == pytest.approx(injection.RETRACTION, abs=1e-6)


def visited(parameters, catheter_values):
    """RMS of y and z [mm] over 40 coordinates with a controller that has these parameters."""
    controller = CoordinateFeedforward(**{name: value for name, value in parameters.items() if "needle" not in name})
    catheter = PullWireCatheter(**{**QUIET, **catheter_values})
    controller.start()
    catheter.start()
    rng = np.random.default_rng(3)
    errors = []
    for k in range(40):
        controller.target_y, controller.target_z = MM * rng.uniform((0, 0), (12, 10))
        begin = float(controller.handle_position), float(controller.wire_position)
        controller.advance(0.01 * k, 0.01)
        assert controller.refusal == 0
        end = float(controller.handle_position), float(controller.wire_position)
        for part in np.linspace(0, 1, 21)[1:]:
            catheter.handle_position, catheter.wire_position = (
                a + part * (b - a) for a, b in zip(begin, end, strict=True)
            )
            catheter.advance(0.0, 1e-3)
        errors.append((catheter.tip_y - controller.target_y, catheter.tip_z - controller.target_z))
    return np.sqrt(np.mean(np.square(errors), axis=0)) / MM


@pytest.mark.slow
def test_another_catheter_gets_its_own_model(folder, tmp_path):
    """With the paper's model it misses by millimeters; with its own by what a smooth fit of the surfaces leaves."""
    theirs, own = visited({}, OTHER), visited(calibrated(folder, "other", tmp_path), OTHER)
    assert np.all(theirs > 0.5)
    assert np.all(own < 0.15)


def test_the_tables_are_listed():
    result = run("coordinate_feedforward")
    for table, columns in calibrate.TABLES.items():
        assert table in result.output
        for column in columns:
            assert column in result.output


HANDLE = (0, 6, 12, 18, 12, 6, 2, 9, 15, 4, 10, 3, 16, 20, 5)  # [mm]
TIP = (0.01, 6.41, 12.72, 19.06, 15.12, 8.81, 4.53, 9.5, 15.83, 6.61, 10.54, 5.68, 16.93, 21.18, 7.66)


def moves(path, header="handle_mm,tip_mm", factor=1.0, tips=TIP):
    """Moves of a handle, as in the how-to page."""
    rows = [f"{handle * factor},{tip}" for handle, tip in zip(HANDLE, tips, strict=True)]
    path.write_text("\n".join([header, *rows]) + "\n")


@pytest.mark.parametrize("alias", ["{name: Handle, unit: cm}", "{name: 'Slide [cm]'}", "{name: Slide}"])
def test_columns_have_names_and_units_of_ones_own(alias, tmp_path):
    moves(tmp_path / "own.csv", "Handle,EM z" if "Handle" in alias else "Slide [cm],EM z", 0.1)
    moves(tmp_path / "plain.csv")
    (tmp_path / "columns.yaml").write_text(f"columns: {{linear: {{handle_mm: {alias}, tip_mm: EM z}}}}")
    results = []
    for name, options in (("own", ("--columns", tmp_path / "columns.yaml")), ("plain", ())):
        target = tmp_path / f"{name}.yaml"
        assert run("coordinate_feedforward", f"linear={tmp_path / name}.csv", "-o", target, *options).exit_code == 0
        results.append(yaml.safe_load(target.read_text())["parameters"])
    assert results[0] == pytest.approx(results[1])


def test_a_poor_fit_is_reported(tmp_path):
    moves(tmp_path / "a.csv", tips=[tip + (-1) ** k for k, tip in enumerate(TIP)])
    result = run("coordinate_feedforward", f"linear={tmp_path / 'a.csv'}", "-o", tmp_path / "out.yaml")
    assert "warning: reversal: RMSE " in result.output
    assert "of the range. Check columns, units and order of its rows." in (tmp_path / "out.yaml").read_text()


def test_a_fit_of_the_play_is_judged_by_its_error_in_mm(tmp_path):
    """R2 of a nearly constant offset is small however exact the readings are; inches without a unit give a hint."""
    moves(tmp_path / "a.csv")
    exact = run("coordinate_feedforward", f"linear={tmp_path / 'a.csv'}", "-o", tmp_path / "a.yaml").output
    assert "warning" not in exact
    assert "6 of 15" in exact
    assert (tmp_path / "a.svg").exists()
    moves(tmp_path / "b.csv", factor=1 / 25.4)
    inches = run("coordinate_feedforward", f"linear={tmp_path / 'b.csv'}", "-o", tmp_path / "b.yaml").output
    assert "warning: linear.handle_mm spans 0.787 mm" in inches


def test_exchanged_columns_and_contradicting_moves_are_reported(tmp_path):
    """A negative slope or offset contradicts the equations; so does a first move in which the tip goes too far."""
    moves(tmp_path / "a.csv")
    header, *rows = (tmp_path / "a.csv").read_text().splitlines()
    (tmp_path / "swapped.csv").write_text("\n".join([",".join(reversed(header.split(","))), *rows]))
    result = run("coordinate_feedforward", f"linear={tmp_path / 'swapped.csv'}", "-o", tmp_path / "b.yaml").output
    assert "is negative: the tip would move less than the handle. Check columns and signs." in result
    assert "warning: reversal_offset: -" in (tmp_path / "b.yaml").read_text()
    moves(tmp_path / "c.csv", tips=[TIP[0] - 3.0, *TIP[1:]])
    result = run("coordinate_feedforward", f"linear={tmp_path / 'c.csv'}", "-o", tmp_path / "c.yaml").output
    assert "warning: linear: unused moves contradict the fits, those to row 2." in result


def test_repeated_readings_are_one(tmp_path):
    """Each place read twice, or some, for the noise: no reversals, and as many moves."""
    results = []
    for repeats in (1, 2, [1, 2, 3] * 5):
        table = {name: np.repeat(values, repeats) for name, values in (("handle_mm", HANDLE), ("tip_mm", TIP))}
        parameters, fits = calibrate.calibrate({"linear": table})
        results.append((parameters, len(fits["reversal"].used)))
        assert np.array_equal(table["tip_mm"][fits["reversal"].used], np.array(TIP)[[4, 7, 9, 10, 11, 12, 14]])
    assert results[0] == results[1] == results[2]


PULL = np.arange(0.0, 9.1, 0.5)
WAY = np.maximum(PULL - 1.0, 0.0) ** 2 / 8.0
STEPS = np.array([1600.0, -1600.0] * 3)


@pytest.mark.parametrize(
    ("table", "values", "message"),
    [
        ("linear", (HANDLE, np.full(15, 3.0)), "Take more, at more places. The same in all rows: linear.tip_mm."),
        (
            "deflection",
            (PULL[6:], WAY[6:] - WAY[6], -WAY[6:]),
            "from the first pull on, 3 mm, so the wire was not slack",
        ),
        ("deflection", (PULL, WAY, WAY), "z_mm rises with the pull, expected to fall"),
        ("steppers", (STEPS, np.full(6, 7.7)), "steppers: 0 mm per revolution of 1600 steps, expected 0.1 to 100 mm"),
        ("steppers", (STEPS, STEPS * 7.7e-3 / 1600), "steppers: 0.0077 mm per revolution"),
    ],
)
def test_readings_that_mean_something_else_are_refused(table, values, message, tmp_path):
    path = tmp_path / "a.csv"
    rows = [",".join(calibrate.TABLES[table]), *(",".join(map(str, row)) for row in zip(*values, strict=True))]
    path.write_text("\n".join(rows))
    with pytest.raises(TwinError) as error:
        run("coordinate_feedforward", f"{table}={path}", "-o", tmp_path / "out.yaml")
    assert message in str(error.value)


@pytest.mark.slow
def test_standard_errors_are_the_spread_of_repeated_calibrations():
    """Of 200 tables of a guide with play and noisy readings: the stated errors are the deviation from table to table."""
    rng, deviations = np.random.default_rng(4), []
    for _ in range(200):
        handle = np.concatenate([[0.0], rng.uniform(0, 20, 60)])
        move = np.diff(handle)
        turned = np.diff(np.sign(move), prepend=1.0) != 0
        tip = np.cumsum([0.0, *np.sign(move) * (1.06 * np.abs(move) - 2.5 * turned)])
        table = {"handle_mm": handle, "tip_mm": tip + rng.normal(0, 0.05, 61)}
        parameters, fits = calibrate.calibrate({"linear": table})
        errors = calibrate.standard_errors(fits)
        true = {"slope": 0.06, "reversal_offset": 2.5}
        deviations.append([(parameters[name] - value) / errors[name] for name, value in true.items()])
    assert np.abs(np.mean(deviations, axis=0)).max() < 0.3
    assert np.std(deviations, axis=0) == pytest.approx((1.0, 1.0), abs=0.25)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ("{linear: {handle: Handle}}", "has no table with column linear.handle"),
        ("{linear: {handle_mm: {name: handle_mm, unit: N}}}", "Correct the unit of handle_mm"),
        ("{linear: {handle_mm: {naem: Handle}}}", "columns.yaml:1: columns.linear.handle_mm"),
    ],
)
def test_wrong_columns_are_one_line(columns, message, tmp_path):
    moves(tmp_path / "moves.csv")
    (tmp_path / "columns.yaml").write_text(f"columns: {columns}")
    with pytest.raises(TwinError) as error:
        run("coordinate_feedforward", f"linear={tmp_path / 'moves.csv'}", "--columns", tmp_path / "columns.yaml")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


BAD = [
    ("", "column `handle_mm` is missing; there is nothing"),
    ("handle_mm;tip\n1;2\n", "column `tip_mm` is missing; there is handle_mm, tip"),
    ("handle_mm,tip_mm\n", "has no readings below its header"),
    ("handle_mm,tip_mm\n1,2\n3\n", "moves.csv:3: tip_mm is '', expected a number"),
    ("handle_mm,tip_mm\n1,two\n", "moves.csv:2: tip_mm is 'two', expected a number"),
    ("handle_mm;tip_mm\n1;2,5\n", "moves.csv:2: tip_mm is '2,5', expected a number. Write a decimal point"),
    ("handle_mm,tip_mm\n1,nan\n", "moves.csv:2: tip_mm is nan, expected a finite number"),
    ("handle_mm,tip_mm\n1,2\n2,3\n", "linear, reversals: 0 usable readings do not determine 2 coefficients"),
    ("handle_mm,tip_mm\n" + "0,0\n10,9\n" * 20, "linear, reversals: 38 usable readings do not determine 2"),
]


@pytest.mark.parametrize(("content", "message"), BAD)
def test_a_bad_file_is_one_line(content, message, tmp_path):
    (tmp_path / "moves.csv").write_text(content)
    with pytest.raises(TwinError) as error:
        run("coordinate_feedforward", f"linear={tmp_path / 'moves.csv'}", "-o", tmp_path / "out.yaml")
    assert message in str(error.value)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out.yaml").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["heart", "a=b.csv"], "heart: has no calibration"),
        (["coordinate_feedforward", "linear"], "linear: expected TABLE=FILE.csv"),
        (["coordinate_feedforward", "bend=b.csv"], "has no table 'bend'. Its tables: steppers"),
        (["coordinate_feedforward", "linear=nowhere.csv"], "nowhere.csv: cannot be read"),
        (["coordinate_feedforward", "linear=a.csv", "linear=b.csv"], "table linear is given twice"),
    ],
)
def test_wrong_arguments_are_one_line(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TwinError) as error:
        run(*arguments)
    assert message in str(error.value)


@pytest.mark.slow
def test_coupling_needs_the_tables_that_it_builds_on(folder, tmp_path):
    with pytest.raises(TwinError, match="coupling: needs the tables deflection and linear"):
        run("coordinate_feedforward", f"coupling={folder / 'paper_coupling.csv'}", "-o", tmp_path / "out.yaml")


@pytest.mark.slow
def test_a_file_is_not_replaced_unasked(folder, tmp_path):
    target = tmp_path / "model.yaml"
    target.write_text("mine")
    arguments = ["coordinate_feedforward", f"steppers={folder / 'paper_steppers.csv'}", "-o", target]
    with pytest.raises(TwinError, match=r"exists\. Use --force"):
        run(*arguments)
    assert target.read_text() == "mine"
    assert run(*arguments, "--force").exit_code == 0
    assert "lead" in target.read_text()


@pytest.mark.slow
def test_the_file_is_what_a_scenario_takes(folder, tmp_path):
    parameters = calibrated(folder, "other", tmp_path)
    patch = {
        "extends": str(ROOT / "scenarios/coordinate_feedforward.yaml"),
        "members": {"feedforward": {"parameters": parameters}},
    }
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(patch))
    problems, _ = check_file(str(tmp_path / "mine.yaml"))
    assert problems == []
