"""Homing methods of CiA 402 as sequences of moves."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class HomingEvent(IntEnum):
    """Event that ends a move; the first three are the order of `Switches.closed`."""

    NEGATIVE = 0
    POSITIVE = 1
    HOME = 2
    INDEX = 3
    BLOCK = 4


class Move(NamedTuple):
    """Move in a direction until an event; `slow`: with the second speed of 6099h."""

    direction: int
    slow: bool
    until: HomingEvent
    closed: bool = True


def switch(direction: int, until: HomingEvent) -> tuple[Move, ...]:
    """Fast onto a switch, slowly off it again."""
    return Move(direction, False, until), Move(-direction, True, until, False)


def edge(direction: int) -> tuple[Move, ...]:
    """Off the home switch if on it, then slowly onto it."""
    return Move(-direction, False, HomingEvent.HOME, False), Move(direction, True, HomingEvent.HOME)


def across(direction: int) -> tuple[Move, ...]:
    """Fast onto the home switch, slowly off it at its other end."""
    return Move(direction, False, HomingEvent.HOME), Move(direction, True, HomingEvent.HOME, False)


def enter(direction: int) -> tuple[Move, ...]:
    """Slowly back onto the home switch."""
    return (Move(direction, True, HomingEvent.HOME),)


def index(direction: int) -> tuple[Move, ...]:
    """Slowly to the next index pulse."""
    return (Move(direction, True, HomingEvent.INDEX),)


def block(direction: int) -> tuple[Move, ...]:
    """Slowly against the end stop."""
    return (Move(direction, True, HomingEvent.BLOCK),)


METHODS: dict[int, tuple[Move, ...]] = {
    1: switch(-1, HomingEvent.NEGATIVE) + index(+1),
    2: switch(+1, HomingEvent.POSITIVE) + index(-1),
    3: switch(+1, HomingEvent.HOME) + index(-1),
    4: edge(+1) + index(+1),
    5: switch(-1, HomingEvent.HOME) + index(+1),
    6: edge(-1) + index(-1),
    7: switch(+1, HomingEvent.HOME) + index(-1),
    8: switch(+1, HomingEvent.HOME) + enter(+1) + index(+1),
    9: across(+1) + enter(-1) + index(-1),
    10: across(+1) + index(+1),
    11: switch(-1, HomingEvent.HOME) + index(+1),
    12: switch(-1, HomingEvent.HOME) + enter(-1) + index(-1),
    13: across(-1) + enter(+1) + index(+1),
    14: across(-1) + index(-1),
    17: switch(-1, HomingEvent.NEGATIVE),
    18: switch(+1, HomingEvent.POSITIVE),
    19: switch(+1, HomingEvent.HOME),
    20: edge(+1),
    21: switch(-1, HomingEvent.HOME),
    22: edge(-1),
    23: switch(+1, HomingEvent.HOME),
    24: switch(+1, HomingEvent.HOME) + enter(+1),
    25: across(+1) + enter(-1),
    26: across(+1),
    27: switch(-1, HomingEvent.HOME),
    28: switch(-1, HomingEvent.HOME) + enter(-1),
    29: across(-1) + enter(+1),
    30: across(-1),
    33: index(-1),
    34: index(+1),
    35: (),
    37: (),
}
# where a limit switch turns the search round
REVERSING = (*range(7, 15), *range(23, 31))
# against the end stop: vendors number them differently
BLOCKS_FAULHABER = {-1: block(-1) + index(+1), -2: block(+1) + index(-1), -3: block(-1), -4: block(+1)}
BLOCKS_MAXON = {-1: block(+1) + index(-1), -2: block(-1) + index(+1), -3: block(+1), -4: block(-1)}
