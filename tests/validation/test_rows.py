"""Rows of measured files that miss a value or stand twice, with the keys of the shipped validations."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.io import savemat

from twin.validation import load, validate

FOLDER = Path(__file__).parents[2] / "validation"


@pytest.mark.parametrize(
    "path", sorted(file for file in FOLDER.glob("*.yaml") if ".parameters" not in file.name), ids=lambda path: path.stem
)
def test_shipped_validations_take_incomplete_files(path):
    for keys in yaml.safe_load(path.read_text())["sets"].values():
        assert (keys["missing"], keys["duplicates"]) == ("drop", "first")


def test_a_row_that_one_column_misses_is_left_out(tmp_path, build):
    count = 60
    time, stroke = np.arange(count) * 0.25, np.abs(np.sin(np.arange(count) / 9.0)) * 3.0
    marker = np.stack([1.5 + stroke, 15.0 - 4.0 * stroke, -155.0 - stroke], 1)
    results = []
    for name, broken in (("whole", False), ("broken", True)):
        folder = tmp_path / name / "tendon_robot" / "random"
        folder.mkdir(parents=True)
        moved, times = marker.copy(), time.copy()
        if broken:
            moved[20] = np.nan
            times[40] = times[39]
        savemat(folder / "a.mat", {"Time": times[:, None], "Stroke": stroke[:, None], "tip_marker": moved})
        own = load(FOLDER / "tendon_robot.yaml", tmp_path / name, build)
        ((row, *_),) = [one.rows for one in validate(own, ["tendon_robot/random/*.mat"], None)]
        results.append(row["rmse"])
    assert np.isfinite(results).all()
    assert results[1] == pytest.approx(results[0], rel=0.1)
