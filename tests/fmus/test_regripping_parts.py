"""The regripping sequencer with the real servomotors and cylinders, judged from their true positions and extensions."""

import pytest
from fmus.pneumatic_cylinder.model import PneumaticCylinder
from fmus.regripping_sequencer.model import RegrippingSequencer
from fmus.servomotor.model import Servomotor
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from tests.fmus.rails import STEP, TRUE_GRIP, Judge, Rig, places


class PartsRail:
    """As `tests.fmus.rails.Rail`, made of components. A lost drive has no current; lost air is that of the cylinders."""

    def __init__(self, native, load=0.0):
        self.load = load  # of the instrument on the grippers that hold it [N]
        self.motors = [native(Servomotor, target_position=home) for home in (-25e-3, 25e-3)]
        self.cylinders = [native(PneumaticCylinder) for _ in range(2)]
        self.t = 0.0
        for part in (*self.motors, *self.cylinders):
            part.start(0.0)
        self.places = [
            (places(motor), places(cylinder)) for motor, cylinder in zip(self.motors, self.cylinders, strict=True)
        ]
        self.read()

    def read(self):
        self.position = [motor["position"][0] for motor, _ in self.places]
        self.velocity = [motor["velocity"][0] for motor, _ in self.places]
        self.extension = [max(cylinder["extension"][0], 0.0) for _, cylinder in self.places]

    def advance(self, target, valve, pressure_ok, drive_ok):
        for k, (motor, cylinder) in enumerate(self.places):
            motor["target_velocity"][0] = target[k]
            motor["load_force"][0] = self.load if self.extension[k] >= TRUE_GRIP else 0.0
            motor["current_maximum"][0] = 2.37 if drive_ok[k] else 0.0
            cylinder["valve"][0] = valve[k]
            self.motors[k].advance(self.t, STEP)
            self.cylinders[k].advance(self.t, STEP)
        self.t += STEP
        self.read()

    def measured(self):
        return [motor["position_actual_value"][0] for motor, _ in self.places]


def make(native, h=1e-3, load=0.0):
    rig = Rig(native(RegrippingSequencer), PartsRail(native, load), Judge(), h)
    rig.start()
    return rig


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [0.005, -0.02, 0.04, -0.04])
def test_speed_is_kept(native, velocity):
    """Means of 20 ms, since Hall increments make the speed ripple."""
    rig = make(native)
    rig.run(0.8, velocity)
    first = len(rig.log)
    rig.run(0.2 / abs(velocity), velocity)
    speeds = rig.table[first:, 0]
    means = speeds[: len(speeds) // 20 * 20].reshape(-1, 20).mean(axis=1)
    assert abs(means - velocity).max() < 0.25e-3
    assert rig.sequencer.regrip_count >= 4
    assert rig.sequencer.violation == 0
    assert not rig.judge.seen


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("load", [-5.0, 5.0])
def test_a_load_that_passes_from_gripper_to_gripper_breaks_no_rule(native, load):
    rig = make(native, load=load)
    for velocity in (0.04, -0.03):
        rig.run(5.0, velocity)
    assert rig.sequencer.regrip_count >= 7
    assert rig.sequencer.violation == 0
    assert not rig.judge.seen


def test_a_loaded_carriage_without_drive_is_caught_by_the_other(native):
    """5 N push the instrument back, more than friction keeps: how far it goes until the other gripper has closed."""
    rig = make(native, load=-5.0)
    rig.run(20.0, 0.04, until=lambda rig: rig.sequencer.step_number == 4)
    begin = rig.instrument
    rig.run(0.5, drive_ok=[False, True], until=lambda rig: rig.rail.extension[1] > TRUE_GRIP)
    assert rig.rail.extension[1] > TRUE_GRIP
    assert -0.02 < rig.instrument - begin < 0.0


action = st.one_of(
    st.tuples(st.just("velocity"), st.floats(-0.06, 0.06)),
    st.tuples(st.just("velocity"), st.sampled_from([0.0, 0.04, -0.04, 0.1, -0.1, 1e-4])),
    st.tuples(st.just("pressure_ok"), st.booleans()),
    st.tuples(st.just("drive_ok"), st.sampled_from([[True, True], [True, True], [True, False], [False, True]])),
    st.tuples(st.just("enable"), st.sampled_from([True, True, False])),
)


@settings(
    max_examples=20, deadline=None, derandomize=True, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)
@given(
    script=st.lists(st.tuples(action, st.floats(0.005, 1.5)), min_size=3, max_size=25),
    h=st.sampled_from([1e-3, 5e-3]),
    load=st.floats(-1.4, 1.4),  # friction keeps a carriage without drive
)
@pytest.mark.slow
def test_random_commands_and_faults_break_no_invariant(native, script, h, load):
    rig = make(native, h, load)
    for (name, value), seconds in script:
        rig.run(seconds, **{name: value})
        assert not rig.judge.seen
        assert rig.sequencer.violation == 0
    begin = rig.instrument
    rig.run(12.0, 0.03, enable=True, pressure_ok=True, drive_ok=[True, True])
    assert rig.instrument - begin > 0.1
    assert not rig.judge.seen
