"""docs/data/drive_writes.csv lists what a run writes into the simulated drives."""

from docs import drive_writes


def test_the_table_is_up_to_date(build):
    assert drive_writes.TABLE.read_text() == drive_writes.render_table(build), "run `python docs/drive_writes.py`"
