"""One line for everything that can be wrong with a scenario file."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from tests.every_case import every_case
from tests.scenario.texts import BASE, changed, problems
from twin.errors import ScenarioError
from twin.scenario import lint, load_scenario
from twin.scenario.scenario_paths import located

METRIC = BASE[BASE.index("{signal: sensor.force - 0.2") : BASE.index("\nexpect:")]


@every_case(
    ("text", "expected"),
    [
        ("", "s.yaml: is empty."),
        ("# nothing\n", "s.yaml: is empty."),
        ("- a\n", "s.yaml:1: a scenario is a list of `key: value` lines."),
        ("a: [1\nb: 2\n", "s.yaml:2: not YAML:"),
        ("a: 1\n\tb: 2\n", "s.yaml:2: not YAML:"),
        ("a: 1\nb: \x07\n", "s.yaml:2: not YAML:"),
        ("a: 1\n---\nb: 2\n", "s.yaml:2: a second document begins."),
        (
            "a: !!python/object:os.system x\n",
            "s.yaml:1: the tag tag:yaml.org,2002:python/object:os.system is not supported.",
        ),
        ("a: &x 1\nb: {<<: *x}\n", "s.yaml:2: `<<` is not supported."),
        ("a: *x\n", "s.yaml:1: nothing is called &x above this line."),
        ("a: &x [*x]\n", "s.yaml:1: nothing is called &x above this line."),
        (
            "a: {b: x[3], c: 1}\n",
            "s.yaml:1: not YAML: did not find expected ',' or '}' while parsing a flow mapping. Put names",
        ),
        ("{[1]: 2}\n", "s.yaml:1: a key must be a name."),
        ("a: " + "[" * 100, "s.yaml:1: nested more than 24 deep."),
        (
            "extends: nowhere.yaml\n",
            "s.yaml:1: extends: there is no file nowhere.yaml. Give the name of a shipped scenario, or a path relative",
        ),
        (
            "extends: none/heart.yaml\n",
            "s.yaml:1: extends: there is no file none/heart.yaml. Give the name of a shipped",
        ),
        (
            "extends: none/heart_wall_force.yaml\n",
            "s.yaml:1: extends: there is no file none/heart_wall_force.yaml. Write `extends: h",
        ),
        ("scenario: a\nvary: {}\n", "s.yaml:2: this file is no scenario but a study. Run it with `twin study`."),
        ("extends: [a]\n", "s.yaml:1: extends: expected the path of one scenario"),
    ],
)
def test_text_that_is_no_scenario(text: str, expected: str) -> None:
    (line,) = problems(text)
    assert line.startswith(expected), line


def test_alias_bomb() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
    (line,) = problems("\n".join(lines))
    assert "more than 1000000 values, aliases counted" in line


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    cases = {
        "folder": "is a folder",
        "nothing.yaml": "cannot be read (No such file",
        "latin.yaml": ":2: byte 0xe9 is not UTF-8",
        "large.yaml": "is larger than 20 MB",
        "round.yaml": ":1: extends: round.yaml extends this file again",
    }
    (tmp_path / "folder").mkdir()
    (tmp_path / "latin.yaml").write_bytes(b"a: 1\nb: caf\xe9\n")
    (tmp_path / "large.yaml").write_bytes(b"#" * 20_000_001)
    (tmp_path / "round.yaml").write_text("extends: round.yaml\n")
    for name, expected in cases.items():
        with pytest.raises(ScenarioError) as caught:
            load_scenario(tmp_path / name)
        assert str(caught.value).startswith(f"{tmp_path / name}")
        assert expected in str(caught.value)


@every_case(
    ("old", "new", "expected"),
    [
        ("connections:", "conections:", "s.yaml:9: unknown key `conections`. Did you mean `connections`?"),
        ("stop_time: 10 s", "start_time: 0", "s.yaml: `stop_time` is missing."),
        ("stop_time: 10 s", "stop_time: 10 N", "s.yaml:3: stop_time: 10 N is not a time: use s, ms, us, ns, min or h."),
        ("stop_time: 10 s", "stop_time: .nan", "s.yaml:3: stop_time: nan is not a time."),
        ("stop_time: 10 s", "stop_time: -1 s", "s.yaml:3: stop_time -1 s is not after start_time 0 s."),
        ("stop_time: 10 s", "stop_time: 10.0005 s", "s.yaml:3: the run of 10.0005 s is not a multiple of step 1 ms."),
        ("at: 2 s", "at: 1e-300 s", "s.yaml:14: variants.PI+FF.events[1].at: 1e-300 s is too short a time. Check the unit."),
        ("stop_time: 10 s", "stop_time: [1]", "s.yaml:3: stop_time: expected a time, such as 1 ms, not a list."),
        ("stop_time: 10 s", "stop_time: true", "s.yaml:3: stop_time: expected a time, such as 1 ms, not True."),
        ("title: Contact force", "step: -1 ms", "s.yaml:1: step: expected a time above zero, not -1 ms."),
        ("title: Contact force", "algorithm: jakobi", "s.yaml:1: algorithm: `jakobi` is not known. Did you mean `jacobi`?"),
        ("seeds: [1, 2]", "seeds: [1, 1]", "s.yaml:4: seed 1 is given twice."),
        ("seeds: [1, 2]", "seeds: [1, x]", "s.yaml:4: seeds[2]: expected a whole number, not `x`."),
        ("seeds: [1, 2]", "seeds: []", "s.yaml:4: seeds: expected at least 1 value, not 0."),
        ("seeds: [1, 2]", "seeds: [1]\nseed: 2", "s.yaml:5: seed and seeds are both given."),
        ("{component: force_sensor}", "{componet: force_sensor}", "s.yaml:7: members.sensor: unknown key `componet`."),
        ("{component: force_sensor}", "{}", "s.yaml:7: member `sensor` has no component."),
        ("{component: force_sensor}", "{component: x.fmu}", "s.yaml:7: member `sensor`: there is no file"),
        ("{component: force_sensor}", "{component: a, period: 0 s}", "s.yaml:7: members.sensor.period: expected a time above"),
        ("{component: force_sensor}", "{component: a, parameters: {b: .inf}}", "s.yaml:7: members.sensor.parameters.b: inf is"),
        ("{component: force_sensor}", "{component: a, parameters: {b: {c: 1}}}", "s.yaml:7: members.sensor.parameters.b: exp"),
        ("{component: force_sensor}", "5", "s.yaml:7: members.sensor: expected a group of `key: value` lines, not 5."),
        ("  sensor:", "  sen-sor: {component: a}\n  sensor:", "s.yaml:7: member `sen-sor`: use letters, digits and _ only."),
        ("controller.command -> servo.command", "controler.command -> servo.command", "s.yaml:10: there is no member `controler`"),
        ("controller.command -> servo.command", "controller.command", "s.yaml:10: connections[1]: `controller.command` is no connection. Write `"),
        ("controller.command -> servo.command", "controller.command - > servo.command",
         "s.yaml:10: connections[1]: `controller.command - > servo.command` is no connection. Write `controller.command -> servo"),
        ("controller.command -> servo.command", "servo.command <- controller.command",
         "s.yaml:10: connections[1]: `servo.command <- controller.command` is no connection. Write `controller.command -> servo"),
        ("seeds: [1, 2]", "seeds: [1]\nstop_time: 5 s", "s.yaml:5: `stop_time` is given twice, first on line 3. Keep one."),
        ("seeds: [1, 2]", "parameter_sets: [none.yaml]", "s.yaml:4: parameter_sets: there is no file none.yaml."),
        ("stop_time: 10 s", "stop_time: 1e300", "s.yaml:3: stop_time: 1e+300 is longer than 10000000 s."),
        ("controller.command -> servo.command", "controller -> servo.command", "s.yaml:10: connections[1].from: expected memb"),
        ("{from: sensor.force, to:", "{form: sensor.force, to:", "s.yaml:11: connections[2]: unknown key `form`. Did you mean `f"),
        ("at: 6 s", "at: 11 s", "s.yaml:16: event at 11 s is outside the run, 0 s to 10 s."),
        ("at: 6 s", "at: 6.0001 s", "s.yaml:16: event at 6.0001 s is no multiple of step 1 ms."),
        ("{at: 6 s, override", "{override", "s.yaml:16: events[1]: `at` or `when` is missing. Add one, such as `at: 5 s`"),
        ("override: {sensor.force: 0 N}", "overide: {sensor.force: 0 N}", "s.yaml:16: events[1]: unknown key `overide`. Did you"),
        ("override: {sensor.force: 0 N}", "override: {sensr.force: 0 N}", "s.yaml:16: there is no member `sensr`. Did you mean"),
        ("override: {sensor.force: 0 N}", "override: {force: 0 N}", "s.yaml:16: events[1].override.force: expected member.var"),
        ("release: sensor.force", "release: servo.load", "s.yaml:17: servo.load is released but was not overridden before 7 s."),
        ("record: [sensor.force", "record: [sensr.force", "s.yaml:19: there is no member `sensr`. Did you mean `sensor`?"),
        ("record: [sensor.force", "record: [a b", "s.yaml:19: record.variables[1]: expected member.variable or member.*"),
        ("record: [sensor.force, servo.*]", "record: {every: 1.5 ms}", "s.yaml:19: every 1.5 ms is not a multiple of step 1 ms."),
        ("signal: sensor.force - 0.2", "signal: sensr.force", "s.yaml:21: there is no member `sensr`. Did you mean `sensor`?"),
        ("signal: sensor.force - 0.2", "signal: open('x')", "s.yaml:21: metrics.error.signal: `open('x')`: `open('x')` cannot be"),
        ("signal: sensor.force - 0.2", "signal: sensor.force -", "s.yaml:21: metrics.error.signal: `sensor.force -` is not an exp"),
        ("signal: sensor.force - 0.2, ", "", "s.yaml:21: metrics.error: `signal` is missing."),
        ("reduce: std", "reduce: std, variants: PJ", "s.yaml:21: metrics.error.variants: there is no variant `PJ`."),
        ("reduce: std", "reduce: sdt", "s.yaml:21: metrics.error.reduce: `sdt` is not known. Did you mean `std`?"),
        ("from: 4 s, unit", "from: 40 s, unit", "s.yaml:21: metrics.error: from 40 s lies outside the run, 0 s to 10 s."),
        ("unit: mN", "unit: fork", "s.yaml:21: metrics.error: unit `fork` is not known."),
        ("reference: {PI: 36.2 mN", "reference: {PJ: 36.2 mN", "s.yaml:21: metrics.error.reference: there is no variant `PJ`."),
        ("reference: {PI: 36.2 mN", "reference: {PI: 36.2 mm", "s.yaml:21: metrics.error.reference: `36.2 mm` does not convert to mN."),
        ("tolerance: 20 %", "tolerance: -20 %", "s.yaml:21: metrics.error.tolerance: expected a ratio between 0 and 10"),
        ("metric: error, ordered", "metric: eror, ordered", "s.yaml:23: expect: no metric `eror`. Did you mean `error`?"),
        ("ordered: [PI, PI+FF]", "ordered: [PI, FF]", "s.yaml:23: expect: there is no variant `FF`."),
        ("ordered: [PI, PI+FF]", "ordered: [PI, PI]", "s.yaml:23: expect: variant `PI` is given twice."),
        (", ordered: [PI, PI+FF]", "", "s.yaml:23: expect: nothing is expected."),
        ("ordered: [PI, PI+FF]", "at_most: 1 N, margin: 1 %", "s.yaml:23: expect: a margin is that of an order."),
        ("ordered: [PI, PI+FF]", "ordered: [PI, PI+FF], margin: -2 mN", "s.yaml:23: expect: the margin is below zero."),
        ("ordered: [PI, PI+FF]", "ordered: [PI, PI+FF], margin: -2 %", "s.yaml:23: expect: margin: expected a ratio between 0 and 10"),
        ("ordered: [PI, PI+FF]", "ordered: [PI, PI+FF], margin: 2 mm", "s.yaml:23: expect: margin:"),
        ("within: [0.1 N, 0.4 N]", "within: [0.4 N, 0.1 N]", "s.yaml:24: expect: the lower limit is above the upper one."),
        ("within: [0.1 N, 0.4 N]", "within: [0.1 N]", "s.yaml:24: expect[2].within: expected at least 2 values, not 1."),
        ("signals: [sensor.force]", "xy: [sensor.force]", "s.yaml:26: plots[1].xy: expected at least 2 values, not 1."),
        ("signals: [sensor.force], ", "", "s.yaml:26: plot `Force`: give either `signals` or `xy: [x, y]`."),
        ("signals: [sensor.force]", "signals: [sensor.force, {signal: sensor.force, x: servo.x}]",
         "s.yaml:26: plot `Force`: some signals have an `x`. Give all of them one, or none."),
        ("per: variant", "per: seed", "s.yaml:26: plots[1].per: `seed` is not known."),
    ],
)  # fmt: skip
def test_one_problem_is_one_line(old: str, new: str, expected: str) -> None:
    lines = problems(changed(old, new))
    assert any(line.startswith(expected) for line in lines), lines


def test_steps_count_from_the_start() -> None:
    times = "start_time: 0.25 ms\nstop_time: {} ms"
    assert not any("the run of" in line for line in problems(changed("stop_time: 10 s", times.format(10000.25))))
    (line,) = [line for line in problems(changed("stop_time: 10 s", times.format(10000.75))) if "the run of" in line]
    assert line.startswith("s.yaml:4: the run of 10.0005 s is not a multiple of step 1 ms.")


def test_all_problems_at_once_in_the_order_of_lines() -> None:
    text = (
        changed("reduce: std", "reduce: sdt")
        .replace("step", "stp")
        .replace("at: 6 s", "at: 60 s")
        .replace("seeds", "sedes")
    )
    lines = problems(text, "srvo.mass=1")
    assert [line.split(": ")[0] for line in lines] == [
        "--set srvo.mass=1",
        "s.yaml:4",
        "s.yaml:16",
        "s.yaml:17",
        "s.yaml:21",
    ]


def test_a_file_that_is_no_text_says_what_it_is(tmp_path: Path) -> None:
    for name, expected in {"a.fmu": "This is not an FMU", "b.ssp": "SSP", "c.zip": "zip archive"}.items():
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            archive.writestr("a", "b")
        with pytest.raises(ScenarioError, match=expected):
            load_scenario(tmp_path / name)


def test_parameter_sets_without_members() -> None:
    (line,) = problems("stop_time: 1 s\nparameter_sets: [{sheath: {stiffness: 1}}]\n")
    assert line.startswith("s.yaml: `members` is missing.")


MANY = """\
stop_time: 1 s
members:
  heart: {component: heart}
  lost: {component: haert}
  sheath: {component: sheath, parameters: {nothing: 1}}
connections:
  - heart.position - > sheath.gripper_position
  - heart.nowhere -> sheath.neither
  - lost.y -> sheath.wrong
  - lost.y -> sheath.friction
events: [{at: 2 s, set: {sheath.absent: 1}}]
metrics: {m: {signal: lost.y, reduce: std}}
plots:
  - {title: late, signals: [heart.position], from: 5 s}
  - {title: unknown, signals: [heart.unknown]}
"""


def test_no_mistake_hides_another(tmp_path: Path) -> None:
    path = tmp_path / "many.yaml"
    path.write_text(MANY)
    found = [line.removeprefix(f"{path}:") for line in lint(path)[1]]
    beginnings = [
        f"4: member `lost`: There is no component 'haert' in {Path.cwd()}/fmus or the project's. Did you mean 'heart'?",
        "5: sheath has no variable `nothing`. Known: ",
        "7: connections[1]: `heart.position",
        "8: 'heart.nowhere': heart has no variable 'nowhere'. Known: ",
        "8: 'sheath.neither': sheath has no variable 'neither'. Known: ",
        "9: 'sheath.wrong': sheath has no variable 'wrong'.",  # its other end is of `lost`
        "11: event at 2 s is outside the run",
        "11: sheath has no variable `absent`.",
        "14: plot `late`: from 5 s lies outside the run",
        "15: heart has no variable `unknown`.",
    ]
    assert [text for text in beginnings if not any(line.startswith(text) for line in found)] == []
    assert len(found) == len(beginnings), found  # and nothing is told of what only `lost` could tell


@pytest.mark.slow
def test_an_invalid_member_has_no_follow_up_errors(tmp_path: Path) -> None:
    """Of an analysis that reads it; the other end of its connections is checked; a misspelled member is suggested."""
    path = tmp_path / "mine.yaml"
    path.write_text(
        "extends: heart_wall_force\nmembers: {wall: {component: wal}}\nconnections: [heart.positon -> wall.heart_position]\n"
        "variants: {PI: {members: {sheeth: {parameters: {friction: 1}}}}}\n"
    )
    beginnings = (
        "2: member `wall`: There is no component 'wal' in ",
        "3: 'heart.positon': heart has no variable 'positon'. Did you mean 'position'?",
        "4: member `sheeth` has no component. Did you mean `sheath`?",
    )
    for beginning, line in zip(beginnings, lint(path)[1], strict=True):
        assert line.startswith(f"{path}:{beginning}"), line


def test_without_imports_no_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "harmful.py").write_text("raise SystemExit(7)\n")
    (tmp_path / "s.yaml").write_text(
        'stop_time: 1 s\nmembers: {a: {component: "harmful:A"}, b: {component: hart}, c: {component: "s.yaml#c"}}\n'
        'analyses: {d: {function: "harmful:d", inputs: {x: a.y}}}\nplots: [{title: t, signals: [d.x, a.y], from: 2 s}]\n'
    )
    monkeypatch.chdir(tmp_path)
    told = [line.split(": ", 1)[1] for line in lint("s.yaml", imports=False)[1]]
    assert [line[:20] for line in told] == ["member `b`: There is", "plot `t`: from 2 s l"]
    assert any("cannot be imported" in line for line in lint("s.yaml")[1])


CONNECTED = """stop_time: 1 s
members: {wall: {component: wall}, sensor: {component: force_sensor}, controller: {component: pi_control}}
connections: [wall.force -> sensor.force]
variants:
  one: {}
  two: {connections: [sensor.measured_force -> controller.force]}
"""


@pytest.mark.parametrize(
    ("variant", "end", "is_wrong"),
    [
        ("one", "sensor.force", False),
        ("one", "sensor.drift", True),
        ("one", "controller.force", True),
        ("two", "controller.force", False),
    ],
)
def test_what_is_disconnected_must_be_connected(variant: str, end: str, is_wrong: bool, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(CONNECTED)
    path = tmp_path / "t.yaml"
    path.write_text(f"extends: s.yaml\nvariants: {{{variant}: {{connections: [{{from: null, to: {end}}}]}}}}\n")
    try:
        load_scenario(path)
        found = []
    except ScenarioError as error:
        found = error.problems
    expected = f"t.yaml:2: nothing is connected to `{end}` under this name."
    assert [line.partition(f"{tmp_path}/")[2].startswith(expected) for line in found] == [True] * is_wrong, found


@pytest.mark.parametrize(
    ("component", "expected"),
    [("servomotor", "nothing*.y matches no variable"), ("no_such_part", "There is no component 'no_such_part'")],
)
def test_a_pattern_is_judged_only_where_all_members_are_known(component: str, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(f"stop_time: 1 s\nmembers: {{motor: {{component: {component}}}}}\nrecord: ['nothing*.y']\n")
    (line,) = lint(path)[1]
    assert expected in line


@every_case(
    ("override", "expected"),
    [
        (
            "step=3 s",
            "--set step=3 s: the run of 10 s is not a multiple of step 3 s. Change stop_time or step. (s.yaml:3)",
        ),
        ("stop_time=3 s", "--set stop_time=3 s: "),
    ],
)
def test_an_option_that_causes_a_problem_is_named(override: str, expected: str) -> None:
    """Not the line of the file that it does not fit; a problem of the file itself keeps its line."""
    assert any(line.startswith(expected) for line in problems(BASE, override, "servo.mass=1 kg"))
    wrong = BASE.replace("seeds: [1, 2]", "seeds: []")
    assert any(line.startswith("s.yaml:4: seeds") for line in problems(wrong, override))


def test_a_step_without_a_unit() -> None:
    text = BASE.replace("seeds: [1, 2]", "step: 1").replace("record: [sensor.force, servo.*]", "record: {every: 5 ms}")
    (line,) = problems(text)
    assert line == (
        "s.yaml:4: step 1 s is longer than 5 ms, the `every` of `record`. A number without a unit is in seconds. "
        "Give at most 5 ms."
    )


def test_a_copied_scenario_says_what_it_lacks(tmp_path: Path) -> None:
    """The remedy is to extend the shipped one, not a list of the files beside the copy."""
    copy = tmp_path / "heart_wall_force.yaml"
    copy.write_text(located("heart_wall_force").read_text())
    with pytest.raises(ScenarioError) as caught:
        load_scenario(copy)
    advice = "The shipped scenarios have it: copy it too, or write `extends: heart_wall_force` and your changes alone."
    assert [line.endswith(advice) for line in caught.value.problems] == [True] * 2
