"""Command, tracker, evaluation and compensation of the rotation experiment."""

from itertools import pairwise

import numpy as np
import pytest
from fmus.em_pose.evaluate import averaged, distance, loop_width, resting, rotation, travelled_angle, travelled_distance
from fmus.em_pose.model import EMPose
from fmus.rotation_command.model import RotationCommand
from fmus.rotation_compensator.identify import analysis, gain, identify, simulate
from fmus.rotation_compensator.model import RotationCompensator
from hypothesis import example, given, settings
from hypothesis import strategies as st

H = 1e-3
DEGREE = np.pi / 180.0


def played(part, name, values, output, h=H):
    """Outputs of a part over values of one of its inputs."""
    setattr(part, name, values[0])
    part.start(0.0)
    found = []
    for step, value in enumerate(values):
        setattr(part, name, value)
        assert part.advance(step * h, h) == 0
        found.append(np.array(getattr(part, output)))
    return np.array(found)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("speed", [0.25, 1.25, 100.0])
def test_command_goes_forth_and_back_within_its_acceleration(native, speed):
    part = native(RotationCommand, speed=speed, rotation=3.0, rest=0.5, cycles=2)
    peak = min(speed, np.sqrt(3.0 * 5.0))
    each = 3.0 / peak + peak / 5.0 + 0.5
    part.start(0.0)
    assert part.cycle == 0
    rows = []
    for step in range(round((4 * each + 1.0) / H)):
        part.advance(step * H, H)
        rows.append((part.target_position, part.target_velocity, part.cycle))
    position, velocity, cycle = np.array(rows, dtype=float).T
    np.testing.assert_allclose(np.diff(position)[5:] / H, (0.5 * (velocity[1:] + velocity[:-1]))[5:], atol=0.011)
    assert np.abs(np.diff(velocity)).max() <= 5.0 * H * 1.001
    assert np.abs(velocity).max() == pytest.approx(peak, rel=1e-3)
    assert position.max() == pytest.approx(3.0, abs=1e-9)
    assert position.min() == pytest.approx(0.0, abs=1e-9)
    assert abs(position[-1]) < 1e-9
    assert [int(cycle[round(x / H)]) for x in (0.4, 0.6, 0.5 + 2.2 * each, 0.8 + 4.0 * each)] == [0, 1, 2, 0]


@pytest.mark.slow
def test_path_has_the_length_of_the_instrument_in_it():
    """Sum of the distances along the path is the path's length, with its two bends back to the first direction."""
    lengths = np.linspace(-0.02, 0.6, 20001)
    points = played(EMPose(noise=0.0), "path_position", lengths, "measured_position", 25e-3)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    np.testing.assert_allclose(steps, lengths[1] - lengths[0], rtol=1e-6)
    # two opposite quarter circles shift the path sideways by twice the radius
    assert points[-1] == pytest.approx((0.343 + 2 * 0.05 + 0.6 - 0.5, 0.1, 0.0), abs=1e-4)


def test_roll_angle_knows_no_turns_and_is_noisy(native):
    part = native(EMPose)
    angles = np.linspace(0.0, 30.0, 4000)
    found = played(part, "roll_angle", angles, "measured_angle", 25e-3)
    assert np.abs(found).max() <= np.pi
    error = travelled_angle(found) - averaged(angles)
    assert np.std(error[100:]) < 3e-3 / 4 * 1.2  # an average of 16
    raw = np.unwrap(found) - angles
    assert np.std(raw) == pytest.approx(3e-3, rel=0.05)


def test_noise_of_each_axis(native):
    part = native(EMPose, path_position=0.1)
    part.start(0.0)
    points = []
    for step in range(4000):
        part.advance(step * 25e-3, 25e-3)
        points.append(np.array(part.measured_position))
    points = np.array(points)
    assert np.std(points, axis=0) == pytest.approx([1e-4] * 3, rel=0.06)
    assert np.mean(points, axis=0) == pytest.approx([0.1, 0.0, 0.0], abs=1e-5)
    assert np.abs(np.corrcoef(points.T) - np.eye(3)).max() < 0.06


@pytest.mark.parametrize("speed", [5e-3, 40e-3])
def test_bias_of_a_sum_of_distances(speed):
    """Noise s per axis adds s^2 / 128 over the true distance to each sample: two axes across, two averages of 16."""
    random = np.random.default_rng(3)
    count = round(0.5 / speed * 40)
    line = np.outer(np.linspace(0.0, 0.5, count), (1.0, 0.0, 0.0))
    noise = 1e-4
    bias = np.mean(
        [
            travelled_distance(line + noise * random.normal(size=(count, 3)))[-1] - travelled_distance(line)[-1]
            for _ in range(20)
        ]
    )
    assert bias == pytest.approx(count * noise**2 / 128 / (speed / 40), rel=0.2, abs=8e-5)


def test_average_is_late_by_seven_and_a_half_samples():
    ramp = np.arange(200.0)
    np.testing.assert_allclose(ramp[20:] - averaged(ramp)[20:], 7.5)
    assert averaged(np.ones((40, 3))) == pytest.approx(np.ones((40, 3)))


def turning(width, speed):
    """Frame at 40 Hz that turns twice forth and back with rests, three times, and a tip behind a play."""
    forth = np.concatenate((np.arange(0.0, 4 * np.pi, speed / 40), np.full(60, 4 * np.pi)))
    frame = np.concatenate((np.zeros(40), np.tile(np.concatenate((forth, 4 * np.pi - forth)), 3)))
    return frame, simulate(width, frame)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("speed", [14.4 * DEGREE, 72 * DEGREE])
def test_evaluation_finds_the_loop_at_any_speed(speed):
    frame, tip = turning(50 * DEGREE, speed)
    wrapped = np.angle(np.exp(1j * tip))
    found = rotation(wrapped, frame)
    assert found["loop_width"] == pytest.approx(50 * DEGREE, rel=0.01)
    assert found["rest_error"] == pytest.approx(25 * DEGREE, rel=1e-3)
    # read against an unfiltered frame the average's lag adds twice 187.5 ms of motion
    assert found["raw_loop_width"] == pytest.approx(50 * DEGREE + 2 * 0.1875 * speed, rel=0.01)
    play, _, residual = identify(frame, travelled_angle(wrapped))
    assert play == pytest.approx(50 * DEGREE, rel=1e-3)
    assert residual < 0.1 * DEGREE
    assert analysis(frame, wrapped)["play"] == play


def test_rest_is_only_where_the_average_has_settled():
    frame, _ = turning(0.0, 1.0)
    rest = resting(frame)
    assert not rest[:60].any()  # it has not moved yet
    assert rest.any()
    np.testing.assert_allclose(averaged(frame)[rest], frame[rest], atol=1e-9)


def test_without_motion_there_is_nothing_to_evaluate():
    still = rotation(np.zeros(100), np.zeros(100))
    assert np.isnan(still["rest_error"])
    assert np.isnan(still["loop_width"])
    assert np.isnan(loop_width(np.linspace(0, 1, 100), np.linspace(0, 1, 100)))  # never back


def test_distance_of_a_trip_there_and_back():
    rest = np.zeros(40)
    there = np.concatenate((rest, np.linspace(0.0, 0.3, 400), rest + 0.3, np.linspace(0.3, 0.0, 400), rest))
    found = distance(there, 0.0 * there, 0.0 * there, there + 0.05)
    lag = 7.5 * 0.3 / 399
    for largest in ("error_out", "error_back", "error_max"):
        assert found[largest] == pytest.approx(lag, rel=1e-3), largest
    assert np.nanmax(found["reference"]) == pytest.approx(0.3, rel=1e-3)
    assert found["speed_lowest"] == pytest.approx(1.0)
    assert np.nanmedian(found["speed"]) == pytest.approx(0.3 / 399 * 40)


def test_a_stop_of_the_tip_is_seen_in_its_speed():
    tip = np.concatenate((np.zeros(40), np.linspace(0.0, 0.3, 400), np.full(40, 0.3)))
    tip[240:250] = tip[240]  # 0.25 s of standing, then a leap
    found = distance(
        tip, 0.0 * tip, 0.0 * tip, np.concatenate((np.zeros(40), np.linspace(0.0, 0.3, 400), np.full(40, 0.3)))
    )
    assert 0.2 < found["speed_lowest"] < 0.5


WALK = st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=12)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@example(ends=[1.0, 0.0, 0.125], play=2.0)
@given(ends=WALK, play=st.floats(0.0, 2.0))
def test_compensator_inverts_the_play_after_every_reversal(native, ends, play):
    """Behind the play the tip is where it is wanted once the lead has crossed over, whatever was wanted before.

    After each way there is time for that, 0.33 s at 6 rad/s: a lead that turns round halfway has not brought the tip back.
    """
    part = native(RotationCompensator, play=play, threshold=1e-4)
    points = [0.0, *ends]
    wanted = np.concatenate([np.append(np.linspace(a, b, 100), np.full(400, b)) for a, b in pairwise(points)])
    frame = played(part, "angle", wanted, "compensated_angle")
    tip = simulate(play, frame)
    assert np.all(np.abs(frame - wanted) <= 0.5 * play + 1e-12)
    if np.ptp(wanted) > 0.01:
        assert tip[-1] == pytest.approx(wanted[-1], abs=2e-4)


def test_compensator_waits_for_a_real_reversal(native):
    part = native(RotationCompensator)
    wanted = np.concatenate((np.linspace(0.0, 1.0, 500), np.full(500, 1.0)))
    wanted[600:] += 2e-3 * np.sin(np.arange(400))  # jitter below the threshold
    found = played(part, "angle", wanted, "lead")
    assert np.all(np.diff(found) >= 0.0)
    assert found[-1] == pytest.approx(0.435)


def test_gain_compares_rms_errors():
    frame, tip = turning(50 * DEGREE, 1.0)
    half = simulate(25 * DEGREE, frame)
    found = gain(np.angle(np.exp(1j * tip)), np.angle(np.exp(1j * half)), frame)
    assert found["factor"] == pytest.approx(2.0, rel=0.05)
    assert found["plain_rms"] == pytest.approx(25 * DEGREE, rel=0.1)
