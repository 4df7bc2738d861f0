"""A rig in a process of its own, followed over UDP by another one; sources that die, and a follower that is killed."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest

import twin
from tests.hw_bridge.multicast import PORT, needed, own
from twin.face import open_run

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "follow.md").read_text()
WAIT = 60.0  # for what a busy machine delays [s]


@pytest.fixture
def start(tmp_path):
    """Start `twin` or a script in the test's folder; what still runs at the end is killed."""
    processes = []

    def started(*words):
        words = ["-P", "-c", "from twin.cli import main; main()", *words] if words[0] != "-c" else words
        process = subprocess.Popen(
            [sys.executable, *words],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        processes.append(process)
        return process

    yield started
    for process in processes:
        process.kill()
        process.communicate()


@pytest.fixture
def port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def until(condition):
    end = time.monotonic() + WAIT
    while not (result := condition()):
        assert time.monotonic() < end
        time.sleep(0.05)
    return result


def saved(folder):
    """Files of the page about following, and the lines of its commands for terminals."""
    for name, text in re.findall(r"Save this as `([^`]+)`:\n\n```\w+\n(.*?)```", PAGE, re.DOTALL):
        (folder / name).write_text(text)
    blocks = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
    return [line for block in blocks for line in block.splitlines() if line.startswith("twin ")]


def words(line, **changes):
    """Arguments of a command of the page, with other texts."""
    for old, new in changes.items():
        line = line.replace(old.strip("_"), new)
    return line.removeprefix("twin ").split()


@pytest.mark.slow
@pytest.mark.real_time
def test_a_twin_follows_another_one_over_udp(tmp_path, build, start, port):
    publish, follow = [words(line, _4710=str(port)) for line in saved(tmp_path) if "udp://" in line]
    follower = start(*follow, "--build", str(build))
    rig = start(*publish, "--build", str(build))
    out, errors = follower.communicate(timeout=WAIT)
    assert follower.returncode == 0, errors
    rig.send_signal(signal.SIGINT)
    run = open_run(tmp_path / "runs" / "sheath" / "latest")
    play = run["estimate.sheath.play_3"].squeeze()
    assert float(play.sel(time=7.0, method="nearest")) == pytest.approx(0.3e-3, abs=0.2e-3)
    assert float(play[-1]) == pytest.approx(0.8e-3, abs=0.2e-3)
    assert "sheath.play[3]" in out
    summary = run.summary["follow"]
    assert summary["measurements"] > 500
    assert summary["nis_in_band"] > 0.85
    assert summary["rig"]["values"] == {}


@pytest.mark.slow
@pytest.mark.real_time
def test_the_friction_of_a_drive_is_followed_on_its_bus(tmp_path, build, start):
    group = needed(own(76), port=PORT)
    drive, follow, master, fault = [
        words(line, _43199=str(PORT), _4703=str(PORT + 12_000), **{"239.74.163.2": group})
        for line in saved(tmp_path)
        if "udp://" not in line
    ]
    bench = tmp_path / "bench.yaml"
    bench.write_text(bench.read_text().replace("239.74.163.2", group).replace("43199", str(PORT)))
    start(*drive, "--build", str(build))
    follower = start(*follow, "--build", str(build))
    time.sleep(3.0)
    start(*master, "--build", str(build))
    rows = until(lambda: list(tmp_path.glob("runs/friction/*/.recording/0.rows")))[0]
    until(lambda: rows.stat().st_size > 80_000)
    assert start(*fault).wait(WAIT) == 0
    _, errors = follower.communicate(timeout=WAIT)
    assert (follower.returncode, errors) == (0, "")
    run = open_run(tmp_path / "runs" / "friction" / "latest")
    friction = run["estimate.servomotor.friction_coulomb"].squeeze()
    before = float(friction.sel(time=6.0, method="nearest"))
    assert before == pytest.approx(1.5, abs=0.5)
    assert float(friction[-1]) / before == pytest.approx(2.0, abs=0.3)


SENDER = """
import json, math, random, socket, sys, time
sender, chance, begin = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), random.Random(1), time.monotonic()
for k in range(100000):
    t = k / 50
    values = {"time": t, "position": 1e3 * math.cos(t) + chance.gauss(0, 20), "extra": {"flag": True}}
    sender.sendto(json.dumps(values).encode(), ("127.0.0.1", int(sys.argv[1])))
    if k % 50 == 25:
        sender.sendto(b"garbage", ("127.0.0.1", int(sys.argv[1])))
    time.sleep(max(begin + (k + 1) / 50 - time.monotonic(), 0))
"""
OSCILLATOR = """
component: "tests.follow.parts:VanDerPol"
step: 10 ms
rig: {sources: {bench: {udp: PORT, lost_after: 500 ms}}, on_loss: REACTION}
outputs: {"position [mm]": {signal: VanDerPol.y, noise: 20 mm}}
estimate:
  VanDerPol.x: {start: 0.8 m, deviation: 0.3 m, walk: 1 mm}
  VanDerPol.v: {start: 0, deviation: 0.3, walk: 0.001}
  VanDerPol.mu: {start: 0, deviation: 0.1, walk: 0.01, from: 0, to: 5}
"""


def rows(folder):
    files = list(folder.glob("runs/oscillator/*/.recording/0.rows"))
    return files[0].stat().st_size if files else 0


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.parametrize("reaction", ["continue", "stop"])
def test_a_source_that_dies_and_comes_back(tmp_path, build, start, port, reaction):
    text = OSCILLATOR.replace("PORT", str(port)).replace("REACTION", reaction)
    (tmp_path / "oscillator.yaml").write_text(text)
    follower = start("follow", "oscillator.yaml", "--build", str(build))
    bench = start("-c", SENDER, str(port))
    until(lambda: rows(tmp_path) > 10_000)
    bench.kill()
    if reaction == "stop":
        _, errors = follower.communicate(timeout=WAIT)
        assert follower.returncode == 1
        assert errors.splitlines()[-1] == "failed: bench: no message for 0.5 s."
    else:
        time.sleep(3.0)
        again = start("-c", SENDER, str(port))
        before = rows(tmp_path)
        until(lambda: rows(tmp_path) > before + 10_000)
        again.kill()
        follower.send_signal(signal.SIGINT)
        _, errors = follower.communicate(timeout=WAIT)
        assert follower.returncode == 0, errors
        lines = errors.splitlines()
        assert lines[0] == "bench: a message is no JSON (Expecting value): left out."
        assert lines[1] == "bench: no message for 0.5 s. Its last inputs are held."
        assert re.fullmatch(r"bench: is back after \d\.\d s\.|bench is back after \d+\.\d s\.", lines[2])
        assert re.fullmatch(
            r"bench: its clock has jumped by -\d+\.\d+ s\. The model goes on with a new offset\.", lines[3]
        )
    run = open_run(tmp_path / "runs" / "oscillator" / "latest")
    time_of = run["nis.value"].time.values
    assert (np.diff(time_of) > 0).all()
    assert run.status == ("failed" if reaction == "stop" else "completed")


@pytest.mark.slow
@pytest.mark.real_time
def test_what_was_estimated_before_a_kill_is_recovered(tmp_path, build, start, port, command_line):
    text = OSCILLATOR.replace("PORT", str(port)).replace("REACTION", "continue")
    (tmp_path / "oscillator.yaml").write_text(text)
    follower = start("follow", "oscillator.yaml", "--build", str(build))
    start("-c", SENDER, str(port))
    until(lambda: rows(tmp_path) > 10_000)
    follower.kill()
    follower.wait(WAIT)
    size = rows(tmp_path)
    (folder,) = [path for path in tmp_path.glob("runs/oscillator/*") if not path.is_symlink()]
    done = command_line.run(["recover", str(folder)], tmp_path)
    assert done.returncode == 0, done.stderr
    run = open_run(folder)
    assert run.status == "interrupted"
    assert run["estimate.VanDerPol.mu"].size == size // (8 * (1 + len(run.signals)))


@pytest.mark.slow
@pytest.mark.real_time
def test_python_iterates_over_a_rig(tmp_path, build, start, port, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = OSCILLATOR.replace("PORT", str(port)).replace("REACTION", "continue")
    (tmp_path / "oscillator.yaml").write_text(text)
    start("-c", SENDER, str(port))
    following = twin.follow("oscillator.yaml", build=build)
    for estimate in following:
        if estimate.time > 1.0:
            break
    dataset = following.to_xarray()
    assert dataset["estimate.VanDerPol.x"].attrs["units"] == "m"
    assert float(dataset["estimate.VanDerPol.x"][-1]) == pytest.approx(estimate.values[0])
    assert dict(dataset.sizes) == {"time": len(following.estimates)}


@pytest.mark.slow
@pytest.mark.real_time
def test_the_page_of_a_rig_stays_until_it_is_ended(tmp_path, build, start, port):
    pytest.importorskip("nicegui")
    saved(tmp_path)
    rig = (tmp_path / "rig.yaml").read_text()
    (tmp_path / "rig.yaml").write_text(rig.replace("stop_time: 20 s", "stop_time: 120 s"))
    source = f"udp://127.0.0.1:{port}"
    start("run", "rig.yaml", "--no-report", "--publish", source, "--build", str(build))
    options = ["--rig", source, "--duration", "3s", "--console", "--no-open", "--build", str(build)]
    follower = start("follow", "sheath.yaml", *options)
    lines = []
    for line in iter(follower.stderr.readline, ""):
        lines.append(line.strip())
        if line.startswith("http"):
            break
    address = lines[-1] if lines else ""
    assert address.startswith("http"), lines
    with urllib.request.urlopen(address, timeout=WAIT) as answer:
        assert "measured.sheath.tip_position" in answer.read().decode()
    shown = []
    for line in iter(follower.stdout.readline, ""):
        shown.append(line)
        if "Look: twin view" in line:  # the last one
            break
    assert "sheath.play[3]" in "".join(shown)
    with urllib.request.urlopen(address, timeout=WAIT) as answer:  # also when its time is over
        assert answer.status == 200
    follower.send_signal(signal.SIGINT)
    follower.communicate(timeout=WAIT)
    assert follower.returncode == 0
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(address, timeout=WAIT)
