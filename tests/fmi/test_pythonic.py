"""FMUs that need Python: honest about it, valid, and the same values as the component they are made from."""

from types import SimpleNamespace

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from twin import fmi
from twin.component import Component, catalog, output
from twin.errors import BuildError, FMUError
from twin.fmi import FMUMember
from twin.fmi.exporting import exporter, pythonfmu_export, pythonfmu_slave
from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, parse_scenario

PUCK = "tests.run.pymunk_parts:Puck"
VERSIONS = ["2.0", "3.0"]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", ["chain", PUCK])
def test_valid_and_honest(name, version, tmp_path):
    path = pythonfmu_export.export(catalog.component(name), version, tmp_path / "a.fmu")
    assert validate_fmu(str(path)) == []
    description = read_model_description(str(path))
    assert description.coSimulation.needsExecutionTool
    assert not description.coSimulation.canGetAndSetFMUstate
    assert description.modelExchange is None
    with pytest.raises(FMUError, match="Model Exchange is needed"):
        fmi.member("a", path, interface="model_exchange")
    assert description.description.endswith("Needs Python with catheter-twin.")
    assert {one.name for one in description.modelVariables} >= {
        v.name for v in catalog.component(name).variables if not v.shape
    }
    member = FMUMember("a", path)
    assert member.notes == ["needs the tool it was made with on this machine"]
    member.close()


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("name", "quiet", "command"),
    [
        ("chain", "chirp.position -> a.gripper_position", "members: {chirp: {component: chirp}, a: {component: WHAT}}"),
        (PUCK, "f.measured_force -> a.force", "members: {f: {component: force_sensor}, a: {component: WHAT}}"),
    ],
)
def test_the_same_bits(name, quiet, command, version, tmp_path, build):
    path = pythonfmu_export.export(catalog.component(name), version, tmp_path / "a.fmu")
    tables = []
    for what in (name, path):
        text = f"stop_time: 40 ms\nstep: 1 ms\n{command.replace('WHAT', repr(str(what)))}\nconnections: [{quiet}]\nrecord: {{variables: ['a.*']}}\n"
        outcome = run_scenario(
            parse_scenario(text, tmp_path / "s.yaml"),
            RunOptions(backend=Backend.fmu, root=tmp_path / "runs", build=build, report=False),
        )
        assert outcome.run.status == "completed", outcome.run.reason
        tables.append(next(iter(outcome.tables.values())).values)
    direct, through = tables
    outputs = [f"a.{v.name}" for v in catalog.component(name).variables if str(v.role) == "output" and not v.shape]
    assert outputs
    for one in outputs:
        assert len(direct[one]) == 41
        assert np.array_equal(direct[one], through[one]), one
    assert any(np.ptp(direct[one]) > 0 for one in outputs)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("version", VERSIONS)
def test_fmpy_runs_it(version, tmp_path):
    path = pythonfmu_export.export(catalog.component("chain"), version, tmp_path / "a.fmu")
    found = simulate_fmu(
        str(path), stop_time=0.02, step_size=1e-3, start_values={"gripper_position": 1e-3}, output=["tip_position"]
    )
    assert np.isfinite(found["tip_position"]).all()
    assert found["tip_position"][-1] > 0


def test_what_needs_no_python_is_refused():
    with pytest.raises(BuildError, match="needs no Python in its FMU"):
        pythonfmu_export.export(catalog.component("wall"), "3.0", None)
    with pytest.raises(BuildError, match="--needs-python"):
        exporter.plan(catalog.component("chain"), "3.0")


def test_a_component_that_nobody_finds(tmp_path):
    from twin.component import PythonComponent

    class Here(PythonComponent):
        """Here."""

        y = output("m", "it")

        def step(self, t, h):
            self.y = t

    assert issubclass(Here, Component)
    with pytest.raises(BuildError, match="module of its own"):
        pythonfmu_export.export(Here, "3.0", tmp_path / "a.fmu")


@pytest.mark.parametrize(
    ("name", "element", "before", "given", "after"),
    [
        ("scalar", None, 1.5, 2.5, 2.5),
        ("scalar", 0, 1.5, 2.5, 2.5),
        ("table", None, [1, 2, 3, 4], [5, 6, 7, 8], [[5, 6], [7, 8]]),
        ("table", 2, 3, 9, [[1, 2], [9, 4]]),
    ],
)
def test_values_by_elements_and_whole(name, element, before, given, after):
    """FMI 3.0 has whole arrays, flat; FMI 2.0 elements by their number."""
    values = {"scalar": 1.5, "table": np.array([[1, 2], [3, 4]])}
    member = SimpleNamespace(get=values.get, set=values.__setitem__)
    assert pythonfmu_slave.read(member, name, element) == before
    pythonfmu_slave.write(member, name, element, given)
    assert np.asarray(values[name]).tolist() == after
