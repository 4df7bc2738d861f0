"""Third-party FMUs are followed as components are, if they save their state; those that do not are named before anything starts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.fmi.third_party import archive, native_library
from tests.follow import parts
from tests.follow.test_follow import MU, recording, write
from twin.component import Component, input, output, parameter, solver, state
from twin.errors import ScenarioError, SimulationError
from twin.fmi import exporter
from twin.follow import Follower, follow, load
from twin.follow.problem import times_of

STATE = {"2.0": "canGetAndSetFMUstate", "3.0": "canGetAndSetFMUState"}
XML = {
    "2.0": """<fmiModelDescription fmiVersion="2.0" modelName="Oscillator" guid="oscillator">
<CoSimulation modelIdentifier="Oscillator" canHandleVariableCommunicationStepSize="true" STATE="true"/>
<ModelVariables>
<ScalarVariable name="u" valueReference="1" causality="input"><Real start="0" unit="m/s2"/></ScalarVariable>
<ScalarVariable name="y" valueReference="2" causality="output"><Real unit="m"/></ScalarVariable>
<ScalarVariable name="mu" valueReference="3" causality="parameter" variability="tunable"><Real start="1" unit="1/s"/></ScalarVariable>
<ScalarVariable name="x0" valueReference="4" causality="parameter" variability="fixed"><Real start="1" unit="m"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>""",
    "3.0": """<fmiModelDescription fmiVersion="3.0" modelName="Oscillator" instantiationToken="oscillator">
<CoSimulation modelIdentifier="Oscillator" canHandleVariableCommunicationStepSize="true" STATE="true"/>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Float64 name="u" valueReference="1" causality="input" start="0" unit="m/s2"/>
<Float64 name="y" valueReference="2" causality="output" unit="m"/>
<Float64 name="mu" valueReference="3" causality="parameter" variability="tunable" start="1" unit="1/s"/>
<Float64 name="x0" valueReference="4" causality="parameter" variability="fixed" start="1" unit="m"/>
</ModelVariables>
<ModelStructure><Output valueReference="2"/></ModelStructure>
</fmiModelDescription>""",
}
PLACES = {"2.0": "binaries/linux64/Oscillator.so", "3.0": "binaries/x86_64-linux/Oscillator.so"}


def foreign(folder, version, attribute=None, forgets=0):
    """An FMU from C, as other tools write them."""
    source = f"#define FORGETS {forgets}\n" + (Path(__file__).with_name("oscillator.c").read_text())
    xml = XML[version].replace("STATE", STATE[version] if attribute is None else attribute)
    files = {"modelDescription.xml": xml.encode(), PLACES[version]: native_library(source)}
    return archive(folder / "Oscillator.fmu", files)


class Euler(Component):
    """The oscillator of the FMU from C."""

    method = solver.euler(1e-3)

    u = input("m/s2", "force per mass", start=0.0)
    mu = parameter(1.0, "1/s", "damping")
    y = output("m", "position")
    x0 = parameter(1.0, "m", "position at the start", fixed=True)
    x = state(0.0, "m", "position")
    v = state(0.0, "m/s", "velocity")

    def initialize(self):
        self.x = self.x0

    def derivatives(self, t):
        self.der_x = self.v
        self.der_v = self.mu * (1.0 - self.x * self.x) * self.v - self.x + self.u
        self.y = self.x


MODEL = """
stop_time: 30 s
step: 10 ms
members:
  oscillator: {component: "COMPONENT"}
  sampler: {component: "tests.follow.parts:Sampler"}
connections: [oscillator.y -> sampler.u]
"""
FOLLOWED = """
scenario: model.yaml
data: data.csv
inputs: {"force [m/s2]": oscillator.u}
outputs:
  "position [mm]": {signal: SIGNAL, noise: 20 mm}
estimate:
  oscillator.mu: {start: 1.0, deviation: 0.5, walk: 0.02, from: 0, to: 5}
"""


def problem_of(folder, component, rows, text=FOLLOWED, signal="oscillator.y"):
    folder.mkdir(exist_ok=True)
    (folder / "model.yaml").write_text(MODEL.replace("COMPONENT", str(component)))
    return load(write(folder, rows, text.replace("SIGNAL", signal)))


def assert_equal(estimates, others):
    assert len(estimates) == len(others) > 50
    for one, other in zip(estimates, others, strict=True):
        assert np.array_equal(one.values, other.values)
        assert np.array_equal(one.covariance, other.covariance)
        assert one.nis == other.nis


@pytest.mark.slow
@pytest.mark.parametrize("signal", ["oscillator.y", "sampler.y"])
@pytest.mark.parametrize("method", ["unscented", "{name: ensemble, size: 7, seed: 1}"])
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_an_own_fmu_gives_the_estimates_of_its_component_to_the_bit(tmp_path, build, version, method, signal):
    rows, _ = recording(4, count=100)
    text = f"{FOLLOWED}method: {method}\n"
    path = exporter.build(parts.VanDerPol, version, build / "tests")
    found = list(follow(problem_of(tmp_path / "fmu", path, rows, text, signal), build))
    component = "tests.follow.parts:VanDerPol"
    assert_equal(found, list(follow(problem_of(tmp_path / "own", component, rows, text, signal), build)))
    assert signal == "sampler.y" or found[-1].deviations[0] < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_foreign_fmu_gives_the_estimates_of_the_same_component(tmp_path, build, version):
    rows, _ = recording(4)
    text = f"{FOLLOWED}method: {{name: ensemble, size: 30, seed: 1}}\nset: {{oscillator.x0: {rows[0][2]} mm}}\n"
    found = list(follow(problem_of(tmp_path / "fmu", foreign(tmp_path, version), rows, text), build))
    wanted = list(follow(problem_of(tmp_path / "own", "tests.follow.test_fmus:Euler", rows, text), build))
    assert len(found) == len(wanted) == 400
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_allclose(one.values, other.values, rtol=1e-9)  # another compiler rounds otherwise
    assert abs(found[-1].values[0] - 1.7) < 3.0 * found[-1].deviations[0] < 0.6


STATES = """  oscillator.x: {start: 0.8 m, deviation: 0.3 m, walk: 1 mm}
  oscillator.v: {start: 0, deviation: 0.3, walk: 0.001}
"""


@pytest.mark.slow
@pytest.mark.parametrize("signal", ["oscillator.y", "sampler.y"])
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_states_of_an_fmu_are_estimated_by_initializing_it_anew(tmp_path, build, version, signal):
    rows, _ = recording(4, count=200)
    text = FOLLOWED + STATES + ("" if signal == "oscillator.y" else "method: {name: ensemble, size: 7}\n")
    path = exporter.build(parts.VanDerPol, version, build / "tests")
    problem = problem_of(tmp_path / "fmu", path, rows, text, signal)
    expected = "oscillator is initialized anew after each measurement at its states x and v: all else that it remembers is lost."
    assert problem.notes[0] == expected
    found = list(follow(problem, build))
    component = "tests.follow.parts:VanDerPol"
    assert_equal(found, list(follow(problem_of(tmp_path / "own", component, rows, text, signal), build)))
    assert signal == "sampler.y" or abs(found[-1].values[0] - MU) < 3.0 * found[-1].deviations[0] < 0.3


EXCHANGE_MODEL = """
stop_time: 30 s
step: 10 ms
members:
  oscillator: {component: "OSCILLATOR", interface: model_exchange}
  sampler: {component: "SPRING", interface: model_exchange}
connections: [oscillator.y -> sampler.u, sampler.y -> oscillator.u]
"""


@pytest.mark.slow
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_fmus_for_model_exchange_are_followed_as_their_components(tmp_path, build, version, monkeypatch):
    """Two of them, integrated together: states are set directly, tunable parameters at an event. Components see each other 1 ms late."""
    rows, _ = recording(4, count=20)
    paths = [exporter.build(cls, version, build / "tests") for cls in (parts.VanDerPol, parts.Spring)]
    text = FOLLOWED.replace('inputs: {"force [m/s2]": oscillator.u}\n', "") + STATES
    exchange = EXCHANGE_MODEL.replace("OSCILLATOR", str(paths[0])).replace("SPRING", str(paths[1]))
    monkeypatch.setattr("tests.follow.test_fmus.MODEL", exchange)
    problem = problem_of(tmp_path / "fmu", "", rows, text)
    assert not any("initialized anew" in note for note in problem.notes)
    found = list(follow(problem, build))
    own = exchange.replace(", interface: model_exchange", "").replace(str(paths[0]), "tests.follow.parts:VanDerPol")
    own = own.replace(str(paths[1]), "tests.follow.parts:Spring").replace("step: 10 ms", "step: 1 ms")
    monkeypatch.setattr("tests.follow.test_fmus.MODEL", own)
    wanted = list(follow(problem_of(tmp_path / "own", "", rows, text), build))
    for one, other in zip(found, wanted, strict=True):
        assert (np.abs(one.values - other.values) < 0.5 * other.deviations).all()
        assert one.deviations == pytest.approx(other.deviations, rel=0.05)


CHANGES = """
changes: {more damping: {set: {oscillator.mu: x2}}}
forecast: {horizon: 500 ms, every: 500 ms, interval: 100 ms, signals: [oscillator.y], draws: 10}
"""


@pytest.mark.slow
@pytest.mark.parametrize("is_own", [False, True])
@pytest.mark.parametrize("interface", ["co_simulation", "model_exchange"])
def test_a_restored_follower_of_an_fmu_repeats_its_estimates_to_the_bit(
    tmp_path, build, is_own, interface, monkeypatch
):
    """Of an own FMU the states are estimated, too."""
    if interface == "model_exchange" and not is_own:
        pytest.skip("the FMU from C is for Co-Simulation")
    monkeypatch.setattr(
        "tests.follow.test_fmus.MODEL", MODEL.replace('"COMPONENT"', f'"COMPONENT", interface: {interface}')
    )
    rows, _ = recording(4, count=60)
    path = exporter.build(parts.VanDerPol, "3.0", build / "tests") if is_own else foreign(tmp_path, "3.0")
    problem = problem_of(tmp_path, path, rows, FOLLOWED + STATES * is_own + CHANGES)
    times = list(times_of(problem).items())

    def run(follower, part):
        for tick, measurements in part:
            follower.advance(tick)
            yield follower.correct(measurements)

    with Follower(problem, build) as follower:
        list(run(follower, times[:20]))
        saved = follower.save()
        forecasts = [follower.forecast(), follower.forecast(overrides={"oscillator.mu": 0.1})]
        wanted = list(run(follower, times[20:]))
        other = follower.save()  # of the end
        follower.restore(saved)
        assert np.ptp(forecasts[0].draws[-1, :, 0]) > 0.0
        assert bool(np.ptp(forecasts[1].draws[-1, :, 0])) is is_own
        found = list(run(follower, times[20:]))
        slots = follower.batch._fmus.slots
        assert not slots
        del saved, other
        assert len(slots) == 2  # used again by the next ones
    for one, two in zip(wanted, found, strict=True):
        assert np.array_equal(one.values, two.values)
        assert np.array_equal(one.changes, two.changes)


@pytest.mark.slow
def test_changes_and_forecasts_of_an_fmu_are_those_of_its_component(tmp_path, build):
    rows, _ = recording(4, count=100)
    path = exporter.build(parts.VanDerPol, "3.0", build / "tests")
    found = list(follow(problem_of(tmp_path / "fmu", path, rows, FOLLOWED + CHANGES), build))
    component = "tests.follow.parts:VanDerPol"
    wanted = list(follow(problem_of(tmp_path / "own", component, rows, FOLLOWED + CHANGES), build))
    assert_equal(found, wanted)
    assert sum(one.forecast is not None for one in found) > 5
    for one, other in zip(found, wanted, strict=True):
        assert np.array_equal(one.changes, other.changes)
        assert (one.forecast is None) == (other.forecast is None)
        if one.forecast is not None:
            np.testing.assert_array_equal(one.forecast.draws, other.forecast.draws)


@pytest.mark.slow
def test_an_fmu_that_cannot_be_followed_is_named_in_one_line(tmp_path):
    rows, _ = recording(4, count=40)

    def told(path, text=FOLLOWED):
        with pytest.raises(ScenarioError) as error:
            problem_of(tmp_path, path, rows, text)
        (line,) = error.value.problems
        return line

    path = foreign(tmp_path, "3.0", attribute="canSerializeFMUState")
    expected = "scenario: oscillator cannot save its state (canGetAndSetFMUState is not true). It cannot be followed."
    assert told(path).endswith(expected)
    path = foreign(tmp_path, "2.0", attribute='canGetAndSetFMUstate="true" canBeInstantiatedOnlyOncePerProcess')
    assert "oscillator allows one instance per process" in told(path)
    path = foreign(tmp_path, "3.0")
    expected = (
        "oscillator.x0 cannot be set while the FMU runs, and it cannot be initialized anew: it declares no continuous"
    )
    assert expected in told(path, FOLLOWED.replace(".mu", ".x0"))
    expected = (
        "oscillator.y is output and calculated by the FMU. Name a parameter, a state with a start value, or an input."
    )
    assert expected in told(path, FOLLOWED.replace("r.mu", "r.y").replace(", from: 0, to: 5", ""))


@pytest.mark.slow
def test_an_fmu_that_saves_a_part_of_its_state_is_named_before_it_is_followed(tmp_path, build):
    rows, _ = recording(4, count=40)
    problem = problem_of(tmp_path, foreign(tmp_path, "3.0", forgets=1), rows)
    with pytest.raises(
        SimulationError, match=r"^oscillator: says that it can save its state, and cannot: in another instance"
    ):
        next(follow(problem, build))
