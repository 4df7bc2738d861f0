"""The kernels of curves, against closed forms and scipy."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from fmus import curves


def carried(k1, k2, steps, h):
    frame = np.empty((4, 3))
    curves.set_frame(frame)
    for i in range(steps):
        s = (i + 0.5) * h
        curves.advance_frame(frame, k1(s), k2(s), h)
    return frame


def test_a_circle_closes():
    frame = carried(lambda _: 20.0, lambda _: 0.0, 40, 2.0 * np.pi / 20.0 / 40)
    np.testing.assert_allclose(frame[3], 0.0, atol=1e-9)
    np.testing.assert_allclose(frame[:3], np.eye(3), atol=1e-9)


def test_a_helix_comes_out_although_no_frame_turns_about_the_tangent():
    radius, pitch = 20e-3, 15e-3  # pitch: rise per radian
    size = np.hypot(radius, pitch)
    curvature, torsion = radius / size**2, pitch / size**2
    length, steps = 0.2, 2000
    h = length / steps
    frame = carried(lambda s: curvature * np.cos(torsion * s), lambda s: curvature * np.sin(torsion * s), steps, h)

    # the helix, turned so that it begins along z with its normal along x
    def helix(s):
        return np.array([radius * np.cos(s / size), radius * np.sin(s / size), pitch * s / size])

    tangent, normal = np.array([0.0, radius, pitch]) / size, np.array([-1.0, 0.0, 0.0])
    turned = np.vstack((normal, np.cross(tangent, normal), tangent))
    np.testing.assert_allclose(frame[3], turned @ (helix(length) - helix(0.0)), atol=1e-7)


def test_frames_stay_orthonormal():
    frame = carried(lambda s: 30.0 * np.sin(40.0 * s), lambda s: 30.0 * np.cos(17.0 * s), 400, 1e-2)
    np.testing.assert_allclose(frame[:3] @ frame[:3].T, np.eye(3), atol=1e-8)


@pytest.mark.parametrize("count", [4, 9, 38])
def test_spline_is_that_of_scipy(count):
    random = np.random.default_rng(1)
    values, moments = np.zeros((40, 2)), np.full((40, 2), np.nan)
    values[:count] = random.normal(size=(count, 2))
    curves.spline(values, moments, np.full(40, np.nan), count)
    wanted = CubicSpline(np.arange(count), values[:count], bc_type="natural")
    for x in np.linspace(0.0, count - 1, 61):
        i = curves.interval(x, count)
        for c in range(2):
            assert curves.interpolated(values, moments, c, i, x - i) == pytest.approx(wanted(x)[c], abs=1e-12)
            assert curves.slope(values, moments, c, i, x - i) == pytest.approx(wanted(x, 1)[c], abs=1e-11)


def test_between_nodes_is_hermite():
    random = np.random.default_rng(2)
    shape, tangent = random.normal(size=(3, 3)), random.normal(size=(3, 3))
    wanted = CubicHermiteSpline([0.0, 0.01, 0.02], shape, tangent)
    for part in (0.0, 0.3, 1.0):
        for j in range(3):
            found = curves.hermite(part, 0.01) @ np.array([shape[1, j], shape[2, j], tangent[1, j], tangent[2, j]])
            assert found == pytest.approx(wanted(0.01 * (1.0 + part))[j], abs=1e-14)
