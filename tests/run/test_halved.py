"""At half the step: what the coupling makes of a run."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from tests.structure.test_structure import MASSES
from twin.cli.run import command
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, parse_scenario

METRICS = """
metrics:
  place: {signal: b.x, reduce: final, unit: mm}
  clock: {signal: b.x - b.x, reduce: max}
variants: {fast: {}, slow: {members: {a: {parameters: {coupling: 100 N/m}}}}}
seeds: [1, 2]
"""


def places(tmp_path, build, step, report=False):
    scenario = parse_scenario(MASSES + METRICS, tmp_path / "s.yaml", [f"step={step}", "stop_time=0.2 s"])
    done = run_scenario(
        scenario, RunOptions(backend=Backend.compiled, root=tmp_path, build=build, refine_steps=True, report=report)
    )
    return done, {one.variant: one for one in done.refinements if one.metric_result.metric.name == "place"}


@pytest.mark.slow
def test_the_difference_falls_with_the_step(tmp_path, build):
    coarse, one = places(tmp_path, build, "2 ms", report=True)
    _, other = places(tmp_path, build, "1 ms")
    assert set(one) == {"fast", "slow"}
    assert one["slow"].half == other["slow"].value  # it is that run, to the bit
    assert 1.5 < one["slow"].difference / other["slow"].difference < 2.5  # order one
    assert [row["seed"] for row in coarse.summary["half_step"]] == [1] * 4
    assert any(line.startswith("half the step changes metrics by at most ") for line in coarse.run.extra["notes"])
    page = (coarse.folder / "report.html").read_text()
    assert "Step refinement" in page
    assert one["slow"].table_cells["difference"] in page
    assert one["slow"].table_cells["part"] != "-"
    assert {row.table_cells["part"] for row in coarse.refinements if row.metric_result.metric.name == "clock"} == {
        "0 %"
    }


@pytest.mark.slow
def test_a_step_that_a_member_cannot_make(tmp_path, build):
    text = "stop_time: 10 ms\nstep: 0.5 ms\nmembers: {m: {component: servomotor}}\n"
    done = run_scenario(
        parse_scenario(text, tmp_path / "s.yaml"),
        RunOptions(backend=Backend.interpreted, root=tmp_path, build=build, refine_steps=True),
    )
    assert done.run.status == "completed"
    (line,) = done.run.extra["notes"]
    assert line.startswith("base, seed 0 at half the step, 250 us: m: failed with ERROR in the step from t = 0 s.")


def test_drives_do_not_repeat_a_run(tmp_path):
    done = CliRunner().invoke(command, [str(tmp_path / "s.yaml"), "--step-refinement", "--hardware", "h.yaml"])
    assert "--step-refinement repeats a run, which a bus of drives does not" in done.output
