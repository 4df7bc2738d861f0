"""Delays, summary and picture of a structure, and the evaluation of a profile, from numbers."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.structure import Cost, GraphMember, Structure, Wire, profiled

MS = 1_000_000


def described(*wires, ranks=(1, 1), periods=(MS, MS), loops=()):
    """A structure of two members."""
    parts = tuple(GraphMember(name, name.upper(), *rest) for name, *rest in zip("ab", ranks, periods, strict=True))
    return Structure(parts, wires, loops, MS, "jacobi")


@every_case(
    ("delays", "usual", "sentence"),
    [
        ([], "", ""),
        ([[0]], "0 s", " Delay of each connection: none."),
        ([[MS]], "1 ms", " Delay of each connection: 1 ms."),
        ([[MS], [0], [MS]], "1 ms", " Delay of each connection: 1 ms unless labeled."),
        ([[5 * MS, 0]], "0 s, 5 ms", " Delay of each connection: 0 s or 5 ms."),
    ],
)
def test_the_usual_delay(delays, usual, sentence):
    found = described(*(Wire("a", "b", delays=one) for one in delays))
    assert found.usual == usual
    assert found.summary == f"jacobi, communication step 1 ms.{sentence}"


def test_loops_are_in_the_summary():
    found = described(loops=(("a.y", "b.y"), ("c.y",)))
    assert found.summary.endswith("1 ms. Solved together at each instant (algebraic loop): a.y, b.y; c.y.")


@pytest.mark.parametrize(
    ("ranks", "periods", "notes"),
    [
        ((1, 1), (MS, MS), []),
        ((1, 2), (MS, MS), ["1.", "2."]),
        ((1, 1), (MS, 5 * MS), ["every 5 ms"]),
        ((2, 1), (MS, 5 * MS), ["2.", "1. · every 5 ms"]),
    ],
)
def test_the_picture_shows_order_periods_and_unusual_delays(ranks, periods, notes):
    wires = Wire("a", "b", ["a.y → b.u"], 1, [0]), Wire("b", "a", ["b.y → a.u"], 1, [MS]), Wire("a", "a", [], 1, [0])
    svg = described(*wires, ranks=ranks, periods=periods).svg()
    shown = [text for text in ("1.", "2.", "every 5 ms", "1. · every 5 ms") if f">{text}<" in svg]
    assert sorted(shown) == sorted(notes)
    assert (svg.count(">1 ms<"), svg.count(">0 s<")) == (1, 0)
    assert "<title>a.y → b.u\ndelay 0 s</title>" in svg
    assert "xmlns" not in svg
    assert "xmlns" in described().svg(alone=True)


def test_costs_of_members():
    """100 communication steps of 50 us, of which 10 were sampled; b makes every fifth step; the clock takes 1 us, read 6 times."""
    watch = SimpleNamespace(
        per_tick=lambda: np.array([4e-6, 10e-6, 6e-6, 2e-6]),
        kinds=["copies", "steps", "steps", "accesses"],
        members=[-1, 0, 1, 1],
        done=np.array([10, 10, 2, 10]),
        sampled=10,
        overhead=1e-6,
        wall=100 * 50e-6,
        ticks=100,
    )
    found = profiled(watch, SimpleNamespace(members={"a": 0, "b": 0, "idle": 0}), {"a": "A"}, 1e-3)
    total = 50e-6 - 6e-6
    assert found.per_tick == pytest.approx(total)
    assert (found.step, found.overhead, found.sampled_steps) == (1e-3, 1e-6, 10)
    assert found.real_time_factor == pytest.approx(1e-3 / total)
    expected = [
        ("loop and recording", "", 0.0, total - 22e-6),
        ("a", "A", 10e-6, 10e-6),
        ("b", "", 30e-6, 8e-6),
        ("connections", "values copied and converted", 0.0, 4e-6),
        ("idle", "", 0.0, 0.0),
    ]
    for cost, (name, what, step, per_tick) in zip(found.costs, expected, strict=True):
        assert cost == Cost(name, what, pytest.approx(step), pytest.approx(per_tick), pytest.approx(per_tick / total))


def test_a_profile_is_no_shorter_than_its_parts():
    """Where reading the clock takes longer than the loop, and where nothing was sampled."""
    watch = SimpleNamespace(
        per_tick=lambda: np.array([3e-6]),
        kinds=["steps"],
        members=[0],
        done=np.array([0]),
        sampled=0,
        overhead=1e-3,
        wall=0.0,
        ticks=0,
    )
    found = profiled(watch, SimpleNamespace(members={"a": 0}), {}, 1e-3)
    assert found.per_tick == pytest.approx(3e-6)
    assert [(cost.name, cost.step, cost.share) for cost in found.costs] == [
        ("a", 0.0, 1.0),
        ("connections", 0.0, 0.0),
        ("loop and recording", 0.0, 0.0),
    ]
