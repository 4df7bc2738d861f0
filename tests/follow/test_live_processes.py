"""A rig in a process of its own, followed over UDP by another one; sources that die, and a follower that is killed."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import twin
from twin.face import open_run

ROOT = Path(__file__).parents[2]
RIG = """
title: A gripper moves an instrument in its sheath
stop_time: 12 s
members:
  chirp:   {component: chirp, parameters: {total_time: 12 s, frequency_final: 1 Hz}}
  sheath:  {component: sheath}
  tracker: {component: em_tracker}
connections:
  - chirp.position -> sheath.gripper_position, tracker.reference
  - sheath.tip_position -> tracker.position
events:
  - {at: 5 s, set: {sheath.play: [0 mm, 0.3 mm, 0.8 mm]}}
record: {every: 25 ms, variables: [chirp.position, tracker.measured_position]}
"""
SHEATH = """
component: sheath
step: 5 ms
inputs: {chirp.position: sheath.gripper_position}
outputs: {tracker.measured_position: {signal: sheath.tip_position, noise: 0.2 mm, delay: 25 ms}}
estimate:
  sheath.play[3]: {start: 0.2 mm, deviation: 0.2 mm, walk: 0.05 mm, from: 0 mm, to: 2 mm}
"""
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
            env={**os.environ, "PYTHONPATH": str(ROOT)},
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


@pytest.mark.slow
@pytest.mark.real_time
def test_a_twin_follows_another_one_over_udp(tmp_path, build, start, port):
    (tmp_path / "rig.yaml").write_text(RIG)
    (tmp_path / "sheath.yaml").write_text(SHEATH)
    address = f"udp://127.0.0.1:{port}"
    rig = start("run", "rig.yaml", "--no-report", "--publish", address, "--build", str(build))
    follower = start("follow", "sheath.yaml", "--rig", address, "--build", str(build))
    rig.communicate(timeout=WAIT)
    time.sleep(0.5)
    follower.send_signal(signal.SIGINT)
    out, errors = follower.communicate(timeout=WAIT)
    assert follower.returncode == 0, errors
    run = open_run(tmp_path / "runs" / "sheath" / "latest")
    play = run["estimate.sheath.play_3"].squeeze()
    assert float(play[-1]) == pytest.approx(0.8e-3, abs=0.2e-3)
    assert "sheath.play[3]" in out
    summary = run.summary["follow"]
    assert summary["measurements"] > 200
    assert summary["nis_in_band"] > 0.85
    assert summary["rig"]["messages"]["rig"] > 200


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
        assert lines[0] == "bench: a datagram is no JSON (Expecting value): left out."
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
