"""Homing in a run: the procedure of `twin hil home`, refused or stopped before it pushes harder or farther than it may."""

from dataclasses import replace

import pytest

from hw_bridge.dictionary import BLOCKS_MAXON, METHODS, State
from hw_bridge.master import Reference
from hw_bridge.session import Session
from tests.hw_bridge.axis import Rig, node
from twin.errors import SimulationError

LIMITS = {
    "position": ["-35 mm", "35 mm"],
    "velocity": "100 mm/s",
    "force": "8 N",
    "following_error": "3 mm",
    "acceleration": "2 m/s^2",
}
HOMING = {"method": -3, "at": "-40 mm", "speed": "20 mm/s"}


@pytest.fixture
def homes(build, monkeypatch):
    """A rig that homes when it begins, and the largest force and way [N, m] that its motor saw."""

    def made(prepare=lambda drive: None, homing=HOMING, **more):
        begin = Session.network

        def watched(self):
            network = begin(self)
            drive = next(iter(self.bench.plants.values())).drive
            prepare(drive)
            self.bench.bus.observers.append(lambda *_: rig.see())
            return network

        monkeypatch.setattr(Session, "network", watched)
        rig = Rig(build, {"servomotor": node(homing=homing, **{"limits": LIMITS, **more})})
        rig.force = rig.way = 0.0

        def see():
            motor = rig.drive.axis.motor
            rig.force = max(rig.force, abs(motor.current) * 11.64)
            rig.way = max(rig.way, abs(motor.position))

        rig.see = see
        return rig

    return made


def test_a_run_refuses_what_home_refuses(homes):
    """The method goes to the positive end, `at` is the negative one."""
    rig = homes(homing={**HOMING, "method": -4})
    with pytest.raises(SimulationError, match=r"method -4 goes to the positive end, but `at` -40\.00 mm"):
        rig.go(1)
    assert rig.force == 0.0
    assert rig.way == 0.0


@pytest.mark.slow
def test_a_run_homes_with_no_more_than_the_limit_of_the_force(homes):
    rig = homes()
    rig.go(20)
    assert rig.drive.state is State.ENABLED
    assert rig.get("position") == pytest.approx(0.0, abs=1e-4)
    assert rig.drive.axis.motor.position == pytest.approx(0.0, abs=3e-4), (
        "40 mm from the end where it began in the middle"
    )
    assert 5.0 < rig.force < 8.0
    assert [rig.drive.dictionary.get(index) for index in (0x60E0, 0x60E1)] == [6000, 6000], "as it was"


@pytest.mark.slow
def test_a_drive_whose_own_limit_does_not_act_is_stopped(homes):
    """Its force is watched."""

    def prepare(drive):
        measure = drive.axis.measure

        def ignoring():
            measure()
            drive.axis.limit = drive.axis.currents.continuous * 3

        drive.axis.measure = ignoring

    rig = homes(prepare)
    with pytest.raises(SimulationError, match=r"homing by method -3: force -?[\d.]+ N is above 8 N"):
        rig.go(1)
    assert rig.drive.state is not State.ENABLED
    assert not rig.drive.axis.motor.powered


def test_a_drive_that_numbers_its_methods_the_other_way_is_not_taken_for_homed(homes):
    """Vendors disagree: -3 is the positive end of one, the negative end of another."""

    def prepare(drive):
        drive.profile = drive.axis.profile = replace(drive.profile, homing=METHODS | BLOCKS_MAXON)

    rig = homes(prepare)
    with pytest.raises(
        SimulationError, match=r"goes to the positive end instead of the negative one.*not taken for -40"
    ):
        rig.go(1)
    assert rig.way < 6e-3, "the limit of the following error, and the way of the stop"
    assert rig.drive.state is not State.ENABLED


@pytest.mark.slow
def test_a_search_that_finds_nothing_is_stopped_in_a_run_too(homes):
    rig = homes(homing={**HOMING, "at": "-5 mm"}, limits={**LIMITS, "position": ["-5 mm", "5 mm"]})
    with pytest.raises(SimulationError, match=r"homing went 1\d\.\d\d mm and found nothing; the limits are 10\.00 mm"):
        rig.go(1)
    assert rig.way < 13e-3


def test_a_place_to_begin_outside_of_the_limits_is_refused_before_anything_moves(homes):
    rig = homes()
    rig.set(target_position=0.036)
    with pytest.raises(SimulationError, match=r"begins at 36\.00 mm, outside of limits\.position"):
        rig.go(1)
    assert rig.force == 0.0


def when_searching(rig, act):
    """Do something once its search is 10 mm under way."""

    def look(*_):
        if not rig.acted and rig.drive.axis.motor.position < -10e-3:
            rig.acted = True
            act()

    rig.acted, before = False, rig.see
    rig.see = lambda: (before(), look())


@pytest.mark.slow
def test_a_host_that_is_gone_while_it_homes(homes):
    """The drive misses the heartbeat, as it does in a run."""
    rig = homes()
    when_searching(rig, lambda: rig.session.bench.network.close())  # noqa: PLW0108 - it is made later
    with pytest.raises(SimulationError):
        rig.go(1)
    assert rig.acted
    assert rig.drive.state is not State.ENABLED
    assert rig.way < 10e-3 + 0.02 * 0.06 + 1.5e-3, "60 ms at 20 mm/s, and the way of the quick stop"


@pytest.mark.slow
def test_ctrl_c_while_it_homes(homes, monkeypatch):
    from hw_bridge.master import homing

    rig, watch = homes(), homing.Homing.watch

    def interrupted(self):
        if self.node.position < -10e-3 and self.node.homing:
            raise KeyboardInterrupt
        watch(self)

    monkeypatch.setattr(homing.Homing, "watch", interrupted)
    with pytest.raises(KeyboardInterrupt):
        rig.go(1)
    assert rig.drive.state is State.DISABLED
    assert rig.way < 12e-3
    assert not rig.drive.axis.motor.powered


@pytest.mark.slow
def test_another_program_that_stops_the_drive_while_it_homes(homes):
    from hw_bridge.bus import Frame, SimulatedNetwork

    rig = homes()
    when_searching(rig, lambda: SimulatedNetwork(rig.session.bench.bus).send(Frame(0, bytes([2, 1]))))
    with pytest.raises(SimulationError, match="sent NMT command 02h to servomotor"):
        rig.go(1)
    assert rig.drive.state is not State.ENABLED
    assert rig.way < 12e-3


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("counts", "homed"), [(0.030, False), (0.0, True), (0.080, True)])
def test_a_reference_that_is_proven_is_kept_within_the_limits(homes, monkeypatch, counts, homed):
    """6064h is 0 at -40 mm: 30 mm is at -10 mm; 0 and 80 mm are outside of +-35 mm, where the drive's own limits would pull it in."""
    monkeypatch.setattr(Reference, "problem", lambda *_: "")

    def prepare(drive):
        drive.axis.origin -= counts
        drive.dictionary.put(0x607D, -200_000, 1)
        drive.dictionary.put(0x607D, 200_000, 2)

    rig = homes(prepare)
    rig.go(20)
    assert rig.get("position") == pytest.approx(0.0, abs=1e-4)
    assert bool(rig.master.references) is not homed
    if not homed:
        assert rig.way == pytest.approx(0.010, abs=5e-4)  # to where the scenario begins, and nowhere else
        assert rig.master.references == ["servomotor: counts from the reference found before: not homed again."]
    else:
        assert rig.way > 0.035


@pytest.mark.slow
@pytest.mark.parametrize(("method", "profile"), [(17, "faulhaber_v3"), (2, "mclm")])
def test_a_drive_that_booted_before_its_homing_failed_is_no_second_node(build, method, profile):
    """The cause is the missing switch; and it is stopped by process data too, since it has the mapping of this run."""
    homing = {"method": method, "at": "-31 mm" if method == 17 else "31 mm", "speed": "14 mm/s"}
    rig = Rig(build, {"servomotor": node(profile, number=8, homing=homing)})
    with pytest.raises(SimulationError, match=r"homing (by method|went)") as caught:
        rig.go(1)
    assert "two nodes" not in str(caught.value)
    assert rig.master.has_mapping(rig.master.nodes["servomotor"])
