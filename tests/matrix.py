"""Cases that try one piece of code over and over: a covering selection at once, the whole product as slow evidence."""

from itertools import product

import pytest


def covering(*axes):
    """All combinations of the values of axes; those beside a diagonal, on which each value stands, are slow tests."""
    values = [list(axis) for axis in axes]
    diagonal = {tuple(i % len(axis) for axis in values) for i in range(max(map(len, values)))}
    return [
        pytest.param(
            *(axis[i] for axis, i in zip(values, at, strict=True)), marks=() if at in diagonal else pytest.mark.slow
        )
        for at in product(*(range(len(axis)) for axis in values))
    ]


def some(cases, chosen):
    """Cases of which only those that are chosen, by value or as a test of the value, run at once."""
    is_chosen = chosen if callable(chosen) else lambda case: case in chosen
    return [case if is_chosen(case) else pytest.param(*as_tuple(case), marks=pytest.mark.slow) for case in cases]


def as_tuple(case):
    """The values of a case: those of a tuple, or the one value."""
    return case if isinstance(case, tuple) else (case,)
