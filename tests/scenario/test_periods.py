"""What a member samples at (`period`) and how often it communicates (`communication_step`): in every form."""

import numpy as np
import pytest
from fmus.pi_feedforward_control.model import PIFeedforwardControl

from tests.fmi.parts import Sampler
from twin.component import resampled
from twin.coupling import CoSimulation
from twin.errors import ScenarioError
from twin.fmi.exporting import exporter
from twin.run import resolve_catalogs
from twin.run.cases import build_simulation, run_case
from twin.scenario import Backend, group, parse_scenario

SCENARIO = """
stop_time: 0.4 s
members:
  heart:      {component: heart}
  controller: {component: pi_control, period: 10 ms}
connections: [heart.position -> controller.heart_position]
variants:
  PI: {}
  PI+FF: {members: {controller: {component: pi_feedforward_control}}}
  declared: {members: {controller: {component: "tests.scenario.test_periods:AtTen", period: null}}}
  fast: {members: {controller: {component: pi_feedforward_control, period: null}}}
  ticks inside: {members: {controller: {component: pi_feedforward_control, communication_step: 20 ms}}}
"""


class AtTen(PIFeedforwardControl):
    """The same controller, declared with another period."""

    period = 10e-3


def simulated(variant: str, form: Backend, build, text: str = SCENARIO) -> CoSimulation:
    scenario = parse_scenario(text)
    case = scenario.cases([variant])[0]
    made = build_simulation(case, resolve_catalogs(scenario)[variant], form, build)
    run_case(case, made, lambda *_: None)
    made.terminate()
    return made


def velocity(variant: str, form: Backend, build, text: str = SCENARIO) -> bytes:
    """Target velocity of the controller at every communication point, to the bit."""
    return simulated(variant, form, build, text).recording().signals["controller.target_velocity"].tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("form", Backend)
def test_a_sampled_component_samples_at_the_scenarios_period(form, build):
    known = {name: velocity(name, form, build) for name in ("PI", "PI+FF", "declared", "fast", "ticks inside")}
    assert known["PI+FF"] == known["declared"]
    assert len(set(known.values())) == 4


@pytest.mark.slow
def test_all_forms_agree_about_it(build):
    assert len({velocity("PI+FF", form, build) for form in Backend}) == 1
    assert len({velocity("ticks inside", form, build) for form in Backend}) == 1


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("form", Backend)
@pytest.mark.parametrize("variant", ["PI+FF", "ticks inside"])
def test_in_a_group_too(variant, form, build, tmp_path):
    scenario = parse_scenario(SCENARIO)
    case = scenario.cases([variant])[0]
    both = group("both", case, resolve_catalogs(scenario)[variant], ["heart", "controller"])
    exporter.build(both, "3.0", build)
    path = tmp_path / "whole.yaml"
    path.write_text(SCENARIO + "groups: {both: [heart, controller]}\n")
    text = f'{{stop_time: 0.4 s, members: {{all: {{component: "{path}#both@{variant}"}}}}}}'
    made = simulated("base", form, build, text)
    inside = made.recording().signals["all.controller.target_velocity"]
    assert inside.tobytes() == velocity(variant, Backend.compiled, build)


def test_a_resampled_component_is_one_class_with_a_name_of_its_own():
    assert resampled(Sampler, Sampler.period_ns) is Sampler
    assert resampled(Sampler, 2_500_000) is resampled(Sampler, 2_500_000)
    assert resampled(Sampler, 2_500_000).__name__ == "Sampler_2500us"
    assert resampled(Sampler, 2_500_000).start_values().keys() == Sampler.start_values().keys()


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ("period: 2.5 ms", "period 2.5 ms is not a multiple of step 1 ms. Use 2 ms or 3 ms, or a step of 500 us."),
        (
            "communication_step: 7 ms",
            "period 10 ms is not a multiple of communication_step 7 ms. Use 7 ms or 14 ms, or a",
        ),
        (
            "communication_step: 0.5 ms",
            "communication_step 500 us is not a multiple of step 1 ms. Use 1 ms, or a step of",
        ),
    ],
)
def test_what_does_not_divide(keys, expected):
    text = SCENARIO.replace("PI: {}", f"PI: {{members: {{controller: {{{keys}}}}}}}")
    with pytest.raises(ScenarioError) as caught:
        resolve_catalogs(parse_scenario(text, "s.yaml"))
    assert any(
        line.startswith("s.yaml:8: member `controller`: ") and expected in line for line in caught.value.problems
    )


def test_a_period_means_how_often_it_communicates_where_nothing_is_sampled():
    scenario = parse_scenario(SCENARIO, overrides=["heart.period=2 ms"])
    resolve_catalogs(scenario)
    with pytest.raises(
        ScenarioError, match=r"heart does not sample by itself, so it has no period. Keep communication_"
    ):
        resolve_catalogs(parse_scenario(SCENARIO, overrides=["heart.period=2 ms", "heart.communication_step=2 ms"]))


def test_the_tick_of_a_finished_fmu_cannot_be_changed(build, tmp_path):
    exporter.export(Sampler, "3.0", tmp_path / "sampler.fmu", build)
    own = round(Sampler.period * 1e3)
    text = "{{stop_time: 1 s, members: {{a: {{component: sampler.fmu, {}: {} ms}}}}}}"
    with pytest.raises(ScenarioError) as caught:
        resolve_catalogs(parse_scenario(text.format("period", 2 * own), tmp_path / "s.yaml"))
    (line,) = caught.value.problems
    assert f"sampler.fmu samples at its own {own} ms, which cannot be changed" in line
    assert f"write `communication_step: {2 * own} ms`" in line
    for key, size in (("period", own), ("communication_step", 2 * own)):
        resolve_catalogs(parse_scenario(text.format(key, size), tmp_path / "s.yaml"))


def test_values_are_those_of_the_period(build):
    fast, slow = (np.frombuffer(velocity(name, Backend.compiled, build)) for name in ("fast", "PI+FF"))
    assert np.count_nonzero(np.diff(fast)) > 1.5 * np.count_nonzero(np.diff(slow)) > 0


@pytest.mark.parametrize(
    ("wrong", "advice"),
    [
        (
            "parameters: {drive_period: 0.3 ms}",
            "drive_period 300 us does not divide its step of 1 ms. Use 500 us or 250 us.",
        ),
        ("parameters: {drive_period: 2 ms}", "drive_period 2 ms does not divide its step of 1 ms. Use 1 ms."),
        ("communication_step: 0.6 ms", "drive_period 500 us does not divide its step of 600 us. Use 600 us or 300 us."),
    ],
)
def test_what_samples_inside_of_a_step_must_divide_it(wrong, advice):
    step = "0.2 ms" if "communication" in wrong else "1 ms"
    text = f"stop_time: 0.3 s\nstep: {step}\nmembers:\n  drive: {{component: servomotor, {wrong}}}\n"
    with pytest.raises(ScenarioError) as caught:
        resolve_catalogs(parse_scenario(text))
    (line,) = caught.value.problems
    assert line.endswith(f": member `drive`: {advice}")
    assert resolve_catalogs(parse_scenario(text.replace(wrong, "parameters: {drive_period: 0.1 ms}")))
