"""Tables of recorded files: cells as numbers, lists in cells, MATLAB arrays, missing and duplicate rows, gaps, traces."""

import numpy as np
import pytest
from scipy.io import savemat

from tests.every_case import every_case
from twin.errors import TwinError
from twin.identify import FileKeys, RecordedFile
from twin.identify.recordings.recorded_files import Column, located
from twin.identify.tables import chosen, cleaned, elements, expand_lists, numbers, read_matlab

NAN = float("nan")


def column(time, values, lines=()):
    return Column("a.csv", "q", "", np.array(time, float), np.array(values, float), np.array(lines, np.int64))


def keys(**fields):
    return FileKeys.model_validate({"file": "a.csv", **fields})


def rows(*cells):
    return [(k + 2, list(row)) for k, row in enumerate(cells)]


def test_cells_are_numbers():
    table = rows(["1", " 2.5 "], ["-3e2", "4"])
    assert numbers(table, ["a", "b"], 0, "a.csv", may_be_missing=False).tolist() == [1.0, -300.0]
    assert numbers(table, ["a", "b"], 1, "a.csv", may_be_missing=False).tolist() == [2.5, 4.0]
    assert numbers([], ["a"], 0, "a.csv", may_be_missing=False).tolist() == []
    missing = numbers(rows(["1"], [" "], ["nan"], [], ["2"]), ["a"], 0, "a.csv", may_be_missing=True)
    assert missing == pytest.approx([1, NAN, NAN, NAN, 2], nan_ok=True)


@every_case(
    ("cells", "may_be_missing", "message"),
    [
        ((["1"], [""]), False, r"^a\.csv:3: a is '', expected a number"),
        ((["1_000"],), False, r"^a\.csv:2: a is '1_000', expected a number"),
        ((["1"], []), False, r"^a\.csv:3: a is '', expected a number"),
        ((["nan"], ["x"]), False, r"^a\.csv:2: a is nan, expected a finite number"),
        (([""], ["nan"], ["x"]), True, r"^a\.csv:4: a is 'x', expected a number"),
        ((["inf"],), False, r"^a\.csv:2: a is inf, expected a finite number"),
    ],
)
def test_a_cell_that_is_no_number(cells, may_be_missing, message):
    with pytest.raises(TwinError, match=message):
        numbers(rows(*cells), ["a"], 0, "a.csv", may_be_missing=may_be_missing)


@every_case(
    ("cell", "parts"),
    [(" [1.5,2] ", ["1.5", "2"]), ("[7]", ["7"]), ("1,2", ["1,2"]), ("[1,2", ["[1,2"]), ("1]", ["1]"])],
)
def test_elements_of_a_cell(cell, parts):
    assert elements(cell) == parts


def test_lists_in_cells_are_columns():
    header, expanded = expand_lists(["t", "x", "y"], rows(["0", "[1,2]", "[3]"], ["1", " [4,5] ", "[6]"]), "a.csv")
    assert header == ["t", "x[1]", "x[2]", "y[1]"]
    assert expanded == [(2, ["0", "1", "2", "3"]), (3, ["1", "4", "5", "6"])]
    plain = ["t", "x"], rows(["0", "1"], ["1", "[2]"])
    assert expand_lists(*plain, "a.csv") == plain  # the first row decides
    assert expand_lists(["t"], [], "a.csv") == (["t"], [])


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ((["0", "[1,2]", "3"],), r"^a\.csv:2: has 3 cells, expected 2 as in the header\.$"),
        ((["0", "[1,2]"], ["1", "[3]"]), r"^a\.csv:3: x has 1 elements, expected 2 as in the first row\.$"),
        ((["0", "[1,2]"], ["1"]), r"^a\.csv:3: x has 0 elements, expected 2 as in the first row\.$"),
    ],
)
def test_a_list_of_another_length(cells, message):
    with pytest.raises(TwinError, match=message):
        expand_lists(["t", "x"], rows(*cells), "a.csv")


def test_vectors_and_matrices_of_a_matlab_file(tmp_path):
    """Of three columns, two rows, or a square: what has as many rows as most vectors have values."""
    content = {
        "t": np.arange(3.0)[:, None],
        "q": np.arange(3.0)[None, :] + 1,
        "is_on": np.array([[True], [False], [True]]),
        "tall": np.arange(6.0).reshape(3, 2),
        "wide": np.arange(6.0).reshape(2, 3),
        "other": np.zeros((4, 1)),
        "single": np.ones((1, 1)),
        "note": "text",
        "cube": np.zeros((3, 3, 3)),
    }
    savemat(tmp_path / "a.mat", content)
    found = {name: values.tolist() for name, values in read_matlab(tmp_path / "a.mat", "a.mat").items()}
    assert found == {
        "t": [0, 1, 2],
        "q": [1, 2, 3],
        "is_on": [1, 0, 1],
        "tall[1]": [0, 2, 4],
        "tall[2]": [1, 3, 5],
        "wide[1]": [0, 1, 2],
        "wide[2]": [3, 4, 5],
    }
    savemat(tmp_path / "b.mat", {"single": np.ones((1, 1)), "matrix": np.ones((3, 3))})
    with pytest.raises(TwinError, match=r"^b\.mat: has no vectors of numbers\. Save each signal as an n x 1 array\.$"):
        read_matlab(tmp_path / "b.mat", "b.mat")


@pytest.mark.parametrize("length", [0, 100, 127, 200, 300])
def test_a_matlab_file_that_is_cut_is_none(tmp_path, length):
    """What the reader of MATLAB files raises depends on where: in the header, a name or values."""
    path = tmp_path / "a.mat"
    savemat(path, {"t": np.arange(9.0)[:, None], "q": np.arange(9.0)[:, None]})
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(TwinError, match=r"^a\.mat: is no MATLAB file \(.*\)\.$"):
        read_matlab(path, "a.mat")


@every_case(
    ("time", "values", "options", "expected"),
    [
        ([0, 1, 1, 2], [5, 6, 8, 9], {}, ([0, 1, 1, 2], [5, 6, 8, 9])),
        ([0, 1, 1, 2], [5, 6, 8, 9], {"duplicates": "first"}, ([0, 1, 2], [5, 6, 9])),
        ([0, 1, 1, 2], [5, 6, 8, 9], {"duplicates": "mean"}, ([0, 1, 2], [5, 7, 9])),
        ([0, 0, 0, 2], [3, 6, 9, 9], {"duplicates": "mean"}, ([0, 2], [6, 9])),
        ([0, 1, NAN, 2], [5, NAN, 8, 9], {"missing": "drop"}, ([0, 2], [5, 9])),
        ([0, 1, 1, 2], [5, NAN, 8, 9], {"missing": "drop", "duplicates": "first"}, ([0, 1, 2], [5, 8, 9])),
        ([0, 1, 1, 1], [5, 2, NAN, 4], {"missing": "drop", "duplicates": "mean"}, ([0, 1], [5, 3])),
        ([3], [5], {"duplicates": "mean"}, ([3], [5])),
        ([3, 3], [5, 7], {"duplicates": "mean"}, ([3], [6])),
    ],
)
def test_missing_values_and_duplicate_times(time, values, options, expected):
    found = cleaned(column(time, values), keys(**options))
    assert (found.time.tolist(), found.values.tolist()) == expected


def test_rows_of_a_column_keep_their_lines():
    some = np.array([True, False, True])
    found = chosen(column([0, 1, 2], [5, 6, 7], [2, 3, 4]), some)
    assert (found.time.tolist(), found.values.tolist(), found.lines.tolist()) == ([0, 2], [5, 7], [2, 4])
    assert chosen(column([0, 1, 2], [5, 6, 7]), some).lines.tolist() == []
    assert (found.where(1), column([0], [1]).where(0)) == ("a.csv:4", "a.csv: row 1")


@every_case(
    ("longest_ns", "begin", "end", "message"),
    [
        (None, 0.0, 9.0, r"^a\.csv:5: q has no values for 5\.1 s before this row\. .* allow it: gap: 5\.1 s\.$"),
        (5_100_000_000, 0.0, 9.0, None),
        (5_000_000_000, 0.0, 9.0, r"for 5\.1 s before"),
        (900_000_000, 0.0, 9.0, r"^a\.csv:3: q has no values for 1 s before"),  # the first one
        (None, 0.0, 2.0, None),  # it begins where the run ends
        (None, 0.0, 2.1, r"5\.1 s"),
        (None, 7.1, 9.0, None),
        (None, 7.0, 9.0, r"5\.1 s"),
    ],
)
def test_a_gap_is_five_times_as_long_as_typical(longest_ns, begin, end, message):
    own = column([0, 1, 2, 7.1, 8.1], [1, 2, 3, 4, 5], [2, 3, 4, 5, 6])
    if message is None:
        own.refuse_gaps(longest_ns, begin, end)
        column([0, 1, 2, 7], [0, 0, 0, 0]).refuse_gaps(None, 0, 9)  # exactly five times
        return
    with pytest.raises(TwinError, match=message):
        own.refuse_gaps(longest_ns, begin, end)


TRACE = """time [s],id,data,node,service,text,values
0.5,181,00,1,PDO,,angle=2 speed=0.1
0.6,182,00,2,PDO,,torque=7
0.7,181,00,1,PDO,,speed=0.2
0.8,701,05,1,heartbeat,,angle=9
0.9,181,00,1,PDO,,angle=4 far_angle=8
"""


def test_names_of_a_decoded_trace_are_columns(tmp_path):
    (tmp_path / "a.csv").write_text(TRACE)
    file = RecordedFile(keys(start="0.5 s"), tmp_path)
    assert file.is_trace
    assert file.names == ["angle", "speed", "torque", "far_angle"]
    assert RecordedFile(keys(node=1), tmp_path).names == ["angle", "speed", "far_angle"]
    angle = file.column("angle")
    assert (angle.time.tolist(), angle.values.tolist(), angle.lines.tolist()) == ([0.0, 0.4], [2, 4], [2, 6])
    (tmp_path / "a.csv").write_text(TRACE.replace("torque", "speed"))
    with pytest.raises(TwinError, match=r"^a\.csv: nodes 1, 2 have speed\. Say which one: node: 1\.$"):
        RecordedFile(keys(), tmp_path).column("speed")
    assert RecordedFile(keys(node=1), tmp_path).column("speed").values.tolist() == [0.1, 0.2]


@pytest.mark.parametrize(
    ("text", "options", "time"),
    [
        ("t [ms],q\n0,1\n500,2\n", {}, [0.0, 0.5]),
        ("Time,q\n1,1\n2,2\n", {"start": "1 s"}, [0.0, 1.0]),
        ("clock [ms],q,time\n1,1,8\n2,2,9\n", {"time": "clock [ms]"}, [1e-3, 2e-3]),
        ("q,time\n1,8\n2,9\n", {"sample_time": "20 ms"}, [0.0, 0.02]),
        ("T,q\n0,1\n500,2\n", {"time": "T", "columns": {"T": {"unit": "ms"}}}, [0.0, 0.5]),
        ("time [s],q\n0,1\n500,2\n", {"columns": {"time [s]": {"unit": "ms"}}}, [0.0, 0.5]),
        ("T,q\n0,1\n500,2\n", {"time": "clock", "columns": {"clock": {"name": "T", "unit": "ms"}}}, [0.0, 0.5]),
    ],
)
def test_times_of_rows(tmp_path, text, options, time):
    (tmp_path / "a.csv").write_text(text)
    found = RecordedFile(keys(**options), tmp_path).column("q")
    assert (found.time.tolist(), found.values.tolist()) == (pytest.approx(time), [1, 2])


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("q\n1\n2\n", {}, r"^a\.csv: has no column `time`\. Say which one it is, such as time: 'q'"),
        ("q,time\n1,2\n", {"time": "tim"}, r"^a\.csv: there is no column `tim`\. Did you mean"),
        ("q,T\n1,2\n3,4\n", {"time": "T", "columns": {"T": {"unit": "N"}}}, r"^a\.csv: T \[N\] is no time"),
        ("q,time [N]\n1,2\n3,4\n", {}, r"^a\.csv: time \[N\] is no time\. Give it in s or ms\.$"),
        ("q,time\n1,2\n", {}, r"^a\.csv: q has 1 values\. Two at least are needed\.$"),
        ("q,time\n1,2\n3,1\n", {}, r"^a\.csv:3: time is before that of the row above\."),
        ("q,time\n1,2\n3,2\n", {}, r"^a\.csv:3: time is the same as the row above\."),
        ("q,q,time\n1,2,3\n", {}, r"^a\.csv:1: column q is there twice\. Rename one\.$"),
    ],
)
def test_times_that_do_not_go_on(tmp_path, text, options, message):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(TwinError, match=message):
        RecordedFile(keys(**options), tmp_path).column("q")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("runs/a/2/signals.parquet", "runs/a/2/signals.parquet"),
        ("runs/a/2", "runs/a/2/signals.parquet"),
        ("runs/a", "runs/a/3/signals.parquet"),
        ("runs/a/latest", "runs/a/3/signals.parquet"),
    ],
)
def test_a_run_and_the_newest_one_of_a_scenario(tmp_path, name, expected):
    for number in (3, 1, 2):
        folder = tmp_path / f"runs/a/{number}"
        folder.mkdir(parents=True)
        (folder / "signals.parquet").touch()
    assert located(tmp_path / name, name) == tmp_path / expected
    with pytest.raises(TwinError, match=r"^there is no file runs/b\. Give a path relative to this file\.$"):
        located(tmp_path / "none" / "b", "runs/b")
