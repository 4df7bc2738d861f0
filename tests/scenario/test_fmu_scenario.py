"""An FMU where a scenario may stand."""

import pytest

from twin.component import catalog
from twin.errors import ScenarioError
from twin.fmi.exporting import exporter
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario


@pytest.mark.slow
def test_an_fmu_is_a_scenario_of_one_member(tmp_path, build):
    path = exporter.export(catalog.component("heart"), "3.0", tmp_path / "1 heart.fmu", build)
    scenario = load_scenario(path, ["stop_time=20 ms", "_1_heart.rate=1.2 Hz"])
    result = run_scenario(scenario, RunOptions(root=tmp_path / "runs", build=build, report=False))
    assert result.passed
    (signals,) = result.tables.values()
    assert "_1_heart.position" in signals.values
    assert signals.time[-1] == 0.02
    assert load_scenario(result.folder / "scenario.yaml").variants[0].members == scenario.variants[0].members


def test_a_file_that_is_no_fmu_is_told(tmp_path):
    path = tmp_path / "not.fmu"
    path.write_text("nothing")
    with pytest.raises(ScenarioError, match=r"not\.fmu: "):
        load_scenario(path)
