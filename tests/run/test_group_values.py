"""Values of a group that a scenario sets."""

from __future__ import annotations

from twin.run.cases import resolve_catalogs
from twin.scenario import load_scenario


def test_an_element_of_an_array_leaves_the_others_as_the_group_sets_them() -> None:
    """The group `heart_motion.yaml` sets `toward` to [0, 1, 0]; the component's default is [0, 0, 1]."""
    scenario = load_scenario("scenarios/heart_wall_force.yaml", ["estimate.estimator.toward[1]=0.1"])
    catalog = resolve_catalogs(scenario)["PI+FF, replayed"]
    case = scenario.cases(["PI+FF, replayed"], [1])[0]
    assert case.values("estimate", catalog["estimate"])["estimator.toward"].tolist() == [0.1, 1.0, 0.0]
