"""The store of generated files: entries appear whole, damaged ones are made again, `clear` removes nothing else."""

import os
import subprocess
import sys
import threading
import time

import pytest
from click.testing import CliRunner

from twin import store
from twin.cli.cache import command
from twin.store import LOCK, SUMS, Store, make_key

FILES = {"a.c": b"int a;\n", "a.h": b""}
KEY = make_key("a")


@pytest.fixture
def filled(tmp_path):
    filled = Store(tmp_path)
    filled.put("a", KEY, FILES)
    return filled


def test_an_entry_is_what_was_put(filled):
    assert filled.get("a", KEY) == FILES
    assert filled.get("a", make_key("b")) is None
    assert filled.get_or_create("a", KEY, dict) == FILES
    assert {path.name for path in filled.folder.iterdir()} == {LOCK, f"a-{KEY}"}


def test_keys_tell_sequences_apart():
    assert len({make_key("ab", "c"), make_key("a", "bc"), make_key("abc"), make_key("abc", "")}) == 4
    assert make_key("a") == make_key(b"a")


def cut(file):
    file.write_bytes(file.read_bytes()[:-4])


DAMAGE = {
    "a changed file": lambda entry: (entry / "a.c").write_bytes(b"int b;\n"),
    "a missing file": lambda entry: (entry / "a.h").unlink(),
    "an additional file": lambda entry: (entry / "b.c").touch(),
    "no sums": lambda entry: (entry / SUMS).unlink(),
    "empty sums": lambda entry: (entry / SUMS).write_bytes(b""),
    "cut sums": lambda entry: cut(entry / SUMS),
    "a line of sums missing": lambda entry: (entry / SUMS).write_text((entry / SUMS).read_text().split("\n")[0]),
    "sums of another folder": lambda entry: (entry / SUMS).write_text(
        (entry / SUMS).read_text().replace("a.h", "../a")
    ),
    "binary sums": lambda entry: (entry / SUMS).write_bytes(b"\xff"),
    "a folder in a file's place": lambda entry: ((entry / "a.h").unlink(), (entry / "a.h").mkdir()),
}


@pytest.mark.parametrize("what", DAMAGE)
def test_a_damaged_entry_is_made_again(what, filled):
    DAMAGE[what](filled.path("a", KEY))
    assert filled.get("a", KEY) is None
    assert filled.get_or_create("a", KEY, lambda: FILES) == FILES
    assert filled.get("a", KEY) == FILES


@pytest.mark.skipif(os.name != "posix", reason="modes of files")
@pytest.mark.parametrize("file", [*FILES, SUMS])
def test_what_others_may_write_does_not_count(file, filled):
    (filled.path("a", KEY) / file).chmod(0o666)
    assert filled.get("a", KEY) is None


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give files away")
@pytest.mark.parametrize("file", [*FILES, SUMS])
def test_what_another_user_owns_does_not_count(file, filled):
    os.chown(filled.path("a", KEY) / file, 12345, -1)
    assert filled.get("a", KEY) is None


@pytest.mark.skipif(os.name != "posix", reason="modes of files")
def test_nothing_is_writable_by_others_whatever_the_umask(tmp_path):
    before = os.umask(0)
    try:
        Store(tmp_path).put("a", KEY, FILES)
    finally:
        os.umask(before)
    assert Store(tmp_path).get("a", KEY) == FILES


def test_a_write_that_fails_leaves_nothing(tmp_path):
    with pytest.raises(OSError, match=rf"a-{KEY}"):
        Store(tmp_path).put("a", KEY, {"a.c": b"", "no/b.c": b""})
    assert [path.name for path in Store(tmp_path).folder.iterdir()] == [LOCK]
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match=rf"a-{KEY}"):
        Store(tmp_path / "file").put("a", KEY, FILES)


def test_the_least_recently_used_are_evicted(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "CAPACITY", 2500)
    filled, now = Store(tmp_path), time.time()
    for number, age in enumerate((7200, 9000, 8000, 10)):
        filled.put("a", make_key(str(number)), {"data": bytes(900)})
        os.utime(filled.path("a", make_key(str(number))), (now - age, now - age))
    Store._evicted.clear()
    filled.put("b", KEY, {"data": b""})
    assert [filled.path("a", make_key(str(number))).exists() for number in range(4)] == [True, False, False, True]
    monkeypatch.setattr(store, "CAPACITY", 0)
    Store._evicted.clear()
    filled.evict()
    assert [entry.name[0] for _, _, entry in filled.entries()] == ["a", "b"]  # used within the hour


def test_use_makes_an_entry_recent(filled):
    os.utime(filled.path("a", KEY), (1.0, 1.0))
    filled.get("a", KEY)
    assert filled.entries()[0][0] > time.time() - 60.0


def test_clear_removes_entries_and_nothing_else(filled, tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "mine").touch()
    for name in (f"link-{KEY}", "notes", "a-1234"):
        (filled.folder / name).symlink_to(outside) if name.startswith("link") else (filled.folder / name).mkdir()
    (filled.folder / f"file-{KEY}").touch()
    (filled.folder / f".a-{KEY}.1.2").mkdir()  # of a process that was killed
    left = {LOCK, f"link-{KEY}", "notes", "a-1234", f"file-{KEY}"}
    result = CliRunner().invoke(command, ["size", "--build", str(tmp_path)])
    assert result.output == "2 entries, 0.0 MB of at most 500 MB\n"
    result = CliRunner().invoke(command, ["clear", "--build", str(tmp_path)])
    assert (result.exit_code, result.output) == (0, "2 entries removed, 0.0 MB\n")
    assert {path.name for path in filled.folder.iterdir()} == left
    assert (outside / "mine").exists()
    result = CliRunner().invoke(command, ["path", "--build", str(tmp_path)])
    assert result.output == f"{filled.folder}\n"


def test_an_empty_folder_has_a_size_and_can_be_cleared(tmp_path):
    for word, text in {"size": "0 entries, 0.0 MB of at most 500 MB\n", "clear": "0 entries removed, 0.0 MB\n"}.items():
        result = CliRunner().invoke(command, [word, "--build", str(tmp_path / "none")])
        assert (result.exit_code, result.output) == (0, text)


@pytest.mark.slow
def test_clear_waits_while_an_entry_is_used_by_its_path(filled, tmp_path):
    pytest.importorskip("fcntl")
    script = "import sys; from pathlib import Path; from twin.store import Store; Store(Path(sys.argv[1])).clear()"
    with filled.shared():
        process = subprocess.Popen([sys.executable, "-c", script, str(tmp_path)])
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=2.0)
        assert filled.get("a", KEY) == FILES
    assert process.wait(timeout=60.0) == 0
    assert filled.get("a", KEY) is None


def test_many_threads_make_one_entry_once(tmp_path):
    found, made = [], []

    def create():
        made.append(KEY)
        time.sleep(0.02)
        return FILES

    work = [
        threading.Thread(target=lambda: found.append(Store(tmp_path).get_or_create("a", KEY, create)))
        for _ in range(16)
    ]
    for thread in work:
        thread.start()
    for thread in work:
        thread.join()
    assert (found, made) == ([FILES] * 16, [KEY])
    assert {path.name for path in Store(tmp_path).folder.iterdir()} == {LOCK, f"a-{KEY}"}
