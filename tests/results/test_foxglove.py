"""MCAP as its own package reads it: topics by member, units in the schema, the samples to the bit."""

import json

import numpy as np
import pyarrow as pa
import pytest

from tests.viewer.recorded import COUNT, FORCE, PLACE, SHAPE, TOUCH, folder_of, wave
from twin.errors import TwinError
from twin.results import export, list_recorded_variables
from twin.results.exporters import split_by_case

reader = pytest.importorskip("mcap.reader")


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    time, force = wave(100.0, 0.5)
    strange = force.copy()
    strange[3] = np.nan
    own = {
        "sensor.force": strange,
        "tip.position": 1e-3 * force,
        "tip.shape": np.stack([force, -force], 1),
        "tip.touches": force > 1,
        "tip.count": np.arange(50),
    }
    cases = {("PI", 1): (time, own), ("PI", 2): (time, {"sensor.force": force})}
    return (
        folder_of(tmp_path_factory.mktemp("mcap") / "run", cases, [FORCE, PLACE, SHAPE, TOUCH, COUNT])
        / "signals.parquet"
    )


def written(source, target, cases):
    export(source, target, list(list_recorded_variables(source).values()), cases)
    with target.open("rb") as file:
        read = reader.make_reader(file)
        messages = [
            (channel.topic, message.log_time, json.loads(message.data)) for _, channel, message in read.iter_messages()
        ]
        summary = read.get_summary()
        return messages, summary


def test_a_run_that_begins_before_zero_is_refused(tmp_path):
    time, force = wave(100.0, 0.5)
    source = (
        folder_of(tmp_path / "run", {("PI", 1): (time - 0.1, {"sensor.force": force})}, [FORCE]) / "signals.parquet"
    )
    with pytest.raises(
        TwinError, match=r"^PI, seed 1 begins at -0\.1 s: MCAP has no negative times\. Write \.csv or \.mat\.$"
    ):
        written(source, tmp_path / "a.mcap", {("PI", 1)})
    assert not (tmp_path / "a.mcap").exists()


def test_messages_are_the_samples(source, tmp_path):
    messages, summary = written(source, tmp_path / "a.mcap", {("PI", 1)})
    time, force = wave(100.0, 0.5)
    sensor = [(when, one) for topic, when, one in messages if topic == "/sensor"]
    tip = [one for topic, _, one in messages if topic == "/tip"]
    assert [when for when, _ in sensor] == [round(t * 1e9) for t in time]
    assert sensor[3][1] == {"force": None}
    assert [one["force"] for i, (_, one) in enumerate(sensor) if i != 3] == np.delete(force, 3).tolist()
    assert tip[7] == {
        "position": 1e-3 * force[7],
        "shape": [force[7], -force[7]],
        "touches": bool(force[7] > 1),
        "count": 7,
    }
    schemas = {one.name: json.loads(one.data) for one in summary.schemas.values()}
    assert schemas["sensor"]["properties"]["force"] == {
        "type": ["number", "null"],
        "description": "contact <force> [N]",
        "unit": "N",
    }
    tip_types = {name: one["type"] for name, one in schemas["tip"]["properties"].items()}
    assert tip_types == {"position": ["number", "null"], "shape": "array", "touches": "boolean", "count": "integer"}


def test_each_case_has_topics_of_its_own(source, tmp_path):
    messages, summary = written(source, tmp_path / "a.mcap", {("PI", 1), ("PI", 2)})
    topics = {one.topic for one in summary.channels.values()}
    assert topics == {"/PI/seed_1/sensor", "/PI/seed_1/tip", "/PI/seed_2/sensor"}  # what was not recorded has none
    assert len(messages) == 150


def test_rows_are_split_where_the_case_changes():
    """Each case is one part, also where rows of several cases were written together."""
    rows = pa.RecordBatch.from_pydict(
        {"variant": ["A", "A", "B", "B", "B", "A"], "seed": [1, 1, 1, 1, 2, 2], "n": range(6)}
    )
    found = [(case, part.column("n").to_pylist()) for case, part in split_by_case(rows)]
    assert found == [(("A", 1), [0, 1]), (("B", 1), [2, 3]), (("B", 2), [4]), (("A", 2), [5])]
    assert list(split_by_case(rows.slice(0, 0))) == []


def test_without_the_package_the_extra_is_named(source, tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(TwinError, match=r"pip install 'catheter-twin\[mcap\]'"):
        export(source, tmp_path / "a.mcap", list(list_recorded_variables(source).values()), {("PI", 1)})
    assert list(tmp_path.iterdir()) == []
