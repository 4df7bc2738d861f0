"""Terminals: valid by the standard's schema, true to the declarations, and enough to couple what belongs together.

Those of anyone's FMU are read, and what is harmful among them is refused.
"""

import zipfile
from itertools import combinations
from pathlib import Path

import fmpy
import pytest
from lxml import etree

from twin.component import Component, PythonComponent, catalog, input, local, output, terminal
from twin.coupling import TerminalMember, declared_variables
from twin.errors import DeclarationError, FMUError
from twin.fmi import FMUMember
from twin.fmi.exporting import exporter
from twin.fmi.terminals import ARCHIVE_PATH
from twin.scenario import load_scenario, parse_scenario, resolve_variables

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
NATIVE = [n for n in catalog.names() if not issubclass(catalog.component(n), PythonComponent)]
WITH = [n for n in NATIVE if catalog.component(n).terminals]


def declared(name):
    """All terminals of a component's FMU, as its XML says: rule, and variable by member."""
    root = etree.fromstring(exporter.plan(catalog.component(name), "3.0").files[ARCHIVE_PATH])
    etree.XMLSchema(etree.parse(SCHEMA)).assertValid(root)
    return {
        t.get("name"): (t.get("matchingRule"), {m.get("memberName"): m.get("variableName") for m in t})
        for t in root.iter("Terminal")
    }


FORCE_EXPERIMENT = {"servomotor", "sheath", "wall", "heart", "pi_control"}


def test_the_components_of_the_force_experiment_have_them():
    assert set(WITH) >= FORCE_EXPERIMENT


@pytest.mark.parametrize(
    "name", [name if name in FORCE_EXPERIMENT else pytest.param(name, marks=pytest.mark.slow) for name in WITH]
)
def test_the_file_is_valid_and_names_variables_of_the_fmu(name):
    files = exporter.plan(catalog.component(name), "3.0").files
    variables = etree.fromstring(files["modelDescription.xml"]).find("ModelVariables")
    causalities = {v.get("name"): v.get("causality") for v in variables}
    for _, members in declared(name).values():
        assert members
        assert {causalities[v] for v in members.values()} <= {"input", "output", "parameter"}
    assert ARCHIVE_PATH not in exporter.plan(catalog.component(name), "2.0").files


def test_the_documentation_shows_them():
    page = exporter.plan(catalog.component("servomotor"), "2.0").files["documentation/index.html"].decode()
    assert "<td>rod</td><td>mechanical side: the end of the rod</td><td>position</td><td>position</td>" in page
    assert "<td></td><td></td><td>force</td><td>load_force</td>" in page


@pytest.mark.slow
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
        assert (ARCHIVE_PATH in names) == (version == "3.0")
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


# ------------------------------------------------------------------------------------------------------------ anyone's


def places(path):
    """The terminals of an FMU's variables, and its notes."""
    member = FMUMember("m", path)
    member.close()
    return {name: one.terminals for name, one in member.variables.items() if one.terminals}, member.notes


def test_an_fmu_has_the_terminals_that_its_component_declares(build):
    for name in ("servomotor", "instrument"):
        cls = catalog.component(name)
        wanted = {name: one.terminals for name, one in declared_variables(cls).items() if one.terminals}
        assert places(exporter.build(cls, "3.0", build)) == (wanted, [])
        assert places(exporter.build(cls, "2.0", build)) == ({}, [])


@pytest.fixture
def foreign(build, tmp_path):
    """Makes the FMU of the sheath with somebody else's terminals."""

    def make(xml, place=ARCHIVE_PATH):
        path = tmp_path / "foreign.fmu"
        with (
            zipfile.ZipFile(exporter.build(catalog.component("sheath"), "3.0", build)) as old,
            zipfile.ZipFile(path, "w") as new,
        ):
            for name in old.namelist():
                if name != ARCHIVE_PATH:
                    new.writestr(name, old.read(name))
            new.writestr(place, xml, zipfile.ZIP_DEFLATED)
        return path

    return make


WHOLE = '<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>{}</Terminals></fmiTerminalsAndIcons>'
POSITION = '<TerminalMemberVariable variableName="gripper_position" memberName="position" variableKind="signal"/>'
FORCE = '<TerminalMemberVariable variableName="reaction_force" memberName="force" variableKind="inflow"/>'
END = f'<Terminal name="end" matchingRule="plug" terminalKind="Flange_a">{POSITION}{FORCE}</Terminal>'


def test_terminals_of_anyone_are_read(foreign):
    """With a namespace, icons and annotations; what a vendor adds under the same names is no terminal."""
    vendor = f'<v:Terminal xmlns:v="urn:v" name="x" matchingRule="bus">{POSITION}</v:Terminal>'
    icon = '<TerminalGraphicalRepresentation x1="0" y1="0" x2="1" y2="1" iconBaseName="a"/>'
    notes = f"<Annotations><Annotation type='v'>{END}</Annotation></Annotations>"
    end = END.replace("</Terminal>", f"{icon}{notes}</Terminal>")
    xml = WHOLE.format(f"<!-- ours -->{vendor}{end}").replace("3.0", "3.0.1")
    wanted = {
        "gripper_position": (TerminalMember("end", "position"),),
        "reaction_force": (TerminalMember("end", "force", "plug", "inflow"),),
    }
    assert places(foreign(xml)) == (wanted, [])
    assert places(foreign(xml.replace(" fmiV", ' xmlns="urn:fmi" fmiV')))[0] == wanted


def test_members_of_a_sequence_are_named_by_their_order_and_terminals_may_hold_others(foreign):
    nameless = FORCE.replace(' memberName="force"', "")
    inner = f'<Terminal name="in" matchingRule="sequence">{nameless}</Terminal>'
    xml = WHOLE.format(END.replace(FORCE, inner))
    found, _ = places(foreign(xml))
    assert found["reaction_force"] == (
        TerminalMember("end", "in.1", "sequence", "inflow"),
        TerminalMember("end.in", "1", "sequence", "inflow"),
    )


@pytest.mark.parametrize(
    ("xml", "note"),
    [
        (END.replace("reaction_force", "nothing"), "member 'force' of terminal 'end' is the variable 'nothing', which"),
        (END.replace('"force"', '"position"'), "member 'position' of terminal 'end' is there twice"),
        (END.replace(' memberName="force"', ""), "a terminal or a member of 'end' has no name"),
        (END + END.replace("plug", "bus"), "terminal 'end' is there twice"),
    ],
)
def test_a_wrong_terminal_is_left_out_with_a_note(foreign, xml, note):
    """FMI leaves it to importers whether they look at terminals at all: the FMU runs."""
    found, (line,) = places(foreign(WHOLE.format(xml)))
    assert note in line
    assert ARCHIVE_PATH in line
    assert "\n" not in line
    assert len(found) == (2 if xml.count("end") == 2 else 0)


BOMB = '<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>' + WHOLE.format("&b;")


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("xml", "reason"),
    [
        (BOMB, "has a document type declaration"),
        ('<!DOCTYPE x SYSTEM "file:///etc/hostname">' + WHOLE.format(END), "has a document type declaration"),
        (WHOLE.format(END)[:-4], "is not well-formed XML"),
        ("<a>" * 300 + "</a>" * 300, "is not well-formed XML"),
        (b"\xff\xfe\x00", "is not well-formed XML"),
        (WHOLE.format('<Terminal name="t" matchingRule="bus">' * 9 + "</Terminal>" * 9), "are more than 8 deep"),
        (WHOLE.format(f'<Terminal name="t" matchingRule="bus">{POSITION * 200_001}</Terminal>'), "more than 200000"),
        (b" " * ((64 << 20) + 1), "is larger than 64 MiB"),
    ],
    ids=["bomb", "external", "cut", "deep", "bytes", "nested", "many", "large"],
)
def test_a_harmful_file_is_refused_in_one_line(foreign, xml, reason):
    path = foreign(xml)
    with pytest.raises(FMUError) as caught:
        places(path)
    text = str(caught.value)
    assert reason in text
    assert ARCHIVE_PATH in text
    assert "\n" not in text
    assert len(text) < 400 + len(str(path))


def test_an_fmu_and_a_component_are_connected_by_their_terminals(foreign):
    """Whatever a member is made of, its terminals connect alike."""
    members = "stop_time: 1 s\nmembers: {rod: {component: servomotor}, sheath: {component: COMPONENT}}\n"
    xml = WHOLE.format(END.replace("inflow", "signal"))
    found = []
    for component, end in (("sheath", "gripper"), (foreign(xml), "end")):
        text = members.replace("COMPONENT", str(component))
        for connection in (f"rod.rod -> sheath.{end}", f"sheath.{end} -> rod.rod"):
            scenario = parse_scenario(f"{text}connections: [{connection}]\n")
            catalogs, problems = resolve_variables(scenario)
            assert problems == []
            links = scenario.variants[0].system(catalogs["base"]).links()
            found.append(sorted((*one.source.key, *one.target.key) for one in links))
    assert (
        found
        == [[("rod", "position", "sheath", "gripper_position"), ("sheath", "reaction_force", "rod", "load_force")]] * 4
    )
