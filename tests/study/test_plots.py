"""What the pictures and tables of a study show: positions, colors and numbers of small studies that are known.

Over 400 lines: one study of few cases serves all tests.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from tests.every_case import every_case
from tests.study.patients import STUDY, study_file
from twin.study import Answers, load_study
from twin.study.answers import page, plots, sensitivity, summary, tables
from twin.study.answers.sensitivity import Change, Effect, MetricSensitivity
from twin.study.answers.statistics import PassRate
from twin.study.execution.case_engine import Row
from twin.study.execution.case_table import CaseTable
from twin.study.execution.tuning import Trial, Tuned
from twin.study.execution.worst_case_search import WorstCase

FORCES = [0.02, 0.04, 0.1, 0.06, 0.08, None]  # of six samples [N]: the third is above 90 mN, the last one failed


def study_of(folder, text=STUDY):
    return load_study(study_file(folder, text.replace("\nkeep:", "\nvariants: [plain]\nkeep:")))


def cases_of(study, forces=FORCES):
    requests = list(study.requests())
    rows = [
        Row(one.number, "failed", f"lost at {i} s", (), ())
        if force is None
        else Row(one.number, "done", "", (force, 0.01), (force <= 0.09, None))
        for i, (one, force) in enumerate(zip(requests, forces, strict=False))
    ]
    return CaseTable(study, requests[: len(rows)], rows)


@pytest.fixture
def study(tmp_path):
    return study_of(tmp_path)


@pytest.fixture
def drawn(monkeypatch):
    """Pictures become axes."""
    from matplotlib.figure import Figure

    def render(size, _salt, paint, **grid):
        axes = Figure(size).subplots(squeeze=False, **grid)
        paint(axes)
        return axes[:, 0]

    monkeypatch.setattr(plots.figure_files, "render_svg", render)


def color(artist):
    from matplotlib.colors import to_hex

    return to_hex(artist.get_color() if hasattr(artist, "get_color") else artist.get_facecolor())


def labels(axis):
    return [one.get_text() for one in axis.get_yticklabels()]


def test_which_cases_fail(study):
    assert plots.failing(cases_of(study)) == [False, False, True, False, False, True]


def test_parallel_coordinates_scale_each_factor_to_its_span(study, drawn):
    cases = cases_of(study)
    (axis,) = plots.parallel(cases, "force_max", "plain", "mN")
    lines = [line for line in axis.lines if len(line.get_ydata()) == 4]
    assert [color(line) for line in lines] == [plots.tint(plots.GOOD, 0.8)] * 4 + [plots.BAD] * 2
    assert [line.get_alpha() for line in lines] == [None] * 6  # opaque, for dark mode
    columns = np.array([line.get_ydata() for line in lines])  # cases 1, 2, 4, 5, then 3 and 6
    values = cases.values[[0, 1, 3, 4, 2, 5]] * [60.0, 1.0, 1.0]  # rates as in the file, per minute
    span = values.max(axis=0) - values.min(axis=0)
    assert columns[:, :3] == pytest.approx((values - values.min(axis=0)) / span)
    assert columns[:5, 3] == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0])  # 20 to 100 mN
    assert np.isnan(columns[5, 3])
    ends = [one.get_text() for one in axis.texts]
    assert ends[-2:] == ["20", "100"]
    letters = [*axis.texts, *axis.get_xticklabels()]
    assert (
        min(one.get_fontsize() for one in letters) * 720.0 / (72.0 * 9.2) > 9.0
    )  # of a picture 720 px wide on a phone
    assert ends[:2] == [f"{values[:, 0].min():.3g}", f"{values[:, 0].max():.3g}"]
    names = [one.get_text() for one in axis.get_xticklabels()]
    assert names == ["heart.rate [/min]", "heart.scale", "bent end [x]", "force_max [mN]"]


def test_points_and_lines_lead_to_their_cases(study, drawn):
    cases, numbers = cases_of(study), [one.number for one in study.requests()]
    (axis,) = plots.scatter(cases, "force_max", "plain", 1, "mN")
    good, bad = axis.collections
    assert good.get_urls() == [f"#case-{numbers[i]}" for i in (0, 1, 3, 4)]
    assert bad.get_urls() == [f"#case-{numbers[2]}"]  # the sixth has no value
    assert np.allclose(good.get_offsets(), np.column_stack([cases.values[[0, 1, 3, 4], 1], [20.0, 40.0, 60.0, 80.0]]))
    (axis_of_rate,) = plots.scatter(cases, "force_max", "plain", 0, "mN")
    assert axis_of_rate.get_xlabel() == "heart.rate [/min]"  # as after a number
    assert np.allclose(axis_of_rate.collections[0].get_offsets()[:, 0], 60.0 * cases.values[[0, 1, 3, 4], 0])
    assert (axis.get_ylabel(), axis.lines[0].get_ydata()[0]) == ("force_max [mN]", pytest.approx(90.0))
    (axis,) = plots.parallel(cases, "force_max", "plain", "mN")
    urls = [line.get_url() for line in axis.lines if len(line.get_ydata()) == 4]
    assert urls == [f"#case-{numbers[i]}" for i in (0, 1, 3, 4, 2, 5)]


def test_the_strongest_factors_are_shown(study):
    answers = Answers(cases_of(study))
    names = [one.name for one in study.factors]
    effects = (Effect(names[0], 0.2), Effect(names[2], -0.7), Effect(names[1], 0.5))
    answers.drivers = [MetricSensitivity("force_max", "plain", "rank", effects)]
    assert page.strongest(answers, "force_max", "plain") == [2, 1, 0]
    assert page.strongest(answers, "motion", "plain") == [0, 1, 2]


def test_of_many_cases_some_lines_and_all_failures_are_shown(study, drawn, monkeypatch):
    monkeypatch.setattr(plots, "LINES", 2)
    (axis,) = plots.parallel(
        cases_of(study), "force_max", "plain", "mN"
    )  # every third of six: 1 and 4; failures 3 and 6
    colors = [color(line) for line in axis.lines if len(line.get_ydata()) == 4]
    assert colors == [plots.tint(plots.GOOD, 0.8)] * 2 + [plots.BAD] * 2


def test_a_difference_of_temperatures_has_no_offset(study, tmp_path, drawn, monkeypatch):
    """A standard deviation of 0.02 K is 0.02 degC, not -273.13 degC."""
    metrics = study.scenario.metrics
    metrics["force_max"] = replace(metrics["force_max"], reduce="std", unit="degC")
    cases = cases_of(study)
    (axis,) = plots.scatter(cases, "force_max", "plain", 1, "degC")
    assert np.allclose(axis.collections[0].get_offsets()[:, 1], [0.02, 0.04, 0.06, 0.08])
    (axis,) = plots.parallel(cases, "force_max", "plain", "degC")
    assert [one.get_text() for one in axis.texts][-2:] == ["0.02", "0.1"]
    monkeypatch.setattr(plots, "FEW", 1)
    (axis,) = plots.histogram(cases, "force_max", "plain", "degC")
    assert axis.containers[0][0].get_x() == pytest.approx(0.02)
    (axis,) = plots.tuning_history(Tuned([Trial((1.0,), 0.5, (), "sample", 0)], None, [], 9), "degC", "std", True)
    assert axis.lines[0].get_ydata() == pytest.approx([0.5])


@pytest.mark.slow
def test_few_cases_are_points(study, drawn):
    """They were bars of one pixel, and the name of the limit covered one."""
    numbers = [one.number for one in study.requests()]
    (axis,) = plots.histogram(cases_of(study, [*FORCES[:5], 0.02]), "force_max", "plain", "mN")
    (points,) = axis.collections
    assert list(points.get_offsets()[:, 0]) == pytest.approx([20.0, 20.0, 40.0, 60.0, 80.0, 100.0])
    assert (
        len({tuple(one) for one in points.get_facecolors()[:5]})
        == 1
        != len({tuple(one) for one in points.get_facecolors()})
    )
    assert points.get_urls()[-1] == f"#case-{numbers[2]}"
    assert len(set(points.get_offsets()[:2, 1])) == 2  # equal values are at two heights
    assert (axis.containers, axis.get_title("right"), list(axis.texts)) == ([], "limit 90 mN", [])  # above the plot


def test_histograms_count_all_cases_with_a_value(study, drawn, monkeypatch):
    monkeypatch.setattr(plots, "FEW", 1)
    cases = cases_of(study, [*FORCES[:5], 0.02])
    (axis,) = plots.histogram(cases, "force_max", "plain", "mN")
    good, all_of_them = axis.containers
    heights = {round(bar.get_x(), 6): bar.get_height() for bar in good if bar.get_height()}
    assert sum(heights.values()) == 5
    assert heights[20.0] == 2
    ((bad, count),) = [(bar.get_x() + bar.get_width(), bar.get_height()) for bar in all_of_them if bar.get_height()]
    top = float(np.quantile([20.0, 40.0, 100.0, 60.0, 80.0, 20.0], 0.995))
    assert (bad, count) == (pytest.approx(top), 1)  # what is beyond the last edge is in the last bar
    assert len(good) == 10  # of few cases
    assert [len(plots.bin_edges(np.arange(float(count)))) - 1 for count in (50, 400, 10_000)] == [14, 40, 60]
    lines = {round(line.get_xdata()[0], 6): color(line) for line in axis.lines}
    assert lines.pop(90.0) == plots.BAD  # the limit, dashed as its note says, and labeled
    assert [line.get_linestyle() for line in axis.lines if line.get_xdata()[0] == pytest.approx(90.0)] == ["--"]
    assert axis.get_title("right") == "limit 90 mN"
    assert sorted(lines) == pytest.approx([20.0, 50.0, 100.0])  # smallest, median, largest of six
    assert axis.get_xlabel() == "force_max [mN]"
    assert plots.histogram(cases_of(study, [None] * 6), "force_max", "plain", "mN") == ""
    (axis,) = plots.histogram(
        cases_of(study, [0.05] * 6), "force_max", "plain", "mN"
    )  # all the same: a span of twice the value
    assert axis.containers[0][0].get_height() == 6
    assert axis.containers[0][-1].get_x() + axis.containers[0][-1].get_width() == pytest.approx(100.0)


@every_case(("soft", "shared"), [([0.3, 0.4, 0.5], False), ([0.003, 0.05, 0.5], True)])
def test_histograms_of_variants_have_a_common_axis(tmp_path, drawn, monkeypatch, soft, shared):
    monkeypatch.setattr(plots, "FEW", 1)
    study = load_study(study_file(tmp_path, STUDY.replace("count: 6", "count: 3")))
    values = {"plain": [0.001, 0.004, 0.005], "soft": soft}
    rows = [
        Row(one.number, "done", "", (values[one.variant][one.sample - 1], 0.01), (True, None))
        for one in study.requests()
    ]
    cases = CaseTable(study, list(study.requests()), rows)
    (plain,), (soft_axis,) = (plots.histogram(cases, "force_max", variant, "mN") for variant in ("plain", "soft"))
    assert plain.get_xlim() == pytest.approx(soft_axis.get_xlim())
    widths = [axis.containers[0][0].get_width() for axis in (plain, soft_axis)]
    assert bool(np.isclose(*widths)) is shared  # bins of their own where they do not overlap
    assert sum(bar.get_height() for own in soft_axis.containers[:1] for bar in own) == 3


def test_limits_of_a_metric_are_those_of_its_variant(study):
    assert plots.limits_of(study, "plain", "force_max") == [0.09]
    assert plots.limits_of(study, "plain", "motion") == []


def areas(axis):
    """Lowest and highest value of each filled area."""
    return [
        tuple(np.round([one.get_datalim(axis.transData).y0, one.get_datalim(axis.transData).y1], 6))
        for one in axis.collections
    ]


def test_bands_of_a_signal_show_quantiles_and_what_is_beyond_limits(tmp_path, drawn):
    text = STUDY.replace("every: 50 ms", "every: 500 ms")
    study = study_of(tmp_path, text)
    cases = cases_of(study, [0.02] * 6)
    curves = [np.full(3, 0.001 * (k + 1), np.float32) for k in range(4)] + [None, np.full(4, 0.101, np.float32)]
    table = pa.table({"case": list(range(1, 7)), "force": pa.array(curves, pa.list_(pa.float32()))})
    parquet.write_table(table, tmp_path / "bands.parquet")
    (axis,) = plots.bands(tmp_path, cases, "force", "plain", 0)
    (median,) = axis.lines
    assert median.get_xdata() == pytest.approx([0.0, 0.5, 1.0])  # as long as the shortest
    assert median.get_ydata() == pytest.approx([3.0, 3.0, 3.0], rel=1e-6)  # mN
    assert areas(axis) == [
        pytest.approx((1.0, 101.0)),
        pytest.approx((1.2, 81.6)),  # 5 and 95 % of 1, 2, 3, 4, 101
        pytest.approx((2.0, 4.0)),
    ]
    empty = pa.table({"case": [1], "force": pa.array([None], pa.list_(pa.float32()))})
    parquet.write_table(empty, tmp_path / "bands.parquet")
    assert plots.bands(tmp_path, cases, "force", "plain", 0) == ""


def test_limits_of_a_signal_hold_in_their_window():
    from twin.results import expression

    def expectation(text, **options):
        window = SimpleNamespace(start_ns=options.pop("start", None), stop_ns=options.pop("stop", None))
        values = {"at_most": None, "at_least": None, "variants": (), **options}
        return SimpleNamespace(signal=expression.parse(text) if text else None, window=window, **values)

    expectations = [
        expectation("a.x", at_most=2.0, at_least=-1.0),
        expectation("a.x", at_most=0.0, start=1_000_000_000, stop=2_000_000_000),
        expectation("a.y", at_most=9.0),
        expectation("", at_most=9.0),
        expectation("a.x", at_most=9.0, variants=("soft",)),
        expectation("a.x", at_least=3.0, variants=("plain",), start=2_000_000_000),
    ]
    study = SimpleNamespace(bands={"x": expression.parse("a.x")}, scenario=SimpleNamespace(expectations=expectations))
    found = plots.expected(study, "plain", "x", np.array([0.0, 1.0, 2.0, 3.0]))
    assert [(limit, sign, inside.tolist()) for limit, sign, inside in found] == [
        (2.0, 1.0, [True] * 4),
        (-1.0, -1.0, [True] * 4),
        (0.0, 1.0, [False, True, True, False]),
        (3.0, -1.0, [False, False, True, True]),
    ]


def bars(axis):
    return [
        [(round(bar.get_y() + bar.get_height() / 2, 6), round(bar.get_width(), 6)) for bar in own]
        for own in axis.containers
        if hasattr(own, "patches")
    ]


def test_bars_of_what_drives_a_metric(drawn):
    effects = (Effect("rate", 0.6, (0.5, 0.7), 0.7, (0.5, 0.9)), Effect("scale", 0.2, (0.15, 0.25), 0.3))
    (axis,) = plots.effects(MetricSensitivity("force", "plain", "sobol", effects), "mN")
    assert bars(axis) == [[(-0.2, 0.6), (0.8, 0.2)], [(0.2, 0.7), (1.2, 0.3)]]
    assert labels(axis) == ["rate", "scale"]
    assert axis.yaxis_inverted()
    assert axis.get_xlabel() == "share of the variance of force"
    assert [one.get_text() for one in axis.get_legend().get_texts()] == [
        "alone (first order)",
        "with interactions (total)",
    ]
    (axis,) = plots.effects(
        MetricSensitivity("force", "plain", "morris", (Effect("rate", 0.004, (0.003, 0.005)),)), "mN"
    )
    assert bars(axis) == [[(0.0, 4.0)]]
    assert axis.get_xlabel() == "mean absolute effect on force [mN]"
    assert axis.get_legend() is None
    (axis,) = plots.effects(MetricSensitivity("force", "plain", "rank", (Effect("rate", -0.4, (-0.9, 0.3)),)), "mN")
    assert bars(axis) == [[(0.0, -0.4)]]
    assert axis.get_xlabel() == "rank correlation with force"
    assert axis.get_xlim() == (-1.0, 1.0)
    (whisker,) = axis.collections[0].get_segments()
    assert whisker[:, 0] == pytest.approx([-0.9, 0.3])


def test_a_tornado_has_the_largest_change_first(drawn):
    own = [Change("force", "plain", "a", 1.0, 2, now, 0.01) for now in (0.012, 0.004, 0.011)]
    (axis,) = plots.tornado(own, "mN", "force", ["a 1", "a 2", "a 3"])
    assert labels(axis) == ["a 2", "a 1", "a 3"]
    assert bars(axis) == [[(0.0, -6.0), (1.0, 2.0), (2.0, 1.0)]]
    assert [color(bar) for bar in axis.patches] == [plots.BAD, plots.GOOD, plots.GOOD]
    assert axis.get_xlabel() == "change of force [mN]"


def test_the_way_of_a_tuning(drawn):
    trials = [
        Trial((1.0,), 0.010, (0.1,), "sample", 0),
        Trial((2.0,), 0.008, (-0.1,), "tune", 1),
        Trial((3.0,), float("inf"), (1e6,), "tune", 2),
        Trial((4.0,), 0.006, (-0.1,), "tune", 5),
    ]
    (axis,) = plots.tuning_history(Tuned(trials, trials[3], [], 9), "mN", "max of force")
    good, bad, own = axis.lines
    assert list(zip(*good.get_data(), strict=True)) == [(1, pytest.approx(8.0)), (5, pytest.approx(6.0))]
    assert bad.get_xdata().tolist() == [0, 2]
    assert bad.get_ydata()[0] == pytest.approx(10.0)
    assert np.isnan(bad.get_ydata()[1])
    assert own.get_ydata()[0] == pytest.approx(10.0)
    assert axis.get_ylim() == pytest.approx((5.6, 10.4))  # room for the points at both ends
    trials = [Trial((1.0,), value, (-0.1,), "tune", i) for i, value in enumerate((0.01, 0.0101, 0.0102))]
    (axis,) = plots.tuning_history(Tuned(trials, trials[0], [], 9), "mN", "max of force")
    assert axis.get_ylim() == pytest.approx((9.98, 10.22))


def test_the_table_of_variants_has_medians_and_pass_rates(tmp_path):
    study = load_study(study_file(tmp_path))
    requests = list(study.requests())
    forces = [0.02, 0.12, 0.04, 0.1, 0.1, 0.02, 0.06, 0.02, 0.08, 0.02, 0.05, 0.02]  # plain and soft in turn
    rows = [Row(one.number, "done", "", (f, None), (f <= 0.09, None)) for one, f in zip(requests, forces, strict=True)]
    answers = Answers(CaseTable(study, requests, rows))
    found = tables.variants(answers)
    assert [row["name"] for row in found["rows"]] == ["force_max", "motion", "gentle"]  # more than variants: as rows
    assert [row["unit"] for row in found["rows"]] == ["mN", "mm", "pass rate"]
    assert [head[0] for head in found["columns"]] == ["plain", "soft"]
    assert (found["worth"], found["of"], [row["bad"] for row in found["rows"]]) == (
        True,
        "metric",
        [False, False, True],
    )
    force, motion, gentle = (row["cells"][0] for row in found["rows"])
    assert (force["value"], force["text"], force["more"]) == (pytest.approx(55.0), "55", "20 to 100")
    assert (motion["text"], motion["value"], motion["more"]) == ("-", None, "no value")  # says why
    assert (gentle["text"], gentle["value"], gentle["kind"]) == ("83.3 %", pytest.approx(5 / 6), "fail")
    assert answers.between("force_max", 0.02, 0.034) == "20 to 34 mN"
    assert answers.between("force_max", float("nan"), 0.034) == "below 34 mN"
    assert answers.between("force_max", 0.02, float("nan")) == "above 20 mN"
    assert answers.between("force_max", float("nan"), float("nan")) == "too few cases"
    assert tables.metric_cell(answers, "motion", float("nan"), "plain", rows[0])["tip"] == "no value"
    lost = replace(rows[0], status="failed")
    assert tables.metric_cell(answers, "motion", float("nan"), "plain", lost)["tip"] == "did not finish"
    listed = tables.singles(SimpleNamespace(runs={3: "cases/run"}, folder="runs/a/1"), answers, [1, 2, 3])
    assert [(row["number"], row["variant"], row["failed"], row["verdict"], row["run"]) for row in listed["rows"]] == [
        (2, "soft", "gentle", "", ""),
        (1, "plain", "", "pass", ""),
        (3, "plain", "", "pass", "cases/run"),
    ]
    assert [row["command"] for row in listed["rows"][1:]] == ["twin run --case runs/a/1:1", "twin view runs/a/1:3"]
    assert [head[:2] for head in listed["columns"]] == [
        ("heart.rate", "/min"),
        ("heart.scale", ""),
        ("bent end", "x"),
        ("force_max", "mN"),
        ("motion", "mm"),
    ]
    rate = listed["rows"][0]["cells"][0]
    assert rate["value"] == pytest.approx(60.0 * answers.cases.values[1, 0])
    assert rate["text"] == f"{rate['value']:.4g}"
    assert listed["of"] == 12
    keep = SimpleNamespace(failed=1, worst=2)
    worst = summary.noteworthy(answers.cases, keep)
    assert worst[0] == 2  # of the failed cases, the one farthest beyond the limit
    assert set(worst) == {5, 9, 2, 4}  # the two largest forces of each variant
    assert summary.noteworthy(answers.cases, SimpleNamespace(failed=0, worst=0)) == []
    assert summary.noteworthy(answers.cases, SimpleNamespace(failed=0, worst=1)) == [5, 2]


ONE_BY_ONE = """
scenario: scenario.yaml
samples: {method: one_at_a_time, seeds: [1, 2]}
variants: [plain]
vary:
  heart.rate: {values: [60 /min, 90 /min], source: assumed}
  bent end: {scales: wall.bending_stiffness, values: [2], source: assumed}
"""


def test_changes_are_from_the_first_sample_with_the_same_seed(tmp_path):
    study = load_study(study_file(tmp_path, ONE_BY_ONE))
    requests = list(study.requests())
    assert len(requests) == 8  # as it is, 60, 90, doubled; each with two seeds
    forces = [0.01, 0.03, 0.02, 0.04, 0.05, 0.06, 0.07, 0.08]
    rows = [Row(one.number, "done", "", (f, 0.0), (True, None)) for one, f in zip(requests, forces, strict=True)]
    cases = CaseTable(study, requests, rows)
    found = [one for one in sensitivity.changes(cases) if one.metric == "force_max"]
    assert [(one.factor, one.value, one.number, one.now, one.before) for one in found] == [
        ("heart.rate", 1.0, 3, 0.02, 0.01),
        ("heart.rate", 1.0, 4, 0.04, 0.03),
        ("heart.rate", 1.5, 5, 0.05, 0.01),
        ("heart.rate", 1.5, 6, 0.06, 0.03),
        ("bent end", 2.0, 7, 0.07, 0.01),
        ("bent end", 2.0, 8, 0.08, 0.03),
    ]
    answers = Answers(cases)
    assert [answers.change(one) for one in (found[2], found[4])] == ["heart.rate 90 /min", "bent end x 2"]
    assert answers.interval(answers.shares[0]) == ""  # no sample of anything
    (first, *_) = [one for one in page.headline(answers) if "force_max changes" in one.text]
    assert first.text == "force_max changes most with bent end x 2, from 10 mN to 70 mN (case 7)."
    assert first.case == 7


def test_sections_of_searches(tmp_path, drawn):
    text = STUDY + "tune:\n  knobs: {wall.free_length: {from: 40 mm, to: 60 mm}}\n  metric: force_max\n  of: quantile\n"
    text += "  limits: [{metric: motion, at_most: 3 mm}, {metric: force_max, of: min, at_least: 5 mN}]\n"
    study = study_of(tmp_path, text)
    answers = Answers(cases_of(study))
    trials = [Trial((0.048,), 0.09, (0.1, -0.1), "sample", 0), Trial((0.05,), 0.08, (-0.1, -0.1), "tune", 3)]
    tuned = Tuned(
        trials,
        trials[1],
        [Trial((0.048,), 0.1, (0.1, 0.0), "unseen", 0), Trial((0.05,), 0.085, (-0.1, 0.0), "unseen", 1)],
        9,
    )
    worst = WorstCase("force_max", "plain", "max", 7, 0.12, (1.5, 1.2, 1.0), 0.1, 48, 54)
    outcome = SimpleNamespace(study=study, worst=worst, tuned=tuned)
    found = page.tuned(outcome, answers)
    assert [(row["name"], row["knobs"], row["objective"], row["limits"]) for row in found["rows"]] == [
        ("as in the scenario", ["48 mm"], "90 mN", "broken: mean of motion at most 3 mm"),
        ("best", ["50 mm"], "80 mN", "kept"),
        ("as in the scenario, unseen samples", ["48 mm"], "100 mN", "broken: mean of motion at most 3 mm"),
        ("best, unseen samples", ["50 mm"], "85 mN", "kept"),
    ]
    assert (found["title"], found["trials"], found["knobs"]) == ("95 % quantile of force_max", 2, ["wall.free_length"])
    searched = next(one for one in page.headline(answers, worst, tuned) if one.topic == "Worst case")
    assert searched.text == (
        "A search in 48 cases found the worst force_max with plain in case 7: 120 mN (heart.rate 90 /min, heart.scale 1.2, "
        "bent end x 1); worst of the random samples: 100 mN."
    )
    assert searched.case == 7
    chosen = "The tuning chose wall.free_length 50 mm: 95 % quantile of force_max on unseen samples 85 mN, with the scenario's values 100 mN."
    assert chosen in [one.text for one in page.headline(answers, worst, tuned)]
    told = page.searched(outcome)
    assert told["worst"]["values"] == [1.5, 1.2, 1.0]
    assert told["tuned"]["best"]["objective"] == 0.08
    assert told["tuned"]["own"]["broken"] == [0.1, -0.1]
    assert [len(told["tuned"][name]) for name in ("unseen", "trials")] == [2, 2]
    nothing = SimpleNamespace(study=study, worst=None, tuned=None)
    assert (page.tuned(nothing, answers), page.searched(nothing)) == (None, {})
    failed = page.headline(answers, None, Tuned(trials[:1], None, tuned.unseen[:1], 9))
    assert "None of 1 trials of the tuning meets the limits." in [one.text for one in failed]
    none_good = SimpleNamespace(study=study, worst=None, tuned=Tuned(trials[:1], None, tuned.unseen[:1], 9))
    assert [row["name"] for row in page.tuned(none_good, answers)["rows"]] == [
        "as in the scenario",
        "as in the scenario, unseen samples",
    ]
    assert page.searched(none_good)["tuned"]["best"] is None


@pytest.mark.slow
def test_which_pictures_a_page_has(study, tmp_path, drawn):
    answers = Answers(cases_of(study))
    outcome = SimpleNamespace(study=study, cases=answers.cases, folder=tmp_path)
    factors = ("heart.rate", "heart.scale", "bent end", "all factors")
    titles = ["plain, distribution", *(f"plain, over {name}" for name in factors)]
    pictures = page.pictures(outcome, answers)
    assert {group: [title for title, *_ in own] for group, own in pictures.items()} == {
        "force_max": titles,
        "motion": titles,
    }
    named = page.link({3})
    assert (named(3), named(4)) == ('<a href="#case-3">3</a>', "4")
    rate, _, bend = tables.factors(outcome)
    assert bend["targets"] == "wall.bending_stiffness (multiplied)"
    assert bend["kind"] == "log-normal: median x 1, geometric standard deviation 1.2"
    assert rate["kind"] == "normal: mean 70 /min, standard deviation 12 /min; from 45 /min to 110 /min"


def test_numbers_that_json_has_not():
    nan, inf = float("nan"), float("inf")
    assert summary.cleaned({"a": (1, nan, np.float64(2.0)), "b": [np.int64(3), -inf], "c": "nan", "d": None}) == {
        "a": [1, None, 2.0],
        "b": [3, None],
        "c": "nan",
        "d": None,
    }
    assert summary.percent(nan) == "-"
    assert PassRate("a", "b", 0, 0, 0.0, 1.0).part != PassRate("a", "b", 0, 1, 0.0, 1.0).part
