"""Drives by the files of their vendors: `scan`, `check`, first motion and a run, and what a drive has not.

Over 400 lines: the same steps for each vendor's drive, on one bench.
"""

import pytest
from click.testing import CliRunner

from hw_bridge.bus import MILLISECOND, Bus, SimulatedNetwork
from hw_bridge.command import hil
from hw_bridge.commission import BOOT, SdoSession, SingleAxisSession, scan
from hw_bridge.device import Drive, Motor, modes
from hw_bridge.dictionary import Mode
from hw_bridge.eds import load_profile
from hw_bridge.hardware import HardwareKeys, load
from hw_bridge.master import Master
from hw_bridge.plant import store_motor_parameters
from hw_bridge.profiles import MOTORS, profile, unsupported_product
from tests.hw_bridge.axis import Rig
from tests.hw_bridge.profiles import fast
from tests.hw_bridge.real import files
from twin.errors import ScenarioError, SimulationError

LINEAR = """
    limits: {position: [-20 mm, 20 mm], velocity: 20 mm/s, force: 15 N, following_error: 2 mm, acceleration: 1 m/s^2}
"""
ROTARY = """
    scale: 0.002
    limits: {position: [-20 mm, 20 mm], velocity: 20 mm/s, force: 300 N, following_error: 2 mm, acceleration: 1 m/s^2}
"""
UNITS = "    units: {position: 0.001 deg, velocity: 0.001 deg/s, acceleration: 0.001 deg/s^2, current: 1 mA}\n"
CONSTANT = "    force_constant: 45 N/A\n"
PP_ONLY = ROTARY + UNITS + CONSTANT + "    follow: {mode: csp}\n"


@pytest.fixture
def bench(tmp_path):
    """Write a hardware file with one drive and its EDS file."""

    def write(name, eds="", keys=LINEAR):
        if eds:
            (tmp_path / "drive.eds").write_text(eds)
        path = tmp_path / "bench.yaml"
        by = "    eds: drive.eds\n" if eds else ""
        path.write_text(f"simulated: true\nnodes:\n  servomotor:\n    node: 1\n    profile: {name}\n{by}{keys}")
        return path

    return write


def run(*words, code=0):
    done = CliRunner().invoke(hil.command, [*map(str, words)])
    assert done.exit_code == code, (done.output, done.exception)
    return " ".join(f"{done.output} {done.exception or ''}".split())


ABORT = files.variable("6007", "Abort connection option", files.I16, "rw", 0)
CASES = {
    "mc5004": ("faulhaber_v3", files.mc5004(), LINEAR + "    motor: lm2070\n"),
    "epos2": ("epos2", "", ROTARY),
    "pp alone": ("cia402", files.gripper(), PP_ONLY),
    "pp and pv": (
        "cia402",
        files.gripper(modes=0x25, velocity=True, current=False, telling=(ABORT,)),
        ROTARY + UNITS + CONSTANT + "    watch_force: false\n",
    ),
}


# the others are run and checked by the fast suite too, but not moved by commands
@pytest.mark.slow
@pytest.mark.parametrize("case", fast("mc5004", of=CASES))
def test_scan_check_and_first_motion(bench, case):
    path = bench(*CASES[case])
    assert "node 1 (servomotor): " in run("scan", "-f", path)
    assert "Bus and hardware file agree." in run("check", "-f", path)
    assert "servomotor: stopped and disabled, at " in run("move", "servomotor", "--by", "1 mm", "-f", path)
    told = run("move", "servomotor", "--by", "-2 mm", "-f", path)
    assert "is at -1.99 mm" in told or "is at -2.00 mm" in told or "is at -2.01 mm" in told
    assert "rise" in run("step", "servomotor", "--by", "0.1 mm", "-f", path, "--plot", path.with_name("step.svg"))


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_run(build, bench, case):
    """A member that is told speeds, then a stop; what was written is restored."""
    rig = Rig(build, load(bench(*CASES[case])))
    rig.go(1)
    before = {place: change.before for place, change in rig.master.nodes["servomotor"].journal.changes.items()}
    rig.set(target_velocity=0.01)
    rig.go(500)  # the loop of an EPOS overcomes friction meanwhile
    begin = rig.get("position")
    rig.go(500)
    assert rig.get("position") - begin == pytest.approx(0.005, rel=0.05)
    rig.axis.close()
    assert rig.session.outcome.notes == []
    held = rig.drive.dictionary
    for (index, sub), data in before.items():
        entry = held.entry(index, sub)
        assert entry.encode(held.values[index, sub]) == data, f"{index:04X}h.{sub}"


@pytest.mark.slow
def test_homing_of_an_mc5004(bench):
    homing = "    homing: {method: -3, at: -40 mm, speed: 20 mm/s}\n"
    wide = LINEAR.replace("-20 mm, 20 mm", "-39 mm, 39 mm")
    told = run("home", "servomotor", "-f", bench("faulhaber_v3", files.mc5004(), wide + homing + "    motor: lm2070\n"))
    assert "homed at -40 mm" in told


def test_all_that_an_mc5004_has_not_is_named_before_anything_is_written(bench):
    told = run("check", "-f", bench(*CASES["mc5004"]), "--verbose")
    for missing in ("603Fh", "607Fh", "60C2h", "60FEh"):
        assert f"note: servomotor: has no {missing} " in told
    assert "has no 6075h, by which its profile scales" in told
    assert "the drive's 6080h" in told  # where limits.velocity acts
    assert "607Fh, 6080h" not in told


def test_an_mc5004_with_the_velocity_factor_of_its_file_is_not_moved(build):
    """1/4096 fits its other default, 4096 positions for a turn; with micrometers it is no unit that is known."""
    wired = Wired("faulhaber_v3", build)
    wired.drive.dictionary.restore({(0x6096, 2): 4096})
    with pytest.raises(SimulationError, match=r"its scale is ASSUMED: a unit of velocity is"), wired.hand.enabled():
        pass
    assert wired.writes == []


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("missing", [0x6065, 0x607D, 0x6085, 0x60C2])
def test_what_a_profile_claims_and_the_drive_has_not_is_left_out(build, missing):
    """The drive is asked: no EDS file says it."""
    wired = Wired("faulhaber_v3", build, {missing})
    wired.hand.master.wait(BOOT)
    notes = wired.hand.master.plan(wired.hand.node).notes
    with wired.hand.enabled():
        wired.hand.move(1e-3, 5e-3, 0.5)
        assert wired.hand.node.position == pytest.approx(1e-3, abs=5e-5)
    assert any(f"axis: has no {missing:04X}h" in note for note in notes)
    assert missing in wired.hand.node.absent


@pytest.mark.parametrize(
    ("missing", "text"),
    [
        (0x1016, "nothing would stop it when this program dies"),
        (0x606C, r"limits\.velocity cannot be watched"),
        (0x6077, r"tells no current \(6077h, 6078h\): limits\.force cannot be watched"),
        (0x1401, r"it has no RPDO 2 \(1401h\)"),
    ],
)
def test_what_a_run_cannot_do_without_is_refused_before_anything_is_written(build, missing, text):
    wired = Wired("faulhaber_v3", build, {missing})
    with pytest.raises(SimulationError, match=text), wired.hand.enabled():
        pass
    assert wired.writes == []


def test_all_reasons_are_named_at_once(build):
    wired = Wired("faulhaber_v3", build, {0x1016, 0x6077, 0x606C})
    with pytest.raises(SimulationError) as failure, wired.hand.enabled():
        pass
    for index in ("1016h", "606Ch", "6077h"):
        assert index in str(failure.value)


class Wired:
    """A simulated drive that lacks objects which its profile has, and a hand on it that does not know it."""

    def __init__(self, name, build, missing=(), keys=None):
        known = profile(name)
        self.drive = store_motor_parameters(Drive(known, 1, Motor(known.motor, build=build)), MOTORS[known.motor_name])
        for index in missing:
            del self.drive.dictionary.objects[index]
        self.writes = []
        download = self.drive.dictionary.download
        self.drive.dictionary.download = lambda index, sub, data: (
            None if index == 0x6040 else self.writes.append((index, sub)),
            download(index, sub, data),
        )[1]
        self.bus = Bus()
        self.bus.attach(self.drive)
        own = HardwareKeys.model_validate(
            {"simulated": True, "nodes": {"axis": {"node": 1, "profile": name, **(keys or {})}}}
        )
        self.hand = SingleAxisSession(own, "axis", SimulatedNetwork(self.bus))


def test_an_mclm_cf_is_named_and_refused(build):
    """It has the product code of another drive; its device type tells."""
    assert unsupported_product(327, 3150, 0x00020192).title == "FAULHABER MCLM 300x CF"
    assert unsupported_product(327, 3150, 0x00420192) is None
    wired = Wired("mclm", build)
    wired.drive.dictionary.values[0x1000, 0] = 0x00020192
    network = SimulatedNetwork(wired.bus)
    line = SdoSession(network)
    line.wait(BOOT)
    (found,) = scan(line)
    assert found.title.startswith("FAULHABER MCLM 300x CF, which no profile fits. Its process data are fixed")
    with pytest.raises(
        SimulationError, match=r"is a FAULHABER MCLM 300x CF\. No profile fits it\..*no heartbeat.*An MCLM 300x CO"
    ):
        SingleAxisSession(wired.hand.master.keys, "axis", SimulatedNetwork(wired.bus)).enabled().__enter__()
    assert wired.writes == []


@pytest.mark.parametrize(
    ("eds", "keys", "text"),
    [
        ("", PP_ONLY, r"cia402: which drive is it\? Name its EDS file"),
        (
            files.gripper(),
            ROTARY + CONSTANT,
            r"units\.position: neither the EDS file tells it \(60A8h, or 6092h, or 608Fh\)",
        ),
        (files.gripper(), ROTARY + CONSTANT, r"units\.velocity: neither the EDS file tells it \(60A9h\)"),
        (files.gripper(), ROTARY + CONSTANT, r"units\.acceleration: neither the EDS file tells it \(60AAh\)"),
        (files.gripper(), ROTARY + CONSTANT, r"units\.current: neither the EDS file tells it \(6075h\)"),
        (files.gripper(), ROTARY + UNITS, r"force_constant: is missing"),
    ],
)
def test_what_neither_the_file_nor_the_drive_tells_is_refused(bench, eds, keys, text):
    with pytest.raises(ScenarioError, match=text) as failure:
        load(bench("cia402", eds, keys))
    assert "bench.yaml:" in str(failure.value)


TOLD = (
    files.variable("60A8", "SI unit position", files.U32, "ro", 0xFD410000),  # mdeg
    files.variable("60A9", "SI unit velocity", files.U32, "ro", 0xFDB44700),  # mrpm
    files.variable("60AA", "SI unit acceleration", files.U32, "ro", 0x00C00300),  # rpm/s
    files.variable("6075", "Motor rated current", files.U32, "ro", 2000),
)


def test_units_that_the_drive_tells(bench):
    node = load(bench("cia402", files.gripper(telling=TOLD), ROTARY + CONSTANT)).nodes["servomotor"]
    from hw_bridge.dictionary import Dictionary

    units = node.drive.units(Dictionary(node.drive.objects, 1))
    assert units.position == pytest.approx(1.7453293e-5)
    assert units.velocity == pytest.approx(1.0471976e-4)
    assert units.acceleration == pytest.approx(0.10471976)
    assert units.torque == pytest.approx(2e-3)


@pytest.mark.parametrize(
    ("rows", "position"),
    [
        (
            (
                files.record(0x6091, "Gear", (1, files.U32, "ro", 5, 0), (2, files.U32, "ro", 1, 0)),
                files.record(0x6092, "Feed", (1, files.U32, "ro", 360000, 0), (2, files.U32, "ro", 1, 0)),
            ),
            5 * 1.7453293e-5,
        ),
        (
            (files.record(0x608F, "Encoder", (1, files.U32, "ro", 4096, 0), (2, files.U32, "ro", 1, 0)),),
            6.2831853 / 4096,
        ),
    ],
    ids=["feed and gear", "encoder"],
)
def test_positions_by_the_factor_group(bench, rows, position):
    keys = ROTARY + CONSTANT + "    units: {velocity: 1 deg/s, acceleration: 1 deg/s^2, current: 1 mA}\n"
    node = load(bench("cia402", files.gripper(telling=rows), keys)).nodes["servomotor"]
    from hw_bridge.dictionary import Dictionary

    assert node.drive.units(Dictionary(node.drive.objects, 1)).position == pytest.approx(position)


def test_a_position_factor_is_not_an_increment(bench):
    """6093h without 6092h, as in older drives: 608Fh alone would be wrong by that factor."""
    rows = (
        files.record(0x608F, "Encoder", (1, files.U32, "ro", 4096, 0), (2, files.U32, "ro", 1, 0)),
        files.record(0x6093, "Position factor", (1, files.U32, "rw", 10, 0), (2, files.U32, "rw", 1, 0)),
    )
    keys = ROTARY + CONSTANT + "    units: {velocity: 1 deg/s, acceleration: 1 deg/s^2, current: 1 mA}\n"
    told = run("check", "-f", bench("cia402", files.gripper(telling=rows), keys), code=1)
    assert "its scale is ASSUMED: units.position: the drive does not tell it" in told


def test_a_unit_that_the_drive_holds_as_0_is_assumed_and_not_moved(bench):
    """The EDS file has the object, the drive has nothing in it."""
    empty = files.record(0x608F, "Encoder", (1, files.U32, "ro", 0, 0), (2, files.U32, "ro", 0, 0))
    keys = ROTARY + CONSTANT + "    units: {velocity: 1 deg/s, acceleration: 1 deg/s^2, current: 1 mA}\n"
    told = run("check", "-f", bench("cia402", files.gripper(telling=(empty,)), keys), code=1)
    assert "its scale is ASSUMED: units.position: the drive does not tell it" in told


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("eds", "text"),
    [
        (files.gripper(heartbeat=False), "has no 1016h Consumer heartbeat time: nothing would stop it"),
        (files.gripper(current=False), "it tells no current"),
        (files.gripper(modes=0x04, velocity=True), r"has neither csp nor pp \(6502h is 4h\)"),
        (files.gripper(pdos=files.pdo(0, True, 0x200, [], 8)), r"it has no RPDO 2 \(1401h\)"),
        (
            files.gripper(
                pdos="".join(
                    files.pdo(n, receive, base + 0x100 * n, [], 3 if receive else 2)
                    for n in range(3)
                    for receive, base in ((True, 0x200), (False, 0x180))
                )
            ),
            "TPDO 1 has room for 2 objects, a run needs 3",
        ),
        (
            files.gripper(
                pdos="".join(
                    files.pdo(n, receive, base + 0x100 * n, [], 8, "ro")
                    for n in range(3)
                    for receive, base in ((True, 0x200), (False, 0x180))
                )
            ),
            "RPDO 1 is fixed",
        ),
    ],
    ids=["heartbeat", "current", "modes", "PDOs", "entries", "fixed"],
)
def test_a_generic_drive_that_cannot_be_run_is_refused(bench, eds, text):
    assert text.replace("\\", "") in run("check", "-f", bench("cia402", eds, PP_ONLY), code=1)


def test_a_member_that_is_told_speeds_needs_a_mode(build, bench):
    """Neither csv nor pv: said by check, refused by a run."""
    path = bench("cia402", files.gripper(telling=(ABORT,)), ROTARY + UNITS + CONSTANT)
    assert "a member that is told speeds needs `follow: {mode: csp}`" in run("check", "-f", path)
    rig = Rig(build, load(path))
    with pytest.raises(SimulationError, match=r"has no mode for csv"):
        rig.go(10)


def test_a_drive_that_may_go_on_alone_is_told_positions_only(bench):
    """No 6007h: what it does without the heartbeat is not known, so that a speed must not be its last target."""
    eds = files.gripper(modes=0x25, velocity=True)
    told = run("check", "-f", bench("cia402", eds, ROTARY + UNITS + CONSTANT), code=1)
    assert "in csv and pv it may go on when this program dies. Correct it, or add `follow: {mode: csp}`" in told
    assert "Bus and hardware file agree." in run("check", "-f", bench("cia402", eds, PP_ONLY))


def frames_of(rig):
    found = []
    rig.session.bench.bus.observers.append(lambda time, frame: found.append((time, frame)))
    return found


@pytest.mark.parametrize("name", ["mclm", "epos2"])
def test_a_set_point_waits_for_its_acknowledge(build, name):
    """Bit 4 of 6040h rises only after bit 12 of 6041h fell, and falls only after it rose."""
    keys = {"scale": 0.002, "limits": {"force": "10 kN"}} if name == "epos2" else {}
    rig = Rig(build, {"servomotor": {"node": 1, "profile": name, **keys}})
    rig.set(mode_of_operation=8)
    rig.go(100)
    seen = frames_of(rig)
    for step in range(200):
        rig.set(target_position=1e-5 * step)
        rig.go(1)
    acknowledged, high, rises, wrong = False, False, 0, []
    for time, frame in seen:
        if frame.id in (0x181, 0x381):
            acknowledged = bool(int.from_bytes(frame.data[:2], "little") & 0x1000)
        elif frame.id == 0x301:
            now = bool(frame.data[0] & 0x10)
            wrong += [(time, now)] if now is not high and acknowledged is now else []
            rises += now and not high
            high = now
    assert wrong == []
    assert rises >= 38  # one in each cycle of 5 ms
    assert rig.get("position") == pytest.approx(1.99e-3, abs=3e-4)


def test_a_set_point_that_is_never_acknowledged_ends_the_run(build, monkeypatch):
    rig = Rig(build, {"servomotor": {"node": 1, "profile": "mclm"}})
    rig.set(mode_of_operation=8)
    rig.go(100)
    monkeypatch.setattr(modes.ProfilePosition, "bits", lambda _: 0)
    rig.set(target_position=1e-3)
    with pytest.raises(SimulationError, match=r"servomotor: does not acknowledge set-points \(6041h, bit 12\)"):
        rig.go(100)


def test_another_program_that_sets_the_mode_is_noticed(build):
    """As a vendor's program does it over USB: no frame on the bus tells it."""
    rig = Rig(build, {"servomotor": {"node": 1, "profile": "faulhaber_v3"}})
    rig.go(100)
    dictionary = rig.drive.dictionary
    dictionary.effects[0x6040] = lambda entry, own=dictionary.effects[0x6040]: (
        own(entry),
        dictionary.put(0x6060, Mode.PV),
    )
    with pytest.raises(SimulationError, match=r"is in mode 3 \(6061h\), not in csv: another program sets it"):
        rig.go(200)


def test_a_drive_that_is_operated_locally_is_noticed(build):
    rig = Rig(build, {"servomotor": {"node": 1, "profile": "faulhaber_v3"}})
    rig.go(100)
    show = rig.drive._show

    def local():
        show()
        dictionary = rig.drive.dictionary
        dictionary.put(0x6041, dictionary.get(0x6041) & ~0x0200)

    rig.drive._show = local
    with pytest.raises(
        SimulationError, match=r"does not obey the bus any more \(6041h, bit 9 is 0\): it is operated locally"
    ):
        rig.go(100)


def test_an_emergency_keeps_register_and_vendors_bytes(build):
    rig = Rig(build, {"servomotor": {"node": 1, "profile": "faulhaber_v3"}})
    rig.go(100)
    rig.drive.inject(0x8611)
    with pytest.raises(
        SimulationError,
        match=r"EMCY 8611h, following error \(1001h 21h generic, device profile; vendor's bytes 02 00 00 00 00, 2320h following error\)",
    ):
        rig.go(50)
    node = rig.master.nodes["servomotor"]
    assert node.emergencies[0][1:] == (0x8611, 0x21, b"\2\0\0\0\0")
    (message,) = [one for one in rig.session.report()["nodes"]["servomotor"]["emergency_messages"] if "8611h" in one]
    assert message.endswith("vendor's bytes 02 00 00 00 00, 2320h following error)")


def test_the_dictionary_of_a_file_is_that_of_the_node(tmp_path):
    path = tmp_path / "mc5004.eds"
    path.write_text(files.mc5004())
    found = load_profile("faulhaber_v3", str(path))
    indices = {one.index for one in found.objects}
    assert not indices & {0x603F, 0x6075, 0x607F, 0x60C2, 0x60FE}
    assert found.units(Drive(found, 1, Motor(found.motor)).dictionary).torque == pytest.approx(0.79e-3)


def test_a_mapping_that_counts_an_empty_object(tmp_path):
    """An EPOS2's file counts two and names one."""
    path = tmp_path / "drive.eds"
    text = files.gripper()
    path.write_text(
        text.replace(
            "[1600sub0]\nParameterName=Number of objects\nObjectType=0x7\nDataType=0x0005\nAccessType=rw\nPDOMapping=0\nDefaultValue=1",
            "[1600sub0]\nParameterName=Number of objects\nObjectType=0x7\nDataType=0x0005\nAccessType=rw\nPDOMapping=0\nDefaultValue=2",
        )
    )
    from hw_bridge import eds

    entries = {(one.index, one.sub): one for one in eds.load(path)}
    assert "DefaultValue=2" in path.read_text()
    assert entries[0x1600, 0].default == 1


def test_a_second_reset_bus_keeps_a_drive_in_bus_off(build):
    """A node that is pulled takes no other with it that is in bus-off."""
    bus = Bus()
    first, second = (Drive(profile("mclm"), number, Motor(profile("mclm").motor, build=build)) for number in (1, 2))
    bus.attach(first)
    bus.attach(second)
    bus.advance(200 * MILLISECOND)
    bus._ports[0].online = False
    bus.detach(second)
    bus.advance(300 * MILLISECOND)
    assert first.now == bus.now


def test_check_reads_only(build):
    wired = Wired("epos2", build, keys={"scale": 0.002})
    Master.plan(wired.hand.master, wired.hand.node)
    assert wired.writes == []
