"""Scenario keys in annotations of an SSP: what is written reads back; annotations of others are left alone."""

from lxml import etree

from tests.every_case import every_case
from twin.ssp import ssp_annotations
from twin.ssp.document import SSC, SSD

KEYS = {
    "order": 1,
    "agreement": 1e-09,
    "isolate": True,
    "finite": False,
    "name": "iterative",
    "text": "a b",
    "limits": {"low": -2, "high": 3.5, "deep": {"on": True}},
    "scales": {"slow.u": "20 mm", "b.y": 3},
    "empty": {},
}


def test_keys_read_back():
    made = ssp_annotations.annotation("Experiment", KEYS)
    assert (made.tag, made.get("type")) == (f"{SSC}Annotation", "local.catheter-twin")
    (node,) = made
    assert node.tag == "{urn:catheter-twin:ssp:1}Experiment"
    assert dict(node.attrib) == {
        "order": "1",
        "agreement": "1e-09",
        "isolate": "true",
        "finite": "false",
        "name": "iterative",
        "text": "a b",
    }
    limits, scales, empty = node
    assert (limits.get("low"), limits[0].get("on"), len(empty)) == ("-2", "true", 0)
    assert [dict(value.attrib) for value in scales] == [
        {"name": "slow.u", "value": "20 mm"},
        {"name": "b.y", "value": "3"},
    ]
    assert ssp_annotations.read(node) == KEYS
    assert ssp_annotations.read_annotations([etree.tostring(made)], "Experiment") == KEYS


@every_case(
    ("text", "value"),
    [
        ("true", True),
        ("false", False),
        ("True", "True"),
        ("3", 3),
        ("-3", -3),
        ("3.0", 3.0),
        ("1e-9", 1e-9),
        ("", ""),
        ("1/150 s", "1/150 s"),
        ("nan s", "nan s"),
    ],
)
def test_texts_are_numbers_or_truths_where_they_can_be(text, value):
    found = ssp_annotations.scalar(text)
    assert (found, type(found)) == (value, type(value))


def test_annotations_are_collected_by_the_name_of_their_element():
    contents = [
        etree.tostring(ssp_annotations.annotation(name, keys))
        for name, keys in (("Member", {"a": 1, "b": 2}), ("Connection", {"c": 3}), ("Member", {"b": 4}))
    ]
    assert ssp_annotations.read_annotations(contents, "Member") == {"a": 1, "b": 4}
    assert ssp_annotations.read_annotations([], "Member") == {}


def test_annotations_of_an_element():
    """Of both kinds of parents, without the text behind them; those of children are not its own."""
    inside = f'<c:Annotation xmlns:c="{SSC[1:-1]}" type="{{}}"/>\n'
    text = (
        f'<a xmlns:d="{SSD[1:-1]}" xmlns:s="{SSC[1:-1]}"><d:Annotations>{inside.format("x")}{inside.format("local.catheter-twin")}'
        f"</d:Annotations><s:Annotations>{inside.format('y')}</s:Annotations><b><d:Annotations>{inside.format('z')}</d:Annotations></b></a>"
    )
    found = [etree.fromstring(content) for content in ssp_annotations.canonical_annotations(etree.fromstring(text))]
    assert [node.get("type") for node in found] == ["x", "local.catheter-twin", "y"]
    assert [ssp_annotations.is_own_annotation(node) for node in found] == [False, True, False]


def test_annotations_come_last():
    owner = etree.fromstring("<a><b/></a>")
    ssp_annotations.add(owner, [])
    assert len(owner) == 1
    ssp_annotations.add(owner, [etree.Element("x"), etree.Element("y")])
    assert [[child.tag for child in owner], [child.tag for child in owner[1]]] == [
        ["b", f"{SSD}Annotations"],
        ["x", "y"],
    ]
