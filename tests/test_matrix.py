"""What runs at once of a matrix has every value in it; with the slow rest it is all of it."""

from itertools import product

import pytest

from tests.matrix import covering, some


@pytest.mark.parametrize("axes", [("abcde", (0, 1)), ("ab", (0, 1, 2, 3), (True, False)), ("a",)], ids=str)
def test_every_value_is_tried_at_once(axes):
    cases = covering(*axes)
    assert [case.values for case in cases] == list(product(*axes))
    at_once = [case.values for case in cases if not case.marks]
    assert len(at_once) == max(map(len, axes))
    assert all(set(found) == set(axis) for found, axis in zip(zip(*at_once, strict=True), axes, strict=True))


def test_some_are_chosen_and_the_others_slow():
    for chosen in ((1, 3), lambda case: case % 2):
        at_once, slow, last = some((1, 2, 3), chosen)
        assert (at_once, last) == (1, 3)
        assert (slow.values, [mark.name for mark in slow.marks]) == ((2,), ["slow"])
