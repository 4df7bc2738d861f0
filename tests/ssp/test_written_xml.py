"""The XML that is written for an SSP, to the letter: connectors, units, start values, connections, annotations, the archive."""

import zipfile

import numpy as np
import pytest
from lxml import etree

from tests.every_case import every_case
from twin.coupling import DTYPES, MemberVariable
from twin.errors import ScenarioError
from twin.ssp import writer
from twin.ssp.document import NAMESPACE, declare_prefixes, violations
from twin.ssp.model import Linear
from twin.ssp.writer import OutlineComponent, OutlineConnection, SystemOutline

ITEMS = (("off", 0), ("on", 2))


def tree(node):
    """An element as (tag, attributes, children) without namespaces."""
    return etree.QName(node).localname, dict(node.attrib), [tree(child) for child in node]


def wire(source="a.y.", target="b.u.", change=None, **rest):
    """A connection `element.connector.indices`."""
    return OutlineConnection(tuple(source.split(".")), tuple(target.split(".")), change or Linear(), **rest)


def outline(components=(), wires=(), **changes):
    """A system of some parts."""
    settings = {"name": "bench", "description": "", "version": "1.0", "start": 0.0, "stop": 0.5, "step": 0.001}
    return SystemOutline(**settings | changes, components=list(components), wires=list(wires))


def connector(name, causality, kind, unit="", shape=(), items=()):
    """A variable of an FMU."""
    return MemberVariable(name, causality, "", kind, DTYPES[kind], shape, unit, items=items)


def part(name="a", ports=(), values=(), **rest):
    """A component with an FMU."""
    return OutlineComponent(name, f"{name}.fmu", b"fmu of " + name.encode(), list(ports), list(values), **rest)


@every_case(
    ("version", "port", "expected"),
    [
        ("1.0", connector("y", "output", "Float64", "mm"), ("output", "Real", {"unit": "mm"}, [])),
        ("2.0", connector("y", "output", "Float64", "mm"), ("output", "Float64", {"unit": "mm"}, [])),
        ("1.0", connector("y", "output", "Float32", "mm"), ("output", "Real", {"unit": "mm"}, [])),
        ("2.0", connector("y", "output", "Float32", "mm"), ("output", "Float32", {"unit": "mm"}, [])),
        ("2.0", connector("y", "output", "Float64"), ("output", "Float64", {}, [])),
        ("1.0", connector("n", "input", "UInt8", "mm"), ("input", "Integer", {}, [])),
        ("2.0", connector("n", "input", "UInt8", "mm"), ("input", "UInt8", {}, [])),
        ("2.0", connector("b", "input", "Boolean"), ("input", "Boolean", {}, [])),
        ("2.0", connector("s", "parameter", "String"), ("parameter", "String", {}, [])),
        (
            "2.0",
            connector("e", "output", "Enumeration", items=ITEMS),
            ("output", "Enumeration", {"name": "enumeration_1"}, []),
        ),
        ("2.0", connector("v", "output", "Float64", shape=(2, 3)), ("output", "Float64", {}, ["2", "3"])),
        # SSP 1.0 has fewer kinds of connectors
        ("1.0", connector("k", "structuralParameter", "Int32"), ("parameter", "Integer", {}, [])),
        ("2.0", connector("k", "structuralParameter", "Int32"), ("structuralParameter", "Int32", {}, [])),
    ],
)
def test_connectors(version, port, expected):
    made = writer.component(part(ports=[port]), version, writer.UnitWriter(), writer.Enumerations())
    kind, typed, attributes, sizes = expected
    dimensions = [("Dimension", {"size": size}, []) for size in sizes]
    assert tree(made) == (
        "Component",
        {"name": "a", "type": "application/x-fmu-sharedlibrary", "source": "resources/a.fmu"},
        [
            (
                "Connectors",
                {},
                [("Connector", {"name": port.name, "kind": kind}, [(typed, attributes, []), *dimensions])],
            )
        ],
    )


def test_a_component_without_connectors_and_with_an_interface():
    made = writer.component(part(implementation="ModelExchange"), "2.0", writer.UnitWriter(), writer.Enumerations())
    assert (made.get("implementation"), len(made)) == ("ModelExchange", 0)


def test_units_are_defined_once_by_powers_of_base_units():
    """mm is 1e-3 m; N is kg m s^-2; a unit with an offset; a second one that is shown by the same name gets another."""
    units = writer.UnitWriter()
    assert units.element(writer.SSD) is None
    texts = ("mm", "N", "K", "mm", "", "K {1.0 K + 273.15}", "K {2.0 K + 0.0}")
    assert [units.name(text) for text in texts] == ["mm", "N", "K", "mm", "", "K'", "K''"]
    assert tree(units.element(writer.SSD)) == (
        "Units",
        {},
        [
            ("Unit", {"name": "mm"}, [("BaseUnit", {"m": "1", "factor": "0.001"}, [])]),
            ("Unit", {"name": "N"}, [("BaseUnit", {"kg": "1", "m": "1", "s": "-2"}, [])]),
            ("Unit", {"name": "K"}, [("BaseUnit", {"K": "1"}, [])]),
            ("Unit", {"name": "K'"}, [("BaseUnit", {"K": "1", "offset": "273.15"}, [])]),
            ("Unit", {"name": "K''"}, [("BaseUnit", {"K": "1", "factor": "2.0"}, [])]),
        ],
    )


@pytest.mark.slow  # a table of all units is read
def test_a_unit_that_is_not_known_is_left_out():
    units = writer.UnitWriter()
    assert (units.name("no unit"), units.element(writer.SSD)) == ("", None)


def test_enumerations_are_defined_once():
    enumerations = writer.Enumerations()
    assert enumerations.element(writer.SSV) is None
    other = (("off", 0), ("on", 1))
    assert [enumerations.name(items) for items in (ITEMS, other, ITEMS)] == [
        "enumeration_1",
        "enumeration_2",
        "enumeration_1",
    ]
    made = enumerations.element(writer.SSV)
    assert made.tag == f"{writer.SSV}Enumerations"
    assert tree(made)[2] == [
        (
            "Enumeration",
            {"name": f"enumeration_{number}"},
            [("Item", {"name": name, "value": str(value)}, []) for name, value in items],
        )
        for number, items in ((1, ITEMS), (2, other))
    ]


@every_case(
    ("port", "value", "expected"),
    [
        (connector("x", "parameter", "Float64", "mm"), 0.1, {"unit": "mm", "value": "0.1"}),
        (connector("x", "parameter", "Float64"), np.float64(1e-300), {"value": "1e-300"}),
        (connector("x", "parameter", "Float32"), np.float32(0.1), {"value": "0.10000000149011612"}),
        (connector("x", "parameter", "Int32"), np.int32(-3), {"value": "-3"}),
        (connector("x", "parameter", "Boolean"), np.bool_(True), {"value": "true"}),
        (connector("x", "parameter", "Boolean"), False, {"value": "false"}),
        (connector("x", "parameter", "String"), "a b", {"value": "a b"}),
        (connector("x", "parameter", "Enumeration", items=ITEMS), 2, {"name": "enumeration_1", "value": "on"}),
        (connector("x", "parameter", "Enumeration", items=ITEMS), 1, {"name": "enumeration_1", "value": "1"}),
        (
            connector("x", "parameter", "Float64", shape=(2, 2)),
            np.array([[1.0, 2.0], [3.0, 0.5]]),
            {"value": "1.0 2.0 3.0 0.5"},
        ),
        (connector("x", "parameter", "Boolean", shape=(2,)), np.array([True, False]), {"value": "true false"}),
    ],
)
def test_start_values(port, value, expected):
    """Written so that they read back to the same bits."""
    root = writer.parameter_set(part(values=[(port, value)]), "2.0")
    assert dict(root.attrib) == {"version": "2.0", "name": "initialValues"}
    assert root.tag == f"{writer.SSV}ParameterSet"
    parameter = root[0][0]
    assert parameter.get("name") == "x"
    assert tree(parameter[0]) == (port.type, expected, [])
    assert [node.get("size") for node in parameter[1:]] == [str(size) for size in port.shape]
    assert [etree.QName(node).localname for node in root[1:]] == ["Enumerations"] * bool(port.items) + ["Units"] * bool(
        port.unit
    )
    assert violations(etree.fromstring(etree.tostring(root)), "a.ssv") == []


def test_arrays_of_texts_and_items_are_elements():
    texts = (connector("s", "parameter", "String", shape=(2,)), np.array(["a b", "c"], object))
    chosen = (connector("e", "parameter", "Enumeration", shape=(2,), items=ITEMS), np.array([2, 0]))
    found = [tree(node[0]) for node in writer.parameter_set(part(values=[texts, chosen]), "2.0")[0]]
    assert found == [
        ("String", {}, [("Value", {"value": "a b"}, []), ("Value", {"value": "c"}, [])]),
        ("Enumeration", {"name": "enumeration_1"}, [("Value", {"value": "on"}, []), ("Value", {"value": "off"}, [])]),
    ]


@every_case(
    ("made", "attributes", "inside"),
    [
        (wire(), {}, []),
        (wire("a.y.2 1", "b.u.3"), {"startIndices": "2 1", "endIndices": "3"}, []),
        (
            wire(change=Linear(2.0, 0.0)),
            {"suppressUnitConversion": "true"},
            [("LinearTransformation", {"factor": "2.0", "offset": "0.0"}, [])],
        ),
        (
            wire(change=Linear(1.0, -0.5)),
            {"suppressUnitConversion": "true"},
            [("LinearTransformation", {"factor": "1.0", "offset": "-0.5"}, [])],
        ),
        (
            wire(scenario_keys={"hold": True}),
            {},
            [
                (
                    "Annotations",
                    {},
                    [("Annotation", {"type": "local.catheter-twin"}, [("Connection", {"hold": "true"}, [])])],
                )
            ],
        ),
    ],
)
def test_connections(made, attributes, inside):
    ends = {"startElement": "a", "startConnector": "y", "endElement": "b", "endConnector": "u"}
    assert tree(writer.connection(made)) == ("Connection", ends | attributes, inside)


NOTE = (
    f'<ssc:Annotation xmlns:ssc="{NAMESPACE}Common" type="{{}}"><x:{{}} xmlns:x="urn:x" stepSize="9"/></ssc:Annotation>'
)


def note(kind, tag):
    """An annotation of another tool."""
    return NOTE.format(kind, tag).encode()


@pytest.mark.parametrize(
    ("prefix", "part"),
    [
        ("ssd", "SystemStructureDescription"),
        ("ssc", "SystemStructureCommon"),
        ("ssv", "SystemStructureParameterValues"),
        ("ssm", "SystemStructureParameterMapping"),
        ("ssb", "SystemStructureSignalDictionary"),
    ],
)
def test_an_undeclared_prefix_has_its_usual_namespace(prefix, part):
    content, prefixes = declare_prefixes(f"<{prefix}:Root/>".encode())
    assert prefixes == [prefix]
    assert etree.fromstring(content).tag == f"{{http://ssp-standard.org/SSP1/{part}}}Root"


def test_annotations_of_others_are_kept_except_the_step():
    """The step is written anew for libcosim and OMSimulator; this project's own annotations come from the scenario."""
    given = [
        note("org.example", "text"),
        note("org.x", "FixedStepMaster"),
        note("y", "FixedStepAlgorithm"),
        note("local.catheter-twin", "z"),
    ]
    kept = list(writer.notes("Member", {}, given))
    assert [node.get("type") for node in kept] == ["org.example"]
    both = list(writer.notes("Member", {"isolate": True}, given))
    assert [node.get("type") for node in both] == ["local.catheter-twin", "org.example"]
    assert tree(both[0])[2] == [("Member", {"isolate": "true"}, [])]


def test_a_whole_description():
    """Annotations in their places; times of the experiment; the step [s] for both tools; connections only where there are any."""
    y, u = connector("y", "output", "Float64", "mm"), connector("u", "input", "Enumeration", items=ITEMS)
    parts = [
        part("a", [y]),
        part("b", [u], [(u, 2)], scenario_keys={"isolate": True}, annotations=[note("of.b", "c")]),
    ]
    whole = outline(
        parts,
        [wire()],
        description="Two parts",
        start=0.25,
        tool="twin 1",
        annotations={"": [note("of.root", "r")], "DefaultExperiment": [note("of.experiment", "e")]},
        scenario_keys={"order": 1},
    )
    root = writer.description(whole)
    assert violations(etree.fromstring(etree.tostring(root)), "a.ssd") == []
    name, attributes, (system, enumerations, units, experiment, annotations) = tree(root)
    assert (name, attributes) == (
        "SystemStructureDescription",
        {"name": "bench", "version": "1.0", "generationTool": "twin 1", "description": "Two parts"},
    )
    assert (enumerations[0], units[0], experiment[0]) == ("Enumerations", "Units", "DefaultExperiment")
    tag, attributes, (elements, connections, oms) = system
    assert (tag, attributes) == ("System", {"name": "system"})
    assert [(one[1]["name"], [child[0] for child in one[2]]) for one in elements[2]] == [
        ("a", ["Connectors"]),
        ("b", ["Connectors", "ParameterBindings", "Annotations"]),
    ]
    assert elements[2][1][2][1] == ("ParameterBindings", {}, [("ParameterBinding", {"source": "resources/b.ssv"}, [])])
    assert [one[1]["type"] for one in elements[2][1][2][2][2]] == ["local.catheter-twin", "of.b"]
    assert len(connections[2]) == 1
    master = ("FixedStepMaster", {"description": "oms-ma", "stepSize": "0.001"}, [])
    assert oms == (
        "Annotations",
        {},
        [
            (
                "Annotation",
                {"type": "org.openmodelica"},
                [("Annotations", {}, [("SimulationInformation", {}, [master])])],
            )
        ],
    )
    assert experiment[1] == {"startTime": "0.25", "stopTime": "0.5"}
    of_osp, own, other = experiment[2][0][2]
    assert of_osp == (
        "Annotation",
        {"type": "com.opensimulationplatform"},
        [("Algorithm", {}, [("FixedStepAlgorithm", {"baseStepSize": "0.001"}, [])])],
    )
    assert (own[2], other[1]["type"]) == ([("Experiment", {"order": "1"}, [])], "of.experiment")
    assert [one[1]["type"] for one in annotations[2]] == ["of.root"]

    plain = writer.description(outline([part()]))
    assert [etree.QName(node).localname for node in plain] == ["System", "DefaultExperiment"]
    assert "description" not in plain.attrib
    assert [etree.QName(node).localname for node in plain[0]] == ["Elements", "Annotations"]


def test_the_archive(tmp_path):
    """FMUs are stored as they are, texts compressed; the same system gives the same archive on every machine and day."""
    k = (connector("k", "parameter", "Float64"), 2.0)
    whole = outline([part("a", values=[k]), part("b")], extra="seeds: 3\n")
    path = tmp_path / "a.ssp"
    writer.write(whole, path)
    with zipfile.ZipFile(path) as archive:
        entries = {info.filename: info for info in archive.infolist()}
        assert archive.read("SystemStructure.ssd") == writer.text(writer.description(whole))
        assert archive.read("extra/catheter-twin/SystemStructure.yaml") == b"seeds: 3\n"
        assert archive.read("resources/b.fmu") == b"fmu of b"
    texts = ["SystemStructure.ssd", "resources/a.ssv", "extra/catheter-twin/SystemStructure.yaml"]
    assert sorted(entries) == sorted([*texts, "resources/a.fmu", "resources/b.fmu"])
    assert {name: info.compress_type for name, info in entries.items()} == {
        **dict.fromkeys(texts, zipfile.ZIP_DEFLATED),
        "resources/a.fmu": zipfile.ZIP_STORED,
        "resources/b.fmu": zipfile.ZIP_STORED,
    }
    assert {(info.date_time, info.create_system, info.external_attr) for info in entries.values()} == {
        ((1980, 1, 1, 0, 0, 0), 3, 0o100644 << 16)
    }
    writer.write(outline([part("a", values=[k]), part("b")]), tmp_path / "b.ssp")
    with zipfile.ZipFile(tmp_path / "b.ssp") as archive:
        assert not any(name.startswith("extra/") for name in archive.namelist())


def test_what_cannot_be_written(tmp_path):
    with pytest.raises(ScenarioError, match=r"a.ssp: a title, a name or a text cannot stand in XML"):
        writer.write(outline([part()], description="a\x01b"), tmp_path / "a.ssp")
    with pytest.raises(ScenarioError, match=r"a.ssp/SystemStructure.ssd:.*'mystery'"):
        writer.write(outline([part(ports=[connector("y", "mystery", "Float64")])]), tmp_path / "a.ssp")
    assert not (tmp_path / "a.ssp").exists()
