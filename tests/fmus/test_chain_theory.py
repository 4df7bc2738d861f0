"""The instrument of bodies against theory: beams, a column, a belt on a drum, the play in two bends."""

from dataclasses import replace

import numpy as np
import pytest
from fmus.chain.model import Chain

from fmus.bodies import anywhere, experiments
from fmus.bodies.rod import euler_load
from twin.scene import read_environment

H = 1e-3
SWEEP = pytest.mark.slow  # of the number of segments, of friction and stiffness


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("segments", "error"), [(10, 0.025), (20, 0.01), pytest.param(40, 0.005, marks=SWEEP)])
@pytest.mark.parametrize("part", [0.01, 2.0])
def test_a_cantilever_bends_like_the_elastica(segments, error, part):
    """Small deflection is Euler and Bernoulli's, FL^3 / 3EI; at F L^2 = 2 EI the tip goes half the length aside."""
    assert experiments.cantilever(segments, part=part) == pytest.approx(1.0, abs=error)


def test_the_elastica_is_that_of_the_books():
    """Tip deflection at F L^2 = EI and 10 EI over the length, Bisshopp and Drucker 1945: 0.302 and 0.811."""
    rod = experiments.ROD
    unit = rod.bending_stiffness / rod.length**2
    found = [experiments.elastica(part * unit, rod)[1] / rod.length for part in (1.0, 10.0)]
    np.testing.assert_allclose(found, [0.302, 0.811], atol=1e-3)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("segments", "error"), [(10, 0.03), (20, 0.015), pytest.param(40, 0.008, marks=SWEEP)])
def test_a_clamped_arc_gives_like_a_curved_beam(segments, error):
    assert experiments.clamped_arc(segments) == pytest.approx(1.0, abs=error)


@pytest.mark.slow
@pytest.mark.parametrize(("segments", "error"), [(10, 0.05), (20, 0.025), pytest.param(40, 0.012, marks=SWEEP)])
def test_a_column_buckles_at_eulers_load(segments, error):
    assert experiments.column(segments) == pytest.approx(1.0, abs=error)


@pytest.mark.slow
@pytest.mark.parametrize("substep", [0.125e-3, 0.5e-3])
def test_statics_do_not_depend_on_the_step(substep):
    for one in (experiments.cantilever, experiments.clamped_arc, experiments.column):
        assert one(10, substep) == pytest.approx(one(10), abs=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("angle", "friction"), [(0.5, 0.15), (1.5, 0.15), (1.0, 0.3)])
def test_friction_grows_with_the_wrap_as_on_a_capstan(angle, friction):
    assert experiments.capstan(angle * np.pi, friction) == pytest.approx(1.0, abs=0.01)


@SWEEP
def test_play_comes_from_friction_and_axial_compliance():
    """Neither alone makes it: without friction there is none, and a ten times stiffer shaft has a fifth."""
    environment = read_environment("two_bends")
    rod = Chain().rod(environment)
    play = experiments.play(environment, rod)
    assert 2.0e-3 < play < 3.0e-3
    assert experiments.play(environment, replace(rod, friction=0.0)) < 0.1e-3
    assert experiments.play(environment, replace(rod, axial_stiffness=9200.0)) < 0.25 * play
    assert experiments.play(environment, replace(rod, friction=0.2)) > 1.15 * play


@pytest.mark.slow
def test_the_free_length_buckles_between_eulers_loads():
    """The sheath guides its far end better than a hinge and worse than a clamp."""
    part = anywhere.component("free_gap")(segments=20, tip_length=0.0)
    part.start(0.0)
    push = []
    for i in range(1500):
        part.gripper_position = 6e-3 * min(i / 1200, 1.0)
        part.advance(i * H, H)
        push.append(-float(part.reaction_force))
    low, high = (euler_load(float(part.bending_stiffness), 70e-3, factor) for factor in (0.7, 0.5))
    assert low < max(push) < high
    assert max(push[600:]) < 1.25 * push[600]  # it no longer grows: an unbuckled one would treble
    assert np.abs(part.shape[:, 1]).max() > 5e-3


def test_a_sharper_tip_curve_presses_elsewhere():
    """A curve at rest moves the tip aside when nothing holds it."""
    parts = [anywhere.component("free_gap")(segments=20, tip_curvature=k, settling=0.5) for k in (-5.0, 0.0)]
    for part in parts:
        part.start(0.0)
    assert parts[0].shape[-1, 1] < parts[1].shape[-1, 1] - 0.02e-3
