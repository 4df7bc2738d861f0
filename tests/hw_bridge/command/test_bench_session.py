"""The session in which a command moves a drive: what is checked before, kept afterwards and told; frames as text.

Over 400 lines: one recorded session serves all commands.
"""

import json
import re
from contextlib import contextmanager
from math import nan
from types import SimpleNamespace

import click
import pytest
from click.testing import CliRunner

from hw_bridge.command import hil
from hw_bridge.command.bench import single_axis, step
from hw_bridge.command.bench.options import BusChoice
from hw_bridge.command.can import command as can_command
from hw_bridge.commission import Axis
from hw_bridge.dictionary import State
from hw_bridge.hardware import load
from tests.hw_bridge.unconnected import unconnected_node
from twin.errors import SimulationError

SOFTWARE_BUS = "interface: udp_multicast\nchannel: 239.74.163.2"
HOMING = ", homing: {method: 37}"
LIMITS = "{position: [-20 mm, 30 mm], velocity: 100 mm/s, following_error: 2 mm}"
FILE = f"simulated: true\nnodes:\n  axis: {{node: 3, profile: faulhaber_v3, limits: {LIMITS}HOMING}}\n"


@pytest.fixture
def session(tmp_path, monkeypatch):
    """Open a session; `calls` has what was done with the drive, its reference and the bus, in this order.

    Over 60 lines: the replaced classes append to one list.
    """
    calls = []
    state = SimpleNamespace(calls=calls, problem="", notes=[], recovered=[], page=None, is_lost=False, refusal="")
    network = SimpleNamespace()

    class Reference:
        def __init__(self, keys, name, rotary):
            calls.append(("reference", name, rotary))

        def problem(self, _drive):
            return state.problem

        def position(self, _drive):
            return 0.02

        def forget(self):
            calls.append("forget")
            self.is_recorded = False

        def save(self, node):
            calls.append(("save", node.name))

        is_recorded = True

    class Session:
        def __init__(self, keys, name, bus, rotary, forced):
            calls.append(("session", list(keys.nodes), keys.nodes[name].homing is not None, rotary, forced))
            self.master = SimpleNamespace(recovered=state.recovered, notes=state.notes, attend=None, before_power=None)
            self.node = SimpleNamespace(
                name="axis", state=State.DISABLED, has_reference=False, started=True, position=0.02, format_length=str
            )
            self.next_line = 0
            self.origin, self.homes = "from reference", keys.nodes[name].homing is not None

        @contextmanager
        def enabled(self, start, homed):
            calls.append(("enabled", start, homed is not None, self.paced, self.master.attend))
            self.node.has_reference |= self.homes  # as the master does when it has homed
            self.node.started = state.refusal in ("", "no position")
            if state.refusal:
                raise SimulationError(state.refusal)
            self.master.before_power()
            try:
                yield self
            finally:
                calls.append("disabled")
                self.node.has_reference &= not state.is_lost

    @contextmanager
    def opened(self):
        yield network
        calls.append("closed")

    monkeypatch.setattr(BusChoice, "network", opened)
    monkeypatch.setattr(
        "hw_bridge.commission.SdoSession", lambda bus, nodes: SimpleNamespace(drive=lambda name: f"drive {name}")
    )
    monkeypatch.setattr(single_axis, "assert_same_drive", lambda drive: None)
    monkeypatch.setattr("hw_bridge.commission.identity_text", lambda drive: f"node 3 ({drive}): serial 7h")
    monkeypatch.setattr("hw_bridge.commission.SingleAxisSession", Session)
    monkeypatch.setattr("hw_bridge.master.Reference", Reference)
    monkeypatch.setattr(single_axis, "check_before_power", lambda *given: calls.append("checked"))

    def enter(homing=True, inside=lambda opened: None, word="move", **options):
        file = tmp_path / "bench.yaml"
        file.write_text(FILE.replace("HOMING", HOMING if homing else ""))
        bus = BusChoice(file, None, None, 1_000_000, {}, None, tmp_path)
        context = click.Context(click.Command(word), info_name=word)
        if state.page is not None:
            context.meta[single_axis.PAGE] = state.page
        axis = Axis("axis", load(file).nodes["axis"], False)
        with context, single_axis.single_axis_session(bus, axis, False, **options) as opened:
            calls.append("inside")
            inside(opened)
        return opened

    state.enter = enter
    return state


BEGIN = [("reference", "axis", False), "checked"]


@pytest.mark.parametrize(
    ("options", "problem", "is_kept"),
    [
        ({}, "", True),  # a reference that is valid stays so
        ({}, "none", False),
        ({"origin": "reference"}, "", True),
        ({"origin": "start"}, "", True),
        ({"homes": True}, "none", True),
        ({"homes": True, "start": 0.004, "forced": True, "paced": True}, "", True),
    ],
)
def test_a_reference_is_forgotten_during_a_motion_and_kept_after_it(session, capsys, options, problem, is_kept):
    session.problem = problem
    session.enter(**options)
    homes, origin = options.get("homes", False), options.get("origin")
    homed = not homes and not problem and origin != "start"
    assert session.calls == [
        *BEGIN,
        ("session", ["axis"], homes, False, options.get("forced", False)),
        ("enabled", options.get("start", 0.0), homed, options.get("paced", False), None),
        "forget",
        "inside",
        "disabled",
        ("save", "axis") if is_kept else "forget",
        "closed",
    ]
    lost = " The reference is lost.\nHome it: twin hil home axis -f " if not is_kept and not problem else ""
    assert capsys.readouterr().out.startswith(f"axis: stopped and disabled, at 0.02 from reference.{lost}")


@pytest.mark.parametrize(
    ("homing", "problem", "text"),
    [
        (False, "", "nodes.axis has no `homing`, so that the drive has no reference"),
        (True, "pushed.", r"axis: no reference: pushed\. Home it: twin hil home axis -f \S+bench.yaml$"),
    ],
)
def test_a_drive_without_a_valid_reference_does_not_count_from_it(session, homing, problem, text):
    session.problem = problem
    with pytest.raises(SimulationError, match=text):
        session.enter(homing, origin="reference")
    assert "inside" not in session.calls
    assert "forget" not in session.calls


def test_warnings_of_a_session_are_an_error_at_its_end(session, capsys):
    session.notes.append("does not stand")
    session.recovered.append("restored")
    with pytest.raises(SystemExit) as caught:
        session.enter()
    assert caught.value.code == 1
    assert capsys.readouterr().out == "restored\nwarning: does not stand\n"
    assert ("save", "axis") in session.calls


@pytest.mark.parametrize(
    ("state", "is_lost", "problem", "end"),
    [
        (
            State.DISABLED,
            False,
            "",
            "at 0.02 from reference. The reference is kept.\n  NEXT status axis -f FILE",
        ),
        (
            State.DISABLED,
            False,
            "none",
            "at 0.02 from reference.\n  NEXT status axis -f FILE",
        ),
        (
            State.DISABLED,
            True,
            "",
            "is lost.\n  NEXT status axis -f FILE\n  Then: twin hil home axis -f FILE",
        ),
        (
            State.FAULT,
            False,
            "",
            "is lost.\n  NEXT reset -f FILE\n  Then: twin hil home axis -f FILE",
        ),
        (
            State.ENABLED,
            True,
            "",
            "before you touch it. The reference is lost.\n  NEXT status axis -f FILE\n  Then: twin hil home axis -f FILE",
        ),
    ],
)
def test_a_motion_that_failed_says_how_it_left_the_drive(session, tmp_path, state, is_lost, problem, end):
    session.is_lost, session.problem = is_lost, problem

    def fail(opened):
        opened.node.state = state
        raise SimulationError("jammed")

    with pytest.raises(SimulationError, match=r"^jammed\n  axis: ") as caught:
        session.enter(inside=fail)
    end = end.replace("NEXT", "Next, once the cause is removed: twin hil")  # one command a line, in their order
    assert str(caught.value).replace("\xa0", " ").endswith(end.replace("FILE", str(tmp_path / "bench.yaml")))
    assert (("save", "axis") in session.calls) == ("kept" in end)
    if state is State.DISABLED:
        with pytest.raises(SimulationError, match=r"removed: twin.hil.jog.axis.-f."):
            session.enter(inside=fail, word="jog")


@pytest.mark.parametrize("refusal", ["its scale is ASSUMED", "no position"])
@pytest.mark.parametrize("problem", ["", "pushed"])
def test_a_refusal_leaves_the_record_of_the_reference_as_it_is(session, refusal, problem):
    """Nothing has moved, and no position was read that could be recorded."""
    session.refusal, session.problem = refusal, problem
    with pytest.raises(SimulationError, match=refusal):
        session.enter()
    assert ("save", "axis") not in session.calls
    assert "inside" not in session.calls
    assert ("forget" in session.calls) is (problem != "" and refusal == "no position")


def test_a_drive_in_fault_has_lost_its_reference_also_if_it_is_refused(session, monkeypatch):
    session.refusal = "is in Fault"
    monkeypatch.setattr(single_axis, "check_before_power", lambda *_: True)
    with pytest.raises(SimulationError, match="is in Fault"):
        session.enter()
    assert session.calls.count("forget") == 1


@pytest.mark.parametrize(("options", "position"), [({}, 0.02), ({"origin": "start"}, None), ({"homes": True}, None)])
def test_a_target_is_checked_before_anything_is_written(session, options, position):
    def check(found):
        session.calls.append(("position", found))
        raise SimulationError("outside")

    with pytest.raises(SimulationError, match="outside"):
        session.enter(check=check, **options)
    assert session.calls == [*BEGIN, ("position", position), "closed"][: len(session.calls)]


def test_an_interrupted_motion_says_whether_the_reference_is_kept(session, capsys):
    def interrupt(_opened):
        raise KeyboardInterrupt

    for is_lost, problem, options, text in (
        (False, "", {}, "The reference is kept."),
        (True, "", {}, "The reference is lost."),
        (False, "none", {}, ""),  # a simulated one is switched on anew
        (True, "none", {"homes": True}, "It is not homed."),
    ):
        session.is_lost, session.problem = is_lost, problem
        with pytest.raises(KeyboardInterrupt):
            session.enter(inside=interrupt, word="jog", **options)
        output = capsys.readouterr().out.strip().split("Next: ")
        assert (
            " ".join(output[0].split())
            == f"axis: power is off (Switch on disabled), at 0.02 from reference. {text}".strip()
        )
        words = ["jog"] + ["home"] * ("lost" in text or "not homed" in text)  # one a line, in their order
        assert re.findall(r"^(?:Then: )?twin hil (\w+) axis -f \S+$", output[1], re.MULTILINE) == words
        session.calls.clear()


def test_a_drive_that_is_not_homed_says_so_at_each_stop(session, capsys, monkeypatch):
    session.problem = "none"
    monkeypatch.setattr(
        "tests.hw_bridge.command.test_bench_session.FILE", FILE.replace("simulated: true", SOFTWARE_BUS)
    )
    monkeypatch.setattr(single_axis, "say_origin", lambda *_: None)
    session.enter()
    said = "axis: stopped and disabled, at 0.02 from reference. It is not homed.\nHome it: twin hil home axis -f "
    assert capsys.readouterr().out.startswith(said)


def test_a_motion_that_failed_on_a_page_leaves_its_live_values(session, capsys, monkeypatch):
    def fail(_opened):
        raise SimulationError("jammed")

    session.notes.append("note")
    session.page = SimpleNamespace(look=None)
    monkeypatch.setattr(single_axis, "show_live", lambda held, is_page, is_final: print("\r at rest\r", end=""))
    with pytest.raises(SimulationError, match="jammed\n  axis: last state"):
        session.enter(inside=fail)
    assert capsys.readouterr().out == "node 3 (drive axis): serial 7h\n\r at rest\r\nwarning: note\n"


@pytest.mark.parametrize(("expected", "is_refused"), [(None, False), ("1", False), ("2B", True)])
def test_another_drive_than_the_one_of_the_steps_is_refused(expected, is_refused):
    drive = unconnected_node()
    with click.Context(click.Command("move")) as context:
        single_axis.save_serial(context, None, expected)
        if not is_refused:
            single_axis.assert_same_drive(drive)
            return
        with pytest.raises(
            SimulationError, match=r"axis: another drive answers: serial number 1h, before 2Bh\. Nothing"
        ):
            single_axis.assert_same_drive(drive)
    assert drive.server.written == []


def test_a_page_is_looked_at_in_every_cycle_and_sees_live_values(session, monkeypatch):
    looks = []
    session.page = SimpleNamespace(look=lambda: looks.append("look"))
    monkeypatch.setattr(single_axis, "show_live", lambda held, **options: looks.append((held.node, options)))
    held = session.enter()
    held.master.attend()
    assert looks == [(held.node, {"is_page": True, "is_final": True}), "look", (held.node, {"is_page": True})]
    assert held.paced


@pytest.mark.parametrize(("speed", "mark"), [(0.001, ">"), (-0.001, "<"), (0.0, " ")])
def test_the_line_of_a_jog(capsys, speed, mark):
    node = SimpleNamespace(
        position=0.001, velocity=-0.002, current=0.256, silent=1, format_length=lambda value: f"{1e3 * value:.2f} mm"
    )
    network, state = SimpleNamespace(now=5), SimpleNamespace(anew=False)
    held = SimpleNamespace(
        node=node,
        ramp=SimpleNamespace(velocity=speed),
        network=network,
        next_line=0,
        note="",
        origin="from start",
        cycle=5_000_000,
        mean_velocity=lambda: -0.00149,
        counts_anew=lambda: state.anew,
    )
    single_axis.show_live(held)
    values = f"\r{mark}    1.00 mm from start       -1.49 mm/s   0.26 A"
    assert capsys.readouterr().out == f"{values}   {'':<27}"
    single_axis.show_live(held)  # not yet again
    state.anew = True
    network.now, held.note, node.state = 5 + single_axis.LINE_PERIOD, "upper end (--distance)", "Quick stop active"
    single_axis.show_live(held, is_page=True)  # a drive that homes has set its position to 0
    assert capsys.readouterr().out == ""
    state.anew = False
    single_axis.show_live(held, is_page=True)
    line = capsys.readouterr().out
    values = "position    1.00 mm from start, velocity -1.49 mm/s, current  0.256 A, Quick stop active"
    assert line == f"\r{mark} {values}   upper end (--distance)     \r"
    node.silent, held.next_line = 56, 0  # its plug was pulled
    single_axis.show_live(held)
    shown = capsys.readouterr().out
    assert shown.endswith("   last known, no data 0.28 s ")
    assert len(shown) <= 80
    node.silent = 0
    single_axis.show_live(
        held, is_page=True, is_final=True
    )  # at once, and as it stands: the ramp may have been cut short
    assert "\r  position    1.00 mm from start, velocity -2.00 mm/s, current  0.256 A" in capsys.readouterr().out
    node.state = State.DISABLED  # its latest current is of before: no reading
    single_axis.show_live(held, is_page=True, is_final=True)
    assert ", current      - A, Switch on disabled" in (off := capsys.readouterr().out)
    assert single_axis.LIVE_VALUES.match(off[1:])["current"] == "-"
    assert single_axis.LIVE_VALUES.match(line[1:]).groupdict() == {
        "mark": mark,
        "position": "1.00",
        "unit": "mm",
        "origin": "from start",
        "velocity": "-1.49 mm/s",
        "current": "0.256",
        "state": "Quick stop active",
    }


@pytest.fixture
def stepped(tmp_path, monkeypatch):
    """Run `twin hil step`; responses have the figures of their name. `gains`, `differences`: what is found."""
    file = tmp_path / "bench.yaml"
    file.write_text(FILE.replace("HOMING", ""))
    state = SimpleNamespace(gains={}, differences=[0.0, 0.0], taken=[], drawn=[], goals=[])

    def response(name, rise=0.02, left=1e-5):
        values = {"rise": rise, "overshoot": 0.125, "settled": nan, "left": left}
        return SimpleNamespace(name=name, figures=lambda: values)

    def simulated(_keys, _name, size, _build, gains):
        state.taken.append(("simulated", round(1e3 * size, 6), gains))
        if abs(size) > 0.9e-3:
            raise SimulationError("axis: force.")
        return response(f"twin {len(gains)}")

    @contextmanager
    def single_axis_session(bus, axis, arm, **more):
        profile = SimpleNamespace(motor=SimpleNamespace(resolution=8e-6))
        yield SimpleNamespace(node=SimpleNamespace(profile=profile, position=0.0))

    def explain(real, *_):
        return response("explained"), state.gains, state.differences

    monkeypatch.setattr(step, "single_axis_session", single_axis_session)
    monkeypatch.setattr(step, "check_target", lambda _session, goal: state.goals.append(goal))
    monkeypatch.setattr("hw_bridge.commission.step.simulated", simulated)
    monkeypatch.setattr("hw_bridge.commission.step.response", lambda _, size: response("real", 0.0104, -2e-6))
    monkeypatch.setattr("hw_bridge.commission.step.explain", explain)
    monkeypatch.setattr(
        "hw_bridge.commission.step.picture",
        lambda path, curves, unit, factor: state.drawn.append((path.name, list(curves), unit, factor)),
    )

    def run(*words, code=0):
        done = CliRunner().invoke(hil.command, ["step", "axis", *words, "-f", str(file)])
        assert done.exit_code == code, f"{done.output}{done.exception}"
        return done.output if code == 0 else str(done.exception)

    state.run = run
    return state


MOST = "mm: must be above 0 and at most 1 mm, half of nodes.axis.limits.following_error of the hardware file."
ROWS = "axis  10 ms  12 %       -        -0.002 mm\ntwin  20 ms  12 %       -        0.01 mm\n"


def test_a_step_is_shown_beside_that_of_the_twin(stepped):
    lines = stepped.run().splitlines(keepends=True)
    assert lines[0] == "      rise   overshoot  settled  left\n"
    assert "".join(lines[2:4]) == ROWS
    assert lines[4] == "step.svg: position and current over time.\n"
    assert stepped.taken == [("simulated", 0.2, {})]  # a tenth of the following error's limit
    assert stepped.drawn == [("step.svg", ["axis", "twin"], "mm", 1e3)]
    assert stepped.goals == [pytest.approx(0.2e-3)]


@pytest.mark.parametrize(
    ("by", "text"),
    [
        ("0 mm", f"--by 0 {MOST}"),
        ("1.01 mm", f"--by 1.01 {MOST}"),
        ("-1.01 mm", f"--by 1.01 {MOST}"),
        ("1 mm", "--by 1 mm: the simulated drive meets a limit: axis: force. Take less."),
        ("-0.9 mm", ""),
    ],
)
def test_a_step_keeps_to_the_limits(stepped, by, text):
    if text:
        assert stepped.run("--by", by, code=1) == text
        assert stepped.drawn == []
        return
    stepped.run("--by", by)
    assert stepped.taken == [("simulated", -0.9, {})]


@pytest.mark.parametrize(
    ("gains", "before", "after", "text", "curves"),
    [
        ({"a": 2.0}, 7.9e-6, 0.0, "The twin does the same, to within an increment of the sensor.", 2),
        (
            {"a": 2.0, "b": 0.254},
            8e-6,
            3.9e-6,
            "Gains that would explain it: a x 2, b x 0.25. Difference 0.008 mm rms, with them\n0.0039 mm.",
            3,
        ),
        ({"a": 2.0}, 8e-6, 4e-6, "No gains explain the difference of 0.008 mm rms: look at load,", 2),
        ({}, 8e-6, 1e-6, "No gains explain the difference of 0.008 mm rms: look at load,", 2),
    ],
)
def test_gains_that_explain_a_difference(stepped, gains, before, after, text, curves):
    """Half of the difference at least, and more than the sensor tells."""
    stepped.gains, stepped.differences = gains, [before, after]
    assert text in stepped.run("--explain", "--plot", "a.svg")
    ((name, labels, *_),) = stepped.drawn
    assert (name, labels) == ("a.svg", ["axis", "twin", "twin with other gains"][:curves])
    assert stepped.taken[1:] == [("simulated", 0.2, gains)] * (curves == 3)


LOG = """\
(0.100000) can0 000#8103
(0.200000) can0 703#00
(0.300000) can0 703#R1
(0.400000) can0 603#4041600000000000
(0.500000) can0 583#4B41600027020000
"""
LINES = [
    "(0.100000)  000  [2]  81 03                    NMT       ",
    "(0.200000)  703  [1]  00                       HEARTBEAT ",
    "(0.300000)  703  [1]  remote                   GUARD     ",
    "(0.400000)  603  [8]  40 41 60 00 00 00 00 00  SDO       ",
    "(0.500000)  583  [8]  4B 41 60 00 27 02 00 00  SDO       ",
]


@pytest.fixture
def decode(tmp_path):
    """Decode a trace of five frames."""
    trace = tmp_path / "a.log"
    trace.write_text(LOG)

    def decode(*words, code=0):
        done = CliRunner().invoke(can_command, ["decode", str(trace), *map(str, words)])
        assert done.exit_code == code, done.output
        return done.output.splitlines()

    return decode


def test_frames_as_text(decode, tmp_path):
    shown = decode("-p", "faulhaber_v3", "-n", 3)
    assert [line[: len(begin)] for line, begin in zip(shown, LINES, strict=True)] == LINES
    assert shown[0].endswith("node 3: reset node")
    assert "Operation enabled" in shown[4]
    decode("-p", "faulhaber_v3", "-n", 3, "-o", tmp_path / "a.txt")
    assert (tmp_path / "a.txt").read_text().splitlines() == shown


@pytest.mark.parametrize(
    ("words", "numbers"),
    [
        (["--from", 0.2], [1, 2, 3, 4]),
        (["--to", 0.2], [0, 1]),
        (["--from", 0.15, "--to", 0.45], [1, 2, 3]),
        (["--only", "sdo"], [3, 4]),
        (["--only", "sdo", "--only", "nmt"], [0, 3, 4]),
        (["-n", 3], [0, 1, 2, 3, 4]),
        (["-n", 4], []),
        (["--only", "sdo", "--events"], []),
    ],
)
def test_frames_that_are_shown(decode, words, numbers):
    assert [line[:10] for line in decode(*words)] == [LINES[number][:10] for number in numbers]


def test_frames_as_json_and_csv(decode):
    rows = [json.loads(line) for line in decode("--json", "-p", "faulhaber_v3", "-n", 3)]
    assert [list(row) for row in rows] == [["time", "id", "data", "node", "service", "text", "values", "event"]] * 5
    assert [(row["time"], row["id"], row["data"]) for row in rows] == [
        (0.1, 0, "8103"),
        (0.2, 0x703, "00"),
        (0.3, 0x703, ""),
        (0.4, 0x603, "4041600000000000"),
        (0.5, 0x583, "4b41600027020000"),
    ]
    assert [row["node"] for row in rows[1:]] == [3] * 4
    assert [row["event"] for row in rows[:2]] == [True, True]
    text = decode("--csv", "-p", "faulhaber_v3", "-n", 3)
    assert text[0] == "time [s],id,data,node,service,text,values"
    assert [line.split(",")[:3] for line in text[1:]] == [
        [f"{row['time']:.6f}", f"{row['id']:03X}", row["data"]] for row in rows
    ]
    assert [" ".join(f"{key}={value}" for key, value in row["values"].items()) for row in rows] == [
        line.rsplit(",", 1)[1] for line in text[1:]
    ]


def test_a_bus_is_left_where_its_trace_cannot_be_written(monkeypatch, tmp_path):
    closed = []
    network = SimpleNamespace(wall_clock=True, close=lambda: closed.append(True), observer_errors=[])
    monkeypatch.setattr("hw_bridge.wire.WireNetwork", lambda *_: network)
    choice = BusChoice(None, "virtual", "x", 1_000_000, {}, tmp_path / "a.xyz", tmp_path)
    with pytest.raises(SimulationError, match="no trace format"), choice.network():
        pass
    assert closed == [True]
