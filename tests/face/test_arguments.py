"""What a notebook may pass: a mistake is one line that says what is expected, never a traceback of the engine."""

import json

import numpy as np
import pytest
from scipy.io import loadmat

import twin
from tests.viewer.recorded import FORCE, PLACE, SHAPE, folder_of, wave
from twin.errors import ScenarioError, TwinError, UnknownNameError
from twin.face import conversions
from twin.results import compare_runs


@pytest.fixture
def recorded(tmp_path):
    time, force = wave(100.0, 0.5)
    values = {"sensor.force": force, "tip.position": 2.0 * force, "tip.shape": np.outer(force, [1.0, 2.0])}
    return twin.open_run(folder_of(tmp_path / "run", {("PI", 1): (time, values)}, [FORCE, PLACE, SHAPE]))


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: twin.run(None), "scenario: None is not a path"),
        (lambda: twin.run("racs", values="heart.rate=1"), "is not a mapping from names to values"),
        (lambda: twin.run("racs", seeds="x"), "seeds: 'x' is not a whole number"),
        (lambda: twin.run("racs", seeds=[1, 1.5]), "seeds: 1.5 is not a whole number"),
        (lambda: twin.load("racs").simulate(seed=True), "seed: True is not a whole number"),
        (lambda: twin.simulate(3), "fmu: 3 is not a path"),
        (lambda: twin.export(3), "what: 3 is not a path"),
    ],
)
def test_arguments_of_another_kind(call, text):
    with pytest.raises(TwinError) as caught:
        call()
    assert text in str(caught.value)
    assert len(caught.value.problems) == 1


def test_seeds_may_be_any_integers():
    for value in (range(1, 3), np.arange(1, 3), (np.int64(1), 2), {1: 0, 2: 0}):
        assert conversions.integers(value, "seeds") == [1, 2]
        assert all(type(number) is int for number in conversions.integers(value, "seeds"))
    assert conversions.integers(None, "seeds") == []
    assert conversions.integers(np.int64(3), "seeds") == [3]


def test_a_missing_file_names_similar_ones(tmp_path):
    for name in ("rig.yaml", "pump.fmu"):
        (tmp_path / name).touch()
    for call, error, similar in (
        (lambda: twin.load(tmp_path / "rgi.yaml"), ScenarioError, "rig.yaml"),
        (lambda: twin.follow(tmp_path / "rgi.yaml"), ScenarioError, "rig.yaml"),
        (lambda: twin.simulate(tmp_path / "pmup.fmu"), TwinError, "pump.fmu"),
    ):
        with pytest.raises(error) as caught:
            call()
        assert f"is not there. Looked in {tmp_path}. Did you mean '{similar}'?" in str(caught.value)
    for call, name in ((twin.load, "heart_wall_force"), (twin.study, "thousand_patients")):
        with pytest.raises(ScenarioError, match=f"is not there.*of this name elsewhere: give the name alone, {name}"):
            call(tmp_path / "scenarios" / f"{name}.yaml")
    with pytest.raises(ScenarioError, match="there is no folder"):
        twin.load(tmp_path / "none" / "rig.yaml")


def test_several_signals_are_a_dataset(recorded):
    chosen = recorded[["sensor.force", "tip.shape"]]
    assert list(chosen.data_vars) == ["sensor.force", "tip.shape"]
    assert chosen["sensor.force"].attrs["units"] == "N"
    for name in (3, ("sensor.force", "PI"), None):
        with pytest.raises(UnknownNameError, match="is not the name of a signal"):
            recorded[name]
    with pytest.raises(UnknownNameError, match=r"Did you mean 'sensor\.force'"):
        recorded[["sensor.forc"]]
    assert twin.Run(str(recorded.folder)).variants == ("PI",)


def test_names_patterns_and_lists_are_taken_everywhere(recorded):
    assert list(recorded["tip.*"].data_vars) == ["tip.position", "tip.shape"]
    assert list(recorded[["tip.s*", "sensor.force"]].data_vars) == ["tip.shape", "sensor.force"]
    columns = ["variant", "seed", "time"]
    assert list(recorded.to_dataframe(["sensor.*", "tip.shape[2]"])) == [*columns, "sensor.force", "tip.shape[2]"]
    assert len(recorded.plot(["sensor.force", "tip.position"], interactive=False).axes) == 2
    assert len(recorded.plot("sensor.force", ["tip.*"], interactive=False).axes) == 2
    assert recorded.compare(recorded, ["tip.s*"]).signals["signal"].tolist() == ["tip.shape"]
    with pytest.raises(TwinError, match=r"'tip\.z\*': not recorded in either run"):
        recorded.compare(recorded, "tip.z*")


@pytest.mark.parametrize("index", ["4", "0", "-1", "x"])
def test_an_element_that_an_array_does_not_have(recorded, index):
    for text in (f"tip.shape[{index}]", [f"tip.shape[{index}]"]):
        with pytest.raises(UnknownNameError, match=r"tip\.shape has 2 elements, from 1 to 2\.$"):
            recorded[text]
    with pytest.raises(UnknownNameError, match=r"sensor\.force is a single value\.$"):
        recorded[f"sensor.force[{index}]"]
    with pytest.raises(UnknownNameError, match=r"has 2 elements|counted from 1"):
        recorded[f"2 * tip.shape[{index}]"]


def test_signals_are_exported(recorded, tmp_path):
    assert recorded.export(tmp_path / "a.mat", "tip.*") == tmp_path / "a.mat"
    cases = loadmat(tmp_path / "a.mat", simplify_cells=True)["cases"]
    np.testing.assert_array_equal(cases["signals"]["tip_position"], recorded["tip.position"].values.ravel())
    recorded.export(str(tmp_path / "a.csv"))
    assert "sensor.force [N]" in (tmp_path / "a.csv").read_text().splitlines()[0]
    for path, text in (("a.parquet", "signals.parquet"), ("none/a.csv", "there is no folder"), ("a.cvs", r"'\.csv'")):
        with pytest.raises(TwinError, match=text):
            recorded.export(tmp_path / path)
    with pytest.raises(UnknownNameError, match=r"Did you mean 'tip\.position'"):
        recorded.export(tmp_path / "a.csv", "tip.positon")


def test_two_runs_are_compared(recorded, tmp_path):
    time, force = wave(100.0, 0.5)
    values = {"sensor.force": 1.01 * force, "tip.position": 2.0 * force, "tip.shape": np.outer(force, [1.0, 2.0])}
    other = folder_of(tmp_path / "other", {("PI", 1): (time, values)}, [FORCE, PLACE, SHAPE])
    assert recorded.compare(recorded).agrees
    comparison = recorded.compare(other)
    assert [signal.name for signal in comparison.differing] == ["sensor.force"]
    assert comparison.differing[0].text.endswith(" N")
    assert repr(comparison).startswith("<Comparison: The runs differ: 1 of 3 signals")
    assert recorded.compare(other, "tip.*").agrees
    assert recorded.compare(other, "sensor.*", tolerance=0.02).agrees


def test_a_difference_is_in_the_unit_of_the_metrics(recorded, tmp_path):
    """As in the report: mN if a metric of the scenario is in mN."""
    time, force = wave(100.0, 0.5)
    other = folder_of(tmp_path / "other", {("PI", 1): (time, {"sensor.force": 1.01 * force})}, [FORCE])
    metric = {"unit": "mN", "variants": {}}
    summaries = [json.loads((folder / "summary.json").read_text()) for folder in (recorded.folder, other)]
    changed = tuple({**summary, "metrics": {"peak": metric}} for summary in summaries)
    (difference,) = compare_runs((recorded.folder, other), changed, 0.0, ["sensor.*"]).differences
    assert difference.text.endswith(" mN")


def test_a_branch_needs_values_by_name(recorded):
    with pytest.raises(TwinError, match="is not a mapping"):
        recorded.branch("1 s", "x")
