"""`twin drive`: a process of its own that another CANopen master talks to, and that gives way to real nodes."""

import os
import select
import signal
import subprocess
import sys
import threading
import time
import uuid
from contextlib import suppress

import can
import canopen
import pytest
from click.testing import CliRunner

from hw_bridge import eds
from hw_bridge.bus import Frame
from hw_bridge.command.drive import command
from hw_bridge.device import Drive, Motor
from hw_bridge.profiles import profile
from hw_bridge.wire import Wire
from hw_bridge.wire.adapter import from_message, to_message
from hw_bridge.wire.link import AnyLink
from hw_bridge.wire.node_id_check import assert_node_id_free
from tests.hw_bridge import program
from tests.hw_bridge.multicast import PORT, needed, own
from tests.hw_bridge.waiting import TIMEOUT, wait_for_frame, wait_for_node
from twin import cli
from twin.errors import SimulationError

NODE = 9


@pytest.mark.parametrize("frame", [Frame(0x123, b"\1\2"), Frame(0x703, remote=True, length=1), Frame(0)])
def test_frames_there_and_back(frame):
    assert from_message(to_message(frame)) == frame


@pytest.mark.parametrize("more", [{"is_extended_id": True}, {"is_error_frame": True}, {"is_fd": True}])
def test_what_canopen_does_not_use_is_ignored(more):
    assert from_message(can.Message(arbitration_id=1, **more)) is None


def test_it_is_a_command_of_twin():
    assert cli.plugin_commands()["drive"].load() is command
    assert "drive" in cli.group.list_commands(None)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("talks", [True, False])
def test_it_refuses_where_another_node_answers(build, talks):
    """A node that is silent by itself answers the question for its identity."""
    channel = uuid.uuid4().hex
    chosen = profile("mclm")
    with can.Bus(channel, interface="virtual") as theirs, can.Bus(channel, interface="virtual") as ours:
        wire = Wire(
            Drive(chosen, NODE if talks else NODE + 1, Motor(chosen.motor, build=build)), AnyLink(theirs, "virtual")
        )
        thread = threading.Thread(target=wire.run)
        thread.start()
        try:
            wait_for_frame(ours, 0x700 + wire.slave.node)
            if talks:
                with pytest.raises(SimulationError, match="another node answers on this ID"):
                    assert_node_id_free(AnyLink(ours, "virtual"), NODE)
            else:
                assert_node_id_free(AnyLink(ours, "virtual"), NODE)
        finally:
            wire.stop.set()
            thread.join()


@pytest.fixture
def multicast(build):
    """A group of this test alone on loopback or the local network."""
    channel = needed(own(74), port=PORT)
    arguments = ["-p", "mclm", "-n", str(NODE), "-i", "udp_multicast", "-c", channel, "--option", f"port={PORT}"]
    return channel, [sys.executable, "-m", "hw_bridge.drive", *arguments, "--build", str(build)]


@pytest.mark.slow
def test_a_process_of_its_own(multicast, tmp_path):
    channel, line = multicast
    path = tmp_path / "mclm.eds"
    path.write_text(eds.export(profile("mclm")))
    process = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    network = canopen.Network()
    try:
        assert "node 9" in process.stdout.readline()
        network.connect(channel=channel, interface="udp_multicast", port=PORT)
        node = network.add_node(NODE, str(path))
        wait_for_node(node)
        assert node.sdo[0x1018][1].raw == 327
        again = subprocess.run(line, capture_output=True, text=True, check=False)
        assert again.returncode == 1
        assert "another node answers on this ID" in again.stderr
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=20)
        assert (process.returncode, err) == (0, "")
        assert "stopped after" in out
    finally:
        network.disconnect()
        process.kill()
        process.wait()


STARTER = "import subprocess, sys, time; subprocess.Popen(sys.argv[1:]); time.sleep(600)"


@pytest.mark.slow
@pytest.mark.parametrize("nohup", [False, True])
def test_it_ends_with_the_process_that_started_it(build, nohup):
    line = [sys.executable, "-m", "hw_bridge.drive", "-p", "mclm", "-i", "virtual", "-c", "x", "--build", str(build)]
    line = ["nohup", *line] if nohup else line
    with program.begun([sys.executable, "-c", STARTER, *line], stdout=subprocess.PIPE, text=True) as starter:
        try:
            assert "node 1" in starter.stdout.readline()
            starter.kill()
            starter.wait()
            ended = select.select([starter.stdout], [], [], 2.0 if nohup else TIMEOUT)[0]
            assert bool(ended) is not nohup
            assert nohup or "stopped after" in starter.stdout.read()
        finally:
            with suppress(ProcessLookupError):
                program.send(starter, signal.SIGKILL)


@pytest.fixture
def serial_line():
    """Two pseudo-terminals with a cable between them."""
    pty, tty = pytest.importorskip("pty"), pytest.importorskip("tty")
    ends = [pty.openpty() for _ in range(2)]
    for end in (*ends[0], *ends[1]):
        tty.setraw(end)
    masters = [master for master, _ in ends]
    over = threading.Event()

    def carry():
        while not over.is_set():
            for master in select.select(masters, [], [], 0.1)[0]:
                os.write(masters[1 - masters.index(master)], os.read(master, 4096))

    thread = threading.Thread(target=carry)
    thread.start()
    yield [os.ttyname(name) for _, name in ends]
    over.set()
    thread.join()
    for end in (*ends[0], *ends[1]):
        os.close(end)


@pytest.mark.slow
@pytest.mark.real_time
def test_slcan_over_a_serial_line(serial_line, build, tmp_path):
    """200 SYNCs at 5 ms, a TPDO for each."""
    ours, theirs = serial_line
    path = tmp_path / "epos4.eds"
    path.write_text(eds.export(profile("epos4")))
    line = [
        sys.executable,
        "-m",
        "hw_bridge.drive",
        "-p",
        "epos4",
        "-n",
        "3",
        "-i",
        "slcan",
        "-c",
        theirs,
        "--build",
        str(build),
    ]
    process = subprocess.Popen(line, stdout=subprocess.PIPE, text=True)
    network = canopen.Network()
    try:
        assert "node 3" in process.stdout.readline()
        network.connect(interface="slcan", channel=ours, bitrate=1_000_000)
        node = network.add_node(3, str(path))
        wait_for_node(node)
        assert node.sdo[0x1018][2].raw == 0x61500000
        node.sdo[0x1800][2].raw = 1
        node.nmt.state = "OPERATIONAL"
        seen = []
        network.subscribe(0x183, lambda _id, data, _time: seen.append(bytes(data)))
        for _ in range(200):
            network.send_message(0x080, b"")
            time.sleep(0.005)
        end = time.monotonic() + TIMEOUT
        while len(seen) < 200 and time.monotonic() < end:
            time.sleep(0.01)
        assert len(seen) == 200
    finally:
        network.disconnect()
        process.terminate()
        process.communicate(timeout=20)
    assert process.returncode == 0


@pytest.mark.slow
def test_eds_files_in_and_out(tmp_path):
    path = tmp_path / "drive.eds"
    runner = CliRunner()
    assert runner.invoke(command, ["-p", "epos4", "--write-eds", str(path)]).exit_code == 0
    assert len(eds.load(path)) == len(profile("epos4").objects)
    few = tmp_path / "few.eds"
    text = path.read_text().replace("[6064]", "[5064]")
    few.write_text(text)
    result = runner.invoke(command, ["-p", "epos4", "--eds", str(few), "-i", "virtual", "-c", "none"])
    assert "lacks 6064" in str(result.exception)
    assert runner.invoke(command, ["-p", "epos4"]).exit_code == 2


@pytest.mark.slow
def test_an_interface_that_cannot_be_opened(build):
    line = [
        sys.executable,
        "-m",
        "hw_bridge.drive",
        "-p",
        "mclm",
        "-n",
        "1",
        "-i",
        "nonsense",
        "-c",
        "x",
        "--build",
        str(build),
    ]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("error: nonsense x: cannot be opened")
    assert done.stderr.count("\n") == 1
