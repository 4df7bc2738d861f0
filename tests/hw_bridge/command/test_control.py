"""`twin drive inject`: faults of a running drive, and frames that are disturbed on a wire."""

import signal
import socket
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import can
import pytest
from click.testing import CliRunner

from hw_bridge.bus import MILLISECOND, Disturbance, Frame, Kind
from hw_bridge.command.control import Control, request
from hw_bridge.command.drive import command
from hw_bridge.device import Drive, Motor
from hw_bridge.fault import Cause, Fault, problem
from hw_bridge.profiles import profile
from hw_bridge.wire import Wire
from hw_bridge.wire.link import Arrival
from tests.every_case import every_case
from tests.hw_bridge.command.test_command import NODE as PROCESS_NODE
from tests.hw_bridge.command.test_command import multicast  # noqa: F401 - a fixture
from tests.hw_bridge.multicast import PORT
from tests.hw_bridge.waiting import wait_for_boot, wait_for_frame
from twin.errors import SimulationError

NODE = 3
STALL = 0.4  # longer than a drive takes to boot [s]


class Line:
    """Takes the place of an interface: keeps what is sent."""

    def __init__(self):
        self.sent = []

    def send(self, frame):
        self.sent.append(frame)


@pytest.fixture
def wire(build):
    chosen = profile("epos4")
    wire = Wire(Drive(chosen, NODE, Motor(chosen.motor, build=build)), Line())
    wire.slave.advance(110 * MILLISECOND)
    return wire


def beats(wire, milliseconds=100):
    """Heartbeats that get out."""
    wire.link.sent.clear()
    wire.slave.advance(wire.now + milliseconds * MILLISECOND)
    return sum(one.id == 0x700 + NODE for one in wire.link.sent)


def test_frames_on_a_wire_are_disturbed(wire):
    wire.slave.dictionary.download(0x1017, 0, bytes([10, 0]))
    assert beats(wire) == 10
    wire.disturbances = [Disturbance(Kind.DROP, 0x703, 0x703, count=4)]
    assert beats(wire) == 6
    wire.disturbances = [Disturbance(Kind.DELAY, 0x703, 0x703, delay=25 * MILLISECOND)]
    assert beats(wire) == 7  # two and a half are under way
    wire.disturbances = [Disturbance(Kind.CORRUPT, 0x703, 0x703, count=5)]  # repeated, and through
    assert beats(wire) == 13  # three were late
    wire.disturbances = [Disturbance(Kind.CORRUPT, 0x703, 0x703, count=32)]
    assert beats(wire) == 9
    assert profile("epos4").bus_off in wire.slave.active
    wire.disturbances = [
        Disturbance(Kind.DROP, 0x603, 0x603, count=1),
        Disturbance(Kind.DELAY, 0x603, 0x603, delay=MILLISECOND),
    ]
    for answers in (0, 1):
        wire.link.sent.clear()
        wire._deliver(Frame(0x603, bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0])))
        wire.slave.advance(wire.now + 5 * MILLISECOND)
        assert sum(one.id == 0x583 for one in wire.link.sent) == answers


def test_a_request_acts_or_says_why_not(wire):
    control = Control(0, wire.slave, wire)
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("socket.socket.recv", lambda one, size: (control.look(), one.recvfrom(size)[0])[1])
            request(control.port, Fault(Cause.EMCY, 0x7320))
            assert 0x7320 in wire.slave.active
            request(control.port, Fault(Cause.DROP, count=3, identifiers=(0x703, 0x703)))
            assert (wire.disturbances[0].count, wire.disturbances[0].only) == (3, {0x703})
            with pytest.raises(SimulationError, match="has no error 1234h"):
                request(control.port, Fault(Cause.EMCY, 0x1234))
            assert "not understood" in control._done(b"{}")
            assert "not understood" in control._done(b"\xff")
    finally:
        control.close()


def test_nobody_answers_and_a_port_that_is_taken(wire):
    control = Control(0, wire.slave, wire)
    try:
        with pytest.raises(SimulationError, match=f"--control {control.port}: .*Choose another port"):
            Control(control.port, wire.slave, wire)
    finally:
        control.close()
    with pytest.raises(SimulationError, match=f"--control {control.port}: no drive answers"):
        request(control.port, Fault(Cause.RESET))


@pytest.mark.slow
def test_faults_of_a_process(multicast):  # noqa: F811
    """EMCY, lost heartbeat and reset of a drive that runs by itself, seen on the bus."""
    channel, line = multicast
    process = subprocess.Popen([*line, "--control", "0"], stdout=subprocess.PIPE, text=True)
    try:
        port = process.stdout.readline().partition("--control ")[2].partition(".")[0]
        inject = [sys.executable, "-c", "from hw_bridge.command.drive import command; command()", "inject"]
        process.send_signal(signal.SIGSTOP)  # on another machine a drive takes longer to boot
        threading.Timer(STALL, process.send_signal, [signal.SIGCONT]).start()
        with can.Bus(channel=channel, interface="udp_multicast", port=PORT) as bus:
            wait_for_boot(bus, PROCESS_NODE)  # a drive that still boots tells no errors
            for words, identifier, data in (
                (["emcy", "--code", "8611h"], 0x080 + PROCESS_NODE, b"\x11\x86"),
                (["reset"], 0x700 + PROCESS_NODE, b"\0"),
            ):
                done = subprocess.run([*inject, *words, "--control", port], capture_output=True, text=True, check=False)
                assert (done.returncode, done.stderr) == (0, "")
                wait_for_frame(bus, identifier, data)
    finally:
        process.terminate()
        process.communicate(timeout=20)
    assert process.returncode == 0


def test_words_that_are_wrong():
    runner = CliRunner()
    assert runner.invoke(command, ["inject", "emcy", "--control", "9", "--code", "zz"]).exit_code == 2
    assert (
        "expected an EMCY code" in runner.invoke(command, ["inject", "emcy", "--control", "9", "--code", "zz"]).output
    )
    assert "bus_off" in runner.invoke(command, ["inject", "--help"]).output
    assert "Name --profile" in runner.invoke(command, []).output


@every_case(
    ("said", "message"),
    [
        (Fault(Cause.ENCODER_OFFSET, offset=float("nan")), "offset is nan: expected a number from -1e+06 to 1e+06"),
        (Fault(Cause.FRICTION, factor=float("inf")), "factor is inf"),
        (Fault(Cause.DROP, share=float("nan")), "share is nan"),
        (Fault(Cause.DELAY, delay=-5), "delay is -5"),
        (Fault(Cause.DELAY, jitter="x"), "jitter is x"),
        (Fault(Cause.DROP, identifiers=(0, 10**12)), "identifiers are (0, 1000000000000): expected two of 0 to 0x7FF"),
        (Fault(Cause.DROP, identifiers=(5, 1)), "identifiers are (5, 1)"),
        (Fault(Cause.EMCY, code=-5), "code is -5"),
    ],
)
def test_numbers_that_would_break_a_drive(said, message):
    assert message in problem(said, profile("epos4"))


@pytest.mark.parametrize("request_", [b"", b"{}", b"[]", b"null", b"\xff", b'"x"', b'{"cause": "emcy"}', b"[" * 4000])
def test_requests_that_are_none_are_answered(wire, request_):
    control = Control(0, wire.slave, wire)
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
            asking.settimeout(2.0)
            asking.connect(("127.0.0.1", control.port))
            asking.send(request_)
            control.look()
            assert asking.recv(4096)
    finally:
        control.close()


@pytest.mark.parametrize(
    "words", [["drop", "--for", "nan"], ["delay", "--delay", "inf"], ["friction", "--factor", "nan"]]
)
def test_odd_numbers_on_the_command_line(words):
    done = CliRunner().invoke(command, ["inject", *words, "--control", "1"])
    assert done.exit_code == 2
    assert "expected a number of at most 1e+06" in done.output


def test_frames_act_when_they_came(wire, monkeypatch):
    """A process that had to wait finds heartbeats from the meantime, and no timeout."""
    slave, arrivals, timeout = (
        wire.slave,
        [[Arrival(Frame(0x77F, b"\x05"), 20 * k * MILLISECOND)] for k in range(10)],
        60,
    )
    slave.dictionary.download(0x1016, 1, (0x7F << 16 | timeout).to_bytes(4, "little"))
    wire._deliver(Frame(0x77F, b"\x05"))
    assert slave.active == {}
    wire.link.looked = 0
    monkeypatch.setattr("hw_bridge.wire.wire.time", SimpleNamespace(monotonic_ns=lambda: wire.link.looked))

    def hear(_timeout):
        wire.link.looked = 200 * MILLISECOND
        return arrivals.pop() if arrivals else wire.stop.set() or []

    wire.link.hear = hear
    wire.run()
    assert not arrivals
    assert slave.active == {}
    wire.slave.advance(wire.now + (timeout + 20) * MILLISECOND)
    assert 0x8130 in slave.active


def test_a_stall_after_the_look_does_not_move_what_came(wire, monkeypatch):
    """Two SYNCs 5 ms apart stay so, though the process was stalled with the first one in its hands."""
    came, looks = [], []
    monkeypatch.setattr(wire.slave, "receive", lambda _frame: came.append(wire.now))

    def hear(_timeout):
        wire.link.looked = time.monotonic_ns()
        looks.append(wire.link.looked)
        if len(looks) == 1:
            time.sleep(0.05)
            return [Arrival(Frame(0x080))]
        if len(looks) == 2:
            return [Arrival(Frame(0x080), looks[1] - looks[0] - 5 * MILLISECOND)]
        wire.stop.set()
        return []

    wire.link.hear = hear
    wire.run()
    assert came[1] - came[0] == 5 * MILLISECOND


def test_identifiers_are_taken_as_a_range(monkeypatch):
    asked = []
    monkeypatch.setattr("hw_bridge.command.control.request", lambda _port, fault: asked.append(fault))
    words = ["inject", "drop", "--control", "9", "--identifiers"]
    assert CliRunner().invoke(command, [*words, "180h-1FF"]).exit_code == 0
    assert asked[0].identifiers == (0x180, 0x1FF)
    for bad in ("180h", "1-2-3", "x-y"):
        assert "expected two such as 180h-1FFh" in CliRunner().invoke(command, [*words, bad]).output
    assert len(asked) == 1
