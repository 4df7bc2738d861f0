import numpy as np
import pytest
from fmus.wall.model import Wall

H = 1e-3


def hold(wall, tip, seconds=1.0, heart=0.0):
    wall.tip_position, wall.heart_position = tip, heart
    for step in range(round(seconds / H)):
        assert wall.advance(step * H, H) == 0
    return float(wall.force)


def test_rests_at_the_static_force(native):
    wall = native(Wall)
    wall.start(0.0)
    assert hold(wall, 0.0) == pytest.approx(0.2, rel=1e-2)

    # cantilever 3 EI / L^3 in series with Hertz contact
    k = 3 * 4.3e-4 / 48e-3**3
    depth = wall.force / k + (wall.force / (4 / 3 * 105e3 * np.sqrt(1.33e-3))) ** (2 / 3)
    assert depth == pytest.approx(18.3e-3, rel=1e-6)


def test_pushes_and_never_pulls(native):
    wall = native(Wall)
    wall.start(0.0)
    forces = []
    for step in range(3000):
        wall.tip_position = -18.3e-3 + 5e-3 * np.sin(2 * np.pi * 2.0 * step * H)
        wall.advance(step * H, H)
        forces.append(float(wall.force))
    assert min(forces) == 0.0
    assert 0.04 < max(forces) < 0.07
    assert hold(wall, -40e-3) == 0.0


def test_moves_with_the_heart(native):
    a, b = native(Wall), native(Wall)
    for wall in (a, b):
        wall.start(0.0)
    assert hold(a, 2e-3) == pytest.approx(hold(b, 0.0, heart=-2e-3), rel=1e-12)


def test_yields_more_slowly_than_it_is_pushed(native):
    """Loading costs more force than unloading: the contact dissipates."""
    wall = native(Wall, free_length=20e-3)
    wall.start(0.0)
    push, release = [], []
    for step in range(1, 200):
        wall.tip_position = -18.3e-3 + 2e-3 * (1 - np.cos(np.pi * step / 200)) / 2
        wall.advance(step * H, H)
        push.append(float(wall.force))
    for step in range(1, 200):
        wall.tip_position = -18.3e-3 + 2e-3 * (1 + np.cos(np.pi * step / 200)) / 2
        wall.advance(0.2 + step * H, H)
        release.append(float(wall.force))
    assert sum(push) > 1.02 * sum(release) > 0.0
