"""Every scenario runs, as FMUs, and what it expects holds; the forms give the same bits."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from fmus.bouc_wen_compensator import identify
from fmus.bouc_wen_compensator.identify import Constants, simulate

from twin.component import catalog
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, load_scenario, parse_scenario

ROOT = Path(__file__).parent.parent.parent
# faults need drives: tests/hw_bridge/bridge/test_events.py runs those
SCENARIOS = [path for path in sorted((ROOT / "scenarios").glob("*.yaml")) if path.stem != "drive_faults"]

LONGEST = 600  # a scenario with more simulated time than this in all is a slow test [s]
BODIES = 20  # bodies run at a few times real time, not at hundreds: their seconds count as so many
# by name: else each process that collects tests would read them all
LONG = {
    "bench_force", "bench_hysteresis", "bench_regripping", "bench_wall", "beyond_paper", "catheter_calibration",
    "coordinate_feedforward", "coordinate_friction", "dynamic_regripping", "dynamic_regripping_sensitivity",
    "heart_motion", "hysteresis_followed", "hysteresis_models", "injection_sequence", "needle", "omnidirectional", "rig_on_wall",
    "rotation", "rotation_compensated", "stepper_calibration", "travel_distance", "heart_wall_ahead", "heart_wall_ten_minutes",
    "in_vivo_navigation", "best_gains", "contact_force", "fiber_shape", "heart_wall_replay", "failures", "tip_tracking",
    "linear_grip_diameter", "linear_grip_pressure", "smooth_regripping",
}  # fmt: skip
COMPILED_FOR_SECONDS = {
    "bench_buckling",
    "guided_injection",
    "hysteresis_identification",
    "linear_grip",
    "push_and_turn",
    "racs",
    "regripping",
    "teleoperation",
    "two_instruments",
    "vessel_teleoperation",
}
SLOW = LONG | COMPILED_FOR_SECONDS
FAST = {  # seeds and variants that run at once, all of them as a slow test; each verdict on what ran counts
    "heart_wall_force": (("seeds=[1]",), ("PI", "PI+FF+BW")),  # all of them in the README's command
    "rotational_grip": (("seeds=[1]",), ()),
}
WHOLE: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())


def is_long(scenario):
    """Whether all variants with all seeds take long."""
    weight = BODIES if scenario.path.stem.startswith("bench_") else 1
    simulated = sum(case.stop_ns - case.start_ns for case in scenario.variants) / 1e9
    return weight * len(scenario.seeds) * simulated > LONGEST


@pytest.fixture(scope="module")
def outcomes(build, tmp_path_factory):
    """The outcome of a scenario, run once."""

    @cache
    def outcome(path, options=(), variants=()):
        scenario = load_scenario(path, options)
        root = tmp_path_factory.mktemp("runs")
        return run_scenario(scenario, RunOptions(variants=variants, root=root, build=build, report=False))

    return outcome


@pytest.mark.parametrize("path", [path for path in SCENARIOS if path.stem not in SLOW], ids=lambda path: path.stem)
def test_scenario(path, outcomes):
    """Where a scenario's length or number of variants is evidence, not a test, with some of them: see FAST."""
    assert not is_long(load_scenario(path)), "add it to LONG"
    outcome = outcomes(path, *FAST.get(path.stem, WHOLE))
    assert_all_holds(outcome)
    judged = [*outcome.evaluation.expectation_results, *outcome.evaluation.metric_results]
    assert path.stem not in FAST or any(one.verdict == "pass" for one in judged), (
        "it judges nothing: name more variants"
    )


@pytest.mark.slow
@pytest.mark.parametrize("path", [p for p in SCENARIOS if p.stem in {*SLOW, *FAST}], ids=lambda path: path.stem)
def test_long_scenario(path, outcomes):
    assert_all_holds(outcomes(path))


@pytest.mark.slow
@pytest.mark.parametrize(
    "path", [p for p in SCENARIOS if p.stem in LONG and p.stem.startswith("bench_")], ids=lambda p: p.stem
)
def test_a_long_scenario_of_bodies_begins(path, build, tmp_path):
    """Every variant, for as long as shows that it runs; what it expects is judged by its slow test."""
    scenario = load_scenario(path)
    assert is_long(scenario), "take it out of LONG"
    nothing = {
        "metrics": dict.fromkeys(scenario.metrics),
        "analyses": dict.fromkeys(one.name for one in scenario.analyses),
    }
    variants = {case.variant: {"stop_time": "50 ms"} for case in scenario.variants}
    keys = {"extends": path.name, "stop_time": "50 ms", "variants": variants, "expect": [], "plots": []}
    text = yaml.safe_dump(keys | nothing)
    short = parse_scenario(text, path.with_name("short.yaml"))
    outcome = run_scenario(short, RunOptions(root=tmp_path, build=build, report=False))
    assert outcome.run.status == "completed", outcome.run.reason
    assert {variant for variant, _ in outcome.tables} == {case.variant for case in scenario.variants}
    for (variant, _), table in outcome.tables.items():
        assert all(np.isfinite(values).all() for values in table.values.values()), variant


def assert_all_holds(outcome):
    assert outcome.run.status == "completed", outcome.run.reason
    failed = [one.name for one in outcome.evaluation.expectation_results if one.verdict == "fail"]
    failed += [
        f"{one.metric.name} of {one.variant}" for one in outcome.evaluation.metric_results if one.verdict == "fail"
    ]
    assert not failed
    assert outcome.passed


@pytest.mark.slow
def test_the_compensators_constants_are_those_that_the_scenario_identifies(outcomes):
    """The valley is flat, so the constants may differ; what they say about the tip may not."""
    assert_constants_fit(outcomes(ROOT / "scenarios/hysteresis_identification.yaml"))


@pytest.mark.slow
def test_the_compensators_constants_are_a_best_fit(outcomes, monkeypatch):
    """The same of one seed and from one start, these constants, which takes a twentieth of the time."""
    shipped = catalog.component("bouc_wen_compensator")
    start = Constants(*(getattr(shipped, constant).start for constant in Constants._fields))
    monkeypatch.setattr(identify, "STARTS", (start,))
    outcome = outcomes(ROOT / "scenarios/hysteresis_identification.yaml", ("seeds=[1]",), ("chirp",))
    assert_all_holds(outcome)
    assert_constants_fit(outcome)


def assert_constants_fit(outcome):
    tables = [table.values for (variant, _), table in outcome.tables.items() if variant == "chirp"]
    assert tables
    for compensator in ("bouc_wen_compensator", "pi_bouc_wen_control"):
        cls = catalog.component(compensator)
        constants = [getattr(cls, constant).start for constant in Constants._fields]
        for signals in tables:
            x_in, x_out = signals["tracker.sampled_reference"][1:], signals["tracker.measured_position"][1:]
            error = x_out - simulate(constants, x_in)
            assert np.std(error) < 1.03 * signals["bouc_wen.residual"][-1]


@pytest.mark.parametrize(
    "overrides",
    [
        pytest.param(["heart.rate=1.6 Hz"], marks=pytest.mark.slow),
        pytest.param(["heart.rate=0.8 Hz"], marks=pytest.mark.slow),
        pytest.param(["heart.scale=0.7"], marks=pytest.mark.slow),
        pytest.param(["heart.scale=1.2"], marks=pytest.mark.slow),
        pytest.param(["controller.setpoint=0.3 N"], marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_the_order_of_the_controllers_holds_elsewhere_too(overrides, build, tmp_path):
    scenario = load_scenario(ROOT / "scenarios/heart_wall_force.yaml", [*overrides, "seeds=[1]"])
    outcome = run_scenario(scenario, RunOptions(root=tmp_path, build=build, report=False))
    assert outcome.run.status == "completed", outcome.run.reason
    verdicts = {one.name: one.verdict for one in outcome.evaluation.expectation_results}
    assert verdicts["order of the controllers"] == "pass"
    assert {one.verdict for one in outcome.evaluation.metric_results} <= {"other", "info"}


@pytest.mark.slow
def test_forms_agree_to_the_bit(build, tmp_path):
    recorded = {}
    for form in Backend:
        scenario = load_scenario(ROOT / "tests/conformance/short_force.yaml", ["stop_time=60 ms"])
        outcome = run_scenario(scenario, RunOptions(backend=form, root=tmp_path / form, build=build, report=False))
        assert outcome.run.status == "completed", outcome.run.reason
        recorded[form] = {
            f"{variant} {name}": values
            for (variant, _), table in outcome.tables.items()
            for name, values in table.values.items()
            if "stream" not in name
        }
    names = set.intersection(*(set(values) for values in recorded.values()))
    assert len(names) > 40
    for name in sorted(names):
        for form in (Backend.compiled, Backend.interpreted):
            assert np.asarray(recorded[form][name]).tobytes() == np.asarray(recorded[Backend.fmu][name]).tobytes(), name


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rotation"])
def test_the_rotation_compensators_play_is_that_which_the_scenario_identifies(name, outcomes):
    """For the catheter, at every speed."""
    outcome = outcomes(ROOT / f"scenarios/{name}.yaml")
    default = catalog.component("rotation_compensator").play.start
    plays = [
        table.values["identified.play"][-1]
        for (variant, _), table in outcome.tables.items()
        if variant.startswith("catheter")
    ]
    assert len(plays) == 3
    np.testing.assert_allclose(plays, default, rtol=0.01)
