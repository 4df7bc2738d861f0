"""Friction between catheter and guidewire, and the command that moves both."""

import numpy as np
import pytest
from fmus.coaxial_command.model import CoaxialCommand
from fmus.coaxial_friction.model import CoaxialFriction

H = 1e-3
DEPTH = 0.3  # [m]
LIMIT = 2.4 * DEPTH  # [N]


def pushed(native, wire, catheter, **values):
    """Force and relative motion over given depths of both tips."""
    part = native(CoaxialFriction, **values)
    part.wire_position, part.catheter_position = wire[0], catheter[0]
    part.start(0.0)
    force = []
    for step, (a, b) in enumerate(zip(wire, catheter, strict=True)):
        part.wire_position, part.catheter_position = a, b
        assert part.advance(step * H, H) == 0
        assert part.catheter_force == -part.wire_force
        force.append(float(part.wire_force))
    return np.array(force)


def there_and_back(amplitude, speed):
    count = round(amplitude / (speed * H))
    ramp = np.linspace(0.0, amplitude, count + 1)
    return np.concatenate([ramp, ramp[-2::-1], ramp[1:], ramp[-2::-1]])


def test_elastic_before_it_slips(native):
    way = there_and_back(1e-3, 0.01)
    force = pushed(native, DEPTH + 0.1 + way, np.full(len(way), DEPTH))
    assert force == pytest.approx(500.0 * way, abs=1e-12)


@pytest.mark.parametrize("speed", [0.005, 0.04])
def test_slips_at_coulomb_and_viscous_friction(native, speed):
    way = there_and_back(0.02, speed)
    force = pushed(native, DEPTH + 0.1 + way, np.full(len(way), DEPTH))
    steady = LIMIT + 6.0 * DEPTH * speed
    assert force.max() == pytest.approx(steady, rel=1e-3)
    assert force.min() == pytest.approx(-steady, rel=1e-3)


def test_the_catheter_is_dragged_as_the_wire_is(native):
    way = there_and_back(0.02, 0.02)
    wire = pushed(native, DEPTH + way, np.full(len(way), DEPTH + 0.1), viscosity=0.0)
    catheter = pushed(native, np.full(len(way), DEPTH + 0.1), DEPTH + way, viscosity=0.0)
    assert wire == pytest.approx(-catheter, abs=1e-12)
    assert np.abs(wire).max() == pytest.approx(2.4 * (DEPTH + 0.02), rel=0.05)


def test_together_they_feel_nothing(native):
    way = DEPTH + there_and_back(0.1, 0.02)
    assert np.abs(pushed(native, way + 0.01, way)).max() < 1e-9


def test_no_overlap_no_force(native):
    way = there_and_back(0.05, 0.02)
    assert not pushed(native, DEPTH + way, np.full(len(way), -0.01)).any()


@pytest.mark.parametrize(("speed", "turning"), [(1e-3, 4.0), (-5e-3, 4.0), (1e-3, -40.0)])
def test_turning_takes_its_part_of_the_friction(native, speed, turning):
    """Steady: force and torque over radius are friction against the sliding of the surface, v along and radius w around."""
    part = native(CoaxialFriction, viscosity=0.0)
    part.wire_position, part.catheter_position = 2.0 * DEPTH, DEPTH
    part.start(0.0)
    for step in range(1, 10001):
        part.wire_position = 2.0 * DEPTH + speed * step * H
        part.wire_angle = turning * step * H
        assert part.advance(step * H, H) == 0
        assert part.catheter_torque == -part.wire_torque
    around = 0.45e-3 * turning
    assert part.wire_force == pytest.approx(LIMIT * speed / np.hypot(speed, around), rel=1e-6)
    assert part.wire_torque == pytest.approx(0.45e-3 * LIMIT * around / np.hypot(speed, around), rel=1e-6)


def test_turning_both_alike_is_no_sliding(native):
    part = native(CoaxialFriction)
    part.wire_position, part.catheter_position = 2.0 * DEPTH, DEPTH
    part.start(0.0)
    for step in range(1, 1001):
        part.wire_angle = part.catheter_angle = 2.0 * step * H
        part.advance(step * H, H)
    assert part.wire_torque == 0.0
    assert part.wire_force == 0.0


def test_it_never_gives_energy(native):
    random = np.random.default_rng(1)
    apart = np.cumsum(random.normal(0.0, 5e-5, 20000))
    wire = 2.0 * DEPTH + apart
    force = pushed(native, wire, np.full(len(wire), DEPTH))
    work = np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(apart))
    stored = 0.5 * force[1:] ** 2 / 500.0
    taken = work - stored
    assert taken.min() >= -1e-9
    assert taken[-1] > 0.01


def test_nor_does_it_when_both_slide_and_turn(native):
    random = np.random.default_rng(2)
    apart, turned = np.cumsum(random.normal(0.0, 5e-5, 20000)), np.cumsum(random.normal(0.0, 0.1, 20000))
    part = native(CoaxialFriction)
    part.wire_position, part.catheter_position = 2.0 * DEPTH, DEPTH
    part.start(0.0)
    apart[0] = turned[0] = 0.0
    loads = []
    for step, (way, angle) in enumerate(zip(apart, turned, strict=True)):
        part.wire_position, part.wire_angle = 2.0 * DEPTH + way, angle
        assert part.advance(step * H, H) == 0
        loads.append((float(part.wire_force), float(part.wire_torque)))
    force, torque = np.array(loads).T
    work = np.cumsum(
        0.5 * (force[1:] + force[:-1]) * np.diff(apart) + 0.5 * (torque[1:] + torque[:-1]) * np.diff(turned)
    )
    taken = work - 0.5 * (force[1:] ** 2 + (torque[1:] / 0.45e-3) ** 2) / 500.0
    assert np.hypot(force, torque / 0.45e-3).max() > 0.9 * LIMIT
    assert taken.min() >= -1e-9
    assert taken[-1] > 0.01


def commanded(native, seconds, wire_off=0.0, **values):
    part = native(CoaxialCommand, **values)
    part.start(0.0)
    rows = []
    for step in range(round(seconds / H)):
        part.wire_position = float(part.wire_reference) + wire_off
        part.catheter_position = float(part.catheter_reference)
        assert part.advance(step * H, H) == 0
        rows.append(
            (part.phase, part.wire_velocity, part.catheter_velocity, part.wire_reference, part.catheter_reference)
        )
    return np.array(rows, dtype=float).T


@pytest.mark.slow
def test_wire_leads_catheter_follows_then_both(native):
    phase, wire_v, catheter_v, wire, catheter = commanded(native, 36.0)
    order = phase[np.concatenate([[True], np.diff(phase) != 0])]
    assert [int(p) for p in order if p] == [1, 2, 1, 2, 3, 4]
    assert not catheter_v[phase == 1].any()
    assert not wire_v[phase == 2].any()
    assert wire_v[phase >= 3] == pytest.approx(catheter_v[phase >= 3], abs=1e-15)
    assert wire.max() == pytest.approx(0.28)
    assert wire[-1] == pytest.approx(0.16)
    assert (wire - catheter).max() == pytest.approx(0.08)
    assert (wire - catheter).min() >= -1e-12
    assert np.cumsum(wire_v) * H == pytest.approx(wire, abs=2e-5)
    assert np.abs(wire_v).max() <= 0.02 + 1e-12


def test_a_wire_that_is_ahead_is_slowed_down(native):
    even = commanded(native, 2.0, gain=2.0)
    ahead = commanded(native, 2.0, wire_off=2e-3, gain=2.0)
    assert (even[1] - ahead[1])[1:] == pytest.approx(2.0 * (2e-3 - 0.8e-3), abs=1e-4)
    assert commanded(native, 2.0, wire_off=0.5e-3, gain=2.0)[1][1:] == pytest.approx(even[1][1:], abs=1e-4)
    far = commanded(native, 2.0, wire_off=-0.1, gain=2.0)
    assert (far[1] - even[1])[1:] == pytest.approx(5e-3, abs=1e-4)
