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


@pytest.mark.parametrize("retracted", [-19e-3, -30e-3, -60e-3])
def test_a_tip_that_is_pulled_back_does_not_drag_the_silicone(native, retracted):
    """What the tip does not feel, the wall does not feel either: it recovers in the same time, however far the tip is away."""
    wall = native(Wall)
    wall.start(0.0)
    hold(wall, 0.0)
    before = float(wall.indentation)
    depths = []
    for step in range(40):
        wall.tip_position = retracted
        assert wall.advance(step * H, H) == 0
        assert wall.force == 0.0
        depths.append(float(wall.indentation))
    # by itself: Hertz elastic force F(d) over its damping c F(d) + g, integrated with small steps
    depth, expected = before, []
    for _ in range(40):
        for _ in range(1000):
            elastic = 4 / 3 * 105e3 * np.sqrt(1.33e-3 * depth) * depth
            depth -= 1e-6 * elastic / (8.0 * elastic + 0.1)
        expected.append(depth)
    np.testing.assert_allclose(depths, expected, rtol=5e-3, atol=2e-7)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("seed", range(5))
def test_contact_gives_no_work_away(native, seed):
    """Over motions that begin and end apart, the work done on tip and heart together is never negative."""
    generator = np.random.default_rng(seed)
    wall = native(Wall)
    wall.tip_position = -40e-3
    wall.start(0.0)
    time = np.arange(0.0, 6.0, H)
    window = np.sin(np.pi * time / 6.0) ** 2
    tip = -40e-3 + window * (30e-3 + 8e-3 * np.sin(2 * np.pi * generator.uniform(0.5, 8.0) * time))
    heart = window * 5e-3 * np.sin(2 * np.pi * generator.uniform(0.5, 3.0) * time)
    work, least, last = 0.0, 0.0, (tip[0] - heart[0], 0.0)
    for t, own, moved in zip(time, tip, heart, strict=True):
        wall.tip_position, wall.heart_position = own, moved
        wall.advance(t, H)
        way, force = own - moved, float(wall.force)
        work += 0.5 * (force + last[1]) * (way - last[0])
        last = way, force
        least = min(least, work)
    assert work > 0.0
    assert least > -1e-6


def press_and_retract(part, seconds=2.0, h=1e-4):
    """Approach from 5 mm off, press by 12 mm beyond the first touch, retract: the part after each step."""
    steps = round(seconds / h)
    off = part.surface_position - 5e-3
    part.tip_position = off
    part.start(0.0)
    for step in range(1, steps + 1):
        part.tip_position = off + 17e-3 * 0.5 * (1.0 - np.cos(2.0 * np.pi * step / steps))
        assert part.advance(step * h, h) == 0
        yield part


def test_the_tip_feels_what_the_silicone_feels(native):
    """Action and reaction over approach, contact and retreat: the bent section's force and that of the silicone's own motion."""
    h = 1e-4
    rows = [
        (float(w.force), float(w.tip_position) - float(w.surface_position), float(w.indentation), float(w.displacement))
        for w in press_and_retract(native(Wall), h=h)
    ]
    force, approach, depth, bent = np.array(rows).T
    k = 3 * 4.3e-4 / 48e-3**3

    # on the silicone: Hertz, and its damping at the speed with which it gives way [N]
    elastic = 4 / 3 * 105e3 * np.sqrt(1.33e-3 * np.maximum(depth, 0.0)) * np.maximum(depth, 0.0)
    on_silicone = elastic + (8.0 * elastic + 0.1) * np.gradient(depth, h)

    # on the tip: the section's bending, and none where it is off
    on_tip = k * np.maximum(approach - depth, 0.0)
    touches = force > 0.0
    assert 0.3 < touches.mean() < 0.9
    assert force.max() > 0.1
    np.testing.assert_allclose(on_tip, force, atol=2e-5)
    np.testing.assert_allclose(on_silicone[2:-2], force[2:-2], atol=2e-4)
    np.testing.assert_allclose(bent, -force / k, rtol=1e-12)
    assert not on_tip[~touches].any()
