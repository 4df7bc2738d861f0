"""What decides how a drive homes, limits its current and stops: read, compared, shown in `check`, not written."""

import pytest

from hw_bridge.bus import Bus, SimulatedNetwork
from hw_bridge.command import hil
from hw_bridge.commission import BOOT, SdoSession, inspect, objects
from hw_bridge.commission.inspection import GROUPS, MORE
from hw_bridge.device import Drive, Motor
from hw_bridge.dictionary import U8, U16, U32, Entry, var
from hw_bridge.hardware import HardwareKeys
from hw_bridge.profiles import DRIVE_PROFILES, profile
from tests.hw_bridge.values import each_write, held

BLOCK = {"faulhaber_v3": -3, "epos4": -3, "mclm": 35}


class Bench:
    """A drive with values of its own, and what `inspect` says of it."""

    def __init__(self, name, build, values=(), more=(), **keys):
        chosen = profile(name)
        self.drive = Drive(chosen, 1, Motor(chosen.motor, build=build))
        for entry in more:
            self.drive.dictionary.objects.setdefault(entry.index, {})[entry.sub] = entry
        self.drive.dictionary.values.update(dict(values))
        bus = Bus()
        bus.attach(self.drive)
        own = HardwareKeys.model_validate({"simulated": True, "nodes": {"axis": {"node": 1, "profile": name, **keys}}})
        self.line = SdoSession(SimulatedNetwork(bus), own.nodes)
        self.line.wait(BOOT)
        self.writes = []
        each_write(self.drive, lambda *one: self.writes.append(one))
        self.found = inspect(self.line.drive("axis"))

    def value(self, object_):
        return next(row[2] for rows in self.found.groups.values() for row in rows if row[0] == object_)

    @property
    def objects(self):
        return {row[0] for rows in self.found.groups.values() for row in rows}


EXPECTED = {
    "faulhaber_v3": {"607Ch.0", "6072h.0", "60E0h.0", "60E1h.0", "6075h.0", "605Ah.0", "605Bh.0", "605Ch.0", "605Dh.0",
                     "605Eh.0", "6007h.0", "1029h.1", "6065h.0", "6066h.0", "60FDh.0", "60FEh.1", "60FEh.2"},
    "mclm": {"607Ch.0", "2333h.1", "2333h.2", "1029h.1", "60FDh.0"},
    "epos4": {"30B0h.0", "30B1h.0", "30B2h.0", "3001h.1", "3001h.2", "605Ah.0", "605Bh.0", "605Ch.0", "605Eh.0", "6007h.0",
              "1029h.1", "6066h.0", "3142h.1", "3158h.1", "3202h.1", "60FEh.1"},
    "epos2": {"607Ch.0", "605Bh.0", "605Ch.0", "605Eh.0", "6007h.0", "6065h.0"},
}  # fmt: skip


def test_every_inspected_object_is_known():
    """Each is listed once, and is an object of a profile or has a name and a type of its own."""
    of_profiles = {(entry.index, entry.sub) for name in DRIVE_PROFILES for entry in profile(name).objects}
    inspected = [address for addresses in GROUPS.values() for address in addresses]
    assert len(inspected) == len(set(inspected))
    assert set(inspected) <= of_profiles | MORE.keys()
    assert MORE.keys() <= set(inspected)


@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_all_of_it_is_read_and_nothing_written(build, name):
    bench = Bench(name, build)
    assert bench.objects >= EXPECTED[name]
    assert bench.writes == []


def test_the_scale_is_shown_with_what_it_follows_from(build):
    rows = {name: (object_, value) for object_, name, value in Bench("faulhaber_v3", build).found.groups["scale"]}
    assert rows["one unit of velocity"] == ("", "1 mm/s")
    assert rows["one unit of acceleration"] == ("", "0.001 m/s^2")
    assert rows["Divisor"] == ("6096h.2", "60000")


def test_an_assumed_scale_is_shown_as_assumed(build):
    bench = Bench("faulhaber_v3", build, values={(0x6096, 2): 4096})
    node = bench.line.drive("axis")
    objects.learn(node)
    shown = {name: value for _, name, value in inspect(node).groups["scale"]}
    assert shown["one unit of velocity"] == "0.0682667 mm/s, ASSUMED"


@pytest.mark.parametrize("limits", [(900, 800), (800, 900)])
def test_objects_that_the_profile_has_not(build, limits):
    """Of the two homing torque limits the larger one decides."""
    more = [entry for index in (0x2350, 0x2351) for entry in var(index, "x", U16, "rw", 0)]
    values = {(0x2350, 0): limits[0], (0x2351, 0): limits[1]}
    bench = Bench("faulhaber_v3", build, values, more, homing={"method": -3, "at": "-40 mm"}, limits={"force": "8 N"})
    assert [bench.value(f"{index}h.0").partition(" (")[2] for index in (2350, 2351)] == [f"{one})" for one in limits]
    (note,) = [one for one in bench.found.notes if "end stop" in one]
    assert note.startswith("axis: homing pushes against the end stop with 8.276 N, above limits.force 8 N.")
    assert not [
        one for one in Bench("mclm", build).found.groups["homing"] if one[0].startswith("235")
    ]  # the motor there


@pytest.mark.parametrize(
    ("name", "values", "keys", "text"),
    [
        (
            "epos4",
            {(0x30B2, 0): 5000},
            {"scale": 1.5915e-3, "homing": {"method": -3, "at": "-40 mm"}, "limits": {"force": "250 N"}},
            "axis: homing pushes against the end stop with 285.9 N, above limits.force 250 N",
        ),
        ("faulhaber_v3", {}, {"homing": {"method": -3, "at": "-40 mm"}}, "no object tells with which current"),
        ("faulhaber_v3", {(0x605A, 0): 0}, {}, "605Ah is 0: at a quick stop it coasts"),
        ("mclm", {(0x1029, 1): 1}, {}, "1029h.1 is 1: it stays Operational"),
        (
            "faulhaber_v3",
            {},
            {"limits": {"force": "8 N"}},
            "the drive's own currents allow 18.39 N, limits.force is 8 N",
        ),
        ("mclm", {(0x2333, 2): 9000}, {"limits": {"force": "8 N"}}, "the drive's own currents allow 104.8 N"),
        ("epos4", {}, {}, "8250h (RPDO time-out) follows from 60C2h"),
    ],
)
def test_what_does_not_fit_is_told(build, name, values, keys, text):
    assert any(text in note for note in Bench(name, build, values, **keys).found.notes)


@pytest.mark.parametrize("name", DRIVE_PROFILES)
def test_check_shows_the_list_and_writes_nothing(build, name, monkeypatch, capsys):
    from hw_bridge.plant import bench

    made = []

    class Watched(Drive):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            made.append((self, held(self), written := []))
            each_write(self, lambda *one: written.append(one))

    monkeypatch.setattr(bench, "Drive", Watched)
    keys = HardwareKeys.model_validate({"simulated": True, "nodes": {"axis": {"node": 1, "profile": name}}})
    if name == "epos4":
        keys.nodes["axis"].__dict__["scale"] = 1e-3
    hil.compare_bus(keys, build).show()
    told = capsys.readouterr().out
    assert "axis: a run writes" in told
    assert "limits.velocity" in told
    assert "heartbeat.lost_after" in told
    assert "axis: stop, unchanged unless the hardware file sets it:" in told
    ((drive, before, written),) = made
    assert written == []
    if name != "mclm":
        assert held(drive) == before


@pytest.mark.parametrize("name", sorted(DRIVE_PROFILES.keys() - {"epos2"}))  # which has no 60FDh
def test_a_counter_of_sync_and_closed_limit_switches_are_told(build, name):
    bench = Bench(name, build, values={(0x1019, 0): 10}, more=var(0x1019, "x", U8, "rw"))
    assert any("1019h is 10: it takes SYNC with a counter only" in note for note in bench.found.notes)
    assert not any("limit switch" in note for note in bench.found.notes)
    bench.drive.axis.switches.positive = bench.drive.axis.switches.negative = 0.0
    bench.line.wait(10_000_000)
    notes = inspect(bench.line.drive("axis")).notes
    assert any("axis: negative limit switch and positive limit switch closed (60FDh)" in note for note in notes)


def test_enabled_sdo_servers_beside_the_default_one_are_told(build):
    """A second master could write through them without a trace at the identifiers that a run monitors."""
    more = [Entry(0x1201 + number, 1, "Request of a client", U32, "rw") for number in range(3)]
    values = {(0x1201, 1): 0x80000000, (0x1202, 1): 0x641, (0x1203, 1): 0x642}
    notes = Bench("faulhaber_v3", build, values, more).found.notes
    servers = [note for note in notes if "SDO server" in note]
    assert [note.partition(": what")[0] for note in servers] == [
        "axis: 1202h is a second SDO server, at 641h",
        "axis: 1203h is a second SDO server, at 642h",
    ]
    assert not any("SDO server" in note for note in Bench("faulhaber_v3", build).found.notes)
