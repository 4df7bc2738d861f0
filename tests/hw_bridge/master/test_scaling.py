"""What lengths follow from: the drive's own values or the named motor's; an assumed scale is shown, and never moved with."""

import dataclasses

import pytest

from hw_bridge.bus import MILLISECOND, Bus, SimulatedNetwork
from hw_bridge.commission import BOOT, SdoSession, objects
from hw_bridge.device import Drive, Motor
from hw_bridge.dictionary import Mode, State
from hw_bridge.hardware import HardwareKeys
from hw_bridge.master import Master
from hw_bridge.plant import plant, store_motor_parameters
from hw_bridge.profiles import MOTORS, motor_parameters, profile
from tests.hw_bridge.axis import Rig, node
from tests.hw_bridge.values import each_write
from twin.errors import SimulationError

LIMITS = {
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


class Bench:
    """A drive that is set up for a motor, with values of its own, and every write to it."""

    def __init__(self, name, build, motor=None, values=(), lacks=(), **keys):
        self.keys = HardwareKeys.model_validate(
            {"simulated": True, "nodes": {"axis": {"node": 1, "profile": name, **LIMITS.get(name, {}), **keys}}}
        )
        known = self.keys.nodes["axis"].drive
        chosen = motor_parameters(known, motor or "profile")
        objects_ = tuple(one for one in known.objects if (one.index, one.sub) not in lacks and one.index not in lacks)
        self.drive = store_motor_parameters(Drive(known, 1, Motor(chosen.model, build=build)), chosen)
        self.drive.dictionary.values.update(dict(values))
        for place in {(one.index, one.sub) for one in known.objects} - {(one.index, one.sub) for one in objects_}:
            del self.drive.dictionary.objects[place[0]][place[1]]
        self.bus = Bus()
        self.bus.attach(self.drive)
        self.writes = []
        each_write(
            self.drive, lambda index, sub, data: self.writes.append((index, sub, int.from_bytes(data, "little")))
        )
        self.network = SimulatedNetwork

    def begin(self):
        master = Master(self.keys, self.network(self.bus))
        try:
            master.begin({"axis": 0.0})
        except SimulationError:
            master.stop()
            raise
        return master

    def refused(self, text):
        with pytest.raises(SimulationError, match=text):
            self.begin()
        assert [one for one in self.writes if one[0] != 0x6040] == []
        assert self.drive.state is not State.ENABLED

    def line(self):
        line = SdoSession(SimulatedNetwork(self.bus), self.keys.nodes)
        line.wait(BOOT)
        return line


def test_the_pitch_of_an_lm1247_is_not_overwritten(build):
    bench = Bench("mclm", build, "lm1247", values={(0x2350, 4): 18})
    master = bench.begin()
    assert not [one for one in bench.writes if one[0] == 0x2350]
    assert master.nodes["axis"].units.position == pytest.approx(1e-6)
    assert bench.drive.axis.units.position == pytest.approx(1e-6)  # in truth
    master.stop()


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("motor", "pitch"), [("lm2070", 24), ("lm1247", 18)])
def test_a_move_is_as_long_as_it_is_asked_for(build, motor, pitch):
    rig = Rig(build, {"servomotor": node("mclm", motor=motor)})
    assert pitch == pytest.approx(1000 * MOTORS[motor].pitch)
    rig.set(target_velocity=0.02)
    rig.go(1000)
    assert rig.drive.dictionary.get(0x2350, 4) == pitch
    moved = rig.plant.motor.position
    assert rig.get("position_actual_value") == pytest.approx(moved, abs=2e-4)  # 0.1 mm in a cycle
    assert moved == pytest.approx(0.02, rel=0.15)


@pytest.mark.parametrize(
    ("name", "motor", "named", "text"),
    [
        (
            "mclm",
            "lm1247",
            "lm2070",
            r"another motor than FAULHABER LM 2070-080-11: 2350h\.4 is 18, 24 with this motor",
        ),
        ("mclm", "lm2070", "lm1247", r"2350h\.4 is 24, 18 with this motor"),
        ("faulhaber_v3", "lm1247", "lm2070", r"6092h\.1 is 18000, 24000 with this motor"),
    ],
)
def test_a_drive_for_another_motor_stops_the_run(build, name, motor, named, text):
    bench = Bench(name, build, motor)
    bench.keys = HardwareKeys.model_validate(
        {"simulated": True, "nodes": {"axis": {"node": 1, "profile": name, "motor": named}}}
    )
    bench.refused(text)


def test_a_v3_for_an_lm1247_is_understood_without_its_name(build):
    bench = Bench("faulhaber_v3", build, "lm1247")
    master = bench.begin()
    assert master.nodes["axis"].units.position == pytest.approx(1e-6)
    assert bench.drive.axis.units.position == pytest.approx(1e-6)
    master.stop()


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("divisor", "unit"), [(60_000, 1e-3), (6000, 1e-4), (600_000, 1e-2)])
def test_a_v3_counts_velocities_by_its_velocity_factor(build, divisor, unit):
    bench = Bench("faulhaber_v3", build, values={(0x6096, 2): divisor})
    master = bench.begin()
    node = master.nodes["axis"]
    assert node.units.velocity == pytest.approx(unit)
    assert bench.drive.axis.units.velocity == pytest.approx(unit)  # in truth
    node.mode, node.target_velocity = Mode.CSV, 0.02
    for _ in range(100):
        master.exchange()
        master.wait(5 * MILLISECOND)
    assert bench.drive.axis.velocity == pytest.approx(0.02, rel=0.05)
    assert node.velocity == pytest.approx(0.02, rel=0.05, abs=unit)
    master.stop()


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({(0x6096, 2): 4096}, r"a unit of velocity is 6\.82667e-05 m/s \(6096h\), no power of ten"),  # its default
        ({(0x6096, 2): 1000}, r"a unit of velocity is 1\.66667e-05 m/s"),  # mm/s, if it counted by the second
        ({(0x607E, 0): 0x40}, r"607Eh is 40h: velocities are reversed, positions are not"),
    ],
)
def test_velocities_of_a_v3_in_no_known_unit_are_not_moved(build, values, text):
    Bench("faulhaber_v3", build, values=values).refused(f"its scale is ASSUMED: {text}")


class WallClockNetwork(SimulatedNetwork):
    """A network whose drives are not simulated by this program, as far as the master knows."""

    wall_clock = True


def test_accelerations_of_a_v3_are_not_moved_with_without_their_unit(build):
    """No object of it states the unit; the profile's is recalled."""
    bench = Bench("faulhaber_v3", build)
    bench.network = WallClockNetwork
    bench.refused(
        r"axis: its scale is ASSUMED: no object states the unit of acceleration, nor does the hardware file; add it as the "
        r"vendor's manual has it, such as `units: \{acceleration: 1 mm/s\^2\}`"
    )


def test_the_unit_of_the_hardware_file_counts_for_accelerations(build):
    """A V3.0 that multiplies by its velocity factor, as it does for turns, would count by 60 mm/s^2."""
    units = {"acceleration": "60 mm/s^2"}
    bench = Bench("faulhaber_v3", build, units=units, limits={"acceleration": "0.6 m/s^2"})
    bench.network = WallClockNetwork
    master = bench.begin()
    assert master.nodes["axis"].units.acceleration == pytest.approx(60e-3)
    assert bench.drive.axis.units.acceleration == pytest.approx(60e-3)
    assert (0x6084, 0, 10) in bench.writes
    assert (0x6085, 0, 10) in bench.writes
    master.stop()


@pytest.mark.parametrize(
    ("name", "values", "text"),
    [
        ("mclm", {(0x608F, 1): 2048}, r"608Fh\.1 is 2048: the sensor is not the motor's Hall sensors"),
        ("mclm", {(0x607E, 0): 0x80}, r"607Eh is 80h: positions are reversed, velocities are not"),
        ("epos2", {(0x608A, 0): 0x01}, r"608Ah is 1h: positions are no counts"),
        ("epos2", {(0x608C, 0): 0xA3}, r"608Ch is A3h: velocities are no rpm"),
        ("epos2", {(0x608E, 0): 0xA3}, r"608Eh is A3h: accelerations are no rpm/s"),
        ("epos4", {(0x60A8, 0): 0x00410000}, r"60A8h is 410000h: positions are no increments"),
        ("epos4", {(0x60A9, 0): 0x00B40300}, r"60A9h is B40300h: velocities are no rpm"),
        ("epos4", {(0x60AA, 0): 0x00C04700}, r"60AAh is C04700h: accelerations are no rpm/s"),
        ("epos4", {(0x3000, 2): 0x00011111}, r"3000h\.2 is 11111h: a gear is configured"),
        ("epos4", {(0x3001, 5): 91_000, (0x6076, 0): 200_000}, r"6076h is 200000 uNm, 3001h tells 455000"),
    ],
)
def test_scales_of_another_kind_are_not_moved(build, name, values, text):
    Bench(name, build, values=values).refused(f"its scale is ASSUMED: .*{text}")


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("name", "values", "kind", "unit"),
    [
        ("mclm", {(0x6091, 1): 2}, "position", 2e-6),
        ("epos2", {(0x608B, 0): -3}, "velocity", 2e-3 * 3.141592653589793 / 60),
        ("epos2", {(0x608D, 0): -1}, "acceleration", 0.2 * 3.141592653589793 / 60),
        ("epos4", {(0x60AA, 0): 0xFEC00300}, "acceleration", 0.02 * 3.141592653589793 / 60),
    ],
)
def test_scales_that_the_drive_tells_are_used(build, name, values, kind, unit):
    keys = {} if name == "mclm" else {**LIMITS["epos4"]}
    bench = Bench(name, build, values=values, **keys)
    master = bench.begin()
    assert getattr(master.nodes["axis"].units, kind) == pytest.approx(unit)
    assert getattr(bench.drive.axis.units, kind) == pytest.approx(unit)
    master.stop()


def test_user_units_that_are_no_micrometers_need_the_motors_name(build):
    values = {(0x6092, 1): 1000, (0x6096, 2): 2500}
    Bench("faulhaber_v3", build, values=values).refused(
        r"axis: its scale is ASSUMED: a magnetic pitch is 1000 user units"
    )
    bench = Bench("faulhaber_v3", build, values=values, scaling={"6092h.1": 1000})
    bench.keys.nodes["axis"].__dict__["motor"] = "lm2070"
    master = bench.begin()
    assert master.nodes["axis"].units.position == pytest.approx(24e-6)
    assert bench.drive.axis.units.position == pytest.approx(24e-6)
    master.stop()


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({(0x3000, 1): 0x300, (0x3000, 2): 0x00020121}, r"the main sensor \(3000h\) is an SSI encoder \(3012h\)"),
        ({(0x3000, 1): 0x00100201, (0x3000, 2): 0x00020111}, "is sensor 2 of type 2"),
        ({(0x3000, 1): 0x00100000}, "is sensor 1 of type 0"),
    ],
)
def test_an_epos4_with_another_sensor_is_not_moved(build, values, text):
    Bench("epos4", build, values=values).refused(f"its scale is ASSUMED: .*{text}")


def test_an_epos4_whose_firmware_tells_the_resolution(build):
    bench = Bench("epos4", build, values={(0x3000, 1): 0x300, (0x3000, 2): 0x00020121}, scaling={"3000h.5": 2000})
    master = bench.begin()
    assert bench.drive.state is State.ENABLED
    master.stop()


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("mclm", (0x2350, 4)),
        ("mclm", (0x6092, 1)),
        ("mclm", (0x608F, 1)),
        ("mclm", (0x6091, 1)),
        ("faulhaber_v3", (0x6092, 1)),
        ("faulhaber_v3", (0x6096, 1)),
        ("faulhaber_v3", (0x6096, 2)),
        ("epos2", (0x608C, 0)),
        ("epos2", (0x608D, 0)),
        ("epos4", (0x60A8, 0)),
        ("epos4", (0x60A9, 0)),
        ("epos4", (0x60AA, 0)),
    ],
)
def test_an_object_that_does_not_answer_is_assumed_and_told(build, name, place):
    bench = Bench(name, build)
    bench.drive.dictionary.checks.clear()
    upload = bench.drive.dictionary.upload

    def silent(index, sub):
        if (index, sub) == place:
            from hw_bridge.dictionary import Abort, Code

            raise Abort(Code.NO_OBJECT)
        return upload(index, sub)

    bench.drive.dictionary.upload = silent
    object_ = rf"{place[0]:04X}h\.{place[1]} .* does not answer, \d+ is assumed"
    with pytest.raises(SimulationError, match=f"its scale is ASSUMED: {object_}"):
        bench.begin()
    line = bench.line()
    found = line.drive("axis")
    objects.learn(found)
    (entry,) = objects.find(found.mirror.entries(), "profile_velocity")
    assert "scale ASSUMED)" in objects.format_value(found, entry, objects.upload(found, entry))


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("faulhaber_v3", (0x6096, 1)),
        ("faulhaber_v3", (0x6096, 2)),
        ("faulhaber_v3", (0x6092, 2)),
        ("mclm", (0x6091, 2)),
    ],
)
def test_a_scale_of_0_is_told(build, name, place):
    bench = Bench(name, build)
    upload = bench.drive.dictionary.upload
    bench.drive.dictionary.upload = lambda *address: bytes(4) if address == place else upload(*address)
    bench.refused(rf"its scale is ASSUMED: {place[0]:04X}h\.{place[1]} is 0")


def test_a_value_of_the_hardware_file_stands_for_it(build):
    bench = Bench("faulhaber_v3", build, scaling={"6075h": 790})
    del bench.drive.dictionary.objects[0x6075]
    bench.drive.axis.units  # noqa: B018 - it has measured
    master = Master(bench.keys, SimulatedNetwork(bench.bus))
    from hw_bridge.master import setup

    master.wait(500_000_000)
    found = master.nodes["axis"]
    setup.learn_scaling(found)
    assert found.own.assumed == []
    assert found.units.torque == pytest.approx(790e-6)


def test_motors_have_values_for_the_drives_that_they_are_wired_to():
    for one in MOTORS.values():
        for name, values in one.scaling.items():
            known = {(entry.index, entry.sub) for entry in profile(name).objects}
            assert set(values) <= known
            assert set(values) <= set(profile(name).scaling)
    assert dataclasses.is_dataclass(MOTORS["lm2070"])
    assert plant
