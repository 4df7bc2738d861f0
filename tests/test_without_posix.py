"""What runs where a Python lacks what Windows' lacks: the same figures, and one line about what is not there.

The libraries for Windows are run by wine, in tests/fmi/test_platforms.py. Here the Python is that of this machine, without
the modules and functions that POSIX brings, as far as the standard library goes on without them.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.study.patients import SCENARIO, study_file

ROOT = Path(__file__).parent.parent
LACKING = """
import asyncio, ctypes.util, multiprocessing, os, platform, select, shutil, signal, socket, subprocess, sys, tempfile, uuid
LACKED = {
    os: "fork forkpty killpg setsid getuid geteuid getgid sysconf sched_getaffinity sched_setaffinity sched_setscheduler "
        "sched_param mkfifo getpgid chown openpty getloadavg posix_spawn",
    signal: "SIGUSR1 SIGUSR2 SIGHUP SIGCHLD SIGALRM SIGSTOP SIGCONT SIGQUIT setitimer pthread_kill pthread_sigmask",
    select: "poll epoll",
}
for module, names in LACKED.items():
    for name in names.split():
        if hasattr(module, name):
            delattr(module, name)
for name in ("fcntl", "resource", "termios", "tty", "pty", "pwd", "grp", "syslog"):
    sys.modules[name] = None
"""


@pytest.fixture
def twin(tmp_path, build):
    """A command in a folder of its own: its exit code, and what it printed."""
    (tmp_path / "python").mkdir()
    (tmp_path / "python" / "sitecustomize.py").write_text(LACKING)
    study_file(tmp_path)
    path = os.pathsep.join([str(tmp_path / "python"), str(ROOT)])

    def run(*words):
        done = subprocess.run(
            [sys.executable, "-c", "from twin.cli import main; main()", *words, "--build", str(build)],
            check=False,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": path},
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert "Traceback" not in done.stderr, done.stderr
        return done.returncode, done.stdout + done.stderr

    return run


@pytest.mark.slow
def test_a_run_and_a_study(twin, tmp_path):
    code, said = twin("run", "scenario.yaml", "--variant", "plain", "--no-report")
    assert code == 0, said
    code, said = twin("study", "patients.yaml", "--workers", "2", "--no-report")
    assert code == 0, said
    (manifest,) = tmp_path.glob("runs/patients/2*/manifest.json")
    assert (json.loads(manifest.read_text())["done"], "did not finish" in said) == (12, False)
    assert "12 cases in" in said.replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.slow
def test_a_member_apart_says_what_it_needs(twin, tmp_path):
    (tmp_path / "apart.yaml").write_text(
        SCENARIO.replace("{component: force_sensor}", "{component: force_sensor, isolate: true}")
    )
    code, said = twin("run", "apart.yaml", "--variant", "plain", "--no-report")
    assert code == 1
    assert "sensor: `isolate` needs POSIX, which this system lacks. Leave it out." in said
