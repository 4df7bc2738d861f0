"""Variants of an extended file: judged by default, removed, and settings that they undo."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import pytest

from twin.errors import ScenarioError
from twin.scenario import load_scenario, parse_scenario

if TYPE_CHECKING:
    from pathlib import Path

BASE = """
stop_time: 10 s
members: {heart: {component: heart, parameters: {rate: 1 Hz}}}
variants:
  calm:
  fast: {members: {heart: {parameters: {rate: 2 Hz}}}, stop_time: 5 s}
  wide: {members: {heart: {parameters: {scale: 2}}}}
metrics:
  rise: {signal: heart.position, reduce: max, unit: mm, reference: {fast: 5 mm}, tolerance: 20 %}
  own: {signal: heart.velocity, reduce: std, variants: [fast]}
expect:
  - {name: range, signal: heart.position, at_most: 1 m, except: [wide]}
  - {name: listed, signal: heart.velocity, at_most: 9 m/s, variants: [calm]}
  - {name: order, metric: rise, ordered: [fast, calm]}
  - {name: of own, metric: own, at_most: 9 m/s}
plots: [{title: Fast, signals: [heart.position], variants: [fast]}]
"""


@pytest.fixture
def extending(tmp_path: Path, caplog: pytest.LogCaptureFixture):  # type: ignore[no-untyped-def]
    (tmp_path / "base.yaml").write_text(BASE)

    def load(text: str):  # type: ignore[no-untyped-def]
        file = tmp_path / "mine.yaml"
        file.write_text(f"extends: base.yaml\n{text}\n")
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            scenario = load_scenario(file)
        return scenario, [record.getMessage().replace(f"{tmp_path}/", "") for record in caplog.records]

    return load


def test_an_added_variant_is_judged_where_others_are_excluded(extending) -> None:  # type: ignore[no-untyped-def]
    scenario, _ = extending("variants: {mine: {members: {heart: {parameters: {rate: 3 Hz}}}}}")
    limits = {item.name: item for item in scenario.expectations}
    assert (limits["range"].variants, limits["range"].excluded) == (("calm", "fast", "mine"), ("wide",))
    assert (limits["listed"].variants, limits["listed"].unlisted) == (("calm",), ("mine",))
    assert limits["of own"].unlisted == ("mine",)  # its metric's list
    own = "expect: [{name: own, signal: heart.position, at_most: 1 m, variants: [calm]}]"
    assert extending(own)[0].expectations[0].unlisted == ()  # its author saw the inherited variants


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        (
            "variants: [calm], except: [wide]",
            "expect range: `variants` names the variants already. Leave `except` out.",
        ),
        ("except: [calm, fast, wide]", "expect range: no variant is left. Leave the expectation out."),
        ("except: [wild]", "expect range: there is no variant `wild`. Did you mean `wide`? Known: calm, fast, wide."),
    ],
)
def test_an_exclusion_that_makes_no_sense(keys: str, problem: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(BASE.replace("except: [wide]", keys))
    assert [line.partition(": ")[2] for line in caught.value.problems] == [problem]


def test_a_variant_is_removed_with_what_names_only_it(extending) -> None:  # type: ignore[no-untyped-def]
    scenario, notes = extending("variants: {fast: null}")
    assert [case.variant for case in scenario.variants] == ["calm", "wide"]  # `calm:` is a variant without changes
    assert list(scenario.metrics) == ["rise"]
    assert (scenario.metrics["rise"].paper, scenario.metrics["rise"].tolerance) == ({}, None)
    assert [item.name for item in scenario.expectations] == ["range", "listed"]
    assert scenario.plots == ()
    left_out = "1 metric, 2 expectations, 1 plot, naming no other variant."
    assert notes == [f"note: mine.yaml:2: left out with fast: {left_out}"]


def test_a_variant_that_is_not_there_cannot_be_removed(extending) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(
        ScenarioError, match=r"mine.yaml:2: there is no variant `fasd` to remove. Did you mean `fast`\?"
    ):
        extending("variants: {fasd: null}")


@pytest.mark.parametrize(
    ("text", "settings"),
    [
        (
            "members: {heart: {parameters: {rate: 3 Hz}}}",
            "heart.rate: no effect in fast, with its own heart (base.yaml:6).",
        ),
        ("stop_time: 8 s", "stop_time: no effect in fast, with its own stop_time (base.yaml:6)."),
        (
            "members: {heart: {parameters: {rate: 3 Hz}}}\nvariants: {fast: {members: {heart: {parameters: {rate: 4 Hz}}}}}",
            "",
        ),
        ("members: {heart: {parameters: {respiration_rate: 0.3 Hz}}}", ""),
    ],
)
def test_a_setting_that_variants_undo_is_noted(extending, text: str, settings: str) -> None:  # type: ignore[no-untyped-def]
    _, notes = extending(text)
    assert [note.partition(" Set it there too")[0] for note in notes] == [f"note: mine.yaml:2: {settings}"] * bool(
        settings
    )


def test_expectations_that_replace_those_of_a_file_elsewhere_are_noted(tmp_path: Path, extending, caplog) -> None:  # type: ignore[no-untyped-def]
    text = "expect:\n  - {signal: heart.position, at_most: 1 m}"
    assert extending(text)[1] == []  # both files are one person's
    (tmp_path / "own").mkdir()
    for expect, notes in ((text, 1), ("expect: []", 0), ("", 0)):
        (tmp_path / "own/mine.yaml").write_text(f"extends: ../base.yaml\n{expect}\n")
        caplog.clear()
        load_scenario(tmp_path / "own/mine.yaml")
        assert [record.getMessage().partition(" expect: ")[2] for record in caplog.records] == [
            "replaces all 4 expectations of ../base.yaml. Copy those that should hold here too."
        ] * notes


def test_an_option_names_the_values_of_variants_that_it_replaces() -> None:
    scenario = parse_scenario(BASE, overrides=["stop_time=8 s", "heart.rate=3 Hz", "heart.respiration_rate=0.2 Hz"])
    assert scenario.replaced_values(["calm", "fast"]) == [
        "--set stop_time=8 s also replaces what variants set themselves: fast (5 s).",
        "--set heart.rate=3 Hz also replaces what variants set themselves: fast (2 Hz).",
    ]
    assert scenario.replaced_values(["calm"]) == []
    assert scenario.previous_values() == ["10 s", "1 Hz", ""]


def test_many_variants_that_undo_a_setting_are_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    variants = ", ".join(f"v{i}: {{members: {{heart: {{parameters: {{rate: {i} Hz}}}}}}}}" for i in range(1, 5))
    (tmp_path / "base.yaml").write_text(
        f"stop_time: 1 s\nmembers: {{heart: {{component: heart}}}}\nvariants: {{{variants}}}\n"
    )
    (tmp_path / "mine.yaml").write_text("extends: base.yaml\nmembers: {heart: {parameters: {rate: 9 Hz}}}\n")
    load_scenario(tmp_path / "mine.yaml")
    (record,) = caplog.records
    assert ": heart.rate: no effect in v1 and 3 more, with their own heart (" in record.getMessage()
