"""Directional derivatives along a simulation: equal to fine differences, fewer simulations, and given up where they do not hold."""

import numpy as np
import pytest

from tests.study.recordings import write
from twin.component import Component, input, output, parameter, rk4, state
from twin.identify import identify, load
from twin.identify.model import Model
from twin.identify.search import Residuals
from twin.run import build_simulation, recorded_signals, resolve_catalogs
from twin.scenario import Backend, parse_scenario


class Oscillator(Component):
    """A spring that stiffens, with damping: der(v) = (force - c v - k x - cubic x^3) / mass."""

    method = rk4(1e-3)
    force = input("N", "drives it")
    position = output("m", "where it is")
    mass = parameter(1.0, "kg", "mass", minimum=1e-3, source="test")
    stiffness = parameter(40.0, "N/m", "of the spring", source="test")
    cubic = parameter(300.0, "N/m^3", "of the spring", source="test")
    damping = parameter((0.5, 0.5), "N*s/m", "two dampers", source="test")
    x = state(0.3, "m", "position")
    v = state(0.0, "m/s", "speed")

    def derivatives(self, t):
        self.der_x = self.v
        load = (self.damping[0] + self.damping[1]) * self.v + self.stiffness * self.x + self.cubic * self.x**3
        self.der_v = (self.force - load) / self.mass
        self.position = self.x


class Starting(Oscillator):
    """Starts where its parameters say: what the sensitivity takes to be zero is not."""

    def initialize(self):
        self.x = 4.0 / self.stiffness
        self.v = 0.0
        self.position = self.x


class Follower(Component):
    """Follows a position, with a lag."""

    method = rk4(1e-3)
    goal = input("m", "to be followed")
    place = output("m", "where it is")
    lag = parameter(0.1, "s", "time constant", minimum=1e-3, source="test")
    x = state(0.0, "m", "place")

    def derivatives(self, t):
        self.der_x = (self.goal - self.x) / self.lag
        self.place = self.x + 0.1 * self.goal


class Bouncer(Component):
    """Falls and bounces: an event whose time depends on the parameter."""

    method = rk4(1e-3)
    switches = ("x",)
    x = state(0.3, "m", "height")
    v = state(0.0, "m/s", "speed")
    height = output("m", "height")
    gravity = parameter(9.81, "m/s^2", "acceleration", minimum=0.1, source="test")

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = -self.gravity if self.x > 0.0 else 200.0
        self.height = self.x


MODEL = """
stop_time: 1 s
step: 25 ms
members:
  drive: {{component: chirp, communication_step: 500 ms}}
  plant: {{component: "tests.study.test_sensitivity:{plant}", interface: model_exchange, solver_tolerance: 1e-7}}
  follower: {{component: "tests.study.test_sensitivity:Follower", interface: model_exchange, solver_tolerance: 1e-7}}
connections:
  - {{from: drive.position, to: plant.force, convert: false, factor: 1000}}
  - plant.position -> follower.goal
record: {{variables: ["*.*"]}}
"""
FILE = """
scenario: model.yaml
data: [drive.csv, place.csv]
inputs: {drive: plant.force}
outputs: {place: {signal: follower.place, offset: {from: -1 mm, to: 1 mm}, noise: 0.1 mm}}
fit:
  plant.stiffness: {from: 10 N/m, to: 100 N/m, start: 25 N/m, scale: log}
  plant.cubic: {from: 0 N/m^3, to: 1000 N/m^3, start: 100 N/m^3}
  plant.damping: {from: 0.1 N*s/m, to: 2 N*s/m, start: 1 N*s/m}
  follower.lag: {from: 20 ms, to: 400 ms, start: 60 ms}
"""
TRUTH = {"plant.stiffness": 40.0, "plant.cubic": 300.0, "plant.damping": 0.5, "follower.lag": 0.1}


def recorded(folder, build, plant="Oscillator"):
    """The model's file, what drove it, and where the follower was, with noise."""
    text = MODEL.format(plant=plant)
    (folder / "model.yaml").write_text(text)
    (folder / "identify.yaml").write_text(FILE)
    scenario = parse_scenario(text, folder / "model.yaml")
    case = scenario.cases()[0]
    running = build_simulation(case, resolve_catalogs(scenario)["base"], Backend.fmu, build)
    try:
        running.initialize(case.start_ns, case.stop_ns)
        running.advance(case.stop_ns)
        found = recorded_signals(running, complete=True)
    finally:
        running.terminate()
    noise = 0.1e-3 * np.random.default_rng(1).standard_normal(len(found.time))
    write(folder / "drive.csv", "time [s],drive", found.time, 1000 * found.values["drive.position"])
    write(folder / "place.csv", "time [s],place", found.time, found.values["follower.place"] + noise)
    return folder / "identify.yaml"


@pytest.mark.slow
def test_they_are_what_fine_differences_say(tmp_path, build):
    problem = load(recorded(tmp_path, build))
    places = np.array([one.position(one.start) for one in problem.unknowns])
    with Model(problem, build) as model:
        residuals = Residuals(model, [1e-4])
        before = model.count
        exact = residuals.analytic_columns(places)
        assert model.derivatives == "directional derivatives"
        compared = model.count - before
        again = residuals.analytic_columns(places)
        assert model.count - before - compared == 1  # one simulation for all columns
        numbers = sorted(exact)
        assert [problem.unknowns[i].name for i in numbers] == list(TRUTH)  # the offset needs none
        fine = residuals.jacobian(places, 1e-4, central=True, of=numbers)
    for number, column in zip(numbers, fine.T, strict=True):
        assert np.linalg.norm(exact[number] - column) < 5e-3 * np.linalg.norm(column)  # second order in steps of 25 ms
        assert np.array_equal(exact[number], again[number])


@pytest.mark.slow
def test_a_fit_needs_fewer_simulations(tmp_path, build, monkeypatch):
    path = recorded(tmp_path, build)
    by_derivatives = identify(load(path), build=build, starts=1, seed=1)
    monkeypatch.setattr("twin.identify.model.watched", lambda *_: None)
    by_differences = identify(load(path), build=build, starts=1, seed=1)
    assert by_derivatives.fit.derivatives == "directional derivatives"
    assert by_differences.fit.derivatives == "differences"
    for result in (by_derivatives, by_differences):
        values = dict(zip([one.name for one in result.problem.unknowns], result.values, strict=True))
        for name, truth in TRUTH.items():
            low, high = result.intervals[[one.name for one in result.problem.unknowns].index(name)]
            assert low < truth < high
            assert values[name] == pytest.approx(truth, rel=0.2)
    assert by_derivatives.fit.simulations < 0.75 * by_differences.fit.simulations


@pytest.mark.slow
def test_a_start_that_depends_on_what_is_looked_for_is_noticed(tmp_path, build):
    problem = load(recorded(tmp_path, build, "Starting"))
    with Model(problem, build) as model:
        assert (
            Residuals(model, [1e-4]).analytic_columns(np.array([one.position(one.start) for one in problem.unknowns]))
            == {}
        )
        reason = "directional derivatives by plant.stiffness are not what differences say"
        assert model.derivatives == f"differences, since {reason}"


@pytest.mark.slow
def test_an_event_at_which_a_derivative_jumps_ends_them(tmp_path, build):
    (tmp_path / "model.yaml").write_text(
        'stop_time: 500 ms\nstep: 10 ms\nmembers: {ball: {component: "tests.study.test_sensitivity:Bouncer", '
        "interface: model_exchange}}\n"
    )
    (tmp_path / "identify.yaml").write_text(
        "scenario: model.yaml\ndata: [ball.csv]\noutputs: {h: {signal: ball.height, noise: 1 mm}}\n"
        "fit: {ball.gravity: {from: 8 m/s^2, to: 12 m/s^2, start: 9 m/s^2}}\n"
    )
    times = np.arange(0.0, 0.5, 0.01)
    write(tmp_path / "ball.csv", "time [s],h", times, np.maximum(0.3 - 0.5 * 9.81 * times**2, 0.0))
    problem = load(tmp_path / "identify.yaml")
    with Model(problem, build) as model:
        assert model.slopes(np.array([0.5])) is None
        assert model.refused.startswith("a derivative of a state jumps at an event at t = 0.24")
