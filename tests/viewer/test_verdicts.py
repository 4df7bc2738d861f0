"""What the scenario says of its signals: limits, where they failed, events; without its components too."""

import json
import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from tests.viewer.recorded import BEATS, FORCE, PLACE, beats, folder_of, runs
from twin.errors import TwinError
from twin.results import EventLine, MetricResult, consecutive_spans, expression, metric_formats
from twin.results.recording.run_folder import RecordedVariable, metric_to_dict
from twin.results.summary_comparison import metric_changes
from twin.viewer import left_out, select_cases, select_signals
from twin.viewer.page_data import about, compare_metrics, events, merge_repeated
from twin.viewer.runs import ViewedCurve
from twin.viewer.verdicts import Verdicts


def metrics_of(*viewed):
    """The metrics of runs, as a page has them."""
    verdicts = [Verdicts(one) for one in viewed]
    return [
        metric
        for own, compared in zip(verdicts, compare_metrics(verdicts), strict=True)
        for metric in own.metrics(compared)
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return beats(tmp_path_factory.mktemp("beats"))


@pytest.fixture(scope="module")
def opened(folder):
    return runs(folder)


@pytest.mark.slow
def test_a_signal_that_only_a_metric_judges_has_the_unit_of_the_metric(tmp_path):
    text = BEATS.replace("unit: mm/s, reference: {slow: 20 mm/s}", "unit: cm/s, reference: {slow: 2 cm/s}")
    text = text.replace("reduce: rms", "reduce: max")
    text = text.replace("metrics:\n", "metrics:\n  far: {signal: heart.position, reduce: max, unit: cm}\n")
    speed = "  - {name: slowly, metric: mean_speed, at_most: 0.1 cm/s}\n"
    opened = runs(beats(tmp_path, text.replace("expect:\n", f"expect:\n{speed}")))
    units = {signal["name"]: signal["unit"] for signal in about(opened)["signals"]}
    assert (units["heart.velocity"], units["heart.position"]) == ("cm/s", "mm")  # an expectation judges the position
    slowly, near, _ = opened.runs[0].verdicts.expectations()
    assert (slowly.high, near.high) == (pytest.approx(0.1), 4.0)
    plain, same = (opened.samples(ViewedCurve(signal, 0)) for signal in ("heart.velocity", "heart.velocity + 0"))
    raw = opened.runs[0].recording.column(("slow", 1), "heart.velocity")
    for samples in (plain, same):
        assert samples.unit == ("cm/s" if samples is plain else "mm/s")
    np.testing.assert_allclose(plain.shown(plain.y), 100.0 * raw)


@pytest.mark.slow
def test_an_expectation_is_shaded_where_its_samples_fail(opened):
    near, never = Verdicts(opened.runs[0]).expectations()
    assert (near.verdict, near.signal, near.high, near.low, near.begin) == ("fail", "heart.position", 4.0, None, 0.5)
    assert set(near.spans) == {("fast", 1), ("fast", 2)}  # the slow one is not there before it becomes small
    for case, own in near.spans.items():
        recording = opened.runs[0].recording
        time, position = recording.column(case, "time"), recording.column(case, "heart.position")
        bad = (position > 4e-3) & (time >= 0.5 - 1e-9)
        shaded = np.any([(time >= begin) & (time <= end) for begin, end in own], axis=0)
        np.testing.assert_array_equal(shaded, bad)
    assert (never.verdict, never.spans, never.low) == ("pass", None, 0.0)


def test_spans_of_very_many_failures_are_few():
    time = np.arange(100_000) / 1000.0
    found = consecutive_spans(time, np.arange(100_000) % 2 == 0)
    assert len(found) == 400
    assert (found[0][0], found[-1][1]) == (0.0, time[-2])
    assert consecutive_spans(time[:6], np.array([1, 1, 0, 0, 1, 0], bool)) == [(0.0, 0.001), (0.004, 0.004)]


def test_events_have_names_and_a_joystick_is_one(opened):
    assert events(opened.runs[0]) == [{"time": 1.0, "name": "heart.scale = 0.5", "variants": []}]
    stick = [EventLine(0.03 * i, f"set command.speed = {i}") for i in range(40)] + [
        EventLine(5.0, "set command.speed = 0")
    ]
    assert [(one["time"], one["name"]) for one in merge_repeated(stick)] == [
        (0.0, "command.speed, 40 times until 1.17 s"),
        (5.0, "command.speed = 0"),
    ]


def test_a_session_has_the_labels_of_its_controls_its_targets_and_the_limits_of_its_warnings(tmp_path):
    time = np.arange(0.0, 6.0, 0.02)
    columns = [FORCE, RecordedVariable("command.speed", unit="m/s"), RecordedVariable("command.pressed", unit="")]
    values = {FORCE.name: 0.6 * time, "command.speed": np.where(time >= 1.0, 0.04, 0.0), "command.pressed": time}
    place = folder_of(tmp_path / "run", {("by hand", 0): (time, values)}, columns)
    (place / "operated.yaml").write_text("""
stop_time: 6 s
step: 20 ms
members: {sensor: {component: sensor}}
variants: {by hand: {}}
console: {controls: [{input: command.speed, label: guidewire, range: 40 mm/s, along: {command.pressed: true}}]}
events:
  - {at: 1 s, set: {command.speed: 0.04}}
  - {at: 1 s, set: {command.pressed: true}}
  - {at: 5 s, set: {command.speed: 0.0}}
plots: [{title: Force on the wall, signals: [{signal: sensor.force, label: both}], unit: N}]
""")
    summary = json.loads((place / "summary.json").read_text())
    warning = {"text": "high", "signal": FORCE.name, "unit": "N", "limit": 2.0, "duration": 2.0}
    summary["operation"] = {"targets": {"begin": 1.0, "reached": {"arch": 3.5}, "missed": []}, "warnings": [warning]}
    names = {"All 1 targets reached": "pass", "No warning: high": "fail"}
    summary["expectations"] = [{"name": name, "verdict": own, "detail": ""} for name, own in names.items()]
    (place / "summary.json").write_text(json.dumps(summary))
    content = about(runs(place))
    assert [(one["time"], one["name"]) for one in content["events"]] == [
        (1.0, "guidewire = 40 mm/s"),
        (3.5, "arch reached"),
        (5.0, "guidewire = 0 mm/s"),
    ]
    failed, reached = content["expectations"]
    assert (reached["signal"], failed["signal"], failed["low"], failed["high"]) == ("", FORCE.name, None, 2.0)
    assert failed["spans"]["0"] == [(pytest.approx(3.34), pytest.approx(5.98))]
    summary["operation"]["warnings"] = [
        warning | {"duration": 0.0, "end": 3.0}
    ]  # of the last target: later is not judged
    (place / "summary.json").write_text(json.dumps(summary))
    assert not any(each["spans"] for each in about(runs(place))["expectations"])
    assert content["plots"][0]["first"]  # its title and labels are those of the console


def test_a_metric_has_the_digits_of_the_terminal(tmp_path):
    """The summary has 15 digits: 0.234375 N - 0.2 N is 0.034375 N there, and 34.37499999999999 mN as it was computed."""
    place = folder_of(tmp_path / "run", {("base", 0): (np.arange(2.0), {FORCE.name: np.zeros(2)})}, [FORCE])
    metric = "{signal: sensor.force, reduce: max, unit: mN}"
    (place / "scenario.yaml").write_text(f"stop_time: 1 s\nmembers: {{}}\nmetrics: {{far: {metric}}}\n")
    viewed = runs(place).runs[0]
    definition = Verdicts(viewed).scenario.metrics["far"]
    result = MetricResult(definition, "base", {0: 0.234375 - 0.2}, None)
    viewed.summary["metrics"] = {"far": {"variants": {"base": metric_to_dict(result)}}}
    (shown,) = metrics_of(viewed)
    assert metric_formats([result])["far"].number(result.mean) == shown["rows"][0]["value"] == "34.38"


def test_expectations_of_one_name_are_shaded_each_in_its_own_window(tmp_path):
    time = np.arange(11) / 10.0
    place = folder_of(tmp_path / "run", {("base", 0): (time, {FORCE.name: time})}, [FORCE])
    limits = "[{signal: sensor.force, at_most: 0.45}, {signal: sensor.force, at_most: 0.45, from: 0.8 s}]"
    (place / "scenario.yaml").write_text(f"stop_time: 1 s\nmembers: {{}}\nexpect: {limits}\n")
    summary = json.loads((place / "summary.json").read_text())
    summary["expectations"] = 2 * [{"name": "sensor.force at most 0.45", "verdict": "fail", "detail": ""}]
    (place / "summary.json").write_text(json.dumps(summary))
    whole, late = Verdicts(runs(place).runs[0]).expectations()
    assert (whole.begin, whole.spans) == (None, {("base", 0): [(0.5, 1.0)]})
    assert (late.begin, late.spans) == (0.8, {("base", 0): [(0.8, 1.0)]})


def test_curves_over_different_signals_are_in_panes_of_their_own(tmp_path):
    """A pane has one horizontal axis: the force over the first curve's signal is not the force over its own."""
    time = np.arange(10) / 10.0
    place = folder_of(tmp_path / "run", {("base", 0): (time, {FORCE.name: time, PLACE.name: time})}, [FORCE, PLACE])
    curves = "[{signal: sensor.force, x: tip.position}, {signal: tip.position, x: sensor.force}, {signal: abs(tip.position), x: sensor.force}]"
    text = f"stop_time: 1 s\nmembers: {{}}\nplots: [{{title: Loops, signals: {curves}}}]\n"
    (place / "scenario.yaml").write_text(text)
    plots = Verdicts(runs(place).runs[0]).plots()
    assert [(plot["title"], plot["signals"], plot["x"]) for plot in plots] == [
        ("Loops, over tip.position", ["sensor.force"], "tip.position"),
        ("Loops, over sensor.force", ["tip.position", "abs(tip.position)"], "sensor.force"),
    ]


def test_metrics_are_texts_beside_the_paper_s(opened, folder):
    (metric,) = metrics_of(opened.runs[0])
    figures = json.loads((folder / "summary.json").read_text())["metrics"]["mean_speed"]["variants"]
    assert (metric["signal"], metric["begin"], metric["end"], metric["unit"], metric["tolerance"]) == (
        "heart.velocity",
        0.5,
        None,
        "mm/s",
        "± 90 %",
    )
    slow, fast = metric["rows"]
    assert (slow["variant"], slow["verdict"], float(slow["reference"])) == ("slow", figures["slow"]["verdict"], 20.0)
    assert float(slow["value"]) == pytest.approx(figures["slow"]["mean"], rel=1e-3)
    assert (fast["verdict"], fast["reference"]) == ("info", None)


def test_a_metric_shows_the_range_of_its_seeds(folder, tmp_path):
    """Lowest and highest, in the decimals of the mean; nothing where all seeds agree."""
    copy = shutil.copytree(folder, tmp_path / "copy")
    summary = json.loads((copy / "summary.json").read_text())
    slow = summary["metrics"]["mean_speed"]["variants"]["slow"]
    slow |= {"values": {"1": 18.5, "2": 21.25}, "mean": 19.875}
    (copy / "summary.json").write_text(json.dumps(summary))
    (metric,) = metrics_of(runs(copy).runs[0])
    assert [row["range"] for row in metric["rows"]] == ["18.50 to 21.25", ""]


def test_about_tells_what_there_is(opened):
    told = about(opened)
    assert [(one["variant"], one["seed"], one["samples"]) for one in told["cases"]] == [
        ("slow", 1, 401),
        ("slow", 2, 401),
        ("fast", 1, 401),
        ("fast", 2, 401),
    ]
    position = next(one for one in told["signals"] if one["name"] == "heart.position")
    assert position == {
        "name": "heart.position",
        "unit": "mm",
        "about": "wall position, positive away from the instrument",
        "cases": "all",
    }
    assert told["plots"][0]["band"] == [-5.0, 4.0]
    assert set(told["expectations"][0]["spans"]) == {"2", "3"}


@pytest.mark.slow
def test_a_folder_alone_is_enough_and_stays_as_it_is(tmp_path):
    """Its component is a person's own, and gone; what a share bears is read, and nothing is written."""
    (tmp_path / "own_hearts.py").write_text("from fmus.instruments.heart.model import Heart\n")
    place = tmp_path / "made"
    place.mkdir()
    folder = shutil.copytree(beats(place), tmp_path / "share")
    text = (folder / "scenario.yaml").read_text()
    assert "component: heart" in text
    (folder / "scenario.yaml").write_text(text.replace("component: heart", "component: not_here.model:Heart"))
    before = {one: one.stat().st_mtime_ns for one in folder.rglob("*")}
    near, _ = about(runs(folder))["expectations"]
    assert (near["signal"], near["high"], len(near["spans"])) == ("heart.position", 4.0, 2)
    assert {one: one.stat().st_mtime_ns for one in folder.rglob("*")} == before
    (folder / "scenario.yaml").write_text("members: [")
    told = about(runs(folder))
    assert "events and limits are not shown" in told["runs"][0]["problem"]
    assert [one["verdict"] for one in told["expectations"]] == ["fail", "pass"]


def test_what_an_analysis_reads_is_shown_before_what_it_computes(opened):
    """A value of a window is a flat line; the signal that it judges tells why it fails."""
    verdicts = Verdicts(opened.runs[0])
    inputs = {"force": expression.parse("heart.position"), "gone": expression.parse("gone.x")}
    verdicts.scenario = SimpleNamespace(analyses=(SimpleNamespace(name="windows", inputs=inputs),))
    assert (verdicts.analyzed("windows.std"), verdicts.analyzed("heart.velocity")) == (["heart.position"], [])
    failed = SimpleNamespace(verdict="fail", signal="windows.std")
    verdicts.expectations, verdicts.plots = lambda: [failed], list
    run = SimpleNamespace(verdicts=verdicts, summary={}, variables={}, folder=opened.runs[0].folder)
    assert select_signals(SimpleNamespace(runs=[run]), ()) == ["heart.position", "windows.std"]


def test_signals_and_cases_are_chosen(opened):
    assert select_signals(opened, ("heart.p*", "abs(heart.velocity)")) == ["heart.position", "abs(heart.velocity)"]
    assert select_signals(opened, ()) == ["heart.position"]
    internal = {"a.line": RecordedVariable("a.line", shape=(9,)), "a.stream": RecordedVariable("a.stream", shape=(6,))}
    variables = {"a.x": RecordedVariable("a.x", shape=(2,)), **internal}
    some = SimpleNamespace(runs=[SimpleNamespace(variables=variables)])
    assert select_signals(some, ("a.*",)) == ["a.x[1]", "a.x[2]"]
    assert left_out(some, ("a.*",), ["a.x[1]"]) == ["a.line", "a.stream"]
    assert len(select_signals(some, ("a.line", "a.stream"))) == 15
    assert left_out(some, ("a.line",), ["a.line[1]"]) == []
    with pytest.raises(TwinError, match=r"'heart\.positio' was not recorded\. Did you mean 'heart\.position'\?"):
        select_signals(opened, ("heart.positio",))
    assert select_cases(opened, "", None) == [0, 2]
    assert select_cases(opened, "slow", None, every=True) == [0, 1]
    assert select_cases(opened, "fast", 2) == [3]
    with pytest.raises(TwinError, match=r"has no such case\. Variants: slow, fast; seeds: 1, 2\."):
        select_cases(opened, "", 7)


def test_metrics_of_two_runs_are_those_of_their_common_seeds_as_in_compare(opened, folder, tmp_path):
    """A has seeds 1, 2, 3 and B 1, 2: a difference of means over other seeds would be that of the seeds."""
    summaries = []
    for name, values in (("a", {"1": 10.0, "2": 11.0, "3": 99.0}), ("b", {"1": 10.5, "2": 12.0})):
        copy = shutil.copytree(folder, tmp_path / name)
        summary = json.loads((copy / "summary.json").read_text())
        summary["metrics"]["mean_speed"]["variants"]["slow"]["values"] = values
        (copy / "summary.json").write_text(json.dumps(summary))
        summaries.append(summary)
    first, second = metrics_of(*runs(tmp_path / "a", tmp_path / "b").runs)
    (own,) = [change for change in metric_changes(*summaries) if change.variant == "slow"]
    slow = second["rows"][0]
    assert (first["rows"][0]["value"], slow["value"], slow["change"], slow["seeds"]) == ("10.50", "11.25", "0.75", 2)
    assert float(slow["change"]) == own.change
    assert first["rows"][1]["seeds"] == 0  # both runs have the same seeds of this variant
    assert second["rows"][1]["change"] == "0.00"
    cut = summaries[1]["metrics"].pop(
        "mean_speed"
    )  # a run without the metric, of seeds 1 and 2: A's value is over these, too
    (tmp_path / "b" / "summary.json").write_text(json.dumps(summaries[1]))
    (first,) = metrics_of(*runs(tmp_path / "a", tmp_path / "b").runs)
    assert (first["rows"][0]["value"], first["rows"][0]["seeds"]) == ("10.50", 2)
    cut["variants"]["slow"]["verdict"] = "cut"
    summaries[1]["metrics"]["mean_speed"] = cut
    (tmp_path / "b" / "summary.json").write_text(json.dumps(summaries[1]))
    _, second = metrics_of(*runs(tmp_path / "a", tmp_path / "b").runs)
    assert (second["rows"][0]["verdict"], second["rows"][0]["change"]) == ("cut", "")  # of another window


def worst_window(folder):
    """A run whose force swings from 12 s on, with the failed result of an analysis of ten seconds."""
    time = np.arange(4401) * 5e-3
    force = 0.2 + 0.01 * np.sin(6.0 * time) * (time > 12.0)
    columns = [FORCE, RecordedVariable("windows.force_std", unit="N")]
    values = {FORCE.name: force, "windows.force_std": np.full(len(time), force[time > 12.0].std())}
    place = folder_of(folder, {(name, 1): (time, values) for name in ("PI", "PI+FF")}, columns)
    (place / "scenario.yaml").write_text("""
stop_time: 22 s
step: 5 ms
members: {sensor: {component: sensor}}
variants: {PI: {}, PI+FF: {}}
analyses: {windows: {function: "fmus.wall_tracking.windows:analysis", inputs: {force: sensor.force}}}
metrics: {worst: {signal: windows.force_std, reduce: max, unit: N}, mean: {signal: sensor.force, reduce: mean, unit: N}}
expect: [{name: quiet, metric: worst, at_most: 6 mN, variants: [PI]}]
""")
    summary = json.loads((place / "summary.json").read_text())
    summary["expectations"] = [{"name": "quiet", "verdict": "fail", "detail": ""}]
    means = {"mean": float(force.mean()), "worst": float(values["windows.force_std"][0])}
    summary["metrics"] = {
        name: {
            "unit": "N",
            "variants": {
                v: {"values": {"1": value}, "mean": value, "paper": None, "verdict": "info"} for v in ("PI", "PI+FF")
            },
        }
        for name, value in means.items()
    }
    (place / "summary.json").write_text(json.dumps(summary))
    return place


def test_a_failed_analysis_is_shaded_in_the_worst_window_of_its_input(tmp_path):
    told = about(runs(worst_window(tmp_path / "run")))
    (quiet,) = told["expectations"]
    assert (quiet["signal"], quiet["sources"], quiet["failed_at"]) == ("windows.force_std", ("sensor.force",), None)
    ((begin, end),) = quiet["spans"]["0"]
    assert (quiet["spans"].keys(), begin, end) == ({"0"}, pytest.approx(12.0, abs=0.02), 22.0)
    mean = next(metric for metric in told["metrics"] if metric["name"] == "mean")
    assert mean["rows"][0]["level"] == pytest.approx(0.2, abs=1e-3)
    assert told["metrics"][0]["rows"][0]["level"] is not None
