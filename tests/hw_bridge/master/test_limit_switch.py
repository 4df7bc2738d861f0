"""A run into a limit switch ends, and says that it is closed; homing on switches passes what watches it."""

import pytest

from hw_bridge.dictionary import State
from hw_bridge.session import Session
from tests.hw_bridge.axis import Rig, node
from tests.hw_bridge.bridge.test_bridge import NODES
from twin.errors import SimulationError

LIMITS = {
    "position": ["-35 mm", "35 mm"],
    "velocity": "100 mm/s",
    "force": "8 N",
    "following_error": "3 mm",
    "acceleration": "2 m/s^2",
}
WAY = {"epos4": 1.5915e-3}  # of the member [m] for 1 rad
METHODS = [*range(1, 15), *range(17, 31)]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("name", sorted(NODES.keys() - {"epos2"}))  # which has no 60FDh
def test_a_run_into_a_limit_switch_says_so(build, name, inverted):
    rig = Rig(build, {"servomotor": {**NODES[name], "inverted": inverted}})
    rig.go(5)
    motor = rig.drive.axis.motor
    switch = motor.measured_position + 2e-3 / WAY.get(name, 1.0)
    rig.drive.axis.switches.positive = switch
    rig.set(target_velocity=-20e-3 if inverted else 20e-3)
    with pytest.raises(SimulationError, match=r"servomotor: its positive limit switch is closed \(60FDh\)\."):
        rig.go(2000)
    assert motor.position < switch + 1e-3 / WAY.get(name, 1.0)
    assert rig.drive.state not in (State.ENABLED, State.QUICK_STOP)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_a_run_homes_on_switches(build, monkeypatch, method):
    """All methods with switches, on a rail of +-30 mm with a home switch at 4 to 6 mm; index pulses are at -24, 0 and 24 mm."""
    begin = Session.network
    references = {1: -0.024, 2: 0.024, 17: -0.030, 18: 0.030}
    at = references.get(method, 0.0)
    home = (-0.006, -0.004) if method in (5, 6, 21, 22) else (0.004, 0.006)  # of one that searches towards negative

    def wired(self):
        network = begin(self)
        switches = next(iter(self.bench.plants.values())).drive.axis.switches
        switches.negative, switches.positive, switches.home = -0.030, 0.030, home
        return network

    monkeypatch.setattr(Session, "network", wired)
    homing = {"method": method, "at": f"{1e3 * at:g} mm", "speed": "20 mm/s", "timeout": "60 s"}
    rig = Rig(build, {"servomotor": node(homing=homing, limits=LIMITS)})
    rig.go(5)
    assert rig.drive.state is State.ENABLED
    reference = rig.drive.axis.origin
    expected = [references[method]] if method in references else [*home] if method > 14 else [-0.024, 0.0, 0.024]
    assert min(abs(reference - one) for one in expected) < 2e-4
