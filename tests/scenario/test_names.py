"""`names:` of a member: an FMU whose variables have other names takes the place of a component."""

import re
import zipfile

import numpy as np
import pytest

from twin.component import catalog
from twin.coupling import declared_variables, renamed
from twin.errors import CouplingError, ScenarioError
from twin.fmi import exporter
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, load_scenario, missing_units, parse_scenario, resolve_variables

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


@pytest.fixture(scope="module")
def bare(fmu, tmp_path_factory):
    """The same FMU without the units of lengths, as many tools write it."""
    path = tmp_path_factory.mktemp("bare") / "heart.fmu"
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(path, "w") as new:
        for item in old.infolist():
            content = old.read(item)
            if item.filename == "modelDescription.xml":
                content = re.sub(rb' unit="m"( displayUnit="mm")?', b"", content)
            new.writestr(item, content)
    return path


@pytest.mark.slow
def test_a_scenario_states_the_unit_that_an_fmu_does_not_declare(fmu, bare, tmp_path, build):
    """The unit converts in connections, limits and overrides; without it, the check of a scenario says what is assumed."""
    text = OWN.replace("FMU,", f"{bare},")
    scenario = parse_scenario(text, tmp_path / "s.yaml")
    (note,) = missing_units(scenario)
    assert "s.yaml:6: heart.position -> wall.heart_position: heart.fmu declares no valid unit for `position`" in note
    assert note.endswith("State its unit, such as `units: {position: m}` of member `heart`.")
    stated = OWN.replace("FMU,", f"{bare}, units: {{position: mm}},")
    assert missing_units(parse_scenario(stated, tmp_path / "s.yaml")) == []
    values, own = signals(stated, tmp_path, build), signals(OWN.replace("FMU,", f"{fmu},"), tmp_path, build)
    np.testing.assert_array_equal(values["heart.position"], own["heart.position"])
    assert np.abs(values["wall.heart_position"]).max() == pytest.approx(1e-3 * np.abs(own["heart.position"]).max())


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ("{position: mm}", "units: `position` is declared in m by the FMU. Leave it out, or use `factor`."),
        ("{place: mm}", "units: there is no variable `place`."),
    ],
)
def test_wrong_units_are_one_line(fmu, tmp_path, units, message):
    text = OWN.replace("FMU,", f"{fmu}, units: {units},")
    with pytest.raises(ScenarioError) as caught:
        run_scenario(parse_scenario(text, tmp_path / "s.yaml"), RunOptions(root=tmp_path))
    assert any(message in problem for problem in caught.value.problems)


@pytest.mark.parametrize(
    ("offset", "result"),
    [
        ("1 mm", 1e-3),
        ("0.002", 0.002),
        ("1 N", "offset: N does not convert to m"),
        ("soon", "`soon` is not a quantity"),
    ],
)
def test_an_offset_of_a_connection_has_a_unit(tmp_path, offset, result):
    text = OWN.replace("FMU", "heart").replace(
        "connections: [heart.position -> wall.heart_position]",
        f"connections: [{{from: heart.position, to: wall.heart_position, offset: {offset}}}]",
    )
    if isinstance(result, float):
        scenario = parse_scenario(text, tmp_path / "s.yaml")
        (case,) = scenario.variants
        (link,) = case.system(resolve_variables(scenario)[0][case.variant]).links()
        assert (link.factor, link.offset) == (1.0, result)
        return
    with pytest.raises(ScenarioError) as caught:
        run_scenario(parse_scenario(text, tmp_path / "s.yaml"), RunOptions(root=tmp_path))
    assert any(result in problem for problem in caught.value.problems)


def test_two_names_may_be_exchanged():
    variables = declared_variables(catalog.component("heart"))
    swapped = renamed(variables, {"position": "velocity", "velocity": "position"})
    assert swapped["velocity"].unit == variables["position"].unit
    assert swapped["velocity"].name == "velocity"
    with pytest.raises(CouplingError, match="another variable `x`"):
        renamed(variables, {"position": "x", "velocity": "x"})
