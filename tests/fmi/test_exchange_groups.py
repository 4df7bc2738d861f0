"""A group of continuous components is one system of equations for a solver outside; its own steps stay as they were."""

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from tests.fmi.exchange_parts import Body, Gain, Spring
from tests.fmi.parts import Sampler
from tests.fmi.test_exchange import Turning
from tests.fmi.test_exchange_members import alone, distances
from twin.coupling import Connection, CoupledSystem, GroupMember, compose, declared_variables
from twin.fmi import member
from twin.fmi.exporting import exporter

MS = 1_000_000
VERSIONS = ("2.0", "3.0")


def group(name, parts, connections, outputs, slow=()):
    """Some components as one; `slow`: those that step every 2 ms."""
    made = {key: GroupMember(cls, values, MS * (1 + (key in slow))) for key, (cls, values) in parts.items()}
    catalog = {key: declared_variables(part.component) for key, part in made.items()}
    links = CoupledSystem(catalog, connections).links()
    return compose(name, made, links, MS, [list(made)], outputs)


PAIR = {"a": (Body, {"place": 1e-3}), "b": (Body, {"mass": 2.0}), "spring": (Spring, {})}
LINKS = [
    *(Connection(f"{one}.{of}", f"spring.{of}{one}") for one in ("a", "b") for of in ("x", "v")),
    Connection("spring.f", "b.f"),
    Connection("spring.f", "a.f", factor=-1.0),
]
PLACES = [("a", "x"), ("b", "x")]


@pytest.fixture(scope="module", params=VERSIONS)
def pair(request, build):
    return exporter.build(group("coupled_pair", PAIR, LINKS, PLACES), request.param, build / "tests")


@pytest.mark.slow_repetitions
def test_others_solve_it(pair):
    assert validate_fmu(str(pair)) == []
    options = {"stop_time": 0.01, "output_interval": 0.001}
    found = simulate_fmu(str(pair), fmi_type="ModelExchange", relative_tolerance=1e-9, **options)
    assert found["a.x"] - found["b.x"] == pytest.approx(distances(found["time"]), abs=1e-9)


@pytest.mark.slow_repetitions
def test_so_do_we(pair):
    times, found, _ = alone(pair, 0.01, 0.001, interface="model_exchange", tolerance=1e-9)
    assert found["a.x"] - found["b.x"] == pytest.approx(distances(times), abs=1e-11)


@pytest.mark.slow
def test_its_directional_derivatives_are_those_of_the_whole(pair):
    one = member("one", pair, {"spring.damping": 300.0}, interface="model_exchange")
    one.instantiate()
    one.enter_initialization(0.0, None)
    one.exit_initialization()
    try:
        system = one.system
        jacobian = system.solver.equations.jacobian(0.0, system.y)
        differences = np.empty_like(jacobian)
        for i, scale in enumerate(np.eye(len(system.y)) * 1e-3):
            ahead, behind = (system.differentiate(0.0, system.y + sign * scale) for sign in (1, -1))
            differences[:, i] = (ahead - behind) / 2e-3
        assert jacobian == pytest.approx(differences, rel=1e-6, abs=1e-3)
        assert np.count_nonzero(jacobian) >= 10
    finally:
        one.close()


@pytest.mark.slow
def test_its_names_and_events_are_those_of_its_members(build):
    parts = {"gain": (Gain, {}), "turning": (Turning, {})}
    path = exporter.build(group("turning_group", parts, [], [("gain", "y"), ("turning", "y")]), "3.0", build / "tests")
    described = read_model_description(str(path))
    assert [one.variable.name for one in described.derivatives] == ["der(gain.mean)", "der(turning.x)"]
    assert [one.variable.name for one in described.eventIndicators] == ["turning.over", "turning.gaps"]
    assert described.coSimulation.providesIntermediateUpdate is False
    assert validate_fmu(str(path)) == []


RING = [Connection("a.y", "b.u"), Connection("b.y", "a.u")]


@pytest.mark.parametrize(
    ("parts", "links", "slow"),
    [
        ({"a": (Gain, {}), "b": (Gain, {})}, RING, ()),
        ({"a": (Gain, {}), "b": (Sampler, {})}, [], ()),
        ({"a": (Gain, {}), "b": (Gain, {})}, RING[:1], ("b",)),
    ],
    ids=["algebraic loop", "sampled member", "slow member"],
)
def test_what_has_no_equations_at_one_point_offers_its_ticks_alone(parts, links, slow):
    made = group("others", parts, links, [("a", "y")], slow)
    assert b"ContinuousStateDerivative" not in exporter.plan(made, "3.0").files["modelDescription.xml"]
