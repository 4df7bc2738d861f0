"""Algorithms that repeat steps, and members that end them early, cannot go back, or say that they can."""

import pytest

from tests.coupling.mock import Liar, Mock
from tests.coupling.parts import Bomb, Hold, Lag, couple
from tests.coupling.test_algorithms import MS
from twin.coupling import Algorithm, Connection, CoSimulation, CoupledSystem
from twin.errors import CouplingError, SimulationError


def pair(build, mock, algorithm, stop=20 * MS, wires=("a.y -> b.u",), periods=None):
    """A lag that drives a mock, run to the end."""
    lag = couple(build, {"a": Lag(x=1.0)}, []).members["a"]
    members = {"a": lag, "b": mock}
    system = CoupledSystem(
        {n: m.variables for n, m in members.items()}, [Connection(*one.split(" -> ")) for one in wires]
    )
    run = CoSimulation(members, system.links(), 4 * MS, algorithm, build=build, periods=periods)
    try:
        run.initialize(0, stop)
        run.advance(stop)
    finally:
        run.terminate()
    return run


@pytest.mark.parametrize("kind", ["early", "discards"])
@pytest.mark.parametrize("name", ["iterative", "step_doubling", "predictive"])
def test_all_go_to_where_one_came(kind, name, build):
    mock = Mock("b", **{kind: [0.0065, 0.0125]})
    run = pair(build, mock, Algorithm(name))
    assert run.time == 20 * MS
    ends = {round(t + h, 9) for t, h in mock.steps}
    assert {0.0065, 0.0125} <= ends
    assert run.recording().signals["b.t"][-1] == pytest.approx(0.02)
    assert run.recording().time.tolist() == [0.0, 0.004, 0.008, 0.012, 0.016, 0.02]


@pytest.mark.parametrize("kind", ["early", "discards"])
def test_fixed_steps_say_that_one_came_back_early(kind, build):
    mock = Mock("b", **{kind: [0.0065]})
    for algorithm in ("jacobi", "gauss_seidel", Algorithm("jacobi", order=1)):
        with pytest.raises(
            SimulationError,
            match=r"b: went to t = 6.5 ms only in the step from t = 4 ms, and .* makes whole steps. Use .*iterative",
        ):
            pair(build, mock, algorithm)


@pytest.mark.parametrize("kind", ["early", "discards"])
def test_one_with_a_period_does_not_make_others_go_back(kind, build):
    expected = r"b: went to t = 10 ms only in the step from t = 8 ms, and its period is to be made in whole"
    with pytest.raises(SimulationError, match=expected):
        pair(build, Mock("b", **{kind: [0.010]}), Algorithm("iterative"), stop=24 * MS, periods={"b": 8 * MS})


def test_who_wants_to_end_the_run_ends_it_where_it_wants(build):
    run = pair(build, Mock("b", ends=0.010), Algorithm("predictive", smallest=1 * MS))
    assert run.finished
    assert run.failure == "b ended the simulation at 10 ms", "shorter steps meet it"
    run = pair(build, Mock("b", early=[0.010], ends=0.010), Algorithm("iterative"))
    assert run.failure == "b ended the simulation at 10 ms"
    assert run.recording().time.tolist() == [0.0, 0.004, 0.008]


def test_a_step_that_was_taken_back_is_not_in_the_log(build):
    mock = Mock("b", talks=True)
    wires = ("a.y -> b.u", "b.y -> a.u")
    algorithm = Algorithm("step_doubling", tolerance=1e-4)
    pair(build, mock, algorithm, wires=wires)
    ends = [line for line in mock.log if line.startswith("step")]
    begins = [float(line.split()[2]) for line in ends]
    assert begins == sorted(set(begins)), "one line for each step that stayed"
    assert len(begins) < len(mock.steps)


def test_a_step_that_is_too_long_for_a_member_is_shortened(build):
    mock = Mock("b", longest=0.0011)
    run = pair(build, mock, Algorithm("step_doubling", tolerance=0.5))
    assert run.time == 20 * MS
    with pytest.raises(SimulationError, match="b: failed with ERROR in the step from t = 0 s"):
        pair(build, Mock("b", longest=0.0011), Algorithm("iterative"))


def test_a_step_that_is_too_short_for_a_member_is_told(build):
    mock = Mock("b", shortest=0.9e-3)
    run = pair(build, mock, Algorithm("predictive", tolerance=1e-9), wires=("a.y -> b.u", "b.y -> a.u"))
    assert any("b makes no steps shorter than 1 ms" in note for note in run.notes)


def test_who_cannot_go_back_is_named_with_the_alternatives(build):
    parts = {"lag": Lag(), "bomb": Bomb(), "hold": Hold()}
    for name in ("iterative", "step_doubling", "predictive"):
        with pytest.raises(
            CouplingError, match=rf"bomb: cannot go back .* which {name} needs. Use jacobi, gauss_seidel"
        ):
            couple(build, parts, ["lag.y -> bomb.u"], Algorithm(name))


def test_who_says_that_it_goes_back_is_tried(build):
    with pytest.raises(CouplingError, match=r"b: says that it can go back .* and cannot: y is 0\..* Use jacobi"):
        pair(build, Liar("b"), Algorithm("iterative"))
