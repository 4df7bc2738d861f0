"""Every drive is left as it was found, however a run ends; nothing is written that is not in the journal before.

Over 400 lines: every way in which a run ends, on the same bench.
"""

import ast
import json
from pathlib import Path

import pytest

from hw_bridge.bus import Bus, Disturbance, Kind, SimulatedNetwork
from hw_bridge.commission import SdoSession, dcf, nvm, objects
from hw_bridge.device import Drive, Module, Motor
from hw_bridge.dictionary import Mode, State
from hw_bridge.hardware import HardwareKeys
from hw_bridge.journal import bus_folder
from hw_bridge.master import Master, SdoClient, setup
from hw_bridge.profiles import DRIVE_PROFILES, device, profile
from tests.hw_bridge.profiles import USUAL, fast
from tests.hw_bridge.values import each_write, held
from twin.errors import SimulationError

ROOT = Path(__file__).parents[3]
UNITS = {
    "epos4": {
        "limits": {
            "following_error": "10 deg",
            "position": ["-1 turn", "1 turn"],
            "velocity": "5 rad/s",
            "acceleration": "50 rad/s^2",
            "force": "0.5 N*m",
        }
    }
}
START = {"axis": 0.0}


class KilledError(BaseException):
    """No handler runs after it."""


@pytest.fixture(autouse=True)
def state(monkeypatch, tmp_path):
    monkeypatch.setenv("TWIN_STATE", str(tmp_path))
    return tmp_path


class RealBench:
    """A drive and a module on a bus that lives on when the master is gone, as real ones do."""

    def __init__(self, name, build, **more):
        chosen = profile(name)
        self.drive = Drive(chosen, 1, Motor(chosen.motor, build=build))
        self.module = Module(device("cia401"), 9)
        self.bus = Bus()
        self.bus.attach(self.drive)
        self.bus.attach(self.module)
        self.keys = HardwareKeys.model_validate(
            {
                "interface": "socketcan",
                "channel": "can0",
                "nodes": {"axis": {"node": 1, "profile": name, **UNITS.get(name, {}), **more}},
                "modules": {"valves": {"node": 9, "outputs": {0: "a.b"}, "safe_outputs": 1}},
            }
        )
        self.network = SimulatedNetwork(self.bus)
        self.bus.advance(500_000_000)
        self.before = held(self.drive), held(self.module)

    @property
    def now(self):
        return held(self.drive), held(self.module)

    def master(self):
        self.network = SimulatedNetwork(self.bus)
        return Master(self.keys, self.network)

    def line(self):
        return SdoSession(SimulatedNetwork(self.bus), self.keys.nodes | self.keys.modules)

    def journals(self):
        return sorted(bus_folder("socketcan", "can0", software=False).glob("*.jsonl"))


@pytest.fixture(params=fast(USUAL))
def name(request):
    return request.param


@pytest.fixture
def bench(name, build):
    return RealBench(name, build)


def killed(master):
    """The process is gone: what it held open is closed by the system."""
    for station in master.stations.values():
        if station.journal.file is not None:
            station.journal.file.file.close()


def changed(bench):
    return bench.now != bench.before


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_after_a_run(bench):
    master = bench.master()
    master.begin(START)
    assert bench.drive.state is State.ENABLED
    assert changed(bench)
    assert len(bench.journals()) == 2
    master.stop()
    assert master.notes == []
    assert bench.now == bench.before
    assert bench.journals() == []
    assert "objects were changed for the run and are as before" in master.restorations[0]


@pytest.mark.parametrize("mode", [Mode.CSV, Mode.CSP, Mode.PP])
def test_a_mode_that_another_program_left_is_restored_whatever_the_run_commands(build, mode):
    """Also where the run begins in the same one: process data change it."""
    bench = RealBench("faulhaber_v3", build)
    bench.drive.dictionary.download(0x6060, 0, bytes([mode]))
    master = bench.master()
    master.begin(START)
    for commanded in (Mode.CSP, Mode.CSV, Mode.CSP):
        master.nodes["axis"].mode = commanded
        master.run_cycle()
    assert bench.drive.dictionary.get(0x6060) == Mode.CSP
    master.stop()
    assert (bench.drive.dictionary.get(0x6060), master.notes) == (mode, [])


def test_after_an_interrupt(bench):
    master = bench.master()
    with pytest.raises(KeyboardInterrupt):
        try:
            master.begin(START)
            raise KeyboardInterrupt
        finally:
            master.stop()
    assert bench.now == bench.before
    assert bench.journals() == []


@pytest.mark.slow
@pytest.mark.parametrize("share", fast(0.5, of=(0.05, 0.5, 0.95)))
def test_after_a_failed_bringing_up(bench, share):
    count = written(bench)
    master = bench.master()
    fails_at(master, int(share * count), SimulationError("the bus was jammed"))
    with pytest.raises(SimulationError, match="jammed"):
        try:
            master.begin(START)
        finally:
            master.stop()
    assert bench.now == bench.before
    assert bench.journals() == []


def written(bench):
    """So many writes a bringing up makes."""
    seen = []
    each_write(bench.drive, lambda *one: seen.append(one))
    master = bench.master()
    master.begin(START)
    count = len(seen)
    master.stop()
    assert bench.now == bench.before
    return count


def fails_at(master, number, error):
    """Raise instead of the write of this number to the drive, once."""
    client = master.nodes["axis"].sdo
    plain, count = client.write, []

    def write(*arguments):
        count.append(1)
        if len(count) == number + 1:
            raise error
        plain(*arguments)

    client.write = write


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("share", fast(0.3, 0.98, of=(0.02, 0.3, 0.6, 0.98)))
def test_killed_while_it_was_brought_up_and_restored_by_a_command(bench, share):
    abandoned(bench, int(share * written(bench)))
    check_restored(bench)


@pytest.mark.slow
def test_killed_at_every_write(bench):
    """Each of them, also in the middle of a mapping."""
    count = written(bench)
    assert count > 20
    for number in range(count):
        abandoned(bench, number)
        check_restored(bench)


def abandoned(bench, number):
    """A process that is killed at its n-th write."""
    master = bench.master()
    fails_at(master, number, KilledError())
    with pytest.raises(KilledError):
        master.begin(START)
    killed(master)


def check_restored(bench):
    line = bench.line()
    for name in ("axis", "valves"):
        node = line.node(name)
        if (found := nvm.restore_journal(line, node, bus_folder("", "", software=False))) is not None:
            assert found.failed == found.foreign == []
    if bench.drive.state is State.FAULT:  # it missed the heartbeat
        setup.reset(line.drive("axis"))
    assert bench.now == bench.before
    assert bench.journals() == []


@pytest.mark.slow
def test_killed_and_restored_by_the_next_run(bench):
    master = bench.master()
    master.begin(START)
    killed(master)
    bench.bus.advance(bench.bus.now + 2_000_000_000)  # the drive misses the heartbeat, and trips
    assert changed(bench)
    line = bench.line()
    node = line.drive("axis")
    setup.reset(node)
    again = bench.master()
    again.begin(START)
    told = [text for text in again.recovered if "ended without restoring" in text]
    assert len(told) == 2
    again.stop()
    assert again.notes == []
    assert bench.now == bench.before
    assert bench.journals() == []


def test_a_drive_that_was_switched_off_meanwhile_has_nothing_to_restore(bench):
    master = bench.master()
    master.begin(START)
    killed(master)
    for number in (1, 9):
        bench.line().nmt(0x81, number)
    bench.bus.advance(bench.bus.now + 1_000_000_000)
    assert bench.now == bench.before
    writes = []
    each_write(bench.drive, lambda *one: writes.append(one))
    check_restored(bench)
    assert writes == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", fast(0, of=range(3)))
def test_frames_may_be_lost_meanwhile(build, seed):
    """Two of a hundred requests and answers."""
    bench = RealBench("faulhaber_v3", build)
    bench.bus._chance.seed(seed)
    master = bench.master()
    master.begin(START)
    bench.bus.disturbances.append(Disturbance(Kind.DROP, 0x580, 0x67F, share=0.02))
    master.stop()
    assert master.notes == []
    assert bench.now == bench.before


@pytest.mark.slow
def test_a_journal_is_not_applied_to_a_drive_with_another_serial_number(bench):
    master = bench.master()
    master.begin(START)
    killed(master)
    bench.bus.advance(bench.bus.now + 2_000_000_000)
    bench.drive.dictionary.values[0x1018, 4] = 99
    left = bench.now[0]
    line = bench.line()
    assert nvm.restore_journal(line, line.drive("axis"), bus_folder("", "", software=False)) is None
    assert bench.now[0] == {**left, (0x6060, 0): bench.now[0][0x6060, 0]}
    assert len(bench.journals()) == 2


@pytest.mark.slow
def test_a_damaged_journal_stops_the_next_run_before_it_writes(bench):
    master = bench.master()
    master.begin(START)
    killed(master)
    bench.bus.advance(bench.bus.now + 2_000_000_000)
    path = next(one for one in bench.journals() if one.stem.endswith("node1"))
    path.write_bytes(path.read_bytes().replace(b'"before"', b'"befure"', 1))
    before = path.read_bytes()
    setup.reset(bench.line().drive("axis"))
    writes = []
    each_write(bench.drive, lambda *one: writes.append(one))
    again = bench.master()
    with pytest.raises(SimulationError, match=r"jsonl:\d+: the journal of .* is damaged; it is kept"):
        try:
            again.begin(START)
        finally:
            again.stop()
    assert writes == []
    assert path.read_bytes() == before


@pytest.mark.slow
def test_what_another_program_changed_since_is_left_and_told(bench):
    master = bench.master()
    master.begin(START)
    killed(master)
    bench.bus.advance(bench.bus.now + 2_000_000_000)
    bench.drive.dictionary.values[0x6083, 0] = 77
    line = bench.line()
    found = nvm.restore_journal(line, line.drive("axis"), bus_folder("", "", software=False))
    (text,) = found.foreign
    assert "6083h.0 is 0000004Dh, which the run did not write" in text
    assert bench.drive.dictionary.get(0x6083) == 77


@pytest.mark.slow
def test_what_the_drive_refuses_is_told_and_its_journal_kept(bench):
    master = bench.master()
    master.begin(START)
    entry = bench.drive.dictionary.entry(0x6083)
    original = bench.before[0][0x6083, 0]

    def refuse(_entry, value):
        from hw_bridge.dictionary import Abort, Code

        if value == original:
            raise Abort(Code.DEVICE_STATE)

    bench.drive.dictionary.checks[entry.index] = refuse
    master.stop()
    assert any("6083h.0 is" in note and "the drive refuses it" in note for note in master.notes)
    (path,) = bench.journals()
    del bench.drive.dictionary.checks[entry.index]
    check_restored(bench)
    assert not path.exists()


@pytest.mark.slow
def test_the_hardware_file_says_what_stays(build):
    bench = RealBench("faulhaber_v3", build, keep=["6083h", "1600h.1"])
    master = bench.master()
    master.begin(START)
    master.stop()
    assert master.notes == []
    differing = {address for address, value in bench.now[0].items() if value != bench.before[0][address]}
    assert differing == {(0x6083, 0), (0x1600, 1)}
    assert "kept: 6083h.0, 1600h.1" in master.restorations[0]
    bench = RealBench("faulhaber_v3", build, keep=["1400h.1", "1402h.1"])  # one in use, one that the run does not use
    master = bench.master()
    master.begin(START)
    master.stop()
    assert master.notes == []
    differing = {address for address, value in bench.now[0].items() if value != bench.before[0][address]}
    assert differing == {(0x1402, 1)}
    bench = RealBench("faulhaber_v3", build, keep="all")
    master = bench.master()
    master.begin(START)
    master.stop()
    assert bench.now[0] != bench.before[0]
    assert bench.journals() == []


def test_an_enabled_drive_is_not_written(bench):
    master = bench.master()
    master.begin(START)
    killed(master)
    line = bench.line()
    with pytest.raises(SimulationError, match="is in Operation enabled: somebody drives it"):
        nvm.restore_journal(line, line.drive("axis"), bus_folder("", "", software=False))
    assert len(bench.journals()) == 2
    with pytest.raises(SimulationError, match=r"a killed run left \d+ objects|is in Operation enabled"):
        nvm.store(line.drive("axis"))


@pytest.mark.slow
def test_store_refuses_what_a_run_left(bench):
    master = bench.master()
    master.begin(START)
    killed(master)
    bench.bus.advance(bench.bus.now + 2_000_000_000)
    line = bench.line()
    node = line.drive("axis")
    with pytest.raises(
        SimulationError, match=r"axis: a killed run left \d+ objects as it wrote them \(.*twin hil restore 1"
    ):
        nvm.store(node)
    check_restored(bench)
    nvm.store(node)


@pytest.mark.slow
@pytest.mark.parametrize("name", fast("epos4"))  # its mapping is not changed while it is in use
def test_a_dump_is_restored_whole(bench, tmp_path):
    """Also mapping entries beyond the count."""
    line = bench.line()
    node = line.drive("axis")
    objects.learn(node)
    text, _ = dcf.dump(node, 1_000_000)
    file = tmp_path / "before.dcf"
    file.write_text(text, encoding="latin-1")
    master = bench.master()
    master.begin(START)
    killed(master)
    bench.bus.advance(bench.bus.now + 2_000_000_000)
    line = bench.line()
    node = line.drive("axis")
    wanted = dcf.load(file, 1)
    assert dcf.differences(node, wanted)
    _, refused = dcf.restore(line, node, wanted)
    assert refused == []
    assert dcf.differences(node, wanted) == []


@pytest.mark.slow
def test_every_write_is_in_the_journal_before_it_is_made(bench):
    """On the disk, with what the object held."""
    seen = []

    def look(index, sub, _data):
        if index == 0x6040:
            return
        (path,) = [one for one in bench.journals() if one.stem.endswith("node1")]
        rows = [json.loads(line)["row"] for line in path.read_bytes().splitlines()][1:]
        found = [row for row in rows if (int(row["index"], 16), row["sub"]) == (index, sub)]
        assert found, f"{index:04X}h.{sub}"
        entry = bench.drive.dictionary.entry(index, sub)
        assert found[0]["before"] == entry.encode(bench.before[0][index, sub]).hex()
        seen.append(index)

    each_write(bench.drive, look)
    master = bench.master()
    master.begin(START)
    master.stop()
    assert len(set(seen)) > 15
    assert bench.now == bench.before


# a client's write: the one function, and commands, which are no configuration
WRITERS = {
    "master/writes.py": {"download"},
    "master/setup.py": {"reset", "configure", "release"},  # 6040h
    "commission/power.py": {"_write"},  # 6040h
    "commission/nvm.py": {"_signed"},  # signatures of 1010h and 1011h
}


@pytest.mark.slow
def test_no_other_code_writes_objects():
    found = {}
    for path in (ROOT / "hw_bridge").rglob("*.py"):
        for function in ast.walk(ast.parse(path.read_text())):
            if not isinstance(function, ast.FunctionDef):
                continue
            for call in ast.walk(function):
                target = getattr(call, "func", None)
                if isinstance(target, ast.Attribute) and target.attr == "write":
                    owner = ast.unparse(target.value)
                    if owner.rpartition(".")[2] == "sdo" or owner.endswith("client"):
                        found.setdefault(str(path.relative_to(ROOT / "hw_bridge")), set()).add(function.name)
    assert found == WRITERS


@pytest.mark.slow
def test_those_that_go_another_way_are_commands():
    """Their writes name 6040h; a person's writes that are to stay name `lasting`."""
    for name in ("master/setup.py", "commission/power.py"):
        tree = ast.parse((ROOT / "hw_bridge" / name).read_text())
        for call in ast.walk(tree):
            if (
                isinstance(call, ast.Call)
                and isinstance(call.func, ast.Attribute)
                and call.func.attr == "write"
                and ast.unparse(call.func.value).endswith("sdo")
            ):
                assert ast.unparse(call.args[0]) == str(0x6040)
    lasting = {
        str(path.relative_to(ROOT / "hw_bridge"))
        for path in (ROOT / "hw_bridge").rglob("*.py")
        for call in ast.walk(ast.parse(path.read_text()))
        if isinstance(call, ast.Call) and any(one.arg == "lasting" for one in call.keywords)
    }
    assert lasting == {"commission/objects.py", "commission/dcf.py"}
    assert SdoClient.write
