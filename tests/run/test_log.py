"""What FMUs log, shown and kept where it is asked for."""

from __future__ import annotations

import pytest

from tests.fmi.third_party import NATIVE_XML, native_fmu
from tests.run.endings import MODES, SOURCE
from twin.errors import ScenarioError
from twin.run import RunCallbacks, RunOptions, run_scenario
from twin.scenario import Backend, parse_scenario

TALKING = (
    SOURCE.replace(
        "void (*log)(void *, int, const char *, const char *); } Instance;",
        "void (*log)(void *, int, const char *, const char *); bool talks; } Instance;",
        1,
    )
    .replace("c->log = log;", "c->log = log; c->talks = logging;", 1)
    .replace(
        "double end = t + h;", 'double end = t + h; if (c->talks) c->log(c->environment, 0, "logAll", "a\\nstep");', 1
    )
)


@pytest.fixture
def scenario(tmp_path):
    path = native_fmu(tmp_path, NATIVE_XML, TALKING)
    return parse_scenario(
        f"stop_time: 30 ms\nstep: 10 ms\nmembers: {{pump: {{component: {path}}}, tank: {{component: {path}}}}}\n",
        tmp_path / "s.yaml",
    )


@pytest.mark.slow
def test_one_member_is_heard(scenario, tmp_path, build):
    heard = []
    done = run_scenario(
        scenario,
        RunOptions(root=tmp_path, build=build, report=False, log_patterns=["tan*"]),
        callbacks=RunCallbacks(on_log_line=heard.append),
    )
    assert heard == ["base, seed 0: tank: OK: a step"] * 3
    assert (done.folder / "log.txt").read_text().splitlines() == heard


def test_nobody_is_asked_to_talk(scenario, tmp_path, build):
    done = run_scenario(scenario, RunOptions(root=tmp_path, build=build, report=False))
    assert not (done.folder / "log.txt").exists()


def test_former_arguments_are_accepted_with_a_note(scenario, tmp_path, build, caplog):
    lines = []
    former = {"root": tmp_path, "build": build, "report": False, "log_patterns": ["tank"], "on_log_line": lines.append}
    run_scenario(scenario, Backend.fmu, **former)
    assert lines == ["base, seed 0: tank: OK: a step"] * 3
    arguments = ", ".join(f"{name}=..." for name in ("backend", *former))
    assert [record.getMessage() for record in caplog.records] == [
        f"note: run_scenario({arguments}) is now RunOptions(...), RunCallbacks(...); the old name ends with the next release."
    ]


def test_who_is_not_there(scenario, tmp_path):
    with pytest.raises(ScenarioError, match=r"--log tnk: there is no member `tnk`. Did you mean 'tank'"):
        run_scenario(scenario, RunOptions(root=tmp_path, log_patterns=["tnk"]))


@pytest.mark.slow
def test_cases_after_one_that_ended_its_process_are_heard_too(tmp_path, command_line, build):
    native_fmu(tmp_path, NATIVE_XML, TALKING)
    (tmp_path / "s.yaml").write_text(
        "stop_time: 400 ms\nstep: 100 ms\nmembers: {pump: {component: Native.fmu}}\n"
        f"variants: {{dies: {{members: {{pump: {{parameters: {{mode: {MODES['exit']}}}}}}}}}, lives: {{}}}}\n"
    )
    words = ["run", "s.yaml", "--build", str(build), "--no-report", "--log", "pump", "--step-refinement"]
    done = command_line.run(words, tmp_path)
    assert done.returncode == 1
    told = [line for line in done.stderr.splitlines() if line.endswith(": a step")]
    assert [line.partition(",")[0] for line in told] == ["dies"] * 4 + ["lives"] * 4
    assert "note: --step-refinement was left out, since the process that ran the scenario had died" in done.stderr
