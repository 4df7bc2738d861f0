"""Connections of terminals in scenario files: checks with lines, patches, groups, and every form of a member."""

import numpy as np
import pytest

from twin.component import catalog
from twin.errors import ScenarioError
from twin.fmi.exporting import exporter
from twin.run.cases import build_simulation, noop, run_case
from twin.scenario import Backend, group, parse_scenario, resolve_variables

BASE = """\
stop_time: 20 ms
members:
  cylinder: {component: pneumatic_cylinder, parameters: {valve: true}}
  sleeve: {component: braided_sleeve}
  other: {component: braided_sleeve}
  instrument: {component: instrument}
connections:
  - cylinder.holder -> sleeve.holder
  - sleeve.grip -> instrument.grip[1]
"""


def looked_up(text):
    scenario = parse_scenario(text, "s.yaml")
    return scenario, *resolve_variables(scenario)


def links(text):
    scenario, catalogs, problems = looked_up(text)
    assert problems == []
    return {
        (*one.source.key, *one.target.key, one.target.first)
        for case in scenario.variants
        for one in case.system(catalogs[case.variant]).links()
    }


def test_a_line_stands_for_ten():
    found = links(BASE)
    assert len(found) == 10
    assert ("sleeve", "grip_stiffness", "instrument", "grip_stiffness", 0) in found
    assert ("sleeve", "contact_extension", "cylinder", "contact_extension", 0) in found
    assert ("cylinder", "extension", "sleeve", "extension", 0) in found


def test_a_second_source_is_told_with_both_lines():
    (problem,) = looked_up(BASE + "  - other.torque_limit -> instrument.torque_limit[1]\n")[2]
    assert problem == (
        "s.yaml:10: instrument.torque_limit[1] has two sources, sleeve.torque_limit and other.torque_limit "
        "(the first: s.yaml:9, sleeve.grip -> instrument.grip[1]). Keep one."
    )
    assert looked_up(BASE + "  - other.torque_limit -> instrument.torque_limit[2]\n")[2] == []


def test_names_that_are_wrong_are_told_with_the_nearest_terminal():
    (problem,) = looked_up(BASE.replace("sleeve.grip ", "sleeve.grips "))[2]
    assert problem.startswith("s.yaml:9: sleeve.grips -> instrument.grip[1]: ")
    assert "sleeve has no variable 'grips'. Did you mean 'grip'?" in problem


def test_a_patch_replaces_and_disconnects_by_the_target_as_it_is_written():
    variants = "variants:\n  v: {connections: [CHANGE]}\n"
    replaced = links(BASE + variants.replace("CHANGE", '"other.grip -> instrument.grip[1]"'))
    assert {one[0] for one in replaced} == {"cylinder", "sleeve", "other"}
    assert len(links(BASE + variants.replace("CHANGE", '{from: null, to: "instrument.grip[1]"}'))) == 5
    assert len(links(BASE + "variants:\n  v: {members: {cylinder: null}}\n")) == 5


def test_an_input_that_a_terminal_connects_cannot_be_set():
    event = "events: [{at: 5 ms, set: {sleeve.tension: 1 N}}]\n"
    assert looked_up(BASE + event)[2] == [
        "s.yaml:10: sleeve.tension is connected and would be written over. Override its source instead."
    ]


def test_terminals_of_a_group_connect_like_those_of_its_members():
    scenario, catalogs, _ = looked_up(BASE)
    part = group("rig", scenario.cases()[0], catalogs["base"], ["cylinder", "sleeve", "instrument"])
    assert {"cylinder.control", "instrument.tip"} <= set(part.terminals)
    assert "instrument.grip" not in part.terminals  # its inputs are driven inside


def test_a_python_system_connects_them():
    import twin

    system = twin.System()
    system.add("sleeve", "braided_sleeve")
    system.add("instrument", "instrument")
    system.connect("sleeve.grip", "instrument.grip[2]")
    with pytest.raises(ScenarioError, match="no partner at the other side for limit_distal"):
        system.connect("sleeve.grip", "instrument.tip")
    assert system.connections == [("sleeve.grip", "instrument.grip[2]")]
    assert "sleeve.grip → instrument.grip[2]" in system._repr_html_()  # drawn as one line


@pytest.mark.slow
def test_every_form_gives_the_same(build):
    """Also an FMU by its file, whose terminals are read from it."""
    fmu = exporter.build(catalog.component("braided_sleeve"), "3.0", build)
    texts = [(BASE, Backend.interpreted), (BASE, Backend.compiled), (BASE, Backend.fmu)]
    texts.append(
        (
            BASE.replace(
                "sleeve: {component: braided_sleeve}", f"sleeve: {{component: {fmu}, parameters: {{seed: 1}}}}", 1
            ),
            Backend.compiled,
        )
    )
    found = []
    for text, form in texts:
        scenario, catalogs, problems = looked_up(
            text.replace("{component: braided_sleeve}", "{component: braided_sleeve, parameters: {seed: 1}}")
        )
        assert problems == []
        case = scenario.cases()[0]
        simulated = build_simulation(case, catalogs["base"], form, build)
        run_case(case, simulated, noop)
        found.append(np.array(simulated.recording().signals["instrument.gripper_force"]))
        found[-1] = np.append(found[-1], simulated.recording().signals["sleeve.limit_proximal"])
        simulated.terminate()
    assert np.any(found[0])
    assert all(one.tobytes() == found[0].tobytes() for one in found)
