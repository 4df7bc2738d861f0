"""What couples the members of a scenario: picture, delays, costs, stability."""

from __future__ import annotations

import re
import time
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.linalg import expm

from twin import clock
from twin.cli.check import command as check
from twin.cli.graph import command as graph
from twin.cli.profile import command as profile_command
from twin.component import PythonComponent, output
from twin.coupling import Growth, growth
from twin.errors import CouplingError
from twin.run import (
    build_simulation,
    case_structure,
    check_stability,
    coupling_report,
    measure_profile,
    resolve_catalogs,
)
from twin.scenario import Backend, load_scenario, parse_scenario
from twin.structure.picture import draw

MASSES = """
title: Two masses
stop_time: 1 s
step: 10 ms
members:
  a: {component: "tests.structure.masses:Sprung"}
  b: {component: "tests.structure.masses:Free"}
connections: [a.force -> b.force, b.x -> a.other]
"""


class Slow(PythonComponent):
    """Takes its time."""

    period = 1e-2

    y = output("s", "time")

    def step(self, t, h):
        time.sleep(2e-4)
        self.y = t


@pytest.fixture
def masses(tmp_path):
    path = tmp_path / "masses.yaml"
    path.write_text(MASSES)
    return path


def described(path, build, *overrides):
    scenario = load_scenario(path, overrides)
    case = scenario.cases((), ())[0]
    simulated = build_simulation(case, resolve_catalogs(scenario)[case.variant], Backend.interpreted, build)
    try:
        return case_structure(case, simulated)
    finally:
        simulated.terminate()


def test_order_delays_and_feedthrough(masses, build):
    jacobi = described(masses, build)
    assert [part.rank for part in jacobi.parts] == [1, 1]
    assert [wire.delay for wire in jacobi.wires] == ["10 ms", "10 ms"]
    assert jacobi.parts[0].feedthrough == (("force", ("other",)),)
    assert jacobi.parts[1].feedthrough == ()
    assert jacobi.summary == "jacobi, communication step 10 ms. Delay of each connection: 10 ms."
    sequence = described(masses, build, "algorithm=gauss_seidel")
    assert [(wire.source, wire.delay) for wire in sequence.wires] == [
        ("a", "10 ms"),
        ("b", "0 s"),
    ]  # a depends on b at once
    assert [part.rank for part in sequence.parts] == [2, 1]


def test_a_loop_at_one_instant_is_told(tmp_path, build):
    path = tmp_path / "s.yaml"
    path.write_text(
        "stop_time: 1 s\nmembers: {a: {component: 'tests.coupling.parts:Gain'}, b: {component: 'tests.coupling.parts:Gain'}}\n"
        "connections: [a.y -> b.u, b.y -> a.u]\n"
    )
    found = described(path, build)
    assert [set(loop) for loop in found.loops] == [{"a.y", "b.y"}]
    assert "Solved together at each instant (algebraic loop): " in found.summary


def test_the_picture_names_what_differs(masses, tmp_path):
    target = tmp_path / "p.svg"
    done = CliRunner().invoke(graph, [str(masses), "--set", "algorithm=gauss_seidel", "-o", str(target)])
    assert done.exit_code == 0, done.output
    texts = [one.text for one in ET.parse(target).iter() if one.tag.endswith("text")]
    assert {"a", "b", "1.", "2."} <= set(texts)
    assert texts.count("10 ms") + texts.count("0 s") == 1  # of the wire that is not as most are
    assert "Two" not in done.output
    assert done.output.splitlines()[-1] == str(target)


def test_rows_of_terminals_are_one(build):
    found = described(Path("scenarios/racs.yaml"), build)
    (wire,) = (one for one in found.wires if (one.source, one.target) == ("sleeve_1", "instrument"))
    assert (wire.values, wire.texts) == (5, ["sleeve_1.grip → instrument.grip[1]"])
    (slow,) = (part for part in found.parts if part.period != found.step)
    assert (slow.name, clock.text(slow.period)) == ("tracker", "25 ms")
    assert "every 25 ms" in found.svg()


def test_a_variant_that_is_not_there(masses):
    done = CliRunner().invoke(graph, [str(masses), "--variant", "none"])
    assert "there is no variant `none`" in str(done.exception)
    done = CliRunner().invoke(graph, [str(masses), "-o", "x.png"])
    assert "only SVG can be written. Use -o x.svg" in done.output


# --- profile


def test_who_takes_longest_is_found(tmp_path, build):
    scenario = parse_scenario(
        """
        stop_time: 2 s
        members:
          slow: {component: "tests.structure.test_structure:Slow"}
          fast: {component: chirp}
          wall: {component: wall}
        connections: [fast.position -> wall.tip_position]
        events: [{at: 1 s, set: {fast.amplitude: 1 mm}}]
        """,
        tmp_path / "s.yaml",
    )
    case = scenario.cases((), ())[0]
    found = measure_profile(case, resolve_catalogs(scenario)["base"], Backend.compiled, build)
    costs = {one.name: one for one in found.costs}
    members = [one.name for one in found.costs if one.name in ("slow", "fast", "wall")]
    assert members[0] == "slow"  # on a busy machine "loop and recording" may take longer
    assert costs["slow"].step > 10 * costs["fast"].step > 0.0
    assert costs["slow"].per_tick == pytest.approx(costs["slow"].step / 10, rel=0.5)  # every tenth communication step
    assert sum(one.share for one in found.costs) == pytest.approx(1.0)
    assert found.overhead > 0.0
    assert found.sampled_steps > 200
    assert found.real_time_factor == pytest.approx(1e-3 / found.per_tick)


def test_what_cannot_be_measured_is_refused(masses):
    done = CliRunner().invoke(
        profile_command, [str(masses), "--backend", "interpreted", "--set", "algorithm=iterative"]
    )
    assert "Measure what one step costs with --set algorithm=jacobi" in str(done.exception)


# --- stability


def analytic(step: float) -> float:
    """Growth of the two masses per Jacobi step [1]: each integrated exactly, with what the other was at its begin."""
    a = np.array([[0.0, 1.0], [-1010.0, -0.1]])  # x, v of the sprung mass; stiffness of wall and coupling
    b = np.array([[0.0, 1.0], [0.0, -0.1]])

    def held(matrix: np.ndarray, effect: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        whole = np.zeros((3, 3))
        whole[:2, :2], whole[:2, 2] = matrix * step, effect * step
        found = expm(whole)
        return found[:2, :2], found[:2, 2]

    (own, other), (free, pushed) = held(a, np.array([0.0, 1000.0])), held(b, np.array([0.0, 1.0]))
    # x_a, v_a, x_b, v_b, and what was published: the force with the other's place at the begin of the step
    step_map = np.zeros((5, 5))
    step_map[:2, :2], step_map[:2, 2] = own, other
    step_map[2:4, 2:4], step_map[2:4, 4] = free, pushed
    step_map[4] = 1000.0 * (step_map[0] - np.eye(5)[2])
    return float(np.abs(np.linalg.eigvals(step_map)).max())


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("step", [1e-3, 5e-3, 2e-2])
def test_growth_is_that_of_the_exact_map(masses, step, build):
    scenario = load_scenario(masses, [f"step={step} s"])
    case = scenario.cases((), ())[0]
    simulated = build_simulation(case, resolve_catalogs(scenario)["base"], Backend.interpreted, build)
    simulated.initialize(0, case.stop_ns)
    before = {key: simulated.value(key) for key in simulated.recorded}
    found = growth(simulated)
    assert found.factor == pytest.approx(analytic(step), abs=1e-5)
    assert found.cycle == step
    assert {name.partition(".")[0] for name in found.share} <= {"a", "b"}
    assert all(np.array_equal(simulated.value(key), value) for key, value in before.items())
    simulated.terminate()


@pytest.mark.slow
def test_what_is_unstable_is_told_with_what_would_be_stable(masses, build):
    scenario = load_scenario(masses)
    case, catalog = scenario.cases((), ())[0], resolve_catalogs(scenario)["base"]
    verdict = check_stability(case, catalog, build)
    assert not verdict.is_stable
    assert verdict.model.rate == pytest.approx(-0.05, abs=0.1)  # damping / (2 mass)
    (step,) = (one for one in verdict.stable_settings if one.startswith("step: "))
    better = load_scenario(masses, [step.replace(": ", "=")]).cases((), ())[0]
    assert check_stability(better, catalog, build).is_stable


@pytest.mark.slow
def test_check_says_so(masses):
    done = CliRunner().invoke(check, [str(masses), "--stability"])
    assert done.exit_code == 1
    assert "base: jacobi at 10 ms is unstable at t = 0 s: a deviation grows 1.05" in done.output
    assert "Use step: " in done.output
    done = CliRunner().invoke(check, [str(masses), "--stability", "--set", "step=1 ms", "--set", "a.damping=100 N*s/m"])
    assert (done.exit_code, "base: jacobi at 1 ms is stable" in done.output) == (0, True)


def test_a_member_that_keeps_its_state_to_itself(tmp_path, build):
    scenario = parse_scenario(
        "stop_time: 1 s\nmembers: {a: {component: 'tests.structure.test_structure:Slow'}}\n", tmp_path / "s.yaml"
    )
    with pytest.raises(CouplingError, match="stability: a keeps its state to itself"):
        check_stability(scenario.cases((), ())[0], resolve_catalogs(scenario)["base"], build)


def test_a_picture_is_read_from_left_to_right():
    """Along the connections; one that closes a loop, or goes from a member to itself, decides nothing."""
    edges = {
        ("tip", "tip"): ["z"],
        ("drive", "tip"): ["x"],
        ("drive", "gear"): ["y"],
        ("gear", "tip"): ["y"],
        ("tip", "drive"): ["f"],
    }
    svg = draw({"drive": "A", "gear": "B", "tip": "C"}, edges)
    drive, gear, tip = (float(x) for x in re.findall(r'<rect x="([0-9.]+)"', svg))
    assert drive < gear < tip


@pytest.mark.parametrize("finest", [2, 16])
def test_growth_of_the_model_is_that_of_infinitely_short_steps(masses, build, monkeypatch, finest):
    """What the coupling adds is proportional to the step. Some members make steps no shorter than a part of it."""
    case = load_scenario(masses).cases((), ())[0]

    def linearized(own, *_):
        if own.step_ns * finest < case.step_ns:
            raise CouplingError("a member has longer steps")
        rate = -0.5 + 40.0 * own.step_ns / 1e9
        cycle = own.step_ns / 1e9
        return Growth(float(np.exp(rate * cycle)), cycle, ())

    monkeypatch.setattr(coupling_report, "linearize_case", linearized)
    coupled = linearized(case)
    found = coupling_report.model_growth(case, {}, build, 0, coupled)
    assert found.rate == pytest.approx(-0.5)
    assert coupling_report.is_growing(coupled, found, 0.1) is (coupled.rate > 0.0)
