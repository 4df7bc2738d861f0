"""report.html in a browser: charts in place of plots, one cursor of time, nothing cut on a phone, plots on paper.

Over 400 lines: a page in a browser serves many tests.
"""

import dataclasses
import json
import re
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.run.reported import FORCE, LIMIT, PLOTS, TIME, labels, tables
from twin.results import (
    Analysis,
    Evaluation,
    EventLine,
    Expectation,
    Metric,
    Plot,
    PlotCurve,
    Signals,
    default_run,
    evaluate,
    expression,
    find_violations,
    trace_to_inputs,
)
from twin.results.evaluation.violations import Violation
from twin.results.recording import run_folder as results
from twin.results.recording.signals import Window
from twin.run import metric_charts, report_curves, report_page
from twin.run.event_table import EventRow
from twin.run.parameter_table import ParameterRow
from twin.run.recorded_views import RecordedSignal, RecordedSystem, machine_film, system_views
from twin.run.report_plots import draw_plots
from twin.run.scenes import ReportScenes
from twin.structure import picture
from twin.web import PackedArrays

SHIPPED = Path(__file__).parents[2] / "scenarios" / "heart_wall_force.yaml"
POSITION = Plot("Position", (PlotCurve(expression.parse("a.x"), "x"),), unit="mm", per_variant=True)
EVENTS = [EventRow(2 * 10**9, "set a.k = 4 N/m")]


def written(folder, plots=(PLOTS[0], POSITION, PLOTS[1]), limit=LIMIT, **more) -> str:
    evaluation = evaluate({}, [limit], tables())
    summary = results.build_summary(results.RunInfo("x"), evaluation, tables()) | {"sentence": ""}
    text = report_page.report_html(
        summary, evaluation, tables(), plots=plots, expectations=[limit], events=EVENTS, folder="runs/x/1", **more
    )
    (folder / "report.html").write_text(text)
    return text


def test_a_report_without_curves_has_no_chart() -> None:
    summary = results.build_summary(results.RunInfo("x"), Evaluation(), {}) | {"sentence": ""}
    assert "class Chart" not in report_page.report_html(summary, Evaluation(), {})


def test_the_first_sentence_of_a_description_stands_alone_and_code_is_marked() -> None:
    text = "A tip of 2.5 mm in `a<b>` moves. It stops. Then it waits."
    assert report_page.split_first_sentence(text) == ("A tip of 2.5 mm in `a<b>` moves.", "It stops. Then it waits.")
    assert report_page.split_first_sentence("") == ("", "")
    assert report_page.mark_code("in `a<b>`") == "in <code>a&lt;b&gt;</code>"


def test_the_system_is_drawn_once_and_variants_differ_in_words(tmp_path) -> None:
    def drawing(*titles: str) -> str:
        return f"<svg>{''.join(f'<title>{title}</title>' for title in titles)}</svg>"

    first = drawing("controller: pi", "a.x → b.y\ndelay 1 ms", "tip: rod")
    others = [drawing("controller: ff", "a.x → b.y", "tip: rod"), drawing("controller: pi", "b.y → a.x", "tip: rod")]
    structures = [((svg, ""), [f"v{number}"]) for number, svg in enumerate([first, *others, *[first] * 12])]
    text = written(tmp_path, structures=structures)
    assert (first in text, others[0] in text, text.count("<summary>Members and connections of v0")) == (True, False, 1)
    words = re.findall('<p><b>(v\\d+)</b>: <span class="soft">(.*?)</span></p>', text)
    assert words[:2] == [("v1", "controller is ff"), ("v2", "with b.y → a.x; without a.x → b.y")]
    assert "2 more differ: <code>twin graph x --variant NAME</code>" in text
    assert "--variant NAME" not in written(tmp_path, structures=structures[:13])


def test_points_of_a_page_are_limited() -> None:
    many = {(f"v{k}", 1): signals for k, signals in enumerate([tables()["PI", 1]] * 300)}
    assert report_curves.points_per_curve([PLOTS[0]], tables()) == report_curves.MAX_POINTS
    assert report_curves.points_per_curve([PLOTS[0]], many) == report_curves.MAX_VALUES // 300


def test_quantized_values_are_as_near_as_stated() -> None:
    values = np.append(np.random.default_rng(1).normal(size=1000), np.nan)
    found = report_curves.quantize(values)
    assert np.nanmax(np.abs(found - values)) <= (np.nanmax(values) - np.nanmin(values)) / 2**17
    assert np.isnan(found[-1])
    np.testing.assert_array_equal(report_curves.quantize(np.full(3, 0.1)), np.full(3, 0.1))


def test_a_curve_is_marked_where_it_violates_its_own_expectations() -> None:
    limits: dict[str, Any] = {"cases": {("PI", 1): None}, "name": "", "text": "", "window": Window()}
    violations = [
        Violation(signal=expression.parse("a.force"), high=2.0, **limits),
        Violation(signal=expression.parse("a.position"), high=0.0, **limits),
    ]
    curves: Any = SimpleNamespace(violations=violations)
    points = np.arange(5.0), np.array([0.0, 3.0, 3.0, 1.0, 4.0])

    def spans(signal: str, *case: Any) -> list[tuple[float, float]]:
        curve: Any = SimpleNamespace(signal=expression.parse(signal))
        return list(report_curves.PaneBuilder.violating_spans(curves, curve, case, points))

    assert spans("a.force", "PI", 1) == [(1.0, 2.0), (4.0, 4.0)]
    assert spans("a.position", "PI", 1) == [(1.0, 4.0)]
    assert spans("a.velocity", "PI", 1) == []
    assert spans("a.force", "PI", 2) == []


def test_an_order_is_drawn_with_its_margins_after_the_curve_of_the_first_violation() -> None:
    """A chart for each failed order, no red curve; the violated curve alone is open; the scene begins at its violation."""
    metrics = {"std": Metric("std", FORCE, "std", unit="mN")}
    wanted = [
        Expectation("order", metric="std", ordered=("PI", "PI+FF"), margin_part=0.7),
        Expectation("other order", metric="std", ordered=("PI+FF", "PI")),
        LIMIT,
    ]
    evaluation = evaluate(metrics, wanted, tables())
    summary = results.build_summary(results.RunInfo("x"), evaluation, tables()) | {"sentence": ""}
    text = report_page.report_html(summary, evaluation, tables(), plots=PLOTS[:1], expectations=wanted)
    assert re.findall("<figcaption><b>(.*?)</b>", text) == [
        "Force &lt;per&gt; controller",
        "Failed: order",
        "Failed: other order",
    ]
    charts = metric_charts.draw_metric_charts(wanted, evaluation)
    assert [figure.violations for figure in charts] == [("order",), ("other order",)]
    assert {"PI", "PI+FF", "std [mN]"} <= set(labels(charts[0].svg))
    rows = [result for result in evaluation.metric_results if result.metric.name == "std"]
    assert list(metric_charts.row_bounds(wanted[0], rows)) == [(1, pytest.approx(0.3 * rows[0].mean))]
    section = text[text.index('id="requirements"') : text.index('id="metrics"')]
    assert re.findall(r'<a href="#plot-(\d)"', section) == ["1", "2", "3"]
    assert text.index("<summary>Failed: order</summary>") > text.index('id="plot-1"')
    worst = TIME[np.argmax(tables()["PI", 2].values["a.force"])]
    assert evaluation.expectation_results[2].detail.startswith(f"0.25 N at {worst:g} s in PI, seed 2")
    assert f'<section id="plots" data-variant="PI" data-seed="2" data-time="{worst}">' in text
    assert '"title":"PI, seed 2"' in text
    assert '"case":["PI",2]' in text


def test_a_metric_of_an_analysis_is_marked_in_its_input() -> None:
    """In the worst window; the flat curve of its result is left out, and its values are a chart."""

    def windows(force: Any) -> dict[str, Any]:
        own = [np.std(force[k : k + 3000]) for k in range(500, 2002)]
        return {"std": np.append(np.full(3499, own[0]), own)}

    windows.outputs, windows.window_length = {"std": "N"}, 3.0  # type: ignore[attr-defined]
    analysis = Analysis("windows", "m:windows", {"force": FORCE})
    object.__setattr__(analysis, "load", lambda: windows)
    recorded = {case: analysis.apply(signals) for case, signals in tables().items()}
    metrics = {"worst": Metric("worst", expression.parse("windows.std"), "max", unit="N")}
    wanted = [Expectation("steady", metric="worst", at_most=0.03, unit="N")]
    evaluation = evaluate(metrics, wanted, recorded)
    (violation,) = find_violations(wanted, evaluation, recorded)
    (traced,) = trace_to_inputs(violation, [analysis], recorded)
    (end,) = {traced.cases["PI", 1]}
    worst = recorded["PI", 1].values["windows.std"]
    assert (traced.signal, traced.variants, end) == (FORCE, ("PI",), TIME[np.flatnonzero(worst == worst.max())[-1]])
    first = TIME[3499]
    assert end >= first
    np.testing.assert_array_equal(traced.violating_samples(("PI", 1), TIME, TIME), np.abs(TIME - end + 1.4995) < 1.4999)
    assert trace_to_inputs(violation, [], recorded) == [violation]
    summary = results.build_summary(results.RunInfo("x"), evaluation, recorded) | {"sentence": ""}
    text = report_page.report_html(
        summary, evaluation, recorded, plots=PLOTS[1:2], expectations=wanted, analyses=[analysis]
    )
    titles = re.findall("<figcaption><b>(.*?)</b>", text)
    assert titles == ["Failed: steady, worst 3 s", "Loop"]  # the computed values are below the curve
    assert '<div class="computed"><small>' in text
    ((pane,),) = draw_plots(PLOTS[1:2], recorded, [], [traced], PackedArrays(), "x")[0].panels
    assert "range" not in pane  # all that is shown is inside: from the first window on
    assert pane["reach"] == pytest.approx((max(first - 3.0, 0.0), TIME[-1]))
    assert "the worst 3 s, which violate steady" in text
    assert "--signal windows.std" not in text


def test_a_changed_run_names_the_command_that_compares_it_with_the_default_run(tmp_path) -> None:
    changed = tmp_path / "2026-01-02_00-00-00"
    command = report_page.compare_command({"name": "x"}, "runs/x/2026-01-02_00-00-00", "")
    assert command == "twin run x; twin compare runs/x/latest runs/x/2026-01-02_00-00-00"
    command = report_page.compare_command({"name": "x", "path": str(SHIPPED)}, "f 1/x/2026-01-02_00-00-00", "")
    assert command == (
        "twin run heart_wall_force --runs 'f 1'; twin compare 'f 1/x/latest' 'f 1/x/2026-01-02_00-00-00'"
    )
    for day, overrides in ((1, ()), (2, ("a.k=4",)), (3, ("a.k=5",))):
        folder = tmp_path / f"2026-01-0{day}_00-00-00"
        folder.mkdir()
        results.write_summary(folder / "summary.json", {"cases": [1], "overrides": overrides})
    own = default_run(changed)
    assert own == tmp_path / "2026-01-01_00-00-00"
    evaluation = evaluate({}, [LIMIT], tables())
    summary = results.build_summary(results.RunInfo("x", overrides=("a.k=4",)), evaluation, tables()) | {"sentence": ""}
    text = report_page.report_html(summary, evaluation, tables(), folder=str(changed), default_folder=str(own))
    assert f"Against the default run:</span> <code>twin compare {own} {changed}</code>" in text


def test_a_changed_run_says_what_fails_and_what_it_was_in_the_default_run(tmp_path) -> None:
    """With the warning of a range below the change, and both values of a failed metric."""
    metrics = {"std": Metric("std", FORCE, "std", unit="mN")}
    limit = dataclasses.replace(LIMIT, at_most=0.24)
    order = Expectation("order", metric="std", ordered=("PI+FF", "PI"))
    evaluation = evaluate(metrics, [order, limit], tables())
    default = {"metrics": {"std": {"variants": {"PI": {"mean": 20.0}, "PI+FF": {"mean": 30.0}}}}}
    default["expectations"] = [{"name": LIMIT.name, "detail": "a.force was 0.11 N to 0.2 N; expected from 0.1 N."}]
    (tmp_path / "summary.json").write_text(json.dumps(default))
    warning = "warning: a.k=4 is outside of the range that the scenario states, 0 to 1."
    info = results.RunInfo("x", overrides=("a.k=4",), extra={"notes": [warning, "another"]})
    summary = results.build_summary(info, evaluation, tables()) | {"sentence": ""}
    text = report_page.report_html(
        summary, evaluation, tables(), expectations=[order, limit], default_folder=str(tmp_path), previous_values=["2"]
    )
    head, rest = text[text.index("<header>") : text.index("</header>")], text[text.index("</header>") :]
    assert "&#34; fail; the first: 0.25\N{NO-BREAK SPACE}N in PI, seed 2 (default run: 0.11" in head
    assert "<b>Changed:</b>" not in head  # said once
    assert f'<p class="warn">{warning}</p>' in head
    own = {
        "title": "Study",
        "case": 3,
        "factors": {"heart.rate": "68.17 /min", "friction": "x 0.5319"},
        "overrides": [],
        "page": "",
    }
    of_study = report_page.report_html(summary | {"study": own}, evaluation, tables())
    assert re.search(r"With heart.rate 68.17\s/min, friction x 0.5319, &#34;.* fail; the first: ", of_study)
    assert warning not in rest
    assert "another" in rest
    table = rest[rest.index('<table class="failures') :]
    assert re.search(r'<td data-label="default run">20(.0*)? mN</td>', table)
    row = table[table.index("stays &lt;in&gt; band<") : table.index(">order</a>")]
    assert re.findall(r'<td data-label="(.*?)">(.*?)</td>', row) == [
        ("limit", "0.1 N to 0.24 N"),
        ("default run", "0.11 N to 0.2 N"),
        ("this run", "0.25 N"),
        ("worst in", "PI, seed 2"),
        ("time", f"{TIME[np.argmax(tables()['PI', 2].values['a.force'])]:g} s"),
    ]


def test_a_value_outside_of_nominal_limits_is_no_green_badge() -> None:
    """Though it is not judged, as settings were changed: the headline names it, the list gives its value."""
    nominal = Expectation("young", signal=FORCE, at_most=0.2, unit="N", nominal=True)
    fine = Expectation("fine", signal=FORCE, at_most=9.0, unit="N")
    evaluation = evaluate({}, [nominal, fine], tables(), paper_applies=False)
    summary = results.build_summary(results.RunInfo("x", overrides=("a.k=4",)), evaluation, tables()) | {"sentence": ""}
    text = report_page.report_html(summary, evaluation, tables(), expectations=[nominal, fine])
    assert summary["passed"]
    badge = '<span class="badge other">✓ 1 of 1 requirements met, 1 not judged, 1 of these outside of nominal limits<'
    assert badge in text
    assert "all 1 judged requirements are met; 1 not judged lies outside of nominal limits: young." in text
    assert "Outside of its limits for nominal values: 0.25 N" in text
    assert results.describe_outcome(summary) == ("PASS", "1 of 1, 1 not judged, 1 of these outside of nominal limits")


def test_changed_values_stand_below_the_sentence_and_first_in_their_table() -> None:
    rows = [
        ParameterRow("a", "m", "1", given=True),
        ParameterRow("a", "k", "4", "N/m", source="set by `--set a.k=4`", given=True, default="2 N/m"),
    ]
    assert report_page.describe_changes(["a.k=4", "step=1 ms", "a.m=3"], ["", "2 ms", "3"], rows) == [
        ("a.k 4", "default 2 N/m"),
        ("step 1 ms", "was 2 ms"),
        ("a.m 3", ""),
    ]
    assert [row.name for row in report_page.group_by_member(rows)["a"]] == ["k", "m"]


@pytest.mark.parametrize("limit", [LIMIT, Expectation("", signal=FORCE, at_most=9.0)])
def test_plots_come_before_metrics(limit) -> None:
    evaluation = evaluate({"mean": Metric("mean", FORCE, "mean")}, [limit], tables())
    summary = results.build_summary(results.RunInfo("x"), evaluation, tables()) | {"sentence": ""}
    text = report_page.report_html(summary, evaluation, tables(), plots=PLOTS[:1], expectations=[limit])
    sections = ["requirements", "plots", "metrics", "versions"]
    assert re.findall('<section id="(.*?)"', text) == sections
    assert re.findall('<a href="#(requirements|plots|metrics|versions)">', text) == sections


@pytest.mark.slow
def test_panes_hold_what_was_recorded_and_what_failed() -> None:
    evaluation = evaluate({}, [LIMIT], tables())
    violations = find_violations([LIMIT], evaluation, tables())
    drawn: list[float] = []
    force, loop, nothing = draw_plots(
        PLOTS, tables(), [EventLine(2.0, "set a.k = 4")], violations, PackedArrays(), "runs/x", {}, drawn.append
    )
    assert drawn == pytest.approx([1 / 2, 2 / 3, 5 / 6])  # the percentage of the bar while a report is written
    ((first, second),) = force.panels
    assert [first["title"], second["title"], first["unit"]] == ["PI, seed 1", "PI+FF, seed 1", "N"]
    assert first["lines"] == [0.2]
    assert first["extent"] == second["extent"] == pytest.approx([0.15, 0.25], abs=1e-3)
    assert first["shared"] == second["shared"] == pytest.approx([0.1, 0.22])  # violated limits; the axis is for both
    inside = np.zeros(len(TIME), bool)
    for case in (("PI", 1), ("PI", 2)):
        value = tables()[case].values["a.force"]
        inside |= (value < 0.1) | (value > 0.22)
    shaded = np.any([(span["from"] <= TIME) & (span["to"] >= TIME) for span in first["spans"]], axis=0)
    np.testing.assert_array_equal(shaded, inside)
    assert [limit["y"] for limit in first["limits"]] == pytest.approx([0.1, 0.4, 0.1, 0.22])
    assert [limit["failed"] for limit in first["limits"]] == [False, False, True, True]
    assert set(first["curves"][0]) >= {"name", "low", "high"}
    assert force.marks == [{"at": 2.0, "text": "1", "variants": []}]
    assert first["reach"] == (0.0, 5.0)
    assert force.command == "twin view runs/x --signal a.force"
    assert loop.panels[0][0]["own"]
    assert nothing.panels == []


@pytest.fixture
def page(browser, tmp_path):
    """The page of a report, which loads nothing and has no errors."""
    written(tmp_path)
    context = browser.new_context(viewport={"width": 1400, "height": 900})
    one, asked, wrong = context.new_page(), [], []
    one.on("request", lambda request: asked.append(request.url))
    one.on("pageerror", lambda error: wrong.append(str(error)))
    one.goto(f"file://{tmp_path}/report.html")
    one.wait_for_function(DRAWN)
    yield one
    assert wrong == []
    assert [url for url in asked if not url.startswith("blob:")] == [f"file://{tmp_path}/report.html"]
    context.close()


CHARTS = "[...document.querySelectorAll('.twin-chart')].map((element) => element.chart)"
DRAWN = f"() => {{ const charts = {CHARTS}; return charts.length === 3 && charts.every((chart) => chart.frames && !chart.stale); }}"


def place(page, chart: int, part: float) -> tuple[float, float]:
    """Return where a part of the time axis is in the first pane of a chart, on the screen."""
    return tuple(
        page.evaluate(
            """([index, part]) => { const element = document.querySelectorAll(".twin-chart")[index], { chart } = element, box = chart.boxes[0];
            element.scrollIntoView({ block: "center" });
            const { left, top } = chart.canvas.getBoundingClientRect(), [from, to] = chart.axis();
            return [left + box.across(from + part * (to - from)), top + box.top + box.height / 2]; }""",
            [chart, part],
        )
    )


@pytest.mark.slow
def test_values_under_the_pointer_and_one_cursor_of_time(page) -> None:
    page.mouse.move(*place(page, 0, 0.5))
    texts = page.locator(".twin-read:not([hidden])").all_inner_texts()
    assert len(texts) == 2  # of both panes, above them: no read-out covers a curve
    assert not page.locator(".twin-hover:not([hidden])").count()
    for text, case in zip(texts, (("PI", 2), ("PI+FF", 1)), strict=True):  # of the seed that violates most
        assert text.startswith("2.5")
        assert "(seeds " in text
        value = tables()[case].values["a.force"][2500]
        assert float(re.search(r"([\d.]+) N", text)[1]) == pytest.approx(value, abs=2e-3)
    reads = page.locator(".twin-read").evaluate_all("(all) => all.map((one) => one.offsetTop + one.offsetHeight)")
    assert page.evaluate(f"{CHARTS}[0].boxes.map(({{ top }}) => top)") >= reads
    low, high = page.evaluate(f"[{CHARTS}[0].boxes[0].low, {CHARTS}[0].boxes[0].high]")
    assert (low < 0.1, high < 0.3) == (True, True)  # the edge at 0.4 N would take more than half of the height
    assert page.evaluate(f"{CHARTS}[1].time") == pytest.approx(2.5, abs=0.01)


@pytest.mark.slow
def test_the_panes_of_a_plot_have_one_axis_of_time(browser, tmp_path) -> None:
    """Of two charts side by side the left one ended at 120 s, the right one at 180 s."""
    time = np.arange(0.0, 181.0)
    cases = {
        (f"v{k}", 1): Signals(time[: 121 + 10 * k], {"a.force": time[: 121 + 10 * k]}, {"a.force": "N"})
        for k in range(7)
    }
    evaluation = evaluate({}, [], cases)
    summary = results.build_summary(results.RunInfo("x"), evaluation, cases) | {"sentence": ""}
    (tmp_path / "report.html").write_text(report_page.report_html(summary, evaluation, cases, plots=PLOTS[:1]))
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.goto(f"file://{tmp_path}/report.html")
    page.wait_for_function(
        f"() => {{ const charts = {CHARTS}; return charts.length === 2 && charts.every((chart) => chart.frames); }}"
    )
    assert page.evaluate(f"{CHARTS}.map((chart) => chart.axis())") == [[0, 180], [0, 180]]
    page.close()


@pytest.mark.slow
def test_a_state_has_its_name_under_the_pointer(browser, tmp_path) -> None:
    """It was `3.00 contact (seeds 2.00 to 3.00)`."""
    states = {1: np.array([3, 3, 3, 3, 3]), 2: np.array([2, 2, 2, 2, 3])}
    cases = {
        ("PI", seed): Signals(np.arange(5.0), {"a.state": value}, {"a.state": "1"}) for seed, value in states.items()
    }
    state = expression.parse("a.state")
    metrics = {"last": Metric("last", state, "final", codes={2: "approach", 3: "contact"})}
    evaluation = evaluate(metrics, [], cases)
    summary = results.build_summary(results.RunInfo("x"), evaluation, cases) | {"sentence": ""}
    text = report_page.report_html(summary, evaluation, cases, plots=[Plot("State", (PlotCurve(state, "state"),))])
    (tmp_path / "report.html").write_text(text)
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.goto(f"file://{tmp_path}/report.html")
    page.wait_for_function(f"() => {CHARTS}[0]?.frames")
    page.mouse.click(*place(page, 0, 0.5))
    assert page.locator(".twin-hover div").first.inner_text().endswith("contact (seeds: approach to contact)")
    assert page.locator(".twin-chip b").first.inner_text() == "contact"
    page.close()


@pytest.mark.slow
def test_a_mark_is_in_the_panes_of_its_variants_up_to_their_ends(page) -> None:
    page.evaluate(
        f"""() => {{ const chart = {CHARTS}[0]; window.lines = [];
        const {{ prototype }} = CanvasRenderingContext2D, plain = prototype.moveTo;
        prototype.moveTo = function (x, y) {{ if (this.getLineDash().join() === "2,3") window.lines.push(y); plain.call(this, x, y); }};
        chart.marks = [{{ at: 1, text: "1", variants: ["PI"] }}, {{ at: 6, text: "2" }}]; chart.draw(); window.tops = chart.boxes.map((box) => box.top); }}"""
    )
    assert page.evaluate("window.lines") == page.evaluate("window.tops")[:1]


@pytest.mark.slow
def test_values_at_two_times_are_exact_and_in_every_pane(page) -> None:
    for part in (0.25, 0.65):
        page.mouse.click(*place(page, 0, part))
    page.wait_for_function(f"{CHARTS}[1].cursors.length === 2")
    times = page.evaluate(f"{CHARTS}[0].cursors")
    panes = page.locator("#plot-1 .twin-legend").all_inner_texts()
    t1, t2 = (round(time, 4) for time in times)
    assert f"t1 {t1:g} s, t2 {t2:g} s, Δt {round(t2 - t1, 4):g} s" in panes[0]
    for case, text in zip((("PI", 2), ("PI+FF", 1)), panes, strict=True):
        expected = np.interp(times, TIME, tables()[case].values["a.force"])
        found = re.findall(r"([\d.]+) → ([\d.]+)", text)
        np.testing.assert_allclose(np.array(found[0], float), expected, atol=1e-4)
    page.mouse.move(*place(page, 0, 0.5))
    page.wait_for_selector(".twin-hover:not([hidden])")  # beside the pointer: above, it would cover those of t1 and t2
    assert not page.locator(".twin-read:not([hidden])").count()


@pytest.mark.slow
def test_charts_zoom_together_and_back(page) -> None:
    begin, end = place(page, 0, 0.2), place(page, 0, 0.6)
    page.mouse.move(*begin)
    page.mouse.down()
    page.mouse.move(*end, steps=3)
    page.mouse.up()
    page.wait_for_function(f"{CHARTS}[1].window")
    assert page.evaluate(f"{CHARTS}[1].window") == pytest.approx([1.0, 3.0], abs=0.02)
    page.mouse.dblclick(*begin)
    page.wait_for_function(f"!{CHARTS}[1].window")


@pytest.mark.slow
def test_panes_share_a_legend_and_a_figure_is_enlarged(page) -> None:
    names = page.locator("#plot-1 .twin-chip-name:visible")
    assert names.all_inner_texts() == ["force"]  # of two panes
    names.click()
    assert page.evaluate(f"{CHARTS}[0].dimmed.size") == 2
    names.click()
    assert page.evaluate(f"{CHARTS}[0].dimmed.size") == 0
    before = page.locator("#plot-1 .twin-chart").bounding_box()
    page.locator("#plot-1 .enlarge").click()
    page.wait_for_function(f"{CHARTS}[0].width > 1300")
    large = page.locator("#plot-1 .twin-chart").bounding_box()
    assert large["height"] > 1.5 * before["height"]
    assert page.evaluate("document.querySelector('#plot-1').scrollWidth") <= 1400
    select = page.locator("#plot-1 .pane")
    select.select_option("PI+FF, seed 1")
    assert page.evaluate(f"{CHARTS}[0].panes.map((pane) => pane.title)") == ["PI+FF, seed 1"]
    page.keyboard.press("Escape")
    page.wait_for_function(f"{CHARTS}[0].height < 500")
    assert page.evaluate(f"{CHARTS}[0].panes.length") == 2
    assert not select.is_visible()
    assert page.locator("#plot-1 .enlarge").inner_text() == "Enlarge"


@pytest.mark.slow
def test_paper_has_plots_in_light_and_a_phone_has_nothing_cut(page) -> None:
    page.emulate_media(color_scheme="dark")
    page.wait_for_function("document.body.classList.contains('body--dark')")
    page.wait_for_function(f"{CHARTS}[0].colors.violation === 'rgba(255, 60, 50, .3)'")  # seen on a dark background
    page.evaluate(
        "addEventListener('beforeprint', () => { window.wasDark = document.body.classList.contains('body--dark'); })"
    )
    page.pdf()
    assert page.evaluate("window.wasDark") is False
    shown = "(name) => getComputedStyle(document.querySelector(`figure.live > ${name}`)).display"
    assert (page.evaluate(shown, "svg"), page.evaluate(shown, ".panels")) == ("none", "grid")
    page.emulate_media(media="print")
    breaks = page.eval_on_selector_all(
        "#plots summary, figcaption", "(all) => all.map((one) => getComputedStyle(one).breakAfter)"
    )
    assert set(breaks) == {"avoid"}  # a title stays with its plot
    assert (page.evaluate(shown, "svg"), page.evaluate(shown, ".panels")) == ("block", "none")
    folds = "(all) => all.map((one) => getComputedStyle(one, '::details-content').contentVisibility)"
    assert page.locator("#requirements details:not(.pass)").evaluate_all(folds) == ["hidden"]  # the list of cases
    page.evaluate("document.querySelector('.scroll').classList.add('cut')")
    assert page.locator(".cut").evaluate("(box) => getComputedStyle(box, '::before').content") == "none"
    page.emulate_media(media="screen")
    page.set_viewport_size({"width": 360, "height": 740})
    page.wait_for_function("document.documentElement.scrollWidth === 360")  # charts follow their size a moment later
    assert page.locator("nav").evaluate("(nav) => getComputedStyle(nav).position") == "sticky"
    label, code, button = (
        page.locator(f"#plot-1 .command > {tag}").bounding_box() for tag in ("span", "code", "button")
    )
    assert max(label["height"], button["height"]) < 30  # one line each, the command below
    assert code["y"] >= button["y"] + button["height"] - 1


@pytest.mark.slow
def test_values_of_metrics_are_on_a_phone(browser, tmp_path) -> None:
    metric = Metric(
        "error", LIMIT.signal, "std", description="standard deviation of the contact force", paper={"PI": 0.04}
    )
    evaluation = evaluate({"error": metric}, [], tables())
    summary = results.build_summary(results.RunInfo("x"), evaluation, tables()) | {"sentence": ""}
    (tmp_path / "report.html").write_text(report_page.report_html(summary, evaluation, tables()))
    page = browser.new_page(viewport={"width": 360, "height": 740})
    page.goto(f"file://{tmp_path}/report.html")
    cells = page.locator("#metrics td:visible")
    boxes = [cells.nth(k).bounding_box() for k in range(cells.count())]
    assert len(boxes) >= 7
    assert all(box["x"] >= 0 and box["x"] + box["width"] <= 360 for box in boxes)
    assert (
        page.locator("#metrics td.twin")
        .first.evaluate("(cell) => getComputedStyle(cell, '::before').content")
        .startswith('"twin ')
    )
    page.close()


@pytest.mark.slow
def test_legends_that_wrap_cover_no_curve(page) -> None:
    rows = f"{CHARTS}.flatMap((chart) => [...chart.legends.children].map((row, k) => chart.boxes[k].top - row.offsetTop - row.offsetHeight))"
    page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    page.add_style_tag(content=".panels { max-width: 150px; }")  # chart and legends change in one frame
    page.wait_for_function(f"{CHARTS}.every((chart) => chart.width === 150)")
    page.wait_for_function(f"{rows}.every((gap) => gap >= 0)", timeout=3000)


@pytest.mark.slow
def test_a_link_of_the_contents_unfolds_a_plot(page) -> None:
    folded = page.locator("#plots details:has(figure)")
    assert folded.evaluate_all("(all) => all.map((one) => one.open)") == [
        False,
        False,
    ]  # the first plot shows the failure
    page.locator("nav a", has_text="Position").click()
    page.wait_for_function("document.querySelector('#plots details:has(figure)').open")
    page.wait_for_function(f"{CHARTS}.at(-2).width > 300 && {CHARTS}.at(-2).frames > 0")
    page.set_viewport_size({"width": 900, "height": 700})  # the menu of a narrow page has the plots, too
    folded.evaluate_all("(all) => all.forEach((one) => { one.open = false; })")
    page.locator("nav select").select_option(page.locator("nav a", has_text="Position").get_attribute("href"))
    page.wait_for_function("document.querySelector('#plots details:has(figure)').open")
    page.wait_for_function(
        "document.querySelector('nav').getBoundingClientRect().bottom <= document.querySelector('#plots details:has(figure)').getBoundingClientRect().top + 1"
    )


@pytest.mark.slow
def test_curves_have_three_quarters_beside_a_scene_and_a_cut_table_says_so(page) -> None:
    page.evaluate("document.body.classList.add('with-films')")
    page.wait_for_function(f"{CHARTS}[0].width > 0.7 * document.querySelector('#plots').clientWidth")
    table = page.locator("#events .scroll")
    page.add_style_tag(content="#events table { min-width: 400px; }")
    sign = "(box) => getComputedStyle(box, '::before').content"
    assert table.evaluate(sign) == "none"
    page.set_viewport_size({"width": 360, "height": 740})
    page.wait_for_function("document.querySelector('#events .scroll').matches('.cut')")
    assert "scroll" in table.evaluate(sign)


@pytest.mark.slow
def test_the_scene_folds_and_commands_are_whole(page) -> None:
    """It covers no plot once it is folded; a command is never cut."""
    page.evaluate("document.body.classList.add('with-films')")
    page.set_viewport_size({"width": 360, "height": 800})
    stage = page.locator("details.stage")
    high = stage.bounding_box()["height"]
    stage.locator("summary").click()
    assert stage.bounding_box()["height"] < min(high, 60)
    for width in (1400, 360):
        page.set_viewport_size({"width": width, "height": 800})
        cut = "(all) => all.filter((one) => one.scrollWidth > one.clientWidth + 1 || getComputedStyle(one).textOverflow === 'ellipsis').length"
        assert page.eval_on_selector_all(".command code", cut) == 0


@pytest.mark.slow
@pytest.mark.parametrize("width", [360, 900, 1400])
def test_the_machine_is_drawn_as_in_the_viewer_and_moves_with_the_time(browser, tmp_path, width) -> None:
    signals = Signals(TIME, {"axis.position": 0.01 * TIME})
    members, kinds = {"axis": "Servomotor"}, {"axis.position": RecordedSignal("axis.position", "output")}
    film = machine_film(system_views(RecordedSystem(members, kinds)), signals, 100_000)
    films = [{"name": f"{variant}, seed 1", **film} for variant in ("PI", "PI+FF")]
    written(tmp_path, scenes=ReportScenes(films, []))
    page, wrong = browser.new_page(viewport={"width": width, "height": 800}), []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(f"file://{tmp_path}/report.html")
    if width <= 900:  # it would cover the first plot
        assert page.locator("details.stage").get_attribute("open") is None
        page.locator("details.stage > summary").click()
    page.locator(".machine svg:visible .on").scroll_into_view_if_needed()
    assert page.locator(".machine svg:visible").count() == 1
    assert not page.locator(".player .fit").is_visible()
    page.locator(".player .time").fill("1499")
    page.wait_for_function("document.querySelector('.machine .on').textContent === '50.0 mm'")
    page.locator(".player .film").select_option("1")
    assert page.locator(".machine svg:visible .on").text_content() == "50.0 mm"
    stage = page.locator("details.stage").bounding_box()
    assert stage["height"] < 300
    assert page.evaluate("document.documentElement.scrollWidth") == width
    letters = page.locator(".machine svg:visible text").evaluate_all(
        "(all) => all.filter((one) => one.textContent && getComputedStyle(one).display !== 'none').map((one) => one.getBoundingClientRect().height)"
    )
    assert min(letters) >= 8.0
    assert wrong == []
    page.close()


@pytest.mark.slow
def test_the_scene_plays_and_a_failure_leads_to_its_case_and_time(browser, tmp_path) -> None:
    """The drawing of a carriage has an element of the class `speed`, as the player has. The time is that of the drawing.

    The case is the worst one, with its time, until the pointer is over the pane of another variant.
    """
    limit = Expectation("low", signal=FORCE, at_least=0.16)
    lowest = {seed: tables()["PI", seed].values["a.force"] for seed in (1, 2)}
    seed = min(lowest, key=lambda each: lowest[each].min())
    first = round(float(TIME[np.argmin(lowest[seed])]), 9)
    members, kinds = {"axis": "Servomotor"}, {"axis.position": RecordedSignal("axis.position", "output")}
    signals, views = Signals(TIME, {"axis.position": 0.01 * TIME}), system_views(RecordedSystem(members, kinds))
    cases = [("PI+FF", 1), ("PI", seed)]
    films = [
        {"name": f"{case}", "case": case, **machine_film(views, signals, 11, [first] if case[0] == "PI" else [])}
        for case in cases
    ]
    assert first > 0.2
    assert first in films[1]["time"]
    assert [len(film["time"]) for film in films] == [11, 12]
    written(tmp_path, limit=limit, scenes=ReportScenes(films, []))
    page, wrong = browser.new_page(viewport={"width": 1400, "height": 900}), []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(f"file://{tmp_path}/report.html")
    now, film = page.locator(".player .now"), page.locator(".player .film")
    page.wait_for_function(f"document.querySelector('.player .now').textContent === '{first:.3f} s'")
    assert film.input_value() == "1"
    film.select_option("0")
    assert now.inner_text() == f"{min(films[0]['time'], key=lambda time: abs(time - first)):.3f} s"  # the nearest one
    page.locator(".player .play").click()
    page.wait_for_function(f"parseFloat(document.querySelector('.player .now').textContent) > {first + 0.6}")
    page.locator(".failures a").click()
    assert (film.input_value(), now.inner_text()) == ("1", f"{first:.3f} s")
    assert page.locator(".player .play").inner_text() == "Play"
    x, y = page.evaluate(
        """() => { const { chart } = document.querySelector(".twin-chart"), { left, top } = chart.canvas.getBoundingClientRect(), box = chart.boxes[1];
        return [left + 200, top + box.top + 20]; }"""
    )
    page.mouse.move(x, y)
    page.wait_for_function("document.querySelector('.player .film').value === '0'")
    instant = films[0]["time"][5]  # of the scene: values, scene and cursor are of this sample
    x, y = page.evaluate(
        """(time) => { const { chart } = document.querySelector(".twin-chart"), { left, top } = chart.canvas.getBoundingClientRect(), box = chart.boxes[1];
        return [left + box.across(time) + 0.6, top + box.top + 20]; }""",
        instant,
    )
    film.select_option("1")
    page.mouse.move(x, y)
    page.mouse.move(x + 1, y)
    assert film.input_value() == "1"  # until a pane is clicked
    page.mouse.click(x, y)
    page.wait_for_function("document.querySelector('.player .film').value === '0'")
    page.wait_for_function(f"document.querySelector('.player .now').textContent === '{instant:.3f} s'")
    assert page.evaluate(f"[{CHARTS}[0].hover.at, ...{CHARTS}[0].cursors]") == [instant, instant]
    assert wrong == []
    page.close()


@pytest.mark.slow
def test_a_drawing_keeps_legible_letters_and_says_that_it_goes_on(browser, tmp_path) -> None:
    svg = picture.draw(dict.fromkeys("abcdefgh", ""), dict.fromkeys(pairwise("abcdefgh"), ()))
    written(tmp_path, structures=[((svg, "remark"), ["PI"])])
    page = browser.new_page(viewport={"width": 360, "height": 740})
    page.goto(f"file://{tmp_path}/report.html")
    page.locator("#system summary").click()
    page.wait_for_function("document.querySelector('.drawing').matches('.cut')")
    shown, full = page.locator(".drawing > svg").evaluate("(svg) => [svg.clientWidth, svg.viewBox.baseVal.width]")
    assert shown >= 0.74 * full
    page.close()
