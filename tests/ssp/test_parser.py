"""Every part of a description as it is read: files, numbers, units, connectors, connections, dictionaries, parameters."""

import pytest

from tests.ssp.parts import HEAD, UNITS, bindings, component, connection, connector, description, packed, system
from twin.errors import ScenarioError
from twin.ssp import parser
from twin.ssp.document import SCHEMA_MESSAGE, SSD, SSV, parse_root
from twin.ssp.model import End, Linear, Messages, ValueTable, resolve_unit
from twin.ssp.package import drop_duplicates, open_package
from twin.ssp.parser import SspParser

WHERE = "s.ssp/SystemStructure.ssd:3"


def problems(read):
    """All that was reported."""
    return read.messages.problems + read.messages.deviations + read.messages.notes


# --- files


@pytest.mark.parametrize(
    ("source", "base", "expected"),
    [
        ("a.fmu", "SSD", ("a.fmu", "")),
        ("./resources/a%20b.fmu#part", "SSD", ("resources/a b.fmu", "part")),
        ("proxyfmu://host?file=a.fmu", "SSD", ("a.fmu", "")),
        ("a.fmu", "component", "is inside a component"),
        ("http://h/a.fmu", "SSD", "is no path inside the archive"),
        ("//h/a.fmu", "SSD", "is no path inside the archive"),
        ("/a.fmu", "SSD", "leads out of the archive"),
        ("resources\\a.fmu", "SSD", "leads out of the archive"),
        ("../a.fmu", "SSD", "leads out of the archive"),
        ("resources/../a.fmu", "SSD", "leads out of the archive"),
        ("", "SSD", "is not in the archive"),
        ("b.fmu", "SSD", "is not in the archive"),
        ("resources", "SSD", "is not in the archive"),
    ],
)
def test_where_a_source_is(read, source, base, expected):
    found = read().resolve_uri(source, "here", base)
    if isinstance(expected, tuple):
        assert (found, read.messages.problems) == (expected, [])
    else:
        assert found is None
        assert read.messages.problems[0].startswith(f"here: `{source}` {expected}.")
    assert len(read.messages.deviations) == source.startswith("proxy")


def test_a_file_beside_a_folder_is_read_with_a_note(read):
    (read.folder / "inner").mkdir()
    own = SspParser(read.folder / "inner", "s", Messages(), read.folder, (), True)
    assert own.resolve_uri("../a.fmu", "here") == ("../a.fmu", "")
    assert own.messages.deviations == ["here: ../a.fmu is outside the folder. Put it into resources/."]
    assert own.resolve_uri("../none.fmu", "here") is None
    assert own.messages.problems == ["here: `../none.fmu` leads out of the archive. Put the file into resources/."]


def test_files_that_are_too_large(read, monkeypatch):
    monkeypatch.setattr(parser, "MAX_FILE_BYTES", 10)
    (read.folder / "x.ssv").write_bytes(b"<a></a>   ")
    assert read().document("x.ssv")[1] == "s.ssp/x.ssv"
    (read.folder / "x.ssv").write_bytes(b"<a></a>    ")
    with pytest.raises(ScenarioError, match=r"s.ssp/x.ssv: is larger than 0 MiB"):
        read().document("x.ssv")


def test_another_kind_of_file(read):
    text = f'<ssm:ParameterMapping {HEAD} version="1.0"/>'
    (read.folder / "x.ssv").write_text(text)
    own = read()
    assert own.file("x.ssv", "here", "SSD", f"{SSV}ParameterSet") is None
    assert read.messages.problems == ["here: x.ssv is no ParameterSet. Name one that is."]
    assert own.file("y.ssv", "here", "SSD", f"{SSV}ParameterSet") is None


# --- numbers, units, transformations


@pytest.mark.parametrize(
    ("attribute", "expected", "is_reported"),
    [
        ("", 7.0, False),
        ('x="2.5"', 2.5, False),
        ('x="-1e3"', -1000.0, False),
        ('x="inf"', 7.0, True),
        ('x="a"', 7.0, True),
    ],
)
def test_numbers(read, attribute, expected, is_reported):
    own = read()
    assert own.number(parse_root(f"<a {attribute}/>".encode(), "x"), "x", "s", 7.0) == expected
    assert read.messages.problems == [f"s:1: x is `{attribute[3:-1]}`, expected a number. Correct it."] * is_reported
    assert own.number(None, "x", "s", 7.0) == 7.0
    assert own.number(None, "x", "s") is None


def test_units_are_those_of_the_file(read):
    """A name with its usual meaning stays; another meaning is written behind it."""
    text = UNITS.replace(
        "</ssd:Units>",
        '<ssc:Unit name="s"><ssc:BaseUnit m="1" factor="2"/></ssc:Unit><ssc:Unit name="none"/>'
        '<ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit></ssd:Units>',
    )
    own = read()
    units = own.units(parse_root(f"<a {HEAD}>{text}</a>".encode(), "x"), "s", SSD)
    shown = [resolve_unit(units, {"unit": name}, "x:1", []) for name in ("mm", "m", "N", None, "s")]
    assert shown == ["mm", "m", "N", None, "s {2.0 m + 0.0}"]
    assert read.messages.problems == ["s:5: unit `mm` is defined twice. Keep one."]


@pytest.mark.parametrize(
    ("inside", "expected"),
    [
        ("", None),
        ("<ssc:LinearTransformation/>", Linear(1.0, 0.0)),
        ('<ssc:LinearTransformation factor="-2" offset="0.5"/>', Linear(-2.0, 0.5)),
        ('<ssc:LinearTransformation factor="0"/>', Linear(0.0, 0.0)),
        (
            '<ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="7"/></ssc:IntegerMappingTransformation>',
            ValueTable({1: 7}),
        ),
        (
            '<ssc:BooleanMappingTransformation><ssc:MapEntry source="true" target="0"/></ssc:BooleanMappingTransformation>',
            ValueTable({True: False}),
        ),
    ],
)
def test_transformations(read, inside, expected):
    assert read().change(parse_root(f"<a {HEAD}>{inside}</a>".encode(), "x"), "s") == expected
    assert problems(read) == []


def test_a_value_that_is_mapped_twice(read):
    inside = '<ssc:MapEntry source="1" target="7"/><ssc:MapEntry source="1" target="8"/>'
    text = f"<a {HEAD}><ssc:IntegerMappingTransformation>{inside}</ssc:IntegerMappingTransformation></a>"
    assert read().change(parse_root(text.encode(), "x"), "s") == ValueTable({1: 8})
    assert read.messages.problems == ["s:1: `1` is mapped twice. Keep one entry."]


@pytest.mark.parametrize(
    ("inside", "expected"),
    [
        ('<x:FixedStepAlgorithm xmlns:x="urn:x" baseStepSize="0.5"/>', 0.5),
        ('<x:A xmlns:x="urn:x"><x:FixedStepMaster stepSize="0.25"/></x:A>', 0.25),
        ('<x:FixedStepMaster xmlns:x="urn:x" baseStepSize="0.5"/>', None),
        ("", None),
    ],
)
def test_the_step_of_other_tools(read, inside, expected):
    text = f'<a {HEAD}><ssd:Annotations><ssc:Annotation type="t">{inside}</ssc:Annotation></ssd:Annotations></a>'
    assert read().step(parse_root(text.encode(), "x"), "s") == expected
    assert read().step(None, "s") is None


# --- elements


def test_a_component_with_its_connectors(read):
    ends = (
        connector("y", "output", "mm"),
        connector("u", "input"),
        connector("k", "odd"),
    )
    root = read.root(description(system(component("a", "a.fmu", *ends))))
    (found,) = root.elements
    assert (root.kind, root.name, found.kind, found.name, found.where) == (
        "system",
        "root",
        "component",
        "a",
        "s.ssp/SystemStructure.ssd:4",
    )
    assert (found.fmu, found.implementation) == (str(read.folder / "a.fmu"), "any")
    assert {one.name: (one.kind, one.unit, one.where) for one in found.connectors.values()} == {
        "y": ("output", "mm", found.where),
        "u": ("input", None, found.where),
        "k": ("unspecified", None, found.where),
    }


def test_components_that_are_none(read):
    text = system(
        '<ssd:Component name="empty"/><ssd:Component name="s" source="a.fmu" implementation="ScheduledExecution"/>\n'
        '<ssd:Component name="m" source="a.fmu" implementation="ModelExchange"/>'
        f'<ssd:Component name="two" source="a.fmu"><ssd:Connectors>{connector("y", "output") * 2}</ssd:Connectors></ssd:Component>'
    )
    empty, scheduled, exchange, _ = read.root(description(text)).elements
    assert (empty.kind, empty.fmu) == ("system", "")
    assert read.messages.notes == ["s.ssp/SystemStructure.ssd:4: component `empty` has no source: it does nothing."]
    assert (scheduled.implementation, exchange.implementation) == ("ScheduledExecution", "ModelExchange")
    assert (
        "s.ssp/SystemStructure.ssd:4: component `s` wants ScheduledExecution. Use an FMU with Co-Simulation, and drop `implementation`."
        in read.messages.problems
    )
    assert "s.ssp/SystemStructure.ssd:5: `two` has two connectors `y`. Rename one." in read.messages.problems


@pytest.mark.parametrize(
    ("more", "inside", "start", "end", "change", "suppress"),
    [
        ("", "", End("a", "y"), End("b", "u"), None, False),
        ('suppressUnitConversion="true"', "", End("a", "y"), End("b", "u"), None, True),
        ('suppressUnitConversion="1"', "", End("a", "y"), End("b", "u"), None, True),
        ('suppressUnitConversion="false"', "", End("a", "y"), End("b", "u"), None, False),
        ('startIndices="2 1" endIndices="3"', "", End("a", "y[2,1]"), End("b", "u[3]"), None, False),
        ("", '<ssc:LinearTransformation factor="3"/>', End("a", "y"), End("b", "u"), Linear(3.0), False),
    ],
)
def test_connections(read, more, inside, start, end, change, suppress):
    parts = component("a", "a.fmu") + component("b", "a.fmu")
    (found,) = read.root(description(system(parts, connection("a.y", "b.u", more, inside)))).connections
    assert (found.start, found.end, found.change, found.suppress, found.where) == (
        start,
        end,
        change,
        suppress,
        "s.ssp/SystemStructure.ssd:6",
    )


def test_a_connection_of_the_system_itself(read):
    text = '<ssd:Connection startConnector="in" endElement="" endConnector="out"/>' + connection("in", "a.u")
    first, second = read.root(description(system(component("a", "a.fmu"), text))).connections
    assert (first.start, first.end, second.start, second.end) == (
        End(None, "in"),
        End(None, "out"),
        End(None, "in"),
        End("a", "u"),
    )
    assert read.messages.deviations == [
        's.ssp/SystemStructure.ssd:5: endElement="" is read as the system itself. SSP leaves the attribute out.'
    ]


def test_systems_inside_and_beside(read):
    """A system used by its id, one in another file of the archive, with the connectors and bindings of both."""
    inner = '<ssd:System name="inner" id="i">{}<ssd:Elements>{}</ssd:Elements></ssd:System>'
    ends = f"<ssd:Connectors>{connector('in', 'input')}</ssd:Connectors>"
    (read.folder / "other.ssd").write_text(description(inner.format(ends + bindings("c.k=1"), component("c", "a.fmu"))))
    own = f"<ssd:Connectors>{connector('out', 'output')}</ssd:Connectors>" + bindings("c.k=2")
    parts = "".join(
        f'<ssd:Component name="{name}" type="application/x-ssp-definition" source="{source}">{more}</ssd:Component>'
        for name, source, more in (("x", "#i", ""), ("y", "other.ssd", own))
    )
    root = read.root(description(system(parts + inner.format("", component("d", "a.fmu")))))
    x, y, z = root.elements
    assert [(one.kind, one.name, [child.name for child in one.elements]) for one in (x, y, z)] == [
        ("system", "x", ["d"]),
        ("system", "y", ["c"]),
        ("system", "inner", ["d"]),
    ]
    assert list(y.connectors) == ["in", "out"]
    assert [[value.value for value in one.parameters] for one in y.bindings] == [[1.0], [2.0]]
    assert problems(read) == []


def test_descriptions_that_contain_themselves(read):
    part = '<ssd:Component name="x" type="application/x-ssp-definition" source="{}"/>'
    (read.folder / "other.ssd").write_text(description(system(part.format("other.ssd"))))
    with pytest.raises(ScenarioError, match=r"s.ssp/other.ssd:4: `other.ssd` is a part of itself. Break the circle."):
        read.root(description(system(part.format("other.ssd"))))
    (read.folder / "other.ssd").write_text("<a/>")
    (found,) = read.root(description(system(part.format("other.ssd")))).elements
    assert (found.kind, found.elements) == ("system", [])
    assert read.messages.problems[0].startswith("s.ssp/other.ssd:1: <a> is no root of an SSP file.")


@pytest.mark.parametrize(("name", "limit", "deepest"), [("MAX_DEPTH", 4, 3), ("MAX_ELEMENTS", 4, 3)])
def test_limits(read, monkeypatch, name, limit, deepest):
    """The root counts as well."""
    monkeypatch.setattr(parser, name, limit)

    def nested(depth):
        return f'<ssd:System name="s{depth}"><ssd:Elements>{nested(depth - 1) if depth else ""}</ssd:Elements></ssd:System>'

    read.root(description(system(nested(deepest - 1))))
    with pytest.raises(ScenarioError, match="more than 4"):
        read.root(description(system(nested(deepest))))


def test_one_variant_of_a_package_inside(read):
    small = (
        description(system(component("c", "a.fmu")), name="default"),
        description(system(component("d", "a.fmu")), name="b"),
    )
    packed(read.folder / "small.ssp", small[0], {"Other.ssd": small[1], "a.fmu": b""})
    part = '<ssd:Component name="{0}" type="application/x-ssp-package" source="small.ssp{1}"/>'
    parts = part.format("x", "") + part.format("y", "#Other.ssd") + part.format("z", "#None.ssd")
    x, y, z = read.root(description(system(parts))).elements
    assert [[child.name for child in one.elements] for one in (x, y, z)] == [["c"], ["d"], ["c"]]
    assert read.messages.problems == [
        "s.ssp/SystemStructure.ssd:4: small.ssp has no None.ssd. Name one of its descriptions."
    ]
    assert open_package(read.folder / "small.ssp", "small.ssp", read.folder / "build").variants[1].name == "b"


def test_a_problem_is_reported_once():
    """What the schema says of a value on a line that another message names is left out."""
    own, other = "f:3: `fast` is no number.", "f:4: `slow` is no number."
    schema = f"f:3: {SCHEMA_MESSAGE} of SSP 1.0: 'fast' is no double. Correct it."
    elsewhere = schema.replace("f:3", "f:5")
    unknown = schema.replace("'fast'", "'kind'")
    assert drop_duplicates([schema, own, own, other, elsewhere, unknown, unknown]) == [own, other, elsewhere, unknown]
    assert drop_duplicates([schema]) == [schema]
