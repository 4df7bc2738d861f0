"""Steps by the energy that power bonds lose (ECCO): how exact, how it steers, what it needs and what it does not."""

import numpy as np
import pytest

from benchmarks.couplings import Answering, Mass
from tests.coupling.parts import Bomb
from tests.coupling.test_algorithms import MS, STOP, exact
from twin import compiler
from twin.coupling import Algorithm, Connection, CoSimulation, CoupledSystem, RecordMember
from twin.errors import CouplingError, SimulationError

ENDS = (("a.x", "b.other_x"), ("a.v", "b.other_v"), ("b.force", "a.f"))
SIGNALS = [("a", "x"), ("b", "x"), ("a", "v"), ("b", "force")]


def coupled(build, algorithm, step=32 * MS, bond="spring", parts=None, ends=ENDS, every=0):
    parts = parts or {"a": Mass(begin=0.01), "b": Answering()}
    members = {name: RecordMember(name, one, compiler.load_component(type(one), build)) for name, one in parts.items()}
    links = CoupledSystem(
        {name: one.variables for name, one in members.items()}, [Connection(*one, bond=bond) for one in ends]
    ).links()
    return CoSimulation(members, links, step, algorithm, build=build, record=SIGNALS, every=every)


def ran(system, stop=STOP):
    try:
        system.initialize(0, stop)
        system.advance(stop)
        return system.recording().signals
    finally:
        system.terminate()


def lost(signals, step, order=0):
    """Energy that the bond made or lost in each step of one length [J], from what was recorded."""
    v, f = signals["a.v"], signals["b.force"]
    fed = [one[:-1] if order == 0 else np.append(one[0], 2 * one[1:-1] - one[:-2]) for one in (v, f)]
    return (fed[1] * v[1:] - f[1:] * fed[0]) * step / 1e9


@pytest.mark.parametrize("order", [0, 1])
def test_it_looks_at_the_energy_that_a_fixed_step_loses(build, order):
    system = coupled(build, Algorithm("ecco", order=order, smallest=4 * MS), step=4 * MS)  # no other step is allowed
    found, residuals = [], []
    system.initialize(0, STOP)
    for k in range(1, STOP // (4 * MS) + 1):
        system.advance(4 * k * MS)
        residuals.append(float(system.state["residual"]))
    found = lost(system.recording().signals, 4 * MS, order)
    v, f = (system.recording().signals[name] for name in ("a.v", "b.force"))
    system.terminate()
    fed = [one[:-1] if order == 0 else np.append(one[0], 2 * one[1:-1] - one[:-2]) for one in (v, f)]
    went = np.cumsum((fed[1] * v[1:] + f[1:] * fed[0]) / 2 * 4e-3)
    largest = np.maximum.accumulate(np.abs(went))
    assert residuals == pytest.approx((np.abs(found) / (1e-3 * largest)).tolist(), rel=1e-9)


@pytest.mark.parametrize(("order", "power"), [(0, 1 / 2), (1, 1 / 3)])
def test_steps_and_errors_follow_the_tolerance(build, order, power):
    """Lost in a step is h^(2 + order): so many more steps, and an error of order 1 or 2 in the step."""
    steps, errors = [], []
    for tolerance in (1e-2, 1e-4):
        system = coupled(build, Algorithm("ecco", order=order, tolerance=tolerance), every=STOP)
        signals = ran(system)
        end = np.array([signals["a.x"][-1], signals["b.x"][-1]])
        steps.append(int(system.state["sweeps"]))
        errors.append(np.abs(end - exact(STOP)).max() / 0.01)
        assert not system.notes
    assert np.log(steps[1] / steps[0]) / np.log(100) == pytest.approx(power, abs=0.12)
    assert errors[1] < 0.4 * errors[0] < 0.04


def test_it_spends_steps_where_energy_is_lost(build):
    """The same number of steps of one length lose more in the worst of them."""
    system = coupled(build, Algorithm("ecco", order=0, tolerance=1e-3), step=16 * MS)
    system.initialize(0, 512 * MS)
    worst, taken = 0.0, 0
    while system.time < 512 * MS:
        system.advance(system.time + 16 * MS)
        worst, taken = max(worst, float(system.state["residual"])), int(system.state["sweeps"])
    system.terminate()
    assert system.state["rejected"] == 0, "nothing is taken back"
    assert 100 < taken < 2000
    fixed = ran(coupled(build, "jacobi", step=MS // 2), 512 * MS)  # as many and more
    assert taken < 1024
    settled = np.abs(lost(fixed, MS // 2))
    assert settled.max() / np.median(settled) > 3
    assert worst < 3.0


def test_a_longer_quiet_time_has_longer_steps(build):
    parts = {"a": Mass(begin=0.01, d=20.0), "b": Answering(d=20.0)}
    system = coupled(build, Algorithm("ecco", tolerance=1e-3), parts=parts, every=64 * MS)
    system.initialize(0, 1024 * MS)
    sweeps = []
    for k in range(1, 17):
        system.advance(64 * k * MS)
        sweeps.append(int(system.state["sweeps"]))
    system.terminate()
    used = np.diff([0, *sweeps])
    assert used[-1] == 2, "the longest, when all has come to rest"
    assert used[0] > 10 * used[-1]


def test_who_cannot_go_back_takes_part(build):
    members = {
        "a": RecordMember("a", Mass(begin=0.01), compiler.load_component(Mass, build)),
        "b": RecordMember("b", Answering(), compiler.load_component(Answering, build)),
    }
    for one in members.values():
        one.has_fmu_state = one.has_cheap_fmu_state = False
    links = CoupledSystem(
        {n: m.variables for n, m in members.items()}, [Connection(*one, bond="s") for one in ENDS]
    ).links()
    system = CoSimulation(members, links, 32 * MS, Algorithm("ecco"), build=build, record=SIGNALS)
    assert np.isfinite(ran(system)["a.x"]).all()


def test_without_a_bond_it_says_so(build):
    system = coupled(build, Algorithm("ecco"), bond="")
    (note,) = system.notes
    assert note.startswith(
        "ecco: no connection is a power bond, so all steps are the longest. Write `bond: name` at a force"
    )
    ran(system)
    assert system.state["sweeps"] == STOP // (32 * MS)


def test_a_place_instead_of_a_velocity_is_refused(build):
    with pytest.raises(CouplingError, match="bond spring: has a force and a place, but no velocity"):
        coupled(build, Algorithm("ecco"), ends=(ENDS[0], ENDS[2]))


@pytest.mark.parametrize(("option", "value"), [("tolerance", 0.0), ("smallest", 0), ("correction", 2.0)])
def test_options_have_ranges(option, value):
    with pytest.raises(CouplingError, match=f"algorithm: {option} of ecco is"):
        Algorithm("ecco", **{option: value})


def test_what_fails_is_not_tried_again(build):
    bomb = Bomb()
    parts = {"a": Mass(begin=0.01), "b": Answering()}
    members = {name: RecordMember(name, one, compiler.load_component(type(one), build)) for name, one in parts.items()}
    members["bomb"] = RecordMember("bomb", bomb)
    links = CoupledSystem(
        {n: m.variables for n, m in members.items()}, [Connection(*one, bond="s") for one in ENDS]
    ).links()
    system = CoSimulation(members, links, 32 * MS, Algorithm("ecco"), build=build, record=SIGNALS)
    with pytest.raises(SimulationError, match="bomb: failed"):
        ran(system)
    assert system.state["rejected"] == 0
