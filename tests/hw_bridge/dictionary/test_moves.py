"""Homing methods end where CiA 402 says: followed on a line of whole places, from either side of the switches and on them.

Limit switches are closed up to 10 and from 90 on, index pulses are at multiples of 7. A home switch is closed from 40 to 60, or
from 52 on (methods of a positive home switch), or up to 52 (of a negative one).
"""

import pytest

from hw_bridge.dictionary.moves import BLOCKS_FAULHABER, BLOCKS_MAXON, METHODS, REVERSING, HomingEvent
from tests.every_case import every_case

BUMP, UP, DOWN = (lambda x: 40 <= x <= 60), (lambda x: x >= 52), (lambda x: x <= 52)
# where each method ends, on which side of which edge; figures of CiA 402-2, Homing mode
INDEXED = {
    1: (BUMP, 14),
    2: (BUMP, 84),
    3: (UP, 49),
    4: (UP, 56),
    5: (DOWN, 56),
    6: (DOWN, 49),
    7: (BUMP, 35),
    8: (BUMP, 42),
    9: (BUMP, 56),
    10: (BUMP, 63),
    11: (BUMP, 63),
    12: (BUMP, 56),
    13: (BUMP, 42),
    14: (BUMP, 35),
}
# without index pulse: beside an edge of a switch, within one place
EDGES = {
    17: (BUMP, 10.5),
    18: (BUMP, 89.5),
    19: (UP, 51.5),
    20: (UP, 51.5),
    21: (DOWN, 52.5),
    22: (DOWN, 52.5),
    23: (BUMP, 39.5),
    24: (BUMP, 39.5),
    25: (BUMP, 60.5),
    26: (BUMP, 60.5),
    27: (BUMP, 60.5),
    28: (BUMP, 60.5),
    29: (BUMP, 39.5),
    30: (BUMP, 39.5),
}


def follow(method, x, home):
    """Where the moves of a method end, from x."""
    for move in METHODS[method]:
        direction = move.direction

        def is_over(x, move=move):
            return ((x <= 10), (x >= 90), home(x))[move.until] is move.closed

        if move.until is HomingEvent.INDEX:
            x += direction
            while x % 7:
                x += direction
            continue
        while not is_over(x):
            ahead = x >= 90 if direction > 0 else x <= 10
            if ahead and method in REVERSING and move.until is HomingEvent.HOME and not move.slow:
                direction = -direction
            x += direction
            assert 0 <= x <= 100, "past an end"
    return x


@every_case("start", [20, 30, 50, 52, 53, 75])
@every_case("method", [*INDEXED, *EDGES])
def test_where_a_method_ends(method, start):
    home, place = (INDEXED | EDGES)[method]
    found = follow(method, start, home)
    assert found == place if method in INDEXED else abs(found - place) == 0.5


@pytest.mark.parametrize(("method", "place"), [(33, 49), (34, 56)])
def test_the_next_index_pulse(method, place):
    assert follow(method, 50, BUMP) == place


def test_directions_are_units_and_what_is_measured_is_approached_slowly():
    for method, moves in (METHODS | BLOCKS_FAULHABER | BLOCKS_MAXON).items():
        assert all(move.direction in (-1, 1) for move in moves), method
        assert all(move.slow for move in moves[1:]), method
        assert all(move.slow for move in moves if move.until in (HomingEvent.INDEX, HomingEvent.BLOCK)), method
        assert not moves or moves[-1].slow, method
    assert {number for number, moves in METHODS.items() if moves and not moves[0].slow} == {
        *(1, 2, 3, 5, *range(7, 15), 17, 18, 19, 21, *range(23, 31)),
        *(4, 6, 20, 22),
    }


def test_methods_against_the_end_stop():
    """Those of maxon go positive first, those of Faulhaber negative."""
    for number, index in ((-1, True), (-2, True), (-3, False), (-4, False)):
        for table, sign in ((BLOCKS_MAXON, 1), (BLOCKS_FAULHABER, -1)):
            first, *others = table[number]
            direction = sign if number % 2 else -sign
            assert (first.direction, first.until) == (direction, HomingEvent.BLOCK)
            assert [(one.direction, one.until) for one in others] == [(-direction, HomingEvent.INDEX)] * index
