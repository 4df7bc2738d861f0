"""The tree of signals and the panes of a chart, without a browser: what is listed, ticked, added and removed."""

import pytest

from tests.every_case import every_case
from twin.web import Chart, ChartCurve, Leaf, Pane, Tree, tree

LEAVES = [
    Leaf("a.b.x", ("a", "b"), "x", "mm", "Position"),
    Leaf("a.b.y", ("a", "b"), "y", "N", "force"),
    Leaf("a.z", ("a",), "z", "", "count"),
    Leaf("t", (), "t", "s"),
]


class Props(dict):
    """An element: its properties."""

    @property
    def props(self):
        return self


def tree_of(leaves=LEAVES, shown=()):
    """A tree without a page, and what it tells of."""
    made, told = object.__new__(Tree), []
    made._leaves = {leaf.name: leaf for leaf in leaves}
    made._on_select = lambda name, on: told.append((name, on))
    made._shown, made._tree, made._count = set(shown), Props(), Props()
    made._count.text = ""
    made._search("")
    return made, told


def test_signals_are_listed_below_their_groups():
    found, _ = tree_of(shown=["a.z"])
    assert found._tree["nodes"] == [
        {
            "id": "\na",
            "label": "a",
            "noTick": True,
            "about": "",
            "children": [
                {
                    "id": "\na\nb",
                    "label": "b",
                    "noTick": True,
                    "about": "",
                    "children": [
                        {"id": "a.b.x", "label": "x", "unit": "mm", "about": "Position"},
                        {"id": "a.b.y", "label": "y", "unit": "N", "about": "force"},
                    ],
                },
                {"id": "a.z", "label": "z", "unit": "", "about": "count"},
            ],
        },
        {"id": "t", "label": "t", "unit": "s", "about": ""},
    ]
    assert (found._tree["ticked"], found._tree["expanded"], found._count.text) == (["a.z"], [], "4 of 4 signals")


@every_case(
    ("text", "names", "expanded"),
    [
        ("POSITION mm", ["a.b.x"], ["\na", "\na\nb"]),
        ("a z", ["a.z"], ["\na"]),
        ("b", ["a.b.x", "a.b.y"], ["\na", "\na\nb"]),
        ("nothing", [], []),
        (None, ["a.b.x", "a.b.y", "a.z", "t"], []),
        ("s", ["a.b.x", "t"], ["\na", "\na\nb"]),
    ],
)
def test_every_word_is_looked_for(text, names, expanded):
    found, _ = tree_of()
    found._search(text)
    assert [node["id"] for node in tree._walk(found._tree["nodes"])] == names
    assert (found._tree["expanded"], found._count.text) == (expanded, f"{len(names)} of 4 signals")


@pytest.mark.parametrize(("count", "text"), [(3, "3 of 3 signals"), (4, "4 of 4 signals, first 3 shown")])
def test_long_lists_are_cut(monkeypatch, count, text):
    monkeypatch.setattr(tree, "MAX_LISTED", 3)
    found, _ = tree_of(LEAVES[:count])
    assert (len(list(tree._walk(found._tree["nodes"]))), found._count.text) == (3, text)


def test_ticks_are_told():
    """What a search hides stays as it is; names that are none are ignored."""
    found, told = tree_of(shown=["a.b.x", "t"])
    found._ticked(["a.z", "a.b.x", "none"])
    assert (told, found._shown) == ([("a.z", True), ("t", False)], {"a.z", "a.b.x"})
    found._search("count")
    told.clear()
    found._ticked(None)
    assert (told, found._shown) == ([("a.z", False)], {"a.b.x"})
    found.show(["t", "none", "a.z"])
    assert found._tree["ticked"] == ["a.z", "t"]


def chart_of(*panes):
    """A chart without a page."""
    made = object.__new__(Chart)
    made.panes, made._props, made.drawn = list(panes), {}, 0

    def update():
        made.drawn += 1

    made.update = update
    return made


def curves(chart):
    return [(pane.unit, [(curve.name, curve.color) for curve in pane.curves]) for pane in chart.panes]


def test_a_curve_goes_where_its_unit_is():
    chart = chart_of(Pane(unit="N", own=True), Pane(unit="N", curves=[ChartCurve("a", color=0)]))
    chart.add("b", "N", "B", step=True, faint="old b")
    chart.add("b", "N")  # it is there
    chart.add("c", "m")
    chart.add("d", "m", pane=1)
    chart.add("e", "m", pane=7)  # there is no such pane
    chart.add("f", "s", pane=-1)
    assert curves(chart) == [
        ("N", []),
        ("N", [("a", 0), ("b", 1), ("d", 3)]),
        ("m", [("c", 2)]),
        ("m", [("e", 4)]),
        ("s", [("f", 5)]),
    ]
    assert chart.panes[1].curves[1] == ChartCurve("b", "B", 1, True, "old b")
    assert (chart.drawn, len(chart._props["panes"])) == (5, 5)
    chart.remove_curve("c")
    assert curves(chart) == [("N", [("a", 0), ("b", 1), ("d", 3)]), ("m", [("e", 4)]), ("s", [("f", 5)])]
    chart.add("g", "s")
    assert curves(chart)[2] == ("s", [("f", 5), ("g", 2)])  # the first color that is used least
    chart.show_marks([{"at": 1.0}])
    assert chart._props["marks"] == [{"at": 1.0}]
