"""The page of the first motion, command by command, against a simulated drive of each vendor in a process of its own."""

import os
import pty
import re
import select
import shlex
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

from hw_bridge.command import hil
from hw_bridge.hardware import load
from tests.hw_bridge.axis import UNSTATED
from tests.hw_bridge.commission.conftest import drive_process

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/tutorial/first_motion.md").read_text()
COMMANDS = [
    line
    for block in re.findall(r"^```text\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    for line in block.splitlines()
    if line.startswith("twin ") and "twin drive" not in line
]
SAVED = re.search(r"Save this as `([^`]+)`:\n\n```yaml\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
# what a vendor's drive says otherwise than the page, by a part of the command: exit code and pattern
OTHERWISE = {
    "faulhaber_v3": {"--by-hand": (0, "the hardware file is right")},
    "epos4": {"--by-hand": (0, "the hardware file is right")},
    "epos2": {"direction servomotor -f": (1, "no cst to push with"), "--by-hand": (0, "the hardware file is right")},
    "mclm": {"direction servomotor -f": (1, "no cst to push with"), "--by-hand": (0, "the hardware file is right")},
}
TOLD = {
    "scan": "Switch on disabled",
    "status": "errors\n  none",
    "dump": "values of",
    "compare": "all values equal",
    "check": "Bus and hardware file agree",
    "direction servomotor -f": "and motor have the same sign",
    "jog": "stopped and disabled",
    "--by": r"is at (0\.9[5-9]|1\.0[0-5]) mm",
    "--explain": "method",
    "home servomotor -f": "homed at",
    "--to": r"is at -(0\.9[5-9]|1\.0[0-5]) mm",
    "--dry-run": "Switched on, no power; 0 of 200 process data lost",
    "--arm --no-report": r"PASS (\d+) of \1 ",
    "store": "are stored",
    "reset": "is not in Fault",
}


def test_the_hardware_file_without_a_drive_fits_the_simulated_drive_of_the_page():
    words = shlex.split(re.search(r"^twin drive .*$", PAGE, re.MULTILINE)[0])
    options = dict(zip(words[2::2], words[3::2], strict=True))
    assert "`-f multicast_first_motion`" in PAGE
    keys, real = load(Path("multicast_first_motion")), load(Path("can0_faulhaber_v3"))
    node = keys.nodes["servomotor"]
    assert (keys.interface, keys.channel) == (options["--interface"], options["--channel"])
    assert (node.profile, str(node.node)) == (options["--profile"], options["--node"])
    assert keys.is_software()
    assert node.model_copy(update={"units": real.nodes["servomotor"].units}) == real.nodes["servomotor"]


def run(line, folder, build, drive):
    """A command as a person types it; the simulated bus in the place of can0."""
    option = f"-i udp_multicast -c {drive.channel} --option port={drive.port}"
    words = shlex.split(line.replace("-i socketcan -c can0", option))
    if words[1] == "hil" and not {"jog", "--by-hand"} & {*words}:  # in this process, which has started already
        done = CliRunner().invoke(hil.command, [*words[2:], "--build", str(build)])
        return done.exit_code, done.output + str(done.exception or "")
    start = [sys.executable, "-c", "from twin.cli import main; main()", *words[1:], "--build", str(build)]
    if "jog" in words:
        return held(start, folder)
    process = subprocess.Popen(start, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if "--by-hand" in words:
        assert any("Move it by hand" in text for text in process.stdout)  # behind the drive's identity
        inject = [
            "-m",
            "hw_bridge.drive",
            "inject",
            "encoder_offset",
            "--offset",
            drive.pushed,
            "--control",
            drive.control,
        ]
        subprocess.run([sys.executable, *inject], check=True, capture_output=True)
    out, _ = process.communicate(timeout=120)
    return process.returncode, out


def held(start, folder):
    """The same in a terminal, with a key that is held for half a second."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(start, cwd=folder, stdin=theirs, stdout=theirs, stderr=theirs)
    os.close(theirs)
    out, end = b"", time.monotonic() + 60
    keys = [b"\x1b[C"] * 15 + [b"q"]
    while time.monotonic() < end and process.poll() is None:
        if select.select([ours], [], [], 0.04)[0]:
            try:
                out += os.read(ours, 4096)
            except OSError:
                break
        if b"hold an arrow key" in out and keys:
            os.write(ours, keys.pop(0))
            time.sleep(0.04)
    code = process.wait(20)
    os.close(ours)
    return code, out.decode()


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.parametrize("profile", OTHERWISE)
def test_the_page_runs(profile, build, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with drive_process(profile, build, 46000 + os.getpid() % 4000) as drive:
        drive.pushed = (
            "0.5" if profile.startswith("epos") else "0.02"
        )  # by hand [rad, m], within the drive's own limits
        bench = (ROOT / f"hw_bridge/benches/can0_{profile}.yaml").read_text()
        place = f"interface: udp_multicast\nchannel: {drive.channel}\noptions: {{port: {drive.port}}}\n"
        assert "interface: socketcan\nchannel: can0\n" in bench
        # a test machine stalls for 100 ms; an EPOS4 trips after three cycles that are silent
        bench = bench.replace("cycle: 5 ms", "cycle: 20 ms").replace("lost_after: 100 ms", "lost_after: 400 ms")
        if profile in UNSTATED:  # as the page says
            bench += f"    units: {{acceleration: {UNSTATED[profile]['acceleration']}}}\n"
        (tmp_path / "my_bench.yaml").write_text(bench.replace("interface: socketcan\nchannel: can0\n", place))
        (tmp_path / SAVED[1]).write_text(SAVED[2])
        for line in COMMANDS:
            code, out = run(line, tmp_path, build, drive)
            part, (wanted, text) = next(
                ((part, one) for part, one in OTHERWISE[profile].items() if part in line),
                next(((part, (0, text)) for part, text in TOLD.items() if part in line), ("", (0, ""))),
            )
            assert code == wanted, f"{line}\n{out}"
            assert re.search(text, out), f"{line} ({part})\n{out}"


def test_every_command_of_the_page_is_judged():
    """None is run without looking at what it says, but the run without a drive."""
    parts = {*TOLD, "--by-hand"}
    assert [line for line in COMMANDS if not any(part in line for part in parts)] == [
        "twin run one_millimeter.yaml --no-report"
    ]
    assert len(COMMANDS) >= 15


@pytest.mark.parametrize("profile", OTHERWISE)
def test_the_bench_files_are_sound(profile):
    keys = load(ROOT / f"hw_bridge/benches/can0_{profile}.yaml")
    assert (keys.interface, keys.channel) == ("socketcan", "can0")
    assert not keys.is_software()
    assert keys.nodes["servomotor"].profile == profile
