"""On a bus of real drives nothing moves and nothing switches without --arm, and only what the hardware file names is addressed."""

import pytest
from click.testing import CliRunner

from hw_bridge import plant
from hw_bridge.bus import Bus, SimulatedNetwork
from hw_bridge.command import hil
from hw_bridge.commission import SdoSession
from hw_bridge.device import Drive, Module, Motor
from hw_bridge.dictionary import State
from hw_bridge.hardware import HardwareKeys
from hw_bridge.journal import state_folder
from hw_bridge.master import restoration, setup
from hw_bridge.profiles import device, profile

BENCH = """
interface: socketcan
channel: can0
nodes:
  servomotor: {node: 1, profile: PROFILE, safe_outputs: 0}
modules:
  valves: {node: 9, outputs: {0: "sequencer.valve[1]"}, safe_outputs: 0}
"""


@pytest.fixture
def bench(build, tmp_path, monkeypatch):
    """A bus with a drive and a module that take themselves for real; `twin hil` on it."""

    def made(name="faulhaber_v3"):
        bus = Bus()
        drive = Drive(profile(name), 1, Motor(profile(name).motor, build=build))
        module = Module(device("cia401"), 9)
        bus.attach(drive)
        bus.attach(module)
        bus.advance(500_000_000)
        made.drive, made.module, made.bus = drive, module, bus
        monkeypatch.setattr(plant, "bench_network", lambda _keys, _build: SimulatedNetwork(bus))
        file = tmp_path / "bench.yaml"
        text = BENCH.replace("PROFILE", name)
        file.write_text(text if name != "mclm" else text.replace(", safe_outputs: 0}\nmod", "}\nmod"))

        def run(*words, code=0):
            done = CliRunner().invoke(hil.command, [*map(str, words), "-f", str(file), "--build", str(build)])
            assert done.exit_code == code, f"{done.output}\n{done.exception}"
            return " ".join((done.output + (str(done.exception) if code else "")).split())

        return run

    return made


@pytest.mark.parametrize("word", ["60FEh.1", "digital_outputs.physical_outputs"])
def test_outputs_of_a_drive(bench, word):
    run = bench()
    assert "60FEh.1 switches outputs at once. Nothing was written. Add --arm" in run("set", "1", word, "FFh", code=1)
    assert bench.drive.outputs == 0
    run("set", "1", word, "FFh", "--arm")
    assert bench.drive.outputs == 0xFF


def test_outputs_of_a_module(bench):
    run = bench()
    assert "6200h.1 switches outputs at once" in run("set", "9", "6200h.1", "FFh", code=1)
    assert bench.module.outputs == 0
    run("set", "9", "6200h.1", "FFh", "--arm")
    assert bench.module.outputs == 0xFF


@pytest.mark.parametrize(
    ("name", "word", "why"),
    [
        ("epos4", "3151h.1", "switches outputs"),  # function of an output: a brake
        ("epos4", "3150h.2", "switches outputs"),
        ("faulhaber_v3", "2311h.4", "switches outputs|is not in the profile"),
        ("mclm", "2315h.1", "switches outputs|is not in the profile"),
        ("mclm", "2FFFh.1", "is not in the profile, and may act at once"),
    ],
)
def test_objects_of_the_vendor(bench, name, word, why):
    run = bench(name)
    said = run("set", "1", word, "1", code=1)
    assert any(one in said for one in why.split("|")), said
    assert "Add --arm" in said


@pytest.mark.parametrize(("address", "value"), [((0x3151, 1), 255), ((0x3150, 2), 3)])
def test_functions_of_pins_in_a_file(bench, tmp_path, address, value):
    """Nothing of the file is written, also not what switches nothing."""
    run, file = bench("epos4"), tmp_path / "before.dcf"
    run("dump", "1", file)
    values = bench.drive.dictionary.values
    before = dict(values)
    values[address], values[0x6067, 0] = value, 50
    said = run("restore", "1", file, code=1)
    assert f"{address[0]:04X}h.{address[1]} switches outputs at once. Nothing was written. Add --arm" in said
    assert (values[address], values[0x6067, 0]) == (value, 50)
    run("restore", "1", file, "--arm")
    assert (values[address], values[0x6067, 0]) == (before[address], before[0x6067, 0])


def test_functions_of_pins_in_a_journal(bench):
    """All else is restored; what may switch an output stays in the journal until it is armed."""
    run = bench("epos4")
    keys = HardwareKeys.model_validate(
        {"interface": "socketcan", "channel": "can0", "nodes": {"axis": {"node": 1, "profile": "epos4"}}}
    )
    drive = SdoSession(SimulatedNetwork(bench.bus), keys.nodes).drive("axis")
    restoration.open_journal(drive, restoration.folder_of(keys))
    values = bench.drive.dictionary.values
    before = dict(values)
    setup.write(drive, 0x3151, 1, 255)
    setup.write(drive, 0x6067, 0, 50)
    drive.journal.file.file.close()
    said = run("restore", "1", code=1)
    assert "3151h.1 was" in said
    assert "may switch outputs, such as a valve or a brake: add --arm" in said
    assert "1 objects are as before the run, 1 are not" in said
    assert (values[0x3151, 1], values[0x6067, 0]) == (255, before[0x6067, 0])
    assert "1 objects are as before the run, 0 are not" in run("restore", "1", "--arm")
    assert values[0x3151, 1] == before[0x3151, 1]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("word", ["6040h", "6060h", "607Ah", "60FFh", "6071h", "60B1h", "1010h.1", "2001h", "31E4h.1"])
def test_what_moves_is_refused_even_if_armed(bench, word):
    run = bench("epos4")
    assert "acts at once" in run("set", "1", word, "0 raw", "--arm", code=1)


def test_parameters_need_no_arm(bench):
    run = bench()
    assert "-> 0.05 mm (50)" in run("set", "1", "6067h", "50 raw")
    assert bench.drive.dictionary.get(0x6067) == 50


# ---------------------------------------------------------------------------------------------------------- references

HOMED = """
interface: socketcan
channel: can0
nodes:
  servomotor:
    node: 1
    profile: PROFILE
    limits: {position: [-45 mm, 45 mm], velocity: 200 mm/s, force: 8 N, following_error: 3 mm, acceleration: 3 m/s^2}
    homing: {method: -3, at: -40 mm, speed: 50 mm/s}
"""
TURNING = """
interface: socketcan
channel: can0
nodes:
  servomotor:
    node: 1
    profile: epos4
    scale: 1.5915e-3
    limits: {position: [-20 mm, 20 mm], velocity: 50 mm/s, force: 250 N, following_error: 2 mm, acceleration: 1 m/s^2}
    homing: {method: 37, at: 0 mm, speed: 10 mm/s}
"""


@pytest.fixture
def homes(bench, tmp_path):
    """The same of a drive that can be homed."""

    def made(name="faulhaber_v3"):
        run = bench(name)
        (tmp_path / "bench.yaml").write_text(TURNING if name == "epos4" else HOMED.replace("PROFILE", name))
        return run

    return made


def move(run, to="-10 mm", code=0):
    return run("move", "servomotor", "--to", to, "--velocity", "20 mm/s", "--arm", code=code)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["faulhaber_v3", "epos4"])
def test_what_was_homed_counts_from_its_reference(homes, bench, name):
    run = homes(name)
    assert "It is at" in run("home", "servomotor", "--arm")
    before = bench.drive.axis.motor.position
    for place in (-10, -10, 12):
        assert f"is at {place}.0" in move(run, f"{place} mm").replace(f"is at {place - 1}.9", f"is at {place}.0")
    way = (bench.drive.axis.motor.position - before) * (1.5915e-3 if name == "epos4" else 1.0)
    assert way == pytest.approx(0.012 - (1e-3 if name == "epos4" else -39e-3), abs=1e-4)


@pytest.mark.parametrize("name", ["faulhaber_v3", "epos4"])
def test_what_was_never_homed_is_refused(homes, bench, name):
    run = homes(name)
    said = move(run, code=1)
    assert "no reference: " in said
    assert "Home it: twin hil home servomotor" in said
    assert bench.drive.state is State.DISABLED


@pytest.mark.slow
@pytest.mark.parametrize("name", ["faulhaber_v3", "epos4"])
def test_what_was_switched_off_since_is_refused(homes, bench, name):
    run = homes(name)
    run("home", "servomotor", "--arm")
    bench.drive.restart()
    bench.bus.advance(bench.bus.now + 500_000_000)
    why = "it was not homed since it was switched on" if name == "epos4" else "it was switched off, or pushed"
    assert why in move(run, code=1)


@pytest.mark.slow
def test_what_was_pushed_is_refused_unless_the_drive_tells_of_its_reference(homes, bench):
    for name in ("epos4", "faulhaber_v3"):
        run = homes(name)
        run("home", "servomotor", "--arm")
        view = bench.drive.axis.motor._views["angle" if name == "epos4" else "rod_position"]
        view[...] += 0.5 if name == "epos4" else 5e-3
        bench.bus.advance(bench.bus.now + 10_000_000)
        if name == "epos4":
            assert "is at -10.0" in move(run)
        else:
            assert "it was switched off, or pushed" in move(run, code=1)


@pytest.mark.slow
def test_another_file_is_refused(homes, tmp_path):
    run = homes()
    run("home", "servomotor", "--arm")
    file = tmp_path / "bench.yaml"
    file.write_text(file.read_text().replace("at: -40 mm", "at: -41 mm"))
    assert "homed with another `homing`" in move(run, code=1)


@pytest.mark.slow
def test_a_motion_that_was_broken_off_is_homed_again(homes, bench):
    run = homes()
    run("home", "servomotor", "--arm")
    bench.bus.event_queue.at(bench.bus.now + 1_500_000_000, lambda: bench.drive.inject(0x8611))
    assert "EMCY 8611h" in move(run, "20 mm", code=1)
    bench.drive._reset_errors()
    bench.drive._enter(State.DISABLED)
    assert "a run was broken off since" in move(run, code=1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["faulhaber_v3", "epos4"])
def test_a_homed_drive_stays_in_its_limits_without_an_option(homes, tmp_path, name):
    """The limits do not move along with the start of each command; --from-start says that they do."""
    run, end = homes(name), 20
    (tmp_path / "bench.yaml").write_text((tmp_path / "bench.yaml").read_text().replace("45 mm]", f"{end} mm]"))
    run("home", "servomotor", "--arm")
    run("move", "servomotor", "--to", f"{end - 5} mm", "--velocity", "20 mm/s", "--arm")
    assert " from reference is outside of limits.position" in run("move", "servomotor", "--by", "6 mm", "--arm", code=1)
    assert "positions count from reference" in run("move", "servomotor", "--by", "4.9 mm", "--arm")
    assert "is outside of limits.position" in run("step", "servomotor", "--by", "0.15 mm", "--arm", code=1)
    said = run("move", "servomotor", "--by", "2 mm", "--from-start", "--arm")
    assert "--from-start: positions and limits count from here" in said
    assert "from 0.00 mm to 2.00 mm" in said
    said = run("move", "servomotor", "--by", "-3 mm", "--arm")  # from outside it may come back
    assert f"from {end + 1}." in said


@pytest.mark.slow
def test_a_refused_move_leaves_the_reference_as_it_is(homes, tmp_path):
    """Before power, also after the bus was begun; status says from where positions count."""
    run, file = homes(), tmp_path / "bench.yaml"
    assert ", not homed" in run("status", "servomotor")
    run("home", "servomotor", "--arm")
    (record,) = (state_folder() / "references").iterdir()
    before = record.read_bytes()
    assert "-39.00 mm from reference (1 mm in the drive), homed" in run("status", "servomotor")
    right = file.read_text()
    file.write_text(right.replace("    limits:", "    motor: nothing\n    limits:").replace("nothing", "lm1247"))
    run("move", "servomotor", "--by", "1 mm", "--arm", code=1)
    file.write_text(right)
    refused = run("move", "servomotor", "--to", "60 mm", "--arm", code=1)
    assert "60 mm from reference is outside of limits.position, -45 mm to 45 mm. It is at -39 mm. Nothing" in refused
    assert record.read_bytes() == before
    assert "is at -38.0" in run("move", "servomotor", "--by", "1 mm", "--arm")


@pytest.mark.slow
def test_a_motion_that_the_program_stopped_keeps_the_reference(homes, bench):
    run = homes()
    run("home", "servomotor", "--arm")
    bench.bus.event_queue.at(
        bench.bus.now + 2_000_000_000, lambda: bench.drive.axis.motor._views["rod_position"].__iadd__(5e-3)
    )
    said = run("move", "servomotor", "--to", "20 mm", "--velocity", "20 mm/s", "--arm", code=1)
    assert "power is off (Switch on disabled), at " in said
    assert "The reference is kept. Next" in said
    assert "positions count from reference" in run("move", "servomotor", "--by", "-1 mm", "--arm")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["faulhaber_v3", "epos4"])
def test_a_run_that_homes_otherwise_forgets_it(homes, bench, build, tmp_path, name):
    """The drive tells that it has a reference, but of another place."""
    from hw_bridge.hardware import load
    from hw_bridge.master import Master

    run = homes(name)
    run("home", "servomotor", "--arm")
    other = tmp_path / "other.yaml"
    at = "at: 3 mm" if name == "epos4" else "at: -41 mm"
    other.write_text((tmp_path / "bench.yaml").read_text().replace("at: 0 mm" if name == "epos4" else "at: -40 mm", at))
    master = Master(load(other), SimulatedNetwork(bench.bus))
    master.begin({"servomotor": 0.0})
    master.stop()
    assert "no reference: it was homed with another `homing`" in move(run, code=1)
