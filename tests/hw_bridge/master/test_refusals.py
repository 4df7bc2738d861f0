"""A drive that refuses one SDO access of the set-up, and a hardware file that takes away what stops a drive."""

import pytest

from hw_bridge.bus import MILLISECOND, Bus, SimulatedNetwork
from hw_bridge.device import Drive, Motor
from hw_bridge.dictionary import Abort, Code, State
from hw_bridge.hardware import HardwareKeys
from hw_bridge.master import Master
from hw_bridge.plant import store_motor_parameters
from hw_bridge.profiles import DRIVE_PROFILES, motor_parameters
from tests.hw_bridge.bridge.test_bridge import NODES
from tests.hw_bridge.values import held
from twin.errors import SimulationError


class Bench:
    """A drive, brought up and stopped. `victim`: (write, index, sub) of the access that it refuses with `code`."""

    def __init__(self, name, build, victim=None, code=Code.DEVICE_STATE, **more):
        keys = HardwareKeys.model_validate({"simulated": True, "nodes": {"axis": {**NODES[name], **more}}})
        profile = keys.nodes["axis"].drive
        motor = motor_parameters(profile, keys.nodes["axis"].motor)
        self.drive = store_motor_parameters(Drive(profile, 1, Motor(motor.model, build=build)), motor)
        self.victim, self.code, self.accesses, self.error = victim, code, [], ""
        bus = Bus()
        bus.attach(self.drive)
        bus.advance(500 * MILLISECOND)
        before, dictionary = held(self.drive), self.drive.dictionary
        upload, download = dictionary.upload, dictionary.download
        dictionary.upload = lambda index, sub: self.refuse(False, index, sub) or upload(index, sub)
        dictionary.download = lambda index, sub, data: self.refuse(True, index, sub) or download(index, sub, data)
        self.master = Master(keys, SimulatedNetwork(bus))
        try:
            self.master.begin({"axis": 0.0})
        except SimulationError as error:
            self.error = str(error)
        finally:
            self.master.stop()
        bus.advance(bus.now + 300 * MILLISECOND)
        self.changed = {address for address, value in held(self.drive).items() if value != before[address]}

    def refuse(self, is_write, index, sub):
        """Note an access, and abort the victim; commands (6040h) are taken."""
        access = is_write, index, sub
        self.accesses.append(access)
        if access == self.victim and index != 0x6040:
            raise Abort(self.code)


def beyond_the_count(drive, index, sub):
    """Whether this is a mapping entry beyond the count: it has no effect."""
    is_mapping = 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00
    return is_mapping and sub > drive.dictionary.get(index)


@pytest.mark.slow
@pytest.mark.parametrize("code", [Code.DEVICE_STATE, Code.NO_SUBINDEX])
@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_every_access_that_is_refused_ends_safe(build, name, code):
    for victim in dict.fromkeys(Bench(name, build).accesses):
        bench = Bench(name, build, victim, code)
        assert bench.drive.state is State.DISABLED, victim
        assert not bench.drive.axis.motor.powered, victim
        assert "\n" not in bench.error
        left = {place for place in bench.changed if not beyond_the_count(bench.drive, *place)}
        assert all(any(f"{index:04X}h.{sub}" in note for note in bench.master.notes) for index, sub in left), victim


@pytest.mark.parametrize(("name", "place"), [("epos4", (0x1600, 1)), ("mclm", (0x1601, 2))])
def test_a_mapping_entry_that_cannot_be_read_is_not_written(build, name, place):
    """It is within the count, so that its value before would be lost."""
    bench = Bench(name, build, (False, *place))
    assert f"{place[0]:04X}h.{place[1]}: refused with 08000022h" in bench.error
    assert bench.changed == set()


def test_a_rated_current_without_its_subindex(build):
    """6075h has it too: the record 2329h is not read any further."""
    assert Bench("faulhaber_v3", build, (False, 0x2329, 1), Code.NO_SUBINDEX).error == ""


def test_a_polarity_that_cannot_be_read_is_assumed(build):
    assert "607Eh.0 cannot be read" in Bench("mclm", build, (False, 0x607E, 0)).error


@pytest.mark.parametrize(
    ("name", "objects", "text"),
    [
        ("faulhaber_v3", {"6007h": 0}, "6007h Abort connection option code is 0"),
        ("epos4", {"6007h": 0}, "6007h Abort connection option code is 0"),
        ("mclm", {"2321h.2": 0}, "2321h.2 has not the bit 100h"),
    ],
)
def test_a_file_that_lets_a_drive_go_on_alone_is_refused(build, name, objects, text):
    bench = Bench(name, build, objects=objects)
    assert f"axis: {text}" in bench.error
    assert "in csv and pv it may go on when this program dies" in bench.error
    assert bench.changed == set()


def test_a_reference_far_outside_of_the_limits_is_refused(build):
    keys = {"homing": {"method": -3, "at": "-400 mm"}, "limits": {"position": ["-35 mm", "35 mm"]}}
    assert (
        "homing: `at` -400.00 mm is 365.00 mm outside of limits.position" in Bench("faulhaber_v3", build, **keys).error
    )
