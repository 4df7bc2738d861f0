"""Files of parameters that serve all members of a component."""

import pytest

from twin.errors import ScenarioError
from twin.run import resolve_catalogs
from twin.scenario import parse_scenario

SETS = """
stop_time: 10 ms
members:
  left:  {component: servomotor}
  right: {component: servomotor, parameters: {mass: 0.9 kg}}
  wall:  {component: wall}
parameter_sets: small.yaml
variants:
  small: {}
  large: {parameter_sets: [small.yaml, large.yaml]}
  plain: {parameter_sets: []}
"""


def mass(scenario, variant, member):
    case = scenario.cases([variant])[0]
    return case.members[member].parameters.get("mass")


def test_parameter_sets_serve_all_members_of_a_component_and_give_way_to_their_own(tmp_path):
    (tmp_path / "small.yaml").write_text("servomotor: {mass: 0.1 kg, friction_coulomb: 2 N}\nsheath: {drag: 7}\n")
    (tmp_path / "large.yaml").write_text("servomotor: {mass: 5 kg}\n")
    scenario = parse_scenario(SETS, tmp_path / "s.yaml")
    assert [mass(scenario, "small", member) for member in ("left", "right")] == ["0.1 kg", "0.9 kg"]
    assert [mass(scenario, "large", member) for member in ("left", "right")] == ["5 kg", "0.9 kg"]
    assert mass(scenario, "plain", "left") is None
    assert scenario.cases(["large"])[0].members["left"].parameters["friction_coulomb"] == "2 N"
    assert mass(parse_scenario(SETS, tmp_path / "s.yaml", ["left.mass=3 kg"]), "large", "left") == "3 kg"


def test_a_whole_array_replaces_elements_of_sets_and_of_members(tmp_path):
    (tmp_path / "one.yaml").write_text('sheath: {"play[3]": 1 mm}\n')
    text = """
        stop_time: 10 ms
        members: {sheath: {component: sheath, parameters: PARAMETERS}}
        variants: {A: {}, B: {members: {sheath: {parameters: {"play[1]": 3 mm}}}}}
        parameter_sets: [one.yaml]
    """
    own = parse_scenario(text.replace("PARAMETERS", "{play: 2 mm}"), tmp_path / "s.yaml")
    assert own.cases(["A"])[0].members["sheath"].parameters == {"play": "2 mm"}
    assert own.cases(["B"])[0].members["sheath"].parameters == {"play": "2 mm", "play[1]": "3 mm"}
    text = text.replace("PARAMETERS", '{"play[2]": 2 mm}')
    changed = parse_scenario(text, tmp_path / "s.yaml", ["sheath.play=0.5 mm"])
    for variant in ("A", "B"):
        assert changed.cases([variant])[0].members["sheath"].parameters == {"play": "0.5 mm"}


def test_a_frozen_scenario_needs_no_parameter_file(tmp_path):
    (tmp_path / "small.yaml").write_text("servomotor: {mass: 0.1 kg}\n")
    (tmp_path / "large.yaml").write_text("servomotor: {mass: 5 kg}\n")
    frozen = parse_scenario(SETS, tmp_path / "s.yaml").frozen()
    (tmp_path / "small.yaml").unlink()
    again = parse_scenario(frozen, tmp_path / "elsewhere" / "s.yaml")
    assert mass(again, "large", "left") == "5 kg"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, r"s\.yaml:7: parameter_sets: there is no file small\.yaml\."),
        ("servomotor: {mas: 1 kg}\n", r"small\.yaml:1: left has no variable `mas`\. Did you mean `mass`\?"),
        ("servomotor: 3\n", r"small\.yaml:1"),
        ("- 3\n", r"small\.yaml:1"),
        (
            "servomoto: {mass: 1 kg}\n",
            r"small\.yaml:1: parameter_sets: there is no component `servomoto`\. Did you mean",
        ),
    ],
)
def test_a_wrong_parameter_set_is_told_with_its_line(tmp_path, content, message):
    if content is not None:
        (tmp_path / "small.yaml").write_text(content)
    text = SETS.replace(", large.yaml", "")
    with pytest.raises(ScenarioError, match=message):
        resolve_catalogs(parse_scenario(text, tmp_path / "s.yaml"))
