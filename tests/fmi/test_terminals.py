"""Terminals: valid by the standard's schema, true to the declarations, and enough to couple what belongs together."""

import zipfile
from itertools import combinations
from pathlib import Path

import fmpy
import pytest
from lxml import etree

from twin.component import Component, PythonComponent, catalog, input, local, output, terminal
from twin.errors import DeclarationError
from twin.fmi import exporter
from twin.fmi.terminals import PLACE
from twin.scenario import load_scenario

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
WITH = [n for n in catalog.names() if catalog.component(n).terminals]


def declared(name):
    """All terminals of a component's FMU, as its XML says: rule, and variable by member."""
    root = etree.fromstring(exporter.plan(catalog.component(name), "3.0").files[PLACE])
    etree.XMLSchema(etree.parse(SCHEMA)).assertValid(root)
    return {
        t.get("name"): (t.get("matchingRule"), {m.get("memberName"): m.get("variableName") for m in t})
        for t in root.iter("Terminal")
    }


def test_the_components_of_the_force_experiment_have_them():
    assert {"servomotor", "sheath", "wall", "heart", "pi_control"} <= set(WITH)


@pytest.mark.parametrize("name", WITH)
def test_the_file_is_valid_and_names_variables_of_the_fmu(name):
    files = exporter.plan(catalog.component(name), "3.0").files
    variables = etree.fromstring(files["modelDescription.xml"]).find("ModelVariables")
    causalities = {v.get("name"): v.get("causality") for v in variables}
    for _, members in declared(name).values():
        assert members
        assert {causalities[v] for v in members.values()} <= {"input", "output", "parameter"}
    assert PLACE not in exporter.plan(catalog.component(name), "2.0").files


def test_the_documentation_shows_them():
    page = exporter.plan(catalog.component("servomotor"), "2.0").files["documentation/index.html"].decode()
    assert "<td>rod</td><td>mechanical side: the end of the rod</td><td>position</td><td>position</td>" in page
    assert "<td></td><td></td><td>force</td><td>load_force</td>" in page


def test_the_connections_of_the_force_experiment_are_among_the_plugs_that_fit():
    """What an importer finds by the matching rule alone: same members, one side the source of each, same unit."""
    members = {"heart", "servomotor", "sheath", "wall"}
    sides = [
        (member, terminal.members)
        for member in sorted(members)
        for terminal in catalog.component(member).terminals.values()
        if terminal.rule == "plug"
    ]
    found = set()
    for (a, one), (b, other) in combinations(sides, 2):
        if a == b or one.keys() != other.keys():
            continue
        if all({one[k].role, other[k].role} == {"input", "output"} for k in one):
            for key in one:
                assert one[key].unit == other[key].unit
                ends = {one[key].role: f"{a}.{one[key].name}", other[key].role: f"{b}.{other[key].name}"}
                found.add((ends["output"], ends["input"]))
    scenario = load_scenario(Path(__file__).parents[2] / "scenarios" / "heart_wall_force.yaml")
    ends = [(c.source, c.target) for c in scenario.variants[0].connections]
    wanted = {pair for pair in ends if {end.split(".")[0] for end in pair} <= members}
    assert len(wanted) == 5
    assert wanted <= found  # a rod may also be plugged into the wall directly


def test_the_archive_holds_them_but_no_sources(build):
    for version in ("2.0", "3.0"):
        names = zipfile.ZipFile(exporter.build(catalog.component("servomotor"), version, build)).namelist()
        assert (PLACE in names) == (version == "3.0")
        assert not any(name.startswith("sources/") or "buildDescription" in name for name in names)


def make(**fields):
    """A component with these fields."""

    def step(self, t, h):
        pass

    return type("Made", (Component,), {"__doc__": "Made for a test.", "step": step, **fields})


def test_declarations_that_make_no_sense_are_refused():
    u, w = input("N", "force"), local(0.0, "N", "inner")
    assert make(u=u, end=terminal("an end", force=u)).terminals["end"].members["force"].name == "u"
    for fields, reason in (
        ({"w": w, "end": terminal("an end", force=w)}, "force is no variable to connect"),
        ({"end": terminal("an end", force=output("N", "of nobody"))}, "force is no variable to connect"),
        ({"end": terminal("an end")}, "nothing is no variable"),
        ({"u": u, "end": terminal("an end", rule="socket", force=u)}, "'socket' is not known"),
        ({"u": u, "icon": terminal("an end", force=u)}, "cannot have this name"),
    ):
        with pytest.raises(DeclarationError, match=reason):
            make(**fields)


def test_terminals_are_inherited_and_no_variables():
    base = make(u=input("N", "force"))
    base = type("More", (base,), {"__doc__": "More.", "end": terminal("an end", force=base.u)})
    derived = type("Most", (base,), {"__doc__": "Most."})
    assert list(derived.terminals) == ["end"]
    assert [v.name for v in derived.variables] == ["u"]
    assert PythonComponent.terminals == {}
