"""Recordings that were truncated, overwritten or edited by hand: one line with the file, never a traceback."""

import numpy as np
import pytest

from tests.viewer.recorded import FORCE, folder_of
from twin.errors import TwinError
from twin.face import open_run
from twin.face.arrays import samples
from twin.results import export, list_recorded_variables, read_variables

TIME = np.arange(1000) / 1000


@pytest.fixture
def recording(tmp_path):
    return (
        folder_of(tmp_path / "run", {("base", 1): (TIME, {"sensor.force": np.sin(TIME)})}, [FORCE]) / "signals.parquet"
    )


@pytest.mark.parametrize("size", [0, 300])
def test_a_truncated_recording_is_named(recording, size):
    recording.write_bytes(recording.read_bytes()[:size])
    with pytest.raises(TwinError, match=r"signals\.parquet: cannot be read \(.*\)\. Run the scenario again\."):
        list_recorded_variables(recording)


@pytest.mark.parametrize("suffix", [".csv", ".mat"])
def test_damaged_samples_are_not_a_mistake_of_the_exported_file(recording, suffix):
    variables = list(list_recorded_variables(recording).values())
    data = recording.read_bytes()
    recording.write_bytes(data[:4] + bytes(b ^ 0xFF for b in data[4 : len(data) // 2]) + data[len(data) // 2 :])
    for read in (
        lambda: export(recording, recording.with_name(f"out{suffix}"), variables, {("base", 1)}),
        lambda: read_variables(recording, variables),
        lambda: samples(recording, variables),
    ):
        with pytest.raises(TwinError, match=r"signals\.parquet: cannot be read"):
            read()


def test_a_summary_that_is_no_object_is_named(tmp_path):
    (tmp_path / "summary.json").write_text("[1, 2]")
    with pytest.raises(TwinError, match=r"summary\.json: is not a JSON object"):
        open_run(tmp_path)
