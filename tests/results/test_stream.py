"""The journal of a run in progress: what it says of each case, and what is no journal."""

import json

import pytest

from twin.errors import TwinError
from twin.results.recording.stream import FOLDER, FORMAT, JOURNAL, read_recording

LINES = (
    {"format": FORMAT, "run": {"name": "swing"}},
    {"start": 0},
    {"rows": ["time"], "tick": 3},
    {"end": {"status": "completed"}},
    {"start": 1},
)


def journal(run, text):
    (run / FOLDER).mkdir(parents=True)
    (run / FOLDER / JOURNAL).write_text(text)
    return run


def test_cases_of_a_journal(tmp_path):
    """A line that is not finished does not count."""
    text = "".join(f"{json.dumps(line)}\n" for line in LINES) + '{"rows": ["ti'
    found = read_recording(journal(tmp_path, text))
    assert found.header == {"name": "swing"}
    first, second = found.case_recordings
    assert (first.number, first.layout, first.end) == (0, LINES[2], LINES[3])
    assert (second.number, second.layout, second.end) == (1, {}, None)


@pytest.mark.parametrize("text", ["", "{}\n", '{"format": -1, "run": {}}\n', "no JSON\n", "[]\n"])
def test_what_is_no_journal(tmp_path, text):
    with pytest.raises(TwinError, match="is damaged, or of another version"):
        read_recording(journal(tmp_path, text))
    with pytest.raises(TwinError, match="contains no recording"):
        read_recording(tmp_path / "other")
