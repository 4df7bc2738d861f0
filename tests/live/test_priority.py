"""Who goes first: a loop that mostly waits, and no other."""

import os

import pytest

from twin.live import scheduling_priority
from twin.live.scheduling_priority import MAX_SHARE, LoopPriority


@pytest.fixture
def given(monkeypatch):
    """What the system was asked for."""
    asked = []
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda _pid, policy, param: asked.append((policy, param.sched_priority))
    )
    return asked


def test_a_loop_that_waits_goes_first_until_it_only_works(given):
    one = LoopPriority()
    for _ in range(3):
        one.update(0.01, 1 / 30)
    assert given == []  # not before it is known for some blocks
    for _ in range(30):
        one.update(0.01, 1 / 30)
    assert given == [(os.SCHED_FIFO, scheduling_priority.PRIORITY)]
    assert one.is_raised
    blocks = 0
    while one.is_raised:
        one.update(1 / 30, 1 / 30)
        blocks += 1
    assert blocks <= 6  # a fifth of a second
    assert given[-1] == (os.SCHED_OTHER, 0)


def test_as_fast_as_possible_never_goes_first(given):
    one = LoopPriority()
    for _ in range(100):
        one.update(1e-6, 0.0)  # at an infinite rate a block stands for no time
    assert (given, one.share > MAX_SHARE) == ([], True)


def test_what_comes_after_does_not_inherit_it(given):
    one = LoopPriority()
    for _ in range(30):
        one.update(0.0, 1.0)
    one.end()
    assert given == [(os.SCHED_FIFO, scheduling_priority.PRIORITY), (os.SCHED_OTHER, 0)]
    one.update(0.0, 1.0)
    assert not one.is_raised


def test_where_it_is_not_allowed_all_stays_as_it_was(monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    one = LoopPriority()
    for _ in range(30):
        one.update(0.0, 1.0)
    assert (one.is_raised, one.allowed) == (False, False)


def test_not_on_a_single_core(given, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    assert not LoopPriority().allowed
