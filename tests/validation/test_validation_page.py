"""The report of a validation: what its plots draw, and what its tables say."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from tests.validation.arrays import data_of
from tests.validation.model import Formula
from twin.validation import page
from twin.validation.frozen import FrozenSet, frozen_path, frozen_text
from twin.validation.schema import ValidationKeys

U = np.arange(41.0)


def prediction(errors, *, band=None, disagreements=()):
    """A run of 5 s whose angle [rad] is predicted `errors` [deg] too large, its tip 3 and 4 mm beside the measured one."""
    own = Formula()
    own.keys.outputs["a"].unit = "deg"
    measured = np.stack([0.01 * U, U, -U], 1)
    predicted = measured + np.stack([np.radians(errors + 0 * U), 3e-3 + 0 * U, 4e-3 + 0 * U], 1)
    row = {
        "file": "a.csv",
        "set": "sines",
        "rmse": 1.2345,
        "mean_error": -0.5,
        "largest": 2.0,
        "coverage": None,
        "area": 0.25,
        "rezeroed_rmse": 1.5,
        "consistent": None,
        "baselines": {},
        "band": band,
        "disagreements": list(disagreements),
        "remarks": [],
    }
    rows = [row | {"quantity": q.name, "unit": q.unit} for q in own.quantities]
    data = data_of([U[:, None]], [measured], step=0.125)
    return SimpleNamespace(set=own, data=data, predicted=predicted, rezeroed=predicted + 1.0, rows=rows)


@pytest.fixture
def axes(monkeypatch):
    """Axes of each figure instead of its text."""
    monkeypatch.setattr(page.figure_files, "figure_to_svg", lambda figure: figure.axes)


def curves(axis):
    """Label, color and values of each curve over time."""
    return {line.get_label(): (line.get_color(), line.get_ydata()) for line in axis.lines if len(line.get_xdata()) > 2}


def spans(axis):
    """Heights between which areas are filled."""
    boxes = [*(one.get_datalim(axis.transData) for one in axis.collections), *(one.get_bbox() for one in axis.patches)]
    return [pytest.approx((box.y0, box.y1)) for box in boxes]


def test_an_output_is_drawn_with_its_band_and_error(axes):
    own = prediction(2.0, band=1.5)
    above, below = page.svg(own, own.set.quantities[0], own.rows[0], U < 31)
    measured = np.degrees(0.01 * U[:31])
    assert list(curves(above)) == ["measured", "predicted"]
    for label, color, values in (("measured", page.MEASURED, measured), ("predicted", page.PREDICTED, measured + 2)):
        assert curves(above)[label] == (color, pytest.approx(values))
    assert above.lines[0].get_xdata() == pytest.approx(0.125 * U[:31])
    assert spans(above) == [(measured[0] + 0.5, measured[30] + 3.5)]
    assert curves(below)["error"][1] == pytest.approx(np.full(31, 2.0))
    assert spans(below) == [(-1.5, 1.5)]
    assert [above.get_ylabel(), below.get_ylabel(), below.get_xlabel()] == ["a [deg]", "error [deg]", "time [s]"]
    assert [one.get_text() for one in above.get_legend().get_texts()] == ["measured", "predicted"]
    assert above.get_shared_x_axes().joined(above, below)


def test_a_distance_has_an_error_from_zero(axes):
    """Its outputs have no band of their own."""
    own = prediction(2.0, band=6.0)
    x, y, below = page.svg(own, own.set.quantities[1], own.rows[1], U >= 0)
    assert curves(x)["predicted"][1] == pytest.approx(1e3 * U + 3)
    assert curves(y)["measured"][1] == pytest.approx(-1e3 * U)
    assert [spans(x), spans(y), spans(below)] == [[], [], [(0.0, 6.0)]]
    assert curves(below)["error"][1] == pytest.approx(np.full(41, 5.0))
    assert [one.get_ylabel() for one in (x, y, below)] == ["x [mm]", "y [mm]", "error [mm]"]
    assert (y.get_legend(), len(x.get_legend().get_texts())) == (None, 2)


@pytest.mark.parametrize(("rows", "lines"), [(U >= 5, [0.625, 5.0]), ((U >= 6) & (U < 40), [])])
def test_where_a_run_disagrees_a_line_is_drawn(axes, rows, lines):
    """In all plots, if it is shown; the corrected prediction stands beside it."""
    own = prediction(2.0, disagreements=[{"time": 0.625}, {"time": 5.0}])
    above, below = page.svg(own, own.set.quantities[0], own.rows[0], rows)
    for axis in (above, below):
        assert [one.get_xdata()[0] for one in axis.lines if len(one.get_xdata()) == 2] == pytest.approx(lines)
    color, values = curves(above)["predicted, offset corrected with the first third"]
    assert color == page.REZEROED
    assert values == pytest.approx(np.degrees(0.01 * U[rows] + 1) + 2)
    assert spans(above) == spans(below) == []


def test_the_time_about_the_largest_error_is_drawn_larger(monkeypatch):
    """A twentieth of 5 s around it; not where that are two samples or fewer."""
    shown = []
    monkeypatch.setattr(page, "svg", lambda *arguments: shown.append(arguments[3]) or "svg")
    own = prediction(np.where(U == 20, -9.0, np.where(U == 30, 8.0, 0.0)))
    assert page.figure_of(own, 0) == {"row": own.rows[0], "whole": "svg", "near": "svg", "worst": "2.5 s"}
    assert [np.flatnonzero(rows).tolist() for rows in shown] == [list(range(41)), [19, 20, 21]]
    assert page.figure_of(prediction(np.where(U == 40, -9.0, 0.0)), 0)["near"] == ""  # its last two samples
    shown.clear()
    assert page.figure_of(own, 1)["row"]["quantity"] == "tip"


@pytest.mark.parametrize(("count", "shown"), [(1400, 1400), (2800, 1400), (4199, 2100), (1, 1)])
def test_areas_are_reduced_to_what_is_visible(count, shown):
    axis = SimpleNamespace(fill_between=lambda *arrays, **options: calls.append((arrays, options)))
    calls = []
    values = np.arange(float(count))
    page.fill(axis, values, -values, 2 * values, color="red")
    (((time, low, high), options),) = calls
    assert options == {"color": "red"}
    assert len(time) == shown
    assert (time[0], low[-1], high[-1]) == (0.0, -time[-1], 2 * time[-1])


def test_tables_of_the_page(tmp_path, monkeypatch):
    near = ["", "<svg/>"]
    figure = {"whole": "<svg/>", "worst": "2 s"}
    monkeypatch.setattr(page, "figure_of", lambda own, k: {**figure, "row": own.rows[k], "near": near[k]})
    path = tmp_path / "robot.yaml"
    fold = {"fold": "b.csv", "quantity": "tip", "unit": "mm", "rmse": 3.14159, "baselines": {"play_cubic": 9.8765}}
    frozen = {
        "sines": FrozenSet(
            {"rest": {"value": 1.23456789, "unit": "rad", "interval": [1.2, 1.3]}},
            baselines={"play_cubic": {}},
            cross_validation=[fold, fold | {"fold": "c.csv", "coverage": 0.876}],
            files={"a.csv": "0", "c.csv": "0"},
            seconds=12.34,
        ),
        "unused": FrozenSet(),
    }
    frozen_path(path).write_text(frozen_text("A robot", frozen))
    keys = ValidationKeys(description="It bends.", source="A bench", license="CC BY", band=0.8, false_alarms=0.02)
    own = SimpleNamespace(path=path, title="A <robot>", keys=keys)
    first, second = prediction(0 * U), prediction(0 * U)
    first.rows[0] |= {"consistent": False, "coverage": 0.5, "baselines": {"play_cubic": 7.5}, "remarks": ["It slips."]}
    for row in second.rows:
        row |= {"file": "d.csv", "consistent": True}
    text = page.html(own, [first, second])
    rows = [
        re.sub(r"\s+", " ", re.sub("<[^>]*>", " ", row)).strip() for row in re.findall("<tr>.*?</tr>", text, re.DOTALL)
    ]
    numbers = "1.23 -0.5 2"
    assert rows[0].startswith("File Quantity RMSE Mean Largest In the 80 % band")
    assert rows[0].endswith("Agrees play cubic")
    assert rows[1:5] == [
        f"a.csv training file bending {numbers} 50 % 0.25 1.5 deg no 7.5",
        f"a.csv training file tip {numbers} - 0.25 1.5 mm - -",
        f"d.csv bending {numbers} - 0.25 1.5 deg yes -",
        f"d.csv tip {numbers} - 0.25 1.5 mm yes -",
    ]
    assert rows[5:] == [
        "Parameter Value 95 % interval Unit",
        "rest 1.2346 1.2 to 1.3 rad",
        "Left out Quantity RMSE In the band play cubic Unit",
        "b.csv tip 3.14 - 9.88 mm",
        "c.csv tip 3.14 88 % 9.88 mm",
    ]
    assert "1 of 2 runs not in agreement with the model" in text
    assert "another run of the same kind exceeds in 2 % of cases" in text
    assert "Fitted to 2 files in 12.3 s" in text
    assert "unused" not in text
    assert text.count("<svg/>") == 2 * (1 + 2)  # of two files: of the tip also about its largest error
    assert text.count("About the largest error, at 2 s") == 2
    assert '<p class="bad">It slips.</p>' in text
    assert "A &lt;robot&gt;" in text
    for row in first.rows:
        row["consistent"] = True
    assert "✓ no run disagrees with the model" in page.html(own, [first])
