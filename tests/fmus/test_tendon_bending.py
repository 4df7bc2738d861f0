from itertools import pairwise

import numpy as np
import pytest
from fmus.tendon_bending.model import TendonBending

H = 0.01
ONE_PLAY = {"gain": (100.0, 0.0, 0.0, 0.0, 0.0), "lag": 0.0, "conditioning": 0.0}


def drive(displacement, **parameters):
    """Angle and tip along a displacement of the tendon."""
    part = TendonBending(tendon_displacement=displacement[0], **parameters)
    part.start()
    rows = []
    for k, value in enumerate(displacement):
        part.tendon_displacement = value
        assert part.advance(k * H, H) == 0
        rows.append((part.bending_angle, part.tip_x, part.tip_y, part.tip_z))
    return np.array(rows)


def ramp(*corners):
    """Piecewise linear displacement [m] through corners [mm], 200 samples each."""
    return 1e-3 * np.concatenate([np.linspace(a, b, 200) for a, b in pairwise(corners)])


def test_reversal_costs_the_width_of_the_play():
    u = ramp(0, 4, 3, 0)
    angle = drive(u, **ONE_PLAY)[:, 0]
    top = 100.0 * (4e-3 - 0.2e-3)
    assert angle.max() == pytest.approx(top)
    stuck = (np.arange(u.size) >= 200) & (u > 3.6e-3 + 1e-9)
    assert angle[stuck] == pytest.approx(top)
    assert angle[399] == pytest.approx(100.0 * (3e-3 + 0.2e-3))


def test_first_pull_bends_less_than_later_ones():
    u = ramp(0, 5, 1, 5)
    angle = drive(u, lag=0.0)[:, 0]
    later = np.interp(3e-3, u[400:], angle[400:])
    assert later > np.interp(3e-3, u[:200], angle[:200]) + np.radians(1)
    assert angle[-1] == pytest.approx(angle[199])  # the loop closes at the last maximum


def test_begins_at_once_where_plays_are_conditioned():
    narrow = drive(ramp(0, 0.1), conditioning=1e-3, lag=0.0)[-1, 0]
    assert narrow == pytest.approx((130.0 + 20.0 + 10.0) * 0.1e-3)


def test_slack_is_taken_up_first():
    angle = drive(ramp(0, 2), slack=0.5e-3, **{**ONE_PLAY, "half_width": (0.0,) * 5})[:, 0]
    assert angle[:49] == pytest.approx(0.0)
    assert angle[-1] == pytest.approx(0.15)


def test_frame_turned_by_half_a_turn_mirrors_x_and_y():
    usual = {"usual_position": (2e-3, 15e-3, -0.15), "tangent": (1e-3, -50e-3, 5e-3)}
    seen = drive(ramp(0, 3), start_position=(2e-3, 15e-3, -0.15), **usual)
    turned = drive(ramp(0, 3), start_position=(-2e-3, -15e-3, -0.15), **usual)
    assert turned == pytest.approx(seen * [1, -1, -1, 1])


def test_rest_elsewhere_on_the_path_follows_the_same_path():
    """A run that rests bent by 0.1 rad comes by the points that a run from the usual rest comes by."""
    shape = {"usual_position": (0.0, 0.0, 0.15), "tangent": (0.08, 0.0, 0.0), "bend": (-0.01, 0.0, 0.0)}
    usual = drive(ramp(0, 3), start_position=(0.0, 0.0, 0.15), **shape)
    bent = drive(ramp(0, 3), start_position=(0.008, 0.0, 0.15), **shape)
    step = 0.08 * usual[-1, 0] - 0.01 * ((0.1 + usual[-1, 0]) ** 2 - 0.1**2)
    assert bent[-1, 1] == pytest.approx(0.008 + step)


def test_lag_delays_by_its_time_constant():
    angle = drive(ramp(0, 4), **{**ONE_PLAY, "lag": 0.05, "half_width": (0.0,) * 5})[:, 0]
    speed = 4e-3 / 199 / H
    assert angle[-1] == pytest.approx(100.0 * (4e-3 - speed * 0.05), abs=100.0 * speed * H)


def test_start_under_pull_continues_the_path():
    """A run that begins pulled, seen from the first tip on, is the rest of one that begins at rest."""
    shape = {"usual_position": (2e-3, 15e-3, -0.15), "tangent": (1e-3, -50e-3, 5e-3), "bend": (0.0, -20e-3, 20e-3)}
    whole = drive(ramp(0, 2, 3), start_position=(2e-3, 15e-3, -0.15), lag=0.0, **shape)
    later = drive(ramp(2, 3), start_position=tuple(whole[199, 1:] * [-1, -1, 1]), lag=0.0, **shape)
    assert later == pytest.approx(whole[200:] * [1, -1, -1, 1])
