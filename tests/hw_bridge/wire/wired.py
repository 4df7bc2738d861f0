"""A simulated drive on a real interface of python-can, in a thread of the test: paced by the wall clock."""

import threading
import time
from contextlib import contextmanager

from hw_bridge.device import Drive, Motor
from hw_bridge.profiles import profile
from hw_bridge.wire import Wire, link, open_bus, shut_down
from tests.hw_bridge.axis import Rig, node
from twin.errors import SimulationError

# a machine that tests share stalls; five cycles without process data are an end
PACE = {"simulated": False, "cycle": "50 ms"}
HEARTBEAT = {"every": "50 ms", "lost_after": "500 ms"}


class Wired(Wire):
    """`ended`: why its interface could not be heard any more."""

    ended = ""


@contextmanager
def wired(interface, channel, build, options=None):
    """A drive of the rig's vendor as node 1, until the block ends."""
    known = profile("faulhaber_v3")
    drive = Drive(known, 1, Motor(known.motor, build=build))
    bus = open_bus(interface, channel, 1_000_000, options or {})
    wire = Wired(drive, link(bus, interface))

    def run():
        try:
            wire.run()
        except SimulationError as error:
            wire.ended = str(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield wire
    finally:
        wire.stop.set()
        thread.join()
        shut_down(bus)


def until(condition, patience=20.0):
    """Whether it comes true within a time [s]."""
    end = time.monotonic() + patience
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    return condition()


def rig(interface, channel, build, options=None):
    """An axis on it, that moves at 20 mm/s."""
    made = Rig(
        build,
        {"servomotor": node(heartbeat=HEARTBEAT)},
        interface=interface,
        channel=channel,
        options=options or {},
        **PACE,
    )
    made.set(target_velocity=0.02)
    return made
