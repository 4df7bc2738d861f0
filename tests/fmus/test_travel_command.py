import numpy as np
import pytest
from fmus.travel_command.model import TravelCommand


def run(part, seconds, h=1e-3):
    part.start(0.0)
    rows = [(0.0, float(part.target_velocity), float(part.reference_position))]
    for k in range(round(seconds / h)):
        part.advance(k * h, h)
        rows.append(((k + 1) * h, float(part.target_velocity), float(part.reference_position)))
    return np.array(rows).T


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("distance", "speed"), [(0.5, 0.04), (-0.1, 0.02), (0.001, 0.04)])
def test_out_and_back_with_the_integral_of_the_speed(native, distance, speed):
    part = native(TravelCommand, distance=distance, speed=speed, begin=0.2, dwell=0.5)
    t, v, x = run(part, 0.2 + 2.0 * (abs(distance) / speed + 0.2) + 0.5)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (v[1:] + v[:-1]))])
    assert x == pytest.approx(integral, abs=2e-7)
    assert np.abs(x).max() == pytest.approx(abs(distance), rel=1e-6)
    assert x[-1] == pytest.approx(0.0, abs=1e-12)
    assert v[-1] == 0.0
    assert np.abs(np.diff(v)).max() <= 0.5e-3 + 1e-12
    assert np.abs(v).max() <= speed + 1e-12


def test_no_distance_is_no_motion(native):
    _, v, x = run(native(TravelCommand, distance=0.0), 1.0)
    assert not v.any()
    assert not x.any()
