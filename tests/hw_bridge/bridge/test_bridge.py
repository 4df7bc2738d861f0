"""The bridge on simulated drives of every vendor: what it writes, how it moves them, how it brings them up."""

import dataclasses

import pytest
from fmus.rotary_drive.model import RotaryDrive

from hw_bridge.bus import MILLISECOND, SimulatedNetwork
from hw_bridge.dictionary import TEXT, U16, Mode, State, record, sub
from hw_bridge.master import setup
from hw_bridge.plant import plant
from hw_bridge.profiles import DRIVE_PROFILES, profile
from hw_bridge.session import Session
from tests.hw_bridge.axis import Rig, node, wire_other_drive
from tests.hw_bridge.profiles import fast
from twin.errors import SimulationError

# The EPOS4 turns a screw of 20 mm: 1 m is 314 rad. Its motor has a rig to turn, which runs on for a while without current.
SCREW = {"scale": 0.02 / 6.283185307179586}
NODES = {
    "faulhaber_v3": node(),
    "mclm": node("mclm"),
    "epos4": node("epos4", limits={"force": "10 kN"}, **SCREW),
    "epos2": node("epos2", limits={"force": "10 kN"}, **SCREW),
}
CSP, CSV = 8, 9


@pytest.fixture(params=DRIVE_PROFILES)
def rig(request, build):
    return Rig(build, {"servomotor": NODES[request.param]})


@pytest.mark.slow
@pytest.mark.parametrize("rig", fast("faulhaber_v3", "mclm"), indirect=True)
def test_a_velocity_becomes_a_way(rig):
    """csv, or pv where the drive has no csv; slower than FAULHABER's unit of 1 mm/s, too."""
    slow = (
        0.004 if rig.session.keys.nodes["servomotor"].profile.startswith("epos") else 0.0004
    )  # its loop takes a while to overcome the rig's friction
    for speed in (0.02, -0.03, slow):
        rig.set(target_velocity=speed)
        rig.go(600)
        before = rig.get("position")
        rig.go(1000)
        assert rig.get("position") - before == pytest.approx(speed, rel=0.02, abs=1e-4)
        assert rig.get("position_actual_value") == pytest.approx(rig.get("position"), abs=2.5e-4)
    assert rig.drive.dictionary.get(0x6061) == (Mode.CSV if Mode.CSV in rig.drive.profile.modes else Mode.PV)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("cycle", [1, 2, 10])
def test_other_cycles(build, cycle):
    others = {"other": node("mclm", 2)} if cycle > 1 else {}
    rig = Rig(build, {"servomotor": node()} | others, cycle=f"{cycle} ms")
    rig.set(target_velocity=0.02)
    rig.go(500)
    assert rig.get("position") == pytest.approx(0.01, rel=0.1)
    assert rig.master.timing.summary()["cycles"] == 500 // cycle
    assert rig.drive.dictionary.get(0x60C2, 1) == cycle


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("rig", fast("faulhaber_v3", "epos2"), indirect=True)
def test_a_position_is_reached(rig):
    """csp, or a new set-point in each cycle where the drive has no csp."""
    rig.set(mode_of_operation=CSP)
    for step in range(200):
        rig.set(target_position=step * 5e-5)
        rig.go(5)
    rig.go(300)
    assert rig.get("position") == pytest.approx(199 * 5e-5, abs=1e-4)
    assert rig.drive.dictionary.get(0x6061) == (Mode.CSP if Mode.CSP in rig.drive.profile.modes else Mode.PP)


@pytest.mark.slow
def test_an_inverted_axis_goes_the_other_way(build):
    rig = Rig(build, {"servomotor": node(inverted=True)})
    rig.set(target_velocity=0.02, load_force=-1.0)
    rig.go(1000)
    assert rig.get("position") == pytest.approx(0.02, rel=0.03)
    assert rig.plant.motor.position == pytest.approx(-0.02, rel=0.03)
    assert rig.get("force") > 1.0  # against load and friction


def test_no_jump_at_enable(build):
    """Targets that an earlier host left in the drive, and a target that is there from the first step."""
    rig = Rig(build, {"servomotor": node(limits={"force": "40 N"})})
    seen = []
    network = SimulatedNetwork.advance

    def watched(self, *given):
        network(self, *given)
        seen.append((rig.drive.state, rig.drive.axis.velocity))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SimulatedNetwork, "advance", watched)
        begin = Session.network

        def stale(self):
            made = begin(self)
            self.bench.bus.advance(200 * MILLISECOND)
            values = self.bench.plants["servomotor"].drive.dictionary.values
            values[0x60FF, 0], values[0x607A, 0], values[0x6060, 0] = 500, 30_000, Mode.CSV
            return made

        patch.setattr(Session, "network", stale)
        rig.set(target_velocity=0.25)
        rig.go(1)
    assert any(state is State.ENABLED for state, _ in seen)
    assert max(abs(speed) for _, speed in seen) < 1e-3
    assert rig.get("position") == pytest.approx(0.0, abs=2e-5)
    rig.go(100)
    assert rig.get("velocity") == pytest.approx(0.25, rel=0.05)


def test_a_position_target_far_from_the_drive_is_refused(build):
    rig = Rig(build, {"servomotor": node()})
    rig.set(mode_of_operation=CSP)
    rig.go(10)
    rig.set(target_position=0.02)
    with pytest.raises(SimulationError, match=r"target_position 20\.00 mm is 20\.00 mm from where the drive is"):
        rig.go(10)
    assert rig.drive.state is not State.ENABLED


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("mode", "text"),
    [
        (
            10,
            r"servomotor: mode_of_operation 10: its process data have no force\. Begin in it, or set or connect a target",
        ),
        (1, r"servomotor: mode_of_operation 1: no cyclic mode\. Use 8 \(csp\), 9 \(csv\) or 10 \(cst\)"),
        (77, "servomotor: mode_of_operation 77: no cyclic mode"),
    ],
)
def test_a_mode_that_the_bridge_has_not(build, mode, text):
    """Refused while the motor moves: nothing else than a stop comes of it."""
    rig = Rig(build, {"servomotor": node()})
    rig.set(target_velocity=0.02)
    rig.go(100)
    rig.set(mode_of_operation=mode)
    with pytest.raises(SimulationError, match=text):
        rig.go(10)
    assert rig.drive.state is not State.ENABLED
    assert not rig.plant.motor.powered


@pytest.mark.parametrize(
    ("profile", "mode", "text"),
    [
        ("faulhaber_v3", 77, "servomotor: mode_of_operation 77: no cyclic mode"),
        (
            "mclm",
            10,
            r"servomotor: mode_of_operation 10: FAULHABER MCLM 300x CO has no cst\. Use 8 \(csp\) or 9 \(csv\), or",
        ),
    ],
)
def test_a_mode_that_is_refused_from_the_first_step_on(build, profile, mode, text):
    """Not even a bus comes of it."""
    rig = Rig(build, {"servomotor": node(profile)})
    rig.set(mode_of_operation=mode)
    with pytest.raises(SimulationError, match=text):
        rig.go(1)
    assert rig.session.bench is None


@pytest.mark.slow
def test_it_begins_where_the_scenario_does(build):
    """Without homing the place counts; with it, the drive goes there first."""
    rig = Rig(build, {"servomotor": node()})
    rig.set(target_position=-0.025)
    rig.go(1)
    assert rig.get("position") == pytest.approx(-0.025, abs=1e-5)
    assert rig.plant.motor.position == pytest.approx(-0.025, abs=1e-5)
    rig = Rig(
        build, {"servomotor": node(homing={"method": -3, "at": "-40 mm"}, limits={"position": ["-45 mm", "35 mm"]})}
    )
    rig.set(target_position=0.01)
    rig.go(1)
    assert rig.get("position") == pytest.approx(0.01, abs=2e-4)
    assert rig.plant.motor.position == pytest.approx(0.01, abs=2e-4)


def test_what_is_written_is_in_the_drive(rig):
    rig.go(1)
    get, name = rig.drive.dictionary.get, rig.drive.profile.name
    if name == "mclm":
        assert get(0x2350, 4) == 24
        assert get(0x2321, 2) & 0x0100  # a lost heartbeat trips
    if name == "epos4":
        assert get(0x60C2, 1) == 5
        assert get(0x60A9) == 0xFDB44700
    assert get(0x1016, 1) == 127 << 16 | 60
    assert get(0x1017) == 20
    low, high = (get(0x607D, sub) * rig.drive.axis.units.position * abs(rig.plant.sign) for sub in (1, 2))
    own = 0.04 if name == "mclm" else 1.0  # it is set up for the stroke of its motor
    assert (low, high) == pytest.approx((-min(own, 0.042), min(own, 0.042)), abs=1e-4)
    words = [
        get(0x1600 + n, sub) for n in range(4) for sub in range(1, get(0x1600 + n) + 1) if get(0x1400 + n, 1) >> 31 == 0
    ]
    assert sum(word >> 16 == 0x6040 for word in words) == 1


def test_a_value_that_does_not_stay_is_found(build):
    """Read-back: a drive that takes a value and keeps another."""
    rig = Rig(build, {"servomotor": node()})
    begin = Session.network

    def stubborn(self):
        made = begin(self)
        dictionary = self.bench.plants["servomotor"].drive.dictionary
        dictionary.effects[0x6083] = lambda entry: dictionary.put(entry.index, 1)
        return made

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Session, "network", stubborn)
        with pytest.raises(SimulationError, match=r"6083h\.0 reads 1 after \d+ was written"):
            rig.go(1)


def test_another_drive_than_expected(build):
    for more, text in (({"product": 5}, "product code is 2D51h, expected 5h"), ({"serial": 77}, "serial number is 1h")):
        rig = Rig(build, {"servomotor": node(**more)})
        with pytest.raises(SimulationError, match=text):
            rig.go(1)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("profile", "method"),
    [("faulhaber_v3", 37), ("mclm", 35), ("epos4", 37), ("faulhaber_v3", -3), ("faulhaber_v3", -1)],
)
def test_homing(build, profile, method):
    rig = Rig(build, {"servomotor": {**NODES[profile], "homing": {"method": method}}})
    rig.go(10)
    assert rig.drive.state is State.ENABLED
    assert rig.get("position") == pytest.approx(rig.get("position_actual_value"), abs=2e-4)
    assert rig.get("position") == pytest.approx(0.0, abs=2e-3)


def test_a_homing_method_that_the_drive_has_not(build):
    rig = Rig(build, {"servomotor": node("epos4", homing={"method": 35}, **SCREW)})
    with pytest.raises(SimulationError, match=r"6098h\.0: refused with 06090030h"):
        rig.go(1)


@pytest.mark.slow
@pytest.mark.parametrize(("event", "text"), [("fault", "homing by method -3 was left"), ("gone", "no heartbeat while")])
def test_homing_that_is_disturbed(build, event, text):
    """It is not begun again by itself."""
    rig = Rig(build, {"servomotor": node(homing={"method": -3, "at": "-40 mm"})})
    begin = Session.network

    def disturbed(self):
        made, drive = begin(self), self.bench.plants["servomotor"].drive
        what = {"fault": lambda: drive.inject(0x7300), "gone": lambda: self.bench.bus.detach(drive)}[event]
        self.bench.bus.event_queue.at(1500 * MILLISECOND, what)
        return made

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Session, "network", disturbed)
        with pytest.raises(SimulationError, match=text):
            rig.go(1)
    assert rig.drive.state is not State.ENABLED or event == "gone"


def test_own_objects(build):
    rig = Rig(build, {"servomotor": node(objects={"2344h.4": 150})})
    rig.go(1)
    assert rig.drive.dictionary.get(0x2344, 4) == 150
    rig = Rig(build, {"servomotor": node(objects={"1234.5": 1})})
    with pytest.raises(SimulationError, match=r"1234h\.5: refused with 06020000h, no object\. A run writes it\."):
        rig.go(1)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("value", "text"),
    [
        (-300, ""),
        (65535, ""),
        (65536, r"servomotor: 2FFFh\.2 cannot hold 65536: it has 2 bytes"),
        (7, "refused with 060900"),
    ],
)
def test_objects_that_the_profile_does_not_know(build, monkeypatch, value, text):
    """A real drive's firmware has more of them: it tells how long they are, and what it does not take."""
    known = profile("mclm")
    entries = (sub(1, "Text", TEXT, "const", "longer"), sub(2, "Number", U16, "rw", 0, 8))
    more = dataclasses.replace(known, objects=(*known.objects, *record(0x2FFF, "Unknown", *entries)))
    wire_other_drive(monkeypatch, plant, more)
    rig = Rig(build, {"servomotor": node("mclm", objects={"2FFFh.2": value})})
    if text:
        with pytest.raises(SimulationError, match=text):
            rig.go(1)
    else:
        rig.go(1)
        assert rig.drive.dictionary.get(0x2FFF, 2) == value & 0xFFFF
    rig = Rig(build, {"servomotor": node("mclm", objects={"2FFFh.1": 0})})
    with pytest.raises(SimulationError, match=r"servomotor: 2FFFh\.1 cannot hold 0: it has 6 bytes"):
        rig.go(1)


@pytest.mark.slow
def test_two_drives_share_a_bus(build):
    rig = Rig(build, {"first": node(number=3), "second": node("mclm", number=4)})
    rig.axes["first"].views["target_velocity"][...] = 0.02
    rig.axes["second"].views["target_velocity"][...] = -0.01
    rig.go(1000)
    assert float(rig.axes["first"].views["position"]) == pytest.approx(0.02, rel=0.05)
    assert float(rig.axes["second"].views["position"]) == pytest.approx(-0.01, rel=0.05)
    assert rig.master.timing.summary()["jitter_max"] == 0.0
    assert all(one.lost == one.late == 0 for one in rig.master.nodes.values())


def test_lost_and_late_process_data_are_counted(build):
    from hw_bridge.bus import Disturbance, Kind

    rig = Rig(build, {"servomotor": node()})
    rig.go(100)
    rig.session.bench.bus.disturbances.append(Disturbance(Kind.DROP, 0x181, 0x181, count=2))
    rig.go(50)
    rig.session.bench.bus.disturbances = [Disturbance(Kind.DELAY, 0x181, 0x181, count=1, delay=5 * MILLISECOND)]
    rig.go(50)
    found = rig.master.nodes["servomotor"]
    assert (found.lost, found.late) == (2, 1)


def test_segmented_upload(build):
    """A name of more than four bytes."""
    rig = Rig(build, {"servomotor": node()})
    rig.go(1)
    assert rig.master.nodes["servomotor"].sdo.read(0x100A) == b"0111.02O"


def test_a_silent_node(build):
    from hw_bridge.master import SdoClient, SilentError

    rig = Rig(build, {"servomotor": node()})
    rig.go(1)
    client = SdoClient(55, rig.master.network.send, rig.master.wait)
    with pytest.raises(SilentError, match=r"node 55 does not answer"):
        client.read(0x1000, timeout=MILLISECOND)


def test_scaling_of_a_read_value(build):
    """The mirror of the dictionary is what the drive says, not the profile's default."""
    rig = Rig(build, {"servomotor": node()})
    rig.go(1)
    rig.drive.dictionary.values[0x6075, 0] = 1000
    found = rig.master.nodes["servomotor"]
    assert setup.read(found, 0x6075) == 1000
    found.use_units()
    assert found.ampere == pytest.approx(1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["faulhaber_v3", "mclm"])
def test_a_rod_that_turns_a_frame_through_a_pinion(build, profile):
    """20 mm of radius: its own motor moves, not the member's, and a load of 0.1 N m is 5 N on the rod."""
    limits = {
        "position": ["-400 deg", "400 deg"],
        "velocity": "1000 deg/s",
        "force": "3 N*m",
        "following_error": "40 deg",
        "acceleration": "500 rad/s^2",
    }
    rig = Rig(build, {"frame": node(profile, scale=50.0, limits=limits)}, RotaryDrive)
    rig.set(mode_of_operation=CSV, target_velocity=0.5, load_torque=-0.1)
    rig.go(2000)
    assert rig.get("angle") == pytest.approx(1.0, abs=0.05)
    assert rig.plant.motor.position == pytest.approx(rig.get("angle") / 50.0, abs=1e-6)
    force = rig.master.nodes["frame"].force
    assert force == pytest.approx(0.13, abs=0.02)  # the load, and the rod's friction of 1.5 N
