"""A run makes no limit of a drive wider: the narrower one of the hardware file and the drive counts."""

import pytest

from hw_bridge.bus import Bus, SimulatedNetwork
from hw_bridge.commission import planned_rows
from hw_bridge.device import Drive, Motor
from hw_bridge.hardware import HardwareKeys
from hw_bridge.master import Master
from hw_bridge.master.limits import LIMITS, POSITION_LIMITS
from hw_bridge.profiles import profile
from tests.hw_bridge.values import each_write
from twin.errors import SimulationError

WIDE = {
    "velocity": "900 mm/s",
    "following_error": "30 mm",
    "position": ["-300 mm", "300 mm"],
    "acceleration": "20 m/s^2",
}
TURNS = {
    "velocity": "300 rad/s",
    "following_error": "3 turn",
    "position": ["-30 turn", "30 turn"],
    "acceleration": "900 rad/s^2",
    "force": "0.5 N*m",
}
OWN = {
    "faulhaber_v3": {
        (0x607F, 0): 150,
        (0x6080, 0): 200,
        (0x6065, 0): 700,
        (0x607D, 1): -5000,
        (0x607D, 2): 6000,
        (0x6072, 0): 900,
        (0x60E0, 0): 1000,
        (0x60E1, 0): 1100,
    },
    "mclm": {(0x607F, 0): 150, (0x607D, 1): -5000, (0x607D, 2): 6000, (0x2333, 1): 300, (0x2333, 2): 600},
    "epos4": {
        (0x607F, 0): 100,
        (0x6080, 0): 120,
        (0x6065, 0): 900,
        (0x607D, 1): -4000,
        (0x607D, 2): 5000,
        (0x60C5, 0): 700,
        (0x3001, 1): 1000,
        (0x3001, 2): 2000,
    },
}


class Bench:
    """A drive with limits of its own, and all that is written to it."""

    def __init__(self, name, build, own, **keys):
        chosen = profile(name)
        self.drive = Drive(chosen, 1, Motor(chosen.motor, build=build))
        self.drive.dictionary.values.update(own)
        bus = Bus()
        bus.attach(self.drive)
        self.written = {}
        each_write(self.drive, self.note)
        limits = TURNS if name == "epos4" else WIDE
        self.keys = HardwareKeys.model_validate(
            {"simulated": True, "nodes": {"axis": {"node": 1, "profile": name, "limits": limits, **keys}}}
        )
        self.master = Master(self.keys, SimulatedNetwork(bus))

    def note(self, index, sub, data):
        entry = self.drive.dictionary.entry(index, sub)
        self.written.setdefault((index, sub), []).append(entry.decode(data))


@pytest.fixture(params=OWN)
def bench(request, build):
    return Bench(request.param, build, OWN[request.param])


@pytest.mark.parametrize("name", OWN)
def test_every_limit_that_a_drive_has_is_read(name):
    has = {(entry.index, entry.sub) for entry in profile(name).objects}
    assert has & {*LIMITS, *POSITION_LIMITS} == OWN[name].keys()


def test_no_limit_is_written_wider(bench):
    own = OWN[bench.drive.profile.name]
    bench.master.begin({"axis": 0.0})
    found = bench.master.nodes["axis"]
    factor = 1000 if bench.drive.profile.name == "epos4" else 1  # rpm became mrpm
    for place, values in bench.written.items():
        if place not in own:
            continue
        most = own[place] * (factor if LIMITS.get(place) == "velocity" else 1)
        assert (
            all(value >= most for value in values) if place == (0x607D, 1) else all(value <= most for value in values)
        ), place
    limits, units, scale = found.keys.limits, profile(bench.drive.profile.name).units(bench.drive.dictionary), 1.0
    assert limits.velocity == pytest.approx(own[0x607F, 0] * factor * units.velocity * scale)
    assert limits.position == pytest.approx([one * units.position for one in (own[0x607D, 1], own[0x607D, 2])])
    if (0x6065, 0) in own:
        assert limits.following_error == pytest.approx(own[0x6065, 0] * units.position)
    bench.master.stop()


def test_the_list_says_which_one_counts(bench):
    bench.master.wait(500_000_000)
    rows = planned_rows(bench.master.plan(bench.master.nodes["axis"]))
    narrowed = [row for row in rows if row.reason.endswith("the drive's own is narrower and counts")]
    names = {row.object for row in narrowed}
    assert "6083h.0" in names or bench.drive.profile.name != "epos4"
    assert not {"6072h.0", "60E0h.0", "2333h.2", "3001h.2"} & {row.object for row in rows}  # nobody asked for them


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "place", "wanted", "kept"),
    [("faulhaber_v3", "6072h", 1500, 900), ("mclm", "2333h.2", 900, 600), ("epos4", "3001h.2", 9000, 2000)],
)
def test_objects_of_the_hardware_file_do_not_widen_either(build, name, place, wanted, kept):
    bench = Bench(name, build, OWN[name], objects={place: wanted})
    bench.master.begin({"axis": 0.0})
    index, _, sub = place.replace("h", "").partition(".")
    assert bench.drive.dictionary.get(int(index, 16), int(sub or 0)) == kept
    bench.master.stop()
    bench = Bench(name, build, OWN[name], objects={place: 200})
    bench.master.begin({"axis": 0.0})
    assert bench.drive.dictionary.get(int(index, 16), int(sub or 0)) == 200
    bench.master.stop()
    assert bench.drive.dictionary.get(int(index, 16), int(sub or 0)) == OWN[name][int(index, 16), int(sub or 0)]


def test_narrower_ones_of_the_file_are_written(build):
    bench = Bench("faulhaber_v3", build, OWN["faulhaber_v3"])
    bench.keys.nodes["axis"].limits.velocity = 0.05
    bench.master = Master(bench.keys, bench.master.network)
    bench.master.begin({"axis": 0.0})
    assert bench.drive.dictionary.get(0x607F) == bench.drive.dictionary.get(0x6080) == 50
    bench.master.stop()
    assert (bench.drive.dictionary.get(0x607F), bench.drive.dictionary.get(0x6080)) == (150, 200)


@pytest.mark.parametrize("low", [310_000, 500_000])  # within the tenth that is added to the file's limits, and beyond
def test_ranges_without_a_common_position_are_refused(build, low):
    own = {**OWN["faulhaber_v3"], (0x607D, 1): low, (0x607D, 2): 600_000}
    bench = Bench("faulhaber_v3", build, own)
    with pytest.raises(
        SimulationError,
        match=rf"axis: limits\.position .* and the drive's own 607Dh, {low / 1000:.2f} mm to 600\.00 mm",
    ):
        try:
            bench.master.begin({"axis": 0.0})
        finally:
            bench.master.stop()
    assert bench.drive.dictionary.get(0x607D, 1) == low


@pytest.mark.parametrize(("name", "index"), [("faulhaber_v3", 0x607C), ("epos4", 0x30B0), ("epos4", 0x30B1)])
def test_an_offset_of_homing_is_refused_before_anything_is_written(build, name, index):
    homing = {
        "method": 37,
        "at": "0 deg" if name == "epos4" else "0 mm",
        "speed": "10 rad/s" if name == "epos4" else "10 mm/s",
    }
    bench = Bench(name, build, {**OWN[name], (index, 0): 40}, homing=homing)
    with pytest.raises(
        SimulationError, match=rf"{index:04X}h is 40, so that the drive does not count 0 at its reference"
    ):
        bench.master.begin({"axis": 0.0})
    bench.master.stop()
    assert set(bench.written) <= {(0x6040, 0)}


@pytest.mark.parametrize("name", OWN)
def test_a_drive_outside_of_its_own_limits_is_not_enabled(build, name):
    """Its 607Dh clips targets: it would go to the limit at once."""
    bench = Bench(name, build, {**OWN[name], (0x607D, 1): 2500, (0x607D, 2): 4700})
    bench.master.wait(500_000_000)
    with pytest.raises(SimulationError, match=r"axis: stands at 0\.00 mm, outside of the drive's own 607Dh"):
        try:
            bench.master.begin({"axis": 0.0})
        finally:
            bench.master.stop()
    assert (0x607D, 1) not in bench.written
    assert not bench.drive.axis.motor.powered
    assert bench.drive.dictionary.get(0x6064) == pytest.approx(0, abs=2)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("inverted", "start", "ends"),
    [(False, 0.0, (-25, 35)), (True, 0.0, (-35, 25)), (False, 0.04, (-65, 5)), (False, -0.05, (-5, 85))],
)
def test_software_limits_are_a_tenth_beyond_those_of_the_file(build, inverted, start, ends):
    """In the drive's own count, which is 0 where it stands; further out where the drive stands outside of the file's."""
    bench = Bench("mclm", build, {(0x607D, 1): 0, (0x607D, 2): 0}, inverted=inverted)
    bench.keys.nodes["axis"].limits.position = [-0.02, 0.03]
    bench.master = Master(bench.keys, bench.master.network)
    bench.master.begin({"axis": start})
    node = bench.master.nodes["axis"]
    written = [bench.written[0x607D, sub][-1] * 1e3 * node.units.position for sub in (1, 2)]
    assert written == pytest.approx(ends, abs=0.1)
    bench.master.stop()
