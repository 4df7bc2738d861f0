"""What is kept of a checked scenario is what checking it gives, and counts only while nothing has changed."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.fmi.third_party import native_fmu
from tests.matrix import some
from twin.errors import ScenarioError
from twin.run import run_scenario
from twin.scenario import Checked, checked, displayed, kept, load_scenario, look_up

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
    (ours, catalogs), (theirs, others) = ((each.scenario, each.catalogs) for each in (one, other))
    bare = {"period_ns": None, "communication_ns": None}
    ours_bare, theirs_bare = (
        [replace(case, members={n: replace(m, **bare) for n, m in case.members.items()}) for case in each.variants]
        for each in (ours, theirs)
    )
    assert ours_bare == theirs_bare
    assert replace(ours, variants=()) == replace(theirs, variants=())
    assert ours.frozen() == theirs.frozen()
    for variant, members in others.items():
        for name, variables in members.items():
            assert list(catalogs[variant][name]) == list(variables)
            for key, variable in variables.items():
                np.testing.assert_equal(catalogs[variant][name][key].start, variable.start)
                assert catalogs[variant][name][key].dtype == variable.dtype
            values = [each.cases([variant], [5])[0].values(name, variables) for each in (ours, theirs)]
            np.testing.assert_equal(*values)


def keep(path, folder, build, *options):
    """Check a scenario, build its components and keep it in a folder."""
    first = checked(path, options, folder)
    first.keep(build)
    return first


def test_what_is_kept_is_what_was_checked(scenario, tmp_path, sealed, build):
    before = load_scenario(scenario)
    catalogs, problems = look_up(before)
    assert not problems
    first = keep(scenario, tmp_path / "kept", build)
    same(first, Checked(displayed(before, catalogs), catalogs))
    sealed()
    same(checked(scenario, (), tmp_path / "kept"), first)


# groups of others, sets of parameters, tables, bodies, analyses, programs: all others have more of the same
KINDS = (
    "heart_wall_force",
    "racs",
    "linear_grip",
    "bench_wall",
    "hysteresis_models",
    "injection_sequence",
    "tip_tracking",
)


@pytest.mark.parametrize("path", some(SCENARIOS, lambda path: path.stem in KINDS), ids=lambda path: path.stem)
def test_every_scenario(path, tmp_path, build):
    if path.stem == "drive_faults":
        pytest.skip("needs hardware")
    first = keep(path, tmp_path, build)
    found = kept.find(first.place)
    assert (found is None) == bool(first.scenario.analyses or first.scenario.scenes)
    if found is not None:
        same(found, first)


@pytest.mark.slow
def test_a_run_of_what_is_kept_gives_the_same_bits(tmp_path, build):
    """A scenario with a group of another one, periods, seeds and parameter sets."""
    path, tables = SCENARIOS[0].with_name("heart_wall_force.yaml"), []
    for _ in range(2):
        known = checked(path, (), tmp_path / "kept")
        outcome = run_scenario(
            known.scenario, variants=["PI+FF"], seeds=[2], root=tmp_path / "runs", build=build, known=known
        )
        tables.append(outcome.tables["PI+FF", 2])
    assert known.place is None  # the second one was kept
    assert known.scenario.cases()[0].members["estimate"].built is not None
    assert tables[0].values.keys() == tables[1].values.keys()
    for name, values in tables[0].values.items():
        assert np.array_equal(values, tables[1].values[name], equal_nan=True), name
    reports = [
        re.sub(r"\d{4}-\d\d-\d\d[^<]*", "", one.read_text()) for one in sorted((tmp_path / "runs").rglob("report.html"))
    ]
    assert len(reports) == 2
    assert re.findall(r"<td>[^<]*</td>", reports[0]) == re.findall(r"<td>[^<]*</td>", reports[1])


def test_numbers_keep_their_bits(tmp_path):
    values = (0.1 + 0.2, np.float64(1e-310), np.array([[1.5, float("inf")], [-0.0, float("nan")]]), np.int64(7),
              (1, None, True), np.array([b"\0x", b""], object), np.array(["a"], object))  # fmt: skip
    found = json.loads(json.dumps(kept.encoded(values)), object_hook=kept.decoded)
    assert repr(found) == repr(values)


@pytest.mark.parametrize("what", ["file", "extended", "option", "folder"])
def test_what_changed_is_checked_anew(scenario, tmp_path, sealed, what, monkeypatch, build):
    base = scenario
    if what == "extended":
        scenario = tmp_path / "two.yaml"
        scenario.write_text(f"extends: {base.name}\n")
    keep(scenario, tmp_path / "build", build)
    sealed()
    options = ("stop_time=2 s",) if what == "option" else ()
    if what in ("file", "extended"):
        base.write_text(TEXT.replace("72 /min", "71 /min"))
    if what == "folder":
        monkeypatch.chdir(tmp_path)
    with pytest.raises(AssertionError, match="anew"):
        checked(scenario, options, tmp_path / "build")


def test_what_may_import_anything_is_not_kept(tmp_path, monkeypatch, build):
    (tmp_path / "one.yaml").write_text('stop_time: 1 s\nmembers: {a: {component: "tests.coupling.parts:Lag"}}\n')
    first = keep(tmp_path / "one.yaml", tmp_path / "kept", build)
    assert first.place is not None
    assert not first.place.exists()


@pytest.fixture
def run(command_line, tmp_path):
    """Runs a script in another process, with a catalog of its own."""

    def run(code):
        if command_line is None:
            command = [sys.executable, "-c", code]
            return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        (tmp_path / "script.py").write_text(code)
        return command_line.run(["script.py"], tmp_path, "python")

    return run


def test_a_component_that_changed(tmp_path, run):
    (tmp_path / "fmus" / "own_part").mkdir(parents=True)
    model = tmp_path / "fmus" / "own_part" / "model.py"
    model.write_text(PART)
    (tmp_path / "one.yaml").write_text("stop_time: 1 s\nmembers: {a: {component: own_part, parameters: {gain: 2}}}\n")
    code = (
        "from pathlib import Path; from twin.scenario import checked; known = checked(Path('one.yaml'), (), Path('build'))\n"
        "print('kept' if known.place is None else 'new'); known.keep(Path('build'))"
    )

    assert run(code).stdout == "new\n"
    assert run(code).stdout == "kept\n"
    model.write_text(PART.replace('"gain"', '"what is multiplied by"'))
    assert run(code).stdout == "new\n"
    model.write_text(PART.replace("minimum=0.0", "minimum=3.0"))
    assert "is below the minimum" in run(code).stderr


def test_a_component_that_imports_something_beside_the_catalog_is_not_kept(tmp_path, run):
    (tmp_path / "fmus" / "own_part").mkdir(parents=True)
    (tmp_path / "fmus" / "own_part" / "model.py").write_text(f"import beside\n{PART}")
    (tmp_path / "beside.py").write_text("")
    (tmp_path / "one.yaml").write_text("stop_time: 1 s\nmembers: {a: {component: own_part}}\n")
    code = (
        "from pathlib import Path; from twin.scenario import checked\n"
        "for _ in range(2): known = checked(Path('one.yaml'), (), Path('build')); print(known.place is None); known.keep(Path('build'))"
    )
    done = run(code)
    assert done.stdout.split() == ["False", "False"], done.stderr


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


def test_an_fmu_that_was_replaced(tmp_path, sealed, build):
    path = native_fmu(tmp_path)
    (tmp_path / "one.yaml").write_text(f"stop_time: 1 s\nmembers: {{a: {{component: {path}}}}}\n")
    keep(tmp_path / "one.yaml", tmp_path / "build", build)
    sealed()
    checked(tmp_path / "one.yaml", (), tmp_path / "build")
    path.write_bytes(path.read_bytes() + b"\0")
    with pytest.raises(AssertionError, match="anew"):
        checked(tmp_path / "one.yaml", (), tmp_path / "build")


@pytest.mark.parametrize("damage", [b"", b"\xff\xfe", b"{}", b"cut", b"changed"])
def test_a_damaged_file_is_made_anew(scenario, tmp_path, damage, build):
    first = keep(scenario, tmp_path / "build", build)
    place = next((tmp_path / "build").rglob("*.json"))
    whole = place.read_bytes()
    broken = {b"cut": whole[:-20], b"changed": whole.replace(b"0.2", b"0.3")}.get(damage, damage)
    assert broken != whole
    place.write_bytes(broken)
    same(keep(scenario, tmp_path / "build", build), first)
    assert place.read_bytes() == whole


def test_mistakes_are_not_kept(tmp_path):
    (tmp_path / "one.yaml").write_text("stop_time: 1 s\nmembers: {a: {component: heart, parameters: {rate: 3 mm}}}\n")
    for _ in range(2):
        with pytest.raises(ScenarioError, match="rate"):
            checked(tmp_path / "one.yaml", (), tmp_path / "build")
    assert not list(tmp_path.rglob("*.json"))


def test_no_place_to_keep_it(scenario, tmp_path, build):
    (tmp_path / "build").write_text("a file")
    keep(scenario, tmp_path / "build", build)
