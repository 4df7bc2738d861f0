"""The journal on disk: flushed before a write, locked, checked, never applied to another drive."""

import json
import os
from contextlib import contextmanager

import pytest

from hw_bridge.journal import DriveIdentity, Journal, JournalFile, ObjectChange, bus_folder, journal_path
from twin.errors import SimulationError

IDENTITY = DriveIdentity(0x147, 3150, 4711, 3)
CHANGE = ObjectChange(0x607D, 1, b"\x01\x00\x00\x00", [b"\x02\x00\x00\x00"], "limits.position")


@pytest.fixture
def path(tmp_path):
    return journal_path(tmp_path, IDENTITY)


def opened(path, identity=IDENTITY):
    journal = Journal()
    journal.attach(JournalFile(path, identity))
    return journal


def killed(journal):
    """The process is gone, its file stays."""
    journal.file.file.close()


def test_what_was_recorded_is_there_for_the_next_process(path):
    journal = opened(path)
    journal.record([CHANGE, ObjectChange(0x6065, 0, b"\xff" * 4, [b"\x10\0\0\0"], "limits.following_error")])
    journal.record([ObjectChange(0x607D, 1, b"", [b"\x03\0\0\0"], "limits.position")])
    killed(journal)
    found = opened(path).changes
    assert list(found) == [(0x607D, 1), (0x6065, 0)]
    assert found[0x607D, 1].before == b"\x01\0\0\0"
    assert found[0x607D, 1].written == [b"\x02\0\0\0", b"\x03\0\0\0"]


def test_it_is_on_the_disk_before_the_call_returns(path, monkeypatch):
    flushed = []
    monkeypatch.setattr(os, "fsync", lambda _: flushed.append(path.read_bytes().count(b"\n")))
    journal = opened(path)
    journal.record([CHANGE])
    assert flushed[-1] == 2


def test_nothing_is_left_where_all_is_restored(path):
    journal = opened(path)
    journal.record([ObjectChange(0x607D, 1, b"\1", [b"\2"])])
    journal.settle([(0x607D, 1)])
    journal.close()
    assert not path.exists()


def test_what_is_not_restored_is_kept(path):
    journal = opened(path)
    journal.record([ObjectChange(0x607D, 1, b"\1", [b"\2"]), ObjectChange(0x607D, 2, b"\1", [b"\2"])])
    journal.settle([(0x607D, 1)])
    journal.close()
    assert list(opened(path).changes) == [(0x607D, 2)]


def test_a_line_without_its_end_was_never_acted_upon(path):
    journal = opened(path)
    journal.record([CHANGE])
    killed(journal)
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"crc": 12, "row": {"ind')
    assert list(opened(path).changes) == [(0x607D, 1)]
    assert path.read_bytes() == whole


@pytest.mark.parametrize("damage", [b'{"crc": 1, "row": {}}\n', b"\xff\xfe\n", b"\n", b"[]\n", b"null\n"])
def test_a_damaged_journal_is_one_line_and_kept(path, damage):
    journal = opened(path)
    journal.record([CHANGE])
    killed(journal)
    path.write_bytes(path.read_bytes() + damage)
    before = path.read_bytes()
    with pytest.raises(SimulationError, match=r"node3\.jsonl:3: the journal of vendor 147h, .* is damaged; it is kept"):
        opened(path)
    assert path.read_bytes() == before


def test_a_changed_value_is_damage(path):
    journal = opened(path)
    journal.record([CHANGE])
    killed(journal)
    path.write_bytes(path.read_bytes().replace(b"01000000", b"01000001"))
    with pytest.raises(SimulationError, match="is damaged"):
        opened(path)


def test_a_line_that_is_no_change_is_an_error(path):
    journal = opened(path)
    journal.file.append([{"index": "607D"}])
    killed(journal)
    with pytest.raises(SimulationError, match=r":2: is no line of a journal; the file is kept"):
        opened(path)


def test_the_journal_of_another_serial_number_is_not_applied(path, tmp_path):
    journal = opened(path)
    journal.record([CHANGE])
    killed(journal)
    other = IDENTITY._replace(serial=4712)
    assert opened(journal_path(tmp_path, other), other).changes == {}  # its own, empty
    path.replace(moved := journal_path(tmp_path, IDENTITY._replace(serial=4713)))
    with pytest.raises(SimulationError, match=r"expected a journal of .*serial 1269h.* it is kept and not applied"):
        opened(moved, IDENTITY._replace(serial=4713))
    assert moved.exists()


def test_two_programs_do_not_share_it(path):
    pytest.importorskip("fcntl")
    journal = opened(path)
    with pytest.raises(SimulationError, match="a running program holds the journal of this drive"):
        opened(path)
    journal.close()
    opened(path).close()


def test_a_journal_that_its_last_program_removes_just_now_is_made_anew(path, monkeypatch):
    """Else changes would go to a file without a name, and be lost with the process."""
    fcntl = pytest.importorskip("fcntl")
    ending, lock = opened(path), fcntl.flock

    def flock(*arguments):
        ending.close()
        lock(*arguments)

    monkeypatch.setattr(fcntl, "flock", flock)
    journal = opened(path)
    journal.record([CHANGE])
    killed(journal)
    monkeypatch.undo()
    found = opened(path)
    killed(found)
    assert list(found.changes) == [CHANGE.address]


def test_no_journal_no_write(path):
    path.parent.joinpath("file").write_text("")
    with pytest.raises(SimulationError, match="cannot be written"):
        JournalFile(path.parent / "file" / "journal.jsonl", IDENTITY)


def test_buses_in_software_have_folders_of_their_own(monkeypatch, tmp_path):
    monkeypatch.setenv("TWIN_STATE", str(tmp_path))
    real = bus_folder("socketcan", "can0", software=False)
    assert real == bus_folder("pcan", "PCAN_USBBUS1", software=False) == tmp_path / "drives"
    one, other = (bus_folder("udp_multicast", "239.74.163.2", True, {"port": port}) for port in (1, 2))
    assert one != other
    assert one.parent == real


def test_lines_are_json(path):
    journal = opened(path)
    journal.record([CHANGE])
    rows = [json.loads(line)["row"] for line in path.read_bytes().splitlines()]
    assert rows[0] == {"journal": 1, "vendor": 0x147, "product": 3150, "serial": 4711, "node": 3}
    assert rows[1] == {
        "index": "607D",
        "sub": 1,
        "size": 4,
        "before": "01000000",
        "after": "02000000",
        "reason": "limits.position",
    }


@contextmanager
def full_disk(path, left):
    """Files may grow by so many bytes over this one, as on a disk that is nearly full."""
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + left, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("left", [0, 70, 200])
def test_a_disk_that_is_full_leaves_no_part_of_a_line(tmp_path, left):
    """The error is told, closing does not fail, and the journal can be read and continued."""
    path = tmp_path / "one.jsonl"
    file = JournalFile(path, IDENTITY)
    journal = Journal()
    journal.attach(file)
    journal.record([ObjectChange(0x6083, 0, b"\1\0\0\0", [b"\2\0\0\0"], "ramp")])
    before = path.read_bytes()
    with full_disk(path, left):
        with pytest.raises(SimulationError, match=r"one\.jsonl: cannot be written: .*The drive is not written\."):
            journal.record(ObjectChange(0x6084, sub, b"\1", [b"\2"], "ramp") for sub in range(20))
        assert path.read_bytes() == before
        journal.settle([(0x6083, 0)])  # the drive was restored, whether or not this can be noted
        file.close(remove=False)
    again = Journal()
    again.attach(JournalFile(path, IDENTITY))
    again.record([ObjectChange(0x6085, 0, b"\3", [b"\4"], "ramp")])
    again.file.close(remove=False)
    last = Journal()
    last.attach(JournalFile(path, IDENTITY))
    assert (0x6085, 0) in last.changes
    last.file.close(remove=True)
