"""The picture is bound to what the components really have."""

import re
from dataclasses import replace
from pathlib import Path

from tests.every_case import every_case
from twin.component import catalog
from twin.console.animation import to_si
from twin.console.operator_panel import condense, read
from twin.live import Catalog, CatalogControl, CatalogSignal, ExecutedCommand
from twin.web.views import BENCH, DRAWINGS, RIG, SCENE, build_views


@every_case("name", DRAWINGS)
def test_components_have_what_is_drawn_of_them(name):
    folder = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
    drawn, found = DRAWINGS[name], catalog.component(folder)
    assert found.__name__ == name
    assert {*drawn.signals, *drawn.sizes} <= {one.name for one in found.variables}


def session(members, *names):
    """A catalog with outputs that are recorded, and parameters."""
    signals = {
        one: CatalogSignal(one, one.rpartition(".")[0], kind, "Float64", start=0.002, recorded=kind == "output")
        for kind, one in names
    }
    return Catalog("s", "", "", "", "", 1, 1e-3, 1e-3, 0.0, 5e-3, False, False, members, signals, (), (), (), {})


def test_members_are_found_by_class_and_in_groups_by_signals():
    own = [("output", f"drive.{one}") for one in DRAWINGS["Servomotor"].signals]
    inner = [("output", f"rig.axis.{one}") for one in DRAWINGS["StepperAxis"].signals]
    wall = [("output", "wall.force"), ("parameter", "wall.surface_position")]
    other = [("output", "other.position")]
    views = build_views(
        session(
            {"drive": "Servomotor", "rig": "x.yaml#rig", "wall": "Wall", "other": "Mine"}, *own, *inner, *wall, *other
        )
    )
    assert [(one["view"], one["title"], [part["kind"] for part in one["parts"]]) for one in views] == [
        (RIG, "", ["carriage", "wall"]),
        (BENCH, "rig", ["axis"]),
    ]
    assert views[0]["parts"][1]["sizes"] == {"surface_position": 0.002}
    assert views[1]["parts"][0]["signals"]["position"] == "rig.axis.position"


def test_pictures_are_drawn_in_si_where_a_member_declares_other_units():
    """Sizes, targets and limits of a member in millimeters and millinewtons."""
    catalog = session(
        {"drive": "Servomotor", "wall": "Wall"},
        ("output", "drive.position"),
        ("output", "wall.force"),
        ("parameter", "wall.surface_position"),
    )
    units = {"drive.position": "mm", "wall.force": "mN", "wall.surface_position": "mm"}
    catalog = replace(
        catalog,
        signals={name: replace(one, unit=units[name], start=2.0) for name, one in catalog.signals.items()},
        targets={"signal": "drive.position", "tolerance": 5.0, "points": {"near": [3.0]}},
        warnings=({"signal": "wall.force", "above": 200.0, "below": -200.0, "text": "high"},),
    )
    drawn = to_si(catalog)
    (view,) = build_views(drawn)
    assert view["parts"][1]["sizes"] == {"surface_position": 0.002}
    assert view["targets"] == [{"name": "near", "at": [0.003], "tolerance": 0.005}]
    assert view["limits"] == {"wall.force": 0.2}
    assert (drawn.warnings[0]["above"], drawn.warnings[0]["below"]) == (0.2, -0.2)


def test_nothing_is_drawn_of_what_is_unknown():
    assert build_views(session({"a": "Mine"}, ("output", "a.position"))) == []


def test_of_what_is_held_begin_and_end_are_listed():
    control = CatalogControl("in", "a.in", "travel", "", -1.0, 1.0, 0.0, 0.0, "", "", 1.0, 0.0, "hold", along=("a.on",))
    lines = [
        "set a.on = true",
        "set a.in = 0.1",
        "set a.in = 0.2",
        "set b.gain = 3",
        "set a.in = 0.0",
        "set a.in = -0.1",
        "set a.in = 0.0",
    ]
    done = [ExecutedCommand(k, 0.1 * k, "set", text, "") for k, text in enumerate(lines)]
    told = [one.text for one in condense(done, {"a.in": control})]
    assert told == [
        "travel: held at 0.1",
        "set b.gain = 3",
        "travel: released",
        "travel: held at -0.1",
        "travel: released",
    ]


def test_values_as_they_are_typed():
    assert [read(one) for one in (" 1.5 ", "true", "12 mm/s")] == [1.5, True, "12 mm/s"]


def test_every_view_has_its_file():
    static = Path(__file__).parents[2] / "twin/web/static"
    assert {SCENE, *(one.view for one in DRAWINGS.values() if one.view)} == {
        one.stem.removeprefix("view_") for one in static.glob("view_*.js")
    }


def test_a_scene_is_drawn_with_what_it_names():
    scene = {"title": "On the wall", "walls": [], "axes": [0, 1], "motions": {}, "points": [], "arrows": []}
    scene["lines"] = [{"signal": "chain.shape", "width": 2.0}]
    drive = [("output", f"drive.{one}") for one in DRAWINGS["Servomotor"].signals]
    catalog = session({"drive": "Servomotor", "chain": "Mine"}, *drive, ("output", "chain.shape"))
    assert [one["view"] for one in build_views(replace(catalog, scenes=(scene,)))] == [SCENE]
    assert [one["view"] for one in build_views(catalog)] == [RIG]
