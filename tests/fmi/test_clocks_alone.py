"""Clocks on import, an FMU alone: steps that end at ticks, input tables, Scheduled Execution, Model Exchange."""

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.fmi3 import FMU3ScheduledExecution

from tests.fmi.clock_parts import KINDS, TICKS, VARIABLES, clocks_fmu, described
from tests.fmi.third_party import archive
from twin.fmi import csv_tables, member, plan, simulate, unpack


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("clocks")


def alone(folder, model, stop, step, starts=None, rows=None, record=(), start=None, **options):
    """Results of an FMU alone, and how it ended."""
    one = member("one", clocks_fmu(folder, model), starts or {}, **options)
    table = None
    if rows:
        (folder / "rows.csv").write_text("\n".join(rows))
        table = csv_tables.read_inputs(folder / "rows.csv", one)
    outcome = simulate(one, plan(one, start=start, stop=stop, step=step, record=record), table)
    assert not outcome.failure, outcome.failure
    return {name: column.tolist() for name, _, column in outcome.results.columns()}


# ------------------------------------------------------------------------------------------------ Scheduled Execution

# as the public Clocks FMU: the first every second, the second by hand, the third by the first at 4 s
PARTITIONS = {
    "first_ticks": [1, 2, 3, 4, 5, 6, 7, 8, 9, 10],
    "second_ticks": [1, 2, 2, 2, 2, 2, 2, 2, 3, 4],
    "third_ticks": [0, 0, 0, 0, 1, 1, 1, 1, 1, 1],
    "total": [2, 4, 5, 6, 8, 9, 10, 11, 13, 15],
    "result": [0, 0, 0, 0, 0, 0, 0, 0, 7, 1007],
    "made": [0, 0, 0, 0, 1000, 1000, 1000, 1000, 1000, 1000],
    "fifth": [False, False, True, False, False, False, True, False, False, True],
}


@pytest.mark.slow
def test_the_schedule(folder):
    rows = ["time,second,given", "0,1,0", "1,1,0", "2,0,5", "8,1,7", "9,1,1000"]
    found = alone(folder, "Partitions", 9, 1.0, rows=rows)
    assert {name: found[name] for name in PARTITIONS} == PARTITIONS

    # the second partition has the smaller number, so it goes first; the third comes when both are done
    assert found["order"][:2] == [201.0, 2010201.0]
    assert found["order"][4] == 201020101010103.0


@pytest.mark.slow
def test_the_same_by_fmpy(folder):
    """FMPy has no scheduler, so its functions are called in the order of ours."""
    path = clocks_fmu(folder, "Partitions")
    with unpack(path) as unpacked:
        token, place = unpacked.description.token, str(unpacked.folder)
        theirs = FMU3ScheduledExecution(
            guid=token, unzipDirectory=place, modelIdentifier="Partitions", instanceName="theirs"
        )
        theirs.instantiate()
        theirs.enterInitializationMode()
        theirs.exitInitializationMode()
        given, found = {0: 0, 1: 0, 8: 7, 9: 1000}, []
        for t in range(10):
            if t in given:
                theirs.setInt32([16], [given[t]])
                theirs.activateModelPartition(2, float(t))
            theirs.activateModelPartition(1, float(t))
            if t == 4:
                theirs.activateModelPartition(3, 4.0)
            found.append(theirs.getInt32([14])[0])
        theirs.freeInstance()
    assert found == PARTITIONS["total"]


@pytest.mark.parametrize("model", list(VARIABLES))
def test_descriptions_are_to_the_standard(folder, model):
    read_model_description(str(clocks_fmu(folder, model)), validate=True)


# -------------------------------------------------------------------------------------------------------------- alone


def test_alone_a_step_ends_where_a_clock_ticks(folder):
    found = alone(folder, "Kinds", 2, 0.4, record=(*(f"{kind}_count" for kind in KINDS), "latest"))
    times = 0.4 * np.arange(6)
    for kind, ticks in TICKS.items():
        assert found[f"{kind}_count"] == np.searchsorted(np.array(ticks), times + 1e-9).tolist(), kind
    assert found["latest"][-1] == pytest.approx(2.0)


def test_alone_the_fmu_may_end_a_step_at_its_event(folder):
    found = alone(folder, "Kinds", 0.5, 0.1, {"signal_at": 0.22}, record=("signalled", "alarm_count", "x"))
    assert found["signalled"] == [0.0, 0.0, 0.0, 0.22, 0.22, 0.22]
    assert found["alarm_count"] == [0, 0, 0, 1, 1, 1]
    assert found["x"] == pytest.approx(0.1 * np.arange(6))


def test_alone_with_rows(folder):
    rows = ["time,triggered,d,u", "0,0,0,0", "0.333,1,4,1", "0.5,0,4,1"]
    starts = {"tunable": 0.2, "wait": 0.111}
    found = alone(
        folder, "Kinds", 1, 0.25, starts, rows, ("tunable_count", "triggered_count", "seen", "countdown_count")
    )
    assert found["tunable_count"] == [1, 2, 3, 4, 6]
    assert found["triggered_count"] == [0, 0, 1, 1, 1]
    assert found["seen"] == [0, 0, 4, 4, 4]
    assert found["countdown_count"] == [0, 0, 0, 1, 1]


def test_alone_a_row_at_zero_lets_a_clock_tick_within_a_step(folder):
    rows = ["time,triggered,d", "-1,0,0", "0,1,4", "0.1,0,4", "0.4,1,5"]
    found = alone(folder, "Kinds", 0.5, 0.3, rows=rows, record=("triggered_count", "seen"), start=-1.0)
    assert found["triggered_count"] == [0, 0, 0, 0, 1, 2]
    assert found["seen"] == [0, 0, 0, 0, 4, 5]


@pytest.mark.parametrize("step", [0.05, 0.4])
def test_clocks_in_model_exchange_are_time_events(folder, step):
    record = (*(f"{kind}_count" for kind in KINDS), "latest", "x", *(["fixed"] if step < 0.1 else []))
    found = alone(folder, "Kinds", 2, step, record=record, interface="model_exchange")
    times = step * np.arange(round(2 / step) + 1)
    for kind, ticks in TICKS.items():
        assert found[f"{kind}_count"] == np.searchsorted(np.array(ticks), times + 1e-9).tolist(), kind
    assert found["latest"][-1] == pytest.approx(2.0)
    assert found["x"] == pytest.approx(times)
    if step < 0.1:
        assert np.round(times[found["fixed"]], 6).tolist() == TICKS["fixed"]


def test_clocks_without_event_mode_never_tick(folder):
    xml = described("Kinds").replace('hasEventMode="true"', "")
    one = member(
        "one",
        archive(folder / "without.fmu", {"modelDescription.xml": xml.encode(), "binaries/x86_64-linux/Kinds.so": b""}),
    )
    one.close()
    assert not one.clocked
    assert "never tick" in one.notes[-1]
    assert not one.variables["alarm"].connectable
