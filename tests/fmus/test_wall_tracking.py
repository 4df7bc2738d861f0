"""The wall from the tip in contact: the gripper's motion is not the wall's, and what is not contact is no sample."""

import numpy as np
import pytest
from fmus.wall_tracking import windows
from fmus.wall_tracking.model import LOST, VALID, WallTracking

from twin.results import Analysis, Expectation, Metric, Signals, evaluate, expression

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


def test_force_in_windows_of_ten_seconds():
    force = np.random.default_rng(0).standard_normal(4403)
    found = windows.analysis(force)["force_std"]
    assert len(found) == len(force)
    assert found[0] == found[4399] == pytest.approx(force[2400:4400].std())
    assert found[-1] == pytest.approx(force[-2000:].std())


@pytest.mark.parametrize("ends", [12.5, 14.0, 21.9])
def test_a_run_without_a_complete_window_is_not_judged_by_it(ends):
    """A limit for ten seconds says nothing of two."""
    signal = expression.parse("windows.force_std")
    analysis = Analysis("windows", "fmus.wall_tracking.windows:analysis", {"force": expression.parse("wall.force")})
    metric = Metric("worst", signal, "max", unit="N")
    limits = [
        Expectation("metric", metric="worst", at_most=1.0),
        Expectation("samples", signal=signal, at_most=1.0),
        Expectation("order", metric="worst", ordered=("PI", "FF")),
    ]
    time = windows.SAMPLE * np.arange(round(ends / windows.SAMPLE) + 1)
    signals = Signals(time, {"wall.force": 0.1 * np.sin(time)}, {"wall.force": "N"})
    found = evaluate({"worst": metric}, limits, {(name, 1): analysis.apply(signals) for name in ("PI", "FF")})
    assert [result.verdict for result in found.expectation_results] == ["skipped"] * 3
    assert not found.metric_results
