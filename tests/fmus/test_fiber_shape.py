"""From the true curve over wavelengths back to a curve: what it is worth, and what it says of itself."""

import numpy as np
import pytest

from fmus.gratings import DEGRADED, LOST, VALID
from tests.fmus.fiber_chain import PERFECT, PERIOD, Chain

ARCH = {"segment_angle": (0.0, 0.0, 1.9, 0.0, 0.0, 0.0)}


def error(chain):
    """Mean distance of the curves, at travel 0 [m]."""
    return np.linalg.norm(chain.shape.shape[1:39] - chain.tip.shape[1:39], axis=1).mean()


def test_wavelengths_follow_the_printed_equation(native):
    chain = Chain(native, fiber={**PERFECT, "temperature": 303.15}).go()
    grating = 24
    unstrained = 1512e-9 + grating * 2e-9
    k1 = chain.tip.curvature[grating, 0]
    for core, angle in ((1, 0.0), (2, 120.0), (3, 240.0)):
        strain = -k1 * 37.5e-6 * np.cos(np.radians(angle))
        wanted = unstrained * (1.0 + 0.78 * strain + 6.5e-6 * 10.0)
        assert chain.fiber.wavelength[core, grating] == pytest.approx(wanted, abs=1e-18)
    assert chain.fiber.wavelength[0, grating] == pytest.approx(unstrained * (1.0 + 6.5e-5), abs=1e-18)


def test_a_perfect_fiber_returns_the_curvature_and_nearly_the_curve(native):
    chain = Chain(native, tip=ARCH, fiber=PERFECT).go()
    np.testing.assert_allclose(chain.shape.curvature, chain.tip.curvature, atol=1e-9)
    assert chain.shape.status == VALID
    assert error(chain) < 0.3e-3  # what sampling every 10 mm leaves


def test_the_curve_of_dense_gratings_is_the_true_one(native):
    dense = {"pitch": 4e-3}
    path = {**dense, "grating_length": 4e-3, "segment_length": (0.02, 0.05, 0.05, 1.0, 1.0, 1.0)}
    chain = Chain(native, {**path, **ARCH, "support_location": (0.02, 0.07, 0.12)}, {**PERFECT, **dense}, dense).go()
    assert error(chain) < 0.02e-3


def test_temperature_and_tension_bend_nothing(native):
    cold = Chain(native, tip=ARCH, fiber=PERFECT).go()
    warm = Chain(native, tip=ARCH, fiber={**PERFECT, "temperature": 310.15}).go()
    np.testing.assert_allclose(warm.shape.shape, cold.shape.shape, atol=1e-9)
    assert warm.shape.temperature == pytest.approx(310.15, abs=1e-3)
    stretched = Chain(native, tip=ARCH, fiber={**PERFECT, "axial_strain": 2e-4}).go()
    np.testing.assert_allclose(stretched.shape.shape, cold.shape.shape, atol=1e-9)


def test_a_known_twist_is_taken_back_and_an_unknown_one_is_not(native):
    straight = Chain(native, tip=ARCH, fiber=PERFECT).go()
    known = Chain(native, tip=ARCH, fiber={**PERFECT, "twist": 2.0}, shape={"twist": 2.0}).go()
    np.testing.assert_allclose(known.shape.shape, straight.shape.shape, atol=1e-9)
    unknown = Chain(native, tip=ARCH, fiber={**PERFECT, "twist": 2.0}).go()
    assert error(unknown) > 10.0 * error(straight)
    assert unknown.shape.status == VALID  # no core feels it


@pytest.mark.parametrize("core", [1, 2, 3, 4])
def test_any_core_may_break(native, core):
    whole = Chain(native, tip=ARCH, fiber=PERFECT).go()
    broken = Chain(native, tip=ARCH, fiber={**PERFECT, "broken_core": core, "break_location": 0.1}).go()
    np.testing.assert_allclose(broken.shape.shape, whole.shape.shape, atol=1e-7)
    assert broken.shape.status == DEGRADED


def test_a_wrong_angle_is_told(native):
    wrong = Chain(native, tip=ARCH, shape={"core_angle": (0.0, 0.0, 2.0944, 2.0 * 2.0944 + 0.5)}).go()
    assert wrong.shape.status == DEGRADED
    assert error(wrong) > 1.15e-3


def nothing_at(*gratings, value=0.0, cores=(0, 1)):
    def spoil(chain):
        for core in cores:
            chain.shape.wavelength[core, list(gratings)] = value

    return spoil


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf, 1.0, -1.0])
def test_what_is_no_wavelength_is_bridged(native, value):
    chain = Chain(native, tip=ARCH, fiber=PERFECT).go()
    chain.go(spoil=nothing_at(24, value=value))
    assert chain.shape.status == DEGRADED
    assert error(chain) < 1.15e-3


@pytest.mark.parametrize("gratings", [(0,), (37,), (0, 1), (36, 37)])
def test_the_outermost_gratings_are_bridged_too(native, gratings):
    chain = Chain(native, fiber=PERFECT).go(spoil=nothing_at(*gratings))
    assert chain.shape.status == DEGRADED
    assert error(chain) < 0.4e-3


def test_saturation_is_no_measurement(native):
    saturated = Chain(native, fiber={**PERFECT, "wavelength_range": 0.5e-9}, shape={"wavelength_range": 0.5e-9}).go()
    assert saturated.shape.status != VALID
    assert np.isfinite(saturated.shape.shape).all()


def wrong_count(chain):
    chain.shape.grating_count = 37


def too_old(chain):
    chain.shape.wavelength_age = 0.2


def no_age(chain):
    chain.shape.wavelength_age = np.nan


def all_gone(chain):
    chain.shape.wavelength[:] = np.nan


@pytest.mark.parametrize("spoil", [wrong_count, too_old, no_age, all_gone, nothing_at(3, 4, 5)])
def test_the_last_good_curve_is_held_for_a_stated_time(native, spoil):
    chain = Chain(native, tip=ARCH).go()
    good = chain.shape.shape.copy()
    states = []
    for _ in range(40):
        chain.go(travel=5e-3, spoil=spoil)
        np.testing.assert_array_equal(chain.shape.shape, good)
        states.append(chain.shape.status)
    held = round(0.1 / PERIOD) - 2  # it was two periods old
    assert states == [DEGRADED] * held + [LOST] * (40 - held)
    assert chain.shape.age == pytest.approx(42 * PERIOD)
    chain.go(travel=5e-3)
    assert chain.shape.status == VALID
    assert not np.array_equal(chain.shape.shape, good)


def test_an_old_sample_is_degraded_before_it_is_lost(native):
    def old(chain):
        chain.shape.wavelength_age = 0.02

    assert Chain(native).go(spoil=old).shape.status == DEGRADED


def test_without_a_first_sample_there_is_a_straight_line_that_is_lost(native):
    chain = Chain(native)
    chain.shape.wavelength[:] = np.nan
    chain.shape.start()
    chain.go(spoil=all_gone)
    assert chain.shape.status == LOST
    np.testing.assert_allclose(chain.shape.shape[38], (0.0, 0.0, 0.38), atol=1e-12)


def test_a_stopped_interrogator_shows_in_the_age(native):
    chain = Chain(native).go()
    before = chain.fiber.wavelength.copy()
    chain.fiber.stopped = True
    for k in range(2, 5):
        chain.go(travel=5e-3)
        assert chain.fiber.age == pytest.approx(k * PERIOD)
    np.testing.assert_array_equal(chain.fiber.wavelength, before)


def test_lost_samples_are_as_many_as_asked(native):
    chain = Chain(native, fiber={"loss": 0.2})
    old = 0
    for _ in range(2000):
        chain.go()
        old += chain.fiber.age > 1.5 * PERIOD
    assert old / 2000 == pytest.approx(0.2, abs=0.03)


def test_fibers_differ_by_their_seed_and_are_as_good_as_published(native):
    errors = [error(Chain(native, tip=ARCH, fiber={"seed": seed}).go()) for seed in range(20)]
    assert len(set(errors)) == len(errors)
    assert 0.2e-3 < np.mean(errors) < 1.15e-3
