"""Recordings in every form: tables, Parquet, runs, decoded traces of a bus."""

import hashlib

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from tests.study.recordings import MODEL
from twin.errors import TwinError
from twin.identify.recordings import replay
from twin.identify.recordings.recorded_files import RecordedFile
from twin.identify.recordings.schema import FileKeys
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, parse_scenario

TRACE = """time [s],id,data,node,service,text,values
0.100000,701,00,1,HEARTBEAT,servomotor: boot-up,state=0
0.200000,181,3712,1,PDO,"servomotor TPDO1: Statusword 1237h, bit 12",statusword=4663 position_actual_value=0.00028
0.205000,281,0000,1,PDO,servomotor TPDO2,velocity_actual_value=0.0
0.210000,181,3712,1,PDO,servomotor TPDO1,statusword=4663 position_actual_value=0.0003
0.215000,182,3712,2,PDO,other TPDO1,position_actual_value=9.0
"""


def column(folder, name, file, **keys):
    return RecordedFile(FileKeys(file=file, **keys), folder).column(name)


def test_a_table_with_units_semicolons_and_a_byte_order_mark(tmp_path):
    (tmp_path / "em.csv").write_text("\ufefftime [ms];tip [mm]\n0;1\n\n25;2\n50;4\n", encoding="utf-8")
    found = column(tmp_path, "tip [mm]", "em.csv", start="25 ms")
    assert found.time.tolist() == pytest.approx([-0.025, 0.0, 0.025])
    assert (found.values.tolist(), found.unit, found.lines.tolist()) == ([1, 2, 4], "mm", [2, 4, 5])


def test_process_data_of_a_decoded_trace(tmp_path):
    (tmp_path / "bus.csv").write_text(TRACE)
    found = column(tmp_path, "position_actual_value", "bus.csv", node=1, start="200 ms")
    assert found.time.tolist() == pytest.approx([0.0, 0.01])
    assert (found.values.tolist(), found.unit, found.lines.tolist()) == ([0.00028, 0.0003], "", [3, 5])
    with pytest.raises(TwinError, match=r"bus\.csv: nodes 1, 2 have position_actual_value\. Say which one: node: 1"):
        column(tmp_path, "position_actual_value", "bus.csv")
    assert "state" not in RecordedFile(FileKeys(file="bus.csv"), tmp_path).names


def test_a_run_and_the_newest_run_of_a_scenario(tmp_path, build):
    scenario = parse_scenario(MODEL.replace("4 s\n", "20 ms\n", 1) + "seeds: [1, 2]\n", tmp_path / "model.yaml")
    outcome = run_scenario(
        scenario, RunOptions(backend=Backend.compiled, root=tmp_path / "runs", build=build, report=False)
    )
    signals = outcome.tables["base", 2]
    for file in ("runs/model", "runs/model/latest", str(outcome.folder), str(outcome.folder / "signals.parquet")):
        found = column(tmp_path, "sheath.position[2]", file, seed=2)
        assert found.unit == "m"
        assert found.values.tobytes() == signals.values["sheath.position"][:, 1].tobytes()
    with pytest.raises(TwinError, match=r"2 cases are meant\. Say which one: variant: 'base', seed: 1; variant"):
        column(tmp_path, "sheath.tip_position", "runs/model")


def test_any_parquet_file(tmp_path):
    fields = [
        pa.field("time [ms]", pa.float32()),
        pa.field("tip", pa.float64(), metadata={"unit": "mm"}),
        pa.field("x", pa.string()),
    ]
    values = [pa.array([0.0, 25.0], pa.float32()), pa.array([1.0, None]), pa.array(["a", "b"])]
    parquet.write_table(pa.table(values, pa.schema(fields)), tmp_path / "em.parquet")
    with pytest.raises(TwinError, match=r"em\.parquet: row 2: tip is missing"):
        column(tmp_path, "tip", "em.parquet")
    with pytest.raises(TwinError, match=r"em\.parquet: x has no numbers but string"):
        column(tmp_path, "x", "em.parquet")
    values[1] = pa.array([1.0, 2.0])
    parquet.write_table(pa.table(values, pa.schema(fields)), tmp_path / "em.parquet")
    found = column(tmp_path, "tip", "em.parquet")
    assert (found.time.tolist(), found.values.tolist(), found.unit) == ([0.0, 0.025], [1.0, 2.0], "mm")


def test_files_are_known_by_their_hash(tmp_path):
    (tmp_path / "em.csv").write_text("time,x\n0,1\n1,2\n")
    file = RecordedFile(FileKeys(file="em.csv"), tmp_path)
    assert file.sha256 == hashlib.sha256(b"time,x\n0,1\n1,2\n").hexdigest()
    assert np.all(file.column("x").lines == [2, 3])


@pytest.mark.parametrize("content", ["", "time,x\n", "time,x\n0,1\n"])
def test_a_file_with_too_little(tmp_path, content):
    (tmp_path / "em.csv").write_text(content)
    with pytest.raises(TwinError, match=r"em\.csv: (is empty|x has [01] values)"):
        column(tmp_path, "x", "em.csv")


REDUCED = """
stop_time: 1 s
members:
  heart: {component: heart}
  wall: {component: wall}
  follower: {component: wall}
  other: {component: heart}
connections: [heart.position -> wall.heart_position, heart.position -> follower.heart_position]
events:
  - {at: 0.5 s, set: {heart.rate: 2 Hz}}
  - {at: 0.5 s, set: {other.rate: 2 Hz}}
"""


def test_what_has_no_influence_is_not_simulated():
    """Nor does it have events; what only reads is left out, too."""
    case = parse_scenario(REDUCED).cases()[0]
    reduced = replay.with_influence(case, ["wall.displacement"])
    assert list(reduced.members) == ["heart", "wall"]
    assert [one.target for one in reduced.connections] == ["wall.heart_position"]
    assert [one.variable for one in reduced.events] == ["heart.rate"]
