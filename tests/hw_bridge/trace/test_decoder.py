"""Traces: the same in every format, with the meaning of their frames; broken ones end in one line."""

import csv
import errno
import io
import json
import struct

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from hw_bridge import eds
from hw_bridge.bus import Frame
from hw_bridge.command.can import command
from hw_bridge.dictionary import Mode
from hw_bridge.profiles import profile
from hw_bridge.trace import Decoder, TracedNode
from hw_bridge.wire import TraceWriter, read
from hw_bridge.wire.files import SUFFIXES
from tests.hw_bridge.axis import Rig, node
from tests.hw_bridge.bench import AbortedError, Bench
from twin.errors import SimulationError

NODE = 3


@pytest.fixture(scope="module")
def recorded(build, tmp_path_factory):
    """A drive is identified, remapped, moved, breaks and starts anew: the same bus in each format."""
    folder = tmp_path_factory.mktemp("traces")
    bench = Bench("epos4", build)
    writers = [TraceWriter(folder / f"bus{suffix}", "can0") for suffix in SUFFIXES]
    for writer in writers:
        bench.bus.observers.append(writer.write)
    begin = bench.bus.now
    for sub in (1, 2):
        bench.read(0x1018, sub)
    bench.sdo(struct.pack("<BHB", 0x40, 0x1008, 0))  # a name of five bytes, in segments
    bench.sdo(b"\x60")
    bench.write(0x60A9, 0xFDB44700)
    bench.write(0x1800, 0xC0000183, 1)
    bench.write(0x1A00, 0)
    for place, word in enumerate((0x60410010, 0x60640020), 1):
        bench.write(0x1A00, word, place)
    bench.write(0x1A00, 2)
    bench.write(0x1800, 1, 2)
    bench.write(0x1800, 0x40000183, 1)
    bench.nmt(1)
    bench.write(0x1017, 20)
    bench.enable(Mode.PP)
    bench.write(0x6081, 1_000_000)  # mrpm
    bench.write(0x607A, 500)
    with pytest.raises(AbortedError):
        bench.write(0x1018, 3, sub=1)
    bench.send(0x203, [0x1F, 0])
    for _ in range(10):
        bench.send(0x080)
        bench.go(4.5)
    bench.drive.inject(0x7320)
    bench.go(5)
    bench.nmt(129)
    bench.go(150)
    bench.nmt(1)
    bench.go(5)
    for writer in writers:
        writer.close()
    return {writer.path.suffix: writer.path for writer in writers} | {"begin": begin, "drive": bench.drive}


def decoded(path, decoder=None):
    decoder = decoder or Decoder()
    return [decoder.decode(time, frame) for time, frame, _ in read(path)]


def texts(lines, service):
    return [line.text for line in lines if line.service == service]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format_has_the_same_frames_and_times(recorded, suffix):
    """To the microsecond: what ASC and candump logs hold."""
    frames = [(round(time / 1e3), frame) for time, frame, _ in read(recorded[suffix])]
    assert frames == [(round(time / 1e3), frame) for time, frame, _ in read(recorded[".log"])]
    assert frames[0][0] * 1000 > recorded["begin"]
    assert len(frames) > 70


def test_an_unknown_node_tells_who_it_is(recorded):
    lines = decoded(recorded[".blf"])
    sdo = texts(lines, "SDO")
    assert "node 3: 1018h.1 Identity object: Vendor ID = 251" in sdo
    assert "node 3: 1008h.0 Manufacturer device name = 'EPOS4'" in sdo
    assert "node 3: write 6060h.0 Modes of operation = 1 pp" in sdo
    assert "node 3: abort 1018h.1 Identity object: Vendor ID: 06010002h read only" in sdo
    assert "node 3: write 607Ah.0 Target position = 500 = 1.5708 rad" in sdo
    assert texts(lines, "NMT") == ["node 3: start", "node 3: reset node", "node 3: start"]
    assert "node 3: 7320h position sensor; register generic, manufacturer" in texts(lines, "EMCY")
    assert {"node 3: boot-up", "node 3: operational"} <= set(texts(lines, "HEARTBEAT"))
    assert sum(line.service == "SYNC" for line in lines) == 10


def test_the_mapping_follows_the_trace(recorded):
    """Remapped over SDO, and as by default after the reset."""
    lines = decoded(recorded[".blf"])
    pdos = [line for line in lines if line.frame.id == 0x183]
    mapped = [line for line in pdos if len(line.frame.data) == 6]
    assert len(mapped) >= 10
    for line in mapped:
        word, position = struct.unpack("<Hi", line.frame.data)
        assert line.values["statusword"] == word
        assert line.values["position_actual_value"] == pytest.approx(position * 2 * 3.14159265 / 2000)
    assert max(line.values["position_actual_value"] for line in mapped) > 0.01
    assert any("Operation enabled" in line.text for line in mapped)
    last = pdos[-1]
    assert len(last.frame.data) == 2
    assert "Switch on disabled" in last.text
    assert last.notable
    (pdo,) = [line for line in lines if line.frame.id == 0x203]
    assert pdo.text == "node 3 RPDO1: Controlword 001Fh Enable operation, new set-point"


def test_a_trace_from_the_middle():
    """Without a profile nothing is claimed of process data; with one its default mapping holds."""
    frame = Frame(0x283, bytes([0x37, 0x06, 1, 0, 0, 0]))
    assert Decoder().decode(0, frame).text == "node 3 TPDO2: mapping not in the trace"
    known = Decoder([TracedNode(3, profile("faulhaber_v3"), name="axis")])
    said = known.decode(0, frame)
    assert said.text.endswith("Operation enabled, target reached; Position actual value 1 = 1e-06 m")
    assert "2 bytes, the mapping has 6" in known.decode(0, Frame(0x283, b"\0\0")).text


def test_units_follow_the_scaling():
    """60A9h in mrpm, which the bridge writes. The screw of the bench and its direction are not the drive's."""
    from hw_bridge.hardware import NodeKeys

    keys = NodeKeys.model_validate({"node": 3, "profile": "epos4", "scale": 0.002, "inverted": True})
    decoder = Decoder([TracedNode(3, profile("epos4"), keys, "screw")])
    speed = Frame(0x283, struct.pack("<ii", 60_000, 1500))
    line = decoder.decode(0, speed)
    assert line.values["velocity_actual_value"] == pytest.approx(2 * 3.14159265)
    assert line.values["current_actual_values_actual"] == pytest.approx(1.5)
    assert "rad/s" in line.text


def test_what_is_stored_remains_after_a_reset():
    party = TracedNode(3, profile("epos4"))
    decoder = Decoder([party])
    for index, value in ((0x60A9, 0xFDB44700), (0x1010, 0x65766173)):
        sub = index == 0x1010
        decoder.decode(0, Frame(0x603, struct.pack("<BHBI", 0x23, index, sub, value)))
        decoder.decode(0, Frame(0x583, struct.pack("<BHBI", 0x60, index, sub, 0)))
    decoder.decode(0, Frame(0x603, struct.pack("<BHBI", 0x23, 0x607A, 0, 7)))
    decoder.decode(0, Frame(0x583, struct.pack("<BHBI", 0x60, 0x607A, 0, 0)))
    assert party.dictionary.get(0x607A) == 7
    decoder.decode(0, Frame(0x703, b"\0"))
    assert (party.dictionary.get(0x607A), party.dictionary.get(0x60A9)) == (0, 0xFDB44700)


def test_segments_of_a_write_are_put_together():
    """CiA 301, 7.2.4.3: the number of unused bytes stands in bits 1 to 3 of a segment, bit 0 marks the last one."""
    party = TracedNode(3, profile("epos4"))
    decoder = Decoder([party])
    name = b"catheter 1"

    def exchange(request, response):
        return [
            decoder.decode(0, Frame(i, data.ljust(8, b"\0"))).text for i, data in ((0x603, request), (0x583, response))
        ]

    begin = exchange(struct.pack("<BHBI", 0x21, 0x1008, 0, len(name)), struct.pack("<BHB", 0x60, 0x1008, 0))
    assert begin[0] == "node 3: write 1008h.0 Manufacturer device name, 10 bytes in segments"
    middle = exchange(b"\x00" + name[:7], b"\x20")
    assert middle == [
        "node 3: segment of 1008h.0 Manufacturer device name",
        "node 3: segment of 1008h.0 Manufacturer device name taken",
    ]
    last = exchange(b"\x19" + name[7:], b"\x30")
    assert last[0] == "node 3: write 1008h.0 Manufacturer device name = 'catheter 1'"


def test_segments_of_a_read_are_put_together():
    party = TracedNode(3, profile("epos4"))
    decoder = Decoder([party])
    frames = [
        (0x603, struct.pack("<BHBI", 0x40, 0x1008, 0, 0)),
        (0x583, struct.pack("<BHBI", 0x41, 0x1008, 0, 9)),
        (0x603, b"\x60".ljust(8, b"\0")),
        (0x583, b"\x00catheter"[:8]),
        (0x603, b"\x70".ljust(8, b"\0")),
        (0x583, b"\x1br8".ljust(8, b"\0")),
    ]
    said = [decoder.decode(0, Frame(*frame)).text for frame in frames]
    title = "1008h.0 Manufacturer device name"
    assert said[0] == f"node 3: read {title}"
    assert said[1] == f"node 3: {title}: 9 bytes in segments"
    assert said[2:5] == [
        f"node 3: next segment of {title}",
        f"node 3: segment of {title}",
        f"node 3: next segment of {title}",
    ]
    assert said[5] == f"node 3: {title} = 'catheter8'"


def test_transfers_of_other_kinds_and_lengths():
    decoder = Decoder([TracedNode(3, profile("epos4"))])
    said = [
        decoder.decode(0, Frame(0x603, data)).text
        for data in (b"\xa0" + bytes(7), b"\xc1" + bytes(7), b"\xe0" + bytes(7), b"\x40\x08")
    ]
    assert said == [
        "node 3: block transfer, not followed",
        "node 3: block transfer, not followed",
        "node 3: unknown command E0h",
        "node 3: request of 2 bytes, 8 expected",
    ]
    assert decoder.decode(0, Frame(0x583, b"\x40")).text == "node 3: response of 1 bytes, 8 expected"


@given(st.lists(st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8)), max_size=30))
def test_no_frame_breaks_a_decoder(frames):
    decoder = Decoder(
        [TracedNode(1, profile("mclm")), TracedNode(2, profile("faulhaber_v3")), TracedNode(3, profile("epos4"))]
    )
    for time, frame in enumerate(frames):
        line = decoder.decode(time, frame)
        assert line.frame is frame
        assert "\n" not in line.text


@pytest.fixture
def run():
    return lambda *words: CliRunner().invoke(command, ["decode", *map(str, words)])


def test_a_count_of_mapped_objects_that_no_pdo_has_is_no_mapping():
    """A write of four bytes to 1A00h.0, which has one."""
    decoder = Decoder([TracedNode(1, profile("faulhaber_v3"))])
    decoder.decode(0, Frame(0x601, b"\x23\x00\x1a\x00\xff\xff\xff\x7f"))
    decoder.decode(1, Frame(0x581, b"\x60\x00\x1a\x00" + bytes(4)))
    assert "mapping not in the trace" in decoder.decode(2, Frame(0x181, bytes(2))).text


def test_on_the_command_line(recorded, run):
    path = recorded[".asc"]
    shown = run(path, "-p", "epos4", "-n", NODE).output.splitlines()
    assert "183  [6]" in next(one for one in shown if "Operation enabled" in one and "TPDO1" in one)
    events = run(path, "--events").output.splitlines()
    assert 5 < len(events) < len(shown)
    found = [json.loads(one) for one in run(path, "--json", "--only", "emcy").output.splitlines()]
    assert found[0]["values"] == {"code": 0x7320, "register": 0x81}
    rows = list(csv.DictReader(io.StringIO(run(path, "--csv", "--from", "0.2", "--node", NODE).output)))
    assert rows
    assert all(float(row["time [s]"]) >= 0.2 and row["node"] == "3" for row in rows)
    assert run(path, "-p", "epos4").exit_code == 2
    assert run(path, "-p", "epos4", "-n", 3, "--bench", "x.yaml").exit_code == 2


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.log", b"garbage\n", "broken after 0 frames"),
        ("a.log", b"(0.1) can0 183#0011 R\n(0.2) can0 18", "broken after 1 frames"),
        ("a.asc", b"garbage\n", "holds no frames, or is no .asc file"),
        ("a.blf", b"garbage garbage\n", "broken after 0 frames"),
        ("a.log", b"", "is empty"),
        ("a.pcap", b"x", r"no trace format '\.pcap'"),
        ("a.log", None, "no such file"),
    ],
)
def test_broken_files(tmp_path, run, name, content, text):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SimulationError, match=text) as caught:
        list(read(path))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert isinstance(run(path).exception, SimulationError)


def test_a_truncated_blf(recorded, tmp_path):
    path = tmp_path / "short.blf"
    path.write_bytes(recorded[".blf"].read_bytes()[:-100])
    with pytest.raises(SimulationError, match="broken after"):
        list(read(path))


def test_written_aside_is_the_same(tmp_path):
    """By a thread of its own, complete and in order when it is closed."""
    frames = [(time * 1000, Frame(time % 0x7FF, bytes([time % 256]))) for time in range(3000)]
    for aside in (False, True):
        writer = TraceWriter(tmp_path / f"{aside}.blf", "can0", aside=aside)
        for one in frames:
            writer.write(*one)
        writer.close()
    assert (tmp_path / "True.blf").read_bytes() == (tmp_path / "False.blf").read_bytes()


@pytest.mark.parametrize("aside", [False, True])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_disk_that_is_full_ends_the_trace_and_says_so(tmp_path, suffix, aside):
    """Not the run: neither a frame nor the end of the trace raises."""
    writer = TraceWriter(tmp_path / f"a{suffix}", "can0", aside=aside)
    file, plain = writer._writer, writer._writer.on_message_received

    def full(message):
        plain(message)
        raise OSError(errno.ENOSPC, "No space left on device")

    file.on_message_received = full
    for time in (2_000_000_000, 3_000_000_000):
        writer.write(time, Frame(1))
    assert writer.close() == (
        f"{tmp_path / f'a{suffix}'}: cannot be written: No space left on device. The trace is incomplete: it ends before 2.000 s."
    )


def test_a_trace_that_cannot_be_completed_is_a_note_of_the_run(build, tmp_path):
    rig = Rig(build, {"servomotor": node()})
    rig.session.trace = tmp_path / "a.blf"
    rig.go(10)
    stop = rig.session.listener.writer._writer.stop

    def full():
        stop()
        raise OSError(errno.ENOSPC, "No space left on device")

    rig.session.listener.writer._writer.stop = full
    rig.axis.close()
    assert [note for note in rig.session.outcome.notes if "The trace is incomplete" in note]
    assert rig.session.outcome.bus_events


def test_a_place_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SimulationError, match="cannot be written"):
        TraceWriter(tmp_path / "file" / "a.blf", "can0")
    with pytest.raises(SimulationError, match="no trace format"):
        TraceWriter(tmp_path / "a.txt", "can0")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_canopen_does_not_use(tmp_path, run, suffix):
    import can

    path = tmp_path / f"other{suffix}"
    writer = TraceWriter(path, "can0")
    writer.write(1_000_000, None)
    writer._writer.on_message_received(can.Message(timestamp=0.002, arbitration_id=0x12345, is_extended_id=True))
    writer.write(3_000_000, Frame(0x703, remote=True, length=1))
    writer.close()
    found = run(path).output.splitlines()
    assert [one.split()[-2:] for one in found] == [["error", "frame"], ["29-bit", "identifier"], ["state", "requested"]]


@pytest.mark.slow
def test_objects_of_an_eds_file(tmp_path, run):
    """Of any vendor: names and types are those of the file."""
    path = tmp_path / "other.eds"
    path.write_text(eds.export(profile("epos4")).replace("ParameterName=Node-ID", "ParameterName=Own name"))
    trace = tmp_path / "some.log"
    trace.write_text("(0.100000) can0 607#4000200000000000\n(0.101000) can0 587#4F00200007000000\n")
    assert "Own name" not in run(trace, "--node", 7).output
    done = run(trace, "--node", 7, "--eds", path)
    assert done.exit_code == 0, done.output
    assert "2000h.0 Own name" in done.output
    assert "2000h.0 Own name" in run(trace, "--profile", "epos4", "--node", 7, "--eds", path).output
    bench = tmp_path / "bench.yaml"
    bench.write_text("simulated: true\nnodes: {screw: {node: 7, profile: epos4}}\n")
    assert "screw: " in run(trace, "--bench", bench, "--node", 7, "--eds", path).output
    assert "2000h.0 Own name" in run(trace, "--bench", bench, "--node", 7, "--eds", path).output
    path.write_text(eds.export(profile("mclm")))  # of another drive: no units then
    assert run(trace, "--profile", "epos4", "--node", 7, "--eds", path).exit_code == 0
    assert "Name one --node for each --eds" in run(trace, "--eds", path).output
