"""Measured data of a set: windows, jumps, inputs on the communication grid, samples between its rows, units."""

import numpy as np
import pytest

from tests.every_case import every_case
from tests.validation.arrays import data_of
from twin.errors import TwinError
from twin.validation.data import SetReader
from twin.validation.schema import SetKeys, rate

UNITS = {"pull": "m", "angle": "rad", "first_angle": "rad", "force": "N"}
KEYS = {
    "step": "10 ms",
    "time": "t",
    "columns": {"q": {"unit": "mm"}, "a": {"unit": "deg"}, "a_dot": {"unit": "deg/s"}},
    "inputs": {"q": "pull"},
    "outputs": {"a": {"signal": "angle", "rate": "a_dot"}},
    "initial": {"first_angle": "a"},
}


def reader(window=0, changes=None, **keys):
    return SetReader(SetKeys.model_validate({**KEYS, **keys}), UNITS, window, changes or {})


def write(path, *columns, header="t,q,a,a_dot"):
    np.savetxt(path, np.stack(columns, 1), "%.9g", ",", header=header, comments="")


@every_case(
    ("count", "window", "jumps", "parts"),
    [
        (7, 0, [], [(0, 7)]),
        (7, 3, [], [(0, 3), (3, 6)]),  # an incomplete last window is left out
        (6, 3, [], [(0, 3), (3, 6)]),
        (3, 3, [], [(0, 3)]),
        (7, 3, [4], [(0, 3), (3, 4), (4, 7)]),  # but for those that jumps make shorter
        (8, 3, [4], [(0, 3), (3, 4), (4, 7), (7, 8)]),
    ],
)
def test_rows_of_windows(count, window, jumps, parts):
    assert [(part.start, part.stop) for part in reader(window).parts(count, jumps, "a.csv")] == parts


def test_a_window_longer_than_the_file_is_refused():
    with pytest.raises(TwinError, match=r"^a\.csv: has 2 rows, fewer than a window of 3\. Choose a shorter window\.$"):
        reader(3).parts(2, [], "a.csv")


def test_a_change_twice_as_large_as_in_training_is_a_jump():
    columns = {"q": np.array([0.0, 1.0, 3.0, 2.0, 4.5]), "a": np.array([0.0, 9.0, 9.0, -9.0, -9.0])}
    assert reader(3, {"q": 1.0, "a": 9.0}).jumps(columns) == [4]  # a changes by 18 at most: no jump
    assert reader(3, {"q": 1.0, "a": 8.9}).jumps(columns) == [3, 4]
    assert reader(3, {"q": 0.0, "a": 9.0}).jumps(columns) == []  # q was constant in training: nothing is known of it
    assert reader(3, {}).jumps(columns) == []
    assert reader(0, {"q": 1.0, "a": 8.9}).jumps(columns) == []


def test_inputs_lie_on_the_grid_and_samples_between_its_rows():
    """Samples at 0, 14, 20 and 35 ms, steps of 10 ms: the grid ends at 40 ms, on the line through the last two samples."""
    grid, lower, weight = reader().gridded(
        {"time": np.array([5.0, 5.014, 5.02, 5.035]), "q": np.array([0.0, 14.0, 8.0, 11.0])}
    )
    assert grid == pytest.approx(np.array([[0.0], [10.0], [8.0], [10.0], [12.0]]))
    assert (1.0 - weight[3]) * grid[3] + weight[3] * grid[4] == pytest.approx(11.0)  # the sample's own input
    assert lower.tolist() == [0, 1, 2, 3]
    assert weight == pytest.approx([0.0, 0.4, 0.0, 0.5])
    grid, lower, weight = reader().gridded({"time": 7.3 + 0.01 * np.arange(300), "q": np.arange(300.0)})
    assert grid[:, 0] == pytest.approx(np.arange(300.0))  # times that rounding puts next to a row lie on it
    assert lower.tolist() == list(range(300))
    assert not weight.any()


def test_values_at_samples_are_on_straight_lines():
    data = data_of([np.zeros((3, 1))], [np.zeros((3, 1))])
    data.lower[:], data.weight[:] = [0, 1, 2], [0.25, 0.5, 0.0]
    assert data.at_samples(np.array([1.0, 3.0, -1.0])).tolist() == [1.5, 1.0, -1.0]
    assert data.at_samples(np.array([[1.0, 0.0], [3.0, 8.0], [-1.0, 2.0]])).tolist() == [
        [1.5, 2.0],
        [1.0, 5.0],
        [-1.0, 2.0],
    ]


def test_files_are_read_in_the_units_of_the_variables(tmp_path):
    """A file of two windows and one that jumps; millimetres and degrees become metres and radians."""
    write(tmp_path / "a.csv", [0, 0.01, 0.02, 0.03, 0.04], [1, 2, 3, 4, 5], [10, 20, 30, 40, 50], [7, 7, 8, 9, 9])
    write(tmp_path / "b.csv", [1, 1.02, 1.03], [0, 1, 9], [0, 10, 11], [5, 6, 4])
    data = reader(2, {"q": 1e-3, "a": 1.0}).read(tmp_path, ["a.csv", "b.csv"])
    degree = np.pi / 180
    assert (data.files, data.step, data.jumps) == (("a.csv", "b.csv"), 0.01, 1)
    assert data.hashes == tuple(reader().read(tmp_path, [name]).hashes[0] for name in ("a.csv", "b.csv"))
    assert [1e3 * window[:, 0] for window in data.inputs] == [
        pytest.approx([1, 2]),
        pytest.approx([3, 4]),
        pytest.approx([0, 0.5, 1]),
        pytest.approx([9]),
    ]
    assert data.initial["first_angle"] == pytest.approx(degree * np.array([10, 30, 0, 11]))
    assert data.measured == pytest.approx(degree * np.array([[10], [20], [30], [40], [0], [10], [11]]))
    assert data.first_measured() == pytest.approx(degree * np.array([[10], [30], [0], [11]]))
    assert data.rates == pytest.approx(degree * np.array([[7], [8], [5], [4]]))
    assert data.time == pytest.approx([0, 0.01, 0.02, 0.03, 1, 1.02, 1.03])
    assert data.file_index.tolist() == [0, 0, 0, 0, 1, 1, 1]
    assert data.window_index.tolist() == [0, 0, 1, 1, 2, 2, 3]
    assert data.lower.tolist() == [0, 1, 2, 3, 4, 6, 7]
    assert data.weight == pytest.approx(np.zeros(7), abs=1e-9)
    assert data.labels.tolist() == []
    assert data.changes == {"q": pytest.approx(1e-3), "a": pytest.approx(10 * degree)}


def test_rates_that_are_not_measured_are_zero(tmp_path):
    write(tmp_path / "a.csv", [0, 0.01], [1, 2], [3, 4], header="t,q,a")
    assert reader(outputs={"a": "angle"}).read(tmp_path, ["a.csv"]).rates.tolist() == [[0.0]]


def test_rows_that_any_column_misses_are_left_out(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,q,a,a_dot\n0,1,10,0\n0.01,,20,0\n0.02,3,30,0\n0.03,4,,0\n0.04,5,50,0\n")
    data = reader(missing="drop").read(tmp_path, ["a.csv"])
    assert data.time == pytest.approx([0, 0.02, 0.04])
    assert 1e3 * data.inputs[0][:, 0] == pytest.approx([1, 2, 3, 4, 5])
    assert np.degrees(data.measured[:, 0]) == pytest.approx([10, 30, 50])


def test_a_unit_that_does_not_fit_is_refused(tmp_path):
    write(tmp_path / "a.csv", [0, 0.01], [1, 2], [3, 4], [0, 0])
    with pytest.raises(TwinError, match=r"a\.csv.*kg.*Correct the unit in `columns`\.$"):
        reader(columns={**KEYS["columns"], "q": {"unit": "kg"}}).read(tmp_path, ["a.csv"])


@pytest.mark.parametrize(
    ("folds", "labels"),
    [
        ({"by": "column", "column": "who"}, ["left", "right"]),  # of the rows of complete windows
        ({"by": "column", "column": "whom"}, []),
        ({"by": "file"}, []),
    ],
)
def test_labels_of_folds_by_column(tmp_path, folds, labels):
    (tmp_path / "a.csv").write_text("t,q,a,a_dot,who\n0,1,1,0, left \n0.01,2,2,0,right\n0.02,3,3,0,right\n")
    assert reader(2, folds=folds).read(tmp_path, ["a.csv"]).labels.tolist() == labels


@pytest.mark.parametrize(("value", "share"), [("5 %", 0.05), ("50 %", 0.5), (0.01, 0.01), (0.5, 0.5)])
def test_rate_of_false_alarms(value, share):
    assert rate(value) == pytest.approx(share)


@every_case("value", ["0 %", "51 %", "often", 0, 0.51, -0.1, [0.05], None])
def test_no_rate_of_false_alarms(value):
    with pytest.raises(ValueError, match=r"^expected a rate above 0 % and up to 50 %, such as 5 %$"):
        rate(value)
