"""Values from text and numbers to the types of FMU variables and back, and the units that FMUs define."""

import numpy as np
import pytest
from lxml import etree

from tests.every_case import every_case
from twin.component.unit import Unit
from twin.coupling import MemberVariable
from twin.errors import FMUError
from twin.fmi import csv_tables, model_description, units, values
from twin.fmi.model_description import DeclaredUnit
from twin.fmi.variables import FMI3_TYPES

ITEMS = {"off": 0, "on": 2}


def variable(kind, shape=(), connectable=True, **rest):
    """A variable of a type."""
    dtype = np.dtype(bool) if kind == "Clock" and connectable else FMI3_TYPES[kind][1]
    return MemberVariable("x", "input", "discrete", kind, dtype, shape, **rest)


@every_case(
    ("kind", "value", "expected"),
    [
        ("Float64", "1.5e-3", 1.5e-3),
        ("Float64", 3, 3.0),
        ("Float64", "nan", None),
        ("Float64", "inf", np.inf),
        ("Float32", "3.4e38", np.float32(3.4e38)),
        ("Float32", np.inf, np.inf),
        ("Int8", 127, 127),
        ("Int8", "-128", -128),
        ("UInt8", 255, 255),
        ("UInt64", 2**64 - 1, 2**64 - 1),
        ("Int32", 3.0, 3),
        ("Boolean", "true", True),
        ("Boolean", " False ", False),
        ("Boolean", "1", True),
        ("Boolean", "0", False),
        ("Boolean", 1.0, True),
        ("Boolean", 0, False),
        ("Boolean", np.True_, True),
        ("Clock", "true", True),
        ("Enumeration", "on", 2),
        ("Enumeration", 0, 0),
        ("Enumeration", "2", 2),
        ("String", "a b", "a b"),
        ("Binary", "00fF", b"\x00\xff"),
        ("Binary", b"a", b"a"),
        ("Binary", bytearray(b"b"), b"b"),
    ],
)
def test_scalars(kind, value, expected):
    found = values.array(variable(kind), value, ITEMS, "w")
    assert (found.shape, found.dtype) == ((), variable(kind).dtype)
    assert np.isnan(found) if expected is None else found[()] == expected


@every_case(
    ("kind", "value", "words"),
    [
        ("Float64", "fast", "w: x is a number, not 'fast'. Write it like 1.5e-3."),
        ("Float64", True, "w: x is a number, not True."),
        ("Float32", "3.5e38", "w: x is a float32, too small for 3.5e38. Give at most 3.4e+38."),
        ("Int8", 128, "w: x is a int8: 128 is out of range. Give -128 to 127."),
        ("Int8", "-129", "w: x is a int8: -129 is out of range."),
        ("UInt8", -1, "w: x is a uint8: -1 is out of range. Give 0 to 255."),
        ("Int32", 1.5, "w: x is a whole number (int32), not 1.5. Write it like 3."),
        ("Float64", "1_000", "w: x is a number, not '1_000'."),
        ("Int32", "1_000", "w: x is a whole number (int32), not '1_000'."),
        ("Int32", "1.0", "w: x is a whole number (int32), not '1.0'."),
        ("Int32", True, "w: x is a whole number (int32), not True."),
        ("Boolean", "yes", "w: x is Boolean, not 'yes'. Write true or false."),
        ("Boolean", 2, "w: x is Boolean, not 2."),
        ("Boolean", 0.5, "w: x is Boolean, not 0.5."),
        ("Enumeration", "of", "w: x is an enumeration without 'of'. Choose from off (0), on (2)."),
        ("Enumeration", 1, "w: x is an enumeration without 1."),
        ("String", 3, "w: x is a String, not 3. Write it in quotes."),
        ("String", "a\0b", "w: x: a String cannot hold the character NUL. Remove it."),
        ("Binary", "0", "w: x is Binary, not '0'. Write hexadecimal digits such as 00ff."),
        ("Binary", 3, "w: x is Binary, not 3."),
    ],
)
def test_values_of_another_type(kind, value, words):
    with pytest.raises(FMUError) as caught:
        values.array(variable(kind), value, ITEMS, "w")
    assert str(caught.value).startswith(words)


def test_a_clock_without_event_mode():
    with pytest.raises(FMUError, match="w: x is a clock of an FMU without Event Mode, where it never ticks"):
        values.array(variable("Clock", connectable=False), "true", {}, "w")


@every_case(
    ("shape", "value", "expected"),
    [
        ((2,), "1 2", [1, 2]),
        ((2,), "1,2", [1, 2]),
        ((2,), "1; 2", [1, 2]),
        ((2,), "[1, 2]", [1, 2]),
        ((2,), (1, 2), [1, 2]),
        ((2, 2), "1 2 3 4", [[1, 2], [3, 4]]),
        ((2, 2), " [[1, 2], [3, 4]]", [[1, 2], [3, 4]]),
        ((2, 2), [[1, 2], [3, 4]], [[1, 2], [3, 4]]),
        ((2, 2), [1, 2, 3, 4], [[1, 2], [3, 4]]),
        ((1,), "5", [5]),
        ((0,), [], []),
        ((2,), np.array([1, 2]), [1, 2]),
        ((2,), np.array([1.0, 2.0]), [1, 2]),
    ],
)
def test_arrays(shape, value, expected):
    found = values.array(variable("Float64", shape), value, {}, "w")
    assert (found.tolist(), found.shape) == (expected, shape)
    assert found is not value


@every_case(
    ("shape", "value", "words"),
    [
        ((2,), "1 2 3", "w: x has 3 values, expected 2. Give 2 values."),
        ((2, 2), [[1, 2, 3, 4]], "w: x has 4 values, expected 2 x 2. Give 4 values."),
        ((2, 2), [[1], [2, 3]], "w: x has 3 values, expected 2 x 2."),
        ((2,), 1.0, "w: x has 1 values, expected 2."),
        ((2,), "[1, 2", "w: x=[1, 2 is not a list ("),
    ],
)
def test_arrays_that_do_not_fit(shape, value, words):
    with pytest.raises(FMUError) as caught:
        values.array(variable("Float64", shape), value, {}, "w")
    assert str(caught.value).startswith(words)


def test_names_of_elements():
    both = {"A": variable("Float64", (2, 3)), "b": variable("Float64")}
    assert values.find("b", both, "w") == (both["b"], None)
    assert values.find("A", both, "w") == (both["A"], None)
    assert [values.find(f"A[{index}]", both, "w")[1] for index in ("1,1", "1,3", "2 , 1", " 2,3 ")] == [0, 2, 3, 5]
    assert values.elements(both["A"])[:4] == ["x[1,1]", "x[1,2]", "x[1,3]", "x[2,1]"]
    assert values.elements(both["b"]) == ["x"]
    for name in ("A[0,1]", "A[3,1]", "A[1,4]", "A[1]"):
        with pytest.raises(FMUError, match=r"is outside of x\[2,3\]\. Elements are counted from 1\."):
            values.find(name, both, "w")
    for name in ("b[1]", "c", "A[1,x]"):
        with pytest.raises(FMUError, match=r"^w: has no variable "):
            values.find(name, both, "w")


@every_case(
    ("kind", "column", "expected"),
    [
        ("Float64", [0.1, 1.0], ["0.1", "1.0"]),
        ("Float32", [0.1], ["0.1"]),
        ("Int32", [3], ["3"]),
        ("Boolean", [True, False], ["1", "0"]),
        ("Clock", [True], ["1"]),
        ("Binary", [b"\x00\xff"], ["00ff"]),
        ("String", ['a "b"'], ['"a ""b"""']),
    ],
)
def test_cells_of_results(kind, column, expected):
    own = variable(kind)
    assert csv_tables.cells(own, np.array(column, own.dtype)) == expected


def test_a_file_of_results(tmp_path):
    """Times in seconds; arrays by elements, whose names have commas."""
    both = [variable("Float64", (1, 2)), variable("Boolean")]
    results = csv_tables.Results(
        [0, 1_500_000], both, [np.array([[1.0, 2.0], [3.0, 0.5]]), np.array([[True], [False]])]
    )
    path = tmp_path / "a.csv"
    csv_tables.write(results, path)
    assert path.read_text() == 'time,"x[1,1]","x[1,2]",x\n0.0,1.0,2.0,1\n0.0015,3.0,0.5,0\n'
    csv_tables.check_output(path)
    for wrong, words in (
        ("a.txt", "results are written as"),
        ("none/a.csv", "is not there. Make it first"),
        ("", "results are written as"),
    ):
        with pytest.raises(FMUError, match=words):
            csv_tables.check_output(tmp_path / wrong)


# exponents of kg, m, s, A, K, mol, cd, rad
LENGTH, TEMPERATURE = (0, 1, 0, 0, 0, 0, 0, 0), (0, 0, 0, 0, 1, 0, 0, 0)


def test_units_with_another_meaning_get_it_written_behind_them():
    """`m` is a metre; an FMU's `m` of 2 m is not; a display unit is `factor * value + offset` of its unit."""
    declared = [
        DeclaredUnit("m", Unit(1.0, 0.0, LENGTH), (("mm", 1000.0, 0.0), ("N", 0.5, 0.0), ("zero", 0.0, 0.0))),
        DeclaredUnit("s", Unit(2.0, 0.0, LENGTH), ()),
        DeclaredUnit("K", Unit(1.0, 0.0, TEMPERATURE), (("A", 1.0, -273.15),)),
        DeclaredUnit("kg", None, (("mm", 4.0, 0.0),)),
    ]
    found = units.names(declared)
    assert found == {
        ("m", ""): ("m", ""),
        ("m", "mm"): ("m", "mm"),
        ("m", "N"): ("m", "N {2.0 m + 0.0}"),
        ("m", "zero"): ("m", ""),
        ("s", ""): ("s {2.0 m + 0.0}", ""),
        ("K", ""): ("K", ""),
        ("K", "A"): ("K", "A {1.0 K + 273.15}"),
        ("kg", ""): ("kg", ""),
        ("kg", "mm"): ("kg", "mm {0.25 kg + 0.0}"),
    }
    shown = [
        (one.unit, one.display_unit)
        for one in (
            units.named(variable("Float64", unit=pair[0], display_unit=pair[1]), found)
            for pair in (("s", ""), ("s", "x"), ("m", "N"), ("N", ""), ("", ""))
        )
    ]
    assert shown == [("s {2.0 m + 0.0}", ""), ("s {2.0 m + 0.0}", "x"), ("m", "N {2.0 m + 0.0}"), ("N", ""), ("", "")]


def test_nothing_is_shown_in_a_display_unit_of_the_inverse():
    """5 m/s are 3.33 min/km, not 83.3."""
    displays = "".join(
        f'<DisplayUnit name="{name}" factor="{factor}"{more}/>'
        for name, factor, more in (("km/h", 3.6, ' inverse="false"'), ("min/km", 16.7, ' inverse="true"'))
    )
    element = etree.fromstring(f'<Unit name="m/s"><BaseUnit m="1" s="-1"/>{displays}</Unit>')
    found = units.names([model_description.unit(element)])
    assert found == {("m/s", ""): ("m/s", ""), ("m/s", "km/h"): ("m/s", "km/h"), ("m/s", "min/km"): ("m/s", "")}


def test_units_of_differences_have_no_offset():
    """5 K of a temperature difference are 5 degC, not -268.15 degC."""
    found = units.names([DeclaredUnit("K", Unit(1.0, 0.0, TEMPERATURE), (("degC", 1.0, -273.15), ("mK", 1000.0, 0.0)))])
    for given, expected in (("degC", "degC {1.0 K + 0.0}"), ("mK", "mK"), ("", ""), ("flubs", "flubs")):
        one = units.named(variable("Float64", unit="K", display_unit=given), found, is_relative=True)
        assert (one.unit, one.display_unit) == ("K", expected)
    absolute = units.named(variable("Float64", unit="K", display_unit="degC"), found)
    assert absolute.display_unit == "degC"


@every_case(
    ("own", "of_type", "expected"),
    [("", "", False), ("", "true", True), ("true", "", True), ("false", "true", False), ("true", "false", True)],
)
def test_a_difference_is_declared_by_the_variable_or_by_its_type(own, of_type, expected):
    element, type_element = (etree.Element("x", {"relativeQuantity": text} if text else {}) for text in (own, of_type))
    assert (
        model_description.is_relative(element, model_description.is_relative(type_element, default=False)) is expected
    )
