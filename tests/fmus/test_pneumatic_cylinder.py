from math import pi, sqrt

import numpy as np
import pytest
from fmus.braided_sleeve.model import BraidedSleeve
from fmus.pneumatic_cylinder.model import LAMINAR, PneumaticCylinder, flow_shape, mass_flow
from fmus.servomotor.model import Servomotor
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fmus.instruments import guidewire

H = 1e-3
AMBIENT = 101325.0
GAS = 287.06
AREA = pi * 5e-3**2
BLOCKED = {"friction_static": 1e9, "friction_coulomb": 1e9}
GUIDEWIRE = guidewire("braided_sleeve")


def run(cylinder, seconds, h=H, names=()):
    """Advance; the named variables after every step."""
    rows = []
    for step in range(round(seconds / h)):
        assert cylinder.advance(step * h, h) == 0
        rows.append([float(getattr(cylinder, name)) for name in names])
    return np.array(rows)


def series(c1, c2):
    return (1.0 / (1.0 / c1**3 + 1.0 / c2**3)) ** (1.0 / 3.0)


def tube(length=0.5, bore=2.5e-3):
    return 0.029 * bore**2 / sqrt(length / bore**1.25 + 510.0)


def test_flow_has_the_limits_of_iso_6358():
    choked = mass_flow(1e-8, 0.3, 7e5, 1e5, 293.15)
    assert choked == pytest.approx(1e-8 * 7e5 * 1.185)
    assert mass_flow(1e-8, 0.3, 7e5, 0.3 * 7e5, 293.15) == choked
    assert mass_flow(1e-8, 0.3, 7e5, 7e5, 293.15) == 0.0
    assert mass_flow(1e-8, 0.3, 7e5, 1e5, 4 * 293.15) == pytest.approx(choked / 2)
    assert flow_shape(0.65, 0.3) == pytest.approx(sqrt(0.75))
    assert flow_shape(LAMINAR - 1e-12, 0.3) == pytest.approx(flow_shape(LAMINAR + 1e-12, 0.3), rel=1e-9)
    ratios = np.linspace(0.0, 1.0, 5001)
    assert np.all(np.diff([flow_shape(ratio, 0.3) for ratio in ratios]) <= 0.0)


@pytest.mark.parametrize("conductance", [4e-9, 2e-9])
def test_choked_filling_takes_the_time_of_the_closed_formula(native, conductance):
    """Adiabatic, piston blocked: dp/dt = gamma R T dm/dt / V as long as the flow is choked."""
    cylinder = native(
        PneumaticCylinder,
        conductance_supply=conductance,
        heat_conductance=0.0,
        delay_on=0.0,
        dead_volume=20e-6,
        **BLOCKED,
    )
    cylinder.start(0.0)
    cylinder.valve = True
    h = 1e-4
    pressure = run(cylinder, 0.02, h, ["pressure_extend"])[:, 0]
    volume = 20e-6 + 0.5 * pi * 1.25e-3**2
    flow = series(conductance, tube()) * (6e5 + AMBIENT) * 1.185
    begin, end = np.searchsorted(pressure, [1e3, 0.5e5])
    expected = (pressure[end] - pressure[begin]) * volume / (1.4 * GAS * 293.15 * flow)
    assert (end - begin) * h == pytest.approx(expected, rel=0.02)


def test_adiabatic_filling_heats_as_the_first_law_says(native):
    """A vessel filled from p1 to p2 by air of T: T / T2 = 1 / gamma + p1 / p2 (1 - 1 / gamma) if it began at T."""
    cylinder = native(PneumaticCylinder, heat_conductance=0.0, **BLOCKED)
    cylinder.start(0.0)
    cylinder.valve = True
    run(cylinder, 0.5)
    temperature = cylinder.gas_energy[0] / (2.5 * GAS * cylinder.gas_mass[0])
    ratio = AMBIENT / (cylinder.pressure_extend + AMBIENT)
    assert cylinder.pressure_extend == pytest.approx(6e5, rel=1e-4)
    assert temperature == pytest.approx(293.15 / (1 / 1.4 + ratio * (1 - 1 / 1.4)), rel=0.01)


def test_walls_bring_the_air_back_to_room_temperature(native):
    cylinder = native(PneumaticCylinder)
    cylinder.start(0.0)
    cylinder.valve = True
    run(cylinder, 3.0)
    volume = 0.5 * pi * 1.25e-3**2 + 0.1e-6 + AREA * cylinder.extension
    assert cylinder.gas_mass[0] == pytest.approx((6e5 + AMBIENT) * volume / (GAS * 293.15), rel=1e-4)
    assert cylinder.pressure_retract == pytest.approx(0.0, abs=1.0)


def test_closed_chambers_follow_the_adiabat(native):
    """A spring that stiffens pushes the piston back while both chambers are as good as closed."""
    cylinder = native(
        PneumaticCylinder,
        conductance_supply=1e-15,
        conductance_exhaust=1e-15,
        heat_conductance=0.0,
        tube_length=0.0,
        dead_volume=0.3e-6,
        valve=True,
        contact_extension=9e-3,
    )
    cylinder.start(0.0)
    names = ["pressure_extend", "pressure_retract", "extension"]
    first = [float(getattr(cylinder, name)) for name in names]
    cylinder.relaxed_stiffness = 2e4
    last = run(cylinder, 0.05, names=names)[-1]
    assert last[2] < first[2] - 4e-3
    for side, area in enumerate((AREA, AREA - pi * 2e-3**2)):
        volumes = [0.3e-6 + area * (x if side == 0 else 10e-3 - x) for x in (first[2], last[2])]
        pressures = [p[side] + AMBIENT for p in (first, last)]
        assert pressures[1] / pressures[0] == pytest.approx((volumes[0] / volumes[1]) ** 1.4, rel=1e-3)


def test_energy_is_never_made(native):
    """Piston, braid and closed chambers against the atmosphere: friction takes, nothing gives."""
    quiet = {"conductance_supply": 1e-15, "conductance_exhaust": 1e-15, "heat_conductance": 0.0}
    cylinder = native(PneumaticCylinder, valve=True, friction_viscous=0.0, **quiet)
    cylinder.start(0.0)
    cylinder.contact_stiffness = 2e5
    names = ["piston_position", "piston_velocity"]
    energies = []
    for step in range(60):
        assert cylinder.advance(step * H, H) == 0
        x, v = (float(getattr(cylinder, name)) for name in names)
        spring = 250.0 * x**2 + 1e5 * max(x - 3.7e-3, 0.0) ** 2
        atmosphere = AMBIENT * pi * 2e-3**2 * x
        energies.append(float(cylinder.gas_energy.sum()) + 0.015 * v**2 + spring + atmosphere)
    change = np.diff(energies)
    assert change.max() < 2e-4
    assert energies[-1] < energies[0]


@settings(max_examples=25, deadline=None)
@given(supply=st.floats(1e5, 8e5), stiffness=st.floats(1e3, 2e5))
def test_static_force_is_pressure_times_area_within_friction(native, supply, stiffness):
    cylinder = native(
        PneumaticCylinder, supply_pressure=supply, contact_stiffness=stiffness, contact_extension=1e-3, stroke=80e-3
    )
    cylinder.start(0.0)
    cylinder.valve = True
    run(cylinder, 1.0)
    assert cylinder.velocity == pytest.approx(0.0, abs=1e-6)  # pressure still settles
    assert cylinder.tension == pytest.approx(supply * AREA, abs=3.0 + 0.01 * supply * AREA)


def test_retracting_force_lacks_the_rod(native):
    cylinder = native(PneumaticCylinder)
    cylinder.start(0.0)
    assert -cylinder.extension * 2e5 == pytest.approx(6e5 * (AREA - pi * 2e-3**2) - 1.5)
    before = float(cylinder.extension)
    run(cylinder, 0.1)
    assert cylinder.extension == before


def test_without_air_nothing_moves_but_what_springs_do(native):
    cylinder = native(PneumaticCylinder, supply_pressure=0.0)
    cylinder.start(0.0)
    cylinder.valve = True
    run(cylinder, 0.1)
    assert cylinder.extension == 0.0

    gripped = native(PneumaticCylinder, valve=True)
    gripped.start(0.0)
    gripped.supply_pressure = 0.0
    run(gripped, 1.0)
    assert gripped.pressure_extend == pytest.approx(0.0, abs=10.0)
    assert 0.0 <= gripped.tension <= 3.0 + 1e-9  # what the seal holds at rest


def test_a_pulse_shorter_than_the_delay_is_ignored(native):
    cylinder = native(PneumaticCylinder)
    cylinder.start(0.0)
    cylinder.valve = True
    run(cylinder, 9e-3)
    cylinder.valve = False
    run(cylinder, 50e-3)
    assert cylinder.pressure_extend == pytest.approx(0.0, abs=1.0)


def test_result_does_not_depend_on_the_communication_step(native):
    fine, coarse = native(PneumaticCylinder), native(PneumaticCylinder)
    for cylinder, h in ((fine, 1e-3), (coarse, 5e-3)):
        cylinder.start(0.0)
        cylinder.valve = True
        run(cylinder, 0.1, h)
    assert coarse.extension == pytest.approx(float(fine.extension), rel=1e-9)


def closing(native, pressure, sleeve=None):
    """Time of each step after the command, and what the gripped instrument withstands, from cylinder and sleeve."""
    cylinder = native(PneumaticCylinder, supply_pressure=pressure)
    braid = native(BraidedSleeve, friction_scatter=0.0, **(sleeve or {}))
    braid.start(0.0)
    cylinder.contact_extension = braid.contact_extension
    cylinder.contact_stiffness = braid.contact_stiffness
    cylinder.relaxed_stiffness = braid.relaxed_stiffness
    cylinder.start(0.0)
    cylinder.valve = True
    force = []
    for step in range(200):
        braid.extension, braid.tension = cylinder.extension, cylinder.tension
        cylinder.advance(step * H, H)
        braid.advance(step * H, H)
        force.append(float(braid.limit_proximal))
    return H * np.arange(1, 201), np.array(force)


@pytest.mark.parametrize("sleeve", [{}, GUIDEWIRE], ids=["catheter", "guidewire"])
def test_grip_delay_is_of_the_expected_size(native, sleeve):
    time, force = closing(native, 6e5, sleeve)
    delay = time[np.flatnonzero(force < 0.9 * force[-1])[-1] + 1]
    assert 15e-3 < delay < 40e-3


def test_grip_rises_with_pressure(native):
    """Friction may hold the piston anywhere within 6 N of its force: so pressures that are further apart than that."""
    held = [closing(native, pressure)[1][-1] for pressure in (0.0, 1e5, 2e5, 4e5, 6e5, 8e5)]
    assert held[0] == 0.0
    assert np.all(np.diff(held) > 0.0)


@settings(max_examples=40, deadline=None)
@given(
    inputs=st.lists(
        st.tuples(st.booleans(), st.floats(0.0, 1e6), st.floats(0.0, 12e-3), st.floats(0.0, 2e5), st.floats(0.0, 1e4)),
        min_size=1,
        max_size=8,
    ),
    mass=st.floats(1e-3, 0.1),
    dead_volume=st.floats(5e-8, 1e-5),
    tube_length=st.floats(0.0, 5.0),
    conductance=st.floats(1e-11, 2e-8),
    ratio=st.floats(0.0, 0.9),
)
def test_stays_finite_and_physical(native, inputs, mass, dead_volume, tube_length, conductance, ratio):
    cylinder = native(
        PneumaticCylinder,
        mass=mass,
        dead_volume=dead_volume,
        tube_length=tube_length,
        conductance_supply=conductance,
        conductance_exhaust=conductance,
        ratio_supply=ratio,
    )
    cylinder.start(0.0)
    names = ["extension", "velocity", "pressure_extend", "pressure_retract", "tension"]
    for valve, supply, contact, stiffness, relaxed in inputs:
        cylinder.valve, cylinder.supply_pressure = valve, supply
        cylinder.contact_extension, cylinder.contact_stiffness = contact, stiffness
        cylinder.relaxed_stiffness = relaxed
        values = run(cylinder, 0.02, names=names)
        assert np.all(np.isfinite(values))
        assert cylinder.gas_mass.min() > 0.0
        assert np.all((values[:, 0] > -15e-3) & (values[:, 0] < 25e-3))
        assert np.all(values[:, 2:4] > -AMBIENT)
        assert np.all(values[:, 4] >= 0.0)


@pytest.mark.parametrize("h", [1e-3, 1e-4])
@pytest.mark.parametrize("orientation", [1, -1])
def test_piston_and_free_carriage_keep_their_momentum(native, orientation, h):
    """A carriage without friction and current, on which the sleeve closes and opens: momentum stays zero, step by step.

    The servomotor's mass is that of the carriage with the piston, whose velocity is relative to the carriage. Within a step
    the force is its mean, so positions converge with the step (3 % at 1 ms) while the momentum is exact.
    """
    cylinder = native(PneumaticCylinder, orientation=orientation)
    free = {"mode_of_operation": 10, "friction_coulomb": 0.0, "friction_viscous": 0.0, "resistance": 1e9}
    motor = native(Servomotor, drive_period=h, **free)
    cylinder.start(0.0)
    motor.start(0.0)
    momenta, places = [], []
    for step in range(round(0.3 / h)):
        cylinder.valve = 0.02 <= step * h < 0.15
        cylinder.advance(step * h, h)
        motor.recoil_force = cylinder.recoil_force
        motor.advance(step * h, h)
        momenta.append((motor.mass * motor.velocity, orientation * cylinder.mass * cylinder.velocity))
        places.append((cylinder.extension, motor.position))
    carriage, piston = np.array(momenta).T
    assert abs(piston).max() > 0.05
    assert abs(carriage + piston).max() < 1e-14
    (closed, there), (opened, back) = places[len(places) // 2 - 1], places[-1]
    travel = -orientation * cylinder.mass / motor.mass * (closed - opened)
    assert there - back == pytest.approx(travel, rel=40.0 * h)
    assert abs(travel) > 0.2e-3
