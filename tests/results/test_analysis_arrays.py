"""An analysis gets a value for each sample, or of an array's bare name all of it."""

import numpy as np

from twin.results import Analysis, Signals, Window
from twin.results.evaluation import expression

TIME = np.arange(5) * 0.5
WHOLE = Window()
ROWS = np.arange(30.0).reshape(5, 3, 2)


def span(points, first):
    """Largest coordinate of each sample less the first one's."""
    assert points.shape[1:] == (3, 2)
    return {"span": points.max(axis=(1, 2)) - first}


span.outputs = {"span": "m"}


def applied(inputs, window=WHOLE):
    signals = Signals(TIME, {"a.points": ROWS}, {"a.points": "mm"})
    expressions = {name: expression.parse(text) for name, text in inputs.items()}
    return Analysis("wide", f"{__name__}:span", expressions, window).apply(signals)


def test_a_bare_name_is_all_of_an_array_in_si():
    found = applied({"points": "a.points", "first": "a.points[1,1]"})
    np.testing.assert_allclose(found.values["wide.span"], 5e-3)


def test_in_a_window_too():
    found = applied({"points": "a.points", "first": "a.points[1,1]"}, Window(500_000_000, 1_500_000_000))
    np.testing.assert_allclose(found.values["wide.span"], [np.nan, 5e-3, 5e-3, 5e-3, np.nan])


def test_arithmetic_of_arrays_and_what_was_not_recorded_give_nothing():
    assert "wide.span" not in applied({"points": "2 * a.points", "first": "a.points[1,1]"}).values
    assert "wide.span" not in applied({"points": "a.others", "first": "a.points[1,1]"}).values
