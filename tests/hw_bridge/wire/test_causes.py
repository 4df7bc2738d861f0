"""What ends a run on a real interface is told with its cause and the drive's own words; the drive is safe."""

import threading
import time
import uuid

import pytest

from hw_bridge.dictionary import State
from tests.hw_bridge.multicast import PORT, needed, own
from tests.hw_bridge.wire.wired import rig, until, wired
from twin.errors import SimulationError

pytestmark = [pytest.mark.slow, pytest.mark.real_time]
BOOTED = 200_000_000  # after that a drive tells errors [ns]
SAFE = (State.DISABLED, State.READY, State.FAULT)


@pytest.fixture(params=["virtual", "udp_multicast"])
def bus(request):
    """Interface, channel and options, of this test alone."""
    if request.param == "virtual":
        return "virtual", uuid.uuid4().hex, {}
    return "udp_multicast", needed(own(76), port=PORT), {"port": PORT}


def test_a_fault_while_it_moves(bus, build):
    interface, channel, options = bus
    with wired(interface, channel, build, options) as wire:
        axis = rig(interface, channel, build, options)
        axis.go(200)
        wire.look = once(wire, lambda: wire.slave.inject(0x7300))
        with pytest.raises(SimulationError) as failure:
            axis.go(2000)
        words = r"servomotor: is in Fault, 603Fh: 7300h encoder; 1003h: 7300h encoder."
        assert str(failure.value) == (
            "servomotor: EMCY 7300h, encoder (1001h 21h generic, device profile; vendor's bytes 40 00 00 00 00, 2320h encoder). All drives "
            f"stop. {words}"
        )
        assert axis.session.outcome.termination().reason == str(failure.value)
        assert axis.session.outcome.unsafe == []
        assert wire.slave.state is State.FAULT


def test_a_fault_at_the_start(bus, build):
    interface, channel, options = bus
    with wired(interface, channel, build, options) as wire:
        wire.look = once(wire, lambda: wire.slave.inject(0x7300))
        assert until(lambda: wire.slave.state is State.FAULT)
        with pytest.raises(SimulationError, match=r"is in Fault, 603Fh: 7300h encoder; 1003h: 7300h .* hil reset"):
            rig(interface, channel, build, options).go(1)
        assert wire.slave.state is State.FAULT


def test_a_drive_that_takes_no_sdo(bus, build, monkeypatch):
    """Its fault is still told, by the EMCY that it sent."""
    interface, channel, options = bus
    with wired(interface, channel, build, options) as wire:
        axis = rig(interface, channel, build, options)
        assert until(lambda: wire.now > BOOTED)
        monkeypatch.setattr(wire.slave.sdo, "answer", lambda _: None)
        begin = axis.session.network

        def network():
            made = begin()
            wire.look = once(wire, lambda: wire.slave.inject(0x7300))
            return made

        monkeypatch.setattr(axis.session, "network", network)
        with pytest.raises(SimulationError) as failure:
            axis.go(1)
        assert str(failure.value) == (
            "servomotor: node 1 does not answer. Check its power, the wiring, the bit rate and its node-ID; twin hil scan lists "
            "the nodes that answer. It tells that it lives, but takes no SDO: switch it off and on. EMCY: servomotor 7300h encoder (1001h 21h generic, "
            "device profile; vendor's bytes 40 00 00 00 00, 2320h encoder)."
        )
        assert wire.slave.state in SAFE


def test_who_comes_second_refuses_and_the_first_goes_on(bus, build):
    """Two whole programs with the same hardware file on one bus."""
    interface, channel, options = bus
    with wired(interface, channel, build, options) as wire:
        first = rig(interface, channel, build, options)
        first.go(100)
        failures, stop = [], threading.Event()

        def go_on():
            try:
                while not stop.is_set():
                    first.go(50)
            except SimulationError as error:
                failures.append(str(error))

        thread = threading.Thread(target=go_on)
        thread.start()
        try:
            with pytest.raises(SimulationError, match="another master") as failure:
                rig(interface, channel, build, options).go(1)
        finally:
            time.sleep(0.2)
            stop.set()
            thread.join()
        assert "Stop it" in str(failure.value)
        assert failures == []
        assert wire.slave.state is State.ENABLED
        first.axis.close()
        assert first.session.outcome.notes == []
        assert wire.slave.state is State.DISABLED


def test_of_two_that_begin_together_one_at_most_goes_on(bus, build):
    """A program that hears the other, or finds its journal in use, before it has written anything refuses; else both stop."""
    interface, channel, options = bus
    with wired(interface, channel, build, options) as wire:
        assert until(lambda: wire.now > BOOTED)
        both, told = [rig(interface, channel, build, options) for _ in range(2)], {}

        def go(one):
            try:
                one.go(500)
            except SimulationError as error:
                told[one] = str(error)

        threads = [threading.Thread(target=go, args=(one,)) for one in both]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert told
        assert all("another master" in text or "holds the journal of this drive" in text for text in told.values()), (
            told
        )
        for one in both:
            one.axis.close()
        assert until(lambda: wire.slave.state in SAFE)


def once(wire, act):
    """To be called between frames: acts at the first call."""

    def look():
        wire.look = lambda: None
        act()

    return look
