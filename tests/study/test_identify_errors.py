"""Every mistake in an identify file or a recording is told, all at once, with file and line."""

import re

import numpy as np
import pytest

from tests.study.recordings import FILE, MODEL, identify_file, recorded
from twin.errors import ScenarioError
from twin.identify import identify, load, read_estimate


@pytest.fixture(scope="module")
def recordings(tmp_path_factory, build):
    folder = tmp_path_factory.mktemp("recordings")
    recorded(folder, build)
    (folder / "model.yaml").write_text(MODEL + "variants: {slow: {}, fast: {}}\n")
    return folder


def problems(folder, text):
    with pytest.raises(ScenarioError) as caught:
        load(identify_file(folder, text))
    return [one.removeprefix(f"{folder}/") for one in caught.value.problems]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("component: sheath", "component: sheeth", r"identify\.yaml:2: component: There is no component 'sheeth' in \S*fmus or the project's\. Did"),
        ("component: sheath", "scenario: none.yaml", r"identify\.yaml:2: scenario: there is no file none\.yaml"),
        ("component: sheath", "scenario: model.yaml", r"identify\.yaml:2: scenario: has variants\. Add one, such as variant: slow"),
        ("component: sheath", "scenario: model.yaml\nvariant: fats", r"identify\.yaml:3: variant: there is no variant `fats`\. Did"),
        ("component: sheath\n", "", r"`scenario` or `component`: is missing"),
        ("component: sheath", "component: sheath\nfitt: {}", r"identify\.yaml:3: unknown key `fitt`\. Did you mean `fit`\?"),
        ("tip.csv]", "tipp.csv]", r"identify\.yaml:3: data\[2\]: there is no file tipp\.csv\. Did you mean 'tip\.csv'"),
        ('"tip [mm]"', '"tap [mm]"', r"identify\.yaml:5: outputs\.tap \[mm\]: no file has this column\. Did you mean `tip \[mm\]`"),
        ("sheath.tip_position", "sheath.tip_velocity", r"identify\.yaml:5: outputs\.tip \[mm\]: is in mm, sheath\.tip_velocity in m/s"),
        ("sheath.tip_position", "sheath.tip", r"identify\.yaml:5: outputs\.tip \[mm\]: 'sheath\.tip': sheath has no variable 'tip'"),
        ("sheath.tip_position", "sheath.position", r"sheath\.position is an array\. Name one element, such as sheath\.position\[1\]"),
        ("sheath.gripper_position", "sheath.drag", r"inputs\.gripper \[mm\]: .*Name an input"),
        ("sheath.play[2]", "sheath.plai[2]", r"identify\.yaml:6: fit\.sheath\.plai\[2\]: .*has no variable 'plai\[2\]'\. .* play,"),
        ("sheath.play[2]", "sheath.tip_position", r"identify\.yaml:6: fit\.sheath\.tip_position: is output, no parameter"),
        ("from: 0 mm, ", "", r"identify\.yaml:6: fit\.sheath\.play\[2\]: `from` is missing"),
        ("from: 0 mm", "from: 2 mm", r"from 2 mm is not below to 1\.5 mm\. Swap them"),
        ("from: 0 mm", "from: -1 mm", r"identify\.yaml:6: fit\.sheath\.play\[2\]: -1 mm is below the minimum"),
        ("from: 0 mm", "from: 0 N", r"identify\.yaml:6: fit\.sheath\.play\[2\]\.from: .*does not convert to m"),
        ("to: 1.5 mm", "to: 1.5 mm, scale: log", r"scale: log needs it"),
        ("to: 1.5 mm", "to: 1.5 mm, start: 2 mm", r"start 2 mm is outside of 0 mm to 1\.5 mm"),
        ("fit:", "set: {sheath.drg: 6}\nfit:", r"has no variable `drg`"),
        ("fit:", "from: 9 s\nfit:", r"identify\.yaml:5: outputs\.tip \[mm\]: no value lies between 9 s and 4 s of the run"),
        ("fit:", "confidence: 12 %\nfit:", r"identify\.yaml:6: confidence: expected a probability from 50 %"),
        ("sheath.tip_position", "{signal: sheath.tip_position, noise: -1 mm}", r"noise: -1 mm is not above zero"),
        ("sheath.tip_position", "{signal: sheath.tip_position, delay: 3 mm}", r"delay: .*does not convert to s"),
        ("loss", "loss", None),
    ],
)  # fmt: skip
def test_a_mistake_in_the_file(recordings, old, new, message):
    if message is None:
        (text,) = problems(recordings, FILE + "loss: hubber\n")
        assert "Did you mean `huber`" in text
        return
    found = problems(recordings, FILE.replace(old, new, 1))
    assert any(re.search(message, one) for one in found), found


def test_all_mistakes_are_told_at_once(recordings):
    text = FILE.replace("tip.csv", "tap.csv").replace("from: 0 mm, ", "").replace("gripper_position", "griper")
    found = problems(recordings, text)
    assert len(found) == 3
    assert found == sorted(found, key=lambda one: int(one.split(":")[1]))


def test_what_has_no_influence_is_told(recordings):
    text = FILE.replace("component: sheath", "scenario: model.yaml\nvariant: slow").replace(
        "sheath.gripper_position", "chirp.position"
    )
    (found,) = problems(recordings, text.replace("fit: {", "fit: {chirp.amplitude: {from: 1 mm, to: 9 mm}, "))
    assert "fit.chirp.amplitude: chirp has no influence on sheath.tip_position" in found


def test_two_members_of_one_component_have_one_value(recordings):
    (recordings / "two.yaml").write_text(MODEL.replace("  sheath:", "  other: {component: sheath}\n  sheath:"))
    text = FILE.replace("component: sheath", "scenario: two.yaml").replace("sheath.gripper_position", "chirp.position")
    assert any("holds for other, too" in one for one in load(identify_file(recordings, text)).notes)
    both = text.replace("fit: {", 'fit: {"other.play[2]": {from: 0 mm, to: 1 mm}, ')
    assert "a parameter set has one value for both" in problems(recordings, both)[0]


@pytest.mark.parametrize(
    ("line", "content", "message"),
    [
        (4, "75,nan", r"tip\.csv:4: tip \[mm\] is nan, expected a finite number"),
        (4, "75,", r"tip\.csv:4: tip \[mm\] is '', expected a number"),
        (4, "75", r"tip\.csv:4: tip \[mm\] is '', expected a number"),
        (4, "20,0.1", r"tip\.csv:4: time is before that of the row above\. Sort the rows"),
        (4, "25,0.1", r"tip\.csv:4: time is the same as the row above"),
        (1, "time [mm],tip [mm]", r"tip\.csv: time \[mm\] is no time"),
        (1, "when,tip [mm]", r"tip\.csv: has no column `time`\. Say which one it is, such as time: 'when'"),
        (1, "time [ms],tip [N]", r"outputs\.tip \[mm\]: no file has this column"),
        (1, "time [ms],tip [mm],tip [mm]", r"tip\.csv:1: column tip \[mm\] is there twice"),
    ],
)
def test_a_mistake_in_a_recording(tmp_path, recordings, line, content, message):
    lines = (recordings / "tip.csv").read_text().splitlines()
    lines[line - 1] = content
    (tmp_path / "tip.csv").write_text("\n".join(lines))
    (tmp_path / "gripper.csv").write_text((recordings / "gripper.csv").read_text())
    assert any(re.search(message, one) for one in problems(tmp_path, FILE))


def test_a_gap_of_an_input_is_told_and_may_be_allowed(tmp_path, recordings):
    lines = (recordings / "gripper.csv").read_text().splitlines()
    (tmp_path / "gripper.csv").write_text("\n".join(lines[:1000] + lines[1100:]))
    (tmp_path / "tip.csv").write_text((recordings / "tip.csv").read_text())
    (text,) = problems(tmp_path, FILE)
    assert text.endswith(
        "gripper.csv:1001: gripper [mm] has no values for 0.101 s before this row. "
        "Choose from and to without the gap, or allow it: gap: 0.101 s."
    )
    load(identify_file(tmp_path, FILE.replace("[gripper.csv", "[{file: gripper.csv, gap: 0.101 s}")))


def test_a_model_that_fails_everywhere_is_told(recordings, build):
    text = FILE.replace("fit: {", "set: {sheath.drag: 1.2}\nstep: 10 ms\nfit: {").replace(
        '"sheath.play[2]": {from: 0 mm, to: 1.5 mm}', '"sheath.stiffness[2]": {from: 1e9 N/m, to: 1e10 N/m}'
    )
    with np.errstate(all="ignore"), pytest.raises(Exception, match="the model fails wherever it was tried"):
        identify(load(identify_file(recordings, text)), starts=2, build=build)


def test_no_file_of_an_identification(tmp_path):
    (tmp_path / "p.yaml").write_text("sheath: {play: 0.1}\n")
    with pytest.raises(ScenarioError, match="has no `identified`"):
        read_estimate(tmp_path / "p.yaml")
    (tmp_path / "p.yaml").write_text(
        "identified: {unknowns: [a], values: [1, 2], units: [m], bounds: [], covariance: []}\n"
    )
    with pytest.raises(ScenarioError, match="is damaged"):
        read_estimate(tmp_path / "p.yaml")
