"""`names:` of a member: an FMU whose variables have other names takes the place of a component."""

import numpy as np
import pytest

from twin.component import catalog
from twin.coupling import declared_variables, renamed
from twin.errors import CouplingError, ScenarioError
from twin.fmi import exporter
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, load_scenario, parse_scenario

OWN = """
stop_time: 0.2 s
members:
  heart: {component: FMU, parameters: {rate: 2 Hz}}
  wall: {component: wall}
connections: [heart.position -> wall.heart_position]
events: [{at: 0.1 s, set: {heart.scale: 2}}]
record: ["*.*"]
expect: [{signal: heart.position, at_most: 1 m}]
"""
NAMES = "{beats_per_second: rate, place: position, velocity: velocity, position: beats}"
OTHER = OWN.replace("rate: 2 Hz}", f"beats_per_second: 2 Hz}}, names: {NAMES}").replace("heart.position", "heart.place")


@pytest.fixture(scope="module")
def fmu(tmp_path_factory, build):
    path = tmp_path_factory.mktemp("names") / "heart.fmu"
    exporter.export(catalog.component("heart"), "3.0", path, build)
    return path


def signals(text, folder, build):
    scenario = parse_scenario(text, folder / "s.yaml")
    outcome = run_scenario(scenario, RunOptions(backend=Backend.fmu, root=folder, build=build, report=False))
    assert outcome.passed, outcome.run.reason
    (table,) = outcome.tables.values()
    return table.values


@pytest.mark.slow
@pytest.mark.parametrize("option", ["", ", isolate: true", ", interface: model_exchange"])
def test_another_name_changes_no_bit(fmu, tmp_path, build, option):
    own, other = (signals(text.replace("FMU,", f"{fmu}{option},"), tmp_path, build) for text in (OWN, OTHER))
    assert "heart.beats" not in other
    for name, before in (("place", "position"), ("position", "beats"), ("velocity", "velocity")):
        np.testing.assert_array_equal(other[f"heart.{name}"], own[f"heart.{before}"])
    np.testing.assert_array_equal(other["wall.force"], own["wall.force"])


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ("{place: positon}", "member `heart`: names: there is no variable `positon`. Did you mean 'position'?"),
        ("{velocity: position}", "names: there is another variable `velocity`. Choose a name that is free."),
    ],
)
def test_wrong_names_are_one_line(fmu, tmp_path, names, message):
    text = OWN.replace("FMU,", f"{fmu}, names: {names},")
    with pytest.raises(ScenarioError) as caught:
        run_scenario(parse_scenario(text, tmp_path / "s.yaml"), RunOptions(root=tmp_path))
    assert any(message in problem for problem in caught.value.problems)


def test_variables_that_an_fmu_names_differently_are_mapped_by_names(fmu, tmp_path):
    text = (
        OWN.replace("FMU,", f"{fmu},").replace("heart.position", "heart.positions").replace("heart.scale", "heart.gain")
    )
    with pytest.raises(ScenarioError) as caught:
        run_scenario(parse_scenario(text, tmp_path / "s.yaml"), RunOptions(root=tmp_path))
    (hint,) = (problem for problem in caught.value.problems if "`names:" in problem)
    assert hint.partition(": ")[0].endswith("s.yaml:4")
    assert (
        "member `heart`: if heart.fmu has these variables under other names, map the scenario's names to its own"
        in hint
    )
    assert "positions: position" in hint
    assert "gain: ITS_NAME" in hint
    assert "`console: null` drops inherited controls" in hint


def test_only_an_fmu_has_names_of_its_own(tmp_path):
    (tmp_path / "s.yaml").write_text(OWN.replace("FMU,", "heart, names: {place: position},"))
    with pytest.raises(ScenarioError, match=r"s\.yaml:4\) is for FMUs\. Leave it out"):
        run_scenario(load_scenario(tmp_path / "s.yaml"), RunOptions(root=tmp_path))


def test_two_names_may_be_exchanged():
    variables = declared_variables(catalog.component("heart"))
    swapped = renamed(variables, {"position": "velocity", "velocity": "position"})
    assert swapped["velocity"].unit == variables["position"].unit
    assert swapped["velocity"].name == "velocity"
    with pytest.raises(CouplingError, match="another variable `x`"):
        renamed(variables, {"position": "x", "velocity": "x"})
