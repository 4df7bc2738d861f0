"""Signal dictionaries, parameter sets and mappings as they are read, inline and from files."""

import pytest

from tests.every_case import every_case
from tests.ssp.parts import HEAD, UNITS, component, description, system
from twin.ssp.model import Linear

WHERE = "s.ssp/SystemStructure.ssd:3"

ENTRY = '<ssb:DictionaryEntry name="{}"><ssc:Real{}/></ssb:DictionaryEntry>'
DICTIONARY = f'<ssb:SignalDictionary {HEAD} version="1.0">{{}}{UNITS.replace("ssd:", "ssb:")}</ssb:SignalDictionary>'


def test_signal_dictionaries(read):
    (read.folder / "d.ssb").write_text(DICTIONARY.format(ENTRY.format("p", ' unit="mm"')))
    inline = f'<ssd:SignalDictionary name="here">{DICTIONARY.format(ENTRY.format("q", ""))}</ssd:SignalDictionary>'
    others = '<ssd:SignalDictionary name="file" source="d.ssb"/><ssd:SignalDictionary name="none" source="e.ssb"/>'
    text = system(
        '<ssd:SignalDictionaryReference name="plug" dictionary="here"/>',
        after=f'<ssd:SignalDictionaries>{inline}{others}<ssd:SignalDictionary name="empty"/></ssd:SignalDictionaries>',
    )
    root = read.root(description(text))
    assert root.dictionaries == {"here": {"q": None}, "file": {"p": "mm"}, "none": {}, "empty": {}}
    assert (root.elements[0].kind, root.elements[0].dictionary) == ("dictionary", "here")
    assert any("`e.ssb` is not in the archive" in text for text in read.messages.problems)


def bound(read, more="", inside=""):
    """The bindings of the system."""
    text = (
        f"<ssd:ParameterBindings><ssd:ParameterBinding {more}>{inside}</ssd:ParameterBinding></ssd:ParameterBindings>"
    )
    return read.root(description(system(component("a", "a.fmu"), before=text))).bindings


SET = f'<ssv:ParameterSet {HEAD} version="1.0" name="p"><ssv:Parameters>{{}}</ssv:Parameters>{{}}</ssv:ParameterSet>'
VALUE = '<ssv:Parameter name="{}"><ssv:{} value="{}"{}/></ssv:Parameter>'


def test_parameter_sets(read):
    values = (
        VALUE.format("x", "Real", "2.5", ' unit="mm"')
        + VALUE.format("n", "Integer", "-3", "")
        + VALUE.format("b", "Boolean", "1", "")
        + VALUE.format("s", "String", " t ", "")
        + VALUE.format("e", "Enumeration", "on", ' name="E"')
        + VALUE.format("x", "Real", "4", "")
    )
    text = f"<ssd:ParameterValues>{SET.format(values, UNITS.replace('ssd:', 'ssv:'))}</ssd:ParameterValues>"
    (found,) = bound(read, 'prefix="a."', text)
    assert [(one.name, one.value, one.unit) for one in found.parameters] == [
        ("a.x", 4.0, None),
        ("a.n", -3, None),
        ("a.b", True, None),
        ("a.s", " t ", None),
        ("a.e", "on", None),
    ]
    assert (found.mapping, found.where) == (None, WHERE)
    assert f"{WHERE}: `a.x` has two values in one set: the last one is used. Keep one." in read.messages.deviations


def test_parameter_sets_and_mappings_from_files(read):
    (read.folder / "p.ssv").write_text(
        SET.format(VALUE.format("x", "Real", "2.5", ' unit="mm"'), UNITS.replace("ssd:", "ssv:"))
    )
    (read.folder / "p.ssm").write_text(
        f'<ssm:ParameterMapping {HEAD} version="1.0"><ssm:MappingEntry source="x" target="a.y" suppressUnitConversion="1">'
        '<ssc:LinearTransformation factor="2"/></ssm:MappingEntry><ssm:MappingEntry source="x" target="a.y"/>'
        '<ssm:MappingEntry source="" target="a.z"/><ssm:MappingEntry source="x" target="a.w"/></ssm:ParameterMapping>'
    )
    (found,) = bound(read, 'source="p.ssv"', '<ssd:ParameterMapping source="p.ssm"/>')
    (value,) = found.parameters
    assert (value.name, value.value, value.unit, value.where) == ("x", 2.5, "mm", "s.ssp/p.ssv:1")
    assert [(one.source, one.target, one.change, one.suppress, one.where) for one in found.mapping] == [
        ("x", "a.y", None, False, "s.ssp/p.ssm:1"),
        ("x", "a.w", None, False, "s.ssp/p.ssm:1"),
    ]
    assert read.messages.problems == ["s.ssp/p.ssm:1: `a.y` is mapped twice. Keep one entry."]
    assert read.messages.deviations == ["s.ssp/p.ssm:1: the mapping of `a.z` has an empty source: it is left out."]


def test_a_mapping_with_a_transformation(read):
    mapping = (
        '<ssd:ParameterMapping><ssm:ParameterMapping version="1.0"><ssm:MappingEntry source="x" target="y" '
        'suppressUnitConversion="true"><ssc:LinearTransformation factor="2" offset="1"/></ssm:MappingEntry>'
        "</ssm:ParameterMapping></ssd:ParameterMapping>"
    )
    values = f"<ssd:ParameterValues>{SET.format(VALUE.format('x', 'Real', '1', ''), '')}</ssd:ParameterValues>"
    ((entry,),) = (one.mapping for one in bound(read, "", values + mapping))
    assert (entry.change, entry.suppress) == (Linear(2.0, 1.0), True)


@pytest.mark.parametrize(
    ("more", "inside", "expected"),
    [
        ("", "", "has neither `source` nor ParameterValues. Give one of them."),
        ('type="text/csv" source="a.fmu"', "", "parameters as `text/csv` cannot be read. Give them as a ParameterSet."),
        ('source="none.ssv"', "", "`none.ssv` is not in the archive. Add it, or correct the name."),
    ],
)
def test_bindings_that_cannot_be_read(read, more, inside, expected):
    assert bound(read, more, inside) == []
    assert f"{WHERE}: {expected}" in read.messages.problems


def test_values_that_cannot_be_read(read):
    values = (
        VALUE.format("x", "Real", "fast", "") + '<ssv:Parameter name="none"/>' + VALUE.format("b", "Binary", "00", "")
    )
    (found,) = bound(read, "", f"<ssd:ParameterValues>{SET.format(values, '')}</ssd:ParameterValues>")
    assert found.parameters == []
    for text in ("`fast` is not a finite number. Correct it.", "parameter `none` has no value. Give it one."):
        assert f"{WHERE}: {text}" in read.messages.problems
    assert any("`00` is binary, which no member takes here. Leave it out." in text for text in read.messages.problems)


@every_case(
    ("kind", "inside", "expected"),
    [
        ('Float64 value="2.5"', "", 2.5),
        ('Float64 value="2.5"', '<ssc:Dimension size="1"/>', [2.5]),
        ('Int32 value="1 2 3 4 5 6"', '<ssc:Dimension size="2"/><ssc:Dimension size="3"/>', [[1, 2, 3], [4, 5, 6]]),
        (
            'UInt8 value="1 2 3 4"',
            '<ssc:Dimension size="2"/><ssc:Dimension size="1"/><ssc:Dimension size="2"/>',
            [[[1, 2]], [[3, 4]]],
        ),
        ("Float64", "2.5", 2.5),
        ("Boolean", "true false", "parameter `x` has 2 values and no Dimension. Keep one value."),
        ("String", "a b", "parameter `x` has 2 values and no Dimension. Keep one value."),
        ("String", 'a b <ssc:Dimension size="2"/>', ["a", "b"]),
        ('String value="a b"', '<ssc:Dimension size="1"/>', ["a b"]),
        ('Float64 value="1 2"', '<ssc:Dimension size="3"/>', "parameter `x` has 2 values for 3. Correct it."),
        (
            'Float64 value="1 2 3"',
            '<ssc:Dimension size="2"/><ssc:Dimension size="2"/>',
            "parameter `x` has 3 values for 2 x 2. Correct it.",
        ),
        ('Float64 value=""', '<ssc:Dimension size="0"/>', "parameter `x` has 0 values for 0. Correct it."),
        (
            'Float64 value="1"',
            '<ssc:Dimension size="-1"/><ssc:Dimension size="-1"/>',
            "parameter `x` has 1 values for -1 x -1. Correct it.",
        ),
        ('Float64 value="1"', '<ssc:Dimension size="many"/>', "`many` is not a whole number. Correct it."),
        ('Float64 value="1e400"', "", "`1e400` is not a finite number. Correct it."),
        ('Boolean value="yes"', "", "`yes` is not true or false. Correct it."),
        ('Int32 value="+12345678901234567890"', "", 12345678901234567890),
        ('Int32 value="123456789012345678901"', "", "`123456789012345678901` is not a whole number. Correct it."),
    ],
)
def test_values_of_version_2_may_be_arrays(read, kind, inside, expected):
    """Values are in an attribute, separated by spaces, or in elements of their own."""
    texts, mark, dimensions = inside.partition("<")
    elements = "".join(f'<ssv:Value value="{text}"/>' for text in texts.split())
    values = f'<ssv:Parameter name="x"><ssv:{kind}>{elements}</ssv:{kind.split()[0]}>{mark}{dimensions}</ssv:Parameter>'
    found = bound(read, "", f"<ssd:ParameterValues>{SET.format(values, '')}</ssd:ParameterValues>")
    given = [parameter.value for binding in found for parameter in binding.parameters]
    if isinstance(expected, str):
        assert given == []
        assert f"{WHERE}: {expected}" in read.messages.problems
    else:
        assert given == [expected]
        assert type(given[0]) is type(expected)


def test_a_mapping_of_another_kind_is_none(read):
    values = f"<ssd:ParameterValues>{SET.format(VALUE.format('x', 'Real', '1', ''), '')}</ssd:ParameterValues>"
    (found,) = bound(read, "", values + '<ssd:ParameterMapping type="text/csv" source="a.fmu"/>')
    assert found.mapping is None
    assert f"{WHERE}: a mapping as `text/csv` cannot be read. Give it as a ParameterMapping." in read.messages.problems
    (found,) = bound(read, "", values + '<ssd:ParameterMapping source="none.ssm"/>')
    assert found.mapping == []
