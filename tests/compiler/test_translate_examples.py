"""A few values for each construct of the translator, every time; `test_translate` and `test_translate_programs` draw many."""

from math import inf, nan

import pytest

from tests.compiler.test_translate import Functions, Integers, Reals, same
from tests.compiler.test_translate_programs import Programs

CASES = [
    *(
        (Integers, {"a": a, "b": b, "s": s, "flag": s > 0, "c": b, "few": (a, b // 3)})
        for a, b, s in ((-7, 2, 3), (7, -2, 0), (-(2**31), -1, 20), (0, 5, 1), (5, 5, 1))
    ),
    *(
        (Reals, {"x": x, "y": y})
        for x, y in (
            (2.5, -0.0),
            (-0.0, 0.0),
            (nan, 1.0),
            (1.0, nan),
            (-7.0, 2.0),
            (7.0, -2.0),
            (1.5, 8.0),
            (-inf, 1e308),
        )
    ),
    *((Functions, {"x": x, "u": u}) for x, u in ((-3.7, 0.4), (1e3, -1.0))),
    *((Programs, {"x": x, "n": n, "k": k}) for x, n, k in ((1.0, 0, -1), (-2.5, 5, 3), (0.75, 12, -4), (4.0, 9, 0))),
]


@pytest.mark.parametrize(("cls", "values"), CASES)
def test_compiled_equals_interpreted_to_the_bit(build, cls, values):
    same(cls, build, **values)
