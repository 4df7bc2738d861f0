"""Commands of `twin hil` on a drive without a bus: what they write, move and print, and their exit codes.

Over 400 lines: all commands share one drive in place of a bus.
"""

import itertools
import re
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import ANY

import click
import pytest
from click.testing import CliRunner

from hw_bridge.command import hil
from hw_bridge.command.bench import direction, motion, power
from hw_bridge.command.bench.options import BusChoice, OptionError, paragraph, table
from hw_bridge.command.bench.single_axis import assert_armed
from hw_bridge.commission.direction import Push
from hw_bridge.commission.ramp import Ramp
from hw_bridge.dictionary import State
from tests.hw_bridge.unconnected import WORDS, unconnected_node
from twin.errors import SimulationError

LIMITS = "{position: [-20 mm, 30 mm], velocity: 100 mm/s, acceleration: 4 m/s^2, force: 5 N, following_error: 2 mm}"
FILE = f"simulated: true\nnodes:\n  axis: {{node: 3, profile: faulhaber_v3, limits: {LIMITS}}}\n"


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run a command on a drive; `run.node` answers by SDO, `run.session` is the session in which it moves."""
    file = tmp_path / "bench.yaml"
    file.write_text(FILE)
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]})
    session = Moves(node)

    @contextmanager
    def sdo_session(self):
        yield SimpleNamespace(node=lambda *_: node, drive=lambda *_: node)

    @contextmanager
    def single_axis_session(bus, axis, arm, **more):
        session.opened = (axis.name, arm, more)
        yield session

    monkeypatch.setattr(BusChoice, "sdo_session", sdo_session)
    for module in (direction, motion, power):
        monkeypatch.setattr(module, "single_axis_session", single_axis_session)

    def run(*words, code=0):
        done = CliRunner().invoke(hil.command, [*words, "-f", str(file)])
        error = "" if done.exception is None or isinstance(done.exception, SystemExit) else str(done.exception)
        assert done.exit_code == code, f"{done.output}{error}"
        return " ".join((done.output + error).replace("│", " ").replace(str(file), "FILE").split())

    run.node, run.session = node, session
    return run


class Moves:
    """A drive in Operation enabled at 1 mm that follows at once; cycles of 5 ms."""

    def __init__(self, node):
        self.node, self.h, self.cycle = node, 0.005, 5_000_000
        self.network, self.next_line, self.note = SimpleNamespace(now=0), 0, ""
        self.origin, self.mean_velocity, self.counts_anew = "from start", lambda: 0.0, lambda: False
        self.master = SimpleNamespace(attend=None)
        self.keys = SimpleNamespace(limits=SimpleNamespace(position=[-0.02, 0.03]))
        node.raw_position = 1000
        self.ramp, self.samples, self.positions, self.moves, self.rests = Ramp(0.001, 4.0, 4.0), [], [], [], 0

    def move(self, goal, speed, acceleration):
        self.moves.append((goal, speed, acceleration))
        if self.master.attend is not None:
            self.network.now += 1
            self.master.attend()
        self.samples = [SimpleNamespace(target=0.0, position=position) for position in (0.1e-3, -0.25e-3, 0.2e-3)]
        return goal + 1e-5

    def go(self, position):
        self.network.now += self.cycle
        self.positions.append(position)
        self.node.raw_position = round(position * 1e6)

    def rest(self, duration):
        self.network.now += duration
        self.rests += 1


@pytest.mark.parametrize(
    ("words", "goal", "speed", "rate", "duration"),
    [
        (["--by", "1 mm"], 0.002, 2e-3, 0.4, "0.51"),
        (["--by", "-21 mm"], -0.02, 2e-3, 0.4, "11"),
        (["--to", "30 mm", "--velocity", "80 mm/s", "--acceleration", "4 m/s^2"], 0.03, 0.08, 4.0, "0.38"),
        (["--by", "1 mm", "--velocity", "80 mm/s", "--acceleration", "0.4 m/s^2"], 0.002, 0.08, 0.4, "0.1"),
    ],
)
def test_a_move(run, words, goal, speed, rate, duration):
    text = run("move", "axis", *words)
    assert run.session.moves == [(pytest.approx(goal), pytest.approx(speed), pytest.approx(rate))]
    assert run.session.opened == ("axis", False, {"origin": "reference" if "--to" in words else None, "check": ANY})
    assert text == (
        f"axis: from 1.00 mm to {1e3 * goal:.2f} mm: {1e3 * abs(goal - 0.001):.2f} mm at {1e3 * speed:g} mm/s, {duration} s "
        "(--velocity); positions count from start. "
        f"axis: is at {1e3 * goal + 0.01:.2f} mm, largest following error 0.25 mm."
    )


def test_a_move_in_a_terminal_shows_where_it_is_on_one_line(run, monkeypatch):
    monkeypatch.setattr(motion, "shows_live", lambda: True)
    before, live, after = run("move", "axis", "--by", "1 mm").partition("1.00 mm from start 0.00 mm/s")
    assert "positions count from start." in before
    assert live
    assert "\x1b[K" in after  # it is gone when the result is printed


def test_a_wrapped_error_of_options_stays_wrapped(capsys):
    OptionError("Which bus?\n       Name one.").show()
    assert capsys.readouterr().err == "error: Which bus?\n       Name one.\n"


def test_a_misspelled_node_is_refused_before_the_bus_is_opened(tmp_path, monkeypatch):
    path = tmp_path / "own.yaml"
    path.write_text(FILE)
    monkeypatch.setattr(BusChoice, "network", lambda _: pytest.fail("it was opened"))
    for words in (["status"], ["disable"], ["move", "--by", "1 mm"], ["get", "6064h"]):
        done = CliRunner().invoke(hil.command, [words[0], "axs", *words[1:], "-f", str(path)])
        assert "Did you mean 'axis'?" in str(done.exception)


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        ([], 2, "Say how far"),
        (["--by", "1 mm", "--to", "1 mm"], 2, "Say how far"),
        (["--to", "1 mm", "--from-start"], 2, "--to counts from the reference"),
        (["--by", "-21.1 mm"], 1, "axis: -20.10 mm from start is outside of limits.position, -20.00 mm to 30.00 mm."),
        (["--by", "29.1 mm"], 1, "axis: 30.10 mm from start is outside of limits.position, -20.00 mm to 30.00 mm."),
        (["--by", "1"], 1, "--by: 1 has no unit. Write it with one, such as '1 mm'."),
    ],
)
def test_a_move_that_is_refused(run, words, code, text):
    assert text in run("move", "axis", *words, code=code)
    assert run.session.moves == []


@pytest.fixture
def held(monkeypatch):
    """A button that is held as the test says, then released for good."""
    deflections = []
    button = SimpleNamespace(over=False)

    def deflection():
        button.over = not deflections
        return deflections.pop(0) if deflections else 0.0

    button.deflection = deflection

    @contextmanager
    def opened():
        yield button

    monkeypatch.setattr(motion, "button", opened)
    return deflections


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("words", "low", "high"),
    [
        ([], -9.0, 11.0),
        (["--distance", "25 mm"], -20.0, 26.0),
        (["--distance", "-40 mm"], -20.0, 30.0),
        (["--distance", "0.5 mm"], 0.5, 1.5),
    ],
)
def test_a_jog_stays_near_where_it_began(run, held, words, low, high):
    held.extend([1.0] * 4000 + [-1.0] * 8000)
    text = run("jog", "axis", *words, "--velocity", "20 mm/s")
    assert text.startswith(f"axis: hold an arrow key; {low:.2f} mm to {high:.2f} mm from start. q ends it.")
    assert 1e3 * max(run.session.positions) == pytest.approx(high, abs=1e-6)
    assert 1e3 * min(run.session.positions) == pytest.approx(low, abs=1e-6)
    for name, end, limit in (("upper", high, 30.0), ("lower", low, -20.0)):
        assert f"{name} end ({'limits.position' if end == limit else '--distance'})" in text


@pytest.mark.parametrize(("expired", "reason"), [(False, "released"), (True, "dead-man switch")])
def test_a_jog_on_a_page_says_why_each_motion_has_ended(run, held, monkeypatch, expired, reason):
    """A line of its own, which stays in the record; at an end while the button is held, and not again when it is released."""
    monkeypatch.setattr(motion, "page_watchdog", lambda: SimpleNamespace(expired=expired))
    held.extend([1.0] * 20 + [0.0] * 20 + [-1.0] * 400 * (not expired) + [0.0] * 20)
    lines = run("jog", "axis", "--velocity", "20 mm/s", "--distance", "5 mm")
    ends = [f"axis: stopped at 2.55 mm: {reason}."] + ["axis: stopped at -4.00 mm: lower end (--distance)."] * (
        not expired
    )
    assert re.findall(r"axis: stopped at [^:]*: .*?\.(?= |$)", lines) == ends
    assert run.session.note == ("dead-man switch" if expired else "lower end (--distance)")


def test_a_jog_of_an_axis_that_turns(run, held, tmp_path):
    turning = (
        "position: [-1 rad, 2 rad], velocity: 1 rad/s, acceleration: 40 rad/s^2, force: 5 N*m, following_error: 0.5 rad"
    )
    (tmp_path / "bench.yaml").write_text(FILE.replace("faulhaber_v3", "epos4").replace(LIMITS[1:-1], turning))
    run.session.keys.limits.position = [-1.0, 2.0]
    run.node.rotary = True
    text = run("jog", "axis")  # from 1 mrad, 0.2 rad each way
    assert text.startswith("axis: hold an arrow key; -11.40 deg to 11.52 deg from start. q ends it.")


def test_a_jog_speeds_up_gently_and_stops_hard(run, held):
    """10 % of the acceleration limit up, all of it down: 2 mm/s and 20 mm/s in each cycle of 5 ms."""
    held.extend([1.0, 1.0, 0.5, 0.0, -1.0, 0.0])
    run("jog", "axis", "--velocity", "20 mm/s")
    positions = [0.001, *run.session.positions]
    speeds = [200 * (after - before) for before, after in itertools.pairwise(positions)]
    assert speeds == pytest.approx([2e-3, 4e-3, 6e-3, 0.0, -2e-3, 0.0], abs=1e-9)
    assert run.session.opened == ("axis", False, {"origin": None, "paced": True})


@pytest.mark.parametrize(("velocity", "fits"), [("80 mm/s", True), ("81 mm/s", False)])
def test_a_jog_is_as_fast_as_other_motions(run, held, velocity, fits):
    text = run("jog", "axis", "--velocity", velocity, code=0 if fits else 1)
    assert ("at most 80 mm/s" in text) is not fits


def test_a_jog_that_cannot_stop_in_time_is_refused(run, held, tmp_path):
    (tmp_path / "bench.yaml").write_text(FILE.replace("4 m/s^2", "1 m/s^2"))
    run("jog", "axis", "--velocity", "60 mm/s")
    text = run("jog", "axis", "--velocity", "61 mm/s", code=1)
    assert "--velocity 61 mm/s takes 61 ms to stop at limits.acceleration, 1 m/s^2; a jog has 60 ms. Go slower." in text


@pytest.mark.parametrize(("duration", "rests"), [("0", 0), ("0.02", 4), ("0.021", 5)])
def test_a_place_is_held_for_a_time(run, duration, rests):
    run.node.word = WORDS[State.ENABLED]
    assert (
        run("enable", "axis", "--for", duration)
        == "axis: Operation enabled at 1.00 mm from start. q or Ctrl-C ends it."
    )
    assert run.session.rests == rests


@pytest.mark.parametrize(
    ("pushes", "code", "texts"),
    [
        (
            [Push(1, 1.5, 64e-6, 0.14e-3), Push(-1, 1.25, -64e-6, -64e-6)],
            0,
            [
                "axis: push of +1.50 N: 0.064 mm, correct direction; coasted to 0.14 mm.",
                "axis: push of -1.25 N: -0.064 mm, correct direction.",
                "The encoder and motor have the same sign.",
            ],
        ),
        (
            [Push(1, 1.5, -64e-6), Push(-1, 1.25, -64e-6)],
            1,
            [
                "axis: push of +1.50 N: -0.064 mm, wrong direction.",
                "The encoder counts against the motor: a closed loop would run away.",
            ],
        ),
        (
            [Push(1, 2.0, 0.0), Push(-1, 2.0, -64e-6)],
            1,
            ["axis: push of +2.00 N: 0 mm, not moved.", "It did not move: is it blocked, or is the brake on?"],
        ),
    ],
)
def test_the_verdict_about_an_encoder(run, monkeypatch, pushes, code, texts):
    forces = []
    monkeypatch.setattr("hw_bridge.commission.direction.pushes", lambda session, force: forces.append(force) or pushes)
    text = run("direction", "axis", code=code)
    assert [part in text for part in texts] == [True] * len(texts)
    assert forces == [pytest.approx(2.0)]  # 40 % of the limit
    assert run.session.opened == ("axis", False, {"origin": None, "forced": True})


@pytest.mark.parametrize(
    ("inverted", "moved", "code", "text"),
    [
        ("false", 2e-3, 0, "It counted 2 mm: the hardware file is right."),
        (
            "false",
            -2e-3,
            1,
            "It counted -2 mm: against the hardware file. Change `inverted: false` to `inverted: true`.",
        ),
        (
            "true",
            -2e-3,
            1,
            "It counted -2 mm: against the hardware file. Change `inverted: true` to `inverted: false`.",
        ),
        ("false", 0.0, 1, "axis: nothing was counted. Check the encoder's cable and type, or move it farther."),
    ],
)
def test_the_verdict_about_motion_by_hand(run, monkeypatch, inverted, moved, code, text):
    asked = []
    run.node.keys = run.node.keys.model_copy(update={"inverted": inverted == "true"})
    monkeypatch.setattr(
        "hw_bridge.commission.direction.measure_manual_motion", lambda *given: asked.append(given[2:]) or moved
    )
    assert run("direction", "axis", "--by-hand", "--within", "3", code=code).endswith(text)
    assert asked == [(pytest.approx(160e-6), 3_000_000_000)]  # twenty increments of 8 um


def test_an_object_is_set_and_read_back(run):
    text = run("set", "axis", "6083h", "0.3 m/s^2")
    assert run.node.server.written == [(0x6083, 0, 300)]
    assert text.startswith("axis: 6083h.0 Profile acceleration: 1 m/s^2 (1000) -> 0.3 m/s^2 (300).")
    assert text.endswith("switched off. Keep it: twin hil store 3 -f FILE")
    assert "607Dh is several objects: " in run("set", "axis", "607Dh", "1 mm", code=2)
    assert "acts at once" in run("set", "axis", "6040h", "15", code=1)
    run.node.server.dictionary.values[0x6041, 0] = WORDS[State.ENABLED]
    assert "somebody drives it" in run("set", "axis", "6083h", "0.4 m/s^2", code=1)
    assert len(run.node.server.written) == 1


def test_objects_are_read_with_their_units(run):
    run.node.server.dictionary.values[0x6064, 0] = -1500
    text = run("get", "axis", "6064h", "607Dh")
    assert "6064h.0 Position actual value -1.5 mm (-1500)" in text
    assert "607Dh.1 " in text
    assert "607Dh.2 " in text
    assert "9999h.0" in run("get", "axis", "9999h", code=1)


def test_a_table_has_columns_and_wraps_the_last(capsys):
    table([("a", "bb", "x " * 60), ("ccc", "d", "")], 2, head=True)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("  a    bb  x x x")
    assert max(map(len, lines)) <= 80
    assert lines[1].startswith(" " * 11 + "x x")
    assert lines[2] == "  " + "-" * 78
    assert lines[3] == "  ccc  d"
    table([])
    paragraph("word " * 30)
    lines = capsys.readouterr().out.splitlines()
    assert [len(line) for line in lines] == [79, 69]


def choice(tmp_path, text="", **named):
    """A bus by a hardware file with this text, or by options."""
    file = None
    if text:
        file = tmp_path / "own.yaml"
        file.write_text(text)
    given = {"interface": None, "channel": None} | named
    return BusChoice(file, given["interface"], given["channel"], 1_000_000, {}, None, tmp_path)


@pytest.mark.parametrize(
    ("text", "named", "is_software"),
    [
        (FILE, {}, True),
        (FILE.replace("simulated: true", "interface: socketcan\nchannel: can0"), {}, False),
        ("", {"interface": "socketcan", "channel": "can0"}, False),
        ("", {"interface": "virtual", "channel": "a"}, True),
        ("", {"interface": "socketcan", "channel": "vcan0"}, True),
    ],
)
def test_nothing_real_moves_without_arm(tmp_path, text, named, is_software):
    bus = choice(tmp_path, text, **named)
    assert bus.is_software is is_software
    if not text:
        with pytest.raises(click.UsageError, match="Name the hardware file"):
            assert_armed(bus, True)
        return
    assert_armed(bus, True)
    if is_software:
        assert_armed(bus, False)
        return
    with pytest.raises(SimulationError, match=r"socketcan can0 may move real drives\. Add --arm"):
        assert_armed(bus, False)


@pytest.mark.parametrize(
    ("text", "named", "message"),
    [
        ("", {}, "Which bus?"),
        ("", {"interface": "virtual"}, "Which bus?"),
        ("", {"channel": "x"}, "Which bus?"),
        (FILE, {"interface": "virtual"}, "not both"),
        (FILE, {"channel": "x"}, "not both"),
    ],
)
def test_a_bus_is_named_once(tmp_path, text, named, message):
    with pytest.raises(click.UsageError, match=message), choice(tmp_path, text, **named).network():
        pass


@pytest.mark.parametrize(
    ("words", "environment", "file"),
    [([], True, True), (["-i", "virtual", "-c", "x"], True, False), (["-i", "virtual", "-c", "x"], False, False)],
)
def test_what_is_typed_counts_before_the_environment(tmp_path, monkeypatch, words, environment, file):
    path = tmp_path / "own.yaml"
    path.write_text(FILE)
    chosen = []

    @contextmanager
    def sdo_session(self):
        chosen.append(self)
        yield SimpleNamespace(drive=lambda _: unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]}))

    monkeypatch.setattr(BusChoice, "sdo_session", sdo_session)
    given = {"TWIN_HARDWARE": str(path)} if environment else {}
    done = CliRunner().invoke(hil.command, ["disable", "3", *words], env=given)
    assert done.exit_code == 0, done.output
    (bus,) = chosen
    assert bus.hardware == (path if file else None)
    assert (bus.bit_rate, bus.options, bus.trace, str(bus.build)) == (1_000_000, {}, None, "build")
    assert (bus.interface, bus.channel) == (("virtual", "x") if words else (None, None))


@pytest.mark.parametrize(
    ("text", "real", "completed"),
    [
        ("Restore them first: twin hil restore 1", False, "Restore them first: twin hil restore 1 -f b.yaml"),
        ("`twin hil disable 3` brings it to rest", True, "`twin hil disable 3 -f b.yaml` brings it to rest"),
        ("(twin hil jog axis). Else", True, "(twin hil jog axis -f b.yaml --arm). Else"),
        ("twin hil set 3 605Ah 2.", False, "twin hil set 3 605Ah 2 -f b.yaml."),
        ("with `twin hil reset -f FILE`.", False, "with `twin hil reset -f b.yaml`."),
        ("twin hil restore axis -f FILE.", False, "twin hil restore axis -f b.yaml."),
        ("twin hil home axis -f c.yaml", False, "twin hil home axis -f c.yaml"),
    ],
)
def test_remedies_run_as_they_are_printed(monkeypatch, tmp_path, text, real, completed):
    monkeypatch.setattr(BusChoice, "is_software", not real)
    bus = BusChoice(Path("b.yaml"), None, None, 1_000_000, {}, None, tmp_path)
    assert bus.complete(text) == completed
    other = BusChoice(None, "socketcan", "can0", 1_000_000, {}, None, tmp_path)
    assert other.complete("twin hil store 1") == "twin hil store 1 -i socketcan -c can0"
