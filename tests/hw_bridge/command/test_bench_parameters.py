"""`twin hil get` to `monitor`: what they read, write and print on a drive without a bus, with their exit codes."""

import re
from contextlib import contextmanager
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from click.testing import CliRunner

from hw_bridge.bus import Frame
from hw_bridge.command import hil
from hw_bridge.command.bench import parameters
from hw_bridge.command.bench.look import LISTENING
from hw_bridge.command.bench.options import BusChoice
from hw_bridge.commission import nvm
from hw_bridge.commission.bus_scan import ScannedNode
from hw_bridge.dictionary import State
from hw_bridge.hardware.keys import LimitKeys
from hw_bridge.journal import ObjectChange
from hw_bridge.master import SilentError
from hw_bridge.master.restoration import Restored
from tests.hw_bridge.unconnected import WORDS, unconnected_node

SIMULATED = "simulated: true\nnodes:\n  axis: {node: 3, profile: faulhaber_v3}\n"
REAL = SIMULATED.replace("simulated: true", "interface: socketcan\nchannel: can0")
RAM = "It is lost when the drive is switched off. Keep it: twin hil store 3 -f bench.yaml"
SAVE = (0x1010, 1, int.from_bytes(b"save", "little"))
LOAD = (0x1011, 1, int.from_bytes(b"load", "little"))


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run a command on a drive; `run.node` answers by SDO, `run.session` is the session of which it is."""
    monkeypatch.setenv("TWIN_STATE", str(tmp_path / "state"))
    file = tmp_path / "bench.yaml"
    file.write_text(SIMULATED)
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]})
    for index in {entry.index for entry in node.mirror.entries() if not entry.type.form}:
        node.mirror.remove(index)  # texts, in several frames
    commands, asked, network = [], [], SimpleNamespace(now=0)

    def wait(duration, done=lambda: False):
        network.now += 0 if done() else duration

    def find(name, profile=""):
        asked.append((name, profile))
        return node

    session = SimpleNamespace(
        node=find,
        drive=find,
        nmt=lambda *command: commands.append(command),
        wait=wait,
        network=network,
        states={},
        keys={"axis": node.keys},
        commands=commands,
        asked=asked,
    )

    @contextmanager
    def sdo_session(self):
        yield session

    monkeypatch.setattr(BusChoice, "sdo_session", sdo_session)

    def run(*words, code=0, typed=None):
        done = CliRunner().invoke(hil.command, [*words, "-f", str(file)], input=typed)
        error = "" if done.exception is None or isinstance(done.exception, SystemExit) else str(done.exception)
        assert done.exit_code == code, f"{done.output}{error}"
        return " ".join((done.output + error).replace("│", " ").split()).replace(f"{tmp_path}/", "")

    run.node, run.session, run.file = node, session, file
    run.written, run.values = node.server.written, node.server.dictionary.values
    return run


def test_objects_are_read(run):
    run.values[0x607D, 1] = -1500
    assert run("get", "axis", "6064h") == "6064h.0 Position actual value 0 mm (0)"
    text = run("get", "axis", "607Dh.1", "6083h", "-p", "mclm")
    assert re.sub(r"6083h.*", "", text).startswith("607Dh.1 Software position limit: ")
    assert "-1.5 mm (-1500)" in text
    assert text.endswith("6083h.0 Profile acceleration 1 m/s^2 (1000)")
    assert run.session.asked == [("axis", ""), ("axis", "mclm")]
    text = run("get", "axis", "9999h.2", "6064h", code=1)  # the others are read all the same
    assert text == (
        "9999h.2 not in the profile node 3: 9999h.2: refused with 06020000h, no object. "
        "6064h.0 Position actual value 0 mm (0)"
    )


def test_an_object_is_set_and_stored(run):
    text = run("set", "axis", "6083h", "0.3 m/s^2", "--store")
    assert text == (
        "axis: 6083h.0 Profile acceleration: 1 m/s^2 (1000) -> 0.3 m/s^2 (300). Back: twin hil set 3 6083h.0 '1000 raw' "
        "-f bench.yaml --store All parameters are stored."
    )
    assert run.written == [(0x6083, 0, 300), SAVE]


def test_a_value_that_is_set_is_shown_first_and_can_be_set_back(run):
    text = run("set", "axis", "6083h", "0.3 m/s^2", "--dry-run")
    assert (
        text == "axis: 6083h.0 Profile acceleration: 1 m/s^2 (1000) -> 0.3 m/s^2 (300). Nothing is written (--dry-run)."
    )
    assert run.written == []
    text = run("set", "axis", "6083h", "0.3 m/s^2")
    (value,) = re.findall(r"Back: twin hil set 3 6083h.0 '(.*?)' -f bench.yaml It is lost", text)
    run("set", "axis", "6083h.0", value)
    assert [value for *_, value in run.written] == [300, 1000]


@pytest.mark.parametrize("name", ["quick_stop_deceleration", "6084h"])
@pytest.mark.parametrize("has_file", [True, False])
def test_a_stop_that_needs_more_than_the_travel_is_refused(run, name, has_file):
    """By the limits of the hardware file, without one by the drive's own."""
    if has_file:
        run.node.own.file = LimitKeys.model_validate({"position": ["-35 mm", "35 mm"], "velocity": "100 mm/s"})
    else:
        run.values.update({(0x607D, 1): -35_000, (0x607D, 2): 35_000, (0x607F, 0): 100})
    text = run("set", "axis", name, "1 mm/s^2", code=1)
    assert "0.001 m/s^2 takes 5000 mm to stop from 100 mm/s, but the travel is 70 mm." in text
    assert "At least 0.07143 m/s^2 is possible." in text
    assert run.written == []
    run("set", "axis", name, "72 mm/s^2")
    assert [value for *_, value in run.written] == [72]


def test_what_a_killed_run_left_is_told_before_values_are_set_or_stored(run, monkeypatch):
    monkeypatch.setattr(nvm, "unrestored_objects", lambda *_: [ObjectChange(0x6065, 0, b"\1")])
    monkeypatch.setattr(parameters, "is_terminal", lambda: True)
    left = "axis: a killed run left 1 object as it wrote it (6065h.0). Restore it: twin hil restore 3"
    text = run("set", "axis", "6083h", "0.3 m/s^2")
    assert text.startswith(f"warning: {left} -f bench.yaml axis: 6083h.0")
    assert text.endswith("It is lost when the drive is switched off.")
    run.written.clear()
    assert run("store", "axis", code=1).startswith(left)  # no table, no question
    assert run("set", "axis", "6083h", "0.4 m/s^2", "--store", code=1).startswith(left)
    assert run.written == []


def test_outputs_are_compared_but_not_restored(run, tmp_path):
    file = tmp_path / "a.dcf"
    run("dump", "axis", str(file))
    outputs = file.read_text(encoding="latin-1").partition("[60FEsub1]")[2].partition("[")[0]
    assert "ParameterValue" not in outputs  # another tool that downloads the file does not switch them
    run.values[0x60FE, 1] = 1
    note = "note: 60FEh.1 Physical outputs differs; outputs are not restored: they would switch."
    text = run("compare", "axis", str(file), code=1)
    assert "60FEh.1 Physical outputs 1 0" in text
    assert text.endswith(note)
    assert run("restore", "axis", str(file)) == f"{note} axis: 0 changed, 0 refused."
    assert run.written == []


@pytest.mark.parametrize(
    ("text", "words", "refused"),
    [
        (REAL, ["60FEh.1"], "switches outputs at once"),
        (REAL, ["60FEh.1", "--arm"], ""),
        (SIMULATED, ["60FEh.1"], ""),
        (REAL, ["6083h"], ""),
        (REAL, ["2999h.2"], "is not in the profile, and may act at once"),
    ],
)
def test_what_may_switch_an_output_needs_arm(run, text, words, refused):
    run.file.write_text(text)
    name, *more = words
    shown = run("set", "axis", name, "1 raw", *more, code=1 if refused else 0)
    if refused:
        assert f"axis: {name} {refused}. Nothing was written. Add --arm if nobody is in the way" in shown
    assert len(run.written) == (not refused)


@pytest.mark.slow
def test_a_dump_is_compared_and_restored(run, tmp_path):
    file = tmp_path / "a.dcf"
    text = run("dump", "axis", str(file))
    count = file.read_text(encoding="latin-1").count("ParameterValue=")
    drive = "node 3 (axis): FAULHABER Motion Control V3.0, serial 1h"
    assert text == f"{drive} a.dcf: {count} values of axis."
    assert count > 50
    assert "Baudrate=1000\n" in file.read_text(encoding="latin-1")
    assert run("compare", "axis", str(file)) == f"{drive} axis: all values equal a.dcf."
    run.values[0x6083, 0] = 300
    text = run("compare", "axis", str(file), code=1)
    assert re.sub(r"-+ ", "", text) == (
        f"{drive} object name drive file 6083h.0 Profile acceleration 0.3 m/s^2 (300) 1 m/s^2 (1000)"
    )
    text = run("restore", "axis", str(file))
    assert text == f"changed: 6083h.0 Profile acceleration axis: 1 changed, 0 refused. {RAM}"
    assert run.session.commands == [(0x80, 3)]
    assert run.written == [(0x6083, 0, 1000)]
    assert run("restore", "axis", str(file)) == "axis: 0 changed, 0 refused."
    assert run("restore", "axis", str(file), "--store").endswith("0 refused. All parameters are stored.")
    assert run.written == [(0x6083, 0, 1000), SAVE]
    run.values[0x6083, 0] = 300
    run.node.server.refused.add((0x6083, 0))
    text = run("restore", "axis", str(file), "--store", code=1)
    assert text.startswith("refused: axis: node 3: 6083h.0: refused with 06010002h")
    assert text.endswith("axis: 0 changed, 1 refused.")
    assert len(run.written) == 2


def test_a_dump_of_another_drive_is_refused(run, tmp_path):
    file = tmp_path / "a.dcf"
    run("dump", "axis", str(file))
    before = file.read_bytes()
    run.values[0x1018, 2] = 5
    assert run("dump", "axis", str(file), code=1).startswith("a.dcf: exists, and may be the only copy")
    assert file.read_bytes() == before
    assert "values of axis" in run("dump", "axis", str(file), "--force")
    assert file.read_bytes() != before
    file.write_bytes(before)
    other = "axis: product code is 5h, the file is of "
    assert run("compare", "axis", str(file), code=1).startswith(f"differs: {other}")
    for word in ("restore", "store"):
        assert run(word, "axis", str(file), code=1).startswith(other)
    assert run.written == []


def test_objects_that_a_drive_does_not_have_are_told_in_a_dump(run, tmp_path):
    run.node.server.missing.add((0x6083, 0))
    assert run("dump", "axis", str(tmp_path / "a.dcf")).endswith(
        "note: not there: 6083h.0 Profile acceleration: no object"
    )


def test_what_is_stored_is_shown_beside_a_dump(run, tmp_path):
    assert run("store", "axis") == (
        "note: there is no dump of this drive to compare with. Take one before you change it: twin hil dump "
        "axis -f bench.yaml before.dcf axis: all parameters are stored."
    )
    file = tmp_path / "a.dcf"
    run("dump", "axis", str(file))
    stored = "axis: all parameters are stored."
    assert run("store", "axis") == f"axis: 0 objects differ from its last dump: {stored}"
    run.values[0x6083, 0] = 300
    text = re.sub(r"-+ ", "", run("store", "axis", str(file)))
    assert text == (
        "axis: 1 objects differ from a.dcf: object name drive dump "
        f"6083h.0 Profile acceleration 0.3 m/s^2 (300) 1 m/s^2 (1000) {stored}"
    )
    assert run.written == [SAVE] * 3


def test_a_terminal_asks_before_values_are_stored(run, monkeypatch):
    monkeypatch.setattr(parameters, "is_terminal", lambda: True)
    question = "axis keeps these values when it is switched off. Go on? [y/N]: "
    assert run("store", "axis", typed="n\n", code=1).endswith(f"{question}n Aborted!")
    assert run.written == []
    assert run("store", "axis", typed="y\n").endswith(f"{question}y axis: all parameters are stored.")
    assert question not in run("store", "axis", "--yes")
    assert run.written == [SAVE] * 2


@pytest.mark.parametrize(
    ("results", "code", "text"),
    [
        ({"3": None, "5": None}, 0, "No run left anything to restore."),
        (
            {"3": Restored(["6083h.0", "6085h.0"]), "5": None},
            0,
            "axis: 2 objects are as before the run, 0 are not. As before: 6083h.0, 6085h.0.",
        ),
        (
            {"3": Restored(["6083h.0"], failed=["axis: why"]), "5": None},
            1,
            "not restored: axis: why axis: 1 objects are as before the run, 1 are not. As before: 6083h.0.",
        ),
        (
            {"3": Restored(foreign=["axis: other"]), "5": Restored()},
            1,
            (
                "not restored: axis: other axis: 0 objects are as before the run, 1 are not. "
                "axis: 0 objects are as before the run, 0 are not."
            ),
        ),
    ],
)
def test_what_runs_left_is_restored_in_every_node_that_answers(run, monkeypatch, results, code, text):
    nodes = [ScannedNode(3), ScannedNode(4, problem="mute"), ScannedNode(5)]
    monkeypatch.setattr("hw_bridge.commission.scan", lambda session: nodes)
    left = iter(results.values())
    monkeypatch.setattr("hw_bridge.commission.nvm.restore_journal", lambda *_: next(left))
    assert run("restore", code=code) == text
    assert run.session.asked == [("3", ""), ("5", "")]
    left = iter([None])
    assert run("restore", "axis") == "No run left anything to restore."


def test_defaults_are_asked_for(run):
    question = "axis (FAULHABER Motion Control V3.0) forgets motor, loops and limits. Go on? [y/N]: "
    later = "axis: has its defaults when it is started anew (--restart, or switch it off and on)."
    assert run("defaults", "axis", typed="n\n", code=1) == f"{question}n Aborted!"
    assert run.written == []
    assert run("defaults", "axis", typed="y\n") == f"{question}y {later}"
    assert run("defaults", "axis", "--yes") == later
    assert run.written == [LOAD] * 2
    run.session.nmt = lambda *command: run.session.states.update({3: 0}) or run.session.commands.append(command)
    assert run("defaults", "axis", "--yes", "--restart") == "axis: has its defaults."
    assert run.session.commands == [(0x81, 3)]


@pytest.mark.parametrize("state", State)
def test_the_status_of_a_drive_decides_the_exit_code(run, state):
    run.values[0x6041, 0] = WORDS[state]
    in_fault = state in (State.FAULT, State.REACTION)
    text = run("status", "axis", "-p", "mclm", code=1 if in_fault else 0)
    assert text.startswith(f"node 3 (axis): FAULHABER Motion Control V3.0, serial 1h power 6041h Statusword {state}")
    assert text.endswith(" errors none")
    assert run.session.asked == [("axis", "mclm")]
    assert "motion 6064h Position actual value 0 mm (0)" in text


def test_errors_of_a_drive_with_remedies(run):
    run.values |= {(0x603F, 0): 0x8611, (0x6041, 0): WORDS[State.FAULT]}
    assert run("status", "axis", code=1).endswith(
        "errors 8611h following error. It cannot follow: look for a jam, lower velocity and acceleration, check 6065h."
    )
    run.node.mirror.remove(0x6041)
    assert "Statusword" not in run("status", "axis")


def test_values_are_shown_again_and_again(run):
    text = run("monitor", "axis", "--for", "0.4", "--every", "0.2")
    assert re.findall(r"\d\.\d s q ends it", text) == ["0.0 s q ends it", "0.2 s q ends it", "0.4 s q ends it"]
    assert text.count("axis 6041h Statusword Switch on disabled; remote (0240h) 6061h Modes of operation display") == 3
    run.session.asked.clear()
    run("monitor", "--for", "0")
    assert run.session.asked == [("axis", "")]
    run.session.keys.clear()
    assert "Name at least one NODE" in run("monitor", "--for", "0", code=2)


def test_a_monitor_that_has_to_be_alone(run, monkeypatch):
    """It listens before it reads, and ends when another program reads or commands the drive, which is told."""
    assert '["1018h.4' in run("monitor", "axis", "--for", "0", "--json")
    with monkeypatch.context() as patch:
        patch.setattr("hw_bridge.commission.objects.learn", Mock(side_effect=SilentError("node 3")))
        assert "no answer check its power" in run("monitor", "axis", "--for", "0")
    plain, waits, frames = run.session.wait, [], []

    def wait(duration, done=lambda: False):
        waits.append(duration)
        for frame in frames[len(waits) - 1 : len(waits)]:
            run.session.network.hear(frame)
        plain(duration, done)

    run.session.wait = wait
    assert run("monitor", "axis", "--for", "0.1", "--alone").count("Switch on disabled") == 1
    assert waits[0] == LISTENING
    reading = Frame(0x603, bytes([0x40, 0x41, 0x60, 0, 0, 0, 0, 0]))
    for frames[:], text in (([reading], "another program on the bus reads axis."), ([Frame(0x80)], "sent SYNC.")):
        waits.clear()
        told = run("monitor", "axis", "--alone", code=1)
        assert text in told
        assert "Statusword" not in told


def test_nodes_of_a_scan(run, monkeypatch):
    nodes = [
        ScannedNode(3, "a drive", (0x147, 2, 0xAB, 4), "Switch on disabled", ""),
        ScannedNode(4, problem="answers no SDO"),
        ScannedNode(5, "another", (1, 2, 3, 4), "", "8611h following error."),
    ]
    monkeypatch.setattr("hw_bridge.commission.scan", lambda session: nodes)
    assert run("scan", code=1) == (
        "node 3 (axis): a drive vendor 147h, product 2h, revision ABh, serial 4h Switch on disabled "
        "node 4: not understood answers no SDO "
        "node 5: another vendor 1h, product 2h, revision 3h, serial 4h 8611h following error. "
        "differs: node 4 is not in the hardware file. Add it, or take it off the bus. "
        "differs: node 5 is not in the hardware file. Add it, or take it off the bus."
    )
    nodes[1:] = [ScannedNode(127, problem="the master of a run")]
    assert run("scan").endswith("node 127: heartbeat of a program that commands drives, such as twin hil or twin run")
    nodes[0] = ScannedNode(1, "a drive")
    assert run("scan", code=1).endswith(
        "differs: axis: node 3 does not answer. Check its power and node-ID. "
        "differs: node 1 is not in the hardware file. Add it, or take it off the bus."
    )
    nodes.clear()
    assert run("scan", code=1).startswith("No node answers. Is the power on?")
