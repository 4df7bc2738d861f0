"""What is done beside something else is done, in order, and what fails there is told."""

import sys
import threading

import pytest

from twin import late


def test_both_are_done_to_their_ends_and_the_result_is_that_of_here():
    met = threading.Barrier(2, timeout=10.0)  # breaks if one waits for the other's end
    done = []

    def task():
        met.wait()
        done.append(threading.current_thread())

    assert late.meanwhile(task, lambda: met.wait() >= 0)
    assert done
    assert done[0] is not threading.main_thread()


@pytest.mark.parametrize("here", [lambda: 3, lambda: 1 / 0])
def test_what_fails_beside_is_raised_whatever_happens_here(here):
    with pytest.raises(OSError, match="full"):
        late.meanwhile(lambda: (_ for _ in ()).throw(OSError("the disk is full")), here)


def test_what_fails_here_is_raised_once_the_task_is_done():
    done = []
    with pytest.raises(ZeroDivisionError):
        late.meanwhile(lambda: done.append(1), lambda: 1 / 0)
    assert done == [1]


def test_without_a_thread_the_task_is_done_all_the_same(monkeypatch):
    def refused(self):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refused)
    done = []
    assert late.meanwhile(lambda: done.append(1), lambda: list(done)) == []
    assert done == [1]


def test_modules_are_imported_ahead_once_and_what_is_to_follow_follows(tmp_path, monkeypatch):
    (tmp_path / "ahead_of_all.py").write_text("", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    found = []

    def then():
        found.append("ahead_of_all" in sys.modules)

    with late.ahead("ahead_of_all", "not_there_at_all", then=then) as begin:
        assert "ahead_of_all" not in sys.modules
        begin()
    assert found == [True]
    with late.ahead("ahead_of_all", then=then) as begin:
        begin()
    assert found == [True], "nothing is waited for twice"
    with late.ahead("not_there_at_all", then=then):
        pass
    assert found == [True], "nobody has begun it"


def test_what_is_over_before_it_is_due_is_not_waited_for(monkeypatch):
    waited = []
    wait = threading.Event.wait

    def noted(self, timeout=None):
        waited.append((timeout, wait(self, 60.0 if timeout == 3600.0 else timeout)))
        return waited[-1][1]

    monkeypatch.setattr(threading.Event, "wait", noted)
    with late.ahead("not_there_at_all", after=3600.0) as begin:
        begin()
    assert (3600.0, True) in waited, "it ended by the end of what was done here"
