"""Requirements of a session that has not ended: when each is judged, and what may still change."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case

pytest.importorskip("nicegui")

from twin.console.verdicts import Row, SessionVerdicts, headline
from twin.scenario import lint, scenario_paths

TEXT = """
stop_time: 0.5 s
members:
  heart: {component: heart}
metrics:
  late: {signal: heart.position, reduce: max, from: 0.2 s, to: 0.4 s, unit: mm}
expect:
  - {name: always, signal: heart.position, at_most: 3 mm}
  - {name: soon, signal: heart.position, from: 0.1 s, at_most: 1 mm}
  - {name: a metric, metric: late, at_least: 2 mm}
"""


@pytest.fixture
def verdicts(tmp_path):
    """Verdicts by name for a heart that is at 2 mm from 0.3 s on, recorded until a time [s]."""
    path = tmp_path / "beat.yaml"
    path.write_text(TEXT)

    def until(end, judged_until=0.5, phase="running"):
        time = np.linspace(0.0, end, 101)
        position = np.where(time < 0.3, 0.0, 2e-3)
        catalog = SimpleNamespace(
            variant="base",
            seed=1,
            start=0.0,
            judged_until=judged_until,
            signals={"heart.position": SimpleNamespace(recorded=True, unit="m", display_unit="mm")},
        )
        samples = SimpleNamespace(time=time, values={"heart.position": position})
        state = SimpleNamespace(phase=phase, epoch=1)
        live = SimpleNamespace(catalog=catalog, changes={}, read=lambda *_: samples, state=state)
        return {row.name: row.verdict for row in SessionVerdicts(path, live).rows()}

    return until


@pytest.mark.parametrize(
    ("end", "told"),
    [
        (0.05, {"always": "pass", "soon": "waiting", "a metric": "waiting", "late": ""}),
        (0.15, {"always": "pass", "soon": "pass", "a metric": "waiting", "late": ""}),
        (0.25, {"always": "pass", "soon": "pass", "a metric": "waiting", "late": ""}),  # it may still come right
        (0.35, {"always": "pass", "soon": "fail", "a metric": "pass", "late": ""}),
        (0.5, {"always": "pass", "soon": "fail", "a metric": "pass", "late": ""}),
    ],
)
def test_what_is_told_while_a_session_runs(verdicts, end, told):
    assert verdicts(end) == told


def test_an_operator_is_judged_until_the_session_ends(verdicts):
    """With controls a session goes on after the scenario's end; what has no end of its own is open until it is over."""
    own = {"always": "pass", "soon": "fail", "a metric": "pass", "late": ""}
    assert verdicts(3.0, judged_until=np.inf) == own
    assert verdicts(3.0, judged_until=np.inf, phase="stopped") == own
    assert verdicts(0.25, judged_until=np.inf, phase="stopped")["a metric"] == "fail"  # nothing comes any more


OTHERS = """
stop_time: 0.5 s
members:
  heart: {component: heart}
variants: {base: {}, other: {}}
metrics:
  own: {signal: heart.position, reduce: max, unit: mm, variants: [base], description: its own, reference: {base: 2 mm}, tolerance: 1 %}
  foreign: {signal: heart.position, reduce: max, unit: mm, variants: [other]}
  hidden: {signal: heart.velocity, reduce: max, unit: mm/s}
  at_end: {signal: heart.position, reduce: final, unit: mm}
expect:
  - {name: here, signal: heart.position, at_most: 3 mm, variants: [base]}
  - {name: there, signal: heart.position, at_most: 3 mm, variants: [other]}
  - {name: hidden, signal: heart.velocity, at_most: 3 mm/s}
  - {name: of own, metric: own, at_most: 1 mm}
  - {name: of hidden, metric: hidden, at_most: 1 mm/s}
  - {name: unchanged, signal: heart.position, at_most: 1 mm, nominal: true}
"""


@pytest.mark.parametrize(
    ("by_operator", "verdicts"),
    [
        (False, {"here": "pass", "of own": "fail", "unchanged": "fail", "its own": "pass", "at end": ""}),
        (
            True,
            {"here": "pass", "of own": "fail", "unchanged": "not judged", "its own": "not judged", "at end": ""},
        ),  # what was changed is no reproduction
    ],
)
def test_what_can_be_judged(tmp_path, by_operator, verdicts):
    """Not what another variant, or a signal that is not recorded, would show."""
    path = tmp_path / "beat.yaml"
    path.write_text(OTHERS)
    time = np.linspace(0.0, 0.5, 6)
    signals = {
        "heart.position": SimpleNamespace(recorded=True, unit="m", display_unit="mm"),
        "heart.velocity": SimpleNamespace(recorded=False, unit="m/s", display_unit="mm/s"),
    }
    catalog = SimpleNamespace(variant="base", seed=1, start=0.0, judged_until=0.5, signals=signals)
    asked = []

    def read(*arguments):
        asked.append(arguments)
        return SimpleNamespace(time=time, values={"heart.position": np.full(6, 2e-3)})

    changes = {2: {"late": 0.5} | ({"early": 0.2} if by_operator else {})}
    live = SimpleNamespace(catalog=catalog, changes=changes, read=read, state=SimpleNamespace(phase="running", epoch=2))
    found = SessionVerdicts(path, live)
    assert list(found.metrics) == ["own", "at_end"]
    found_rows = found.rows()
    assert {row.name: row.verdict for row in found_rows} == verdicts
    assert asked == [(["heart.position"], None, 0.5)]
    own, _ = [row for row in found_rows if row.is_metric]
    assert own.detail == "2 mm; reference 2 mm"
    assert own.reference == (None if by_operator else 2e-3)  # what is not comparable stands beside no reference
    assert [row.is_outside for row in found_rows if row.name == "unchanged"] == [by_operator]
    live.read = lambda *_: SimpleNamespace(time=time[:0], values={"heart.position": np.zeros(0)})
    begun = found.rows()  # all are listed from the start, so that the list does not grow under the pointer
    assert [row.name for row in begun] == [row.name for row in found_rows]
    assert {row.detail for row in begun if not row.is_metric and row.verdict == "waiting"} == {"judged from 0 s"}
    assert begun[-1].detail == "from 0 s"


@every_case(
    ("counts", "sentence"),
    [
        ((2, 0, 0), "2 of 2 requirements met"),
        ((2, 1, 0), "1 failed · 2 passed"),
        ((0, 0, 0), ""),
        ((1, 2, 3), "2 failed · 1 passed · 3 not judged"),
        ((0, 0, 1), "1 not judged"),
    ],
)
def test_the_result_in_a_sentence(counts, sentence):
    verdicts = [
        verdict for verdict, count in zip(("pass", "fail", "waiting"), counts, strict=True) for _ in range(count)
    ]
    assert headline([Row(verdict, "name", "") for verdict in [*verdicts, ""]], True) == sentence


def test_a_requirement_for_the_values_of_the_file_says_so():
    """The paper's force is not judged after another setpoint was set, in each scenario whose page lists parameters."""
    for name in ("bench_wall", "heart_wall_force", "hysteresis_models", "rig_on_wall"):
        scenario, _ = lint(scenario_paths.located(name), imports=False)
        papers = [each for each in scenario.expectations if "paper's 0." in each.name or "as in the paper" in each.name]
        assert papers
        assert all(each.nominal for each in papers)


def test_requirements_that_are_not_judged_are_counted():
    rows = [Row(verdict, "name", "") for verdict in ("pass", "pass", "not judged")]
    assert headline(rows, True) == "2 of 2 requirements met, 1 not judged"


def test_numbers_have_the_unit_of_the_charts_and_what_a_session_is_too_short_for_is_not_judged(tmp_path):
    path = tmp_path / "beat.yaml"
    path.write_text(
        "stop_time: 0.5 s\nmembers: {heart: {component: heart}}\n"
        "metrics: {far: {signal: heart.position, reduce: max, to: 0.45 s, unit: mm}}\n"
        "expect:\n"
        "  - {name: far, metric: far, at_most: 3 mm}\n"
        "  - {name: near, signal: heart.position, at_most: 3 mm}\n"
    )
    signals = {"heart.position": SimpleNamespace(recorded=True, unit="m", display_unit="m")}
    catalog = SimpleNamespace(variant="base", seed=1, start=0.0, judged_until=0.5, signals=signals)
    samples = SimpleNamespace(time=np.linspace(0.0, 0.3, 4), values={"heart.position": np.full(4, 2e-3)})
    state = SimpleNamespace(phase="stopped", epoch=1)
    live = SimpleNamespace(catalog=catalog, changes={}, read=lambda *_: samples, state=state)
    rows = SessionVerdicts(path, live).rows()
    assert {row.name: row.verdict for row in rows if not row.is_metric} == {"far": "not judged", "near": "pass"}
    assert (
        next(row.detail for row in rows if row.name == "near")
        == "heart.position was 0.002 m; expected at most 0.003 m."
    )
    assert next(row.detail for row in rows if row.is_metric) == "0.002 m"
    assert headline(rows, True) == "1 of 1 requirements met, 1 not judged"
