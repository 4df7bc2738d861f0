"""`twin export` of a follow file: the estimator's FMU and C give the estimates of `twin follow` of the same recording."""

from __future__ import annotations

import re
import subprocess
import zipfile
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import fmpy
import numpy as np
import pytest
from click.testing import CliRunner

import twin
from tests.follow.test_fmus import foreign
from tests.follow.test_follow import SAMPLED, SCENARIO, VAN_DER_POL, recording, write
from twin.cli.export import command
from twin.compiler import library
from twin.coupling import RecordMember
from twin.errors import ScenarioError, TwinError
from twin.fmi import exporter
from twin.follow import FollowProblem, estimator, follow, load, path_of
from twin.follow.problem import times_of

DELAYED = VAN_DER_POL.replace("noise: 20 mm}}", "noise: 20 mm, delay: 50 ms, offset: 5 mm}}")


MATHEMATICS = {"sqrt", "exp", "log", "pow", "sin", "cos", "tan", "fabs", "floor", "ceil", "fmod", "atan2"}  # of libm


@dataclass
class Arrivals:
    """Inputs of an estimator at each communication step, as they arrive while a recording is made."""

    problem: FollowProblem

    @property
    def step(self) -> float:
        return float(self.problem.experiment.case.step_ns) * 1e-9

    @cached_property
    def delays(self) -> list[int]:
        return [round(float(output.delay) / self.step) for output in self.problem.outputs]

    @property
    def lag(self) -> int:
        return max(0, *self.delays)

    def table(self) -> dict[str, Any]:
        """Values of each input; of what is not measured either NaN or, at every other step, a wrong value that is not valid."""
        times, problem = times_of(self.problem), self.problem
        count = max(times) + self.lag + 2
        columns = {path_of(i.signal): np.resize(i.values, count) for i in problem.experiment.inputs}
        for number, (output, delay) in enumerate(zip(problem.outputs, self.delays, strict=True)):
            measured = np.where(np.arange(count) % 2, np.nan, 7.0)
            valid = np.arange(count) % 2 == 1
            for tick, values in times.items():
                if number in values and tick + delay >= 0:
                    measured[tick + delay], valid[tick + delay] = values[number] + float(output.offset), True
            columns |= {path_of("measured", output.signal): measured, path_of("valid", output.signal): valid}
        return columns

    def names(self) -> list[str]:
        """Names of the outputs of the estimator."""
        groups = [[path_of(g, one.name) for one in self.problem.estimates] for g in ("estimate", "deviation")]
        return [*groups[0], *groups[1], "nis.value"]

    def expected(self, build, rows):
        """Estimates of `twin follow`, and those in `rows`: after each communication step."""
        wanted, found = [], []
        case = self.problem.experiment.case
        for estimate in follow(self.problem, build):
            tick = round((estimate.time - case.start_ns * 1e-9) / self.step) + self.lag
            if tick < len(rows):
                wanted.append([*estimate.values, *estimate.deviations, estimate.nis])
                found.append(rows[tick])
        assert len(found) > 20
        return np.array(found), np.array(wanted)


def interpreted(component, arrivals):
    """Outputs after each step, stepped by the loop's own calls in Python."""
    columns, rows = arrivals.table(), []
    member = RecordMember("estimator", component())
    for k in range(len(next(iter(columns.values())))):
        for name, values in columns.items():
            member.set(name, values[k])
        if k == 0:
            member.enter_initialization(0.0, None)
            member.exit_initialization()
        assert member.component.advance(k * arrivals.step, arrivals.step) == 0
        rows.append([member.get(name) for name in arrivals.names()])
    return rows


def in_fmpy(path, arrivals):
    """Outputs after each step of an FMU in FMPy."""
    columns = arrivals.table()
    count = len(next(iter(columns.values())))
    fields = [("time", float), *((name, values.dtype) for name, values in columns.items())]
    signals = np.zeros(count, fields)
    signals["time"] = np.arange(count) * arrivals.step
    for name, values in columns.items():
        signals[name] = values
    step = arrivals.step
    options = {"stop_time": (count - 1) * step, "step_size": step, "output_interval": step, "validate": True}
    found = fmpy.simulate_fmu(str(path), input=signals, output=arrivals.names(), fmi_type="CoSimulation", **options)
    return [[row[name] for name in arrivals.names()] for row in found[1:]]


def nm(*arguments):
    """Names of the symbols of a library."""
    listed = subprocess.run(["nm", *map(str, arguments)], check=True, capture_output=True, text=True)
    lines = [line.split() for line in listed.stdout.splitlines()]
    return {words[-1].partition("@")[0] for words in lines if len(words) > 1}


@pytest.mark.slow
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_an_fmu_in_fmpy_gives_the_estimates_of_twin_follow(tmp_path, build, version):
    problem = load(path := write(tmp_path, recording(1, count=80)[0], DELAYED))
    exported = estimator(path)
    assert exported.notes == ()
    exporter.export(exported.component, version, tmp_path / "estimator.fmu", build)
    arrivals = Arrivals(problem)
    assert arrivals.lag == 5
    found, wanted = arrivals.expected(build, in_fmpy(tmp_path / "estimator.fmu", arrivals))
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-12)


@pytest.mark.slow
def test_exported_code_allocates_nothing(tmp_path, build):
    """The C needs functions of libm alone, and the library of the FMU nothing at all: there is no malloc that they could call."""
    component = estimator(write(tmp_path, recording(1, count=20)[0])).component
    library.export(component, "estimator", tmp_path / "c", build, ("x86_64-linux",), force=True)
    path = tmp_path / "c" / "x86_64-linux" / "libestimator.a"
    assert nm("-u", path) <= MATHEMATICS
    assert "estimator_step" in nm("--defined-only", path)
    exporter.export(component, "3.0", tmp_path / "estimator.fmu", build)
    archive = zipfile.ZipFile(tmp_path / "estimator.fmu")
    (name,) = (name for name in archive.namelist() if "x86_64-linux/" in name and name.endswith(".so"))
    assert nm("-D", "-u", archive.extract(name, tmp_path)) <= MATHEMATICS


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["tests.follow.parts:Sampler", "em_tracker"])
def test_a_system_with_a_slow_member_and_a_negative_delay(tmp_path, build, sensor):
    """The tracker adds noise by its random seed."""
    scenario, sampled = SCENARIO.replace("tests.follow.parts:Sampler", sensor), SAMPLED
    if sensor == "em_tracker":
        scenario = scenario.replace("sampler.u", "sampler.position").replace("step: 10 ms", "step: 5 ms")
        sampled = sampled.replace("sampler.y", "sampler.measured_position")
    (tmp_path / "system.yaml").write_text(scenario)
    problem = load(path := write(tmp_path, recording(2, count=40)[0], f"scenario: system.yaml\n{sampled}"))
    arrivals = Arrivals(problem)
    assert arrivals.lag == 0 > arrivals.delays[0]
    found, wanted = arrivals.expected(build, interpreted(estimator(path).component, arrivals))
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-12)


CONTROLLED = """
stop_time: 8 s
step: 10 ms
members:
  plant: {component: "tests.follow.parts:VanDerPol", parameters: {mu: 1.7 1/s}}
  estimator: {component: estimator.fmu, parameters: {interval: 1}}
  damper: {component: "tests.follow.parts:Damper"}
connections:
  - plant.y -> estimator.measured.VanDerPol.y
  - estimator.estimate.VanDerPol.v -> damper.v
  - damper.u -> plant.u, estimator.VanDerPol.u
record: {every: 10 ms, variables: ["*.*"]}
"""


@pytest.mark.slow
def test_an_estimator_beside_a_controller_that_uses_it(tmp_path, build):
    """The controller damps with the estimated velocity; following the run afterwards gives the same estimates."""
    path = write(tmp_path, recording(1, count=20)[0])
    exporter.export(estimator(path).component, "3.0", tmp_path / "estimator.fmu", build)
    (tmp_path / "rig.yaml").write_text(CONTROLLED)
    run = twin.run(tmp_path / "rig.yaml", report=False, out=tmp_path / "runs", build=build)
    free = twin.run(
        tmp_path / "rig.yaml", values={"damper.gain": 0.0}, report=False, out=tmp_path / "runs", build=build
    )
    amplitude, free_amplitude = (np.ptp(each["plant.y"].values.ravel()[-300:]) for each in (run, free))
    assert amplitude < 0.2 < 1.0 < free_amplitude
    assert run["estimator.estimate.VanDerPol.mu"].values.ravel()[-1] == pytest.approx(1.7, abs=0.01)
    columns = [run["damper.u"].values.ravel(), 1e3 * run["plant.y"].values.ravel()]
    problem = load(write(tmp_path, np.column_stack([np.arange(len(columns[0])) * 0.01, *columns])))
    names = [f"estimator.{name}" for name in Arrivals(problem).names()]
    rows = np.column_stack([run[name].values.ravel() for name in names])[1:]
    found, wanted = Arrivals(problem).expected(build, rows)
    assert found == pytest.approx(wanted, rel=1e-5, abs=1e-7)  # the file has 9 digits


def refused(folder, text):
    with pytest.raises(ScenarioError) as error:
        estimator(write(folder, recording(1, count=3)[0], text))
    (line,) = error.value.problems
    return line


def test_what_cannot_be_exported_is_refused_in_one_line(tmp_path):
    assert "method ensemble cannot be exported" in refused(tmp_path, f"{VAN_DER_POL}method: ensemble\n")
    (tmp_path / "system.yaml").write_text(SCENARIO + "algorithm: gauss_seidel\n")
    assert "Use algorithm: jacobi without options" in refused(tmp_path, f"scenario: system.yaml\n{SAMPLED}")
    (tmp_path / "system.yaml").write_text(SCENARIO + "events: [{at: 1 s, set: {oscillator.mu: 2 1/s}}]\n")
    assert "sets oscillator.mu at a time" in refused(tmp_path, f"scenario: system.yaml\n{SAMPLED}")
    (tmp_path / "force.csv").write_text("time [s],force [m/s2]\n0,0\n30,1\n")
    table = SCENARIO.replace(
        "connections: [", "  table: {component: force.csv}\nconnections: [table.force -> oscillator.u, "
    )
    (tmp_path / "system.yaml").write_text(table)
    undriven = SAMPLED.replace('inputs: {"force [m/s2]": oscillator.u}\n', "")
    assert "table is Python-side and cannot be compiled" in refused(tmp_path, f"scenario: system.yaml\n{undriven}")


@pytest.mark.slow
def test_a_model_that_is_an_fmu_is_refused(tmp_path):
    foreign(tmp_path, "3.0")
    text = VAN_DER_POL.replace('"tests.follow.parts:VanDerPol"', "Oscillator.fmu").replace("VanDerPol", "Oscillator")
    states = re.compile(r"  Oscillator\.[xv].*\n")
    assert "Oscillator is an FMU and cannot be compiled into" in refused(tmp_path, states.sub("", text))


def test_options_of_a_part_of_a_scenario_are_refused(tmp_path):
    path = str(write(tmp_path, recording(1, count=3)[0]))
    for options, words in ((["--members", "a"], "Drop --members, --group and --variant"), (["--ssp"], "Drop --ssp")):
        result = CliRunner().invoke(command, [path, *options])
        assert isinstance(result.exception, TwinError)
        assert words in str(result.exception)


def test_another_interval_and_what_is_left_out_are_noted(tmp_path):
    rows = recording(1, count=6)[0]
    del rows[3]
    text = f"{VAN_DER_POL}changes: {{more damping: {{set: {{VanDerPol.mu: x2}}}}}}\n"
    exported = estimator(write(tmp_path, rows, text))
    changes, interval = exported.notes
    assert changes == "`changes`: the estimator looks for no changes."
    assert "The estimator expects 5 communication steps" in interval
    variables = {one.name: one for one in exported.component.variables}
    assert (variables["interval"].start, variables["interval"].maximum) == (5, 10)
    assert {"VanDerPol.u", "measured.VanDerPol.y", "valid.VanDerPol.y", "VanDerPol.side"} <= set(variables)
    assert "VanDerPol.mu" not in variables
