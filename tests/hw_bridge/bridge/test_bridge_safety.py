"""Whatever fails, the drives end disabled: limits, errors of drives and bus, contact, a host that is gone."""

import signal

import pytest

from hw_bridge.bus import MILLISECOND, Disturbance, Kind
from hw_bridge.dictionary import State
from hw_bridge.profiles import DRIVE_PROFILES
from tests.hw_bridge.axis import Rig, node
from tests.hw_bridge.bridge.test_bridge import NODES
from tests.matrix import covering
from twin.errors import SimulationError

CONTACT = {"signal": "sensor.measured_force", "distance": "10 mm", "speed": "50 mm/s"}


@pytest.fixture(params=DRIVE_PROFILES)
def rig(request, build):
    """An axis that moves."""
    rig = Rig(build, {"servomotor": NODES[request.param]})
    rig.set(target_velocity=0.05)
    rig.go(200)
    return rig


def after(rig, milliseconds):
    """Let the bus go on without the master."""
    rig.session.bench.bus.advance(rig.session.bench.bus.now + milliseconds * MILLISECOND)


def stopped(drive):
    """No current, no motion."""
    return drive.state not in (State.ENABLED, State.QUICK_STOP) and not drive.axis.motor.powered


def speed(rig):
    return abs(rig.drive.axis.velocity * abs(rig.plant.sign))


@pytest.mark.slow_repetitions
def test_close_stops_and_disables(rig):
    rig.axis.close()
    assert stopped(rig.drive)
    assert rig.session.outcome.notes == []
    after(rig, 500)
    assert speed(rig) < 1e-3
    assert rig.drive.active == {}  # nobody waits for a heartbeat any more
    rig.axis.close()


@pytest.mark.parametrize(
    ("limits", "text"),
    [
        ({"position": ["-5 mm", "11 mm"]}, r"position 11\.\d\d mm is outside -5\.00 mm to 11\.00 mm"),
        ({"velocity": "40 mm/s"}, ""),
        ({"force": "1 N"}, r"force -?[\d.]+ N is above 1 N"),
        ({"following_error": "0.1 mm"}, r"following error -?[\d.]+ mm is above 0\.10 mm"),
    ],
)
def test_limits(build, limits, text):
    rig = Rig(build, {"servomotor": node(limits=limits)})
    rig.set(target_velocity=0.05)
    if not text:  # the target is kept inside
        rig.go(300)
        assert rig.get("velocity") == pytest.approx(0.032, rel=0.05)
        return
    with pytest.raises(SimulationError, match=text):
        rig.go(400)
    assert stopped(rig.drive)
    assert rig.get("position") < 0.015


TARGETS = {8: "target_position", 9: "target_velocity", 10: "target_force"}  # of csp, csv, cst


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "value"), covering(TARGETS, [float("nan"), float("inf"), -float("inf")]))
def test_a_target_that_is_no_number_stops(build, mode, value):
    target = TARGETS[mode]
    rig = Rig(build, {"servomotor": node()})
    rig.set(mode_of_operation=mode)
    rig.go(50)
    rig.set(**{target: value})
    with pytest.raises(SimulationError, match=f"servomotor: {target} is {value}, no number"):
        rig.go(6)
    assert stopped(rig.drive)
    assert speed(rig) < 1e-3


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_start_that_is_no_number_moves_nothing(build, value):
    rig = Rig(build, {"servomotor": node(homing={"method": -3, "at": "-40 mm"})})
    rig.set(target_position=value)
    with pytest.raises(SimulationError, match=f"servomotor: target_position is {value}, no number"):
        rig.go(1)
    assert rig.session.bench is None  # no drive was brought up


@pytest.mark.slow
def test_a_load_that_carries_the_axis_away(build):
    rig = Rig(build, {"servomotor": node(limits={"velocity": "65 mm/s", "force": "100 N"})})
    rig.set(target_velocity=0.05)
    rig.go(200)
    rig.set(load_force=60.0)
    with pytest.raises(SimulationError, match=r"velocity [\d.]+ mm/s is above 65\.00 mm/s"):
        rig.go(400)
    assert rig.drive.state is not State.ENABLED


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("rig", "code"), covering(DRIVE_PROFILES, [0x8611, 0x3210]), indirect=["rig"])
def test_an_emergency(rig, code):
    if code not in rig.drive.profile.faults:
        code = 0x84F0
    rig.drive.inject(code)
    with pytest.raises(SimulationError, match=f"EMCY {code:04X}h"):
        rig.go(100)
    assert stopped(rig.drive)


@pytest.mark.slow
def test_a_lost_node_stops_the_others(build):
    rig = Rig(build, {"first": node(number=3), "second": node("mclm", number=4)})
    for axis in rig.axes.values():
        axis.views["target_velocity"][...] = 0.02
    rig.go(200)
    first, second = (plant.drive for plant in rig.session.bench.plants.values())
    rig.session.bench.bus.detach(first)
    with pytest.raises(SimulationError, match="first: no "):
        rig.go(200)
    assert stopped(second)
    assert any("first: did not confirm" in note for note in rig.session.outcome.notes)
    first.advance(first.port.event_queue.now + 500 * MILLISECOND)  # it has not heard a heartbeat either
    assert first.state is not State.ENABLED


@pytest.mark.slow_repetitions
def test_a_node_that_starts_anew(rig):
    rig.drive.nmt.command(bytes([129, rig.drive.node]))
    with pytest.raises(SimulationError, match=r"servomotor: (started anew|left Operation|no process data|EMCY)"):
        rig.go(500)
    assert stopped(rig.drive)


@pytest.mark.slow_repetitions
def test_bus_off_of_the_master(rig):
    """Everything that the master sends is destroyed: the drive stops by itself, the notes say so."""
    rig.session.bench.bus.disturbances.append(Disturbance(Kind.CORRUPT, 0, 0x7FF))
    with pytest.raises(SimulationError, match=r"bus-off|no heartbeat|no process data"):
        rig.go(500)
    after(rig, 500)
    assert stopped(rig.drive) or rig.drive.state is State.QUICK_STOP
    assert speed(rig) < 1e-3
    assert any("stop by themselves" in note for note in rig.session.outcome.notes)


@pytest.mark.slow_repetitions
def test_a_host_that_is_gone(rig):
    """No more frames of the master: the drive reacts within its heartbeat time, an EPOS4 by missing targets before."""
    lost_after = 60
    first = 0 if rig.drive.profile.rpdo_timeout else 20
    last = rig.session.bench.bus.now
    while rig.drive.state is State.ENABLED:
        after(rig, 1)
    reacted = (rig.session.bench.bus.now - last) / MILLISECOND
    assert first < reacted <= lost_after + 2
    after(rig, 300)
    assert speed(rig) < 1e-3
    assert 0x8130 in rig.drive.active


@pytest.mark.slow_repetitions
def test_a_loop_that_hangs_is_a_host_that_is_gone(rig):
    """The heartbeat comes from the loop itself, not from a thread beside it."""
    beats = []
    rig.session.bench.bus.observers.append(lambda now, frame: beats.append(now) if frame.id == 0x77F else None)
    rig.go(100)
    count = len(beats)
    assert count == pytest.approx(5, abs=1)
    after(rig, 100)
    assert len(beats) == count


@pytest.mark.slow_repetitions
def test_ctrl_c(rig, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(rig.master, "check", interrupted)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        rig.go(10)
    assert stopped(rig.drive)
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("rig", "number"), covering(DRIVE_PROFILES, [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]), indirect=["rig"]
)
def test_a_signal_does_not_interrupt_the_stop(rig, number):
    sent = []

    def impatient(_now, _frame):
        sent.append(signal.raise_signal(number))

    rig.session.bench.bus.observers.append(impatient)
    before = signal.signal(number, signal.default_int_handler)
    try:
        rig.axis.close()
        assert signal.getsignal(number) is signal.default_int_handler
    finally:
        signal.signal(number, before)
    assert len(sent) > 10
    assert stopped(rig.drive)
    assert rig.session.outcome.notes == []


def test_digital_outputs_are_safe_before_and_after(build):
    rig = Rig(build, {"servomotor": node(safe_outputs=5)})
    rig.go(10)
    outputs = rig.drive.dictionary
    assert outputs.get(0x60FE, 1) == 5
    outputs.put(0x60FE, 2, 1)
    rig.axis.close()
    assert outputs.get(0x60FE, 1) == 5
    rig = Rig(build, {"servomotor": node("mclm", safe_outputs=5)})
    with pytest.raises(
        SimulationError, match="servomotor: it has no 60FEh Digital outputs: leave outputs and safe_outputs out"
    ):
        rig.go(1)


def test_another_master_on_the_bus(build):
    """Two masters with one ID: neither may go on."""
    from hw_bridge.bus import Frame
    from hw_bridge.bus.network import MasterPort
    from hw_bridge.session import Session

    rig = Rig(build, {"servomotor": node()})
    begin = Session.network

    def crowded(self):
        made = begin(self)
        other = MasterPort()
        self.bench.bus.attach(other)
        other.send(Frame(0x77F, b"\5"))
        return made

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Session, "network", crowded)
        with pytest.raises(SimulationError, match="node 127: another master"):
            rig.go(1)
    assert stopped(rig.drive)


def touching(build, **more):
    rig = Rig(build, {"servomotor": node(contact={**CONTACT, **more})})
    rig.set(target_velocity=0.005, contact_force=0.2)
    for step in range(100):
        rig.set(contact_force=0.2 + 1e-4 * (step % 7))
        rig.go(1)
    return rig


def test_too_much_contact_force_retracts(build):
    rig = touching(build)
    before = rig.get("position")
    rig.set(contact_force=0.45)
    with pytest.raises(
        SimulationError, match=r"sensor\.measured_force is 0\.450 N, above 0\.4 N\. Retracted 10\.\d\d mm"
    ):
        rig.go(1000)
    assert rig.get("position") - before == pytest.approx(-0.010, abs=1e-3)
    assert rig.t - 100 < 260  # 10 mm at 50 mm/s
    assert stopped(rig.drive)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("value", [0.2, float("nan")])
def test_a_silent_sensor_retracts(build, value):
    rig = touching(build)
    rig.set(contact_force=value)
    with pytest.raises(SimulationError, match=r"has not changed for 10\d ms\. Retracted"):
        rig.go(1000)
    assert rig.get("position") < -0.005
    assert stopped(rig.drive)


@pytest.mark.slow
def test_a_retraction_ends_at_the_position_limit(build):
    rig = touching(build, distance="60 mm", direction="positive")
    rig.set(contact_force=0.6)
    with pytest.raises(SimulationError, match=r"above 0\.4 N"):
        rig.go(3000)
    assert rig.get("position") == pytest.approx(0.034, abs=5e-4)


@pytest.mark.slow
def test_what_stands_against_an_end_stop_is_noticed(build):
    """At a speed at which a tenth of a second shows nothing: the motor pushes, and the way does not follow."""
    rig = Rig(build, {"servomotor": node(limits={"position": ["-80 mm", "80 mm"], "force": "100 N"})})
    rig.set(target_velocity=0.02)
    with pytest.raises(SimulationError, match=r"following error 5\.\d\d mm is above 5\.00 mm"):
        rig.go(3000)
    assert rig.get("position") == pytest.approx(0.04, abs=1e-4)  # the end of 80 mm
    assert stopped(rig.drive)


@pytest.mark.slow
def test_homing_at_an_end_stop_beyond_the_limits(build):
    """The way back from there is allowed, another way out is not."""
    limits = {"position": ["-20 mm", "20 mm"]}  # 607Dh a tenth beyond: a drive that is enabled at -40 mm would jump
    rig = Rig(build, {"servomotor": node(homing={"method": -3, "at": "-40 mm", "speed": "50 mm/s"}, limits=limits)})
    rig.go(50)
    assert rig.get("position") == pytest.approx(0.0, abs=1e-4)
    rig.set(target_velocity=-0.05)
    with pytest.raises(SimulationError, match=r"position -20\.\d\d mm is outside -20\.00 mm to 20\.00 mm"):
        rig.go(1000)


@pytest.mark.slow_repetitions
def test_a_drive_that_somebody_stopped_is_disabled(rig):
    """NMT Stopped: it takes neither process data nor SDO until it is sent to Pre-operational."""
    rig.drive.nmt.command(bytes([2, rig.drive.node]))
    with pytest.raises(SimulationError):
        rig.go(200)
    assert stopped(rig.drive)
    assert rig.session.outcome.notes == []


def test_a_stall_lengthens_the_way_that_was_asked_for(build):
    """The drive goes on while this program stands: that is no following error."""
    rig = Rig(build, {"servomotor": node()})
    rig.set(target_velocity=0.05)
    rig.go(50)
    one = rig.master.nodes["servomotor"]
    before = sum(asked for asked, _ in one.distances)
    one.follow(5_000_000, 30_000_000)
    assert sum(asked for asked, _ in one.distances) - before == pytest.approx(0.05 * (25e-3 + 5e-3))
