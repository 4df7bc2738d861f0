"""What a page renews, as the process that commands a drive judges it: too old, of another press, or not there at all."""

import socket

import pytest

from hw_bridge.commission.deadman import HOLD
from hw_bridge.commission.page_watchdog import ATTENDED, PageWatchdog
from hw_bridge.commission.single_axis_session import SLOWEST_STOP
from twin.errors import SimulationError
from twin.live.channel import Channel

LONGEST = HOLD / 1e9
FOLLOWS = 0.02  # what a drive's loop takes to stand after its target does [s]: test_jog


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def watched(clock):
    """Who moves, and what the page says."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        one = PageWatchdog(theirs, clock)
        one.page = Channel(ours)
        yield one


def way(one):
    one.look()
    return one.deflection()


def test_it_goes_while_it_is_renewed_and_no_longer(watched, clock):
    assert way(watched) == 0.0
    for _ in range(5):
        watched.page.send(here=clock.now, hold=0.5, press=1)
        assert way(watched) == 0.5
        clock.now += 0.03
    clock.now += LONGEST - 0.031
    assert way(watched) == 0.5
    assert not watched.expired
    clock.now += 0.002
    assert way(watched) == 0.0
    assert watched.expired
    watched.page.send(here=clock.now, hold=1.0, press=1)  # the same press comes back: it has to be let go first
    assert way(watched) == 0.0
    watched.page.send(here=clock.now, hold=-1.0, press=2)
    assert way(watched) == -1.0
    assert not watched.expired
    watched.page.send(release_hold=True)
    assert way(watched) == 0.0
    assert not watched.expired  # it was let go


def test_with_ramp_and_loop_it_stands_within_200_ms_of_the_last_renewal():
    assert LONGEST + SLOWEST_STOP + FOLLOWS <= 0.2


def test_what_was_kept_back_on_its_way_is_old(watched, clock):
    watched.page.send(here=clock.now - LONGEST, hold=1.0, press=1)
    assert way(watched) == 0.0
    watched.page.send(here=clock.now - LONGEST / 2, hold=7.0, press=1)  # half of it is over, and more than all is all
    assert way(watched) == 1.0
    clock.now += LONGEST / 2 + 1e-6
    assert way(watched) == 0.0


def test_what_no_page_shows_does_not_go_on(watched, clock):
    watched.look()
    clock.now += ATTENDED - 0.01
    watched.look()
    watched.page.send(here=clock.now)
    clock.now += ATTENDED - 0.01
    watched.look()
    clock.now += 0.02
    with pytest.raises(SimulationError, match="the operator's page has not answered for 510 ms"):
        watched.look()


def test_a_server_that_is_gone_ends_it(watched):
    watched.page.end.close()
    with pytest.raises(SimulationError, match="server of the page has ended"):
        watched.look()


def test_an_orderly_end(watched):
    watched.page.send(end=True)
    watched.look()
    assert watched.over
