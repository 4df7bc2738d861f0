"""The key `threads` of a scenario: its values, and commands that step members by one thread all the same."""

import threading

import pytest

from benchmarks.parallel import work_fmu
from twin.errors import ScenarioError
from twin.run import build_simulation, resolve_catalogs
from twin.scenario import Backend, load_scenario, parse_scenario
from twin.study.execution import Engine, Job

TEXT = """
stop_time: 20 ms
threads: 3
members: {a: {component: work.fmu}, b: {component: work.fmu}}
"""


ALONE = "stop_time: 1 s\nthreads: 3\nmembers: {heart: {component: heart}}"


@pytest.mark.parametrize(("text", "limit"), [("auto", None), ("off", 1), ("1", 1), ("2", 2)])
def test_values(text, limit):
    assert parse_scenario(ALONE).variants[0].threads == 3
    assert parse_scenario(ALONE, overrides=[f"threads={text}"]).variants[0].threads == limit


@pytest.mark.parametrize("text", ["0", "-1", "257", "2.5", "true", "many", "[1]"])
def test_other_values_are_refused(text):
    with pytest.raises(ScenarioError, match="threads: expected auto, off or a number from 1 to 256, not "):
        parse_scenario(ALONE, overrides=[f"threads={text}"])


def test_a_run_has_the_threads_of_its_scenario_and_a_study_none(tmp_path, build):
    work_fmu(tmp_path / "work.fmu")
    path = tmp_path / "rig.yaml"
    path.write_text(TEXT)
    scenario = load_scenario(path)
    (case,) = scenario.cases()
    simulation = build_simulation(case, resolve_catalogs(scenario)["base"], Backend.compiled, build)
    before = threading.active_count()
    simulation.initialize(case.start_ns, case.stop_ns)
    assert threading.active_count() == before + 1  # of three threads two have a member, and one is this one
    simulation.terminate()
    assert Engine(Job(path, (), (), (), 50_000_000, build)).cell("base").case.threads == 1
