"""Several recordings in one fit: what they have in common is one value, what is of one of them is its own."""

import re

import numpy as np
import pytest

from tests.study.recordings import identify_file, recorded
from twin.errors import ScenarioError
from twin.identify import html, identify, load
from twin.identify.model import Model

SHARED = """
component: sheath
inputs: {"gripper [mm]": sheath.gripper_position}
outputs: {"tip [mm]": {signal: sheath.tip_position, offset: {from: -2 mm, to: 2 mm}}}
fit: {"sheath.play[2]": {from: 0 mm, to: 1.5 mm}}
"""
TWO = (
    SHARED
    + """
recordings:
  slow: {data: [slow/gripper.csv, slow/tip.csv]}
  fast: {data: [fast/gripper.csv, {file: fast/tip.csv, start: 5 ms}], to: 3 s}
"""
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, build):
    """One sheath in two chirps; its valve was tightened between, and the tracker's zero was not the same."""
    folder = tmp_path_factory.mktemp("several")
    for name, rate, friction, zero, late in (("slow", 2.0, 0.6, 0.5, 0.0), ("fast", 6.0, 1.2, -0.8, 5e-3)):
        (folder / name).mkdir()
        own = f"chirp.frequency_final={rate} Hz", f"sheath.friction=[{friction} N, 0.8 N, 0.8 N]"
        recorded(folder / name, build, *own, "sheath.play=[0 mm, 0.7 mm, 0.3 mm]", seed=int(rate), late=late)
        table = np.loadtxt(folder / name / "tip.csv", delimiter=",", skiprows=1)
        table[:, 1] += zero
        np.savetxt(folder / name / "tip.csv", table, "%.17g", ",", header="time [ms],tip [mm]", comments="")
    return folder


def found(folder, build, text, **options):
    return identify(load(identify_file(folder, text)), build=build, **{"starts": 1, "seed": 1, **options})


VALVE = """
recordings:
  slow: {data: [slow/gripper.csv, slow/tip.csv]}
  fast:
    data: [fast/gripper.csv, {file: fast/tip.csv, start: 5 ms}]
    fit: {"sheath.friction[1]": {from: 0 N, to: 3 N}}
"""


@pytest.mark.slow
def test_what_is_common_is_found_from_all_and_what_is_not_by_itself(folder, build):
    result = found(folder, build, SHARED + VALVE)
    names = [one.name for one in result.problem.unknowns]
    assert names == [
        "sheath.play[2]",
        "sheath.friction[1] in fast",
        "offset of tip [mm] in slow",
        "offset of tip [mm] in fast",
    ]
    for value, (low, high) in zip((0.7e-3, 1.2, 0.5e-3, -0.8e-3), result.intervals, strict=True):
        assert low < value < high
    assert result.passed
    assert result.parameter_set() == {"sheath": {"play[2]": result.values[0]}}  # the valve is that of one day
    assert [one["column"] for one in result.identified()["residuals"]] == ["tip [mm] in slow", "tip [mm] in fast"]
    assert len(result.identified()["files"]) == 4
    assert "tip [mm] in fast" in html(result)


@pytest.mark.slow
def test_two_recordings_tell_more_than_either(folder, build):
    def width(text):
        (low, high), *_ = found(folder, build, text).intervals
        return high - low

    data = "data: [slow/gripper.csv, slow/tip.csv]"
    halves = "to: 2 s", "from: 2 s"
    alone = [width(f"{SHARED}{data}\n{half}\n") for half in halves]
    both = width(
        SHARED + "recordings:\n" + "".join(f"  {half.replace(': ', ' ')}: {{{data}, {half}}}\n" for half in halves)
    )
    assert both < 0.9 * min(alone)


@pytest.mark.slow
def test_a_single_recording_is_the_file_without_a_name(folder, build):
    plain = found(folder, build, SHARED + "data: [slow/gripper.csv, slow/tip.csv]\n")
    named = found(folder, build, SHARED + "recordings: {slow: {data: [slow/gripper.csv, slow/tip.csv]}}\n")
    assert np.array(named.values).tobytes() == np.array(plain.values).tobytes()
    assert named.problem.model == plain.problem.model


def test_a_recording_has_its_own_model_start_values_and_outputs(folder, build):
    text = TWO.replace("slow: {", "slow: {set: {sheath.gripper_position: 1 mm}, ").replace(
        "to: 3 s", 'to: 3 s, outputs: {"tip [mm]": {signal: sheath.tip_position, delay: {from: -20 ms, to: 20 ms}}}'
    )
    problem = load(identify_file(folder, text))
    slow, fast = problem.recordings
    assert slow.case.members["sheath"].parameters["gripper_position"] == "1 mm"
    assert "gripper_position" not in fast.case.members["sheath"].parameters
    assert (slow.case.stop_ns, fast.case.stop_ns) == (4_000_000_000, 3_020_000_000)  # the delay may be 20 ms ahead
    assert [one.name for one in problem.unknowns][1:] == ["offset of tip [mm] in slow", "delay of tip [mm] in fast"]
    with Model(problem, build) as model:
        places = np.array([one.position(one.start) for one in problem.unknowns])
        model.predicted(places)
        assert model.count == 2
        places[1:] = 0.4
        model.predicted(places)
        assert model.count == 2  # offsets and delays need no simulation


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("to: 3 s}", "too: 3 s}", r"identify\.yaml:9: recordings\.fast: unknown key `too`\. Did you mean `to`"),
        (
            "fast/tip.csv",
            "fast/tap.csv",
            r"identify\.yaml:9: data\[2\]: there is no file fast/tap\.csv\. Did you mean 'tip\.csv'",
        ),
        (
            "[slow/gripper.csv, slow/tip.csv]",
            "slow/gripper.csv",
            r"outputs\.tip \[mm\]: no file has this column of slow",
        ),
        ("data: [slow/gripper.csv, slow/tip.csv]", "to: 3 s", r"identify\.yaml:8: `data` is missing"),
        ("to: 3 s", "from: 7 s", r"outputs\.tip \[mm\]: no value lies between 7 s and 4 s of the run of fast"),
        (
            "to: 3 s",
            "fit: {sheath.plai: {from: 0 mm, to: 1 mm}}",
            r"identify\.yaml:9: fit\.sheath\.plai: .*has no variable 'plai'",
        ),
        ("{data: [slow/gripper.csv, slow/tip.csv]}", "5", r"identify\.yaml:8: recordings\.slow: "),
    ],
)
def test_a_mistake_in_a_recording_is_told_with_its_line(folder, old, new, message):
    assert old in TWO
    with pytest.raises(ScenarioError) as caught:
        load(identify_file(folder, TWO.replace(old, new, 1)))
    assert any(re.search(message, one) for one in caught.value.problems), caught.value.problems
