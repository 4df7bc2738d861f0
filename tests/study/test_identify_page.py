"""identify.html: its tables, colors and what its plots draw."""

import re

import numpy as np
import pytest

from tests.study.identified import COVARIANCE, POSITIONS, known, output, problem, recording, result
from twin.identify import Fit, page
from twin.identify.intervals import ProfileLikelihood
from twin.identify.search import Start


@pytest.fixture
def plots(monkeypatch):
    """Plots and the signals that they draw, by salt."""
    drawn = {}
    monkeypatch.setattr(
        page.plotting, "plot_svg", lambda plot, tables, salt: drawn.update({salt: (plot, tables["", 0])}) or f"[{salt}]"
    )
    return drawn


def drawn_curves(plot, signals):
    """Label and values of each curve."""
    return {one.label: one.signal.evaluate(signals.values) for one in plot.curves}


def test_unknowns_with_their_deviations(tmp_path):
    """In display units; of a logarithm linearized: 0.01 of a place is 1 N ln(100) / 100."""
    own = result(tmp_path, knowledge=known(COVARIANCE, POSITIONS, effect=[True, True, False]))
    assert page.rows(own) == [
        {
            "name": "sheath.play",
            "value": "0.5 mm",
            "deviation": "0.04 mm",
            "interval": "0.42 mm to 0.58 mm",
            "bounds": "0 mm to 2 mm",
            "verdicts": [],
        },
        {
            "name": "sheath.drag",
            "value": "1 N",
            "deviation": "0.04605 N",
            "interval": "0.912 N to 1.096 N",
            "bounds": "0.1 N to 10 N",
            "verdicts": [],
        },
        {
            "name": "offset of tip in slow",
            "value": "5 mm",
            "deviation": "-",
            "interval": "3.8 mm to 6.2 mm",
            "bounds": "-10 mm to 10 mm",
            "verdicts": ["not identifiable: it changes nothing of what is compared"],
        },
    ]


def test_a_difference_of_temperatures_has_no_offset():
    of = output()
    object.__setattr__(of, "unit", "K")
    object.__setattr__(of, "display_unit", "degC")
    assert page.difference(1.5, of).startswith("1.5 ")
    object.__setattr__(of, "display_unit", "")
    assert page.difference(1.5, of) == "1.5 K"


def test_strong_correlations_are_red(tmp_path):
    """By the fourth power: 0.81 for 0.9487; unknowns without effect have none."""
    r = 0.9
    covariance = [[4.0, 2 * r, 0.0], [2 * r, 1.0, 0.0], [0.0, 0.0, 1.0]]
    red = {"text": "0.900", "color": f"rgba(180, 35, 53, {0.55 * r**4:.2f})"}
    own, none = {"text": "1.000", "color": "#f5f7fa"}, {"text": "-", "color": "transparent"}
    table = page.matrix(result(tmp_path, knowledge=known(covariance, POSITIONS, effect=[True, True, False])))
    assert table == [[own, red, none], [red, own, none], [none, none, none]]
    clear = {"text": "0.000", "color": "rgba(180, 35, 53, 0.00)"}
    assert page.matrix(result(tmp_path, knowledge=known(covariance, POSITIONS)))[2] == [clear, clear, own]


def test_an_output_is_drawn_with_its_residuals(tmp_path, plots):
    found = page.measured(result(tmp_path), 0)
    assert found == {
        "title": "tip [mm] in slow",
        "signal": "sheath.tip",
        "file": "tip.csv",
        "rms": "0.1732 mm",
        "noise": "0.1 mm",
        "count": "5",
        "span": "0 to 2 s",
        "fit": "[fit 0]",
        "near": "[near 0]",
        "left": "[left 0]",
    }
    plot, signals = plots["fit 0"]
    curves = drawn_curves(plot, signals)
    assert list(curves) == ["measured", "model"]
    assert curves["measured"] == pytest.approx([0, 1e-3, 2e-3, 3e-3, 4e-3])
    assert curves["model"] == pytest.approx([0, 1.1e-3, 1.9e-3, 3.3e-3, 3.8e-3])
    assert (plot.unit, plot.label) == ("mm", "sheath.tip")
    assert signals.time.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    near, _ = plots["near 0"]
    assert (near.window.start_ns, near.window.stop_ns) == (1_450_000_000, 1_550_000_000)  # a twentieth of 2 s
    assert near.curves == plot.curves
    left, signals = plots["left 0"]
    assert drawn_curves(left, signals)["measured minus model"] == pytest.approx([0, -1e-4, 1e-4, -3e-4, 2e-4])
    assert left.unit == "mm"


def test_the_time_about_a_largest_residual_at_the_start(tmp_path, plots):
    page.measured(result(tmp_path, errors=(9, 0, 0, 0, 0)), 0)
    assert (plots["near 0"][0].window.start_ns, plots["near 0"][0].window.stop_ns) == (0, 50_000_000)


def test_a_profile_is_drawn_over_its_unknown(tmp_path, plots):
    knowledge = known(COVARIANCE, POSITIONS, method="profile")
    knowledge.profiles[1] = ProfileLikelihood(np.array([0.25, 0.5, 1.0]), np.array([1.0, 0.0, 2.0]))
    assert page.profile(result(tmp_path, knowledge=knowledge), 1) == {"name": "sheath.drag", "svg": "[profile 1]"}
    plot, signals = plots["profile 1"]
    (curve,) = plot.curves
    assert curve.x.evaluate(signals.values) == pytest.approx([10**-0.5, 1.0, 10.0])
    assert curve.signal.evaluate(signals.values).tolist() == [1.0, 0.0, 2.0]
    assert (plot.x_label, plot.x_unit, plot.label) == ("sheath.drag", "N", "cost above the best / limit")


def test_starts_are_sorted_by_their_cost(tmp_path):
    fit = Fit(
        np.array(POSITIONS),
        [1.0, 1.0],
        [Start(np.zeros(3), np.array([0.5, 0.0, 1.0]), 6.0), Start(np.zeros(3), np.array(POSITIONS), 4.0)],
    )
    assert page.starts(result(tmp_path, fit=fit)) == [
        {"cost": "1", "ends": "0.5 mm, 1 N, 5 mm"},
        {"cost": "1.5", "ends": "1 mm, 0.1 N, 10 mm"},
    ]
    exact = Fit(np.array(POSITIONS), [1.0, 1.0], [Start(np.zeros(3), np.zeros(3), cost) for cost in (0.0, 2.0)])
    assert [one["cost"] for one in page.starts(result(tmp_path, fit=exact))] == ["0", "2"]
    assert page.starts(result(tmp_path, fit=Fit(np.array(POSITIONS), [1.0, 1.0]))) == []


def test_the_page(tmp_path, plots):
    knowledge = known(COVARIANCE, POSITIONS)
    knowledge.profiles.update({k: ProfileLikelihood(np.array([0.1, 0.2]), np.array([1.0, 0.0])) for k in (2, 0)})
    text = page.html(result(tmp_path, knowledge=knowledge))
    assert list(plots) == ["fit 0", "near 0", "left 0", "fit 1", "near 1", "left 1", "profile 0", "profile 2"]
    assert "✓ all unknowns identified" in text
    assert re.findall("<b>([^<]*)</b><span>([^<]*)</span>", text) == [
        ("2026-03-04", "05:06, sheath, 2 recordings"),
        ("3", "unknowns, 8 measured values"),
        ("1 of 2", "starts came to the best"),
        ("0", "simulations in 0 s, differences"),
    ]
    assert "only one of 2 starts came to this. Try more: --starts 8." in text
    assert "90 % interval, jacobian" in text
    assert text.count("<h2>") == 8  # unknowns, notes, two outputs, correlation, profiles, starts, what went in
    assert "tip.csv <code>sum of tip.csv</code>" in text
    knowledge.effect[0] = False
    assert "✗ not all unknowns are identified" in page.html(result(tmp_path, knowledge=knowledge))
    single = problem(tmp_path, recording("", output(recording="")), unknowns=problem(tmp_path).unknowns[:1])
    alone = known([[1e-4]], [0.5])
    text = page.html(result(tmp_path, of=single, fit=Fit(np.array([0.5]), [0.1], interrupted=True), knowledge=alone))
    assert "Correlation of the unknowns" not in text
    assert "Profiles" not in text
    assert '<span class="badge fail">interrupted</span>' in text
