"""Members with clocks in processes of their own: the same values, whatever the algorithm, and an end that is told."""

import os
import signal

import numpy as np
import pytest

from tests.fmi.clock_parts import clocks_fmu
from twin.coupling import Algorithm, Connection, CoSimulation, CoupledSystem, IsolatedMember
from twin.errors import SimulationError
from twin.fmi import member

MS = 1_000_000
TICKING = {"k": "Kinds", "f": "Follower"}, ["k.every_second -> f.tick", "k.x -> f.u"]
TALKING = {"m": "Node", "n": "Node"}, ["m.sent -> n.take", "m.message -> n.taken"]
SCHEDULED = {"p": "Partitions", "q": "Partitions"}, ["p.fifth -> q.second", "p.made -> q.given"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("isolated")


@pytest.fixture(scope="module")
def made(folder, build):
    """A co-simulation, some of its members in processes of their own."""

    def make(system, isolated=(), step=50 * MS, algorithm="jacobi", starts=None):
        parts, wires = system
        members = {
            name: member(name, clocks_fmu(folder, part), (starts or {}).get(name)) for name, part in parts.items()
        }
        members = {name: IsolatedMember(one, build) if name in isolated else one for name, one in members.items()}
        links = CoupledSystem(
            {name: one.variables for name, one in members.items()}, [Connection(*one.split(" -> ")) for one in wires]
        ).links()
        return CoSimulation(members, links, step, algorithm, build=build)

    return make


def ran(system, stop, act=None):
    try:
        system.initialize(0, stop)
        if act:
            system.advance(stop // 2)
            act(system)
        system.advance(stop)
        return system.recording().signals
    finally:
        system.terminate()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "stop", "options"),
    [
        pytest.param(TICKING, 1000 * MS, {}, marks=pytest.mark.slow),
        (TICKING, 1000 * MS, {"step": 40 * MS}),  # ticks cut the steps, as they do not with 50 ms
        (TICKING, 1000 * MS, {"algorithm": Algorithm("step_doubling", order=1)}),
        pytest.param(TALKING, 1000 * MS, {"step": 100 * MS, "starts": {"m": {"address": 7}}}, marks=pytest.mark.slow),
        (SCHEDULED, 6000 * MS, {"step": 1000 * MS}),
    ],
    ids=["ticks", "cut", "back", "binary", "scheduled"],
)
def test_the_same_to_the_bit(made, system, stop, options):
    alone = ran(made(system, **options), stop)
    for isolated in (list(system[0]), list(system[0])[:1]):
        apart = ran(made(system, isolated, **options), stop)
        assert alone.keys() == apart.keys()
        assert all(np.array_equal(alone[name], apart[name]) for name in alone), isolated
    assert any(len(np.unique(one)) > 2 for one in alone.values())


@pytest.mark.slow
def test_what_is_set_by_hand_comes_there(made):
    found = ran(made(TICKING, ["k"]), 500 * MS, lambda one: one.set(("k", "triggered"), value=True))
    assert found["k.triggered_count"][[0, -1]].tolist() == [0, 1]


@pytest.mark.slow
def test_a_process_that_ends_is_told(made):
    def kill(system):
        os.kill(system.members["k"]._process.pid, signal.SIGKILL)

    with pytest.raises(SimulationError, match=r"k: was killed \(SIGKILL\) by another process.* in fmi3DoStep"):
        ran(made(TICKING, ["k"]), 500 * MS, kill)
