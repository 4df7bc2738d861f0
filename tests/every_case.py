"""A table of cases tried by one test, for functions without fixtures.

Thousands of short cases, each a test of its own, cost pytest more time than what they test.
"""

import functools
import inspect

import pytest


def every_case(names, cases, ids=None):
    """Call the test once for each case, as `pytest.mark.parametrize` would; what fails is noted with its case.

    `names`: parameters, a sequence or a text with commas. `cases`: a value, or a tuple of values, for each; marks are refused.
    """
    names = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    rows = [values_of(case, len(names)) for case in cases]
    assert rows, "no case"

    def decorate(test):
        @functools.wraps(test)
        def tried(*args, **others):
            for number, row in enumerate(rows):
                try:
                    test(*args, **dict(zip(names, row, strict=True)), **others)
                except pytest.skip.Exception as skip:
                    raise AssertionError(f"case {number + 1} would skip those after it: {skip}") from None
                except Exception as error:
                    error.add_note(f"case {number + 1} of {len(rows)}: {dict(zip(names, row, strict=True))}")
                    raise

        parameters = inspect.signature(test).parameters.values()
        tried.__signature__ = inspect.Signature([each for each in parameters if each.name not in names])
        return tried

    return decorate


def values_of(case, number):
    """The values of a case, also of a `pytest.param`, whose marks nobody would see here."""
    if marks := getattr(case, "marks", ()):
        raise TypeError(f"a case has marks: {marks}")
    values = getattr(case, "values", None)
    if type(case).__name__ == "ParameterSet":
        case = tuple(values) if number > 1 else values[0]
    row = tuple(case) if number > 1 else (case,)
    assert len(row) == number, row
    return row
