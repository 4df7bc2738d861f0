"""Tables and sentences about a run: events, conditions, parameters, step refinement, variants, curves of its page."""

from __future__ import annotations

import base64
import zlib
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.every_case import every_case
from twin.coupling import Growth
from twin.results import (
    Evaluation,
    EventLine,
    Expectation,
    ExpectationResult,
    Metric,
    Plot,
    PlotCurve,
    Signals,
    Window,
    evaluate,
    find_violations,
)
from twin.results.evaluation import expression
from twin.results.evaluation.metrics import MetricResult
from twin.run import parameter_table, report, report_curves, report_plots
from twin.run.conditions import add_occurrences, condition_notes, occurrences
from twin.run.coupling_report import component_names, is_growing
from twin.run.event_table import EventRow, event_rows
from twin.run.step_refinement import StepRefinement, summarize_refinements
from twin.run.variant_matrix import MatrixCell, MatrixRow, build_matrix
from twin.structure.profile import Cost, CostProfile, profiled
from twin.web import PackedArrays

S = 10**9
FORCE = expression.parse("a.force")


def case(variant: str, seed: int = 1, **more: Any) -> Any:
    return SimpleNamespace(variant=variant, seed=seed, **{"events": (), "faults": (), "conditions": (), **more})


def at(time: int, text: str) -> Any:
    return SimpleNamespace(time_ns=time, text=text)


def test_events_of_all_variants_in_order_of_time() -> None:
    both, late = at(2 * S, "set a.k = 1"), at(3 * S, "set a.k = 2")
    cases = [
        case("PI", 1, events=[both, late], faults=[at(1 * S, "short")]),
        case("PI", 2, events=[both, late], faults=[at(1 * S, "short")]),
        case("FF", 1, events=[both]),
    ]
    met = [
        {"variant": variant, "seed": seed, "time": time, "event": "stop (when a.x > 1)", "label": label}
        for variant, seed, time, label in (("PI", 5, 2.5, "far"), ("PI", 6, 0.5, "far"), ("PI", 5, 4.0, "far"))
    ]
    assert event_rows(cases, met) == [
        EventRow(1 * S, "fault short", "PI", ("PI",)),
        EventRow(2 * S, "set a.k = 1"),
        EventRow(2_500_000_000, "stop (when a.x > 1)", "PI", ("PI",), "far"),
        EventRow(3 * S, "set a.k = 2", "PI", ("PI",)),
        EventRow(4 * S, "stop (when a.x > 1)", "PI", ("PI",), "far"),
    ]
    assert EventRow(2_500_000_000, "stop", "PI", ("PI",), "far").annotation == EventLine(2.5, "far", ("PI",))
    assert EventRow(1500, "stop").annotation == EventLine(1.5e-6, "stop")
    assert EventRow(1_500_000, "stop").time == "1.5 ms"
    assert event_rows([]) == []


def condition(text: str, description: str = "") -> Any:
    return SimpleNamespace(condition=SimpleNamespace(text=text), text=f"stop (when {text})", description=description)


def test_when_conditions_were_met() -> None:
    specs = (condition("a.x > 1"), condition("a.x > 2"))
    cases = [case("PI", 1, conditions=specs), case("PI", 2, conditions=specs), case("FF", 1, conditions=specs[:1])]
    met = [{"variant": "PI", "seed": 1, "when": "a.x > 1", "time": 0.5 * (k + 1)} for k in range(6)]
    met.append({"variant": "FF", "seed": 1, "when": "a.x > 1", "time": 0.25})
    texts = [f"{time} (seed 1)" for time in ("500 ms", "1 s", "1.5 s", "2 s", "2.5 s")]
    assert condition_notes(cases, met) == [
        f"PI: condition `a.x > 1` was met at {', '.join(texts)} and 1 more time, never with seed 2",
        "PI: condition `a.x > 2` was never met",
        "FF: condition `a.x > 1` was met at 250 ms",
    ]
    more = [{**met[0], "time": 3.5}]
    assert condition_notes(cases, met + more)[0].endswith(f"{texts[4]} and 2 more times, never with seed 2")
    assert condition_notes(cases[2:], met[:5]) == ["FF: condition `a.x > 1` was never met"]
    assert condition_notes(cases[:1], met[:5])[0] == "PI: condition `a.x > 1` was met at 500 ms, 1 s, 1.5 s, 2 s, 2.5 s"


def test_occurrences_in_the_summary() -> None:
    own = case("PI", 3, conditions=(condition("a.x > 1", "far"), condition("a.y > 1")))
    met = [(S * k, 0) for k in range(1001)] + [(5, 1)]
    found = occurrences(own, SimpleNamespace(conditions=SimpleNamespace(met=met)))  # type: ignore[arg-type]
    assert len(found) == 1001
    common = {"variant": "PI", "seed": 3}
    assert found[999] == common | {"time": 999.0, "when": "a.x > 1", "event": "stop (when a.x > 1)", "label": "far"}
    assert found[1000] == common | {"time": 5e-9, "when": "a.y > 1", "event": "stop (when a.y > 1)", "label": "a.y > 1"}
    info = SimpleNamespace(extra={"other": 1})
    for added in ([], found[:2], found[2:3]):
        add_occurrences(info, added)  # type: ignore[arg-type]
    assert info.extra == {"other": 1, "conditions": found[:3]}


@every_case(
    ("value", "unit", "display", "text"),
    [
        (None, "m", "m", ""),
        (0.25, "m", "m", "0.25"),
        (0.25, "m", "mm", "250"),
        (2, "", "", "2"),
        (True, "", "", "true"),
        ("file.csv", "", "", "file.csv"),
        (310.15, "K", "degC", "37"),
        (37.0, "degC", "K", "310.15"),
        (1 / 3, "m", "m", "0.333333"),
        (10.0, "rad/s", "deg/s", "573"),
        (0.0123456, "rad", "deg", "0.7074"),
        (123456.0, "m", "km", "123.5"),
        (1234560.0, "Pa", "hPa", "12345.6"),
        (0.03625, "N", "mN", "36.25"),
        ([0.001, 0.002], "m", "mm", "[1, 2]"),
        (list(range(6)), "", "", "[0, 1, 2, 3, 4, 5]"),
        (list(range(7)), "", "", "[0, 1, 2, … 6] (7)"),
        ([[1.5, 2.0], [3.0, 4.0]], "", "", "[1.5, 2, 3, 4]"),
    ],
)
def test_parameters_in_their_display_unit(value: object, unit: str, display: str, text: str) -> None:
    assert parameter_table.format_parameter(value, unit, display) == text


def test_small_parameters_have_a_small_unit() -> None:
    assert parameter_table.unit_for_size(1e-4, "m") == "mm"
    assert parameter_table.unit_for_size([0.0, 0.02], "s") == "ms"
    assert parameter_table.unit_for_size(0.5, "m") == "m"
    assert parameter_table.unit_for_size(1e-4, "kg") == "kg"
    assert parameter_table.unit_for_size("file.csv", "m") == "m"
    assert parameter_table.unit_for_size(None, "m") == "m"


def refinement(value: float | None, half: float | None, scale: float = 0.0, unit: str = "mN") -> StepRefinement:
    result = MetricResult(Metric("error", FORCE, "max", unit=unit), "PI", {1: value}, None, scale=scale)
    return StepRefinement("PI", 1, 500_000, result, value, half)


@every_case(
    ("row", "difference", "part", "texts"),
    [
        (refinement(0.25, 0.2), -0.05, 0.25, ("250 mN", "200 mN", "-50 mN", "25 %")),
        (refinement(0.2, 0.25), 0.05, 0.2, ("200 mN", "250 mN", "+50 mN", "20 %")),
        (refinement(0.1, -0.2), -0.3, 1.5, ("100 mN", "-200 mN", "-3e+02 mN", "1.5e+02 %")),
        (refinement(0.03, 0.01, 4.0), -0.02, 0.5, ("30 mN", "10 mN", "-20 mN", "50 %")),
        (refinement(0.03, 0.0, 3.0), -0.03, 1.0, ("30 mN", "0 mN", "-30 mN", "1e+02 %")),
        (refinement(0.0, 0.0), 0.0, None, ("0 mN", "0 mN", "+0 mN", "-")),
        (refinement(None, 0.2), None, None, ("-", "200 mN", "-", "-")),
        (refinement(0.2, None), None, None, ("200 mN", "-", "-", "-")),
        (refinement(2.0, 3.0, unit=""), 1.0, 1 / 3, ("2", "3", "+1", "33 %")),
    ],
)
def test_step_refinement(
    row: StepRefinement, difference: float | None, part: float | None, texts: tuple[str, ...]
) -> None:
    assert row.difference == (None if difference is None else pytest.approx(difference, abs=1e-15))
    assert row.part == (None if part is None else pytest.approx(part))
    keys = ("value", "half", "difference", "part")
    assert row.table_cells == {"variant": "PI", "metric": "error", **dict(zip(keys, texts, strict=True))}
    common = {"variant": "PI", "seed": 1, "metric": "error", "step": 0.0005}
    assert row.to_dict() == common | {"value": row.value, "half": row.half, "difference": row.difference}


def test_the_largest_change_by_half_the_step() -> None:
    rows = [refinement(0.1, 0.11), refinement(0.1, 0.2), refinement(None, 1.0), refinement(0.0, 0.0)]
    assert summarize_refinements(rows) == "half the step changes metrics by at most 50 % (error, PI)"
    assert summarize_refinements(rows[2:]) == "half the step: no metric to compare"
    assert summarize_refinements([refinement(1.0, float("inf"))]) == "half the step: no metric to compare"


def two_variants() -> tuple[Evaluation, list[Any]]:
    time = np.arange(3.0)
    tables = {
        (name, 1): Signals(time, {"a.force": force * np.ones(3)}, {"a.force": "N"})
        for name, force in (("PI", 0.03), ("FF", 0.06))
    }
    metrics = {
        "mean": Metric("mean", FORCE, "mean", unit="mN", description="mean force"),
        "last": Metric("last", FORCE, "final", Window(1 * S, None), "mN", {"FF": 0.05}, 0.1, ("FF",)),
    }
    limit = Expectation("small", "mean", at_most=0.04, unit="N")
    evaluation = evaluate(metrics, [limit], tables)
    return evaluation, find_violations([limit], evaluation, tables)


def test_a_matrix_has_failures_first_but_columns_of_variants_have_their_order() -> None:
    evaluation, violations = two_variants()
    assert [row.variant for row in build_matrix(evaluation, violations, ["FF", "PI"]).rows] == ["FF", "PI"]
    found = build_matrix(evaluation, violations, ["PI", "FF"])
    assert found.is_wide
    assert [row.variant for row in found.rows] == ["PI", "FF"]
    mean = replace(
        evaluation, metric_results=tuple(one for one in evaluation.metric_results if one.metric.name == "mean")
    )
    found = build_matrix(mean, violations, ["PI", "FF"])
    assert not found.is_wide
    assert [row.variant for row in found.rows] == ["FF", "PI"]
    found = build_matrix(evaluation, violations, ["FF", "PI"])
    assert found.columns == (
        ("last", "mN", "", "final of a.force, from 1 s"),
        ("mean", "mN", "mean force", "mean of a.force"),
    )
    assert found.rows == (
        MatrixRow(
            "FF",
            (MatrixCell("60", ("paper 50 ± 10 %", "ratio 1.20 ✗"), 60.0, "fail"), MatrixCell("60", (), 60.0, "fail")),
            ("small", "last"),
        ),
        MatrixRow("PI", (MatrixCell(), MatrixCell("30", (), 30.0, "info")), ()),
    )
    assert not found.is_large
    assert type(found)((), found.rows * 3).is_large
    assert type(found)((), (found.rows * 3)[:5]).is_large
    assert not type(found)((), (found.rows * 3)[:4]).is_large


def test_a_code_has_its_name_and_the_worst_seed_is_below_the_mean() -> None:
    metrics = {
        "state": Metric("state", FORCE, "final", codes={8: "done"}),
        "mean": Metric("mean", expression.parse("2 * a.force"), "mean", unit="N"),
    }
    values = {seed: np.array([1.0, last]) for seed, last in ((1, 8.0), (2, 8.0), (3, 8.5))}
    tables = {("PI", seed): Signals(np.arange(2.0), {"a.force": y}, {"a.force": "N"}) for seed, y in values.items()}
    evaluation = evaluate(metrics, [], {case: tables[case] for case in list(tables)[:2]})
    found = build_matrix(evaluation, [])
    assert ([cell.text for cell in found.rows[0].cells], found.is_wide) == (["8 done", "9"], True)
    assert report.metric_rows(evaluation.metric_results)[0]["mean"] == "8 done"
    (row,) = build_matrix(evaluate(metrics, [], tables), []).rows
    assert [cell.notes for cell in row.cells] == [("seeds 8.000 to 8.500",), ("seeds 9.000 to 9.500",)]  # no worst one


def test_values_say_that_they_leave_a_band_and_that_their_window_has_a_fault() -> None:
    time = np.arange(4.0)
    tables = {(name, 1): Signals(time, {"a.force": 0.09 * (time + 1)}, {"a.force": "N"}) for name in ("PI", "FF")}
    metrics = {
        reduce: Metric(reduce, FORCE, reduce, Window(0, 3 * S), unit="N") for reduce in ("min", "max", "mean")
    } | {"all": Metric("all", FORCE, "mean", unit="N")}
    plot = Plot("", (PlotCurve(FORCE, ""),), unit="N", band=(0.1, 0.4))
    events = [
        EventLine(1.0, "a", ("PI",)),
        EventLine(2.0, "b", ("PI",)),
        EventLine(2.0, "c"),
        EventLine(9.0, "d", ("PI",)),
    ]
    rows = build_matrix(evaluate(metrics, [], tables), [], ["PI", "FF"], [plot], events).rows
    outside = "outside of 0.1 N to 0.4 N, not judged"
    assert [[cell.notes for cell in row.cells] for row in rows] == [
        [("with events 1-2", outside), ("with events 1-2",), ("with events 1-2",), ()],
        [(outside,), (), (), ()],
    ]
    limit = Expectation("safe", signal=FORCE, at_least=0.1, unit="N")
    evaluation = evaluate(metrics, [limit], tables)
    rows = build_matrix(evaluation, find_violations([limit], evaluation, tables), ["FF"], [plot]).rows
    assert not rows[0].cells[0].notes  # the requirement fails


def test_a_matrix_has_metrics_with_a_reference_before_others() -> None:
    metrics = {name: Metric(name, FORCE, "mean", paper={"PI": 1.0} if name == "b" else {}) for name in "abc"}
    tables = {("PI", 1): Signals(np.arange(2.0), {"a.force": np.ones(2)}, {"a.force": "N"})}
    found = build_matrix(evaluate(metrics, [], tables), [])
    assert [name for name, *_ in found.columns] == ["b", "a", "c"]


def values_that_are(text: str) -> dict[tuple[str, int], Signals]:
    values = {"a.force": np.full(2, float(text))}
    return {(variant, 1): Signals(np.arange(2.0), values, {"a.force": "N"}) for variant in ("PI", "FF")}


def test_lines_of_failures() -> None:
    evaluation, _ = two_variants()
    assert [(one.name, one.detail, one.more) for one in report.list_failures(evaluation)] == [
        ("small", "mean 60 mN in 0 s to 2 s in FF, expected at most 40 mN.", "Judged: mean."),
        ("last, FF", "60 mN, expected the paper's 50 mN ± 10 %.", ""),
    ]
    nothing = evaluate({"m": Metric("m", FORCE, "mean", paper={"PI": 1.0, "FF": 1.0})}, [], values_that_are("nan"))
    assert [(one.name, one.detail) for one in report.list_failures(nothing)] == [
        ("m, PI and FF", "no value, expected the paper's 1 -.")
    ]
    rows = {row["metric"] + row["variant"]: row for row in report.metric_rows(evaluation.metric_results)}
    assert rows["lastFF"] == {
        "metric": "last",
        "variant": "FF",
        "verdict": "fail",
        "paper": "50 mN",
        "mean": "60 mN",
        "worst": "-",
        "ratio": "1.20",
        "tolerance": "± 10 %",
        "description": "",
        "definition": "final of a.force, from 1 s",
    }
    assert [rows["meanPI"][key] for key in ("ratio", "tolerance", "paper", "mean")] == ["-", "-", "-", "30 mN"]
    for name, detail, own in (("mean at most 1", "mean: was 0", False), ("safe", "mean was 0", True)):
        assert report.has_own_name(ExpectationResult(name, "pass", detail)) is own


@every_case(
    ("rate", "model_rate", "grows"),
    [
        (-1.0, 0.0, False),
        (0.0004, 0.0, False),
        (0.0006, 0.0, True),
        (1.0, 0.5, False),
        (1.002, 0.5, True),
        (0.1, -9.0, True),
    ],
)
def test_growth_by_the_coupling(rate: float, model_rate: float, grows: bool) -> None:
    """Over a cycle of 0.2 s, more than twice that of the model and rounding (1e-4)."""
    coupled, model = (Growth(float(np.exp(0.2 * each)), 0.2, ()) for each in (rate, model_rate))
    assert is_growing(coupled, model, 1.0) is grows


@every_case(
    ("model_cycle", "model_rate", "duration", "grows"),
    [(0.1, 0.0, 1700.0, False), (0.1, 0.0, 1800.0, True), (0.1, 0.0003, 1800.0, False), (0.2, 0.0, 1800.0, False)],
)
def test_slow_growth_that_doubles_a_deviation_within_the_run(
    model_cycle: float, model_rate: float, duration: float, grows: bool
) -> None:
    """0.0004 / s is below the limit of a cycle; in 1733 s it is a factor of two. Nothing is known without finer steps."""
    coupled, model = (
        Growth(float(np.exp(0.2 * 0.0004)), 0.2, ()),
        Growth(float(np.exp(model_cycle * model_rate)), model_cycle, ()),
    )
    assert is_growing(coupled, model, duration) is grows


def test_names_of_components_without_folders() -> None:
    components = {"a": "heart", "b": "rigs/rig.yaml#rig@fast", "c": "x/y.fmu"}
    members = {name: SimpleNamespace(component=text) for name, text in components.items()}
    assert component_names(SimpleNamespace(members=members)) == {"a": "heart", "b": "rig.yaml#rig@fast", "c": "y.fmu"}  # type: ignore[arg-type]


def test_costs_of_members() -> None:
    """100 of 1000 ticks were sampled; a tick takes 10 us, of which three readings of the clock take 0.1 us each."""
    watch = SimpleNamespace(
        kinds=["steps", "copies", "steps"],
        members=[0, 0, 1],
        done=np.array([100, 100, 20]),
        per_tick=lambda: np.array([2e-6, 1e-6, 4e-6]),
        overhead=1e-7,
        ticks=1000,
        wall=0.01,
        sampled=100,
    )
    found = profiled(watch, SimpleNamespace(members={"fast": 0, "slow": 0}), {"fast": "heart"}, 1e-3)  # type: ignore[arg-type]
    total = 1e-5 - 5e-7
    rows = [
        Cost("slow", "", 2e-5, 4e-6, 4e-6 / total),
        Cost("fast", "heart", 2e-6, 3e-6, 3e-6 / total),
        Cost("loop and recording", "", 0.0, total - 7e-6, 1 - 7e-6 / total),
        Cost("connections", "values copied and converted", 0.0, 1e-6, 1e-6 / total),
    ]
    assert [(cost.name, cost.what) for cost in found.costs] == [(cost.name, cost.what) for cost in rows]
    for cost, expected in zip(found.costs, rows, strict=True):
        numbers = (expected.step, expected.per_tick, expected.share)
        assert (cost.step, cost.per_tick, cost.share) == pytest.approx(numbers, rel=1e-9, abs=1e-15)
    assert found.per_tick == pytest.approx(total)
    assert (found.step, found.sampled_steps) == (1e-3, 100)
    assert found.real_time_factor == pytest.approx(1e-3 / total)
    assert CostProfile((), 2.0, 1.0, 0.0, 0).real_time_factor == 0.5


def test_the_range_of_seeds_contains_them_at_each_sample_shown() -> None:
    """Also between the samples that are left of steep curves: all are read at the same times."""
    time = np.linspace(0.0, 10.0, 20_001)
    values = [np.sin(9.0 * time) + offset * np.cos(40.0 * time) for offset in (0.0, 0.01, -0.02)]
    found = report_curves.seed_range(time, [(time, y) for y in values])
    samples = report_curves.extreme_samples([values[0], found["low"], found["high"]], 400)
    assert len(samples) <= 400
    assert (samples[0], samples[-1]) == (0, 20_000)
    low, line, high = (np.interp(time, time[samples], y[samples]) for y in (found["low"], values[0], found["high"]))
    assert np.all((low <= line) & (line <= high))
    assert np.max(high[samples] - low[samples]) <= 0.0301  # no wider than the seeds are at one time
    assert (line.min(), line.max()) == (values[0].min(), values[0].max())  # no peak is lost
    shorter = report_curves.seed_range(
        np.arange(6.0), [(np.arange(6.0), np.zeros(6)), (np.array([0.0, 5.0]), np.array([3.0, 0.5]))]
    )
    assert shorter["high"].tolist() == [3.0, 2.5, 2.0, 1.5, 1.0, 0.5]
    gaps = np.where(np.arange(1_000) % 10 == 0, np.nan, 1.0)
    assert np.isfinite(gaps[report_curves.extreme_samples([gaps], 100)[1:-1]]).all()
    assert report_curves.extreme_samples([gaps[:5]], 100).tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("span", [65536.0, 1e-3, 7.0])
def test_values_of_a_page_are_multiples_of_a_power_of_two(span: float) -> None:
    found = report_curves.quantize(np.array([0.0, 0.3, 1.0, np.inf]) * span)
    step = 2.0 ** np.floor(np.log2(span / 65536))
    assert (found[:3] / step == np.rint(found[:3] / step)).all()
    assert found[1] == pytest.approx(0.3 * span, abs=step / 2)
    assert found[3] == np.inf
    assert report_curves.quantize(np.array([])).tolist() == []


def test_events_of_the_variants_of_a_plot() -> None:
    tables = {("PI", 1): Signals(np.arange(2.0), {}), ("FF", 1): Signals(np.arange(3.0), {})}
    events = [EventLine(1.0, "set a.k = 1"), EventLine(1.0, "set b.k = 1"), EventLine(2.0, "stop", ("FF",))]
    events.append(EventLine(1.5, "after its end", ("PI",)))
    curves = (PlotCurve(expression.parse("a.k"), "k"),)
    both = {"at": 1.0, "text": "1-2", "variants": []}
    numbered = report_plots.events_in_plot(Plot("", curves, variants=("PI",)), tables, events)
    assert report_curves.event_marks(numbered) == [both]
    numbered = report_plots.events_in_plot(Plot("", curves), tables, events)
    assert report_curves.event_marks(numbered) == [both, {"at": 2.0, "text": "3", "variants": ["FF"]}]
    late = report_plots.events_in_plot(Plot("", curves, window=Window(int(2.5 * S), None)), tables, events)
    assert list(late) == [3]  # of one variant: it stays so in a plot that begins after it


def test_panes_of_a_plot() -> None:
    time = np.arange(5.0)
    tables = {
        (f"v{k}", seed): Signals(time, {"a.force": k + np.array([0.0, 0, 3, 0, seed])}, {"a.force": "N"})
        for k in range(9)
        for seed in (1, 2)
    }
    limit = Expectation("", signal=FORCE, at_most=4.0, unit="N", window=Window(1 * S, None), variants=("v1", "v2"))
    curves = (PlotCurve(FORCE, "force"),)

    def charts(count: int, **options: Any) -> tuple[Any, PackedArrays]:
        names = tuple(f"v{k}" for k in range(count))
        plot = Plot("Force", curves, unit="mN", per_variant=True, variants=names, **options)
        arrays = PackedArrays()
        violations = find_violations([limit], evaluate({}, [limit], tables), tables)
        return report_curves.plot_charts(plot, tables, violations, arrays, 400), arrays

    (panes,), _ = charts(3, band=(0.5, 1.0), lines=(2.0,))
    assert [pane["title"] for pane in panes] == ["v0, seed 1", "v1, seed 1", "v2, seed 1"]
    assert [pane["case"] for pane in panes] == [("v0", 1), ("v1", 1), ("v2", 1)]
    assert [pane["unit"] for pane in panes] == ["mN"] * 3
    assert panes[0]["lines"] == [2000.0]
    assert [(pane["extent"], pane["shared"]) for pane in panes] == [([0.0, 5000.0], [4000.0])] * 3  # of all variants
    assert "extent" not in charts(3)[0][0][0]
    assert [pane["spans"] for pane in panes] == [[], [], [{"from": 2.0, "to": 2.0}]]
    assert [pane["limits"][2:] for pane in panes[::2]] == [[], [{"y": 4000.0, "from": 1.0, "to": 4.0, "failed": True}]]
    assert panes[0]["limits"] == [{"y": y, "from": 0.0, "to": 4.0, "failed": False} for y in (500.0, 1000.0)]
    assert [len(chart) for chart in charts(6)[0]] == [6]
    assert [len(chart) for chart in charts(7)[0]] == [4, 3]
    assert [len(chart) for chart in charts(9)[0]] == [5, 4]
    assert charts(2, points=True)[0] == []
    (single,), _ = charts(1)
    assert single[0]["title"] == "v0, seed 1"


def test_times_of_a_page_are_those_of_the_samples() -> None:
    """180 s in steps of 10 ms were rounded to 2 ms: a cursor stood at 47.3604 s."""
    time, arrays = np.arange(18_001) / 100, PackedArrays()
    tables = {("PI", 1): Signals(time, {"a.force": np.sin(time)}, {"a.force": "N"})}
    ((pane,),) = report_curves.plot_charts(Plot("", (PlotCurve(FORCE, "force"),)), tables, [], arrays, 20_000)
    first, _, step = map(int, pane["curves"][0]["name"].split())
    counts = np.frombuffer(zlib.decompress(base64.b64decode(arrays.texts[first])))
    np.testing.assert_array_equal(counts * step / 1e9, time)
