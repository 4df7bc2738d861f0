"""FMUs that somebody else's builder made, with algorithms that take their steps back."""

import subprocess
import sys

import numpy as np
import pytest

from tests.coupling.mock import Mock
from tests.coupling.parts import Lag, couple
from twin.cli.check import check_file
from twin.coupling import Algorithm, Connection, CoSimulation, CoupledSystem, IsolatedMember
from twin.errors import CouplingError
from twin.fmi import FMUMember

MS = 1_000_000

# y follows u with a time constant of 0.1 s, by explicit Euler, as the mock does; its state may be hidden from PythonFMU
SOURCE = """
from pythonfmu.fmi2slave import Fmi2Slave, Fmi2Causality as C, Fmi2Variability as V, Real

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.y, self.hidden = 0.0, 0.0, 0.0
        self.register_variable(Real("u", causality=C.input, variability=V.continuous))
        self.register_variable(Real("y", causality=C.output, variability=V.continuous))

    def do_step(self, t, h):
        self.{state} += h / 0.1 * (self.u - self.{state})
        self.y = self.{state}
        return True
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """FMUs that say that they can save their state: one that does, one that leaves out what nobody registered."""
    folder = tmp_path_factory.mktemp("foreign")
    for name, state in (("KeepsAll", "y"), ("ForgetsSome", "hidden")):
        (folder / f"{name.lower()}.py").write_text(SOURCE.format(name=name, state=state))
        call = [sys.executable, "-m", "pythonfmu", "build", "-f", folder / f"{name.lower()}.py", "-d", folder]
        subprocess.run([*call, "--handle-state"], check=True, capture_output=True)
    return folder


def run(member, algorithm, build):
    """A lag and a member that feed each other; what both are at the end."""
    lag = couple(build, {"lag": Lag(x=1.0)}, []).members["lag"]
    members = {"lag": lag, "other": member}
    catalog = {name: one.variables for name, one in members.items()}
    links = CoupledSystem(
        catalog, [Connection("lag.y", "other.u", convert=False), Connection("other.y", "lag.u", convert=False)]
    )
    simulated = CoSimulation(members, links.links(), 4 * MS, algorithm, build=build)
    try:
        simulated.initialize(0, 100 * MS)
        simulated.advance(100 * MS)
    finally:
        simulated.terminate()
    recorded = simulated.recording().signals
    return np.array([recorded["lag.y"], recorded["other.y"]])


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    "algorithm",
    [
        Algorithm("iterative", acceleration="newton", order=1),
        Algorithm("step_doubling", order=1, tolerance=1e-4),
        Algorithm("predictive", order=1),
    ],
    ids=str,
)
def test_one_that_keeps_its_state_goes_back(algorithm, built, build):
    theirs = run(FMUMember("other", built / "KeepsAll.fmu"), algorithm, build)
    ours = run(Mock("other"), algorithm, build)
    np.testing.assert_allclose(theirs, ours, rtol=1e-9, atol=1e-12)


def test_one_that_says_so_and_does_not_is_named(built, build, tmp_path):
    with pytest.raises(
        CouplingError, match=r"other: says that it can go back .*, and cannot: y is .* Use jacobi, gauss"
    ):
        run(FMUMember("other", built / "ForgetsSome.fmu"), Algorithm("iterative"), build)
    (tmp_path / "s.yaml").write_text(
        "stop_time: 20 ms\nalgorithm: iterative\nmembers:\n"
        f"  good: {{component: {built}/KeepsAll.fmu}}\n  bad: {{component: {built}/ForgetsSome.fmu}}\n"
        "connections: [good.y -> bad.u]\n"
    )
    problems, _ = check_file(str(tmp_path / "s.yaml"))
    assert len(problems) == 1
    assert "s.yaml:5: bad: says that it can go back" in problems[0]


@pytest.mark.slow
def test_one_in_a_process_of_its_own_goes_back(built, build):
    algorithm = Algorithm("iterative", order=1)
    alone = run(IsolatedMember(FMUMember("other", built / "KeepsAll.fmu"), build), algorithm, build)
    np.testing.assert_array_equal(alone, run(FMUMember("other", built / "KeepsAll.fmu"), algorithm, build))
