"""What a restoration writes, in its order, and what it reports of each object: from the journal of one drive."""

from contextlib import suppress
from types import SimpleNamespace

import pytest

from hw_bridge.dictionary import State
from hw_bridge.journal import DriveIdentity
from hw_bridge.master import restoration
from hw_bridge.master.restoration import refuse_enabled, restore
from hw_bridge.master.setup import configure
from hw_bridge.master.writes import write
from tests.hw_bridge.unconnected import WORDS, unconnected_node
from twin.errors import SimulationError

CYCLE = 5_000_000


@pytest.fixture
def drive():
    """A drive at rest, whose 6083h and 6085h, and an object of its scale, were changed in this order; its values before."""
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED], (0x6083, 0): 300, (0x6085, 0): 500})
    node.before = dict(node.server.dictionary.values)
    for index, sub, value in ((0x6083, 0, 301), (0x6085, 0, 501), (0x6092, 1, 77)):
        write(node, index, sub, value, "a reason")
    node.server.written.clear()
    return node


def test_scaling_goes_first_then_the_last_write(drive):
    result = restore(drive)
    assert drive.server.written == [(0x6092, 1, drive.before[0x6092, 1]), (0x6085, 0, 500), (0x6083, 0, 300)]
    assert result.restored == ["6083h.0", "6085h.0", "6092h.1"]
    assert (result.retained, result.foreign, result.failed) == ([], [], [])
    assert drive.journal.changes == {}


def test_values_that_are_as_before_are_not_written(drive):
    drive.server.dictionary.values[0x6085, 0] = 500
    assert restore(drive).restored == ["6083h.0", "6085h.0", "6092h.1"]
    assert [address[0] for address in drive.server.written] == [0x6092, 0x6083]


def test_what_another_program_wrote_since_is_left(drive):
    drive.server.dictionary.values[0x6085, 0] = 0x1234
    result = restore(drive)
    assert result.foreign == [
        "axis: 6085h.0 is 00001234h, which the run did not write; before the run it was 000001F4h. It is left as it is."
    ]
    assert (result.restored, result.failed) == (["6083h.0", "6092h.1"], [])
    assert drive.journal.changes == {}


@pytest.mark.parametrize(
    ("how", "text"),
    [
        ("refused", "axis: 6085h.0 is 000001F5h and was 000001F4h before the run: the drive refuses it."),
        ("ignored", "axis: 6085h.0 is 000001F5h and was 000001F4h before the run: it reads otherwise."),
        (
            "missing",
            "axis: 6085h.0 was 000001F4h and cannot be read: node 3: 6085h.0: refused with 06020000h, no object.",
        ),
    ],
)
def test_what_cannot_be_restored_stays_in_the_journal(drive, how, text):
    getattr(drive.server, how).add((0x6085, 0))
    result = restore(drive)
    assert result.failed == [text]
    assert result.restored == ["6083h.0", "6092h.1"]
    assert set(drive.journal.changes) == {(0x6085, 0)}


@pytest.mark.parametrize(
    ("keep", "retained"),
    [("all", ["6083h.0", "6085h.0", "6092h.1"]), (["6085h"], ["6085h.0"]), (["6092h.1", "6083h.1"], ["6092h.1"])],
)
def test_objects_that_the_hardware_file_keeps(keep, retained):
    node = unconnected_node(keep=keep, values={(0x6041, 0): WORDS[State.DISABLED]})
    for index, sub, value in ((0x6083, 0, 301), (0x6085, 0, 501), (0x6092, 1, 77)):
        write(node, index, sub, value)
    result = restore(node)
    assert result.retained == retained
    assert result.restored == [name for name in ("6083h.0", "6085h.0", "6092h.1") if name not in retained]
    assert node.journal.changes == {}
    assert [change.name for change in node.journal.history] == [*retained, *result.restored]


def test_outputs_and_offsets_stay_as_they_are():
    """To restore them would switch a valve, or shift every target."""
    values = {(0x60FE, 1): 9, (0x60B1, 0): 5, (0x6041, 0): WORDS[State.DISABLED]}
    node = unconnected_node(values=values)
    write(node, 0x60FE, 1, 2)
    write(node, 0x60B1, 0, 0)
    node.server.written.clear()
    result = restore(node)
    assert (result.retained, result.restored, node.server.written) == (["60FEh.1", "60B1h.0"], [], [])


def test_process_data_are_disabled_before_all_else_and_enabled_last():
    """Of each PDO (CiA 301): disabled, its mapping from count 0 to its count, its kind, its COB-ID."""
    node = unconnected_node(limits={"velocity": "100 mm/s"}, values={(0x6041, 0): WORDS[State.DISABLED]})
    before = dict(node.server.dictionary.values)
    configure(node, CYCLE, 127)
    node.server.written.clear()
    node.server.dictionary.values[0x6041, 0] = WORDS[State.DISABLED]
    result = restore(node)
    written = node.server.written
    off = [(0x1400, 0x203), (0x1401, 0x303), (0x1800, 0x183), (0x1801, 0x283)]
    assert written[:4] == [(index, 1, 0x80000000 | identifier) for index, identifier in off]
    pdos = [row for row in written[4:] if 0x1400 <= row[0] < 0x1C00]
    assert pdos == [
        (0x1600, 0, 0),
        (0x1600, 1, 0x60400010),
        (0x1600, 0, 1),
        (0x1400, 2, 255),
        (0x1400, 1, 0x203),
        (0x1601, 0, 0),
        (0x1601, 2, 0x607A0020),
        (0x1601, 3, 0),
        (0x1601, 0, 2),
        (0x1401, 2, 255),
        (0x1401, 1, 0x303),
        (0x1402, 1, 0x403),
        (0x1403, 1, 0x503),
        (0x1A00, 0, 0),
        (0x1A00, 2, 0),
        (0x1A00, 3, 0),
        (0x1A00, 0, 1),
        (0x1800, 2, 255),
        (0x1800, 1, 0x183),
        (0x1A01, 0, 0),
        (0x1A01, 1, 0x60410010),
        (0x1A01, 2, 0x60640020),
        (0x1A01, 0, 2),
        (0x1801, 2, 255),
        (0x1801, 1, 0x283),
        (0x1802, 1, 0x383),
        (0x1803, 1, 0x483),
    ]
    assert written[-2:] == [(0x1017, 0, 0), (0x1016, 1, 0)]
    assert written.index(pdos[0]) > written.index((0x6007, 0, before[0x6007, 0]))
    node.server.dictionary.values[0x6041, 0] = before[0x6041, 0]
    assert node.server.dictionary.values == before
    assert (result.failed, result.foreign, node.journal.changes) == ([], [], {})


def test_a_mapping_with_an_entry_that_is_refused_stays_empty():
    """A frame of a later master must not act on another object than its own."""
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]})
    configure(node, CYCLE, 127)
    node.server.refused.add((0x1600, 1))
    node.server.dictionary.values[0x6041, 0] = WORDS[State.DISABLED]
    result = restore(node)
    assert result.failed == [
        "axis: 1600h.0 is 00h and was 01h before the run: the drive refuses one of its entries.",
        "axis: 1600h.1 is 607A0020h and was 60400010h before the run: the drive refuses it.",
    ]
    assert set(node.journal.changes) == {(0x1600, 0), (0x1600, 1)}


def test_a_mapping_whose_entry_is_refused_at_first_gets_its_count_in_the_second_round():
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]})
    before = dict(node.server.dictionary.values)
    configure(node, CYCLE, 127)
    node.server.busy[0x1600, 1] = 1
    result = restore(node)
    assert (result.failed, node.journal.changes) == ([], {})
    assert node.server.dictionary.values == before | {(0x6040, 0): 0}


@pytest.mark.parametrize("refused", [False, True])
def test_a_count_that_the_hardware_file_keeps_is_0_only_while_entries_are_restored(refused):
    node = unconnected_node(keep=["1600h.0"], values={(0x6041, 0): WORDS[State.DISABLED], (0x1600, 0): 2})
    for sub, value in ((0, 0), (1, 0x607A0020), (0, 1)):
        write(node, 0x1600, sub, value)
    node.server.written.clear()
    node.server.refused |= {(0x1600, 1)} if refused else set()
    result = restore(node)
    if refused:
        assert node.server.written[1:-1] == [(0x1600, 0, 0)]
        assert result.failed == [
            "axis: 1600h.1 is 607A0020h and was 60400010h before the run: the drive refuses it.",
            "axis: 1600h.0 was to stay 01h and is 00h: the drive refuses it or one of its entries.",
        ]
        return
    assert node.server.written[1:-1] == [(0x1600, 0, 0), (0x1600, 1, 0x60400010), (0x1600, 0, 1)]
    assert (result.retained, result.restored, result.failed) == (["1600h.0"], ["1600h.1"], [])


class KilledError(BaseException):
    """No handler runs after it."""


@pytest.mark.parametrize("keep", [["1400h.1"], ["1600h.0"], ["1400h", "1A00h.0"]])
def test_process_data_that_stay_are_enabled_also_where_a_restoration_was_killed(keep):
    """At each of its writes; the next one completes it."""

    def run_and_restore(number):
        node = unconnected_node(keep=keep, values={(0x6041, 0): WORDS[State.DISABLED]})
        configure(node, CYCLE, 127)
        node.server.dictionary.values[0x6041, 0] = WORDS[State.DISABLED]
        send, writes = node.sdo.send, []

        def send_until_killed(request):
            if request.data[0] >> 5 == 1:
                writes.append(request)
                if len(writes) == number:
                    raise KilledError
            send(request)

        node.sdo.send = send_until_killed
        with suppress(KilledError):
            restore(node)
        result = restore(node)
        assert (result.failed, result.foreign, node.journal.changes) == ([], [], {})
        return node.server.dictionary.values, len(writes)

    expected, count = run_and_restore(None)
    assert not expected[0x1400, 1] & 0x80000000
    for number in range(1, count + 1):
        assert run_and_restore(number)[0] == expected, number


@pytest.mark.parametrize("state", State)
def test_nothing_is_restored_while_the_power_stage_is_on(drive, state):
    drive.server.dictionary.values[0x6041, 0] = WORDS[state]
    if state in (State.ENABLED, State.QUICK_STOP, State.REACTION):
        with pytest.raises(SimulationError, match=rf"^axis: is in {state}: nothing is restored while it is enabled\.$"):
            restore(drive)
        assert drive.server.written == []
        return
    refuse_enabled(drive)


def test_a_device_without_a_statusword_is_restored(drive):
    drive.server.missing.add(0x6041)
    assert restore(drive).restored == ["6083h.0", "6085h.0", "6092h.1"]


def test_identity_of_a_drive_that_does_not_have_all_of_it(drive):
    identity = [drive.server.dictionary.values[0x1018, sub] for sub in (1, 2, 4)]
    assert restoration.identity_of(drive) == DriveIdentity(*identity, 3)
    drive.server.missing.add((0x1018, 4))
    assert restoration.identity_of(drive) == DriveIdentity(identity[0], identity[1], 0, 3)


def master_of(drive):
    """A master of this drive in simulated time, which records its NMT commands."""
    commands = []
    return SimpleNamespace(
        stations={"axis": drive},
        keys=SimpleNamespace(simulated=True),
        recovered=[],
        restorations=[],
        armed=True,
        notes=[],
        nmt=lambda *command: commands.append(command),
        commands=commands,
    )


def test_an_earlier_run_is_restored_before_the_next_one(drive):
    master = master_of(drive)
    restoration.begin(master)
    assert master.recovered == [
        "axis: an earlier run ended without restoring 3 objects; they were restored before this one."
    ]
    assert (master.commands, drive.journal.changes, drive.journal.history) == ([(0x80, 3)], {}, [])
    restoration.begin(master)
    assert len(master.commands) == 1


def test_what_an_earlier_run_left_and_a_drive_refuses_ends_the_next_one(drive):
    drive.server.refused.add((0x6085, 0))
    with pytest.raises(SimulationError) as caught:
        restoration.begin(master_of(drive))
    assert str(caught.value).splitlines() == [
        "axis: 6085h.0 is 000001F5h and was 000001F4h before the run: the drive refuses it.",
        "axis: an earlier run left these. The journal is kept.",
    ]


def test_the_end_of_a_run(drive):
    drive.server.dictionary.values[0x6085, 0] = 0x1234
    master = master_of(drive)
    restoration.finish(master)
    assert master.restorations == ["axis: 2 objects were changed for the run and are as before"]
    assert len(master.notes) == 1
    assert master.notes[0].startswith("axis: 6085h.0 is 00001234h, which the run did not write")
    assert (master.commands, drive.sdo.attempts) == ([(0x80, 3)], 4)
    restoration.finish(master)
    assert len(master.commands) == 1
