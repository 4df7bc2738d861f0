"""The wall from the tip in contact: the gripper's motion is not the wall's, and what is not contact is no sample."""

import numpy as np
import pytest
from fmus.wall_tracking import windows
from fmus.wall_tracking.model import LOST, VALID, WallTracking

H = 1e-3


def tracked(native, tips, force=0.2, **parameters):
    """Travel along the wall's motion, status and age at each tip."""
    part = native(WallTracking, force=force, tip_age=4e-3, **parameters)
    part.start(0.0)
    rows = []
    for k, tip in enumerate(tips):
        part.tip_position[:] = tip
        assert part.advance(k * H, H) == 0
        rows.append((float(part.position[2]), int(part.status), float(part.age)))
    return np.array(rows)


def test_the_grippers_motion_is_not_the_walls(native):
    """On a wall inclined by 45 deg that moves as `wall`, a root that comes forward slides the tip along it."""
    times = np.arange(1.0, 2000.0) * H
    wall = 5e-3 * np.sin(2 * np.pi * times)
    root = 7e-3 * np.sin(2 * np.pi * 0.37 * times)
    found = tracked(native, np.stack([0 * wall, wall - root, root], axis=1))
    np.testing.assert_allclose(found[:, 0], wall, atol=1e-12)
    assert (found[:, 1] == VALID).all()
    np.testing.assert_allclose(found[:, 2], 5e-3)  # a period older


def test_a_tip_that_does_not_touch_is_no_sample(native):
    assert (tracked(native, [(0, 1e-3, 0)], force=0.02)[:, 1] == LOST).all()
    assert (tracked(native, [(0, 1e-3, 0)], force=np.nan)[:, 1] == LOST).all()


@pytest.mark.parametrize("values", [{"tip": (0, np.nan, 0)}, {"normal": (0.0, 1.0, 0.0)}])
def test_what_is_no_place_is_no_sample(native, values):
    tip = values.pop("tip", (0, 1e-3, 0))
    (row,) = tracked(native, [tip], **values)
    assert row[1] == LOST
    assert np.isfinite(row).all()


def test_a_sample_that_is_held_keeps_its_place_and_age(native):
    part = native(WallTracking, tip_age=4e-3)
    part.start(0.0)
    part.tip_position[:] = (0, 1e-3, 0)
    part.advance(0.0, H)
    part.tip_age = 9e-3  # of a sample that did not come
    part.advance(H, H)
    assert (float(part.position[2]), float(part.age)) == (1e-3, 5e-3)


@pytest.mark.parametrize(("count", "first"), [(4401, 4400), (3201, 3201), (2500, None)])
def test_force_in_windows_of_ten_seconds(count, first):
    """A run that ends early has one shorter window, or no number: it must not pass for a run without data."""
    force = np.random.default_rng(0).standard_normal(count)
    found = windows.analysis(force)["force_std"]
    assert len(found) == count
    if first is None:
        assert np.isnan(found).all()
    else:
        assert found[0] == pytest.approx(force[2400:first].std())
        assert found[-1] == pytest.approx(force[-2000:][-(count - 2400) :].std())
