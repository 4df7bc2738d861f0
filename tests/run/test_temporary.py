"""Where a run's temporary files lie, and that nothing of them stays."""

import importlib
import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from twin.process import temporary_folder_for

owners = importlib.import_module("twin.process.process_identity")  # the package has a function of that name
ROOT = Path(__file__).parents[2]
FREE = {"f_flag": 0, "f_bavail": 1 << 20, "f_frsize": 4096}


@pytest.mark.parametrize(
    ("told", "named", "is_used"),
    [
        ({}, "", True),
        ({"f_flag": getattr(os, "ST_NOEXEC", 8)}, "", False),  # as in many containers: no library could be loaded
        ({"f_bavail": 1 << 14}, "", False),  # 64 MiB, as in most
        ({}, "/elsewhere", False),
    ],
)
def test_memory_is_used_where_it_can_be(told, named, is_used, tmp_path, monkeypatch):
    for name in ("TMPDIR", "TEMP", "TMP"):
        monkeypatch.setenv(name, named if name == "TMPDIR" else "")
    monkeypatch.setattr(owners, "MEMORY", tmp_path)
    monkeypatch.setattr(os, "statvfs", lambda _: SimpleNamespace(**{**FREE, **told}))
    assert owners.memory_folder() == (tmp_path if is_used else None)


def test_only_what_is_small_lies_in_memory(monkeypatch):
    assert temporary_folder_for(1) is None  # nobody would remove it
    monkeypatch.setattr(owners.MemoryFolder, "folder", "/memory/of/a/run")
    assert (temporary_folder_for(1), temporary_folder_for(owners.SMALL + 1)) == ("/memory/of/a/run", None)


@pytest.mark.slow
@pytest.mark.parametrize("stop", ["20 ms", "1e5 s"])
def test_nothing_stays(stop, tmp_path, build):
    """Of a run without a place of its own for temporary files, complete or killed with the process that watches it."""
    (tmp_path / "s.yaml").write_text(f"{{stop_time: {stop}, members: {{wall: {{component: wall}}}}}}")
    command = [sys.executable, "-c", "from twin.cli import main; main()", "run", "s.yaml", "--build", str(build)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": ""}
    places = [place for place in (owners.MEMORY, Path("/tmp")) if place.is_dir()]

    def left(pid):
        return [one for place in places for one in place.glob(f"{owners.PREFIX}{pid}-*")]

    with subprocess.Popen(
        [*command, "--no-report"], cwd=tmp_path, env=environment, stdout=-1, stderr=-1, text=True
    ) as task:
        assert next(line for line in iter(task.stderr.readline, "") if line.startswith("running "))
        if stop == "20 ms":
            task.communicate(timeout=60)
            assert (task.returncode, left(task.pid)) == (0, [])
            return
        child = int(Path(f"/proc/{task.pid}/task/{task.pid}/children").read_text())
        task.kill()
        os.kill(child, 9)
        task.communicate(timeout=60)
    end = time.monotonic() + 20
    while left(task.pid):
        assert time.monotonic() < end
        time.sleep(0.01)


def test_what_killed_processes_left_is_swept(tmp_path):
    """Where even the process that removes it was killed, as by the end of a container."""
    dead = subprocess.Popen(["true"])
    dead.wait()
    named = [
        f"{dead.pid}-1",
        f"{dead.pid}-1-fmu-abc",
        owners.process_identity(),
        f"{owners.process_identity()}-fmu-abc",
        "else",
        f"{dead.pid}",
    ]
    for name in named:
        (tmp_path / f"{owners.PREFIX}{name}" / "folder").mkdir(parents=True)
    owners.sweep(tmp_path)
    assert {one.name for one in tmp_path.iterdir()} == {f"{owners.PREFIX}{name}" for name in named[2:]}
