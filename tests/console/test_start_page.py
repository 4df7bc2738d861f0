"""The list of scenarios on the start page, without a browser."""

from pathlib import Path

import pytest

pytest.importorskip("nicegui")

from twin.cli import demo
from twin.console.start_page import TOPICS, facts, group_scenarios, no_match, select_groups
from twin.scenario import scenario_paths


@pytest.fixture(scope="module")
def groups():
    return group_scenarios(["racs"], scenario_paths.scenarios())


def test_scenarios_are_grouped_by_topic(groups):
    by_heading = dict(groups)
    assert list(by_heading) == ["Start here, and recent", *TOPICS.values(), "Others"]
    first = [line.split()[-1] for line in demo.EXAMPLES]  # as `twin demo` and `twin list` say
    assert [name for name, _ in by_heading["Start here, and recent"]] == [
        *(name for name in first if name != "latest"),
        "racs",
    ]
    names = [name for _, entries in groups for name, _ in entries]
    assert len(names) == len(set(names))  # each once
    assert all(each.has_controls for _, each in by_heading["Operate"])
    for topic in ("Operate", "Navigation"):  # a card is found wherever a user looks for it
        ((_, entries),) = select_groups(groups, "", topic)
        assert {"vessel_teleoperation", "in_vivo_navigation"} <= dict(entries).keys()


def test_every_scenario_says_how_long_it_lasts(groups):
    """Also where the stop time is that of the extended file; an operator ends a session with controls."""
    overviews = {name: each for _, entries in groups for name, each in entries}
    assert overviews["contact_force"].duration == overviews["heart_wall_replay"].duration != ""
    assert facts(overviews["vessel_teleoperation"]).endswith("until you end it")
    assert facts(overviews["heart_wall_force"]) == "5 variants, 22\N{NO-BREAK SPACE}s"
    assert [name for name, each in overviews.items() if not facts(each)] == []


def test_a_scenario_with_controls_begins_with_the_variant_for_an_operator(groups):
    """The first variant of `in_vivo_navigation` replays a recording, in which a joystick moves nothing."""
    overviews = {name: each for _, entries in groups for name, each in entries}
    assert overviews["in_vivo_navigation"].variant == "by hand"
    assert overviews["racs"].variant is None


def test_every_shipped_scenario_has_a_topic():
    shipped = [path for path in scenario_paths.scenarios().values() if path.is_relative_to(Path("scenarios"))]
    assert [path.stem for path in shipped if scenario_paths.overview(path).topic not in TOPICS] == []


def test_a_search_leaves_out_empty_groups(groups):
    assert [(heading, [name for name, _ in found]) for heading, found in select_groups(groups, "joystick inj")] == [
        ("Operate", ["guided_injection"])
    ]
    assert select_groups(groups, "nothing at all") == []
    for search, scenario in (
        ("wall friction coefficient", "bench_wall"),  # title of a variant
        ("not drawn to scale", "bench_wall"),  # description
        ("hysterisis", "hysteresis_models"),
    ):
        assert scenario in [name for _, entries in select_groups(groups, search) for name, _ in entries]
    assert no_match("nothing at all") == "No scenario matches."
    study = next(iter(scenario_paths.scenarios("study")))
    assert no_match(study.upper()).endswith(f" {study} is a study: run `twin study {study}` in a terminal.")


def test_own_scenarios_come_last(tmp_path):
    (tmp_path / "mine.yaml").write_text("description: my pump\nstop_time: 3\ntopic: pumps\n")
    (tmp_path / "broken.yaml").write_text("title: [")
    groups = group_scenarios([], {path.stem: path for path in tmp_path.glob("*.yaml")})
    assert [heading for heading, _ in select_groups(groups, "")] == ["Others"]
    mine = dict(groups[-1][1])["mine"]
    assert (mine.title, mine.duration, mine.has_controls) == ("my pump", "3 s", False)
