"""Changes of a follow file: how an amount is written, what may change, and which problems are named."""

from types import SimpleNamespace

import pytest

from twin.follow import readers
from twin.follow.changes import NO_CHANGE, UNKNOWN, Amount
from twin.follow.readers import read_changes

VARIABLES = {
    "rig.mu": ("parameter", "tunable", "", 1),
    "rig.k": ("parameter", "tunable", "N/m", 2),
    "rig.size": ("parameter", "fixed", "m", 1),
    "rig.x": ("output", "continuous", "m", 1),
    "rig.force": ("output", "continuous", "N", 1),
    "other.mu": ("parameter", "tunable", "", 1),
}
UNITS = {"": 1.0, "N": 1.0, "mN": 1e-3, "N/m": 1.0, "m": 1.0}


class Loader:
    """Reads numbers with a unit; problems are kept."""

    def __init__(self, **changes):
        self.problems, self.catalog = [], None
        self.compared = [SimpleNamespace(signal=name) for name in ("rig.x", "rig.force")]
        self.full_case = SimpleNamespace(members=["rig.mu"])
        self.keys = SimpleNamespace(
            changes={name: SimpleNamespace(set=values, rate=rate) for name, (values, rate) in changes.items()}
        )

    def add_problem(self, text, *path):
        self.problems.append((".".join(path), text))

    def looked_up(self, name, catalog, *path):
        if name not in VARIABLES:
            self.add_problem("unknown", *path)
            return None
        causality, variability, unit, _ = VARIABLES[name]
        return SimpleNamespace(causality=causality, variability=variability, unit=unit)

    def quantity(self, raw, unit, *path, is_difference=False):
        number, _, symbol = str(raw).strip().partition(" ")
        assert not symbol or unit  # a factor has no unit
        return float(number) * UNITS[symbol]


@pytest.fixture(autouse=True)
def sizes(monkeypatch):
    monkeypatch.setattr(readers, "find", lambda name, _: SimpleNamespace(size=VARIABLES[name][3]))


@pytest.mark.parametrize(
    ("raw", "factor", "difference"),
    [
        ("x1.5", 1.5, 0.0),
        ("x 2", 2.0, 0.0),
        ("*0.5", 0.5, 0.0),
        ("+0.25", 1.0, 0.25),
        ("-0.25", 1.0, -0.25),
        ("- 0.25", 1.0, -0.25),
        (" 3 ", 0.0, 3.0),
        (3, 0.0, 3.0),
        (-2, 1.0, -2.0),
    ],
)
def test_an_amount_multiplies_adds_or_is_the_new_value(raw, factor, difference):
    loader = Loader(wear=({"rig.mu": raw}, 3600.0))
    (change,) = read_changes(loader)
    assert (change.name, change.rate, loader.problems) == ("wear", 1.0, [])
    assert change.amounts == (Amount({"rig.mu": (factor, difference)}, {}),)


def test_lists_are_amounts_and_arrays_change_as_a_whole():
    loader = Loader(wear=({"rig.mu": ["x2", "x3"], "rig.k": ["+5 N/m", 7]}, 1.8), offset=({"rig.force": "-5 mN"}, 36.0))
    wear, offset = read_changes(loader)
    assert loader.problems == []
    assert (wear.rate, offset.rate) == (pytest.approx(5e-4), pytest.approx(0.01))
    assert wear.amounts == (
        Amount({"rig.mu": (2.0, 0.0), "rig.k[1]": (1.0, 5.0), "rig.k[2]": (1.0, 5.0)}, {}),
        Amount({"rig.mu": (3.0, 0.0), "rig.k[1]": (0.0, 7.0), "rig.k[2]": (0.0, 7.0)}, {}),
    )
    assert offset.amounts == (Amount({}, {1: pytest.approx(-0.005)}),)


@pytest.mark.parametrize(
    ("name", "values", "where", "problem"),
    [
        ("a", {}, "changes.a", "`set` is missing."),
        ("a", {"rig.mu": ["x2", "x3"], "rig.k": "+5"}, "changes.a.set", "lists in `set` differ in length."),
        ("a", {"rig.mu": []}, "changes.a.set", "lists in `set` differ in length."),
        (NO_CHANGE, {"rig.mu": "x2"}, f"changes.{NO_CHANGE}", f"`{NO_CHANGE}` is what no listed change is called."),
        (UNKNOWN, {"rig.mu": "x2"}, f"changes.{UNKNOWN}", f"`{UNKNOWN}` is what no listed change is called."),
        ("a", {"rig.force": "x2"}, "changes.a.set.rig.force", "a measured signal gets an offset, such as +5 mN."),
        ("a", {"rig.force": "2"}, "changes.a.set.rig.force", "a measured signal gets an offset, such as +5 mN."),
        ("a", {"rig.size": "x2"}, "changes.a.set.rig.size", "rig.size is no tunable parameter and no measured signal."),
        ("a", {"other.mu": "x2"}, "changes.a.set.other.mu", "other.mu has no influence on the measured signals."),
        ("a", {"rig.none": "x2"}, "changes.a.set.rig.none", "unknown"),
    ],
)
def test_problems_are_named_and_the_others_are_read(name, values, where, problem):
    loader = Loader(**{"good": ({"rig.mu": "x2"}, 1.0), name: (values, 1.0), "too": ({"rig.mu": "x3"}, 1.0)})
    assert [change.name for change in read_changes(loader)] == ["good", "too"]
    ((found, text),) = loader.problems
    assert (found, text[: len(problem)]) == (where, problem)
