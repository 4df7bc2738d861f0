"""Sizes of a scene over all of its instants."""

import numpy as np
import pytest

from twin.scene.frames import Frames, Track, Vectors

ROD = np.array([[[0.0, 0.0], [0.3, 0.0]], [[0.0, 0.0], [0.3, 0.4]], [[np.nan, 0.0], [np.nan, np.nan]]])


def test_bounds_hold_every_instant():
    frames = Frames("rod", None, np.arange(3.0), lines=(Track("rod", ROD),))
    assert len(frames.extent_points) == 4
    assert frames.arrow == pytest.approx(0.14 * 0.5)
    assert frames.bounds == pytest.approx((-0.016, -0.016, 0.316, 0.416))


def test_tips_of_arrows_are_within_the_bounds():
    """The longest one has the length of `arrow`, whatever its unit."""
    vectors = np.array([[[0.0, -20.0]], [[0.0, 10.0]], [[np.nan, 0.0]]])
    load = Vectors("load", np.array([[[0.3, 0.0]]] * 3), vectors, "N")
    frames = Frames("rod", None, np.arange(3.0), lines=(Track("rod", ROD),), arrows=(load,))
    assert frames.bounds[1] == pytest.approx(-0.07 - 0.04 * 0.47)


def test_a_scene_without_a_point_has_a_size():
    frames = Frames("nothing", None, np.arange(3.0), points=(Track("tip", np.full((3, 1, 2), np.nan)),))
    assert frames.bounds == (-0.1, -0.1, 0.1, 0.1)
