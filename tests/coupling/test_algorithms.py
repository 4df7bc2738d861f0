"""Algorithms beyond the fixed step: how exact they are, how they choose steps, what they leave behind, whom they refuse."""

import numpy as np
import pytest
from scipy.linalg import expm

from benchmarks.couplings import Answering, Mass
from tests.coupling.mock import Taker
from tests.coupling.parts import Clock, Gain, Hold, Lag, SlowClock, SlowHold, couple
from tests.every_case import every_case
from twin.coupling import Algorithm, Connection, CoSimulation, CoupledSystem
from twin.errors import CouplingError, SimulationError
from twin.fmi import FMUMember
from twin.fmi.exporting import exporter

MS = 1_000_000
STOP = 256 * MS
FORCE = ["a.x -> b.other_x", "a.v -> b.other_v", "b.force -> a.f"]
PLACES = ["a.x -> b.other_x", "a.v -> b.other_v", "b.x -> a.other_x", "b.v -> a.other_v"]
SCHEMES = ["relaxed", "aitken", "anderson", "newton"]


def masses(wires):
    """The two masses of a coupling."""
    return {"a": (Mass if wires is FORCE else Answering)(begin=0.01), "b": Answering()}


def exact(stop):
    """Where both masses are: the matrix exponential."""
    k, d, own_k, own_d = 200.0, 2.0, 100.0, 1.0
    a = np.array([[0, 1, 0, 0], [-own_k - k, -own_d - d, k, d], [0, 0, 0, 1], [k, d, -own_k - k, -own_d - d]])
    return (expm(a * stop / 1e9) @ [0.01, 0, 0, 0])[[0, 2]]


def ran(build, wires, algorithm, step, stop=STOP):
    """A finished run of two masses, its last values beside it."""
    run = couple(build, masses(wires), wires, algorithm, step=step, record=[("a", "x"), ("b", "x")], every=stop)
    run.initialize(0, stop)
    run.advance(stop)
    run.terminate()
    signals = run.recording().signals
    return run, np.array([signals["a.x"][-1], signals["b.x"][-1]])


def error(build, wires, algorithm, step):
    """Largest error at the end, relative to what the mass began with."""
    return np.abs(ran(build, wires, algorithm, step)[1] - exact(STOP)).max() / 0.01


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("wires", [FORCE, PLACES], ids=["force", "places"])
@pytest.mark.parametrize(
    ("algorithm", "order"),
    [
        (Algorithm("jacobi"), 1),
        (Algorithm("gauss_seidel"), 1),
        (Algorithm("iterative"), 1),
        (Algorithm("jacobi", order=1), 2),
        (Algorithm("gauss_seidel", order=1), 2),
        *((Algorithm("iterative", order=1, acceleration=one), 2) for one in SCHEMES),
        (Algorithm("iterative", order=2), 2),
    ],
    ids=lambda one: getattr(one, "described", str(one)),
)
def test_order_of_convergence(wires, algorithm, order, build):
    errors = [error(build, wires, algorithm, step) for step in (2 * MS, 1 * MS)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.25)


@pytest.mark.slow
def test_all_accelerations_come_to_the_same(build):
    ends = [ran(build, FORCE, Algorithm("iterative", acceleration=one, agreement=1e-9), 4 * MS)[1] for one in SCHEMES]
    for end in ends[1:]:
        np.testing.assert_allclose(end, ends[0], rtol=1e-7)


@pytest.mark.parametrize("acceleration", SCHEMES)
def test_a_linear_loop_is_solved_exactly(acceleration, build):
    parts = {"a": Gain(), "b": Gain(k=-1.5)}
    loop = couple(
        build, parts, ["a.y -> b.u", "b.y -> a.u"], Algorithm("iterative", acceleration=acceleration, iterations=60)
    )
    loop.initialize(0, 5 * MS)
    parts["a"].c = 3.0  # after the initialization
    loop.advance(5 * MS)
    loop.terminate()
    # y_a = y_b / 2 + 3, y_b = 1 - 1.5 y_a
    assert loop.recording().signals["a.y"][1] == pytest.approx(2.0, rel=1e-5)
    assert not loop.notes


def test_iterations_that_do_not_suffice_are_noted_or_stop_the_run(build):
    wires = ["a.y -> b.u", "b.y -> a.u"]
    few = {"name": "iterative", "acceleration": "relaxed", "iterations": 3}
    for unsolved in ("note", "stop"):
        parts = {"a": Gain(k=1.0), "b": Gain(k=-4.0)}
        loop = couple(build, parts, wires, Algorithm({**few, "unsolved": unsolved}))
        loop.initialize(0, 5 * MS)
        parts["a"].c = 3.0
        if unsolved == "note":
            loop.advance(5 * MS)
            loop.terminate()
            assert "5 steps did not agree after the last iteration" in loop.notes[0]
            assert "t = 0 s" in loop.notes[0]
        else:
            with pytest.raises(SimulationError, match=r"a.u do not agree after 3 iterations in the step from t = 0 s"):
                loop.advance(5 * MS)
            loop.terminate()


@pytest.mark.parametrize("name", ["step_doubling", "predictive"])
@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("sequential", [False, True])
def test_steps_follow_the_tolerance(name, order, sequential, build):
    found = []
    for tolerance in (1e-2, 1e-4):
        algorithm = Algorithm(name, order=order, tolerance=tolerance, sequential=sequential)
        run, end = ran(build, FORCE, algorithm, 32 * MS)
        found.append((int(run.state["sweeps"]), np.abs(end - exact(STOP)).max() / 0.01))
        assert not run.notes
    assert found[1][0] > found[0][0]
    assert found[1][1] < 0.4 * found[0][1]
    assert found[1][1] < 1e-2


def test_the_recording_grid_is_met_whatever_the_steps(build):
    parts = {"a": Mass(begin=0.01), "b": Answering()}
    algorithm = Algorithm("step_doubling", tolerance=1e-4, order=1)
    run = couple(build, parts, FORCE, algorithm, step=16 * MS, every=32 * MS)
    run.initialize(0, 320 * MS)
    run.advance(160 * MS)
    run.set(("a", "k"), 300.0)
    run.advance(320 * MS)
    run.terminate()
    assert run.recording().time.tolist() == [k * 32 / 1000 for k in range(11)]
    assert run.state["rejected"] > 0


def test_smallest_step_is_kept_to_and_told(build):
    algorithm = Algorithm("step_doubling", tolerance=1e-9, smallest=1 * MS)
    run, _ = ran(build, FORCE, algorithm, 16 * MS)
    assert run.state["sweeps"] < 3 * 140
    assert len(run.notes) == 1
    assert "128 steps of the smallest size were not as exact as asked for" in run.notes[0]
    assert run.state["unsolved"] == 0


@pytest.mark.slow
def test_modes_and_forms_agree_to_the_bit(build):
    """Compiled, interpreted, as FMUs of both versions: what is taken back leaves no trace."""
    for algorithm in (Algorithm("iterative", order=1), Algorithm("step_doubling", order=1, tolerance=1e-4)):
        ends = []
        for mode in ("compiled", "interpreted", "2.0", "3.0"):
            if mode in ("2.0", "3.0"):
                own = {
                    "a": FMUMember("a", exporter.build(Mass, mode, build), {"begin": 0.01}),
                    "b": FMUMember("b", exporter.build(Answering, mode, build)),
                }
                links = CoupledSystem(
                    {n: m.variables for n, m in own.items()}, [Connection(*one.split(" -> ")) for one in FORCE]
                ).links()
                run = CoSimulation(own, links, 4 * MS, algorithm, build=build)
            else:
                run = couple(build, masses(FORCE), FORCE, algorithm, step=4 * MS, mode=mode)
            run.initialize(0, 64 * MS)
            run.advance(64 * MS)
            run.terminate()
            ends.append(run.recording().signals["a.x"].tobytes())
        assert len(set(ends)) == 1


def test_sampled_members_are_not_iterated(build):
    """What samples takes the value of its instant once, whatever the others iterate."""
    hold = SlowHold()
    parts = {"clock": Clock(), "slow": hold, "lag": Lag(x=1.0), "gain": Gain()}
    wires = ["clock.y -> slow.u", "gain.y -> lag.u", "lag.y -> gain.u"]
    run = couple(build, parts, wires, Algorithm("iterative"))
    run.initialize(0, 50 * MS)
    run.advance(50 * MS)
    run.terminate()
    assert hold.count == 5
    assert run.recording().signals["slow.y"][::10].tolist() == pytest.approx([0.0, 0.0, 0.01, 0.02, 0.03, 0.04])
    assert run.state["sweeps"] > 50


def test_overrides_and_events_hold_in_every_attempt(build):
    for algorithm in (
        Algorithm("iterative", order=1),
        Algorithm("step_doubling", order=1),
        Algorithm("jacobi", order=2),
    ):
        parts = {"a": Lag(x=1.0), "b": Lag()}
        run = couple(build, parts, ["a.y -> b.u", "b.y -> a.u"], algorithm, record=[("a", "y"), ("b", "y"), ("b", "u")])
        run.initialize(0, 40 * MS)
        run.advance(10 * MS)
        run.override(("b", "u"), 5.0)
        run.advance(20 * MS)
        assert parts["b"].u == 5.0
        run.release(("b", "u"))
        run.advance(21 * MS)
        assert parts["b"].u < 1.5
        run.advance(40 * MS)
        run.terminate()


def test_delays(build):
    parts = {"clock": Clock(), "slow": SlowHold(), "lag": Lag(), "gain": Gain()}
    wires = ["clock.y -> slow.u", "gain.y -> lag.u", "lag.y -> gain.u"]
    told = {}
    for name in ("jacobi", "gauss_seidel", "iterative", "predictive"):
        run = couple(build, parts, wires, Algorithm(name))
        told[name] = [delay // MS for _, delay in run.delays()]
    assert told == {
        "jacobi": [10, 1, 1],
        "gauss_seidel": [9, 1, 0],
        "iterative": [10, 0, 0],
        "predictive": [10, 1, 1],
    }


@every_case(
    ("given", "message"),
    [
        ("jakobi", "there is no 'jakobi'. Did you mean 'jacobi'"),
        ({"name": "iterative", "iteration": 3}, "iterative has no option 'iteration'. Did you mean 'iterations'"),
        ({"name": "iterative", "iterations": 0}, "iterations of iterative is 0. Give 1 to 1000"),
        ({"name": "iterative", "acceleration": "atken"}, "no acceleration 'atken'. Did you mean 'aitken'"),
        ({"name": "jacobi", "order": 3}, "order of jacobi is 3. Give 0 to 2"),
        ({"name": "jacobi", "order": 0.5}, "order of jacobi is 0.5. Give 0 to 2"),
        ({"name": "step_doubling", "tolerance": 0}, "tolerance of step_doubling is 0. Give above 0 up to 1"),
    ],
)
def test_wrong_options_are_one_line(given, message):
    with pytest.raises(CouplingError, match=message):
        Algorithm(given)


def test_names_and_options():
    assert Algorithm("jacobi") == Algorithm.jacobi == "jacobi"
    assert Algorithm("iterative", order=1) != Algorithm("iterative")
    assert Algorithm("iterative", order=1).described == "iterative (order: 1)"
    assert [one.name for one in Algorithm][:2] == ["jacobi", "gauss_seidel"]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("name", "order"), [("jacobi", 0), ("jacobi", 1), ("gauss_seidel", 1), ("iterative", 2)])
def test_who_takes_derivatives_of_inputs_gets_them(name, order, build):
    """Two such members: y1' = (y2 - y1) / 0.1 s and the other way round; the order is one above that of the inputs.

    Extrapolation of order 2 begins with steps of order 0 and 1, whose error stays: two are all it has from the start.
    """
    errors = []
    for step in (4 * MS, 2 * MS):
        members = {"a": Taker("a"), "b": Taker("b")}
        members["a"].memory[1] = 1.0
        members["b"].memory[1] = -0.5
        catalog = {n: m.variables for n, m in members.items()}
        links = CoupledSystem(catalog, [Connection("a.y", "b.u"), Connection("b.y", "a.u")]).links()
        run = CoSimulation(members, links, step, Algorithm(name, order=order), build=build)
        run.initialize(0)
        run.advance(200 * MS)
        end = np.array([run.recording().signals[f"{n}.y"][-1] for n in "ab"])
        errors.append(np.abs(end - (expm(np.array([[-10.0, 10.0], [10.0, -10.0]]) * 0.2) @ [1.0, -0.5])).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order + 1, abs=0.3)


# power bonds


def bonded(build, names, algorithm, stop=2_048 * MS, wires=PLACES):
    """Two masses without damping, coupled by connections that are declared as bonds; energy at the end by that at the begin."""
    free = {"d": 0.0}
    parts = {
        "a": Answering(begin=0.01, between_d=0.0, **free) if wires is PLACES else Mass(begin=0.01, **free),
        "b": Answering(between_d=0.0, **free),
    }
    members = couple(build, parts, []).members
    ends = [Connection(*one.split(" -> "), bond=names.get(one, "")) for one in wires]
    links = CoupledSystem({n: m.variables for n, m in members.items()}, ends).links()
    run = CoSimulation(members, links, 4 * MS, algorithm, build=build)
    run.initialize(0, stop)
    run.advance(stop)
    run.terminate()
    s = run.recording().signals
    own = (s["a.v"] ** 2 + s["b.v"] ** 2) / 2 + 50 * (s["a.x"] ** 2 + s["b.x"] ** 2)
    energy = own + 100 * (s["a.x"] - s["b.x"]) ** 2
    return energy[-1] / energy[0] - 1


def test_bonds_lose_less_energy_and_make_none(build):
    names = dict.fromkeys(FORCE, "spring")
    plain, corrected = (
        bonded(build, names, one, wires=FORCE) for one in (Algorithm("jacobi", order=1), Algorithm("energy"))
    )
    assert plain > 0.005, "extrapolation alone makes energy"
    assert -plain < corrected < 0.0


def test_without_bonds_it_is_said_that_nothing_is_corrected(build):
    run = couple(build, masses(FORCE), FORCE, Algorithm("energy"))
    run.initialize(0, 4 * MS)
    run.advance(4 * MS)
    run.terminate()
    assert run.notes[0].startswith("energy: no connection is a power bond, so none is corrected. Write `bond: name`")


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ({FORCE[0]: "spring"}, "bond spring: goes one way only, from a. Declare it at a connection back"),
        ({PLACES[0]: "spring", PLACES[2]: "spring"}, r"bond spring: a.x \[m\] and b.x \[m\] give no power"),
    ],
)
def test_what_is_no_bond_is_told(names, message, build):
    wires = PLACES if PLACES[2] in names else FORCE
    with pytest.raises(CouplingError, match=message):
        bonded(build, names, Algorithm("energy"), wires=wires)


@pytest.mark.parametrize("name", ["step_doubling", "predictive"])
def test_steps_may_be_solved_too(name, build):
    """A coupling that iterates, and halves the steps in which it does not come to an end."""
    exact_end = exact(STOP)
    for order, worst in ((0, 0.1), (1, 5e-3)):
        algorithm = Algorithm(name, order=order, tolerance=1e-3, iterations=12, acceleration="newton")
        run, end = ran(build, FORCE, algorithm, 32 * MS)
        assert np.abs(end - exact_end).max() / 0.01 < worst
        assert not run.notes
    parts = {"a": Gain(k=1.0), "b": Lag(time_constant=0.002)}
    wires = ["a.y -> b.u", "b.y -> a.u"]
    loop = couple(
        build, parts, wires, Algorithm(name, iterations=3, acceleration="relaxed", tolerance=0.5), step=16 * MS
    )
    loop.initialize(0, 16 * MS)
    parts["a"].k = -3.0
    loop.advance(16 * MS)
    loop.terminate()
    assert loop.state["rejected"] > 0
    assert loop.state["unsolved"] == 0


def test_steps_that_stay_unsolved_are_made_in_whole(build):
    parts = {"a": Gain(k=1.0), "b": Gain(k=-4.0), "clock": Clock()}
    algorithm = Algorithm("step_doubling", iterations=2, acceleration="relaxed", smallest=500_000)
    loop = couple(build, parts, ["a.y -> b.u", "b.y -> a.u"], algorithm)
    loop.initialize(0, 3 * MS)
    parts["a"].c = 3.0
    loop.advance(3 * MS)
    loop.terminate()
    assert loop.recording().signals["clock.y"].tolist() == pytest.approx([0.0, 0.001, 0.002, 0.003])
    assert "step_doubling: 3 steps did not agree after the last iteration" in " ".join(loop.notes)


@pytest.mark.parametrize("name", ["predictive", "iterative", "step_doubling"])
def test_what_a_slow_member_publishes_is_seen_from_the_next_step_on(name, build):
    """A slow clock publishes at 10, 20, 30 ms; a member that is stepped every 2 ms holds what it saw when its step began."""
    parts = {"slow": SlowClock(), "fast": Hold()}
    run = couple(build, parts, ["slow.y -> fast.u"], Algorithm(name), step=2_000_000)
    run.initialize(0, 30_000_000)
    run.advance(30_000_000)
    run.terminate()
    recorded = run.recording()
    begins = np.round(recorded.time[:-1] * 1e3).astype(int)
    assert recorded.signals["fast.y"][1:].tolist() == [begin // 10 * 0.01 for begin in begins]
