"""What is kept of a checked scenario is what checking it gives, and counts only while nothing has changed."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.fmi.third_party import native_fmu
from twin.errors import ScenarioError
from twin.scenario import checked, displayed, kept, load_scenario, look_up

SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").glob("*.yaml"))
TEXT = """
stop_time: 1 s
members: {heart: {component: heart, parameters: {rate: 72 /min}}, sheath: {component: sheath}}
connections: [heart.position -> sheath.gripper_position]
variants: {slow: {members: {heart: {parameters: {rate: 0.9 Hz}}}}, soft: {events: [{at: 0.5 s, set: {heart.rate: 1 Hz}}]}}
metrics: {reach: {signal: 'abs(heart.position) - sheath.position[2]', reduce: max, paper: {slow: 4 mm}, unit: mm}}
expect: [{signal: heart.position, within: [-20 mm, 20 mm]}]
plots: [{title: Both, signals: [heart.position, {signal: sheath.tip_position, label: tip}], lines: 1 mm, from: 0.2 s}]
"""


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "one.yaml"
    path.write_text(TEXT)
    return path


@pytest.fixture
def sealed(monkeypatch):
    """From here on nothing may be checked anew."""

    def seal():
        def refuse(*_):
            raise AssertionError("checked anew")

        monkeypatch.setattr("twin.scenario.load.load_scenario", refuse)

    return seal


def same(one, other):
    (ours, catalogs), (theirs, others) = one, other
    assert ours == theirs
    assert ours.frozen() == theirs.frozen()
    assert [case.members for case in ours.variants] == [case.members for case in theirs.variants]
    for variant, members in others.items():
        for name, variables in members.items():
            assert list(catalogs[variant][name]) == list(variables)
            for key, variable in variables.items():
                np.testing.assert_equal(catalogs[variant][name][key].start, variable.start)
                assert catalogs[variant][name][key].dtype == variable.dtype
            assert ours.cases([variant], [5])[0].values(name, catalogs[variant][name]).keys() == (
                theirs.cases([variant], [5])[0].values(name, variables).keys()
            )


def test_what_is_kept_is_what_was_checked(scenario, tmp_path, sealed):
    before = load_scenario(scenario)
    catalogs, problems = look_up(before)
    assert not problems
    first = checked(scenario, (), tmp_path / "build")
    same(first, (displayed(before, catalogs), catalogs))
    sealed()
    same(checked(scenario, (), tmp_path / "build"), first)


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_every_scenario(path, tmp_path):
    if path.stem == "drive_faults":
        pytest.skip("needs hardware")
    first = checked(path, (), tmp_path)
    if list(tmp_path.rglob("*.json")):
        same(kept.find(next(tmp_path.rglob("*.json"))), first)


def test_numbers_keep_their_bits(tmp_path):
    values = (0.1 + 0.2, np.float64(1e-310), np.array([[1.5, float("inf")], [-0.0, float("nan")]]), np.int64(7),
              (1, None, True), np.array([b"\0x", b""], object), np.array(["a"], object))  # fmt: skip
    found = kept.decoded(json.loads(json.dumps(kept.encoded(values))))
    assert repr(found) == repr(values)


@pytest.mark.parametrize("what", ["file", "extended", "option", "folder"])
def test_what_changed_is_checked_anew(scenario, tmp_path, sealed, what, monkeypatch):
    base = scenario
    if what == "extended":
        scenario = tmp_path / "two.yaml"
        scenario.write_text(f"extends: {base.name}\n")
    checked(scenario, (), tmp_path / "build")
    sealed()
    options = ("stop_time=2 s",) if what == "option" else ()
    if what in ("file", "extended"):
        base.write_text(TEXT.replace("72 /min", "71 /min"))
    if what == "folder":
        monkeypatch.chdir(tmp_path)
    with pytest.raises(AssertionError, match="anew"):
        checked(scenario, options, tmp_path / "build")


def test_a_component_that_changed(tmp_path, monkeypatch):
    (tmp_path / "own_part.py").write_text(PART)
    (tmp_path / "one.yaml").write_text(
        "stop_time: 1 s\nmembers: {a: {component: own_part:Part, parameters: {gain: 2}}}\n"
    )
    code = "import sys; from pathlib import Path; from twin.scenario import checked; print(checked(Path('one.yaml'), (), Path('build'))[1])"

    def run():
        command = [sys.executable, "-c", code]
        environment = {**os.environ, "PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)

    first = run()
    assert first.returncode == 0, first.stderr
    assert len(list((tmp_path / "build").rglob("*.json"))) == 1
    assert run().stdout == first.stdout
    (tmp_path / "own_part.py").write_text(PART.replace("minimum=0.0", "minimum=3.0"))
    assert "is below the minimum" in run().stderr


PART = '''
"""One."""
from twin.component import Component, output, parameter
class Part(Component):
    """One."""
    period = 1e-3
    gain = parameter(1.0, "", "gain", minimum=0.0, source="assumed")
    y = output("", "it")
    def initialize(self):
        self.y = self.gain
    def step(self, t, h):
        self.y = self.gain
'''


def test_an_fmu_that_was_replaced(tmp_path, sealed):
    path = native_fmu(tmp_path)
    (tmp_path / "one.yaml").write_text(f"stop_time: 1 s\nmembers: {{a: {{component: {path}}}}}\n")
    checked(tmp_path / "one.yaml", (), tmp_path / "build")
    sealed()
    checked(tmp_path / "one.yaml", (), tmp_path / "build")
    path.write_bytes(path.read_bytes() + b"\0")
    with pytest.raises(AssertionError, match="anew"):
        checked(tmp_path / "one.yaml", (), tmp_path / "build")


@pytest.mark.parametrize("damage", [b"", b"\xff\xfe", b"{}", b"cut", b"changed"])
def test_a_damaged_file_is_made_anew(scenario, tmp_path, damage):
    first = checked(scenario, (), tmp_path / "build")
    place = next((tmp_path / "build").rglob("*.json"))
    whole = place.read_bytes()
    broken = {b"cut": whole[:-20], b"changed": whole.replace(b"0.2", b"0.3")}.get(damage, damage)
    assert broken != whole
    place.write_bytes(broken)
    same(checked(scenario, (), tmp_path / "build"), first)
    assert place.read_bytes() == whole


def test_mistakes_are_not_kept(tmp_path):
    (tmp_path / "one.yaml").write_text("stop_time: 1 s\nmembers: {a: {component: heart, parameters: {rate: 3 mm}}}\n")
    for _ in range(2):
        with pytest.raises(ScenarioError, match="rate"):
            checked(tmp_path / "one.yaml", (), tmp_path / "build")
    assert not list(tmp_path.rglob("*.json"))


def test_no_place_to_keep_it(scenario, tmp_path):
    (tmp_path / "build").write_text("a file")
    checked(scenario, (), tmp_path / "build")
