"""Bookkeeping of a master without a bus: frames of a station, SDO answers, other masters, timing, kept references."""

import json
import struct
from types import SimpleNamespace

import numpy as np
import pytest

from hw_bridge.bus import Frame
from hw_bridge.dictionary import NmtState
from hw_bridge.hardware import HardwareKeys, ModuleKeys
from hw_bridge.master.fault_report import describe_failure, format_emergencies, format_emergency
from hw_bridge.master.foreign_master import ForeignMasterMonitor
from hw_bridge.master.module import ModuleNode
from hw_bridge.master.reference import Reference
from hw_bridge.master.sdo import SdoClient, SdoError, SilentError
from hw_bridge.master.station import EmergencyMessage
from hw_bridge.master.timing import Timing
from hw_bridge.profiles import device
from tests.every_case import every_case
from tests.hw_bridge.axis import node as node_keys
from tests.hw_bridge.unconnected import NUMBER, SdoServer, frame, unconnected_node


def test_services_of_a_node():
    node = unconnected_node()
    node.process_frame(frame(0x580, bytes(8)), 1)
    node.process_frame(frame(0x600, bytes(8)), 1)
    assert node.alive is False
    node.process_frame(frame(0x080, bytes([0x10, 0x43, 0x08, 1, 2, 3, 4, 5])), 2)
    node.process_frame(frame(0x080, bytes([0x10, 0x43])), 3)
    node.process_frame(frame(0x080, b"\x10"), 4)  # too short
    assert node.emergencies == [EmergencyMessage(2, 0x4310, 8, bytes([1, 2, 3, 4, 5])), EmergencyMessage(3, 0x4310)]
    assert node.alive is True
    node.process_frame(frame(0x700, b""), 5)
    assert (node.last_heartbeat_at, node.boots, node.nmt_state) == (0, 0, None)
    for time, state, boots in ((6, 0x00, 1), (7, 0x7F, 1), (8, 0x85, 1), (9, 0x04, 1), (10, 0x00, 2), (11, 0x33, 2)):
        node.process_frame(frame(0x700, bytes([state])), time)
        assert (node.last_heartbeat_at, node.boots) == (time, boots)
        expected = {0x85: NmtState.OPERATIONAL, 0x33: None}.get(state, state)
        assert node.nmt_state == expected
    assert node.booted_at == 10


def test_answers_of_each_cycle_are_counted():
    """In each cycle one answer: none is missing, a second one is late; what never came was lost."""
    node = unconnected_node()
    seen = []
    for answers in (1, 0, 0, 3, 1, 0):
        node.answered = answers
        node.count_answers()
        seen.append((node.missing, node.late, node.silent, node.lost, node.answered))
    assert seen == [
        (0, 0, 0, 0, 0),
        (1, 0, 1, 1, 0),
        (2, 0, 2, 2, 0),
        (2, 2, 0, 0, 0),
        (2, 2, 0, 0, 0),
        (3, 2, 1, 1, 0),
    ]
    node.boots, node.nmt_state, node.oldest = 2, NmtState.STOPPED, 9
    node.emergencies.append(EmergencyMessage(0, 1))
    node.forget()
    assert (node.missing, node.late, node.silent, node.nmt_state, node.oldest) == (0, 0, 0, None, 0)
    assert node.boots == 2, "its PDO mapping is lost"
    assert node.emergencies == []


def test_the_age_of_actual_values_is_that_of_the_older_ones():
    node = unconnected_node()
    node.synced(100)
    node.process_frame(frame(0x180, struct.pack("<Hbi", 0, 0, 0)), 150)
    node.process_frame(frame(0x280, struct.pack("<ih", 0, 0)), 160)
    node.synced(5_000_100)
    node.process_frame(frame(0x180, struct.pack("<Hbi", 0, 0, 0)), 5_000_150)
    assert node.sample_lag == 5_000_000
    node.update_age(9_000_100)
    assert (node.age, node.oldest) == (9_000_000, 9_000_000)
    node.process_frame(frame(0x280, struct.pack("<ih", 0, 0)), 9_000_200)
    assert node.sample_lag == 0
    node.update_age(9_000_300)
    assert (node.age, node.oldest) == (4_000_200, 9_000_000)
    assert node.in_doubt is False


class Line:
    """Records requests of an SDO client; `answers` are given one after the other, None: silence."""

    def __init__(self, *answers):
        self.sent, self.waits, self.answers = [], [], list(answers)
        self.client = SdoClient(NUMBER, self.sent.append, self.wait)

    def wait(self, duration, done):
        self.waits.append(duration)
        for answer in self.answers.pop(0) if self.answers else []:
            self.client.process_frame(answer)
        return done()


def answer(command, index=0x6064, sub=0, data=b""):
    return bytes([command]) + struct.pack("<HB", index, sub) + data.ljust(4, b"\0")


@every_case(
    ("command", "data", "sized"),
    [
        (0x43, b"\1\2\3\4", True),
        (0x47, b"\1\2\3", True),
        (0x4B, b"\1\2", True),
        (0x4F, b"\1", True),
        (0x42, b"\1\2\0\0", False),
    ],
)
def test_an_expedited_upload_has_the_size_that_its_answer_tells(command, data, sized):
    line = Line([answer(command, data=data)])
    assert line.client.read(0x6064) == data
    assert line.client.sized is sized
    assert line.sent == [Frame(0x603, bytes([0x40, 0x64, 0x60, 0, 0, 0, 0, 0]))]
    assert line.waits == [300_000_000]


def test_a_segmented_upload_toggles():
    line = Line([answer(0x41, 0x1008, data=b"\x09")], [b"\x00abcdefg"], [b"\x1bhi\0\0\0\0\0"])
    assert line.client.read(0x1008, timeout=7) == b"abcdefghi"
    assert [sent.data[0] for sent in line.sent] == [0x40, 0x60, 0x70]
    assert line.waits == [7, 7, 7]


@pytest.mark.parametrize("size", [1, 2, 4])
def test_an_expedited_download(size):
    line = Line([answer(0x60)])
    line.client.write(0x6064, 0, bytes(range(1, size + 1)))
    command = {1: 0x2F, 2: 0x2B, 4: 0x23}[size]
    assert line.sent == [Frame(0x603, answer(command, data=bytes(range(1, size + 1))))]


@every_case(
    "other",
    [
        answer(0x43, 0x6065),
        answer(0x43, sub=1),
        answer(0x60),
        answer(0x43)[:7],
        answer(0x80, 0x6065, data=b"\0\0\2\6"),
        answer(0x80, sub=1, data=b"\0\0\2\6"),
    ],
)
def test_an_answer_to_another_request_is_not_taken(other):
    """Another object, another subindex, another service, too short, an abort of another object."""
    line = Line([other], [answer(0x4B, data=b"\x34\x12")])
    assert line.client.number(0x6064) == 0x1234
    assert (len(line.sent), line.client.prompt, line.client.doubled) == (2, False, False)


def test_silence_and_aborts():
    line = Line()
    with pytest.raises(SilentError, match=r"^node 3 does not answer\. Check its power"):
        line.client.read(0x6064)
    line.client.process_frame(answer(0x4B, data=b"\x34\x12"))  # of another request
    with pytest.raises(SilentError, match=r"^node 3: no answer on 6064h\.0\. Check its power"):
        line.client.read(0x6064)
    assert len(line.sent) == 4
    line = Line([answer(0x80, data=struct.pack("<I", 0x06020000))])
    with pytest.raises(SdoError, match=r"^node 3: 6064h\.0: refused with 06020000h, no object\.$") as caught:
        line.client.read(0x6064)
    assert caught.value.code == 0x06020000


def test_two_answers_to_one_request_are_two_nodes():
    line = Line([answer(0x43), answer(0x43)])
    line.client.read(0x6064)
    assert line.client.doubled is True
    line = Line([answer(0x43)])
    line.client.process_foreign_request(answer(0x40))  # another program reads the same object
    line.client.process_frame(answer(0x43))
    line.answers = [[answer(0x43), answer(0x43)]]
    line.client.read(0x6064)
    assert line.client.doubled is False
    line = Line([], [answer(0x43), answer(0x43)])  # the first request was answered late
    line.client.read(0x6064)
    assert line.client.doubled is False


WRITE, READ, SEGMENT = b"\x23\x64\x60\x01\0\0\0\0", b"\x40\x64\x60\x01\0\0\0\0", b"\x00\x64\x60\x01\0\0\0\0"


@every_case(
    ("heard", "text"),
    [
        (Frame(0x77F, b"\5"), "node 127: another master tells that it lives on this ID. Stop it, or change `master`."),
        (Frame(0x080), "another master on the bus sent SYNC. Stop it."),
        (Frame(0x000, bytes([1, 0])), "another master on the bus sent NMT command 01h to all nodes. Stop it."),
        (Frame(0x000, bytes([2, 3])), "another master on the bus sent NMT command 02h to axis. Stop it."),
        (Frame(0x000, bytes([1, 4])), ""),
        (Frame(0x000, bytes([1])), ""),
        (Frame(0x603, WRITE), "another master on the bus writes 6064h.1 of axis. Stop it."),
        (Frame(0x603, SEGMENT), "another master on the bus writes 6064h.1 of axis. Stop it."),
        (Frame(0x603, READ), ""),
        (Frame(0x603, WRITE[:7]), ""),
        (Frame(0x604, WRITE), ""),
        (Frame(0x203, b"\0"), "another master on the bus sends axis targets. Stop it."),
        (Frame(0x303), "another master on the bus sends axis targets. Stop it."),
        (Frame(0x403), "another master on the bus sends axis targets. Stop it."),
        (Frame(0x503), "another master on the bus sends axis targets. Stop it."),
        (Frame(0x183), ""),
        (Frame(0x283), ""),
        (Frame(0x083, bytes(8)), ""),
        (Frame(0x204), ""),
        (Frame(0x703, b"\5"), ""),
    ],
)
def test_frames_that_only_one_master_may_send(heard, text):
    monitor = ForeignMasterMonitor(127, {3: "axis"})
    monitor.hear(heard)
    assert monitor.text == text
    monitor.hear(Frame(0x709, b"\5"))
    monitor.hear(Frame(0x708, b"\5"))
    assert monitor.text == (f"{text} It may be node 8, 9, not in the hardware file." if text else "")
    monitor.hear(Frame(0x080))
    assert monitor.text.startswith(text or "another master on the bus sent SYNC")


def test_resets_and_unknown_nodes():
    monitor = ForeignMasterMonitor(127, {3: "axis", 4: "other"})
    for number in (0, 3, 127):
        monitor.hear(Frame(0x700 + number, b"\5"))
    monitor.hear(Frame(0x705, b"\5", remote=True))
    assert monitor.unknown_nodes == set()
    for command in (1, 2, 128):
        monitor.hear(Frame(0x000, bytes([command, 4])))
    assert not monitor.has_reset(4)
    monitor.hear(Frame(0x000, bytes([0x81, 4])))
    assert (monitor.has_reset(3), monitor.has_reset(4)) == (False, True)
    monitor.hear(Frame(0x000, bytes([0x82, 0])))
    assert monitor.has_reset(3)


def test_messages_of_an_error():
    node = unconnected_node()
    message = EmergencyMessage(0, 0x8611, 0x20, bytes([2, 0, 0, 0, 0]))
    text = "8611h following error (1001h 20h profile; vendor's bytes 02 00 00 00 00, 2320h following error)"
    assert format_emergency(node, message).replace("device profile", "profile") == text
    assert format_emergency(node, EmergencyMessage(0, 0x1234)) == "1234h (1001h 00h none)"
    node.emergencies = [EmergencyMessage(0, code) for code in (0x1000, 0, 0x2000, 0x3000, 0x4000, 0x5000)]
    texts = [f"axis {code}h (1001h 00h none)" for code in (2000, 3000, 4000, 5000)]
    assert format_emergencies([node]) == f"EMCY: {', '.join(texts)}."
    assert format_emergencies([unconnected_node()]) == ""
    assert describe_failure("Too fast.", "Master.", [], [node]) == f"Too fast. Master. EMCY: {', '.join(texts)}."
    assert describe_failure("Too fast.", "", ["axis: Fault."], [node]) == "Too fast. axis: Fault."
    assert describe_failure("axis: EMCY 1000h. Master.", "Master.", [], [node]) == "axis: EMCY 1000h. Master."


def test_timing_of_syncs():
    timing = Timing(5_000_000)
    assert timing.summary() == {"cycles": 0}
    for sent, due in ((100, 100), (5_000_300, 5_000_100), (9_999_900, 10_000_100), (15_000_000, 14_999_000)):
        timing.synced(sent, due)
    assert timing.jitter == pytest.approx([200e-9, -400e-9, 100e-9])
    summary = timing.summary()
    assert summary == pytest.approx(
        {
            "cycles": 4,
            "cycle": 0.005,
            "jitter_std": float(np.std([200e-9, -400e-9, 100e-9])),
            "jitter_median": 200e-9,
            "jitter_99": 396e-9,
            "jitter_999": 399.6e-9,
            "jitter_max": 400e-9,
            "lateness_99": 976e-9,
            "lateness_max": 1e-6,
        }
    )


MODULE = {"node": 3, "profile": "cia401", "outputs": {0: "a.b", 9: "a.c"}, "safe_outputs": 0x102}


def test_outputs_of_a_module():
    """Two bytes: the safe ones until the drives stand."""
    network = SimpleNamespace(send=lambda _: None, wall_clock=False)
    for outputs, safe, size in (
        ({0: "a.b"}, 0, 1),
        ({7: "a.b"}, 0, 1),
        ({8: "a.b"}, 0, 2),
        ({0: "a.b"}, 0x100, 2),
        ({0: "a.b"}, 0xFF, 1),
    ):
        keys = ModuleKeys.model_validate(MODULE | {"outputs": outputs, "safe_outputs": safe})
        assert ModuleNode("valves", keys, device("cia401"), network, None).size == size
    module = ModuleNode("valves", ModuleKeys.model_validate(MODULE), device("cia401"), network, None)
    module.outputs = 0x201
    assert module.frames() == [Frame(0x203, b"\x02\x01")]
    module.resting = False
    assert module.frames() == [Frame(0x203, b"\x01\x02")]
    module.process_frame(Frame(0x183, b"\0"), 9)
    assert (module.answered, module.answered_at) == (1, 9)
    module.process_frame(Frame(0x283, b"\0"), 10)
    assert (module.answered, module.answered_at) == (1, 9)


def test_outputs_of_a_module_are_commanded_by_one_pdo_alone():
    """Another one is disabled, whatever its identifier: another master could switch a valve by it."""
    node = device("cia401")
    server = SdoServer(node, {(0x1401, 1): 0x21A})
    network = SimpleNamespace(send=server.send, wall_clock=False)
    module = ModuleNode("valves", ModuleKeys.model_validate(MODULE), node, network, lambda *_: None)
    server.answer = module.sdo.process_frame
    module.configure(127)
    assert server.dictionary.get(0x1401, 1) == 0x8000021A


@every_case(
    ("rotary", "at", "limits", "resting"),
    [
        (False, "0 mm", ["-35 mm", "45 mm"], 1e-3),
        (False, "0 mm", ["-45 mm", "35 mm"], -1e-3),
        (False, "-35 mm", ["-35 mm", "35 mm"], -0.034),
        (False, "35 mm", ["-35 mm", "35 mm"], 0.034),
        (False, "-40 mm", ["-35 mm", "35 mm"], -0.035),
        (False, "-35.5 mm", ["-35 mm", "35 mm"], -0.034),
        (False, "0 mm", ["-0.1 mm", "0.2 mm"], 0.2e-3),
        (True, "0 rad", ["-1 rad", "3 rad"], 0.1),
    ],
)
def test_a_homed_drive_is_left_away_from_its_reference(rotary, at, limits, resting):
    keys = node_keys(number=3, homing={"method": 37, "at": at}, limits={"position": limits})
    file = HardwareKeys.model_validate({"simulated": True, "nodes": {"axis": keys}})
    assert Reference(file, "axis", rotary).resting_position() == pytest.approx(resting)


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """A reference of a drive on a bus of another process, which was left at 5 mm; 0.25 mm are near."""
    monkeypatch.setenv("TWIN_STATE", str(tmp_path))

    def kept(profile="faulhaber_v3", at=5000, homing=None, **more):
        homing = {"method": 37, "at": "4 mm"} | (homing or {})
        keys = node_keys(profile, 3, homing=homing, **more)
        file = HardwareKeys.model_validate({"interface": "virtual", "channel": "a/b", "nodes": {"axis": keys}})
        node = unconnected_node(profile, {(0x6064, 0): at}, homing=homing, **more)
        return Reference(file, "axis"), node

    return kept


def test_a_reference_holds_while_the_drive_stands_where_it_was_left(kept):
    """A quarter of a millimeter is near: 249 increments of 1 um are, 251 are not."""
    reference, node = kept()
    node.identity, node.raw_position = [node.sdo.number(0x1018, sub) for sub in (1, 2, 4)], 5000
    assert reference.problem(node) == "this program has not homed it, or a run was broken off since."
    reference.save(node)
    assert reference.path.name == "virtual_a_b_-node3.json"
    record = json.loads(reference.path.read_text())
    homing = {"method": 37, "at": 0.004, "scale": 1.0, "inverted": False}
    assert record == {"identity": node.identity, "homing": homing, "position": 5000}
    assert reference.problem(node) == ""
    assert reference.position(node) == pytest.approx(0.009)
    assert reference.is_recorded
    for count, is_near in ((5249, True), (4751, True), (5251, False), (4749, False)):
        text = "" if is_near else f"6064h is {count} and was 5000 when it was left: it was switched off, or pushed."
        assert reference.problem(kept(at=count)[1]) == text
    for count in (249, -249):
        node.raw_position = count
        reference.save(node)
        text = f"6064h is {count}, as after power-on: whether it was switched off since is not known."
        assert reference.problem(kept(at=count)[1]) == text
    node.raw_position = 251
    reference.save(node)
    assert reference.problem(kept(at=251)[1]) == ""
    node.server.dictionary.values[0x1018, 4] += 1
    assert reference.problem(node) == "another drive was homed at this node-ID."
    for change in ({"homing": {"at": "5 mm"}}, {"homing": {"method": 35}}, {"inverted": True}):
        other, drive = kept(at=251, **change)
        assert other.problem(drive) == "it was homed with another `homing`, `scale` or `inverted`."
    reference.forget()
    assert reference.problem(node) == "this program has not homed it, or a run was broken off since."


def test_a_drive_that_tells_of_its_reference(kept):
    reference, node = kept("epos4", at=0)
    bit = node.profile.reference_bit
    text = f"the drive has no reference (6041h, bit {bit}): it was not homed since it was switched on."
    assert reference.problem(node) == text
    node.server.dictionary.values[0x6041, 0] = 1 << bit
    node.identity = [node.sdo.number(0x1018, sub) for sub in (1, 2, 4)]
    reference.save(node)
    assert reference.problem(node) == ""  # wherever it stands
