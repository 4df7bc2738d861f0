"""Values of the instruments as scenarios have them."""

from pathlib import Path

from twin.run import resolve_catalogs
from twin.scenario import parse_scenario

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def guidewire(component):
    """What the guidewire's parameter set says of a component, in SI."""
    text = f"stop_time: 1 s\nmembers: {{part: {{component: {component}}}}}\nparameter_sets: instruments/guidewire.yaml"
    scenario = parse_scenario(text, SCENARIOS / "guidewire.yaml")
    case = scenario.cases()[0]
    found = case.values("part", resolve_catalogs(scenario)[case.variant]["part"])
    return {name: value.tolist() for name, value in found.items() if name != "seed"}
