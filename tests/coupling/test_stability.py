"""How fast a deviation grows in a coupling with FMUs of others: as it does with components of the same equations."""

import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from tests.fmi.third_party import archive, native_library
from tests.structure.masses import Free, Sprung
from twin import compiler
from twin.cli.check import command as check
from twin.coupling import Connection, CoSimulation, CoupledSystem, RecordMember, growth
from twin.errors import CouplingError
from twin.fmi import FMUMember

MS = 1_000_000

MASS = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Mass" guid="mass">
<CoSimulation modelIdentifier="Mass" canHandleVariableCommunicationStepSize="true" {offers}/>
<ModelVariables>
  <ScalarVariable name="x" valueReference="0" causality="output" initial="exact"><Real start="0" unit="m"/></ScalarVariable>
  <ScalarVariable name="v" valueReference="1" initial="exact"><Real start="0" unit="m/s"/></ScalarVariable>
  <ScalarVariable name="der(x)" valueReference="2"><Real derivative="1"/></ScalarVariable>
  <ScalarVariable name="der(v)" valueReference="3"><Real derivative="2"/></ScalarVariable>
  <ScalarVariable name="force" valueReference="4" causality="input"><Real start="0" unit="N"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="1" dependencies=""/></Outputs>
  <Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives></ModelStructure>
</fmiModelDescription>
"""

# the same mass; explicit Euler in ten steps is near enough
PYTHON_2 = """
from pythonfmu.fmi2slave import Fmi2Slave, Fmi2Causality as C, Fmi2Variability as V, Real

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.force, self.x, self.v = 0.0, 0.0, 0.0
        self.register_variable(Real("force", causality=C.input, variability=V.continuous))
        self.register_variable(Real("x", causality=C.output, variability=V.continuous))
        self.register_variable(Real("v", causality=C.output, variability=V.continuous))

    def do_step(self, t, h):
        for _ in range(10):
            self.x += h / 10 * self.v
            self.v += h / 10 * (self.force - 0.1 * self.v)
        return True
"""

PYTHON_3 = PYTHON_2.replace("pythonfmu.fmi2slave", "pythonfmu3").replace("Fmi2", "Fmi3").replace("Real", "Float64")
PYTHON_3 = PYTHON_3.replace(
    "        self.force,",
    "        self.time = 0.0\n"
    '        self.register_variable(Float64("time", causality=C.independent, variability=V.continuous))\n'
    "        self.force,",
)

OFFERS = {
    "state": 'canGetAndSetFMUstate="true"',
    "derivatives": 'providesDirectionalDerivative="true"',
    "nothing": "",
}


@pytest.fixture(scope="module")
def masses(tmp_path_factory):
    """FMUs of a mass, by what they offer."""
    folder = tmp_path_factory.mktemp("masses")
    library = native_library((Path(__file__).with_name("mass.c")).read_text())
    found = {}
    for name, offers in OFFERS.items():
        files = {"modelDescription.xml": MASS.format(offers=offers).encode(), "binaries/linux64/Mass.so": library}
        found[name] = archive(folder / f"{name}.fmu", files)
    for package, source in (("pythonfmu", PYTHON_2), ("pythonfmu3", PYTHON_3)):
        name = f"Mass_{package}"
        (folder / f"{name.lower()}.py").write_text(source.format(name=name))
        call = [sys.executable, "-m", package, "build", "-f", folder / f"{name.lower()}.py", "-d", folder]
        subprocess.run([*call, "--handle-state"], check=True, capture_output=True)
        found[package] = folder / f"{name}.fmu"
    return found


def coupled(build, other, step, algorithm="jacobi", at=0, periods=None):
    """The growth with the sprung mass; `other`: an FMU, or None for the component."""

    def record(name, cls):
        return RecordMember(name, cls(), compiler.load_component(cls, build))

    members = {"a": record("a", Sprung), "b": record("b", Free) if other is None else FMUMember("b", other)}
    catalog = {name: one.variables for name, one in members.items()}
    links = CoupledSystem(catalog, [Connection("a.force", "b.force"), Connection("b.x", "a.other")]).links()
    simulated = CoSimulation(members, links, step, algorithm, build=build, periods=periods)
    try:
        simulated.initialize(0, 1000 * MS)
        if at:
            simulated.advance(at)
        before = {key: simulated.value(key) for key in simulated.recorded}
        found = growth(simulated)
        assert {key: simulated.value(key) for key in simulated.recorded} == before
        simulated.advance(at + 100 * MS)  # and it goes on as if nothing had been
        return found, simulated.value(("a", "x"))
    finally:
        simulated.terminate()


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("offer", ["state", "derivatives"])
@pytest.mark.parametrize(
    ("algorithm", "step", "more"),
    [
        ("jacobi", MS, {}),
        ("jacobi", 20 * MS, {}),
        ("gauss_seidel", 10 * MS, {}),
        ("gauss_seidel", MS, {"at": 50 * MS, "periods": {"b": 5 * MS}}),
    ],
    ids=str,
)
def test_growth_is_that_of_components(offer, algorithm, step, more, masses, build):
    ours, x = coupled(build, None, step, algorithm, **more)
    theirs, same = coupled(build, masses[offer], step, algorithm, **more)
    assert theirs.factor == pytest.approx(ours.factor, abs=1e-5)
    assert theirs.cycle == ours.cycle
    assert same == pytest.approx(x, rel=1e-9)
    assert {name.partition(".")[0] for name in theirs.share} <= {"a", "b"}


def test_also_with_an_algorithm_that_goes_back(masses, build):
    ours, _ = coupled(build, None, 10 * MS, "iterative")
    theirs, _ = coupled(build, masses["state"], 10 * MS, "iterative")
    assert theirs.factor == pytest.approx(ours.factor, abs=1e-5)
    with pytest.raises(CouplingError, match="stability: step_doubling chooses the length of its steps, and b shows"):
        coupled(build, masses["state"], 10 * MS, "step_doubling")


@pytest.mark.parametrize("package", ["pythonfmu", "pythonfmu3"])
def test_with_fmus_that_others_built(package, masses, build):
    ours, _ = coupled(build, None, 20 * MS)
    theirs, _ = coupled(build, masses[package], 20 * MS)
    assert theirs.factor == pytest.approx(ours.factor, abs=4e-3)  # by explicit Euler


def test_one_that_offers_nothing_is_named(masses, build):
    with pytest.raises(CouplingError, match=r"stability: b keeps its state to itself, .* Export it with its state"):
        coupled(build, masses["nothing"], MS)


@pytest.mark.slow
def test_check_proposes_a_step(masses, tmp_path):
    (tmp_path / "s.yaml").write_text(
        "stop_time: 10 ms\nstep: 1.25 ms\nmembers:\n  a: {component: 'tests.structure.masses:Sprung'}\n"
        f"  b: {{component: {masses['state']}}}\nconnections: [a.force -> b.force, b.x -> a.other]\n"
    )
    done = CliRunner().invoke(check, [str(tmp_path / "s.yaml"), "--stability"])
    assert done.exit_code == 1
    assert "jacobi at 1.25 ms is unstable at t = " in done.output
    assert "a deviation grows 1.001 times in 1.25 ms, mostly a." in done.output
    assert "Use step: 312.5 us or algorithm: {name: iterative, order: 1}" in done.output


@pytest.mark.slow
def test_slow_growth_counts_in_a_long_run(tmp_path):
    """A spring that a mass feels a step late adds energy: in steps of 0.625 ms some 0.05 / s, 16 times in 60 s."""
    (tmp_path / "s.yaml").write_text(
        "stop_time: 60 s\nstep: 625 us\nmembers:\n"
        "  mass: {component: 'tests.fmi.exchange_parts:Body'}\n"
        "  spring: {component: 'tests.fmi.exchange_parts:Spring', parameters: {stiffness: 100.0, damping: 0.0}}\n"
        "connections:\n  - {from: mass.x, to: spring.xb}\n  - {from: spring.f, to: mass.f}\n"
    )
    done = CliRunner().invoke(check, [str(tmp_path / "s.yaml"), "--stability"])
    assert "jacobi at 625 us is unstable at t = 0 s: a deviation grows 1.0000" in done.output
    short = CliRunner().invoke(check, [str(tmp_path / "s.yaml"), "--stability", "--set", "stop_time=1 s"])
    assert "jacobi at 625 us is stable" in short.output
