"""The end of a scenario in the console: it pauses, is judged, and the next run is compared with it."""

import json
import time
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("nicegui")

from twin.console.curves import PREVIOUS
from twin.console.session import Host, RunMetrics
from twin.console.summary import session_result
from twin.console.verdicts import Row, SessionVerdicts, headline
from twin.errors import TwinError
from twin.live import LiveSession
from twin.run import score

TEXT = """
stop_time: 0.5 s
members:
  heart: {component: heart, parameters: {rate: 1 Hz}}
variants:
  slow: {title: at rest}
  fast: {members: {heart: {parameters: {rate: 2 Hz}}}}
console:
  parameters: {heart.rate: [40 /min, 120 /min], heart.scale: []}
  targets: {signal: heart.position, tolerance: 0.2 mm, points: {systole: 1.4 mm, never: 1 m}}
  warnings: [{signal: heart.position, above: 2 mm, text: far out}]
record: {every: 5 ms}
metrics:
  reach: {signal: heart.position, reduce: peak_to_peak, unit: mm}
  late: {signal: heart.position, reduce: max, from: 0.4 s, unit: mm}
expect:
  - {name: small, signal: heart.position, within: [-20 mm, 20 mm]}
  - {name: never, signal: heart.position, at_most: -1 m}
  - {name: other, metric: reach, at_least: 0 mm, variants: [fast]}
"""


def until(condition):
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture
def host(tmp_path, build):
    path = tmp_path / "beat.yaml"
    path.write_text(TEXT)
    one = Host(runs=tmp_path / "runs", build=build, rate=10.0)
    one.begin(path)
    one.live.wait()
    yield one
    one.close()


@pytest.mark.slow
def test_a_scenario_pauses_at_its_end_and_the_next_run_is_compared(host):
    catalog = host.catalog
    assert (dict(catalog.variants), catalog.stop) == ({"slow": "at rest", "fast": "fast"}, 0.5)
    assert catalog.parameters == {"heart.rate": (pytest.approx(2 / 3), 2.0), "heart.scale": None}
    assert catalog.targets == {
        "signal": "heart.position",
        "tolerance": 2e-4,
        "points": {"systole": [1.4e-3], "never": [1.0]},
    }
    assert catalog.warnings == ({"signal": "heart.position", "above": 2e-3, "text": "far out", "below": -2e-3},)
    assert (host.stop_label, host.source.previous_run) == ("End", None)
    host.resume()
    until(lambda: host.live.state.phase == "paused" and host.live.state.time > 0)
    assert host.live.state.time == 0.5
    until(lambda: host.source.span() == (0.0, 0.5))  # rows follow their step
    rows = SessionVerdicts(host.scenario, host.live).rows()
    assert [(row.verdict, row.name) for row in rows] == [
        ("pass", "small"),
        ("fail", "never"),
        ("", "reach"),
        ("", "late"),
    ]
    assert headline(rows, True) == "1 failed · 1 passed"
    samples = host.live.read(["heart.position"])
    assert list(score(samples.time, samples.values["heart.position"], catalog.targets, 0.0).reached) == ["systole"]
    seen = host.source.read("heart.position", 0.0, 0.5, 4000)[1]
    host.live.reset()
    assert host.source.previous_run.read("heart.position", 0.0, 0.5, 4000)[1].tolist() == seen.tolist()
    host.resume()
    until(lambda: host.source.span() == (0.0, 0.5))  # as the charts read it
    host.restart("fast")
    host.live.wait()
    assert host.catalog.variant == "fast"
    name = host.source.previous("heart.position")
    assert name == f"{PREVIOUS}heart.position"
    assert host.source.read(name, 0.0, 0.5, 4000)[1].tolist() == seen.tolist()
    host.resume()  # beyond the end: the operator decides
    until(lambda: host.live.state.time == 0.5)
    host.resume()
    until(lambda: host.live.state.time > 0.6)
    host.close()
    summary = json.loads((Path(host.live.state.folder) / "summary.json").read_text())
    result = session_result(host.live, None)
    report = (Path(host.live.state.folder) / "report.html").read_text()
    operation = summary["operation"]  # card, summary and report have one verdict
    assert (summary["status"], summary["passed"]) == ("completed", False)
    assert (
        (result.kind, result.score)
        == ("failed", operation["targets"]["detail"])
        == (operation["verdict"], result.score)
    )
    assert (list(operation["targets"]["reached"]), operation["targets"]["missed"]) == (["systole"], ["never"])
    assert operation["text"] in report.partition("</header>")[0]
    assert [each["name"] for each in summary["expectations"] if each["verdict"] == "fail"] == [
        "never",
        "All 2 targets reached",
        "No warning: far out",
    ]


def test_with_drives_a_session_is_stopped_by_its_operator(tmp_path):
    host = Host(hardware=tmp_path / "bench.yaml")
    assert host.stop_label == "STOP"
    host.live = LiveSession.__new__(LiveSession)
    host.live.state = type("State", (), {"phase": "running"})()
    host.live.catalog = type("Catalog", (), {"controls": ("hand",)})()
    for phase, label in (("running", "STOP"), ("finishing", "")):  # without drives nothing moves any more
        host.live.state.phase = phase
        assert (host.stop_label, Host(live=host.live).stop_label) == ("STOP", label)
    with pytest.raises(TwinError, match="Stop it first"):
        host.restart(None)


def test_headlines():
    assert headline([Row("", "b", "")], True) == ""
    assert headline([Row("waiting", "a", ""), Row("pass", "b", "")], False) == "So far 1 met, 0 failed, 1 open."
    assert headline([Row("pass", "a", "")], False) == "So far 1 met, 0 failed."
    assert headline([Row("pass", "a", "")], True) == "1 of 1 requirements met"
    paper = Row("pass", "c", "3 mN", True)  # a metric with a tolerance is a requirement, as in report and terminal
    assert headline([Row("pass", "a", ""), paper], True) == "2 of 2 requirements met"
    far = Row("fail", "d", "9 mN", True)
    assert headline([Row("pass", "a", ""), far], True) == "1 failed · 1 passed"


def test_metrics_of_the_run_before_stand_beside_those_of_this_one():
    host = Host()
    assert host.metrics_before("first").values == {}
    host.latest_metrics = RunMetrics("first", {"error": 3e-3}, "PI, 10:15")
    assert host.metrics_before("first").values == {}  # another page of the same run
    assert host.metrics_before("second") == RunMetrics("first", {"error": 3e-3}, "PI, 10:15")
    assert host.metrics_before("third").values == {"error": 3e-3}  # the second had none yet
    host.leave()
    assert host.metrics_before("fourth").values == {}


def test_metrics_of_another_scenario_or_file_are_not_those_before(tmp_path):
    host = Host()
    for text, other in (("a", "a"), ("a", "b"), ("b", "c")):
        host.scenario = tmp_path / text
        host.scenario.write_text(text)
        host.metrics_before(object())
        host.latest_metrics = replace(host.latest_metrics, values={"error": 3e-3})
        (tmp_path / text).write_text(other)
        assert host.metrics_before(object()).values == ({"error": 3e-3} if text == other else {})
    host.latest_metrics = replace(host.latest_metrics, values={"error": 3e-3})
    host.scenario = tmp_path / "a"
    assert host.metrics_before(object()).values == {}


@pytest.mark.slow
def test_one_fmu_alone(tmp_path, build):
    from twin.component import catalog
    from twin.fmi import exporter
    from twin.scenario.fmu_reader import plots

    assert plots("m", {}) == []
    file = Path(exporter.export(catalog.component("heart"), "3.0", tmp_path / "heart.fmu", build))
    host = Host(runs=tmp_path / "runs", build=build)
    host.begin(file)
    host.live.wait()
    try:
        assert host.catalog.title == "heart.fmu alone"
        assert {"heart.position"} <= {name for _, _, names in host.catalog.plots for name in names}
    finally:
        host.close()
