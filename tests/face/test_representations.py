"""What prints in a notebook's cell or a debugger: one line that names the object, its unit and its meaning."""

import pytest

import twin
from tests.face.parts import Types
from twin.results import RecordedVariable
from twin.study import load_study


@pytest.mark.parametrize(
    ("thing", "text"),
    [
        (Types.push, "<input push [N]: force>"),
        (Types.row, "<output row[3] [m]: three places>"),
        (Types.odd, "<output odd: whether the count is odd>"),
        (Types.gain, "<parameter gain = 2.0 [m/N]: gain>"),
        (RecordedVariable("a.x", shape=(2,), unit="m", description="tip"), "<signal a.x[2] [m]: tip>"),
        (RecordedVariable("a.x", unit="1"), "<signal a.x>"),
        (
            Types(push=0.25),
            "<Types: push = 0.25 N, place = 0 m, count = 0, odd = 0, gain = 2 m/N, mass = 1 kg>",
        ),
        (Types.__new__(Types), "<Types>"),  # as a debugger shows it before it is initialized
    ],
)
def test_variables_and_components(thing, text):
    assert repr(thing) == text


def test_a_simulation_names_its_case_and_members(scenario, build):
    with scenario.simulate("strong", 2, build=build, backend="interpreted") as simulation:
        assert repr(simulation) == "<Simulation of strong, seed 2 at 0 s: running; members part>"
        assert repr(simulation.variable("part.push")) == "<input push [N]: force>"
    assert "closed" in repr(simulation)


def test_a_scenario_and_a_study():
    study = repr(load_study("thousand_patients"))
    assert study.startswith("<Study thousand_patients: ")
    assert "; varies " in study
    assert len(study) < 400
    assert repr(twin.load("racs")).startswith("<Scenario racs: ")
    assert '; variants "nothing fails", "compressor lost", "air lost", "air lost, 10 N pull", ' in repr(
        twin.load("failures")
    )
