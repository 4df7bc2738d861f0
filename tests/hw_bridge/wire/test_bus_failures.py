"""The bus fails while a drive moves: the run ends with the cause, without a traceback, and so does the drive's motion."""

import ctypes
import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from hw_bridge.dictionary import State
from tests.hw_bridge.multicast import PORT
from tests.hw_bridge.wire.wired import rig, until, wired
from twin.errors import SimulationError

pytestmark = [
    pytest.mark.slow,
    pytest.mark.real_time,
    pytest.mark.skipif(sys.platform != "linux" or shutil.which("ip") is None, reason="network namespaces"),
]
NEW_NETWORK = 0x40000000  # CLONE_NEWNET of linux/sched.h
UP = ["link set lo up multicast on", "route add 239.0.0.0/8 dev lo"]
GROUP, OPTIONS = "239.74.0.3", {"port": PORT}


def ip(words):
    subprocess.run(["ip", *words.split()], check=True)


@pytest.fixture
def isolated():
    """A thread, and those that it starts, with a network interface of their own."""
    with ThreadPoolExecutor(1) as executor:
        if executor.submit(ctypes.CDLL(None).unshare, NEW_NETWORK).result():
            pytest.skip("no right to make a network namespace")
        for words in UP:
            executor.submit(ip, words).result()
        yield executor


def fail(build, failure):
    """Let the interface fail a second after the drive moves; return error, notes, time until the end [s], and the drive."""
    with wired("udp_multicast", GROUP, build, OPTIONS) as wire:
        axis = rig("udp_multicast", GROUP, build, OPTIONS)
        failed_at = []

        def act():
            assert until(lambda: abs(wire.slave.axis.motor.position) > 1e-3)
            failed_at.append(time.monotonic())
            ip(failure)

        thread = threading.Thread(target=act)
        thread.start()
        with pytest.raises(SimulationError) as error:
            axis.go(20_000)
        ended_at = time.monotonic()
        thread.join()
        assert until(lambda: wire.slave.state not in (State.ENABLED, State.QUICK_STOP))
        return str(error.value), axis.session.outcome.unsafe, ended_at - failed_at[0], wire.slave


@pytest.mark.parametrize("failure", ["link set lo down", "route del 239.0.0.0/8 dev lo"])
def test_a_network_interface_that_fails(isolated, build, failure):
    error, notes, duration, drive = isolated.submit(fail, build, failure).result()
    assert error.startswith("bus: does not take frames: [Errno 101] Network is unreachable. Check the adapter")
    assert notes[0].endswith("The drives stop by themselves when this program's heartbeat is missing.")
    assert 0x8130 in drive.active
    assert duration < 5.0
