"""Units, transformations and values along a chain of connections."""

from types import SimpleNamespace

import pytest

from tests.every_case import every_case
from twin.errors import CouplingError
from twin.ssp.flat import SystemFlattener, append_connection, is_same_unit
from twin.ssp.model import End, Linear, SspConnection, ValueTable
from twin.ssp.parameters import AssignedValue, convert_value


@every_case(
    ("first", "second", "expected"),
    [
        ("mm", "mm", True),
        ("mm", "m", False),
        ("mm", "N", False),
        ("N", "m {1.0 kg*m*s^-2 + 0.0}", True),
        ("mm", "x {0.001 m + 0.0}", True),
        ("mm", "x {0.0010000001 m + 0.0}", False),
        ("K", "x {1.0 K + 0.5}", False),
        ("K", "x {1.0 K + 0.0000001}", True),
    ],
)
def test_units_of_one_meaning(first, second, expected):
    assert is_same_unit(first, second) is expected
    assert is_same_unit(second, first) is expected


@pytest.mark.slow  # a table of all units is read
def test_units_that_are_not_known_count_as_equal():
    assert is_same_unit("flubs", "mm")
    assert is_same_unit("mm", "flubs")


def wire(change=None, suppress=False):
    """A connection."""
    return SspConnection(End("a", "y"), End("b", "u"), change, suppress, "f:1")


@every_case(
    ("total", "units", "connection", "expected"),
    [
        (Linear(), ("mm", "m"), wire(), (Linear(0.001, 0.0), "m")),
        (Linear(), ("mm", None), wire(), (Linear(), "mm")),
        (Linear(), (None, "m"), wire(), (Linear(), "m")),
        (Linear(), ("mm", "m"), wire(suppress=True), (Linear(), "m")),
        (Linear(), ("mm", None), wire(suppress=True), (Linear(), None)),
        (Linear(3.0, 1.0), ("m", "mm"), wire(Linear(2.0, 0.5)), (Linear(6000.0, 2000.5), "mm")),
        (Linear(3.0, 1.0), ("m", "mm"), wire(Linear(2.0, 0.5), suppress=True), (Linear(6.0, 2.5), "mm")),
        (Linear(), ("m", "m"), wire(ValueTable({1: 1})), (Linear(), "m")),
    ],
)
def test_transformations_along_a_chain(total, units, connection, expected):
    """First the units, then the transformation; a suppressed conversion loses the unit where the next has none."""
    assert append_connection(total, *units, connection) == expected


def test_what_cannot_be_put_into_a_chain():
    with pytest.raises(
        CouplingError, match=r"^a\.y -> b\.u: maps single values, which only a component can do\. Put one between\.$"
    ):
        append_connection(Linear(), None, None, wire(ValueTable({1: 2})))
    with pytest.raises(CouplingError, match=r"^a\.y -> b\.u: mm does not convert to N"):
        append_connection(Linear(), "mm", "N", wire())


def test_transformations_in_a_row():
    """3 x + 1, then 2 x - 5."""
    both = Linear(3.0, 1.0).then(Linear(2.0, -5.0))
    assert (both, both.of(10.0)) == (Linear(6.0, -3.0), 57.0)
    assert Linear().of(0.1) == 0.1


@every_case(
    ("value", "unit", "change", "suppress", "target", "expected"),
    [
        (2.0, "m", None, False, "mm", 2000.0),
        (2.0, "m", None, True, "mm", 2.0),
        (2.0, None, None, False, "mm", 2.0),
        (2.0, "m", None, False, None, 2.0),
        (2.0, "m", Linear(0.5, 1.0), False, "mm", 1001.0),  # the unit first
        ([1.0, 2.0], "m", Linear(2.0, 0.0), False, "m", [2.0, 4.0]),
        (2, "m", None, False, "m", 2),
        (True, "m", None, False, "mm", True),
        ("a", None, Linear(), False, None, "a"),
        (1, None, ValueTable({1: 7}), False, None, 7),
        (2, None, ValueTable({1: 7}), False, None, 2),
    ],
)
def test_values(value, unit, change, suppress, target, expected):
    found = convert_value(AssignedValue(value, unit, change, suppress, "f:1"), target, "x")
    assert found == expected
    assert type(found) is type(expected)


def test_a_text_has_no_transformation():
    with pytest.raises(CouplingError, match=r"^x: a linear transformation is for numbers, not for 'a'\. Drop it\.$"):
        convert_value(AssignedValue("a", None, Linear(2.0), False, "f:1"), None, "x")


@every_case(
    ("connections", "units", "expected"),
    [
        ([wire()], ("mm", "m"), None),  # the units of the FMUs say it all
        ([wire()], ("", "m"), Linear(0.001)),
        ([wire()], ("mm", ""), Linear(0.001)),
        ([wire(suppress=True)], ("mm", "m"), Linear()),
        ([wire(Linear(2.0))], ("mm", "m"), Linear(0.002)),
        ([wire(), wire(suppress=True)], ("mm", "m"), Linear()),
        ([wire(Linear(2.0)), wire()], ("mm", "m"), Linear(0.002)),
    ],
)
def test_what_a_flat_connection_changes(connections, units, expected):
    """None: values are converted from the unit of one FMU to that of the other."""
    source, target = (("a",), "y"), (("b",), "u")
    flattener = SystemFlattener({})
    for (path, name), unit in zip((source, target), units, strict=True):
        info = SimpleNamespace(variables={name: SimpleNamespace(unit=unit)})
        flattener.members[path] = SimpleNamespace(info=info)
    middle = [((), f"connector {number}") for number in range(len(connections) - 1)]
    flattener.units = {source: "mm", target: "m"} | dict.fromkeys(middle, "mm")
    flattener.add_connection(source, target, list(zip([*middle, target], connections, strict=True)))
    (flat,) = flattener.flat.wires
    assert (flat.source, flat.target, flat.change) == ("a.y", "b.u", expected)
