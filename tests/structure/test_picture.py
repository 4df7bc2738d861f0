"""The drawing of a system: columns, order, heights, lines, arrows and texts, with the numbers of the layout by hand."""

import re
from itertools import pairwise
from xml.etree import ElementTree as ET

import pytest

from tests.every_case import every_case
from twin.structure import picture
from twin.structure.picture import Slot

BLUE, RED = "#3b8fd4", "#d1495b"


def numbers(path):
    """The numbers of a path."""
    return [float(number) for number in re.findall(r"-?\d+\.\d+", path)]


def drawn(*arguments):
    """Size, boxes (x, y, width), texts (x, y, text, anchor), lines (color, tooltip, path, arrow)."""
    svg = picture.draw(*arguments)
    root = ET.fromstring(picture.standalone(svg))
    plain = [(one.tag.rpartition("}")[2], one) for one in root.iter()]
    boxes = [tuple(float(one.get(key)) for key in ("x", "y", "width")) for tag, one in plain if tag == "rect"]
    texts = [
        (float(one.get("x")), float(one.get("y")), one.text, one.get("text-anchor"))
        for tag, one in plain
        if tag == "text"
    ]
    lines = []
    for tag, one in plain:
        if tag == "g" and one.get("stroke"):
            title, path, arrow, broad = one
            assert path.get("d") == broad.get("d")
            assert one.get("stroke") == arrow.get("fill")
            lines.append((one.get("stroke"), title.text, numbers(path.get("d")), numbers(arrow.get("d"))))
    size = tuple(float(number) for number in root.get("viewBox").split())
    return size, boxes, texts, lines


def test_two_members_with_a_connection_and_back():
    """Boxes of 70 x 40 px with 56 px between; two lines leave 9 px apart; the one back is red, its arrow at the left."""
    size, boxes, texts, lines = drawn({"a": "A", "b": ""}, {("a", "b"): ["a.y → b.u", "delay 0 s"], ("b", "a"): []})
    assert size == (0, 0, 212, 72)
    assert boxes == [(8, 13, 70), (134, 13, 70)]
    assert texts == [
        (43, 31, "a", "middle"),
        (43, 45, "A", "middle"),
        (169, 31, "b", "middle"),
        (169, 45, None, "middle"),
    ]
    assert lines == [
        (BLUE, "a.y → b.u\ndelay 0 s", [78, 28.5, 106, 28.5, 106, 28.5, 134, 28.5], [134, 28.5, 127, 25, 127, 32]),
        (RED, "b → a", [78, 37.5, 106, 37.5, 106, 37.5, 134, 37.5], [78, 37.5, 85, 34, 85, 41]),
    ]


def test_labels_and_notes_make_room():
    """Labels of 10 and 4 characters, of both directions, need 22 + 14 * 6.1 px between the columns; a note 13 px below; a long component is cut."""
    size, boxes, texts, _ = drawn(
        {"a": "C" * 22, "b": "D" * 23},
        {("a", "b"): [], ("b", "a"): []},
        {"a": "1."},
        {("a", "b"): "label of 1", ("b", "a"): "5 ms"},
    )
    width = 18 + 22 * 6.1
    assert boxes == [
        (8, 13, pytest.approx(width, abs=0.06)),
        (pytest.approx(8 + width + 107.4, abs=0.06), 13, pytest.approx(width, abs=0.06)),
    ]
    assert size == (0, 0, round(16 + 2 * width + 107.4), 62 + 10 + 13)
    found = {text: (x, y, anchor) for x, y, text, anchor in texts}
    assert found["label of 1"] == (
        pytest.approx(8 + width + 107.4 - 9, abs=0.06),
        24.5,
        "end",
    )  # before the arrow, above the line
    assert found["5 ms"] == (pytest.approx(8 + width + 9, abs=0.06), 36.5, "start")
    assert found["1."] == (pytest.approx(8 + width / 2, abs=0.06), 33 + 20 + 12, "middle")
    assert "C" * 22 in found
    assert "D" * 21 + "…" in found
    assert drawn({"name of a part": ""}, {})[1][0][2] == 18 + 14 * 7


@pytest.mark.parametrize("count", [2, 3, 8])
def test_labels_at_one_box_do_not_overlap(count):
    """Their letters are 10 px high; the box is as high as they need."""
    edges = {(f"m{k}", "last"): "5 ms" for k in range(count)}
    members = dict.fromkeys([*(source for source, _ in edges), "last"], "")
    _, _, texts, _ = drawn(members, dict.fromkeys(edges, ()), {}, edges)
    heights = sorted(y for _, y, text, _ in texts if text == "5 ms")
    assert all(lower - upper >= 10 for upper, lower in pairwise(heights))
    assert len(heights) == count


def test_a_connection_of_a_member_to_itself():
    root = ET.fromstring(picture.draw({"a": ""}, {("a", "a"): ["a.y → a.u", "delay 1 ms"]}))
    (path,) = (one for one in root if one.tag == "path")
    assert numbers(path.get("d")) == [57, 13, 61, -1, 25, -1, 29, 13]  # from right to left above the box
    assert (path[0].text, path.get("stroke")) == ("a.y → a.u\ndelay 1 ms", RED)
    assert len(root) == 2


def test_texts_are_escaped_and_nothing_is_drawn_of_nothing():
    assert picture.draw({}, {}) == ""
    svg = picture.draw({"a": "<b>"}, {})
    assert "&lt;b&gt;" in svg
    assert picture.standalone(svg).startswith('<svg xmlns="http://www.w3.org/2000/svg" role="img"')
    assert "color: #1f2933; background: #fff" in picture.standalone(svg)


def test_a_line_passes_between_the_boxes_of_a_column():
    """a -> b -> c and a -> c: the long line has a place of its own in the middle column, and no box lies on it."""
    _, boxes, _, lines = drawn(dict.fromkeys("abc", ""), {("a", "b"): [], ("b", "c"): [], ("a", "c"): []})
    assert [x for x, _, _ in boxes] == [8, 134, 260]
    (long,) = (path for _, title, path, _ in lines if title == "a → c")
    assert len(long) == 16
    assert (long[6], long[8]) == (134, 204)  # ends at the left of the column, goes on at its right
    assert long[7] == long[9]
    top = boxes[1][1]
    assert not top < long[7] < top + 40
    assert abs(long[7] - (top + 20)) == pytest.approx(29 + 5)  # half a box with its gap, and half a line


@every_case(
    ("edges", "backward", "columns"),
    [
        ("", "", {"a": 0, "b": 0, "c": 0, "d": 0}),
        ("ab bc cd", "", {"a": 0, "b": 1, "c": 2, "d": 3}),
        ("ab bc ac", "", {"a": 0, "b": 1, "c": 2, "d": 0}),
        ("dc cb ba", "", {"d": 0, "c": 1, "b": 2, "a": 3}),  # members without inputs come first
        ("ab ba", "ba", {"a": 0, "b": 1, "c": 0, "d": 0}),
        ("ab bc ca da", "ca", {"d": 0, "a": 1, "b": 2, "c": 3}),
        ("ab ac bd cd db", "db", {"a": 0, "b": 1, "c": 1, "d": 2}),
        ("ab aa ca", "", {"a": 1, "b": 2, "c": 0, "d": 0}),
        ("ab bc cd db dc", "db dc", {"a": 0, "b": 1, "c": 2, "d": 3}),
    ],
)
def test_columns(edges, backward, columns):
    """Right of all that drive it; a connection that closes a loop decides nothing."""
    given = [tuple(edge) for edge in edges.split()]
    back = picture.find_backward_edges(list("abcd"), given)
    assert back == {tuple(edge) for edge in backward.split()}
    assert picture.assign_columns(list("abcd"), [edge for edge in given if edge[0] != edge[1]], back) == columns


def test_the_slots_of_a_line():
    slots = {name: Slot(name) for name in "abc"}
    layers = [[slots["a"]], [slots["b"]], [slots["c"]]]
    depth = {"a": 0, "b": 1, "c": 2}
    first, passing, last = picture.route(("c", "a"), True, depth, slots, layers).slots
    assert (first, last, passing.member) == (slots["a"], slots["c"], "")
    assert layers[1] == [slots["b"], passing]
    assert (first.behind, passing.before) == ([(passing, ("c", "a"))], [(first, ("c", "a"))])
    assert (passing.behind, last.before) == ([(last, ("c", "a"))], [(passing, ("c", "a"))])
    assert picture.route(("a", "b"), False, depth, slots, layers).slots == [slots["a"], slots["b"]]
    assert (first.half, passing.half) == (29, 5)


@every_case(
    ("members", "heights", "expected"),
    [
        ("a", [5], [5]),
        ("ab", [0, 0], [-29, 29]),
        ("ab", [0, 58], [0, 58]),
        ("ab", [0, 100], [0, 100]),
        ("abc", [0, 0, 0], [-58, 0, 58]),
        ("a.", [0, 0], [-17, 17]),  # a line takes 10 px
        ("..", [3, 3], [-2, 8]),
    ],
)
def test_no_overlap_in_a_column(members, heights, expected):
    layer = [Slot(name.strip("."), y=float(y)) for name, y in zip(members, heights, strict=True)]
    picture.spread(layer)
    assert [slot.y for slot in layer] == expected


def test_members_are_ordered_along_their_neighbors():
    """c and d are declared against the order of a and b, which drive them: d is above, and no line crosses; the top is 4 px."""
    slots = {name: Slot(name) for name in "abcd"}
    layers = [[slots["a"], slots["b"]], [slots["c"], slots["d"]]]
    for edge in (("a", "d"), ("b", "c")):
        picture.route(edge, False, {"a": 0, "b": 0, "c": 1, "d": 1}, slots, layers)
    picture.arrange(layers)
    assert {name: slot.y for name, slot in slots.items()} == {"a": 33, "b": 91, "c": 91, "d": 33}
    assert [slot.member for slot in layers[1]] == ["d", "c"]


@every_case(("count", "step"), [(1, 9.0), (2, 9.0), (3, 9.0), (4, 8.0), (8, 4.0)])
def test_lines_leave_a_member_in_the_order_of_their_ends(count, step):
    """9 px apart, or as close as a box of 40 px needs."""
    middle, others = Slot("m", y=100.0), [Slot(f"o{i}", y=50.0 - i) for i in range(count)]
    for other in others:
        middle.behind.append((other, ("m", other.member)))
        middle.before.append((other, (other.member, "m")))
    expected = [100.0 + (i - (count - 1) / 2) * step for i in reversed(range(count))]
    assert [picture.port_height(middle, other, ("m", other.member), True) for other in others] == expected
    assert [picture.port_height(middle, other, (other.member, "m"), False) for other in others] == expected
    assert picture.port_height(Slot(y=7.0), middle, ("m", "m"), True) == 7.0
