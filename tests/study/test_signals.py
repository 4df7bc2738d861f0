"""Signals at a study: whenever they come, and however many, they end in one line, and what is done is kept."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

MAIN = [sys.executable, "-c", "from twin.cli import main; main()"]
SCENARIO = """
stop_time: 2 s
members: {heart: {component: heart}, sheath: {component: sheath}}
connections: [heart.position -> sheath.gripper_position]
metrics: {reach: {signal: sheath.tip_position, reduce: max, unit: mm}}
"""
STUDY = """
scenario: one.yaml
metrics: [reach]
samples: {method: random, count: 3000, seeds: [1]}
vary: {heart.rate: {values: [0.9 Hz, 1 Hz, 1.1 Hz], source: assumed}}
"""
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")


@pytest.fixture
def study(tmp_path, build):
    """Start a study in a folder of its own; `until` something holds there."""
    (tmp_path / "one.yaml").write_text(SCENARIO)
    (tmp_path / "many.yaml").write_text(STUDY)
    started = []

    def start(until, *words, own_build=False):
        line = [*MAIN, "study", "many.yaml", "--workers", "2", *words]
        line += ["--build", str(tmp_path / "build" if own_build else build)]
        process = subprocess.Popen(line, cwd=tmp_path, stdout=-1, stderr=-1, text=True, start_new_session=True)
        started.append(process)
        end = time.monotonic() + 60
        while not until() and process.poll() is None and time.monotonic() < end:
            time.sleep(0.005)
        return process

    start.folder = tmp_path
    yield start
    for process in started:
        process.kill()
        process.communicate()


def rows(folder):
    return sum(len(path.read_bytes().splitlines()) for path in folder.glob("runs/many/*/cases.jsonl"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_before_the_first_case_is_one_line(study, number):
    process = study(lambda: list(study.folder.glob("runs/many/*/manifest.json")), own_build=True)
    process.send_signal(number)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130, told
    assert told.strip().splitlines()[-1].endswith(": interrupted before the first case. Go on with --resume.")
    assert "Traceback" not in told
    (manifest,) = study.folder.glob("runs/many/*/manifest.json")
    assert json.loads(manifest.read_text())["status"] == "interrupted"


@pytest.mark.slow
@pytest.mark.parametrize("numbers", [[signal.SIGHUP], [signal.SIGINT] * 3, [signal.SIGTERM, signal.SIGHUP]])
def test_signals_in_a_row_keep_what_is_done(study, numbers):
    """Sent to the whole process group, as a terminal does."""
    process = study(lambda: rows(study.folder) > 5)
    for number in numbers:
        os.killpg(process.pid, number)
        time.sleep(0.02)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130, told
    assert "Traceback" not in told
    count = rows(study.folder)
    assert f"interrupted: {count} cases are kept. Go on with --resume." in told
    again = study(lambda: rows(study.folder) > count + 5, "--resume", "--no-report")
    again.send_signal(signal.SIGINT)
    again.communicate(timeout=60)
    assert rows(study.folder) > count + 5
