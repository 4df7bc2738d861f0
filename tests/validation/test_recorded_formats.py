"""`twin identify` reads recordings as they are: any column names and units, MATLAB matrices, Parquet, lists in cells."""

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from tests.validation.synthetic import PERIOD, run, write_csv, write_matlab
from twin.errors import ScenarioError
from twin.identify import load

FILE = """
component: tests.validation.bending:Bending
step: 10 ms
data: {{file: {file}, {time}, columns: {{tendon: {{name: {tendon}, unit: mm}}, angle: {{name: {angle}, unit: deg}}}}}}
inputs: {{tendon: Bending.tendon}}
outputs: {{angle: Bending.angle}}
fit: {{Bending.gain: {{from: 50, to: 200}}}}
"""


def write_parquet(path, time, tendon, angle):
    path.parent.mkdir(exist_ok=True)
    parquet.write_table(pa.table({"Time": time, "Stroke": 1e3 * tendon, "Bend": np.degrees(angle)}), path)


def write_lists(path, _time, tendon, angle):
    path.parent.mkdir(exist_ok=True)
    rows = [f'"[0,{a:.9g}]","[{q:.9g}]"' for a, q in zip(np.degrees(angle), 1e3 * tendon, strict=True)]
    path.write_text("\n".join(["state,input", *rows]))


FORMATS = {
    "a.txt": (write_csv, "time: Time", "Tendon Disp.", "Angle x"),
    "a.mat": (write_matlab, "time: Time", "Stroke", "Bend"),
    "a.parquet": (write_parquet, "time: Time", "Stroke", "Bend"),
    "lists.txt": (write_lists, "sample_time: 10 ms", '"input[1]"', '"state[2]"'),
}


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", FORMATS)
def test_formats_give_the_same_problem(name, tmp_path):
    write, time_key, tendon, angle = FORMATS[name]
    time, moved, measured = run(1)
    write(tmp_path / "data" / name, time, moved, measured)
    path = tmp_path / "fit.yaml"
    path.write_text(FILE.format(file=f"data/{name}", time=time_key, tendon=tendon, angle=angle))
    (output,) = load(path).outputs
    assert output.values == pytest.approx(measured, rel=1e-7)
    assert output.time == pytest.approx(PERIOD * np.arange(len(time)), abs=1e-7)


def test_unknown_column_is_one_line(tmp_path):
    write_csv(tmp_path / "data/a.txt", *run(1))
    path = tmp_path / "fit.yaml"
    path.write_text(FILE.format(file="data/a.txt", time="time: Time", tendon="Tendn Disp.", angle="Angle x"))
    with pytest.raises(ScenarioError, match=r"data/a.txt: there is no column `Tendn Disp\.`.*Tendon Disp\."):
        load(path)
