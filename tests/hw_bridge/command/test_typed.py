"""Commands that pages run, without starting them: command lines, permissions, held buttons; options of the terminal.

Over 400 lines: the steps of one page share its fixtures.
"""

import signal
import threading
import time
from types import SimpleNamespace

import click
import pytest
from click.testing import CliRunner

from hw_bridge.bus import NEVER
from hw_bridge.command import control as control_channel
from hw_bridge.command import drive
from hw_bridge.command.commissioning_steps import STEPS, options
from hw_bridge.command.pages import Page
from hw_bridge.command.progress import Outcome
from hw_bridge.command.running_card import listed, picture
from hw_bridge.command.state_watch import StateWatch
from hw_bridge.command.typed import IDENTITY, READY, SHOWN, Typed, settled
from hw_bridge.commission import Axis
from hw_bridge.fault import Cause, Fault
from hw_bridge.hardware import load
from hw_bridge.profiles import profile
from tests.every_case import every_case
from twin.errors import TwinError

SIMULATED = "simulated: true\nnodes:\n  axis: {node: 1, profile: faulhaber_v3}\n"
REAL = SIMULATED.replace("simulated: true", "interface: socketcan\nchannel: can0")


@pytest.fixture
def make(tmp_path, monkeypatch):
    """A runner whose commands are recorded in `started` and go on until `running` is cleared."""

    def make(text=SIMULATED, arm=False, used=""):
        file = tmp_path / "bench.yaml"
        file.write_text(text)
        started = []

        def start(self, words, attended):
            started.append((words, attended))
            self.running = True
            self._page = SimpleNamespace(send=lambda **message: self.sent.append(message)) if attended else None

        monkeypatch.setattr(Typed, "_start", start)
        host = SimpleNamespace(
            hardware=file, arm=arm, drives_in_use=used, build="build", lock=threading.Lock(), runs=tmp_path / "runs"
        )
        made = Typed(host)
        made.started, made.sent = started, []
        return made

    return make


@pytest.mark.parametrize(
    ("word", "node", "given", "words", "attended"),
    [
        ("scan", "", (), ["scan", "-f", "FILE"], False),
        ("reset", "axis", (), ["reset", "axis", "-f", "FILE"], False),
        ("move", "axis", ["--by=1 mm"], ["move", "axis", "-f", "FILE", "--by=1 mm"], True),
    ],
)
def test_the_command_line_of_a_button(make, word, node, given, words, attended):
    typed = make()
    typed.begin(word, node, given, (5.0, "mm/s"))
    words = [str(typed.file) if item == "FILE" else item for item in words]
    assert typed.started == [([*words, "--build", "build"], attended)]
    shown = " ".join(f"'{item}'" if " " in item else item for item in words)
    assert typed.line == f"twin hil {shown}"
    assert (typed.word, typed.node, typed.speed, typed.changed, typed.attended) == (
        word,
        node,
        (5.0, "mm/s"),
        1,
        attended,
    )
    with pytest.raises(TwinError, match=rf"^twin hil {word} goes on\. End it first\.$"):
        typed.begin("scan")
    busy = "" if word == "scan" else f"twin hil {word} has the drives (Commissioning). End it first."
    assert typed.busy == busy


def test_a_page_that_answers_late_moves_nothing(make, monkeypatch):
    """It is measured before: a motion that its 0.5 s would end is not offered. What moves nothing goes on."""
    now = [100.0]
    monkeypatch.setattr("hw_bridge.command.typed.time.monotonic", lambda: now[0])
    typed = make()
    typed.here(0.24)
    assert typed.late_text == ""
    typed.here(0.3)
    with pytest.raises(TwinError, match=r"^This page answers late \(0\.3 s\): too slow to move\. Close other pages"):
        typed.begin("move", "axis", ["--by=1 mm"])
    typed.begin("status", "axis")
    typed.running = False
    now[0] += 6.0
    typed.begin("move", "axis", ["--by=1 mm"])
    assert typed.running


def test_the_live_state_begins_by_itself(make, monkeypatch):
    """On a bus that outlives its commands, while no session has the drives; not again after it was switched off, later after it ended."""
    calls = []
    monkeypatch.setattr(StateWatch, "resume", lambda watch: calls.append(watch.is_on))
    monkeypatch.setattr(StateWatch, "pause", lambda _watch: calls.append("pause"))
    typed = make(REAL)
    typed.console.is_open = True
    typed.reload()
    assert (calls, typed.watch.is_on) == ([], False)
    typed.console.is_open = False
    typed.reload()
    typed.reload()
    assert (calls, typed.watch.is_on) == ([True], True)
    typed.release_drives()  # a session begins
    typed.reload()
    assert (calls, typed.watch.is_on) == ([True, "pause", True], True)
    typed.watch.is_on, typed.watch.retry_at = False, time.monotonic() + 100.0  # it has ended by itself
    typed.reload()
    assert not typed.watch.is_on
    typed.watch.retry_at = 0.0
    typed.reload()
    assert typed.watch.is_on
    typed.switch_watch(False)
    typed.reload()
    assert not typed.watch.is_on
    simulated = make()
    simulated.console.is_open = False
    simulated.reload()
    assert not simulated.watch.is_on


def test_the_steps_of_another_drive_are_open(make):
    typed = make(REAL)
    typed.watch.is_wanted = False
    check, jog, status = (next(step for step in STEPS if step.word == word) for word in ("check", "jog", "status"))

    def connect(serial):
        typed.watch.rows = {"axis": [("6041h Statusword", "Fault (0008h)"), ("1018h.4 Serial number", serial)]}
        typed.reload()
        return [typed.progress.time_of(step, "axis") is not None for step in (check, jog, status)]

    assert connect("2Bh") == [False] * 3
    for line in (f"check {typed.file}", f"jog axis -f {typed.file}", f"status axis -f {typed.file}"):
        typed.progress.record(f"twin hil {line}", "axis", Outcome.DONE)
    assert (connect("2Bh"), typed.exchanged) == ([True] * 3, {})
    typed.console.arm = True
    typed.begin("jog", "axis")
    assert "--serial=2B" in typed.started.pop()[0]  # the command refuses another drive
    typed.running = False
    assert connect("2Ch") == [False] * 3
    assert typed.exchanged["axis"].startswith("Another drive answers: serial number 2Ch, before 2Bh.")
    assert connect("2Bh") == [True] * 3
    scan = "node 1 (axis): a drive vendor 1h, product 2h, revision 3h, serial 2Ch ready"
    assert IDENTITY.findall(f"node 3: mute node 4: 2 answers: several {scan} node 2: b, serial 7h") == [
        ("1", "2C"),
        ("2", "7"),
    ]


def test_a_changed_eds_file_opens_the_steps(make, tmp_path):
    from hw_bridge import eds

    (tmp_path / "axis.eds").write_text(eds.export(profile("faulhaber_v3")))
    typed = make(REAL.replace("faulhaber_v3", "faulhaber_v3, eds: axis.eds, units: {acceleration: 1 mm/s^2}"))
    typed.watch.is_wanted = False
    (check,) = (step for step in STEPS if step.word == "check")
    typed.progress.record(f"twin hil check -f {typed.file}", "", Outcome.DONE)
    assert not typed.reload()
    assert typed.progress.time_of(check, "") is not None
    (tmp_path / "axis.eds").write_text(eds.export(profile("faulhaber_v3")) + "\n; another revision\n")
    assert typed.reload()
    assert typed.progress.time_of(check, "") is None
    assert not typed.reload()


@pytest.mark.parametrize(
    ("text", "arm", "word", "needs"),
    [
        (REAL, False, "move", True),
        (REAL, False, "enable", True),
        (REAL, False, "scan", False),
        (REAL, False, "reset", False),
        (REAL, True, "move", False),
        (SIMULATED, False, "move", False),
    ],
)
def test_real_drives_move_only_if_the_console_is_armed(make, text, arm, word, needs):
    typed = make(text, arm)
    assert typed.needs_arm(word) is needs
    if needs:
        with pytest.raises(TwinError, match=r"socketcan can0 may move real drives, and this console was not armed"):
            typed.begin(word, "axis")
        assert typed.started == []
        return
    typed.begin(word, "axis")
    assert ("--arm" in typed.started[0][0]) is (arm and word == "move")


def test_a_session_keeps_its_drives_but_may_be_watched(make):
    typed = make(used="a run has the drives.")
    with pytest.raises(TwinError, match=r"^a run has the drives\.$"):
        typed.begin("disable", "axis")
    typed.begin("status", "axis")
    assert len(typed.started) == 1


def test_stop_while_a_command_waits_for_the_live_state_to_end(make, monkeypatch):
    """It takes seconds where drives do not answer; there is no process yet that could be interrupted."""
    typed, resumed = make(), []
    monkeypatch.setattr(typed.watch, "pause", typed.stop)
    monkeypatch.setattr(typed.watch, "resume", lambda: resumed.append(True))
    with pytest.raises(TwinError, match=r"^twin hil home: stopped before it began\.$"):
        typed.begin("home", "axis")
    assert (typed.started, typed.running, resumed) == ([], False, [True])
    monkeypatch.setattr(typed.watch, "pause", lambda: None)
    typed.begin("home", "axis")
    assert len(typed.started) == 1


def test_stop_while_a_process_is_started(make, monkeypatch):
    """Its process is known only afterwards."""
    typed, signals = make(), []
    process = SimpleNamespace(poll=lambda: None, send_signal=signals.append)

    def start(*_):
        typed.stop()
        typed.running, typed.process = True, process

    monkeypatch.setattr(typed, "_start", start)
    typed.begin("home", "axis")
    assert signals == [signal.SIGINT]


def test_the_button_of_a_jog(make, monkeypatch):
    """It is there once the drive is ready, and counts as held for as long as it is renewed."""
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    typed = make()
    typed.begin("jog", "axis")
    assert (typed.controls, typed.held) == ((), {})
    typed.hold("jog axis", 1.0, 7, 0.02)
    assert typed.sent == []
    typed.text = f"axis: {READY}"
    assert typed.controls == ()  # the drive has not reported Operation enabled, or not any more
    typed.motion.state = "Operation enabled"
    assert typed.controls == ("jog axis",)
    typed.hold("jog other", 1.0, 7, 0.02)
    typed.hold("jog axis", -0.5, 7, 0.02)
    typed.here(0.05)
    assert typed.sent == [{"here": 99.98, "hold": -0.5, "press": 7}, {"here": 99.95}]
    now[0] = 100.099
    assert typed.held == {"jog axis": -0.5}
    now[0] = 100.101  # 120 ms after it was renewed
    assert typed.held == {}
    typed.hold("jog axis", 0.0, 7, 0.0)
    assert typed.held == {}
    typed.hold("jog axis", 1.0, 8, 0.0)
    assert typed.held == {"jog axis": 1.0}
    typed.sent.clear()
    typed.release_hold()
    typed.end()
    assert typed.held == {}
    assert typed.sent == [{"release_hold": True}, {"end": True}]
    assert typed.lateness == 0.0
    for age in (0.45, 0.3):
        typed.here(age)
    assert typed.lateness == 0.45
    now[0] += 6.0
    assert typed.lateness == 0.0
    typed.motion.state = "Switch on disabled"
    assert typed.controls == ()
    typed.running = False
    assert (typed.controls, typed.attended, typed.busy) == ((), False, "")


def test_output_as_a_terminal_shows_it():
    assert settled("a\nbcd\rxy\nlast\r") == "a\nxy\nlast\r"
    assert settled(settled("10 mm\r") + "stands\n") == "stands\n"
    assert settled("one\r\ntwo") == "one\ntwo"
    assert settled("x" * (SHOWN + 5)) == "x" * SHOWN


STEP = {(step.word, step.button): step for step in STEPS}


@pytest.mark.parametrize(
    ("step", "values", "words"),
    [
        (("direction", "by hand"), {}, ["--by-hand"]),
        (
            ("move", "move"),
            {"by": " 1 mm ", "velocity": "", "from-start": True, "to": None},
            ["--by=1 mm", "--from-start"],
        ),
        (("move", "move"), {"from-start": False, "acceleration": "2 m/s^2"}, ["--acceleration=2 m/s^2"]),
        (("step", "step"), {"explain": True, "by": "-2e-4 m", "from-start": True}, ["--by=-2e-4 m", "--explain"]),
    ],
)
def test_fields_become_options(step, values, words):
    assert options(STEP[step], values) == words


@pytest.mark.parametrize(("text", "fits"), [("1" * 40, True), ("1" * 41, False), ("1 mm; x", False), ("--arm", False)])
def test_a_field_holds_a_quantity(text, fits):
    if fits:
        assert options(STEP["move", "move"], {"by": text}) == [f"--by={text}"]
        return
    with pytest.raises(TwinError, match=r"^by: expected a number with its unit, such as '1 mm'\.$"):
        options(STEP["move", "move"], {"by": text})


@pytest.mark.parametrize(("rotary", "speed"), [(False, (10.0, "mm/s")), (True, (10.0, "deg/s"))])
def test_a_page_begins_steps(make, rotary, speed):
    typed = make()
    page = Page(typed.console, lambda: True, typed)
    drive_axis = Axis("axis", load(typed.file).nodes["axis"], rotary)
    velocity = {"velocity": "10 deg/s" if rotary else "10 mm/s"}
    page.begin(STEP["jog", "power on for a jog"], "axis", velocity, drive_axis)
    assert (typed.word, typed.node) == ("jog", "axis")
    assert typed.speed == (pytest.approx(speed[0]), speed[1])
    typed.running = False
    page.begin(STEP["step", "step"], "axis", {}, drive_axis)
    assert typed.started[-1][0][4:] == [f"--plot={page.plot('axis')}", "--build", "build"]
    typed.running = False
    page.plot("axis").write_text("<svg/>")
    assert picture(page) == ""  # none has ended
    typed.done.appendleft((0.0, "twin hil step <axis>", 0))
    assert picture(page).startswith('<img class="full-width"')
    typed.done.appendleft((0.0, "twin hil step axis", 1))
    assert picture(page) == ""
    typed.done.appendleft((0.0, "twin hil jog axis", 130))
    typed.outputs.extend(["axis: stopped at 1.00 mm: released.\n\naxis: stopped.\n", "error: no\n", ""])
    *_, line, first, _, last = typed.record().splitlines()
    assert line.endswith("  twin hil jog axis  exit code 130")
    assert (first, last) == ("    axis: stopped at 1.00 mm: released.", "    axis: stopped.")
    lines = listed(typed).split("<li>")
    assert "<b>stopped</b>" in lines.pop(1)
    assert len(lines) == 3
    assert '<b class="twin-bad">exit code 1</b>' in lines[1]
    assert lines[2].endswith("twin hil step &lt;axis&gt;</li></ul>")


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["emcy", "--code", "7320h", "--lasting"], Fault(Cause.EMCY, code=0x7320, lasting=True)),
        (
            ["delay", "--for", "0.5", "--share", "0.25", "--count", "3", "--delay", "0.02", "--jitter", "0.001"],
            Fault(Cause.DELAY, duration=500_000_000, share=0.25, count=3, delay=20_000_000, jitter=1_000_000),
        ),
        (["drop", "--identifiers", "180h-1FFh"], Fault(Cause.DROP, identifiers=(0x180, 0x1FF))),
        (["friction", "--factor", "3"], Fault(Cause.FRICTION, factor=3.0)),
        (["encoder_offset", "--offset", "-0.001"], Fault(Cause.ENCODER_OFFSET, offset=-0.001)),
        (["heartbeat"], Fault(Cause.HEARTBEAT, duration=NEVER, count=NEVER)),
    ],
)
def test_a_fault_on_the_command_line(monkeypatch, words, fault):
    seen = []
    monkeypatch.setattr(control_channel, "request", lambda port, requested: seen.append((port, requested)))
    done = CliRunner().invoke(drive.command, ["inject", *words, "--control", "4703"])
    assert done.exit_code == 0, done.output
    assert seen == [(4703, fault)]


def test_options_of_a_simulated_drive():
    assert drive.named(("port=43114", "ttl=-1", "name=a=b")) == {"port": 43114, "ttl": -1, "name": "a=b"}
    for option in ("port", "=3"):
        with pytest.raises(click.UsageError, match=rf"--option {option}: expected NAME=VALUE"):
            drive.named((option,))
    assert drive.with_motor(profile("mclm"), "lm1247").motor_name == "lm1247"
    with pytest.raises(click.UsageError, match=r"--motor ec_i_40: no values of it are known for FAULHABER MCLM"):
        drive.with_motor(profile("mclm"), "ec_i_40")
    with pytest.raises(click.UsageError, match=r"--profile cia402: name the drive's --eds FILE\."):
        drive.generic_drive("cia402", None, ())


@pytest.mark.parametrize(
    ("words", "is_set_up"),
    [
        ([], True),
        (["--factory"], False),
        (["--eds", "own.eds"], False),
        (["--eds", "own.eds", "--motor", "lm1247"], True),
        (["--eds", "own.eds", "--motor", "lm1247", "--factory"], False),
    ],
)
def test_a_simulated_drive_is_set_up_for_its_motor(monkeypatch, tmp_path, words, is_set_up):
    """Not as delivered, and not where an EDS file says what it holds, unless a motor is named."""
    seen = []
    monkeypatch.setattr(drive, "serve", lambda *given: seen.append(given))
    monkeypatch.setattr(drive, "with_dictionary", lambda chosen, path: chosen)
    bus = ["-p", "mclm", "-n", "3", "-i", "virtual", "-c", "x", "--bitrate", "500000", "--option", "port=7"]
    file = tmp_path / "own.eds"
    file.write_text("")
    done = CliRunner().invoke(drive.command, [*bus, *(str(file) if word == "own.eds" else word for word in words)])
    assert done.exit_code == 0, done.output
    (given,) = seen
    assert (given[0].name, given[0].motor_name) == (
        "mclm",
        "lm1247" if "--motor" in words else profile("mclm").motor_name,
    )
    assert given[1:5] == (3, "virtual", "x", 500_000)
    assert given[6:10] == (None, None, {"port": 7}, is_set_up)


def test_a_simulated_drive_is_node_1_where_nothing_is_said(monkeypatch):
    seen = []
    monkeypatch.setattr(drive, "serve", lambda *given: seen.append(given[1:5]))
    done = CliRunner().invoke(drive.command, ["-p", "mclm", "-i", "virtual", "-c", "x"])
    assert done.exit_code == 0, done.output
    assert seen == [(1, "virtual", "x", 1_000_000)]


@every_case(
    ("words", "text"),
    [
        (["-n", "1"], "Name --profile: faulhaber_v3"),
        (["-p", "mclm", "-n", "128"], "--node 128: expected 1 to 127, or 255"),
        (["-p", "mclm", "-n", "254"], "--node 254: expected 1 to 127, or 255"),
        (["-p", "mclm", "-n", "255"], "Name --interface and --channel"),
        (["-p", "mclm", "-n", "127", "-i", "virtual"], "Name --interface and --channel"),
        (["-p", "cia401", "-n", "3", "--switch", "home=1mm:2mm"], "--switch: Digital"),
    ],
)
def test_what_a_simulated_drive_needs(words, text):
    done = CliRunner().invoke(drive.command, words)
    assert done.exit_code == 2
    message = " ".join(done.output.replace("│", " ").split())
    assert text.split("Digital")[0] in message
