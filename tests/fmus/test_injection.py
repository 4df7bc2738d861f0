"""The injection catheter: exact where the paper measured, passive between; the feedforward is its inverse."""

from itertools import pairwise
from math import nan

import numpy as np
import pytest
from fmus.camera_tracker.model import CameraTracker
from fmus.coordinate_feedforward import model as feedforward
from fmus.coordinate_feedforward.model import CoordinateFeedforward
from fmus.pull_wire_catheter.model import PullWireCatheter
from fmus.stepper_axis.model import StepperAxis
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fmus import injection
from tests.every_case import every_case

QUIET = {"deviation_y": 0.0, "deviation_z": 0.0, "deviation_needle": 0.0, "wire_play": 0.0}
MM = 1e-3


def bench(**values):
    """A catheter without noise, and a function that moves its slides [mm] and gives y, z, needle length [mm]."""
    catheter = PullWireCatheter(**{**QUIET, **values})
    catheter.start()
    place = np.zeros(3)

    def go(handle=None, wire=None, needle=None):
        wanted = [old if new is None else new for old, new in zip(place, (handle, wire, needle), strict=True)]
        for part in np.linspace(0.0, 1.0, 13)[1:]:
            now = place + part * (np.array(wanted) - place)
            catheter.handle_position, catheter.wire_position, catheter.needle_position = MM * now
            assert catheter.advance(0.0, 1e-3) == 0
        place[:] = wanted
        return catheter.tip_y / MM, catheter.tip_z / MM, catheter.needle_length / MM

    return catheter, go


def eq4(a):
    return -0.0326 * a**3 + 0.472 * a**2 + 0.145 * a


def eq5(a):
    return -0.0083 * a**3 + 0.171 * a**2 - 0.165 * a + 0.102


def test_deflection_is_that_of_eqs_4_and_5_at_every_increment_and_has_no_jump():
    for pull in range(2, 10):
        assert injection.bend(injection.BEND_Y, 1.0, pull) == pytest.approx(eq4(pull), rel=1e-12)
        assert injection.bend(injection.BEND_Z, 1.0, pull) == pytest.approx(eq5(pull), rel=1e-12)
    for c in (injection.BEND_Y, injection.BEND_Z):
        assert injection.bend(c, 1.0, 0.5) == injection.bend(c, 1.0, 1.0) == 0.0
        fine = [injection.bend(c, 1.0, 0.001 * k) for k in range(9001)]
        steps = np.diff(fine)
        assert steps.min() >= 0.0
        assert steps.max() < 0.003


@every_case("spread", [0.0, 0.3])
@every_case("way", [3.0, 7.0, 15.0])
def test_moves_are_those_of_eqs_2_and_3(spread, way):
    _, go = bench(play_spread=spread)
    _, before, _ = go(handle=18.0)
    _, turned, _ = go(handle=18.0 - way)
    assert before - turned - way == pytest.approx(-(-0.0257 * way + 1.5776), abs=1e-12)
    _, on, _ = go(handle=0.0)
    assert turned - on - (18.0 - way) == pytest.approx(0.0257 * (18.0 - way), abs=1e-12)


def test_a_move_inside_of_the_play_moves_nothing_and_costs_nothing():
    _, go = bench()
    start = go(handle=10.0, wire=5.0)
    inside = go(handle=9.2)
    assert inside[1] == pytest.approx(start[1], abs=1e-12)
    assert go(handle=10.0) == pytest.approx(start, abs=1e-12)


@pytest.mark.parametrize(("pushed", "terms"), [(True, 21), (False, 10)])
def test_coupling_is_that_of_table_1_on_both_branches(pushed, terms):
    """Terms in the order of poly55 and poly33, written out here by their exponents."""
    column = injection.COMPRESSION if pushed else injection.TENSION
    exponents = [(d - j, j) for d in range(6) for j in range(d + 1)][:terms]
    assert len(column) == terms
    for pull in (2.0, 5.0, 8.0):
        _, go = bench()
        go(wire=pull)
        for place in (2.0, 8.0, 14.0):
            y, z, _ = (go(handle=0.0), go(handle=place))[1] if pushed else (go(handle=19.0), go(handle=place))[1]
            advance = z + eq5(pull)
            table = sum(c * pull**i * advance**j for c, (i, j) in zip(column, exponents, strict=True))
            assert y - eq4(pull) == pytest.approx(table, abs=1e-9)


def test_both_columns_of_table_1_meet_where_the_direction_turns():
    """Why z of eq. (6) is a position: at 0 and at 20 mm a loop must close; in the middle the columns are apart."""
    a = np.linspace(2.0, 9.0, 15)
    gap = {
        z: np.max(
            np.abs(
                [
                    injection.surface(injection.COMPRESSION, 5, x, z) - injection.surface(injection.TENSION, 3, x, z)
                    for x in a
                ]
            )
        )
        for z in (0.0, 16.0, 20.0)
    }
    assert gap[0.0] < 0.3
    assert gap[20.0] < 1.0
    assert gap[16.0] > 1.5


def test_needle_is_that_of_eqs_7_8_and_9():
    for pull in (0.0, 3.0, 8.0):
        _, go = bench()
        go(wire=pull)
        for slide in (4.0, 8.0, 11.5):
            _, _, length = go(needle=slide)
            assert length == pytest.approx(0.4428 * slide - 1.1044 + 0.0984 * pull, abs=1e-12)
        for decrease in (0.8, 1.6, 2.4):
            slide = 9.821 - 2.132 * decrease + 0.3162 * pull + 0.04756 * decrease**2
            slide += -0.02998 * decrease * pull - 0.04206 * pull**2
            _, _, shorter = go(needle=slide)
            assert length - shorter == pytest.approx(decrease, abs=1e-9)


@pytest.mark.slow
@given(st.lists(st.tuples(st.floats(0, 25), st.floats(0, 9), st.floats(0, 14)), min_size=2, max_size=6))
@settings(max_examples=15, deadline=None)
def test_a_closed_cycle_of_the_handle_takes_work_and_gives_none(path):
    catheter, go = bench()
    for place in path:
        go(*place)
    work, last = 0.0, None
    for _ in range(2):
        for handle in (*np.linspace(5.0, 15.0, 12), *np.linspace(15.0, 5.0, 12)):
            go(handle=handle)
            now = handle, float(catheter.handle_force)
            if last is not None:
                work += 0.5 * (now[1] + last[1]) * (now[0] - last[0])
            last = now
    assert work < 0.0


def settle(controller, k):
    """Six periods of the controller with slides that are already there."""
    for j in range(6):
        assert controller.advance(0.06 * k + 0.01 * j, 0.01) == 0


@pytest.mark.slow
@given(st.lists(st.tuples(st.floats(0, 15), st.floats(0, 20), st.floats(0, 6)), min_size=1, max_size=12))
@example([(0.0, 0.0, 3.0), (13.765625, 16.0703125, 3.4231124843215515), (2.4e-05, 0.0, 2.764435468081648)])
@example([(0.0, 10.0, 3.0), (0.0, 5.0, 3.0), (0.0, 5.00000012, 3.0)])
@example([(0.0, 10.0 - 0.9e-6 * k, 3.0) for k in range(12)])
@example([(0.0, 2.0, 0.0), (5.0, 0.0, 0.0), (5.0, 0.0078125, 0.0)])
@example([(8.25, 20.0, 0.0), (12.25, 18.5625, 0.0)])
@settings(max_examples=40, deadline=None)
def test_feedforward_is_the_inverse_of_the_model_in_the_whole_workspace(coordinates):
    """Up to NEAR along, where the handle stays: however many such targets come, the play is all used up to one side.

    A few targets lie in the play, for which eq. (6) has no column: pushed, the tip would have to go back, and pulled, on, as
    the pull is another. Or the longest pull is too short for a direction. They are refused, and nothing moves.
    """
    controller = CoordinateFeedforward()
    controller.start()
    catheter, go = bench(play_spread=0.0)
    reached = go(needle=float(controller.needle_position) / MM)
    for k, (y, z, length) in enumerate(coordinates):
        controller.target_y, controller.target_z, controller.target_needle_length = MM * y, MM * z, MM * length
        settle(controller, k)
        if controller.refusal:
            assert controller.refusal == feedforward.NOT_REACHABLE
            for share, sign in ((0.0, 1.0), (1.0, -1.0)):
                pull = feedforward.pull_for(controller, y, z, share)
                advance = z + injection.bend(injection.BEND_Z, injection.DEAD_BAND, pull)
                assert pull < 0.0 or sign * (advance - controller.tip_advance) < 1e-9
        else:
            reached = y, z, length
        go(handle=float(controller.handle_position) / MM, wire=float(controller.wire_position) / MM)
        found = go(needle=float(controller.needle_position) / MM)
        assert found == pytest.approx(reached, abs=feedforward.NEAR + 1e-9)
    assert catheter.tension_share in (pytest.approx(0.0, abs=1e-9), pytest.approx(1.0, abs=1e-9))


@every_case(
    ("target", "reason"),
    [
        ((15.1, 5.0, 3.0), feedforward.Y_OUTSIDE),
        ((-0.1, 5.0, 3.0), feedforward.Y_OUTSIDE),
        ((nan, 5.0, 3.0), feedforward.Y_OUTSIDE),
        ((5.0, 20.1, 3.0), feedforward.Z_OUTSIDE),
        ((5.0, -0.1, 3.0), feedforward.Z_OUTSIDE),
        ((5.0, nan, 3.0), feedforward.Z_OUTSIDE),
        ((5.0, 5.0, 6.1), feedforward.NEEDLE_OUTSIDE),
        ((5.0, 5.0, nan), feedforward.NEEDLE_OUTSIDE),
    ],
)
def test_a_target_outside_is_refused_and_moves_nothing(target, reason):
    controller = CoordinateFeedforward()
    controller.start()
    outputs = "handle_steps", "wire_steps", "needle_steps"
    seen = []
    for k, (y, z, length) in enumerate([(8.0, 10.0, 3.0), target, (8.0, 10.0, 3.0)]):
        controller.target_y, controller.target_z, controller.target_needle_length = MM * y, MM * z, MM * length
        settle(controller, k)
        seen.append(([int(getattr(controller, name)) for name in outputs], int(controller.refusal)))
    assert seen[0] == seen[2]
    assert seen[0][1] == feedforward.ACCEPTED
    assert seen[1] == (seen[0][0], reason)


def test_what_the_wire_cannot_reach_and_an_unknown_mode_are_refused():
    for values, reason in (({"pull_maximum": 5.0}, feedforward.NOT_REACHABLE), ({"mode": 2}, feedforward.NO_MODE)):
        controller = CoordinateFeedforward(target_y=14.0 * MM, target_z=5.0 * MM, **values)
        controller.start()
        settle(controller, 0)
        assert controller.refusal == reason
        assert controller.handle_steps == controller.wire_steps == 0


def test_a_new_direction_costs_the_offset_once():
    controller = CoordinateFeedforward()
    controller.start()
    ways = []
    for k, z in enumerate((10.0, 12.0, 9.0, 7.0, 8.0)):
        controller.target_z = MM * z
        settle(controller, k)
        ways.append(float(controller.handle_position) / MM)
    slope = 1.0257
    assert np.diff(ways) == pytest.approx([2 / slope, -(3 + 1.5776) / slope, -2 / slope, (1 + 1.5776) / slope])


def test_unmodified_uses_the_deflection_alone():
    controller = CoordinateFeedforward(mode=0, target_y=eq4(6.0) * MM, target_z=7.0 * MM)
    controller.start()
    settle(controller, 0)
    assert controller.wire_position / MM == pytest.approx(6.0, abs=1e-9)
    assert controller.handle_position / MM == pytest.approx(7.0 + eq5(6.0), abs=1e-9)
    assert controller.wire_steps == round(6.0 * 1600 / 7.7)


def run(axis, seconds, t=0.0):
    for k in range(round(seconds * 1000)):
        assert axis.advance(t + 1e-3 * k, 1e-3) == 0


def test_axis_goes_to_its_target_at_its_rate(native):
    axis = native(StepperAxis, lead_deviation=0.0, position_deviation=0.0, step_rate=2000.0)
    axis.start()
    axis.target_steps = 16000
    run(axis, 4.0)
    assert axis.step_count == pytest.approx(8000, abs=0.5 * 2000**2 / 4e4 + 2)  # less the ramp
    assert axis.velocity == pytest.approx(2000 / 1600 * 7.7 * MM, rel=0.02)
    run(axis, 5.0, 4.0)
    assert axis.step_count == 16000
    assert not axis.moving
    assert axis.lost_steps == 0
    assert axis.position == pytest.approx(77.0 * MM, abs=0.01 * MM)


def test_rate_is_capped(native):
    axis = native(StepperAxis, step_rate=4500.0)
    axis.start()
    axis.target_steps = 40000
    run(axis, 1.0)
    begin = int(axis.step_count)
    run(axis, 1.0, 1.0)
    assert axis.step_count - begin == pytest.approx(4000, abs=1)


@pytest.mark.parametrize("jam", [0.05, 0.1, 0.2, 0.35])
def test_overload_loses_whole_periods_of_four_full_steps(native, jam):
    axis = native(StepperAxis, lead_deviation=0.0, position_deviation=0.0, step_rate=1500.0, load_force=-5.0)
    axis.start()
    axis.target_steps = 2000
    run(axis, 0.3)
    axis.load_force = -600.0
    run(axis, jam, 0.3)
    axis.load_force = -5.0
    run(axis, 2.0, 0.3 + jam)
    assert axis.lost_steps > 0
    assert axis.lost_steps % 32 == 0
    short = (2000 - axis.lost_steps) * 7.7 * MM / 1600
    assert axis.position == pytest.approx(short, abs=0.02 * MM)


@pytest.mark.slow
def test_slides_differ_from_run_to_run_as_the_paper_measured(native):
    """Spread of single revolutions: 0.081 mm, with the camera's 0.03 mm at both ends."""
    ways = []
    for seed in range(40):
        axis = native(StepperAxis, seed=seed, step_rate=4000.0)
        axis.start()
        places = [0.0]
        for k in range(1, 5):
            axis.target_steps = 1600 * (k % 2)
            run(axis, 0.7, k)
            places.append(float(axis.position))
        ways += [abs(b - a) for a, b in pairwise(places)]
    assert np.mean(ways) == pytest.approx(7.7 * MM, abs=0.02 * MM)
    assert np.hypot(np.std(ways), 0.03 * MM * np.sqrt(2)) == pytest.approx(0.081 * MM, rel=0.2)


def test_camera_rounds_and_has_noise(native):
    camera = native(CameraTracker, tip_y=5e-3, tip_z=10.007e-3)
    camera.start()
    values = np.empty((2000, 2))
    for k in range(len(values)):
        camera.advance(0.04 * k, 0.04)
        values[k] = camera.measured_y, camera.measured_z
    np.testing.assert_allclose(values / 0.02e-3, np.round(values / 0.02e-3), atol=1e-6)
    assert values.mean(axis=0) == pytest.approx([5e-3, 10.007e-3], abs=3e-6)
    assert values.std(axis=0) == pytest.approx([np.hypot(0.02e-3, 0.02e-3 / np.sqrt(12))] * 2, rel=0.1)
