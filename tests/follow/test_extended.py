"""Extended filter: tangents of coupled members and groups are those of differences; the falling body; what has none is refused."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter

from tests.follow import parts
from tests.follow.test_filters import FREE, GUESS, GUESS_DEVIATION, TRUE, distance, fall
from tests.follow.test_follow import MU, SAMPLED, recording, write
from twin.errors import ScenarioError
from twin.follow import follow, in_band, load
from twin.follow.batch import Batch
from twin.follow.filters import Extended, Unscented
from twin.follow.tangents import TangentBatch, with_slopes

COUPLED = """
stop_time: 30 s
step: 10 ms
members:
  oscillator: {component: "tests.follow.parts:VanDerPol"}
  spring:     {component: "tests.follow.parts:Spring"}
connections:
  - {from: oscillator.y, to: spring.u, factor: 1.5, offset: 0.1}
  - spring.y -> oscillator.u
groups: {plant: [oscillator, spring]}
"""
ESTIMATED = """
data: data.csv
outputs:
  "position [mm]": {signal: oscillator.y, noise: 20 mm}
  "force [m/s2]": {signal: spring.y, noise: 20}
estimate:
  oscillator.x: {start: 0.8 m, deviation: 0.3 m}
  oscillator.mu: {start: 1.0, deviation: 0.5}
  spring.k: {start: 0.7, deviation: 0.5}
method: extended
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("extended")
    (path / "system.yaml").write_text(COUPLED)
    (path / "sequential.yaml").write_text(f"{COUPLED}algorithm: gauss_seidel\n")
    return path


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    "model", ["scenario: system.yaml", "scenario: sequential.yaml", 'component: "system.yaml#plant"\nstep: 10 ms']
)
def test_points_are_those_of_the_linearized_model(folder, build, model):
    """Directions moved by tangents, against central differences of the model itself."""
    text = ESTIMATED
    if "#" in model:
        for name in ("oscillator", "spring"):
            text = text.replace(f" {name}.", f" plant.{name}.")
    problem = load(write(folder, recording(1, 3)[0], f"{model}\n{text}"))
    start, step, size = np.array([0.8, 1.0, 0.7]), 1e-6, 3
    points = np.vstack([start, start + np.array([[1.0, 0.5, 0.0], [0.0, -0.7, 0.3], [0.4, 0.2, -1.0]])])
    batch = TangentBatch(problem, 4, build)
    plain = Batch(problem, 2 * size + 1, build)
    try:
        batch.write(points, sharing=4)
        around = [start + sign * step * (point - start) for point in points[1:] for sign in (1.0, -1.0)]
        plain.write(np.vstack([start, *around]), sharing=7)
        for each in (batch, plain):
            each.advance(20)
        for found, reference in ((batch.read(), plain.read()), (batch.outputs([1, 0]), plain.outputs([1, 0]))):
            assert found[0].tolist() == reference[0].tolist()  # values are computed as without tangents
            slopes = (reference[1::2] - reference[2::2]) / (2.0 * step)
            assert found[1:] - found[0] == pytest.approx(slopes, rel=1e-6, abs=1e-8)
            assert abs(slopes).max() > 0.1
    finally:
        batch.close()
        plain.close()


def test_a_component_with_tangents_moves_in_python_too():
    """Interpreted: the tangent of a parameter against differences, and values as without tangents."""
    made = with_slopes(parts.VanDerPol)
    ends = []
    for change in (1e-6, -1e-6):
        plain = parts.VanDerPol(mu=1.0 + change)
        plain.start(0.0)
        plain.advance(0.0, 0.5)
        ends.append(float(plain.x))
    carrier = made(mu=1.0)
    carrier.start(0.0)
    carrier.views["slope.mu"][...] = 1.0
    assert carrier.advance(0.0, 0.5) == 0
    assert carrier.views["slope.x"] == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-6)
    assert carrier.views["slope.y"] == carrier.views["slope.x"] != 0.0
    plain = parts.VanDerPol(mu=1.0)
    plain.start(0.0)
    plain.advance(0.0, 0.5)
    assert carrier.x == plain.x


def test_models_without_tangents_are_refused(folder):
    (folder / "sampled.yaml").write_text(
        COUPLED.replace("parts:Spring", "parts:Controller").replace(
            "{from: oscillator.y, to: spring.u, factor: 1.5, offset: 0.1}", "oscillator.y -> spring.u"
        )
    )
    text = ESTIMATED.replace("  spring.k: {start: 0.7, deviation: 0.5}\n", "")
    path = write(folder, recording(1, 3)[0], f"scenario: sampled.yaml\n{text}")
    with pytest.raises(ScenarioError) as error:
        load(path)
    (line,) = error.value.problems
    assert line.endswith(
        "method: extended needs derivatives of spring, and there are none: the component is not continuous. "
        "Use `method: unscented`."
    )
    load(write(folder, recording(1, 3)[0], f"scenario: sampled.yaml\n{text.replace('extended', 'unscented')}"))


@pytest.mark.parametrize(
    ("method", "reason"), [("ros2", "its method ros2 is implicit"), ("", "the component is not continuous")]
)
def test_reasons_for_no_tangents(method, reason):
    assert with_slopes(parts.Stiff if method else parts.Sampler) == reason


@pytest.mark.slow
def test_hidden_states_and_parameters(tmp_path, build):
    rows, true = recording(1)
    text = (
        SAMPLED.replace("oscillator", "VanDerPol")
        .replace("sampler", "VanDerPol")
        .replace("delay: -50 ms", "delay: 0 s")
    )
    text = f'component: "tests.follow.parts:VanDerPol"\nstep: 10 ms\n{text}method: extended\n'
    estimates = list(follow(load(write(tmp_path, rows, text)), build))
    last = estimates[-1]
    assert abs(last.values[2] - MU) < 3.0 * last.deviations[2] < 0.3
    errors = np.array([one.values[:2] for one in estimates[100:]]) - true[101:]
    assert np.sqrt((errors**2).mean(axis=0)) == pytest.approx([0.0, 0.0], abs=0.03)
    assert 0.85 < in_band(estimates) <= 1.0


def jacobian(function, x, steps):
    columns = [(function(x + h) - function(x - h)) / (2.0 * np.abs(h).sum()) for h in np.diag(steps)]
    return np.stack(columns, axis=-1)


def linearized(function, points, steps):
    """Points moved by the linearized function, as the tangents of a model move them."""
    moved = function(points[0])
    return np.vstack([moved, moved + (points[1:] - points[0]) @ jacobian(function, points[0], steps).T])


@pytest.mark.slow
def test_the_falling_body_of_the_literature():
    """The same estimates as filterpy's."""
    random, noise = np.random.default_rng(3), np.array([100.0])
    steps = 1e-5 * GUESS_DEVIATION
    own = Extended(GUESS, GUESS_DEVIATION, -FREE, FREE)
    reference = ExtendedKalmanFilter(3, 1)
    reference.x, reference.P, reference.R = GUESS.copy(), np.diag(GUESS_DEVIATION**2), np.array([[1e4]])
    true = TRUE
    for _ in range(15):
        true = fall(true)
        measured = distance(true) + noise * random.standard_normal(1)
        moved = linearized(fall, own.spread(np.zeros(3)), steps)
        own.update(moved, linearized(distance, moved, steps), measured, noise)
        slope = jacobian(fall, reference.x, steps)
        reference.x, reference.P = fall(reference.x), slope @ reference.P @ slope.T
        reference.update(measured, lambda x: jacobian(distance, x, steps), distance)
        assert own.mean == pytest.approx(reference.x, rel=1e-6)
        assert own.covariance == pytest.approx(reference.P, rel=1e-4, abs=1e-9)


def cartesian(x):
    return np.array([x[0] * np.sin(x[1]), x[0] * np.cos(x[1])])


def test_a_bearing_in_cartesian_coordinates():
    """Julier and Uhlmann, Proc. IEEE 92(3), 2004: at 1 m with 2 cm and 15 deg the mean is at 96.7 cm; linearized, at 1 m."""
    mean, deviation = np.array([1.0, 0.0]), np.array([0.02, np.radians(15.0)])
    own, other = (make(mean, deviation, -FREE[:2], FREE[:2]) for make in (Extended, Unscented))
    points = own.spread(np.zeros(2))
    update = own.update(points, linearized(cartesian, points, 1e-6 * deviation), np.zeros(2), np.full(2, 1e-9))
    assert update.predicted.tolist() == [0.0, 1.0]
    assert update.deviation == pytest.approx([np.radians(15.0), 0.02], rel=1e-6)
    points = other.spread(np.zeros(2))
    update = other.update(points, np.array([cartesian(x) for x in points]), np.zeros(2), np.full(2, 1e-9))
    assert update.predicted == pytest.approx([0.0, np.exp(-0.5 * np.radians(15.0) ** 2)], abs=1e-5)
    assert update.predicted[1] == pytest.approx(0.967, abs=1e-3)
