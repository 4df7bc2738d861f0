"""A CSV file as a member of a scenario."""

from __future__ import annotations

import pytest

from twin.errors import ScenarioError
from twin.results.recording.run_folder import read_signals
from twin.run import RunOptions, resolve_catalogs, run_scenario
from twin.scenario import load_scenario

SCENARIO = """
start_time: 0.1 s
stop_time: 0.5 s
step: 50 ms
members:
  operator: {component: command.csv, parameters: {hold: HOLD}}
  wall: {component: wall}
connections: [operator.position -> wall.tip_position]
record: {variables: [operator.position, operator.speed, wall.tip_position]}
"""
TABLE = "time,position [mm],speed [m/s]\n0.2,1,5\n0.3000001,2,5\n0.4,2,5\n0.4,4,6\n"


def followed(tmp_path, build, hold):
    (tmp_path / "command.csv").write_text(TABLE)
    path = tmp_path / "s.yaml"
    path.write_text(SCENARIO.replace("HOLD", hold))
    done = run_scenario(load_scenario(path), RunOptions(root=tmp_path, build=build, report=False))
    assert done.passed
    return read_signals(done.folder / "signals.parquet")[0]["base", 0].values


def test_linear_between_rows(tmp_path, build):
    found = followed(tmp_path, build, "false")
    # at 0.1, 0.15, ..., 0.5 s; 0.3 s is a hair before its row
    assert found["operator.position"] == pytest.approx([1, 1, 1, 1.5, 2, 2, 4, 4, 4], abs=1e-5)
    assert found["operator.speed"].tolist() == [5] * 6 + [6] * 3
    # whoever follows takes, at each communication point, the row that its time names
    assert found["wall.tip_position"][1:] == pytest.approx(found["operator.position"][:-1] * 1e-3)


def test_rows_closer_than_a_thousandth_of_a_step(tmp_path, build, monkeypatch):
    """Rows of 10 us and steps of 50 ms: at 0.1, 0.15, ..., 0.5 s the position is the time in mm."""
    rows = "".join(f"{k / 1e5},{k / 1e5},0\n" for k in range(60_000))
    monkeypatch.setitem(globals(), "TABLE", f"time,position [mm],speed [m/s]\n{rows}")
    for hold in ("false", "true"):
        position = followed(tmp_path, build, hold)["operator.position"]
        assert position == pytest.approx([0.1 + 0.05 * k for k in range(9)], abs=1e-9)


def test_held_between_rows(tmp_path, build):
    assert followed(tmp_path, build, "true")["operator.position"].tolist() == [1, 1, 1, 1, 2, 2, 4, 4, 4]


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ("", "command.csv: is empty."),
        ("t,x\n0,1\n", "command.csv:1: expected a column `time` and rows below the header."),
        ("time,x\n", "command.csv:1: expected a column `time` and rows below the header."),
        ("time,x\n0,1_000\n", "command.csv:2: x is '1_000', expected a number."),
        ("time,x\n0,a\n", "command.csv:2: x is 'a', expected a number."),
        ("time,x\n1,0\n0,0\n", "command.csv:3: time 0 is before 1. Sort the rows."),
        ("time,x,x\n0,1,2\n", "command.csv:1: column 'x' stands there twice."),
        ("time,my x\n0,1\n", "command.csv:1: column 'my x' is no name of a variable."),
        ("time,x [blorb]\n0,1\n", "command.csv:1: "),
        ("time,step\n0,1\n", "command.csv:1: step: this name is the engine's own. Choose another."),
        ("time,x\n0,nan\n", "command.csv:2: x is nan, expected a finite number."),
    ],
)
def test_what_is_wrong_with_a_table(tmp_path, table, expected):
    (tmp_path / "command.csv").write_text(table)
    path = tmp_path / "s.yaml"
    path.write_text("stop_time: 1 s\nmembers: {operator: {component: command.csv}}\n")
    with pytest.raises(ScenarioError) as caught:
        resolve_catalogs(load_scenario(path))
    (line,) = caught.value.problems
    assert line.startswith(f"{path}:2: member `operator`: {tmp_path}/{expected}")


def test_a_table_that_is_not_there(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text("stop_time: 1 s\nmembers: {operator: {component: none.csv}}\n")
    with pytest.raises(ScenarioError, match=r"there is no file .*none\.csv\. Give a path relative to the scenario\."):
        load_scenario(path)
