"""Simulated bench of a run: the member's load and position at the motor, what is not at rest, planned faults."""

from types import SimpleNamespace

import pytest

from hw_bridge.dictionary import State
from hw_bridge.plant import Plant, bench, start_position
from hw_bridge.plant.bench import Bench, SimulatedBench
from tests.hw_bridge.axis import Rig, node


class RecordedMotor:
    """A motor whose values a test sets; it records its load."""

    def __init__(self, model, build, position):
        self.model, self.position, self.measured_position = model, position, position
        self.loads, self.parameters, self.values = [], {}, {"force": 2.0}

    def load(self, value):
        self.loads.append(value)

    def set(self, name, value):
        self.parameters[name] = value

    def get(self, name):
        return self.values[name]


@pytest.fixture
def make(build, monkeypatch):
    """Make the plant of a servomotor with these keys; its motor and its drive do nothing by themselves."""

    def make(position=0.01, **keys):
        rig = Rig(build, {"servomotor": node(**keys)})
        monkeypatch.setattr("hw_bridge.plant.plant.Motor", RecordedMotor)
        drive = SimpleNamespace(state=State.DISABLED, outputs=0, axis=SimpleNamespace(level=0.25))
        monkeypatch.setattr("hw_bridge.plant.plant.Drive", lambda *_: drive)
        monkeypatch.setattr("hw_bridge.plant.plant.store_motor_parameters", lambda made, _: made)
        return Plant(rig.axis, rig.hardware.keys.nodes["servomotor"], position, build)

    return make


@pytest.mark.parametrize(
    ("keys", "motor", "load"),
    [
        ({}, 0.01, 3.0),
        ({"inverted": True}, -0.01, -3.0),
        # of a member that moves twice as far, a motor feels twice the force
        ({"scale": 2.0}, 0.005, 6.0),
        ({"scale": 2.0, "inverted": True}, -0.005, -6.0),
    ],
)
def test_positions_and_loads_of_the_motor(make, keys, motor, load):
    plant = make(**keys)
    assert plant.motor.position == pytest.approx(motor)
    assert plant.position() == pytest.approx(0.01)
    plant.axis.views["load_force"][...] = 3.0
    plant.update_load()
    assert plant.motor.loads == [pytest.approx(load)]
    plant.motor.measured_position = plant.motor.position = 3 * motor
    plant.zero(0.05)  # what was 30 mm is 50 from now on
    assert plant.position() == pytest.approx(0.05)
    plant.motor.position = 2 * motor
    assert plant.position() == pytest.approx(0.04)
    assert plant.true("force") == (-2.0 if plant.keys.inverted else 2.0)
    shown = plant.shown()
    assert (shown["position"](), shown["angle"](), shown["overload"]()) == (
        pytest.approx(0.04),
        pytest.approx(0.04),
        0.25,
    )


def test_a_drive_that_homes_begins_at_its_own_zero(make):
    assert make(homing={"method": 37}).motor.position == 0.0


def test_parameters_of_the_member_are_those_of_its_motor(make):
    plant = make()
    assert plant.parameters
    name = next(iter(plant.parameters))
    plant.update_load()
    assert plant.motor.parameters == {}
    plant.axis.views[name][...] = 2.0 * plant.parameters[name] + 1.0
    plant.update_load()
    plant.update_load()
    assert plant.motor.parameters == {name: plant.parameters[name]}
    assert plant.parameters[name] == float(plant.axis.views[name])
    assert "current_maximum" not in plant.parameters


@pytest.mark.parametrize(
    ("state", "speed", "outputs", "text"),
    [
        (State.DISABLED, 0.0, 2, ""),
        (State.DISABLED, 0.00049, 2, ""),
        (State.FAULT, 0.0, 2, ""),
        (State.ENABLED, 0.0, 2, "node 1: Operation enabled."),
        (State.DISABLED, 0.002, 2, "node 1: moves at 0.004 m/s."),
        (State.ENABLED, 0.002, 3, "node 1: Operation enabled, moves at 0.004 m/s, outputs 3, not 2."),
    ],
)
def test_what_is_not_at_rest(make, state, speed, outputs, text):
    """Faster than 1 mm/s of the member, which moves twice as far as the motor."""
    plant = make(scale=2.0, safe_outputs=2)
    plant.drive.state, plant.drive.outputs = state, outputs
    assert plant.faults_at_rest(speed) == text
    plant = make()
    plant.drive.outputs = 7
    assert plant.faults_at_rest(0.0) == ""  # no level is asked for


def test_the_start_is_the_targets(make):
    plant = make()
    plant.axis.views["target_position"][...] = 0.02
    assert start_position(plant.axis) == 0.02
    assert start_position(SimpleNamespace(views={})) == 0.0


class SimulatedBus:
    """A clock with events and recorded planned faults."""

    def __init__(self, _bit_rate):
        self.now, self.events, self.load, self.longest_wait = 0, [], 0.25, 3_000_000
        self.event_queue = SimpleNamespace(at=lambda time, act: self.events.append((time, act)))

    def attach(self, device):
        pass

    def advance(self, time):
        self.now = time


@pytest.fixture
def simulated(monkeypatch):
    """A bench of one drive and one module, whose plant and bus are recorded."""
    plant = SimpleNamespace(drive=SimpleNamespace(node=4), sign=-2.0, motor=SimpleNamespace(position=0.5), speeds=[])
    plant.faults_at_rest = lambda speed: plant.speeds.append(speed) or ("moves." if speed else "")
    plant.shown = lambda: {"angle": 1}
    monkeypatch.setattr(bench, "Bus", SimulatedBus)
    monkeypatch.setattr(bench, "SimulatedNetwork", lambda bus: bus)
    monkeypatch.setattr(bench, "Plant", lambda *_: plant)
    monkeypatch.setattr(bench, "Module", lambda *_: SimpleNamespace(node=9, outputs=5))
    monkeypatch.setattr(bench, "start_position", lambda _: 0.0)
    module = SimpleNamespace(profile="cia401", node=9, safe_outputs=5)
    keys = SimpleNamespace(bit_rate=1_000_000, nodes={"axis": None}, modules={"valves": module}, master=127)
    made = SimulatedBench(keys, {"axis": None}, None)
    made.plant = plant
    return made


def test_faults_are_planned_at_the_node_that_they_hit(simulated):
    seen = []
    overrides = [
        SimpleNamespace(at=at, node=name, act=lambda *given: seen.append(given))
        for at, name in ((5, "axis"), (7, "valves"), (9, "master"))
    ]
    simulated.plan(overrides, 100)
    assert [time for time, _ in simulated.bus.events] == [105, 107, 109]
    for _, act in simulated.bus.events:
        act()
    bus, drive, module = simulated.bus, simulated.plant.drive, simulated.modules["valves"]
    assert seen == [(bus, 4, drive, -2.0), (bus, 9, module, 1.0), (bus, 127, None, 1.0)]
    simulated.bus.now = 107
    assert simulated.acted(overrides, 100) == overrides[:2]
    assert (simulated.shown("axis"), simulated.shown("valves")) == ({"angle": 1}, {})
    assert simulated.report() == {"bus_load": 0.25, "longest_wait": 3e-3}


def test_motion_after_a_failure_is_observed(simulated):
    """Half a second later, over 10 ms: 20 um are 2 mm/s."""
    assert simulated.faults_at_rest(False, ["note"]) == []
    assert (simulated.plant.speeds, simulated.bus.now) == ([0.0], 0)
    advance = simulated.bus.advance

    def moving(time):
        simulated.plant.motor.position -= 20e-6
        advance(time)

    simulated.bus.advance = moving
    assert simulated.faults_at_rest(True, []) == ["moves."]
    assert simulated.plant.speeds[1] == pytest.approx(2e-3)
    assert simulated.bus.now == 510_000_000
    simulated.modules["valves"].outputs = 4
    assert simulated.faults_at_rest(False, []) == ["valves: outputs 4, not 5."]


def test_a_real_bench_knows_only_what_its_master_tells(monkeypatch):
    monkeypatch.setattr(bench, "wire", lambda keys: ("network", keys))
    made = bench.set_up(SimpleNamespace(simulated=False), {}, None)
    assert type(made) is Bench
    assert made.network[0] == "network"
    assert (made.acted([1], 0), made.shown("axis"), made.report()) == ([], {}, {})
    assert made.faults_at_rest(True, ("not confirmed.",)) == ["not confirmed."]
