import numpy as np
import pytest
from fmus.sheath.model import Sheath

from fmus.dead_zone import dead_zone

H = 1e-3


def drive(sheath, path, force=0.0, h=H):
    """Tip positions and reactions along a path of the gripper; force: contact force, one or one per sample."""
    force = np.broadcast_to(force, path.shape)
    sheath.gripper_position, sheath.contact_force = path[0], force[0]
    sheath.start(0.0)
    tip, reaction = [], []
    for step in range(path.size):
        sheath.gripper_position, sheath.contact_force = path[step], force[step]
        assert sheath.advance(step * h, h) == 0
        tip.append(float(sheath.tip_position))
        reaction.append(float(sheath.reaction_force))
    return np.array(tip), np.array(reaction)


def test_beyond_is_a_dead_zone():
    assert [dead_zone(x, 1.0) for x in (-3.0, -1.0, 0.5, 1.0, 2.5)] == [-2.0, 0.0, 0.0, 0.0, 1.5]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("seed", range(4))
def test_is_passive(native, seed):
    """Work put in at both ends is never negative, from rest on, and positive over closed cycles."""
    random = np.random.default_rng(seed)
    h = 1e-4
    t = np.arange(0.0, 4.0, h)
    path = sum(
        3e-3 / k * np.sin(2 * np.pi * k * t + p) - 3e-3 / k * np.sin(p)
        for k, p in enumerate(random.uniform(0, 6, 3), 1)
    )
    force = 1.5 * (1.0 - np.cos(2 * np.pi * t)) * random.uniform(0.2, 1.0)
    tip, reaction = drive(native(Sheath), path, force, h)
    work = np.cumsum(-0.5 * (reaction[1:] + reaction[:-1]) * np.diff(path)) - np.cumsum(
        0.5 * (force[1:] + force[:-1]) * np.diff(tip)
    )
    assert work.min() > -1e-6
    cycles = work[9999::10000]
    assert np.all(np.diff(cycles) > 1e-3)


def test_friction_holds_the_tip(native):
    # 2.2 N/mm * 0.25 mm stays below the 0.6 N of the first node
    tip, reaction = drive(native(Sheath), np.full(500, 0.25e-3) * np.sin(np.arange(500) * 0.05))
    assert np.all(tip == 0.0)
    assert np.abs(reaction).max() < 0.6
    tip, _ = drive(native(Sheath), np.zeros(500), force=0.79)
    assert np.all(tip == 0.0)


def test_play_is_lost_at_a_reversal(native):
    sheath = native(Sheath, friction=(0.0, 0.0, 0.0), friction_coefficient=0.0)
    path = np.concatenate((np.arange(0, 4000), np.arange(4000, 0, -1))) * 1e-6  # 1 mm/s
    tip, _ = drive(sheath, path)
    lost = (path[3500] - tip[3500]) - (path[5500] - tip[5500])
    assert lost == pytest.approx(0.6e-3, rel=0.05)


def test_loop_is_wider_at_higher_rate(native):
    widths = []
    for frequency in (0.2, 3.0):
        t = np.arange(0.0, 3.0 / frequency, H)
        path = 5e-3 * np.sin(2 * np.pi * frequency * t)
        tip, _ = drive(native(Sheath), path)
        cycle = t > 2.0 / frequency
        widths.append(-np.trapezoid(path[cycle], tip[cycle]) / np.ptp(tip[cycle]))
    assert abs(widths[1]) > 1.1 * abs(widths[0]) > 1e-3
