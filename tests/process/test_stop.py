"""Signals: the first one interrupts where that is allowed, no other changes how that ends, and none is lost."""

import os
import signal
import threading
import time
import weakref

import pytest

from twin.process import Stop, is_interrupted
from twin.process.stop import SIGNALS, once


@pytest.fixture(autouse=True)
def handlers_stay():
    before = {one: signal.getsignal(one) for one in SIGNALS}
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    yield
    for one, handler in before.items():
        signal.signal(one, handler)


class Target:
    """Can be referred to weakly."""


def ignored(number):
    """Have a signal come where Python ignores what its handler raises: in the callback of a weak reference."""
    target = Target()
    reference = weakref.ref(target, lambda _: signal.raise_signal(number))
    del target
    assert reference() is None


@pytest.mark.parametrize("number", SIGNALS)
def test_only_the_first_signal_interrupts(number):
    done = []
    with Stop() as stop:
        signal.signal(number, stop._on_signal)
        stop._before[number] = signal.SIG_IGN
        try:
            with stop.armed():
                signal.raise_signal(number)
        except KeyboardInterrupt:
            signal.raise_signal(number)
            done.append("written")
        signal.raise_signal(number)
    assert (done, stop.number) == (["written"], number)


def test_a_signal_that_came_before_interrupts_what_may_be_interrupted():
    with Stop() as stop:
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt), stop.armed():
            pytest.fail("it began")


def test_an_interrupt_that_python_ignores_is_not_printed_and_comes_again(capsys):
    with Stop() as stop, pytest.raises(KeyboardInterrupt), stop.armed():
        ignored(signal.SIGINT)
        threading.Event().wait(20.0)
    assert capsys.readouterr().err == ""
    signal.signal(signal.SIGINT, once)
    with pytest.raises(KeyboardInterrupt):
        ignored(signal.SIGINT)
        threading.Event().wait(20.0)
    assert is_interrupted()
    assert capsys.readouterr().err == ""


def test_further_signals_of_the_same_instant_are_not_printed(capsys):
    for number in SIGNALS:
        signal.signal(number, once)
    with pytest.raises(KeyboardInterrupt):
        try:
            signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
            for number in SIGNALS:
                os.kill(os.getpid(), number)
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
            time.sleep(0.05)
    assert capsys.readouterr().err == ""


def test_an_interrupt_that_comes_while_python_still_reports_the_first_is_not_lost(monkeypatch, capsys):
    start = threading.Thread.start

    def slow(thread):
        start(thread)
        time.sleep(0.05)

    monkeypatch.setattr(threading.Thread, "start", slow)
    with Stop() as stop, pytest.raises(KeyboardInterrupt), stop.armed():
        ignored(signal.SIGINT)
        threading.Event().wait(20.0)
    assert capsys.readouterr().err == ""


def test_an_ignored_interrupt_does_not_come_again_where_nothing_may_be_interrupted():
    with Stop() as stop:
        with pytest.raises(KeyboardInterrupt), stop.armed():
            ignored(signal.SIGINT)
            stop.check()
        time.sleep(0.05)
        assert stop.number == signal.SIGINT


def test_each_signal_is_notified_at_once():
    seen = []
    with Stop(lambda: seen.append("outer")), Stop() as inner:
        signal.raise_signal(signal.SIGINT)
        assert seen == ["outer"]
        signal.raise_signal(signal.SIGINT)
        assert inner.number
    assert seen == ["outer"] * 2


def test_a_surrounding_stop_learns_of_the_signal():
    with Stop() as stop:
        with Stop() as inner, pytest.raises(KeyboardInterrupt), inner.armed():
            signal.raise_signal(signal.SIGINT)
        assert stop.number == signal.SIGINT
        with pytest.raises(KeyboardInterrupt), stop.armed():
            pytest.fail("it began")


def test_a_command_that_was_interrupted_is_not_interrupted_again():
    signal.signal(signal.SIGINT, once)
    with Stop() as stop:
        signal.raise_signal(signal.SIGINT)
    assert stop.number
    for one in SIGNALS:
        if one in stop._before:
            assert signal.getsignal(one) is signal.SIG_IGN
    signal.raise_signal(signal.SIGINT)
