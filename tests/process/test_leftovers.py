"""Temporary folders: where they are, which are removed, and whose process is alive."""

import importlib
import os
from pathlib import Path
from types import SimpleNamespace

module = importlib.import_module("twin.process.process_identity")
OWN = module.process_identity()
NONE = 2**22 + 1  # no process has such a number


def test_only_a_process_with_the_same_start_is_alive():
    number, _, start = OWN.partition("-")
    assert start == module.start_time(os.getpid()) != "0"
    identities = (OWN, f"{number}-{int(start) + 1}", f"{number}-", number, f"x{number}-{start}", f"-{start}", "")
    assert [module.alive(identity) for identity in identities] == [True] + 6 * [False]
    assert module.start_time(NONE) == ""
    assert [module.exists(pid) for pid in (os.getpid(), 1, NONE)] == [True, True, False]


def test_folders_of_temporary_files(monkeypatch, tmp_path):
    """The first that can be written to; in memory if there is room for programs, and for small files only."""
    for name in ("TMPDIR", "TEMP", "TMP"):
        monkeypatch.delenv(name, raising=False)
    assert module.temporary_folder() == Path("/tmp")
    monkeypatch.setattr(module, "MEMORY", tmp_path)
    room = module.ROOM
    for blocks, size, flags, expected in (
        (room // 4096, 4096, 0, tmp_path),
        (room // 4096 - 1, 4096, 0, None),
        (room // 4096, 4096, os.ST_NOEXEC, None),
        (room // 4096, 4096, os.ST_NOSUID, tmp_path),
    ):
        status = SimpleNamespace(f_flag=flags, f_bavail=blocks, f_frsize=size)
        monkeypatch.setattr(module.os, "statvfs", lambda _, status=status: status)
        assert module.memory_folder() == expected
    monkeypatch.setenv("TEMP", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "none"))
    assert (module.temporary_folder(), module.memory_folder()) == (tmp_path, None)
    monkeypatch.setattr(module.MemoryFolder, "folder", "quick")
    sizes = (module.SMALL, module.SMALL + 1)
    assert [module.temporary_folder_for(size) for size in sizes] == ["quick", None]
    monkeypatch.setattr(module.MemoryFolder, "folder", "")
    assert module.temporary_folder_for(0) is None


def test_leftovers_of_processes_that_ended_are_removed(tmp_path):
    """Not those of others, and nothing with another name."""
    names = {
        f"{module.PREFIX}{name}": kept
        for name, kept in ((OWN, True), (f"{NONE}-5", False), ("x-5", True), ("7", True), ("7-x", True))
    }
    for name in (*names, "other-1-5"):
        (tmp_path / name / "inner").mkdir(parents=True)
    module.sweep(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        [*(name for name, kept in names.items() if kept), "other-1-5"]
    )
    module.sweep(tmp_path / "none")
