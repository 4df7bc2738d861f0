"""Whose a folder or a lock is, and whether its owner is alive; limits of memory."""

import os
import subprocess
import sys

import pytest

from twin.process.process_identity import alive, exists, memory_is_limited, process_identity, remove


def dead() -> int:
    """The number of a process that was."""
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        pass
    return process.pid


def test_whether_a_process_is_there(monkeypatch):
    """Where /proc is missing: also a process that belongs to another user is there."""
    assert exists(os.getpid())
    assert not exists(dead())

    def forbidden(_pid, _signal):
        raise PermissionError

    monkeypatch.setattr(os, "kill", forbidden)
    assert exists(1)


def test_an_owner_lives_as_long_as_its_process():
    own = process_identity()
    pid, _, start = own.partition("-")
    assert (int(pid), alive(own)) == (os.getpid(), True)
    assert not alive(f"{pid}-{int(start) + 1}")  # another process of that number, before or after
    assert not alive(f"{dead()}-{start}")
    assert not alive("neither-1")
    assert not alive(f"{pid}-")


def test_a_folder_is_removed_with_all_in_it(tmp_path):
    for name in ("empty", "full"):
        (tmp_path / name).mkdir()
    (tmp_path / "full" / "file").write_text("")
    for name in ("empty", "full", "absent"):
        remove(tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("limit", [-1, 1 << 30])
def test_whether_memory_is_limited(limit, monkeypatch):
    resource = pytest.importorskip("resource")
    monkeypatch.setattr(resource, "getrlimit", lambda what: (limit, -1) if what == resource.RLIMIT_AS else (-1, -1))
    assert memory_is_limited() == (limit != resource.RLIM_INFINITY)
