"""`twin hil check` and `reset`: differences between a bus and a hardware file, without a bus."""

import re
import sys
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from hw_bridge.bus import MILLISECOND
from hw_bridge.command import hil
from hw_bridge.commission import planned_rows, softer_stop
from hw_bridge.commission.bus_scan import DUPLICATE_ID, ScannedNode
from hw_bridge.dictionary import State
from hw_bridge.hardware import HardwareKeys, load
from hw_bridge.journal import ObjectChange
from hw_bridge.master import setup
from hw_bridge.master.activity import active_drives
from hw_bridge.master.plan import plan_drive
from tests.every_case import every_case
from tests.hw_bridge.unconnected import WORDS, unconnected_node

FILE = "simulated: true\nnodes:\n  axis: {node: 3, profile: faulhaber_v3}\n  other: {node: 4, profile: mclm}\n"


def keys_of(node):
    return HardwareKeys(simulated=True, nodes={"axis": node.keys})


class Bench:
    """A master and a scan that tell what a test sets. `node`: the drive `axis`; `other` does not answer by SDO."""

    def __init__(self, file):
        self.node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]})
        self.scanned = [ScannedNode(3, "a drive"), ScannedNode(4, "another drive")]
        self.compared, self.plans, self.active, self.foreign, self.closed = {}, [], [], "", 0
        self.waits, self.looked = [], []
        self.file = file

    def master(self, keys, network):
        other = SimpleNamespace(name="other", number=4, doubled="", absent=[0x6085], rotary=None)
        self.other, self.node.absent = other, [0x6080]
        return SimpleNamespace(
            nodes={"axis": self.node, "other": other},
            stations={"axis": self.node, "other": other},
            wait=lambda duration, done=None: self.waits.append(duration),
            compare=lambda node: self.compared.get(node.name, []),
            foreign_master=SimpleNamespace(action=self.foreign, text=self.foreign),
            network=SimpleNamespace(close=self.close),
        )

    def close(self):
        self.closed += 1


@pytest.fixture
def bench(tmp_path, monkeypatch):
    file = tmp_path / "bench.yaml"
    file.write_text(FILE)
    made = Bench(file)
    monkeypatch.setattr(hil, "bench_network", lambda *_: "network")
    monkeypatch.setattr(hil, "SdoSession", lambda network: "session")
    monkeypatch.setattr(hil, "scan", lambda session, left_out: made.looked.append(left_out) or made.scanned)
    monkeypatch.setattr(hil, "unready", lambda _, node: made.plans.append(node.name) or hil.Findings())
    monkeypatch.setattr("hw_bridge.master.Master", made.master)
    monkeypatch.setattr(
        "hw_bridge.master.active_drives", lambda nodes, _: made.active.append([n.name for n in nodes]) or []
    )
    return made


@pytest.mark.parametrize(
    ("changes", "problems", "planned", "active"),
    [
        ({}, [], ["axis", "other"], ["axis", "other"]),
        (
            {"scanned": [ScannedNode(3, "a drive")]},
            ["other: node 4 does not answer. Check its power and node-ID."],
            ["axis"],
            ["axis"],
        ),
        (
            {"scanned": [ScannedNode(3, "a drive"), ScannedNode(4, problem=f"2 {DUPLICATE_ID}")]},
            [f"other: node 4: 2 {DUPLICATE_ID}. Give one of them another."],
            ["axis"],
            ["axis", "other"],
        ),
        ({"compared": {"axis": ["axis: differs."]}}, ["axis: differs."], ["other"], ["axis", "other"]),
        (
            {"scanned": [ScannedNode(3, "a"), ScannedNode(4, "b"), ScannedNode(9, "c")], "foreign": "another master."},
            ["node 9 is not in the hardware file. Add it, or take it off the bus.", "another master."],
            ["axis", "other"],
            ["axis", "other"],
        ),
    ],
)
def test_every_difference_between_a_bus_and_its_file(bench, capsys, changes, problems, planned, active):
    for name, value in changes.items():
        setattr(bench, name, value)
    absent = {}
    keys = load(bench.file)
    assert hil.compare_bus(keys, bench.file.parent, {"axis": True}, absent).problems == problems
    assert (bench.plans, bench.active) == (planned, [active])
    assert absent == {"axis": [0x6080], "other": [0x6085]}
    assert (bench.node.rotary, bench.other.rotary) == (True, False)
    assert (bench.waits, bench.looked, bench.closed) == ([500 * MILLISECOND], [[keys.master]], 1)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines] == [f"node {scanned.node}" for scanned in bench.scanned]


def test_a_doubled_drive_is_not_asked_whether_it_moves(bench):
    bench.node.sdo.doubled = True
    hil.compare_bus(load(bench.file), bench.file.parent)
    assert bench.active == [["other"]]


def test_the_command_shows_limits_and_differences(bench):
    done = CliRunner().invoke(hil.command, ["check", "-f", str(bench.file), "--verbose"])
    assert done.exit_code == 0
    lines = done.output.splitlines()
    assert lines[0].startswith("node 3: a drive")
    assert [line for line in lines if line.endswith("effect of each limit")] == [
        "axis: effect of each limit",
        "other: effect of each limit",
    ]
    assert lines[-1] == "Bus and hardware file agree."
    bench.scanned.pop()
    done = CliRunner().invoke(hil.command, ["check", "-f", str(bench.file)])
    assert done.exit_code == 1
    node, difference, verdict = done.output.splitlines()
    assert difference == "differs: other: node 4 does not answer. Check its power and node-ID."
    assert node == lines[0]
    assert verdict == "Bus and hardware file differ. Above the tables: differences 1, notes 0."


def test_what_a_run_would_write_is_shown(capsys):
    """With the inspected objects, notes and wider limits; an absurd limit, a fault and a refused object are problems."""
    node = unconnected_node(
        values={(0x6041, 0): WORDS[State.FAULT], (0x603F, 0): 0x4310},
        missing=[0x605E],
        objects={"605Eh": 1},
        limits={"velocity": "2.5 m/s", "acceleration": "900 m/s^2", "force": "19 N"},
    )
    master = SimpleNamespace(keys=keys_of(node), plan=lambda station: plan_drive(station, 5 * MILLISECOND, 127))
    planned = planned_rows(plan_drive(node, 5 * MILLISECOND, 127))
    findings = hil.unready(master, node)
    assert findings.problems == [
        (
            "axis: node 3: 605Eh.0: refused with 06020000h, no object. A run writes it. Correct the hardware file or the "
            "profile."
        ),
        "axis: is in Fault, 603Fh: 4310h temperature.",
    ]
    findings.show()
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    labels = [line.partition(":")[0] for line in lines if line.startswith(("differs: ", "note: ", "axis: "))]
    assert labels == ["differs"] * 2 + ["note"] * len(findings.notes) + ["axis"] * len(findings.tables)
    text = " ".join(" ".join(lines).split())
    counts = re.search(r"axis: a run writes (\d+) objects, (\d+) of them .* at its end\. (\d+) have", text)
    total, passing, count = map(int, counts.groups())
    assert (
        total
        == passing + count
        == len({(write.index, write.sub) for write in plan_drive(node, 5 * MILLISECOND, 127).writes})
    )
    assert "without it the drive's current limit does, 18.39 N as it is set." in text
    assert text.count("limits.velocity") >= 3
    assert f"{count} have another value during the run: object name before after why" in text
    assert "axis: stop, unchanged unless the hardware file sets it:" in text
    assert "note: axis: limits.velocity 2500 mm/s is above the drive's own 2000 mm/s (6080h)." in text
    findings.show(verbose=False)
    brief = capsys.readouterr().out
    assert len(brief.splitlines()) < 50
    assert all(row.object in brief for row in planned if not hil.PDO_OBJECT.match(row.object))
    assert "17 more  PDOs, 1400h.2 to 1A01h.2" in brief
    assert "limits.velocity" not in brief.partition("object ")[2]


def test_the_drives_own_position_limits_are_shown_from_home_too(capsys):
    """The number in the drive counts from its own zero and is a tenth wider: it looks wrong beside the file's."""
    limits = {"position": ["-35 mm", "35 mm"], "acceleration": "3 m/s^2"}
    node = unconnected_node(limits=limits, units={"acceleration": "1 mm/s^2"}, homing={"method": -3, "at": "-40 mm"})
    master = SimpleNamespace(keys=keys_of(node), plan=lambda station: plan_drive(station, 5 * MILLISECOND, 127))
    hil.unready(master, node).show(verbose=False)
    text = " ".join(capsys.readouterr().out.split())
    assert "607Dh.1 Min position limit no limit -2 mm in the drive, -42 mm from home 607Dh.2" in text
    assert "82 mm in the drive, 42 mm from home" in text
    assert (
        "607Dh counts in the drive from where homing sets it to 0, and is written then. It is a tenth of the range"
        in text
    )
    assert "A jog or move writes and restores the same without those of homing, and 607Dh" in text


@pytest.mark.parametrize(("own", "is_softer"), [(10_000, True), (3_000, False), (2_000, False)])
def test_a_quick_stop_that_is_softer_than_the_drives_own_is_noted(own, is_softer):
    node = unconnected_node(
        values={(0x6085, 0): own}, limits={"acceleration": "3 m/s^2"}, units={"acceleration": "1 mm/s^2"}
    )
    note = (
        "axis: during a run the quick stop brakes with 3 m/s^2 (limits.acceleration), softer than the drive's own 10 m/s^2 "
        "(6085h). If the machine bears more, raise limits.acceleration."
    )
    assert softer_stop(plan_drive(node, 5 * MILLISECOND, 127)) == [note] * is_softer


def test_what_a_killed_command_left_is_a_problem(monkeypatch, tmp_path):
    """Its error and its journal come first; the values before it are those that are restored."""
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED], (0x1001, 0): 0x11}, objects={"6067h": 50})
    keys = keys_of(node).model_copy(update={"simulated": False})
    master = SimpleNamespace(keys=keys, plan=lambda station: plan_drive(station, 5 * MILLISECOND, 127))
    node.server.dictionary.values[0x6067, 0] = 50  # as the killed command wrote it
    left = [ObjectChange(0x6067, 0, b"\x07\0\0\0")]
    monkeypatch.setattr("hw_bridge.commission.nvm.unrestored_objects", lambda *_: left)
    findings = hil.unready(master, node)
    assert findings.problems[0].startswith("axis: reports an earlier error (1001h is 11h)")
    assert findings.problems[1].startswith(
        "axis: a killed run left 1 object as it wrote it (6067h.0). Restore it: twin hil restore 3 -f FILE."
    )
    before = next(row[2:4] for row in findings.tables[0][1] if row[0] == "6067h.0")
    assert [text.partition(" ")[0] for text in before] == ["0.007", "0.05"]


@pytest.mark.parametrize("words", [["check", "-f", "FILE"], ["reset", "-f", "FILE", "axis"], ["reset", "-f", "FILE"]])
def test_the_hardware_file_is_an_option_too(monkeypatch, tmp_path, words):
    opened = []
    monkeypatch.setattr("hw_bridge.command.bench.options.load", lambda path: opened.append(path) or sys.exit(7))
    line = [str(tmp_path / "b.yaml") if word == "FILE" else word for word in words]
    assert CliRunner().invoke(hil.command, line).exit_code == 7
    assert opened == [tmp_path / "b.yaml"]
    monkeypatch.setenv("TWIN_HARDWARE", str(tmp_path / "set.yaml"))
    for each in (line, [word for word in line if word not in ("-f", line[2])]):
        assert CliRunner().invoke(hil.command, each).exit_code == 7
    assert opened[1:] == [tmp_path / "b.yaml", tmp_path / "set.yaml"]  # what is typed counts
    monkeypatch.delenv("TWIN_HARDWARE")
    for wrong in ([words[0]], [words[0], "a.yaml", "axis", "-f", "x"]):
        assert CliRunner().invoke(hil.command, wrong).exit_code == 2


def test_an_absurd_limit_is_a_problem():
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]}, limits={"velocity": "21 m/s"})
    master = SimpleNamespace(keys=keys_of(node), plan=lambda station: plan_drive(station, 5 * MILLISECOND, 127))
    assert hil.unready(master, node).problems == [
        f"axis: limits.velocity 21000 mm/s is above the drive's own 2000 mm/s ({index}). Correct the unit or the number."
        for index in ("6080h", "607Fh")
    ]


@pytest.mark.parametrize(
    ("values", "problems", "after", "is_free", "text"),
    [
        ({}, [], State.DISABLED, True, "axis: is not in Fault."),
        (
            {(0x6041, 0): WORDS[State.FAULT], (0x603F, 0): 0x4310},
            [],
            State.DISABLED,
            True,
            "axis: is in Fault, 603Fh: 4310h temperature. Reset: Switch on disabled.",
        ),
        (
            {(0x6041, 0): WORDS[State.FAULT]},
            [],
            State.FAULT,
            False,
            "axis: is in Fault, and does not say why. Reset: Fault. Its cause is still there.",
        ),
        (
            {(0x1001, 0): 0x10},
            [],
            State.DISABLED,
            True,
            "axis: reported an earlier error (1001h is 10h). Reset: Switch on",
        ),
        ({(0x6041, 0): WORDS[State.FAULT]}, ["another.", "wrong."], None, False, "differs: another. wrong."),
        (
            {(0x6041, 0): WORDS[State.ENABLED], (0x1001, 0): 0x10},
            [],
            None,
            False,
            "differs: axis: is in Operation enabled: somebody drives it.",
        ),
    ],
)
def test_a_drive_leaves_fault(capsys, values, problems, after, is_free, text):
    node = unconnected_node(values={(0x6041, 0): WORDS[State.DISABLED]} | values)
    master = SimpleNamespace(compare=lambda _: problems)
    plain = node.sdo.write

    def write(index, sub, data, *more):
        plain(index, sub, data, *more)
        if (index, data) == (0x6040, b"\x80\0"):
            node.server.dictionary.values[0x6041, 0] = WORDS[after]

    node.sdo.write = write
    assert hil.reset_drive(master, node) is is_free
    assert bool(node.server.written) is (after is not None and "is not in Fault" not in text)
    assert " ".join(capsys.readouterr().out.split()).startswith(text)


def test_what_is_not_restored_is_told_after_a_reset(capsys, monkeypatch, tmp_path):
    left = {"axis": [ObjectChange(0x6083, 0, b"\1"), ObjectChange(0x1600, 1, b"\1")], "other": []}
    monkeypatch.setattr("hw_bridge.commission.nvm.unrestored_objects", lambda node, _: left[node.name])
    file = tmp_path / "b.yaml"
    file.write_text("interface: socketcan\nchannel: can0\nnodes:\n  axis: {node: 3, profile: faulhaber_v3}\n")
    for name, changes in left.items():
        names = hil.note_leftovers(hil.BusChoice(file), SimpleNamespace(name=name, number=3))
        assert names == {change.name for change in changes}
    text = " ".join(capsys.readouterr().out.split())
    assert text == (
        f"note: axis: a killed run left 2 objects as it wrote them (6083h.0, 1600h.1). Restore them: twin hil restore 3 -f {file}"
    )
    file.write_text("simulated: true\nnodes:\n  axis: {node: 3, profile: faulhaber_v3}\n")
    assert hil.note_leftovers(hil.BusChoice(file), SimpleNamespace(name="axis", number=3)) == set()  # a new drive


@every_case(
    ("state", "distance", "text"),
    [
        (State.DISABLED, 32, ""),  # four increments of the sensor in 50 ms are noise
        (
            State.DISABLED,
            -33,
            (
                "axis: moves at 0.66 mm/s although it has no power (Switch on disabled). Nothing was written. Does its "
                "axis fall, or does somebody push it? Secure it: brake, counterweight."
            ),
        ),
        (
            State.ENABLED,
            0,
            (
                "axis: is in Operation enabled: another program drives it, or left it so. Nothing was written. End that "
                "program; `twin hil disable 3` brings it to rest with its ramp."
            ),
        ),
        (State.QUICK_STOP, 500, "axis: is in Quick stop active and moves at 10.00 mm/s: another program drives it"),
        (State.REACTION, 0, "axis: is in Fault reaction active: another program drives it"),
        (State.SWITCHED_ON, 0, ""),
    ],
)
def test_drives_that_are_enabled_or_move(state, distance, text):
    node = unconnected_node(values={(0x6041, 0): WORDS[state], (0x6064, 0): 5})
    waits = []

    def wait(duration):
        waits.append(duration)
        node.server.dictionary.values[0x6064, 0] += distance

    found = active_drives([node], wait)
    assert [line[: len(text)] for line in found] == ([text] if text else [])
    assert waits == [50 * MILLISECOND]
    assert node.server.written == []
    assert setup.faults(node) == ("" if state is not State.REACTION else "axis: is in Fault, and does not say why.")
