"""Model Exchange on import: solvers and events of ours, alone, in one state with others, and in a co-simulation."""

import sys
from itertools import pairwise

import numpy as np
import pytest
from fmpy import simulate_fmu
from scipy.integrate import solve_ivp

from tests.fmi.exchange_parts import Body, Gain, Spring, VanDerPol, exchange_fmu, python_ball
from tests.fmi.parts import Failing, Masses
from twin.coupling import Connection, CoSimulation, CoupledSystem
from twin.errors import CouplingError, FMUError, SimulationError
from twin.fmi import csv_tables, member, plan, simulate
from twin.fmi.exporting import exporter
from twin.fmi.model_exchange import solvers

VERSIONS = ("2.0", "3.0")
MS = 1_000_000
G, RESTITUTION = 9.81, 0.7
SOLVERS = [
    *(("Radau", 1e-12), ("RK45", 1e-11), ("BDF", 1e-6)),
    *(("CVODE", 1e-6), ("CVODE_Adams", 1e-6), ("ARKODE", 1e-7), ("ARKODE_ERK", 1e-7)),
]


def needs(solver):
    """Skip a test where the wheel of a solver is not installed."""
    for package, names in {"sksundae": solvers.CVODE, "SundialsPy": solvers.ARKODE}.items():
        if solver in names:
            pytest.importorskip(package)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("exchange")


@pytest.fixture(scope="module")
def built(build):
    return lambda part, version="3.0": exporter.build(part, version, build / "tests")


def alone(path, stop, step=0.01, inputs=None, record=(), starts=None, **options):
    """Times, results by name, and the outcome of an FMU alone."""
    one = member("one", path, starts or {}, **options)
    table = csv_tables.read_inputs(inputs, one) if inputs else None
    outcome = simulate(one, plan(one, stop=stop, step=step, record=record), table)
    assert not outcome.failure
    times = np.array([float(time) for time in outcome.results.times]) / 1e9
    return times, {name: values for name, _, values in outcome.results.columns()}, outcome


def heights(times):
    """Of a ball that falls from 1 m and keeps a part of its speed when it bounces."""
    begins, speed = [np.sqrt(2.0 / G)], np.sqrt(2.0 * G)
    found = 1.0 - 0.5 * G * times**2
    while begins[-1] < times[-1]:
        speed *= RESTITUTION
        begins.append(begins[-1] + 2.0 * speed / G)
        flight = times - begins[-2]
        found = np.where(flight > 0.0, speed * flight - 0.5 * G * flight**2, found)
    return found, sum(begin <= times[-1] for begin in begins)


# -------------------------------------------------------------------------------------------------------------- alone


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("solver", "error"), SOLVERS)
def test_a_ball_bounces_when_it_must(folder, version, solver, error):
    needs(solver)
    path = exchange_fmu(folder, "Ball", version)
    times, found, _ = alone(path, 1.9, solver=solver)
    expected, bounces = heights(times)
    assert np.abs(found["h"] - expected).max() < error
    assert found["bounces"][-1] == bounces == 4


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("solver", ["BDF", "Radau", "CVODE"])
def test_derivatives_by_differences_do_not_move_the_model(folder, version, solver):
    """After its directional derivatives were asked for, an FMU may stand at another time and in another state."""
    needs(solver)
    times, found, _ = alone(exchange_fmu(folder, "Ball", version, differences=True), 0.4, solver=solver, tolerance=1e-8)
    assert found["h"][0] == 1.0
    assert found["v"][0] == 0.0
    np.testing.assert_allclose(found["v"], -G * times, atol=1e-6)
    np.testing.assert_allclose(found["h"], heights(times)[0], atol=1e-6)


@pytest.mark.slow
def test_it_agrees_with_fmpy(folder):
    path = exchange_fmu(folder, "Ball", "2.0")
    theirs = simulate_fmu(str(path), stop_time=1.9, output_interval=0.01, relative_tolerance=1e-10)
    times, found, _ = alone(path, 1.9)
    unique = np.append(np.diff(theirs["time"]) > 0, True)
    assert np.interp(times, theirs["time"][unique], theirs["h"][unique]) == pytest.approx(found["h"], abs=1e-4)


@pytest.mark.slow
def test_a_ball_that_another_builder_made(folder):
    times, found, _ = alone(python_ball(folder), 1.9, tolerance=1e-8)
    expected, bounces = heights(times)
    assert np.abs(found["h"] - expected).max() < 1e-12
    assert found["bounces"][-1] == bounces


@pytest.mark.slow
def test_events_without_end_are_told(folder):
    one = member("one", exchange_fmu(folder, "Ball", "3.0"), {"e": 0.3})
    outcome = simulate(one, plan(one, stop=2.0, step=0.1))
    assert "one: events follow each other without end at t = 0.838" in outcome.failure
    assert outcome.results.times[-1] == 800 * MS


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["Radau", "BDF"])
def test_a_stiff_oscillator(built, solver):
    times, found, _ = alone(built(VanDerPol), 30.0, 0.5, interface="model_exchange", solver=solver, tolerance=1e-7)
    exact = solve_ivp(
        lambda _, y: [y[1], 50.0 * (1.0 - y[0] ** 2) * y[1] - y[0]],
        (0.0, 30.0),
        [2.0, 0.0],
        method="Radau",
        rtol=1e-10,
        atol=1e-12,
        t_eval=times,
    )
    assert found["x"] == pytest.approx(exact.y[0], rel=1e-4)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("version", VERSIONS)
def test_time_events_and_the_end_that_an_fmu_wants(folder, version):
    times, found, outcome = alone(exchange_fmu(folder, "Stair", version), 8.0, 0.4, tolerance=1e-6)
    assert found["counter"].tolist() == [int(t + 1e-9) for t in times]
    assert times[-1] == 5.0
    assert "ended the simulation in the step from 4.8 s" in outcome.notes[-1]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("version", VERSIONS)
def test_inputs_are_continuous_within_a_step_and_steps_have_events(folder, version, tmp_path):
    inputs = tmp_path / "inputs.csv"
    inputs.write_text("time,u\n0,0\n1,1\n1.5,1\n1.5,0\n2,0\n")
    times, found, _ = alone(exchange_fmu(folder, "Relay", version), 2.0, 0.1, inputs, ("on", "x"), solver="RK45")
    on = [bool(0.5 < t < 1.5 - 1e-9) for t in times.round(9)]
    assert found["on"].astype(bool).tolist() == on
    assert found["x"][times.round(9) == 1.5][0] == pytest.approx(1.0 - np.exp(-9.0), abs=1e-3)  # 0.6 s at the earliest
    after = times > 1.5
    assert found["x"][after] == pytest.approx(found["x"][times.round(9) == 1.5] * np.exp(-10 * (times[after] - 1.5)))


@pytest.mark.slow
def test_an_input_that_jumps_between_communication_points(built, tmp_path):
    inputs = tmp_path / "inputs.csv"
    inputs.write_text("time,push\n0,0\n0.503,1\n0.503,3\n1,0\n")
    times, found, _ = alone(built(Masses), 1.0, 0.1, inputs, interface="model_exchange", tolerance=1e-9)
    y, exact = [0.1, 0.2, 0.0, 0.0], []
    for (begin, first), (end, last) in pairwise([(0.0, (0.0, 1.0)), (0.503, (3.0, 0.0)), (1.0, (0.0, 0.0))]):
        del last

        def speed(t, y, begin=begin, end=end, first=first):
            push = first[0] + (first[1] - first[0]) * (t - begin) / (end - begin)
            return [y[2], y[3], (push - 10.0 * y[0]) / 0.5, (push - 10.0 * y[1]) / 0.5]

        inside = times[(times >= begin) & (times <= end)]
        part = solve_ivp(speed, (begin, end), y, rtol=1e-11, atol=1e-13, dense_output=True)
        exact += [sum(part.sol(t)[:2]) for t in inside]
        y = part.y[:, -1]
    assert found["total"] == pytest.approx(exact, abs=1e-8)


@pytest.mark.parametrize("solver", ["Radau", "RK45", "BDF"])
def test_a_pulse_of_an_input_within_a_step(built, tmp_path, solver):
    """At rest a solver would step across it."""
    inputs = tmp_path / "inputs.csv"
    inputs.write_text("time,f\n0,0\n0.4,0\n0.41,1\n0.42,0\n1,0\n")
    _, found, _ = alone(built(Body), 1.0, 0.5, inputs, interface="model_exchange", solver=solver)
    assert found["v"][-1] == pytest.approx(0.01, abs=1e-5)


# ------------------------------------------------------------------------------------------------------- in one state


def coupled(built, build, interface, h, stop=10 * MS, **options):
    """Two bodies at a stiff spring; what was recorded, and the delays of the connections."""
    parts = {"a": (Body, {"place": 1e-3}), "b": (Body, {"mass": 2.0}), "spring": (Spring, {})}
    members = {
        name: member(name, built(part), starts, interface=interface, **options)
        for name, (part, starts) in parts.items()
    }
    connections = [
        *(Connection(f"{one}.{of}", f"spring.{of}{one}") for one in ("a", "b") for of in ("x", "v")),
        Connection("spring.f", "b.f"),
        Connection("spring.f", "a.f", factor=-1.0),
    ]
    system = CoupledSystem({name: one.variables for name, one in members.items()}, connections)
    simulated = CoSimulation(members, system.links(), h, build=build)
    try:
        simulated.initialize(0, stop)
        simulated.advance(stop)
        return simulated.recording(), [delay for _, delay in simulated.delays()]
    finally:
        simulated.terminate()


def distances(times):
    """Of the two bodies: reduced mass 2/3 kg at 1e6 N/m and 1e3 N s/m."""
    decay, square = 750.0, 1.5e6 - 750.0**2
    omega = np.sqrt(square)
    return 1e-3 * np.exp(-decay * times) * (np.cos(omega * times) + decay / omega * np.sin(omega * times))


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["Radau", "RK45", "CVODE", "ARKODE"])
def test_a_stiff_coupling_is_solved_together(built, build, solver):
    needs(solver)
    found, delays = coupled(built, build, "model_exchange", MS, solver=solver, tolerance=1e-8)
    between = found.signals["a.x"] - found.signals["b.x"]
    assert between == pytest.approx(distances(found.time), abs=1e-8)
    assert set(delays) == {0}


@pytest.mark.slow
def test_steps_apart_are_not_stable_for_it(built, build):
    found, delays = coupled(built, build, "co_simulation", MS)
    assert np.abs(found.signals["a.x"] - found.signals["b.x"]).max() > 0.01
    assert set(delays) == {MS}


def pair(built, build, parts, connections, stop=10 * MS, step=MS, algorithm="jacobi", record=None):
    """What members do that are connected."""
    system = CoupledSystem(
        {name: one.variables for name, one in parts.items()}, [Connection(*one) for one in connections]
    )
    simulated = CoSimulation(parts, system.links(), step, algorithm, build=build, record=record)
    try:
        simulated.initialize(0, stop)
        simulated.advance(stop)
        return simulated.recording()
    finally:
        simulated.terminate()


def gains(built, first, second):
    given = {"a": {"gain": first, "offset": 1.0}, "b": {"gain": second, "offset": 1.0}}
    return {name: member(name, built(Gain), starts, interface="model_exchange") for name, starts in given.items()}


RING = [("a.y", "b.u"), ("b.y", "a.u")]


def test_algebraic_loops_are_solved(built, build):
    found = pair(built, build, gains(built, 0.5, -3.0), RING)
    assert found.signals["a.y"] == pytest.approx(np.full(11, 0.6))  # y = 1 + (1 - 3 y) / 2
    assert found.signals["b.y"] == pytest.approx(np.full(11, -0.8))


def test_those_without_a_solution_are_named(built, build):
    with pytest.raises(SimulationError, match=r"algebraic loop through a\.y, b\.y has no solution"):
        pair(built, build, gains(built, 1.0, 1.0), RING)


@pytest.mark.slow
def test_an_event_of_one_is_an_event_of_all(folder, build):
    parts = {
        name: member(name, exchange_fmu(folder, model, version), {})
        for name, model, version in (("ball", "Ball", "3.0"), ("relay", "Relay", "2.0"))
    }
    found = pair(
        None, build, parts, [("ball.h", "relay.u")], 1000 * MS, 10 * MS, record=[("ball", "h"), ("relay", "on")]
    )
    assert np.array_equal(found.signals["relay.on"], found.signals["ball.h"] > 0.5)
    assert found.signals["ball.h"] == pytest.approx(heights(found.time)[0], abs=1e-9)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("key", [("relay", "u"), ("ball", "h")])
def test_overrides_hold_inside(folder, build, key):
    """What the relay hears is overridden for a while, at its input or at its source; the ball goes on as it does."""
    parts = {
        "ball": member("ball", exchange_fmu(folder, "Ball", "2.0")),
        "relay": member("relay", exchange_fmu(folder, "Relay", "3.0")),
    }
    system = CoupledSystem({name: one.variables for name, one in parts.items()}, [Connection("ball.h", "relay.u")])
    simulated = CoSimulation(
        parts, system.links(), 10 * MS, build=build, record=[("ball", "h"), ("relay", "on"), ("ball", "v")]
    )
    try:
        simulated.initialize(0, 300 * MS)
        simulated.advance(50 * MS)
        simulated.override(key, 0.25)
        simulated.advance(150 * MS)
        simulated.release(key)
        simulated.advance(300 * MS)
        found = simulated.recording()
    finally:
        simulated.terminate()
    inside = (found.time > 0.05) & (found.time <= 0.15)
    assert found.signals["relay.on"].tolist() == (~inside & (found.time <= 0.31)).tolist()
    assert found.signals["ball.v"] == pytest.approx(-G * found.time, abs=1e-9)
    seen = 0.25 if key == ("ball", "h") else heights(found.time)[0][inside][-1]
    assert found.signals["ball.h"][inside][-1] == pytest.approx(seen, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "algorithm", ["jacobi", *(pytest.param(name, marks=pytest.mark.slow) for name in ("gauss_seidel", "iterative"))]
)
def test_beside_a_member_that_steps_by_itself(built, build, algorithm):
    """A slow body and a soft spring: one body is integrated with the spring, the other steps by itself."""

    def run(interface):
        starts = {"a": {"place": 0.1}, "b": {"mass": 2.0}, "spring": {"stiffness": 10.0, "damping": 1.0}}
        of = {"a": (Body, interface), "b": (Body, "co_simulation"), "spring": (Spring, interface)}
        parts = {name: member(name, built(part), starts[name], interface=way) for name, (part, way) in of.items()}
        connections = [
            ("a.x", "spring.xa"),
            ("a.v", "spring.va"),
            ("b.x", "spring.xb"),
            ("b.v", "spring.vb"),
            ("spring.f", "b.f"),
        ]
        return pair(built, build, parts, connections, 500 * MS, 5 * MS, algorithm)

    one, other = run("model_exchange"), run("co_simulation")
    assert one.signals["b.x"] == pytest.approx(other.signals["b.x"], abs=2e-3)
    assert np.abs(one.signals["b.x"]).max() > 0.05


def test_going_back(built):
    one = member("one", built(Masses), {"push": 1.0}, interface="model_exchange", tolerance=1e-10)
    assert one.has_cheap_fmu_state
    one.instantiate()
    one.enter_initialization(0.0, None)
    one.exit_initialization()
    place = np.frombuffer(bytearray(40), np.float64).ctypes.data
    go = lambda t, h: one._callback(one.instance, t, h, 1, place, place + 8, place + 16, place + 24)  # noqa: E731
    try:
        assert go(0.0, 0.1) == 0
        saved = one.save()
        assert go(0.1, 0.1) == 0
        there = one.get("total")
        one.restore(saved)
        assert go(0.1, 0.1) == 0
        assert one.get("total") == pytest.approx(there, rel=1e-12)
    finally:
        one.close()


# ------------------------------------------------------------------------------------------------------------ refused


def refused(call, text):
    with pytest.raises(FMUError) as told:
        call()
    assert text in str(told.value)


def test_what_cannot_be_is_told(folder, built, monkeypatch):
    ball = exchange_fmu(folder, "Ball", "3.0")
    refused(lambda: member("one", ball, solver="Radua"), "solver 'Radua' is not known. Did you mean 'Radau'?")
    refused(lambda: member("one", ball, interface="model_exchang"), "is not known. Did you mean 'model_exchange'?")
    refused(
        lambda: member("one", ball, interface="co_simulation"), "is for Model Exchange only; Co-Simulation is needed"
    )
    refused(
        lambda: member("one", built(Failing), interface="model_exchange"), "is for Co-Simulation only; Model Exchange"
    )
    refused(lambda: member("one", built(Masses), solver="RK45"), "without a solver. Use interface model_exchange")
    for solver, module in {"CVODE": "sksundae.cvode", "ARKODE": "SundialsPy"}.items():
        monkeypatch.setitem(sys.modules, module, None)
        refused(lambda name=solver: alone(ball, 1.0, solver=name), "pip install 'catheter-twin[solvers]'")


def test_members_of_one_state_must_agree(folder, build):
    make = lambda name, **options: member(name, exchange_fmu(folder, name.title(), "3.0"), {}, **options)  # noqa: E731
    links = [("ball.h", "relay.u")]
    parts = {"ball": make("ball", solver="RK45"), "relay": make("relay", solver="BDF")}
    with pytest.raises(CouplingError, match="with different solvers"):
        pair(None, build, parts, links)
    for one in parts.values():
        one.close()
    parts = {"ball": make("ball"), "relay": make("relay")}
    system = CoupledSystem({name: one.variables for name, one in parts.items()}, [Connection(*links[0])])
    with pytest.raises(CouplingError, match="step differently"):
        CoSimulation(parts, system.links(), MS, build=build, periods={"ball": 2 * MS})
    for one in parts.values():
        one.close()
