"""Simulations of an FMU from Python: inputs of every kind, and what is wrong with them."""

import numpy as np
import pandas as pd
import pytest

import twin
from twin.errors import FMUError, SimulationError


def test_inputs_of_every_kind_do_the_same(fmu, tmp_path):
    times, pushes = [0.0, 0.5, 1.0], [0.0, 1.0, 2.0]
    frame = pd.DataFrame({"time": times, "push": pushes})
    frame.to_csv(tmp_path / "in.csv", index=False)
    given = [
        frame,
        frame.set_index("time"),
        {"time": np.array(times), "push": pushes},
        tmp_path / "in.csv",
        str(tmp_path / "in.csv"),
        frame.to_records(index=False),
        pd.DataFrame({"time": times, "push [mN]": [0, 1000, 2000]}),
    ]
    tables = [twin.simulate(fmu, one, stop_time="1 s", step_size="100 ms") for one in given]
    assert all(np.allclose(table.to_numpy(float), tables[0].to_numpy(float)) for table in tables)
    assert tables[0].attrs["units"]["place"] == "m"
    assert [tables[0][name].dtype.kind for name in ("time", "count", "odd")] == ["f", "i", "b"]
    # what twin made keeps its units
    again = pd.DataFrame({"time": times, "push": [0, 1000, 2000]})
    again.attrs["units"] = {"push": "mN"}
    assert np.allclose(twin.simulate(fmu, again, stop_time=1, step_size=0.1).place, tables[0].place)


@pytest.mark.parametrize(
    "wrong",
    [
        {"input": 3},
        {"input": {"time": [0, 1], "push": [1]}},
        {"input": {"push": [1]}},
        {"input": {"time": [None], "push": [1]}},
        {"input": {"time": [0], "pusch": [1]}},
        {"input": {"time": [0], "push": [float("nan")]}},
        {"input": {}},
        {"input": {"time": [1, 0], "push": [1, 1]}},
        {"input": "missing.csv"},
        {"record": "plce"},
        {"stop_time": -1},
        {"stop_time": "soon"},
        {"start_values": {"gian": 1}},
        {"step_size": 0},
    ],
)
def test_what_is_wrong_with_a_simulation_is_one_line(fmu, wrong):
    with pytest.raises(twin.TwinError) as caught:
        twin.simulate(fmu, **{"stop_time": 1, **wrong})
    assert len(caught.value.problems) == 1
    assert "--" not in str(caught.value)


def test_there_is_no_such_fmu():
    with pytest.raises(FMUError, match="is not there"):
        twin.simulate("missing.fmu")
    assert issubclass(SimulationError, twin.TwinError)
