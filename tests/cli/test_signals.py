"""Commands that a signal ends, several times and for all of their processes: in order, with one sentence, and nothing stays."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.study.patients import STUDY, study_file
from tests.study.recordings import FILE, identify_file, recorded
from twin.run import RunOptions, run_scenario
from twin.scenario import parse_scenario

ROOT = Path(__file__).parents[2]
TIMEOUT = 60.0  # for what takes an idle machine seconds [s]
BUILD = ("--build", str(ROOT / "build"))
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes in /proc"),
]


def has_case(folder, _):
    return any(one.stat().st_size for one in folder.glob("runs/*/*/cases.jsonl"))


def has_said(text):
    return lambda _, said: text in said


# words of a command, when the signal comes, exit code, and what it says at its end
COMMANDS = {
    "study": (
        ("patients.yaml", "--workers", "2", *BUILD),
        has_case,
        130,
        r"interrupted: \d+ finished cases? (is|are) kept\. Continue: ",
    ),
    "identify": (
        ("identify.yaml", "--starts", "50", "-o", "set.yaml", *BUILD),
        has_said("start 1 of"),
        130,
        "set.yaml",
    ),
    "view": (("seen", "--no-open"), has_said("?token="), 0, "The viewer is closed"),
    "console": (
        (str(ROOT / "tests/live/carriage.yaml"), "--no-open", *BUILD),
        has_said("?token="),
        0,
        "The console is closed",
    ),
    "drive": (("-p", "mclm", "-i", "virtual", "-c", "x", *BUILD), has_said("Ctrl-C ends it"), 0, "stopped after"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory, build):
    place = tmp_path_factory.mktemp("commands")
    study_file(place, STUDY.replace("count: 6", "count: 30000"))
    recorded(place, build, "sheath.play=[0 mm, 0.7 mm, 0.3 mm]")
    identify_file(place, FILE)
    scenario = parse_scenario("{stop_time: 10 ms, members: {wall: {component: wall}}}", place / "s.yaml")
    run_scenario(scenario, RunOptions(root=place / "runs", build=build, report=False)).folder.rename(place / "seen")
    return place


def session(pid):
    """Processes of a session that are alive."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == pid and fields[0] != "Z":
            found.append(stat.parent.name)
    return found


@pytest.mark.parametrize(
    ("name", "number"),
    [
        *((name, signal.SIGHUP) for name in COMMANDS),
        ("study", signal.SIGQUIT),
        ("drive", signal.SIGQUIT),
        ("study", signal.SIGINT),
    ],
)
def test_a_signal_ends_it_in_order(name, number, folder, tmp_path):
    words, is_ready, code, told = COMMANDS[name]
    start = (
        "import signal; [signal.signal(one, signal.SIG_DFL) for one in (1, 3, 15)]; from twin.cli import main; main()"
    )
    line = [
        sys.executable,
        "-c",
        start,
        name,
        *words,
        *(["--runs", str(tmp_path / "runs")] if name in ("study", "console") else []),
    ]
    if name == "identify":
        line.append("--force")
    output = tmp_path / "output.txt"
    with output.open("w") as file:
        process = subprocess.Popen(
            line,
            cwd=folder,
            stdout=file,
            stderr=file,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )
    end = time.monotonic() + TIMEOUT
    try:
        while not is_ready(tmp_path, output.read_text()):
            assert process.poll() is None, output.read_text()
            assert time.monotonic() < end, output.read_text()
            time.sleep(0.01)
        for _ in range(3):
            os.killpg(process.pid, number)
            time.sleep(0.01)
        assert process.wait(TIMEOUT) == code, output.read_text()
        while session(process.pid) and time.monotonic() < end:
            time.sleep(0.01)
        assert session(process.pid) == []
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    said = output.read_text()
    assert re.search(told, said), said
    assert "Traceback" not in said
    assert "Exception ignored" not in said
