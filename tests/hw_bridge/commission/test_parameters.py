"""What a drive holds: read and written by name and unit, as DCF files, stored. On drives in simulated time."""

from contextlib import nullcontext
from types import SimpleNamespace

import canopen
import pytest
from click.testing import CliRunner

from hw_bridge.bus import Bus, SimulatedNetwork
from hw_bridge.command import hil
from hw_bridge.commission import BOOT, Keyboard, SdoSession, dcf, nvm, object_texts, objects, profile_name_of, scan
from hw_bridge.device import Drive, Module, Motor
from hw_bridge.dictionary import METHODS, State, cia301
from hw_bridge.profiles import DRIVE_PROFILES, device, profile
from twin.errors import DeclarationError, SimulationError

FORCE = "hw_bridge/benches/simulated_force.yaml"
RACS = "hw_bridge/benches/simulated_racs_module.yaml"


@pytest.fixture(scope="module")
def devices(build):
    """One drive of each profile and a module on one bus, and somebody who asks."""
    bus = Bus()
    found = {
        name: Drive(one := profile(name), number, Motor(one.motor, build=build))
        for number, name in enumerate(DRIVE_PROFILES, 1)
    }
    found["cia401"] = Module(device("cia401"), 9)
    for one in found.values():
        bus.attach(one)
    line = SdoSession(SimulatedNetwork(bus))
    line.wait(BOOT)
    line.devices = found
    return line


@pytest.fixture(scope="module", params=DRIVE_PROFILES)
def node(devices, request):
    """A drive of each profile."""
    found = devices.node(str(list(DRIVE_PROFILES).index(request.param) + 1))
    objects.learn(found)
    return found


def test_all_are_found_and_recognized(devices):
    found = scan(devices)
    assert [one.node for one in found] == [1, 2, 3, 4, 9]
    assert [one.title for one in found][:4] == [profile(name).title for name in DRIVE_PROFILES]
    assert found[0].state.startswith("Switch on disabled")
    assert devices.node("9").profile.name == "cia401"
    assert profile_name_of(0xFB, 0x68500000, 0x00020192) == ""  # an EPOS4 Micro is no EPOS4
    assert profile_name_of(327, 4711, 0x00420192) == "faulhaber_v3"
    assert profile_name_of(0x1234, 1, 0x00020192) == ""


@pytest.mark.slow
def test_a_fault_is_told_with_what_to_do(devices):
    drive = devices.devices["epos4"]
    drive.inject(0x8A88)
    devices.wait(BOOT)
    (found,) = [one for one in scan(devices) if one.title == "maxon EPOS4"]
    assert found.state.startswith("Fault")
    assert found.fault == "8A88h STO. STO is open: close both inputs, as the vendor's manual shows."
    with pytest.raises(SimulationError, match="is in Operation enabled: somebody drives it"):
        drive.state = State.ENABLED
        drive._show()
        nvm.store(devices.node("3"))
    devices.nmt(cia301.RESET_NODE, 3)
    devices.wait(BOOT)


def test_every_error_of_every_profile_has_a_remedy():
    codes = {code for name in DRIVE_PROFILES for code in profile(name).faults}
    assert codes - object_texts.REMEDIES.keys() == set()
    assert object_texts.REMEDIES.keys() - codes == set()


@pytest.mark.parametrize(
    ("word", "mode", "told"),
    [
        (0x0637, 8, "Operation enabled; voltage, remote, target reached"),
        (0x1637, 6, "Operation enabled; voltage, remote, target reached, homing attained"),
        (0x2218, 1, "Fault; voltage, remote, following error"),
        (0x0040, -4, "Switch on disabled"),
    ],
)
def test_statuswords_in_words(word, mode, told):
    assert object_texts.statusword(word, mode) == told


def test_homing_methods_in_words():
    for method, moves in METHODS.items():
        told = object_texts.homing(moves)
        assert len(told) == max(len(moves), 1), method
    assert object_texts.homing(METHODS[1]) == [
        "fast to negative positions of the drive until the negative limit switch closes",
        "slowly to positive positions of the drive until the negative limit switch opens",
        "slowly to positive positions of the drive until the next index pulse",
    ]


@pytest.mark.parametrize("word", ["6064h", "0x6064", "6064", "position_actual_value", "Position actual value"])
def test_objects_by_name_and_index(node, word):
    (entry,) = objects.find(node.mirror.entries(), word)
    assert (entry.index, entry.sub) == (0x6064, 0)


def test_records_and_what_is_not_there(node):
    found = objects.find(node.mirror.entries(), "software_position_limit")
    assert [(one.index, one.sub) for one in found] == [(0x607D, 1), (0x607D, 2)]
    assert objects.find(node.mirror.entries(), "607D.2")[0].sub == 2
    with pytest.raises(SimulationError, match=r"no such object\. Did you mean 'position_actual_value'"):
        objects.find(node.mirror.entries(), "posiiton_actual_value")


@pytest.mark.parametrize(
    ("word", "text", "problem"),
    [
        ("6085", "300", "has no unit"),
        ("6085", "5 N", "does not convert"),
        ("6085", "-5 m/s^2", "outside"),
        ("6085", "abc", "is not a quantity"),
        ("1017", "5 s", ""),
        ("1017", "70 s", r"is outside 0 ms \(0\) to .* ms \(65535\)"),
        ("6041", "1", "can only be read"),
        ("6040", "15", "acts at once"),
        ("607A", "1 mm", "acts at once"),
        ("6066", "0 ms", ""),
        ("1029.1", "1", ""),
        ("1029.1", "3", "outside 0 to 2"),
        ("1029.1", "1.5", "expected a whole number"),
    ],
)
def test_values_are_checked_before_anything_is_sent(node, word, text, problem):
    if node.profile.motor.unit == "rad":
        text = text.replace("m/s^2", "rad/s^2")
    found = objects.find(node.mirror.entries(), word)
    if not found:  # the MCLM has no 6066h
        return
    if problem:
        with pytest.raises(SimulationError, match=problem):
            objects.parse_value(node, found[0], text)
    else:
        assert objects.parse_value(node, found[0], text) >= 0


def test_quantities_are_the_drives(node):
    """5 m/s^2, or what that is on a motor that turns, is read back as the same."""
    (entry,) = objects.find(node.mirror.entries(), "quick_stop_deceleration")
    unit = "rad/s^2" if node.profile.motor.unit == "rad" else "m/s^2"
    number = objects.parse_value(node, entry, f"5 {unit}")
    objects.download(node, entry, number)
    assert number * node.units.acceleration == pytest.approx(5.0, rel=0.02)
    assert f"({number})" in objects.format_value(node, entry, objects.upload(node, entry))
    assert objects.parse_value(node, entry, f"{number} raw") == number


@pytest.mark.slow
def test_a_dcf_there_and_back(devices, node, tmp_path):
    file = tmp_path / "drive.dcf"
    text, refused = dcf.dump(node, 1_000_000)
    file.write_text(text, encoding="latin-1")
    assert refused == []
    read = canopen.import_od(str(file), node_id=node.number)  # another reader understands it
    assert read[0x1018][1].value_raw == str(node.sdo.number(0x1018, 1))
    assert read.bitrate == 1_000_000
    values = dcf.load(file, node.number)
    assert dcf.differences(node, values) == []
    changed = {0x6085: 77, 0x6099: 33}
    for index, value in changed.items():
        objects.download(node, node.mirror.objects[index][1 if index == 0x6099 else 0], value)
    node.sdo.write(0x1800, 1, (0x80000180 + node.number).to_bytes(4, "little"))
    node.sdo.write(0x1800, 2, b"\4")  # at every fourth SYNC
    node.sdo.write(0x1A00, 0, b"\0")
    node.sdo.write(0x1A00, 1, (0x60640020).to_bytes(4, "little"))
    node.sdo.write(0x1A00, 0, b"\1")
    found = {(entry.index, entry.sub) for entry, _, _ in dcf.differences(node, values)}
    two_mapped = {(0x1A00, 0)} if node.profile.name == "epos2" else set()  # by default
    assert found == {(0x6085, 0), (0x6099, 1), (0x1800, 1), (0x1800, 2), (0x1A00, 1)} | two_mapped
    done, refused = dcf.restore(devices, node, values)
    assert refused == []
    assert len(done) == 3
    assert dcf.differences(node, values) == []


def test_a_dcf_of_another_drive_and_files_that_are_none(devices, tmp_path):
    file = tmp_path / "drive.dcf"
    file.write_text(dcf.dump(devices.node("1"), 1_000_000)[0], encoding="latin-1")
    with pytest.raises(SimulationError, match="product code is C4Eh, the file is of 2D51h"):
        dcf.restore(devices, devices.node("2"), dcf.load(file, 2))
    file.write_text("")
    with pytest.raises(DeclarationError, match=r"is not a DCF file|no ParameterValue"):
        dcf.load(file, 1)
    with pytest.raises(DeclarationError, match="cannot be read"):
        dcf.load(tmp_path / "none.dcf", 1)
    from hw_bridge import eds

    file.write_text(eds.export(profile("mclm")))
    with pytest.raises(DeclarationError, match="no ParameterValue"):
        dcf.load(file, 1)


def test_stored_and_as_delivered(devices, node):
    (entry,) = objects.find(node.mirror.entries(), "profile_acceleration")
    before = objects.upload(node, entry)
    objects.download(node, entry, 123)
    nvm.store(node)
    nvm.restart(devices, node)
    assert objects.upload(node, entry) == 123
    nvm.defaults(node)
    nvm.restart(devices, node)
    assert objects.upload(node, entry) == before


@pytest.fixture
def run(build):
    def run(*words, code=0):
        done = CliRunner().invoke(hil.command, [*map(str, words), "--build", str(build)])
        assert done.exit_code == code, f"{done.output}\n{done.exception}"
        return done.output + (str(done.exception) if code else "")

    return run


@pytest.mark.slow
def test_the_commands(run, tmp_path):
    assert "node 9 (valves): I/O module (CiA 401)" in run("scan", "-f", RACS)
    told = run("status", "servomotor", "-f", FORCE)
    assert "Switch on disabled; voltage (0050h)" in told
    assert "24 V (2400)" in told
    assert max(map(len, told.splitlines())) <= 80
    assert "2000 mm/s (2000)" in run("get", "1", "max_motor_speed", "-f", FORCE)
    assert run("get", "1", "2FFFh", "-f", FORCE, code=1).count("no object") == 1
    assert "2000 mm/s (2000) -> 300 mm/s (300)." in run("set", "1", "6080h", "300 mm/s", "-f", FORCE)
    assert "--store" in run("set", "--help")
    file = tmp_path / "a.dcf"
    assert "218 values" in run("dump", "1", file, "-f", FORCE)
    assert "all values equal" in run("compare", "1", file, "-f", FORCE)
    text = file.read_text()
    file.write_text(text.replace("ParameterValue=10000\n", "ParameterValue=5000\n"))
    told = run("compare", "1", file, "-f", FORCE, code=1)
    assert "10 m/s^2 (10000)" in told
    assert "5 m/s^2 (5000)" in told
    assert "1 changed, 0 refused" in run("restore", "1", file, "-f", FORCE)
    assert "are stored" in run("store", "1", "-f", FORCE)
    assert "has its defaults" in run("defaults", "1", "--yes", "--restart", "-f", FORCE)
    assert run("monitor", "--for", "0.3", "-f", FORCE).count("6041h Statusword") == 2
    assert "Which bus?" in run("scan", code=2)
    assert "node 7 does not answer" in run("status", "7", "-f", FORCE, code=1)
    assert "Did you mean 'servomotor'" in run("status", "servomoter", "-f", FORCE, code=1)


def test_help_is_at_most_80_columns_and_has_examples(run):
    for name in hil.COMMANDS:
        told = run(name, "--help")
        assert max(map(len, told.splitlines())) <= 80, name


@pytest.mark.slow
def test_store_shows_what_differs_from_a_dump(build, tmp_path, monkeypatch):
    monkeypatch.setenv("TWIN_STATE", str(tmp_path))

    def run(*words, code=0):
        done = CliRunner().invoke(hil.command, [*map(str, words), "-f", FORCE, "--build", str(build)])
        assert done.exit_code == code, done.output
        return done.output + str(done.exception or "")

    assert "note: there is no dump of this drive to compare with." in run("store", 1)
    file = tmp_path / "delivered.dcf"
    run("dump", 1, file)
    assert "servomotor: 0 objects differ from its last dump:" in run("store", 1)
    file.write_text(file.read_text().replace("ParameterValue=2000", "ParameterValue=900", 1))
    told = run("store", 1, file)
    assert "servomotor: 1 objects differ from" in told
    assert "6072h.0" in told
    file.write_text(file.read_text().replace("ParameterValue=327", "ParameterValue=251"))
    assert "vendor is 147h, the file is of FBh" in run("store", 1, file, code=1)


def test_the_monitor_ends_by_q(run, monkeypatch):
    """Other keys do nothing."""
    presses = iter([[], ["up"], ["x", "q"]])
    keyboard = SimpleNamespace(pressed=lambda: next(presses))
    monkeypatch.setattr(Keyboard, "open_if_terminal", lambda: nullcontext(keyboard))
    assert run("monitor", "servomotor", "--every", "0.05", "-f", FORCE).count("6041h Statusword") == 3
