"""The lists of docs/how-to/drive_writes.md are those of the simulated drives."""

import pytest

from docs import drive_writes


@pytest.mark.parametrize("profile", drive_writes.NODES)
def test_the_list_is_up_to_date(profile, build):
    begin, end = drive_writes.marked(profile)
    found = drive_writes.PAGE.read_text().partition(begin)[2].partition(end)[0].strip()
    assert found == drive_writes.table(profile, build).strip(), "run `python docs/drive_writes.py`"
