import numpy as np
import pytest
from fmus.air_supply.model import AirSupply

H = 1e-3
BURST = 3e-8


def run(supply, seconds, begin=0.0):
    rows = []
    for step in range(round(seconds / H)):
        assert supply.advance(begin + step * H, H) == 0
        rows.append((float(supply.supply_pressure), bool(supply.pressure_ok)))
    return np.array(rows).T


def started(native, **values):
    supply = native(AirSupply, **values)
    supply.start(0.0)
    return supply


def test_rests_just_below_the_regulator(native):
    pressure, ok = run(started(native), 2.0)
    assert 5.99e5 < pressure[-1] < 6e5
    assert ok.all()


def test_line_below_the_regulator_sets_the_pressure(native):
    supply = started(native, line_pressure=3e5)
    pressure, ok = run(supply, 1.0)
    assert pressure[-1] == pytest.approx(3e5, rel=1e-3)
    assert not ok.any()


def test_burst_empties_the_reservoir_as_a_choked_flow_does(native):
    supply = started(native, line_pressure=0.0, conductance_leak=BURST)
    supply.line_pressure = 6e5
    supply.start(0.0)
    supply.line_pressure = 0.0
    pressure, ok = run(supply, 0.5)

    # choked, absolute pressure falls exponentially: C rho R T / V
    rate = BURST * 1.185 * 287.06 * 293.15 / 0.1e-3
    choked = pressure > 3e5
    time = H * (1 + np.arange(len(pressure)))
    absolute = (6e5 + 101325.0) * np.exp(-rate * time)
    assert pressure[choked] + 101325.0 == pytest.approx(absolute[choked], rel=0.02)
    assert pressure[-1] == pytest.approx(0.0, abs=100.0)
    assert np.all(np.diff(pressure) <= 1e-6)
    assert not ok[-1]


def test_check_valve_keeps_the_air_of_a_lost_line(native):
    supply = started(native)
    supply.line_pressure = 0.0
    pressure, ok = run(supply, 10.0)
    assert 5e5 < pressure[-1] < 6e5
    assert ok.all()


def test_each_switched_valve_takes_its_share(native):
    supply = started(native, conductance_leak=0.0)
    supply.line_pressure = 0.0
    seen = []
    for k in range(12):
        supply.valve[k % 2] = not supply.valve[k % 2]
        seen.append(run(supply, 0.1, begin=0.1 * k)[0][-1])
    assert np.array(seen) == pytest.approx(6e5 * (1.0 - 0.034) ** np.arange(1, 13), rel=1e-6)
    assert not supply.pressure_ok


def test_switch_has_a_hysteresis(native):
    supply = started(native, line_pressure=6e5)
    supply.line_pressure = 0.0
    supply.conductance_leak = BURST
    pressure, ok = run(supply, 0.5)
    assert pressure[np.flatnonzero(ok == 0)[0]] < 4.5e5 <= pressure[np.flatnonzero(ok == 1)[-1]]
    supply.line_pressure = 8e5
    supply.conductance_leak = 0.0
    pressure, ok = run(supply, 1.0)
    assert pressure[np.flatnonzero(ok == 0)[-1]] < 5e5 <= pressure[np.flatnonzero(ok == 1)[0]]
    assert ok[-1]
