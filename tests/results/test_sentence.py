"""The answer of a scenario in a sentence, and the display of metrics: one unit and one number of decimals a metric."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.every_case import every_case
from twin.errors import ScenarioError
from twin.results import Metric, MetricResult, check_sentence, fill_sentence, metric_formats
from twin.results.evaluation import expression
from twin.scenario import load_scenario, parse_scenario, scenario_paths

ERROR = Metric("error", expression.parse("a.force"), "std", unit="mN", paper={"PI": 0.0362})
RESULTS = (
    MetricResult(ERROR, "PI", {1: 0.0356, 2: 0.0358}, 0.0362),
    MetricResult(ERROR, "PI+FF, replayed", {1: 0.001}, None),
)
SCENARIO = """
summary: "{SENTENCE}"
stop_time: 1 s
members: {heart: {component: heart}}
metrics: {reach: {signal: heart.position, reduce: max, unit: mm}}
"""


@every_case(
    ("text", "filled"),
    [
        ("Off by {error[PI]}.", "Off by 35.7 mN."),
        ("{error[PI+FF, replayed]} instead of {error}", "1.0 mN instead of 35.7 mN"),
        ("{error[PI].worst}, the paper: {error[PI].reference}", "35.8 mN, the paper: 36.2 mN"),
        ("{error[PI]} and {error[PI+FF]}", ""),
        ("With {error[PI]} and {error[PI+FF]}; the paper: {error[PI].reference}. It is {error}.", "It is 35.7 mN."),
        ("{other} alone", ""),
        ("Off by {error[PI]}; with both {error[PI+FF]}. Alone {other}.", "Off by 35.7 mN."),
        ("Folded\n  lines {error}\n", "Folded lines 35.7 mN"),
        ("From {error[PI].min} to at most {error[PI].max}.", "From 35.6 mN to at most 35.8 mN."),
        ("Deviation: {other} by hand; {error} with PI; {error[PI+FF]} with both.", "Deviation: 35.7 mN with PI."),
        ("Deviation: {other}.", ""),
    ],
)
def test_values_are_filled_in(text: str, filled: str) -> None:
    assert fill_sentence(text, RESULTS) == filled


def test_a_value_of_a_part_of_its_window_is_not_filled_in() -> None:
    cut = [replace(result, verdict="cut") for result in RESULTS[:1]]
    assert fill_sentence("Off by {error[PI]}.", cut) == ""


def test_wrong_placeholders_are_named() -> None:
    found = check_sentence("{eror} {error[P]} {error.median} {error[PI]}", {"error": ERROR}, ["PI", "PI+FF"])
    assert [line.partition(".")[0] for line in found] == [
        "there is no metric 'eror'",
        "there is no variant 'P'",
        "a placeholder is not `{metric}` or `{metric[variant]",
    ]


def test_a_wrong_sentence_is_found_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"s\.yaml:2: summary: there is no metric 'rech'\. Did you mean 'reach'"):
        parse_scenario(SCENARIO.replace("SENTENCE", "rech"), tmp_path / "s.yaml")
    assert parse_scenario(SCENARIO.replace("SENTENCE", "reach"), tmp_path / "s.yaml").summary == "{reach}"


def test_the_sentence_holds_for_its_own_file_only(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(SCENARIO.replace("SENTENCE", "reach"))
    (tmp_path / "s.yaml").write_text("extends: base.yaml\nmetrics: {reach: null}\n")
    assert load_scenario(tmp_path / "s.yaml").summary == ""


def test_no_sentence_about_settings_that_were_changed(tmp_path: Path) -> None:
    """It may state one of them, or compare with figures of others."""
    text, path = SCENARIO.replace("SENTENCE", "reach"), tmp_path / "s.yaml"
    for overrides, sentence in (((), "{reach}"), (("seeds=[2]",), "{reach}"), (("heart.scale=2",), "")):
        assert parse_scenario(text, path, overrides).sentence == sentence


def test_every_shipped_scenario_answers_in_a_sentence() -> None:
    silent = []
    for name, path in scenario_paths.scenarios().items():
        if path.is_relative_to(Path("scenarios")) and "\nsummary: " not in path.read_text():
            silent.append(name)
    assert silent == []


@every_case(
    ("name", "claim"),
    [
        # a reduction is that of one metric, between a variant without learning and one with it
        (
            "omnidirectional",
            "learning reduces the error of the coordinates from {late[not learning]} to {late[learning]}",
        ),
        # the offset of eq. (2) is a length, its slope a number
        ("catheter_calibration", "the tip falls behind the slide by {offset}"),
    ],
)
def test_sentences_give_the_metric_that_they_name(name: str, claim: str) -> None:
    assert claim in " ".join(load_scenario(f"scenarios/{name}.yaml").summary.split())


def test_a_metric_has_one_unit_and_one_number_of_decimals() -> None:
    style = metric_formats(RESULTS)["error"]
    assert [style.text(result.mean) for result in RESULTS] == ["35.7 mN", "1.0 mN"]
    assert style.number(-1e-9) == "0.0"
    large = MetricResult(ERROR, "PI", {1: 0.25}, None)
    assert metric_formats([large])["error"].text(0.25) == "250 mN"
