"""Former names of variables in scenarios: read for one release, with a note."""

import pytest

from twin.component import catalog
from twin.scenario import lint, load_scenario

GROUP = """
stop_time: 1 s
members:
  estimator: {component: heart_motion, parameters: {OLD: 10 s}}
groups: {chain: [estimator]}
"""
SCENARIO = """
stop_time: 1 s
parameter_sets: [{heart_motion: {FIRST: 2}}]
members:
  trouble: {component: state_trigger}
  estimate: {component: heart_motion}
connections: [trouble.SECOND -> estimate.learn]
events: [{at: 0.5 s, set: {estimate.FIRST: 1}}]
record: [estimate.THIRD]
console: {parameters: {estimate.FIRST: [1, 9]}}
metrics: {m: {signal: 2 * estimate.THIRD - estimate.rate, reduce: std, description: estimate.FIRST in words}}
variants:
  longer: {members: {estimate: {parameters: {FIRST: 3}}}}
"""
FORMER = {"FIRST": "patience", "SECOND": "begun", "THIRD": "found_rate"}
PRESENT = {"FIRST": "max_disturbed_beats", "SECOND": "is_active", "THIRD": "search_rate"}


def written(folder, names):
    text = SCENARIO
    for key, name in names.items():
        text = text.replace(key, name)
    path = folder / "one.yaml"
    path.write_text(text)
    return path


def test_former_names_are_read_everywhere_with_one_note(tmp_path, caplog):
    former = load_scenario(written(tmp_path, FORMER))
    (note,) = caplog.messages
    assert note.startswith(
        f"note: {tmp_path / 'one.yaml'}:3: `patience` is now `max_disturbed_beats`; the old name ends"
    )
    caplog.clear()
    present = load_scenario(written(tmp_path, PRESENT))
    assert not caplog.messages
    assert lint(tmp_path / "one.yaml")[1] == []
    for one, other in zip(former.variants, present.variants, strict=True):
        assert (one.connections, one.events, one.record) == (other.connections, other.events, other.record)
        assert one.members["estimate"].parameters == other.members["estimate"].parameters
    assert former.console_parameters == present.console_parameters
    assert former.metrics["m"].signal.signals == present.metrics["m"].signal.signals
    assert former.metrics["m"].description == "estimate.patience in words"


@pytest.mark.parametrize("option", ["estimate.lesson=3 s", "estimate.training_time=3 s"])
def test_options_may_use_former_names(tmp_path, option):
    scenario = load_scenario(written(tmp_path, PRESENT), [option])
    assert {case.members["estimate"].parameters["training_time"] for case in scenario.variants} == {"3 s"}


def test_parts_of_groups_have_former_names(tmp_path, caplog):
    (tmp_path / "group.yaml").write_text(GROUP.replace("OLD", "training_time"))
    path = tmp_path / "one.yaml"
    path.write_text(
        "stop_time: 1 s\nmembers: {e: {component: group.yaml#chain, parameters: {estimator.lesson: 2 s}}}\n"
        "record: [e.estimator.found_rate]\n"
    )
    (case,) = load_scenario(path).variants
    assert case.members["e"].parameters == {"estimator.training_time": "2 s"}
    assert case.record.patterns == ("e.estimator.search_rate",)
    assert len(caplog.messages) == 1


def test_a_name_that_the_component_of_another_variant_has_is_left(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(catalog.component("heart_motion"), "former_names", (("scale", "rate"),))
    path = tmp_path / "one.yaml"
    text = "stop_time: 1 s\nmembers: {a: {component: heart_motion}}\nrecord: [a.scale]\n"
    path.write_text(text)
    assert load_scenario(path).variants[0].record.patterns == ("a.rate",)
    caplog.clear()
    path.write_text(f"{text}variants: {{one: {{}}, two: {{members: {{a: {{component: heart}}}}}}}}\n")
    assert {case.record.patterns for case in load_scenario(path).variants} == {("a.scale",)}
    assert not caplog.messages
