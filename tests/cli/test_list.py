"""`twin list` and `twin describe`, and scenarios by name.

Over 400 lines: every kind of entry is listed, described and found by the same names.
"""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

import twin
from tests.fmi.clock_parts import described
from tests.fmi.third_party import NATIVE_XML, archive
from twin.cli import group
from twin.cli.list import kinds_of_names
from twin.component import catalog
from twin.errors import ScenarioError, TwinError
from twin.results import find_results
from twin.scenario import scenario_paths
from twin.study import load_study


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A command in an empty folder: its exit code, or its error, and the lines that it printed."""
    monkeypatch.chdir(tmp_path)

    def invoke(*words):
        done = CliRunner().invoke(group, words)
        return done.exit_code if done.exception is None else str(done.exception), done.output.splitlines()

    return invoke


@pytest.mark.slow
def test_every_component_says_what_it_is():
    assert [name for name in catalog.names() if not catalog.summary(name).endswith(".")] == []
    assert catalog.summary("servomotor") == "Linear servomotor with its drive."
    assert catalog.summary("no_such_component") == ""


def test_every_scenario_says_what_it_is():
    assert [name for name, path in scenario_paths.scenarios().items() if not scenario_paths.title(path)] == []


@pytest.mark.slow
def test_all_that_there_is(run):
    code, lines = run("list")
    assert code == 0
    headings = [line.partition(":")[0] for line in lines if line and not line.startswith(" ")]
    assert headings == ["scenarios", "studies", "components", "profiles", "runs", "Titles"]
    for name in ("servomotor", "heart_wall_force", "thousand_patients", "epos4", "cia401"):
        assert any(name in line for line in lines)
    assert len(lines) < 60  # names alone; each kind has its titles
    assert any(
        line.split() == ["epos4", "maxon", "EPOS4", "with", "an", "EC-i", "40"] for line in run("list", "profiles")[1]
    )
    assert run("list", "--filter", "zzzz")[0] == "Nothing contains 'zzzz'. See `twin list`."
    assert run("list", "runs")[1] == ["runs: 0 in runs; `twin run heart_wall_force` makes one"]
    assert run("list", "runs", "--runs", "nowhere")[0].startswith("--runs nowhere: there is no such folder.")


def test_scenarios_are_listed_by_topic_those_to_start_with_first(run):
    _, lines = run("list", "scenarios", "--filter", "force")
    assert lines[1] == " Start here:"
    assert lines[2].split()[0] == "heart_wall_force"
    topics = [line.strip(" :") for line in lines[1:] if line.endswith(":")]
    assert topics == [name for name in ["Start here", *scenario_paths.TOPICS.values()] if name in topics]
    assert int(lines[0].split()[1]) == len(lines) - 1 - len(topics)


def test_components_are_listed_by_folder_own_ones_last(run, tmp_path):
    (tmp_path / "fmus" / "servo_of_mine").mkdir(parents=True)
    (tmp_path / "fmus" / "servo_of_mine" / "model.py").write_text('"""My servo."""\n')
    _, lines = run("list", "components", "--filter", "servo")
    assert [line.split()[0] for line in lines] == [
        "components:",
        "Actuators:",
        "servomotor",
        "Others:",
        "servo_of_mine",
    ]


@pytest.mark.slow
def test_a_kind_and_a_text(run):
    code, lines = run("list", "components", "--filter", "servo")
    assert (code, lines[0]) == (0, "components: 1")
    assert run("list", "component", "--filter", "servo") == (code, lines)
    assert run("list", "componentes")[0] == "There is no list of 'componentes'. Did you mean 'components'?"
    assert run("list", "force")[0].endswith("Entries that contain it: twin list --filter force.")


def store_run(folder, verdicts=(), **summary):
    """A finished run."""
    folder.mkdir(parents=True)
    text = {
        "status": "completed",
        "passed": "fail" not in verdicts,
        "cases": [{}],
        "metrics": {},
        "expectations": [{"verdict": verdict} for verdict in verdicts],
        **summary,
    }
    (folder / "summary.json").write_text(json.dumps(text))


def test_runs_the_latest_first_verdicts_first(run, tmp_path):
    """Under their scenario, without its folder; what was not judged is counted."""
    store_run(tmp_path / "runs" / "some" / "2026-01-01_10-00-00", ["pass", "fail", "skipped"])
    store_run(tmp_path / "runs" / "some" / "2026-01-02_10-00-00", ["pass"])
    store_run(tmp_path / "runs" / "other" / "2026-01-01_10-00-01", ["pass"], status="interrupted")
    (tmp_path / "runs" / "some" / "2026-01-03_10-00-00").mkdir()
    (tmp_path / "runs" / "some" / "2026-01-03_10-00-00" / "summary.json").write_text("{")
    assert run("list", "runs")[1] == [
        "runs: 4, in runs, newest first",
        " some:",
        " 2026-01-03_10-00-00  its summary.json cannot be read",
        " 2026-01-02_10-00-00  PASS 1 of 1",
        " 2026-01-01_10-00-00  FAIL 1 failed · 1 passed · 1 not judged",
        " other:",
        " 2026-01-01_10-00-01  INTERRUPTED",
    ]


def test_a_run_by_its_time_alone(run, tmp_path):
    """As `twin list runs` shows it, also with its scenario; a time that two runs have is refused."""
    about = {
        "scenario": {"name": "some", "title": "Some run"},
        "started": "2026-01-01T10:00:00",
        "sentence": "It held.",
    }
    store_run(tmp_path / "runs" / "some" / "2026-01-01_10-00-00", ["pass"], **about)
    path = Path("runs/some/2026-01-01_10-00-00")
    for name in ("2026-01-01_10-00-00", "some/2026-01-01_10-00-00", "latest", "some/latest"):
        assert find_results(Path(name), "summary.json", "run", "some").resolve() == path.resolve()
        lines = run("describe", name)[1]
        assert lines[0].endswith("2026-01-01_10-00-00: run of some, 2026-01-01 10:00")
        assert lines[1:4] == ["Some run", "PASS 1 of 1", "It held."]
        assert lines[4].startswith("Look: twin view ")
    (tmp_path / "runs" / "other" / path.name).mkdir(parents=True)
    with pytest.raises(TwinError, match=r"is the time of 2 runs\. Name one: runs/other/"):
        find_results(Path(path.name), "summary.json", "run", "some")


def test_whatever_is_listed_can_be_described(run):
    lines = run("describe", "epos4")[1]
    assert lines[:2] == [
        "epos4: maxon EPOS4 with an EC-i 40",
        "One of `twin list profiles`. Use it in a hardware file, `profile: epos4`, or simulate it: twin drive --profile epos4",
    ]
    assert "Identity (1018h): vendor FBh, product 61500000h, revision 1700000h" in lines
    assert any(
        line.startswith("Modes of operation: profile position, profile velocity, homing, cyclic") for line in lines
    )
    assert "      profile: epos4" in lines
    code, lines = run("describe", "thousand_patients")
    assert (code, lines[0].partition(": ")[2]) == (0, "A thousand patients")
    assert any(
        line.split()
        == ["heart.rate", "normal", "75", "/min,", "13", "/min;", "from", "48", "/min;", "to", "120", "/min"]
        for line in lines
    )
    assert "Run it: twin study thousand_patients" in lines
    assert any(
        line.startswith(" controller.integral") and "tuned, from" in line
        for line in run("describe", "tune_force_control")[1]
    )


def test_a_file_without_its_suffix_is_named(run, tmp_path):
    (tmp_path / "mine.yaml").write_text("extends: racs\n")
    assert "There is a file of this name: twin describe mine.yaml." in run("describe", "mine")[0]


def test_a_filter_that_finds_nothing_says_so(run, tmp_path):
    (tmp_path / "beat.yaml").write_text("stop_time: 1 s\nmembers: {heart: {component: heart}}\n")
    for name in ("beat.yaml", "servomotor"):
        assert (
            run("describe", name, "--filter", "zzz")[0]
            == f"{name}: nothing contains 'zzz'. Leave --filter out to see all."
        )
    assert any("heart.rate" in line for line in run("describe", "beat.yaml", "--filter", "HEART.rate")[1])


def test_what_is_often_changed_in_a_scenario(run, tmp_path):
    """The parameters that it lists first, with value, range and meaning, and a command to copy."""
    (tmp_path / "beat.yaml").write_text(
        "stop_time: 1 s\nmembers: {heart: {component: heart}}\nconsole: {parameters: {heart.rate: [40 /min, 120 /min]}}\n"
    )
    _, lines = run("describe", "beat.yaml")
    row = next(line for line in lines if line.startswith(" heart.rate"))
    assert [cell.strip() for cell in row.split("  ") if cell.strip()] == [
        "heart.rate",
        "60 /min",
        "40 to 120 /min",
        "heart rate; a change keeps the phase",
    ]
    assert lines[-3:-1] == ["Run it: twin run beat.yaml", 'Change it: twin run beat.yaml --set heart.rate="90 /min"']


def test_a_run_is_listed_with_what_differs_from_its_scenario(run, tmp_path):
    """Overrides, variants if not all, seeds if not those of the scenario; within 80 columns."""
    cases = [{"variant": variant, "seed": 3} for variant in ("PI", "PI, slow")]
    whole = [{"variant": variant, "seed": seed} for variant in ("PI", "PI, slow", "FF") for seed in (1, 2)]
    for stamp, overrides, own in (
        ("01", ["heart.rate=1.4 Hz"], cases),
        ("02", [f"a.b{i}={i}" for i in range(9)], whole),
    ):
        folder = tmp_path / "runs" / "some" / f"2026-01-01_10-00-{stamp}"
        folder.mkdir(parents=True)
        (folder / "scenario.yaml").write_text("seeds: [1, 2]\nvariants: {PI: {}, 'PI, slow': {}, FF: {}}\n")
        summary = {
            "status": "completed",
            "passed": True,
            "overrides": overrides,
            "cases": own,
            "metrics": {},
            "expectations": [],
        }
        (folder / "summary.json").write_text(json.dumps(summary))
    _, lines = run("list", "runs")
    assert [line.partition("DONE; ")[2] for line in lines[2:]] == [
        "set a.b0=0, a.b1=1, a.b2=2, a.b3=3, and 5 more",
        'set heart.rate=1.4 Hz; only "PI", "PI, slow"; seed 3',
    ]


def test_a_component(run):
    code, lines = run("describe", "servomotor")
    assert (code, lines[0]) == (0, "servomotor: component of the communication step")
    row = next(line for line in lines if line.startswith(" stroke "))
    assert row.split(maxsplit=1)[1].split("  ")[0] == "80 mm"
    assert "at least 0 mm" in row
    assert "from:" not in row
    assert any(line.startswith(" carriage ") and "position, velocity, force" in line for line in lines)
    assert not any(line.startswith(" local ") for line in lines)
    assert lines[-1] == "Sources of the values, states and local variables: --all"
    every = run("describe", "servomotor", "--all")[1]
    assert any(line.startswith(" local ") for line in every)
    assert any(line.startswith(" stroke ") and "(from: type code -080-)" in line for line in every)


@pytest.mark.parametrize(
    ("files", "made"),
    [
        ({}, "none"),
        (
            {"binaries/x86_64-windows/Native.dll": b"", "binaries/x86_64-linux/a.so": b""},
            "x86_64-linux, x86_64-windows",
        ),
        ({"binaries/aarch64-darwin/Native.dylib": b"", "sources/a.c": b""}, "aarch64-darwin, C sources"),
    ],
)
def test_an_fmu_of_any_platform(run, tmp_path, files, made):
    archive(tmp_path / "Native.fmu", {"modelDescription.xml": NATIVE_XML.encode(), **files})
    code, lines = run("describe", "Native.fmu")
    assert (code, lines[0]) == (0, "Native.fmu: FMU, FMI 3.0, Co-Simulation")
    assert lines[1] == f"generated by an unnamed tool, platforms: {made}"
    assert any(line.startswith(" mode ") for line in lines)


def test_clocks_of_an_fmu(run, tmp_path):
    archive(tmp_path / "Kinds.fmu", {"modelDescription.xml": described("Kinds").encode()})
    _, lines = run("describe", "Kinds.fmu")
    kinds = {line.split()[0]: line.split("clock, ")[1].rstrip() for line in lines if "clock, " in line}
    assert kinds["constant"] == "constant of 200 ms, first after 100 ms"
    assert (kinds["countdown"], kinds["alarm"]) == ("countdown", "triggered")


def test_metrics_without_a_description_are_shown_by_their_signal(run, tmp_path):
    scenario = (
        "stop_time: 1 s\nmembers: {heart: {component: heart}}\nmetrics: {top: {signal: heart.position, reduce: max}}\n"
    )
    (tmp_path / "beat.yaml").write_text(scenario)
    _, lines = run("describe", "beat.yaml")
    assert any(line.split() == ["top", "max", "of", "heart.position"] for line in lines)


def test_values_and_connections_of_a_scenario(run, tmp_path):
    """On request: parameters and set inputs as they will run, what set them, and connections; files from the scenario's folder."""
    members = (
        "{a: {component: heart, parameters: {rate: 72 /min}}, w: {component: wall}, b: {component: 'other.yaml#m'}}"
    )
    (tmp_path / "beat.yaml").write_text(
        f"stop_time: 1 s\nmembers: {members}\nconnections: [{{from: a.position, to: w.heart_position}}]\n"
    )
    (tmp_path / "other.yaml").write_text("stop_time: 1 s\nmembers: {h: {component: heart}}\ngroups: {m: [h]}\n")
    _, lines = run("describe", "beat.yaml")
    assert "Parameters and connections: --all or --filter NAME" in lines
    assert any(line.split() == ["b", "other.yaml#m"] for line in lines)
    assert not any("a.rate" in line for line in lines)
    _, lines = run("describe", "beat.yaml", "--filter", "a.")
    rate = next(line for line in lines if line.startswith(" a.rate"))
    assert rate.split(maxsplit=1)[1].startswith("1.2 Hz")
    assert " ".join(rate.split()).endswith(
        "at least 0 Hz heart rate; a change keeps the phase (set by the scenario; default 1 Hz)"
    )
    assert any(line.split() == ["a.position", "w.heart_position"] for line in lines)


def test_what_is_no_fmu(run, tmp_path):
    (tmp_path / "any.fmu").write_text("no archive")
    assert run("describe", "any.fmu")[0].startswith("any.fmu: is not a zip archive")
    assert run("describe", "other.fmu")[0] == "other.fmu: is not there. Give the path of an .fmu file."


@pytest.mark.slow
def test_a_scenario(run):
    code, lines = run("describe", "heart_wall_force")
    assert code == 0
    assert lines[0] == "heart_wall_force: Contact force against a beating wall"
    assert any(line.split()[:3] == ["clinical", "range", "0.1"] for line in lines)
    assert any("PI > PI+FF > PI+FF+BW" in line for line in lines)


def test_what_there_is_not(run):
    message = "There is nothing called 'servomoter'. Did you mean 'servomotor'? See `twin list`."
    assert run("describe", "servomoter")[0] == message


@pytest.mark.slow
def test_a_scenario_by_its_name_anywhere(run, tmp_path):
    assert run("check", "heart_wall_force")[0] == 0
    assert twin.load("heart_wall_force").title == "Contact force against a beating wall"
    with pytest.raises(ScenarioError, match="There is no scenario 'heart_wal_force', and no file of this name"):
        scenario_paths.located("heart_wal_force")
    (tmp_path / "own.yaml").touch()
    for wrong, near in (("heart_wal_force.yaml", "heart_wall_force"), ("onw.yaml", "own.yaml")):
        with pytest.raises(ScenarioError, match=rf"{wrong}: is not there\. Did you mean '{near}'\?"):
            scenario_paths.located(wrong)
    assert run("check", "scenarios/racs.yaml")[1][0] == (
        "scenarios/racs.yaml: is not there. There is a scenario of this name elsewhere: give the name alone, racs."
    )


@pytest.mark.parametrize("command", ["", "run", "check", "graph", "export", "study", "new", "console"])
def test_help_names_no_file_that_only_a_checkout_has(run, command):
    code, lines = run(*command.split(), "--help")
    assert (code, [line for line in lines if "scenarios/" in line or "hw_bridge/" in line]) == (0, [])


@pytest.mark.slow
def test_a_study_by_its_name_anywhere(run, tmp_path):
    assert load_study("thousand_patients").name == "thousand_patients"
    (tmp_path / "studies").mkdir()
    own = tmp_path / "studies" / "two.yaml"
    own.write_text(
        "scenario: heart_wall_force\nvariants: [PI]\nsamples: {method: random, count: 2, seed: 1}\n"
        "vary: {heart.rate: {uniform: [60 /min, 80 /min], source: assumed}}\n"
    )
    assert load_study(own).scenario.title == "Contact force against a beating wall"
    assert run("study", "thousand_patient")[0] == (
        "There is no study 'thousand_patient', and no file of this name. Did you mean 'thousand_patients'?"
    )


def test_a_scenario_is_no_study(run, tmp_path):
    assert run("study", "heart_wall_force")[0] == "'heart_wall_force' is a scenario: twin run heart_wall_force"
    assert run("run", "servomotor")[0] == "'servomotor' is a component: twin describe servomotor"
    unknown = "There is no scenario 'zzz', and no file of this name. See `twin list scenarios`."
    assert run("run", "zzz")[0] == unknown
    assert run("run", "thousand_patients")[0] == "'thousand_patients' is a study: twin study thousand_patients"
    (tmp_path / "mine.yaml").write_text("members: {}\n")
    assert run("study", "mine.yaml")[0] == "mine.yaml: is a scenario: twin run mine.yaml"
    hint = "There is no scenario 'mine'. Name the file that is here: mine.yaml"
    assert run("check", "mine")[1] == [hint, "1 problem"]


def test_own_files_count_first(run, tmp_path):
    (tmp_path / "scenarios").mkdir()
    own = tmp_path / "scenarios" / "racs.yaml"
    own.write_text("title: mine\nmembers: {}\n")
    assert scenario_paths.located("racs").resolve() == own
    (tmp_path / "racs").write_text("")
    assert str(scenario_paths.located("racs")) == "racs"
    assert str(scenario_paths.located("scenarios/racs.yaml")) == "scenarios/racs.yaml"
    assert str(scenario_paths.located("mine.yaml")) == "mine.yaml"
    with pytest.raises(ScenarioError, match=r"racs\.yaml: is not there\. There is a scenario of this name elsewhere"):
        scenario_paths.located("racs.yaml")


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("twin descr", ["plain,describe"]),
        ("twin run heart_wall_f", ["plain,heart_wall_force", "file,heart_wall_f"]),
        ("twin describe servom", ["plain,servomotor", "file,servom"]),
        ("twin run any --step-r", ["plain,--step-refinement"]),
    ],
)
def test_a_shell_completes(words, offered):
    asked = {"_TWIN_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": str(len(words.split()) - 1)}
    done = CliRunner().invoke(group, [], prog_name="twin", env=asked)
    assert done.output.splitlines() == offered


@pytest.mark.slow
def test_all_that_is_listed_is_described(run):
    """By the name that `twin list` shows, also what is listed as a study, and as a file where a component has its name."""
    failed = {}
    for kind, listing in kinds_of_names(Path("runs")).items():
        for name in listing():
            code, _ = run("describe", name)
            if code:
                failed[f"{kind}: {name}"] = code
    assert failed == {}


def test_a_scenario_that_studies_vary_is_a_scenario(run):
    assert "patient_force" in scenario_paths.scenarios()
    assert "patient_force" not in scenario_paths.scenarios("study")
    with pytest.raises(ScenarioError, match="'patient_force' is a scenario: twin run patient_force"):
        load_study("patient_force")
    code, lines = run("describe", "patient_force")
    assert code == 0
    assert "Run it: twin run patient_force" in lines


def test_a_component_with_the_name_of_a_scenario_names_it(run):
    also = "There is also a scenario of this name: twin describe heart_motion.yaml"
    assert run("describe", "heart_motion")[1][-1] == also
    for name in ("heart_motion.yaml", "scenarios/heart_motion"):
        assert "Run it: twin run heart_motion" in run("describe", name)[1]


def test_a_run_is_described_with_failures_and_metrics(run, tmp_path):
    """Judged metrics first."""
    variants = {
        "PI": {"mean": 0.03, "paper": 0.04, "verdict": "fail"},
        "FF": {"mean": 0.5, "paper": None, "verdict": "info"},
    }
    folder = tmp_path / "runs" / "some" / "2026-01-01_10-00-00"
    store_run(
        folder,
        scenario={"name": "some", "title": "Some"},
        started="2026-01-01T10:00:00",
        expectations=[{"name": "safe", "verdict": "fail", "detail": "2 N."}, {"name": "fast", "verdict": "pass"}],
        metrics={"force": {"unit": "N", "variants": variants}},
        notes=["warning: heart.rate=9 Hz is odd."],
    )
    lines = run("describe", "latest")[1]
    assert "FAIL    safe: 2 N." in lines
    rows = [line.split() for line in lines if line.startswith(" force")]
    assert rows == [["force", "PI", "0.03", "N", "0.04", "N", "fail"], ["force", "FF", "0.50", "N", "-", "-"]]
