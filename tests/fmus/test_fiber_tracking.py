"""Tip tracking by the shift of the curvature profile: what it is worth, what it says of itself, and that it can fail.

Over 400 lines: everything about one estimator.
"""

import numpy as np
import pytest
from fmus.guided_tip.model import GuidedTip
from fmus.registration import rotate_onto
from fmus.tip_tracking import evaluate
from fmus.tip_tracking.model import TipTracking
from scipy.spatial.transform import Rotation

from fmus.gratings import DEGRADED, LOST, VALID
from tests.fmus.fiber_chain import PERFECT, PERIOD, Chain

ARCH = {"segment_angle": (0.0, 0.0, 1.9, 0.0, 0.0, 0.0)}
STRAIGHT = {"segment_curvature": (0.0,) * 6}
SWEEP = np.concatenate((np.zeros(5), np.linspace(0.0, 5e-3, 26), np.linspace(5e-3, -5e-3, 51)))


def follow(chain, travels=SWEEP):
    """Errors of travel and of the tip in space [m], over travels."""
    travel, tip = [], []
    for wanted in travels:
        chain.go(travel=wanted)
        travel.append(float(chain.tracking.travel) - wanted)
        tip.append(chain.tracking.position - chain.tip.tip_position)
    return np.array(travel), np.array(tip)


def paper_holds(errors):
    """Whether errors [m] are within those of section IV.C."""
    return errors.std() <= 0.60e-3 and np.abs(errors).max() <= 1.81e-3


BEAT = np.linspace(0.0, 2.0, 400)  # of the heart, twice
BEATEN = 4e-3 * np.sin(2 * np.pi * BEAT) + 2e-3 * np.sin(4 * np.pi * BEAT + 2.8) - 2e-3 * np.sin(2.8)
SMOOTH = {"blend_length": 30e-3}


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("path", [{}, ARCH, SMOOTH])
@pytest.mark.parametrize("place", [0.0, 5e-3])
def test_motion_beyond_a_pitch_tells_what_the_interpolation_is_wrong_by(native, path, place):
    lengths = (0.203 + place, 0.0785, 0.0785, 1.0, 1.0, 1.0)
    found = {}
    for learn in (False, True):
        chain = Chain(native, {**path, "segment_length": lengths}, {"seed": 3}, tracking={"learn_interpolation": learn})
        errors = follow(chain, np.concatenate((np.zeros(5), BEATEN)))[0][205:]  # from the second beat on
        found[learn] = abs(errors.mean()), errors.std(), np.abs(errors).max()
    mean, spread, largest = found[True]
    assert mean < max(0.6 * found[False][0], 0.05e-3)
    assert spread < max(0.6 * found[False][1], 0.06e-3)
    assert largest < 0.3e-3


@pytest.mark.slow
def test_motion_below_a_pitch_and_a_path_without_bends_teach_nothing(native):
    chain = Chain(native)
    follow(chain, 0.7 * BEATEN)
    assert np.all(chain.tracking.wave == 0.0)
    assert np.any(chain.tracking.path_count == 0)
    for bends in (
        0.0,
        0.5,
        1.0,
        2.0,
        3.0,
    ):  # references that are off by 0.05 1/m make steps that a stretched path would hide
        chain = Chain(native, {"segment_curvature": (0.0, bends, bends, 0.0, 0.0, 0.0)}, {"seed": 3})
        follow(chain, BEATEN)
        assert np.all(chain.tracking.wave == 0.0)


@pytest.mark.parametrize("path", [{}, ARCH, {"segment_length": (0.2105, 0.0785, 0.0785, 1.0, 1.0, 1.0)}])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_shift_is_resolved_far_below_the_pitch(native, path, seed):
    chain = Chain(native, tip=path, fiber={"seed": seed})
    travel, tip = follow(chain)
    assert paper_holds(travel)
    assert np.abs(travel).max() < 0.6e-3  # of a pitch of 10 mm
    assert paper_holds(tip[:, 2] - tip[0, 2])
    assert chain.tracking.status == VALID


def test_shorter_pitch_is_better(native):
    def spread(pitch, count):
        own = {"pitch": pitch, "count": count}
        path = {
            **own,
            "segment_length": (0.02, 0.05, 0.05, 1.0, 1.0, 1.0),
            "segment_curvature": (0.0, 20.0, 20.0, 0, 0, 0),
            "support_location": (0.02, 0.07, 0.12),
        }
        tracking = {**own, "window": 10e-3}
        return follow(Chain(native, path, {**PERFECT, **own}, own, tracking))[0].std()

    assert spread(4e-3, 38) < 0.3 * spread(8e-3, 19)


def test_the_tip_itself_may_move_across(native):
    chain = Chain(native, tip=ARCH)
    for k in range(20):
        chain.go(travel=2e-4 * k, displacement=(2e-4 * k, -1e-4 * k))
    moved = chain.tracking.position - chain.tip.tip_position
    follow_start = Chain(native, tip=ARCH).go().go()
    assert np.linalg.norm(moved - (follow_start.tracking.position - follow_start.tip.tip_position)) < 1e-3


def test_long_travel_takes_new_references(native):
    path = {
        "segment_length": (0.06, 0.05, 0.06, 0.05, 0.06, 1.0),
        "segment_curvature": (0, 20.0, 5.0, 20.0, 0, 0),
        "segment_angle": (0, 0, 2.0, 4.0, 0, 0),
        "support_location": (0.1, 0.2, 0.3),
    }
    chain = Chain(native, tip=path)
    travel, tip = follow(chain, np.concatenate((np.zeros(3), np.linspace(0.0, 0.05, 101))))
    assert chain.tracking.reference_travel > 0.03
    assert np.abs(travel).max() < 0.6e-3
    assert chain.tracking.status == VALID
    assert np.linalg.norm(tip - tip[2], axis=1).max() < 1.5e-3


def test_roll_is_found_and_does_not_disturb(native):
    chain = Chain(native, tip=ARCH, fiber=PERFECT)
    chain.go().go()
    angle = 0.4

    def rolled(one):
        # the fiber turns in the sheath: all its directions do
        c, s = np.cos(angle), np.sin(angle)
        one.shape.curvature[:] = one.shape.curvature @ np.array([[c, -s], [s, c]])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        one.shape.shape[:] = one.shape.shape @ turn
        one.shape.tangent[:] = one.shape.tangent @ turn

    before = chain.tracking.position.copy()
    rolled(chain)
    for name in ("curvature", "shape", "tangent"):
        getattr(chain.tracking, name)[:] = getattr(chain.shape, name)
    chain.tracking.advance(chain.samples * PERIOD, PERIOD)
    assert abs(chain.tracking.roll) == pytest.approx(angle, abs=1e-6)
    assert chain.tracking.travel == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(chain.tracking.position, before, atol=1e-6)


def test_the_rotation_is_that_of_scipy():
    random = np.random.default_rng(3)
    tracking = TipTracking()
    for _ in range(20):
        points = random.normal(size=(12, 3))
        turn = Rotation.random(random_state=int(random.integers(1 << 30)))
        moved = turn.apply(points) + 0.05 * random.normal(size=points.shape)
        tracking.moment[:] = points.T @ moved
        rotate_onto(tracking.moment, tracking.horn, tracking.vectors, tracking.rotation)
        np.testing.assert_allclose(tracking.rotation, Rotation.align_vectors(moved, points)[0].as_matrix(), atol=1e-9)


def test_flat_curves_are_not_mirrored():
    points = np.random.default_rng(4).normal(size=(12, 3)) * (1.0, 1.0, 0.0)
    tracking = TipTracking()
    tracking.moment[:] = points.T @ (points * (1.0, -1.0, 1.0))  # best: half a turn about x, no reflection
    rotate_onto(tracking.moment, tracking.horn, tracking.vectors, tracking.rotation)
    assert np.linalg.det(tracking.rotation) == pytest.approx(1.0)


def test_a_straight_path_is_told_and_nothing_is_made_up(native):
    chain = Chain(native, tip=STRAIGHT)
    for wanted in SWEEP:
        chain.go(travel=wanted)
        assert chain.tracking.status != VALID
        assert np.isfinite(chain.tracking.position).all()
    assert chain.tracking.status == LOST
    assert chain.tracking.uncertainty > 5e-3


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("noise", [0.3e-12, 1e-12, 1.5e-12, 3e-12])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noise_of_any_size_on_a_straight_path_is_no_bend(native, noise, seed):
    chain = Chain(native, tip=STRAIGHT, fiber={"noise": noise, "seed": seed}, tracking={"matched_length": 0.15})
    for _ in range(500):
        chain.go()
        assert chain.tracking.status == LOST
        assert chain.tracking.uncertainty > 5e-3


def test_two_places_that_look_alike_are_told_as_uncertain(native):
    # a wave of 40 mm in the path: a shift of 20 mm and one of -20 mm match as well, in noise
    path = {"segment_length": (0.02,) + (0.02,) * 4 + (1.0,), "segment_curvature": (6.0, -6.0) * 3}
    chain = Chain(native, tip=path, fiber={"seed": 2}, tracking={"matched_length": 0.06, "window": 45e-3})
    chain.go().go()
    chain.tracking.curvature[:] = 0.0
    chain.tracking.curvature[::4, 0] = chain.tracking.curvature[1::4, 0] = 6.0
    chain.tracking.curvature[2::4, 0] = chain.tracking.curvature[3::4, 0] = -6.0
    chain.tracking.has_reference = False
    chain.tracking.advance(chain.samples * PERIOD, PERIOD)
    assert chain.tracking.uncertainty > 5e-3
    assert chain.tracking.status != VALID


def test_the_uncertainty_grows_with_the_noise_of_the_fiber(native):
    told, found = [], []
    for noise in (0.3e-12, 10e-12):
        errors, uncertainties = [], []
        for seed in range(1, 7):
            chain = Chain(native, fiber={**PERFECT, "noise": noise, "seed": seed})
            errors.append(follow(chain, np.zeros(80))[0][5:])
            uncertainties.append(float(chain.tracking.uncertainty))
        told.append(np.mean(uncertainties))
        found.append(np.std(errors))
    assert told[1] > 2.0 * told[0]
    assert found[1] > 2.0 * found[0]


def test_a_reference_that_nothing_matches_any_more_is_given_up(native):
    path = {
        "segment_length": (0.06, 0.05, 0.06, 0.05, 0.06, 1.0),
        "segment_curvature": (0, 20.0, 5.0, 20.0, 0, 0),
        "segment_angle": (0, 0, 2.0, 4.0, 0, 0),
        "support_location": (0.1, 0.2, 0.3),
    }
    chain = Chain(native, tip=path)
    for _ in range(5):
        chain.go()
    for _ in range(60):  # the fiber is dark while the instrument goes on by more than the window
        chain.go(travel=45e-3, spoil=lost)
    before = float(chain.tracking.travel)
    states = []
    for _ in range(60):
        chain.go(travel=45e-3)
        states.append(int(chain.tracking.status))
    assert LOST in states[:30]  # so that everyone who reads the travel notices that it counts anew
    assert states[-1] == VALID
    assert chain.tracking.restarts == 1
    assert chain.tracking.travel == pytest.approx(before, abs=0.5e-3)
    for k in range(40):
        chain.go(travel=45e-3 - 0.2e-3 * k)
    assert chain.tracking.travel == pytest.approx(before - 0.2e-3 * 39, abs=1e-3)


def test_an_even_bend_tells_as_little(native):
    even = {
        "segment_length": (0.0, 1.0, 1.0, 1.0, 1.0, 1.0),
        "segment_curvature": (8.0,) * 6,
        "blend_length": 1e-3,
        "segment_angle": (0.0,) * 6,
    }
    chain = Chain(native, tip=even)
    for _ in range(30):
        chain.go(travel=3e-3)
    assert chain.tracking.status == LOST


def lost(chain):
    chain.shape.wavelength[:] = np.nan


@pytest.mark.parametrize("name", ["curvature", "shape", "tangent", "profile_age"])
def test_no_number_in_no_number_out(native, name):
    chain = Chain(native).go()
    chain.go(travel=1e-3)
    good = chain.tracking.position.copy()
    if name == "profile_age":
        chain.tracking.profile_age = np.nan
    else:
        getattr(chain.tracking, name)[20, 1] = np.nan
    chain.tracking.advance(2 * PERIOD, PERIOD)
    np.testing.assert_array_equal(chain.tracking.position, good)
    assert chain.tracking.status == DEGRADED
    assert np.isfinite([chain.tracking.travel, chain.tracking.age, chain.tracking.uncertainty]).all()


@pytest.mark.parametrize(
    "tracking",
    [
        {"count": 40, "free_length": 0.0, "window": 10e-3},  # every node is used
        {"count": 40, "free_length": 0.0, "window": 2e-3, "blind_limit": 5e-3},
        {"count": 8, "window": 0.1},  # nothing is left of the crop
        {"count": 38, "free_length": 1.0},
        {"pitch": 1e-3},
    ],
)
def test_odd_parameters_end_in_a_status(native, tracking):
    chain = Chain(native, tip={"count": 40}, fiber={"count": 40}, shape={"count": 40}, tracking=tracking)
    for travel in (0.0, 0.0, 10e-3, -10e-3, 50e-3):
        chain.go(travel=travel)
        numbers = (
            *chain.tracking.position,
            *chain.tracking.direction,
            chain.tracking.travel,
            chain.tracking.uncertainty,
        )
        assert np.isfinite(numbers).all()


@pytest.mark.slow
def test_nonsense_is_never_passed_on(native):
    random = np.random.default_rng(5)
    chain = Chain(native, tip=ARCH)
    nonsense = np.array([np.nan, np.inf, -np.inf, 0.0, 1e-6, 1.6e-6, 1e300, -1.0])

    def spoil(one):
        places = random.random(one.shape.wavelength.shape) < random.choice([0.0, 0.01, 0.3])
        one.shape.wavelength[places] = random.choice(nonsense, places.sum())
        one.shape.grating_count = random.choice([38, 38, 38, 0, -5, 400])
        one.shape.wavelength_age = random.choice([4e-3, 4e-3, 0.5, np.nan, -np.inf])

    for _ in range(400):
        chain.go(travel=random.uniform(-5e-3, 5e-3), spoil=spoil)
        for member, names in (
            (chain.shape, ("curvature", "shape", "tangent", "temperature", "residual", "age")),
            (chain.tracking, ("position", "direction", "travel", "roll", "uncertainty", "mismatch", "age")),
        ):
            assert all(np.isfinite(getattr(member, name)).all() for name in names)
            assert member.status in (VALID, DEGRADED, LOST)

        # the tracker alone, behind a reconstruction that is somebody else's
        for name in ("curvature", "shape", "tangent"):
            values = getattr(chain.tracking, name)
            values[tuple(random.integers(0, size) for size in values.shape)] = random.choice(nonsense)
        chain.tracking.profile_status = random.choice([0, 1, 2])
        chain.tracking.advance(chain.samples * PERIOD, PERIOD)
        assert np.isfinite((*chain.tracking.position, chain.tracking.travel, chain.tracking.uncertainty)).all()
        chain.samples += 1
    chain.go()
    chain.go()
    assert chain.tracking.status == VALID
    assert np.linalg.norm(chain.tracking.position - chain.tip.tip_position) < 5e-3


def test_the_last_good_tip_is_held_then_lost_then_found_again(native):
    chain = Chain(native).go()
    chain.go(travel=2e-3)
    position = chain.tracking.position.copy()
    states = []
    for _ in range(60):
        chain.go(travel=4e-3, spoil=lost)
        np.testing.assert_array_equal(chain.tracking.position, position)
        states.append(int(chain.tracking.status))
    assert states == sorted(states)
    assert states.count(DEGRADED) == pytest.approx(0.1 / PERIOD, abs=3)
    assert chain.tracking.status == LOST
    chain.go(travel=4e-3)
    assert chain.tracking.status == VALID
    assert chain.tracking.travel == pytest.approx(4e-3, abs=0.6e-3)


def test_a_broken_core_degrades_but_does_not_mislead(native):
    chain = Chain(native, tip=ARCH)
    follow(chain, SWEEP[:30])
    chain.fiber.break_location = 0.2
    chain.fiber.broken_core = 3
    travel, _ = follow(chain, SWEEP[30:])
    assert chain.tracking.status == DEGRADED
    assert paper_holds(travel)


def test_broken_on_purpose_it_does_not_hold(native):
    wrong_pitch, _ = follow(Chain(native, tracking={"pitch": 14e-3}))
    assert not paper_holds(wrong_pitch)
    two_lost = Chain(native)
    follow(two_lost, SWEEP[:20])
    two_lost.fiber.broken_core = 3
    for _ in range(40):
        two_lost.go(spoil=lambda one: one.shape.wavelength[1].fill(0.0))
    assert two_lost.tracking.status == LOST


def test_a_wrong_angle_spoils_the_place_of_the_tip(native):
    angles = (0.0, 0.0, 2.0944, 2.0 * 2.0944 + 0.6)
    wrong = Chain(native, tip=ARCH, fiber=PERFECT, shape={"core_angle": angles})
    _, tip = follow(wrong)
    assert np.linalg.norm(tip, axis=1).mean() > 5e-3
    assert wrong.tracking.status != VALID


def test_the_curve_stays_on_the_path(native):
    tip = native(GuidedTip, **ARCH)
    tip.start()
    before = tip.shape.copy()
    tip.travel[:] = 10e-3  # one pitch: each node lies where the next one was
    tip.advance(0.0, 1e-3)
    np.testing.assert_allclose(tip.shape[:38], before[1:39], atol=2e-6)


def test_a_cantilever_bends_by_its_displacement(native):
    tip = native(GuidedTip, free_length=48e-3, segment_length=(0.17, 0.0785, 0.0785, 1.0, 1.0, 1.0))
    tip.start()
    straight = tip.tip_position.copy()
    tip.displacement[:] = (0.0, 1e-3)
    tip.advance(0.0, 1e-3)
    assert tip.tip_position[1] - straight[1] == pytest.approx(1e-3, rel=0.005)


def test_evaluation_puts_samples_where_they_were_taken():
    t = np.arange(4000) * 1e-3
    motion = 5e-3 * np.sin(2 * np.pi * np.maximum(t - 1.0, 0.0))

    def late(period, latency):
        rows = np.maximum((np.floor(t / period + 1e-9) * period - latency) * 1e3, 0).round().astype(int)
        return motion[rows]

    # a measurement is never twice the same, which tells one sample from the next
    em = late(25e-3, 25e-3) + 1e-9 * np.floor(t / 25e-3)
    fiber = late(4e-3, 12e-3) + 1e-9 * np.floor(t / 4e-3)
    rest = np.zeros(4000)
    result = evaluate.against_em(em, 0.6 * fiber, rest, 0.8 * fiber, rest + 12e-3, rest)
    assert result["error_max"] < 0.05e-3
    assert result["em_range"] == pytest.approx(10e-3, rel=0.01)
    assert evaluate.against_em(em, 0.6 * fiber, rest, 0.8 * fiber, rest, rest)["error_max"] > 0.3e-3
