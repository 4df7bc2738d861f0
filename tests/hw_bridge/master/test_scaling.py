"""What lengths follow from: the drive's own values or the named motor's; an assumed scale is shown, and never moved with."""

import dataclasses

import pytest

from hw_bridge.bus import Bus, SimulatedNetwork
from hw_bridge.commission import BOOT, Line, objects
from hw_bridge.device import Drive, Motor
from hw_bridge.dictionary import State
from hw_bridge.hardware import HardwareKeys
from hw_bridge.master import Master
from hw_bridge.plant import plant, set_up_for
from hw_bridge.profiles import MOTORS, motor_parameters, profile
from tests.hw_bridge.axis import Rig, node
from tests.hw_bridge.values import each_write
from twin.errors import SimulationError

LIMITS = {"epos4": {"limits": {"following_error": "10 deg", "position": ["-1 turn", "1 turn"], "velocity": "5 rad/s",
                               "acceleration": "50 rad/s^2", "force": "0.5 N*m"}}}  # fmt: skip


class Bench:
    """A drive that is set up for a motor, with values of its own, and every write to it."""

    def __init__(self, name, build, motor=None, values=(), lacks=(), **keys):
        known = profile(name)
        chosen = motor_parameters(known, motor or "profile")
        objects_ = tuple(one for one in known.objects if (one.index, one.sub) not in lacks and one.index not in lacks)
        self.drive = set_up_for(Drive(known, 1, Motor(chosen.model, build=build)), chosen)
        self.drive.dictionary.values.update(dict(values))
        for place in {(one.index, one.sub) for one in known.objects} - {(one.index, one.sub) for one in objects_}:
            del self.drive.dictionary.objects[place[0]][place[1]]
        self.bus = Bus()
        self.bus.attach(self.drive)
        self.writes = []
        each_write(
            self.drive, lambda index, sub, data: self.writes.append((index, sub, int.from_bytes(data, "little")))
        )
        self.keys = HardwareKeys.model_validate(
            {"simulated": True, "nodes": {"axis": {"node": 1, "profile": name, **LIMITS.get(name, {}), **keys}}}
        )

    def begin(self):
        master = Master(self.keys, SimulatedNetwork(self.bus))
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
        line = Line(SimulatedNetwork(self.bus), self.keys.nodes)
        line.wait(BOOT)
        return line


def test_the_pitch_of_an_lm1247_is_not_overwritten(build):
    bench = Bench("mclm", build, "lm1247", values={(0x2350, 4): 18})
    master = bench.begin()
    assert not [one for one in bench.writes if one[0] == 0x2350]
    assert master.nodes["axis"].units.position == pytest.approx(1e-6)
    assert bench.drive.axis.units.position == pytest.approx(1e-6)  # in truth
    master.stop()


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


def test_user_units_that_are_no_micrometers_need_the_motors_name(build):
    values = {(0x6092, 1): 1000}
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


@pytest.mark.parametrize(
    ("name", "place"),
    [("mclm", (0x2350, 4)), ("mclm", (0x6092, 1)), ("faulhaber_v3", (0x6092, 1)), ("epos4", (0x60A9, 0))],
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
    assert "scale ASSUMED)" in objects.meant(found, entry, objects.upload(found, entry))


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
