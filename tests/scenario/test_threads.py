"""The key `threads` of a scenario: its values, runs that crash, and commands that step members by one thread all the same."""

import json
import threading

import pytest

from benchmarks.parallel import work_fmu
from tests.every_case import every_case
from twin.coupling.threads import step_threads
from twin.errors import ScenarioError
from twin.run import build_simulation, resolve_catalogs
from twin.scenario import Backend, load_scenario, parse_scenario
from twin.study.design import StudyRequest
from twin.study.execution import Engine, Job
from twin.study.execution.case_engine import DONE

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


@every_case("text", ["0", "-1", "257", "2.5", "true", "many", "[1]"])
def test_other_values_are_refused(text):
    with pytest.raises(ScenarioError, match="threads: expected auto, off or a number from 1 to 256, not "):
        parse_scenario(ALONE, overrides=[f"threads={text}"])


@pytest.mark.slow
def test_a_run_has_the_threads_of_its_scenario_and_a_study_none(tmp_path, build, monkeypatch):
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
    monkeypatch.setattr(step_threads, "StepThreads", None)  # A study has a process for each core.
    row = Engine(Job(path, (), (), (), 50_000_000, build)).row(StudyRequest(1, "", 1, "base", 0, ()))
    assert (row.status, row.why) == (DONE, "")


@pytest.mark.slow
@pytest.mark.parametrize("threads", ["auto", "2", "off"])
def test_a_member_that_crashes_in_a_thread(threads, tmp_path, build, command_line):
    work_fmu(tmp_path / "work.fmu", count=50000.0)
    (tmp_path / "rig.yaml").write_text(TEXT.replace("b: {", "b: {parameters: {crash: 0.01}, "))
    words = ["run", "rig.yaml", "--build", str(build), "--no-report", "--set", f"threads={threads}"]
    assert command_line.run(words, tmp_path).returncode == 1
    (path,) = tmp_path.glob("runs/rig/2*/summary.json")
    who, function = "b", "fmi2DoStep"
    if threads != "off" and step_threads.cores() > 1:
        who, function = "a or b", "a step at the same time as the others (threads: off tells which)"
    how = f"{who}: crashed with SIGSEGV (Segmentation fault) in {function}, in the step from t = 10 ms."
    assert json.loads(path.read_text())["reason"] == f"base, seed 0: {how}"
