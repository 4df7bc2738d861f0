"""Conditions of events, as part of the compiled loop: evaluated at each communication point on the published values.

A condition is a program for a stack machine on Float64. As with all tables of the loop, a new condition needs no compilation.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from twin.compiler import read64, read_float, write64, write_float
from twin.coupling.execution.scalars import convert_scalar

# a condition: its instructions; for how many communication points it must hold; the first at which it is evaluated; its state
CONDITION = ("instructions", "count", "hold", "first", "state")
CONDITION_STATE = ("phase", "since")  # `since`: 1 + communication point since which it holds, 0: it does not hold
INSTRUCTION = ("operation", "operand", "kind")  # `operand`: Float64 bits of a number, or the address of a value
ARMED, MET, WAITING, DISARMED = range(
    4
)  # phases; a condition that is met acts, then waits until it is false, or is disarmed

# instructions of a stack machine on Float64; 1.0 is true, 0.0 is false
NUMBER, VALUE, NEGATE, ABS, SQRT, NOT = range(6)
ADD, SUBTRACT, MULTIPLY, DIVIDE, POWER, MIN, MAX, LESS, LESS_EQUAL, EQUAL, NOT_EQUAL, AND, OR = range(6, 19)


def is_met(self: Any, tick: int) -> int:
    """Evaluate all conditions at a communication point; return 1 if one is met: it is in the phase MET then."""
    row, result = self.conditions, 0
    for _ in range(self.condition_count):
        state = read64(row + 32)
        phase = read64(state)
        if phase != DISARMED and tick >= read64(row + 24):
            if evaluate(read64(row), read64(row + 8), self.stack) == 0.0:
                write64(state, ARMED)
                write64(state + 8, 0)
            else:
                if read64(state + 8) == 0:
                    write64(state + 8, tick + 1)
                if phase == ARMED and tick + 1 - read64(state + 8) >= read64(row + 16):
                    write64(state, MET)
                    result = 1
        row += 40
    return result


def start(self: Any) -> int:
    """Evaluate all conditions before the first step; return 1 if one is met."""
    return is_met(self, self.tick)


def evaluate(row: int, count: int, stack: int) -> float:
    """Run the instructions of a condition; return their result."""
    top = stack
    for _ in range(count):
        operation = read64(row)
        if operation == NUMBER:
            write64(top, read64(row + 8))
            top += 8
        elif operation == VALUE:
            convert_scalar(read64(row + 8), read64(row + 16), top, 0, 1.0, 0.0)
            top += 8
        elif operation <= NOT:
            write_float(top - 8, unary(operation, read_float(top - 8)))
        else:
            top -= 8
            write_float(top - 8, binary(operation, read_float(top - 8), read_float(top)))
        row += 24
    return read_float(stack)


def unary(operation: int, x: float) -> float:
    """Return the result of an operation on one value."""
    if operation == NEGATE:
        return -x
    if operation == ABS:
        return abs(x)
    if operation == SQRT:
        return sqrt(x)  # compiled, NaN of a negative number, as in numpy
    return 1.0 - x


def binary(operation: int, x: float, y: float) -> float:
    """Return the result of an operation on two values; comparisons with NaN are false."""
    if operation == ADD:
        return x + y
    if operation == SUBTRACT:
        return x - y
    if operation == MULTIPLY:
        return x * y
    if operation == DIVIDE:
        return x / y
    if operation == POWER:
        return float(x**y)
    return compare(operation, x, y)


def compare(operation: int, x: float, y: float) -> float:
    """Return the result of a comparison, of `min`, `max`, `and` or `or`."""
    if operation == MIN:
        return y if y < x or y != y else x  # noqa: PLR0124 - NaN stays NaN, as in numpy
    if operation == MAX:
        return y if y > x or y != y else x  # noqa: PLR0124
    is_true = x != 0.0 or y != 0.0
    if operation == LESS:
        is_true = x < y
    elif operation == LESS_EQUAL:
        is_true = x <= y
    elif operation == EQUAL:
        is_true = x == y
    elif operation == NOT_EQUAL:
        is_true = x != y
    elif operation == AND:
        is_true = x != 0.0 and y != 0.0
    return 1.0 if is_true else 0.0
