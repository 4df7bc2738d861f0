"""What a newcomer sees first: the start page, the last line of a run, `latest`, wrapped texts."""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from twin.cli import group, terminal
from twin.cli.demo import EXAMPLES
from twin.errors import TwinError
from twin.results import count_verdicts, finished_runs, link_latest, resolve_latest
from twin.results.recording.latest_run import latest_run
from twin.scenario import load_scenario, scenario_paths

MAIN = [sys.executable, "-c", "from twin.cli import main; main()"]
SCENARIO = """
title: Beats
stop_time: 1 s
members: {heart: {component: heart}}
metrics: {reach: {signal: heart.position, reduce: max, unit: mm}}
expect: [{metric: reach, at_least: LIMIT}]
"""


def invoke(*words: str):
    return CliRunner().invoke(group, words)


@pytest.mark.parametrize("words", [(), ("demo",)])
def test_alone_it_names_three_things_to_try(words):
    done = invoke(*words)
    assert done.exit_code == 0
    assert [line.strip() for line in done.output.splitlines() if line.startswith("  twin ")] == list(EXAMPLES)


def test_the_three_things_exist():
    for line in EXAMPLES:
        _, command, name = line.split()
        assert command in group.list_commands(None)
        assert name == "latest" or name in scenario_paths.scenarios()


@pytest.fixture
def beats(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def run(limit="1 mm", *words):
        Path("beats.yaml").write_text(SCENARIO.replace("LIMIT", limit))
        return invoke("run", "beats.yaml", "--backend", "interpreted", "--no-report", *words)

    return run


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("limit", "verdict"), [("1 mm", "PASS 1 of 1 in"), ("1 m", "FAIL: 1 failed, in")])
def test_a_run_ends_with_verdict_speed_and_where_to_look(beats, limit, verdict):
    last = beats(limit).output.splitlines()[-1]
    pattern = rf"{verdict} \S+ s \(\S+x real time\)\. Results: runs/beats/\S+/summary\.json  Look: twin view latest"
    assert re.fullmatch(pattern, last)


def test_elsewhere_the_folder_is_named(beats):
    last = beats("1 mm", "--runs", "mine").output.splitlines()[-1]
    assert re.search(r"Look: twin view mine/beats/2\S+$", last)


def test_latest_is_the_last_run_on_disk(beats):
    for _ in range(2):
        beats()
    folders = finished_runs(Path("runs"))
    assert len(folders) == 2
    assert Path("runs/beats/latest").resolve() == folders[0].resolve()
    assert resolve_latest(Path("runs/beats/latest")) == folders[0]
    listed = invoke("list", "runs").output
    assert "latest" not in listed
    assert listed.count("PASS 1 of 1") == 2


def test_a_file_names_the_run_where_links_cannot_be_made(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise OSError("no links")

    monkeypatch.setattr(Path, "symlink_to", refuse)
    for name in ("2026-01-01_00-00-00", "2026-01-01_00-00-00_10", "2026-01-01_00-00-00_9"):
        folder = tmp_path / "s" / name
        folder.mkdir(parents=True)
        (folder / "summary.json").write_text("{}")
        link_latest(folder)
    assert (tmp_path / "s" / "latest").read_text() == "2026-01-01_00-00-00_10\n"
    assert resolve_latest(tmp_path / "s" / "latest").name == "2026-01-01_00-00-00_10"


def test_without_a_run_there_is_no_latest(tmp_path):
    (tmp_path / "s").mkdir()
    with pytest.raises(TwinError, match=r"s: holds no finished run\. Run the scenario first\."):
        latest_run(tmp_path / "s")
    done = invoke("view", "latest", "--runs", str(tmp_path))
    assert f"{tmp_path}: holds no finished run. Run a scenario first" in str(done.exception)


def test_metrics_with_a_reference_count_as_requirements():
    summary = {
        "metrics": {"m": {"variants": {"a": {"verdict": "pass"}, "b": {"verdict": "info"}, "c": {"verdict": "none"}}}},
        "expectations": [{"verdict": "skipped"}, {"verdict": "fail"}],
    }
    assert count_verdicts(summary) == (1, 3)


def test_later_lines_begin_under_the_first_word(monkeypatch):
    class Screen(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr(sys, "stdout", Screen())
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "40")
    terminal.show_text("one two three four five six seven eight nine runs/" + "x" * 40, "note: ")
    shown = re.sub(r"\x1b\[[0-9;]*m", "", sys.stdout.getvalue())
    assert shown.splitlines() == [
        "note: one two three four five six seven",
        "      eight nine",
        "      runs/" + "x" * 40,
    ]


@pytest.mark.slow
@pytest.mark.parametrize("words", [["list"], ["describe", "heart"], ["describe", "heart_wall_force"]])
def test_a_pipe_gets_no_filling_spaces(words):
    done = subprocess.run([*MAIN, *words], capture_output=True, text=True, check=True, timeout=120)
    assert not [line for line in done.stdout.splitlines() if line != line.rstrip()]


@pytest.mark.slow
def test_what_is_built_is_counted(tmp_path):
    (tmp_path / "beats.yaml").write_text(SCENARIO.replace("LIMIT", "1 mm"))
    words = ["run", "beats.yaml", "--no-report", "--backend", "compiled", "--build", "fresh"]
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run([*MAIN, *words], cwd=tmp_path, capture_output=True, text=True, check=True, env=environment)
    assert "building heart (1 of 1)" in done.stderr.splitlines()
    (summary,) = tmp_path.glob("runs/beats/2*/summary.json")
    assert json.loads(summary.read_text())["passed"]


def test_implausible_values_are_named_before_the_run(beats):
    """Outside of the range that the scenario states, else by the factor from its value; and numbers in another unit than shown."""
    rate, offset = "heart.rate=100 Hz", "heart.blend_in=500 s"
    done = beats("1 mm", "--set", rate, "--set", offset, "--set", "heart.respiration_rate=0.3 Hz")
    assert "warning: heart.rate=100 Hz is implausible, 100" not in done.output  # a factor of 100 itself
    assert "warning: heart.blend_in=500 s is implausible, 500 times the scenario's 1 s." in done.output
    assert "respiration_rate=0.3 Hz is" not in done.output
    Path("beats.yaml").write_text(
        SCENARIO.replace("LIMIT", "0 mm") + "console: {parameters: {heart.rate: [40 /min, 120 /min]}}\n"
    )
    done = invoke(
        "run", "beats.yaml", "--backend", "interpreted", "--no-report", "--set", rate, "--set", "heart.offset=3"
    )
    line = f"warning: {rate} is 6000 /min, outside of 40 /min to 120 /min."
    assert done.output.count(line) == 2
    assert done.output.splitlines()[-2] == line  # again above the verdict
    assert "PASS 1 of 1, 1 warning in " in done.output.splitlines()[-1]
    assert "PASS 1 of 1, 1 warning; set heart.rate" in invoke("list", "runs").output
    assert "note: heart.offset=3 means 3 m = 3000 mm. Write '3 mm' if you mean mm." in done.output
    done = invoke("run", "beats.yaml", "--backend", "interpreted", "--no-report", "--set", "heart.rate=72")
    text = "heart.rate=72 means 72 Hz = 4320 /min, outside of 40 /min to 120 /min. Write '72 /min' if you mean /min."
    assert f"warning: {text}" in done.output.splitlines()
    assert "set: heart.rate=72 Hz (4320 /min)" in done.output.splitlines()
    assert "set heart.rate=72 Hz" in invoke("list", "runs").output  # with its unit
    shown = invoke("describe", "beats.yaml", "--filter", "heart.rate").output  # as without --filter
    assert re.search(r"heart\.rate\s+60 /min\s+40 to 120 /min", shown)
    assert "Hz" not in shown


def test_two_variants_are_compared(beats):
    """Of one run, or of runs of two scenarios, which name their variants if they have nothing in common."""
    beats()
    text = (
        SCENARIO.replace("LIMIT", "1 mm") + "variants: {slow: {}, fast: {members: {heart: {parameters: {rate: 2 Hz}}}}}"
    )
    Path("mine.yaml").write_text(text)
    invoke("run", "mine.yaml", "--backend", "interpreted", "--no-report")
    done = invoke("compare", "mine/latest", "beats/latest")
    assert done.output.splitlines()[-3:] == [
        "variants of the first: slow, fast",
        "variants of the second: base",
        'Compare two of them: --variant "slow=base"',
    ]
    done = invoke("compare", "mine/latest", "beats/latest", "--variant", "slow=base")
    assert (done.exit_code, done.output.splitlines()[2][:16]) == (0, "The runs agree: ")
    done = invoke("compare", "mine/latest", "--variant", "slow=fast")
    assert done.exit_code == 1
    assert re.search(r"^ metric +slow +fast +change$", done.output, re.MULTILINE)
    assert "Name a second RUN" in invoke("compare", "mine/latest").output
    missing = invoke("compare", "mine/latest", "beats/latest", "--variant", "slow=fast").exception
    assert str(missing) == "'slow=fast': the second run has no variant 'fast'. Known: base."


@pytest.mark.slow
def test_the_proposed_change_meets_all_requirements(beats):
    """`twin describe` proposes a command; its value is the middle between the scenario's own and the upper end of its range."""
    line = next(line for line in invoke("describe", "heart_wall_force").output.splitlines() if "Change it: " in line)
    words = shlex.split(line.removeprefix("Change it: twin "))
    assert invoke(*words, "--backend", "compiled", "--seed", "1", "--no-report").exit_code == 0


@pytest.mark.slow
def test_a_study_that_has_run_is_listed_and_described(beats):
    """With its least pass rate; a repeated case shows the study's values; a mistake in `set` has its line; a name is suggested."""
    beats()
    text = "scenario: beats.yaml\nsamples: {count: 2, method: random}\nvary: {heart.rate: {uniform: [60 /min, 90 /min], source: assumed}}\n"
    Path("few_patients.yaml").write_text(text)
    assert invoke("study", "few_patients.yaml", "--workers", "1").exit_code == 0
    (folder,) = Path("runs/few_patients").glob("2*")
    assert re.search(rf"{folder.name}  STUDY of 2 cases; all pass", invoke("list", "runs").output)
    assert invoke("describe", f"few_patients/{folder.name}").output.startswith(f"{folder}: STUDY of 2 cases")
    lines = invoke("run", "--case", "few_patients:1", "--no-report", "--backend", "interpreted").output.splitlines()
    (factor,) = [line.removeprefix("set: heart.rate = ") for line in lines if line.startswith("set: ")]
    assert re.fullmatch(r"[\d.]{1,6} /min", factor)
    assert f"set heart.rate={factor}" in invoke("list", "runs").output
    assert str(invoke("run", "few_patients").exception) == "few_patients.yaml is a study: twin study few_patients.yaml"
    assert "Did you mean 'few_patients.yaml'?" in str(invoke("study", "few_patient").exception)
    Path("few_patients.yaml").write_text(f"{text}set: {{heart.rat: 1}}\n")
    assert invoke("check", "few_patients.yaml").output.startswith(
        "few_patients.yaml:4: set.heart.rat: heart has no variable `rat`."
    )


def test_implausible_values_of_a_file_over_its_base_are_named(beats):
    """By `twin check` and `twin run`; a misspelled member, too."""
    beats("0 mm")
    Path("beats.yaml").write_text(
        SCENARIO.replace("LIMIT", "0 mm") + "console: {parameters: {heart.rate: [40 /min, 120 /min]}}\n"
    )
    text = "extends: beats\nmembers: {heart: {parameters: {rate: 9 Hz, blend_in: 500 s}}, hert: {component: heart}}\n"
    Path("mine.yaml").write_text(text)
    lines = [
        "warning: mine.yaml:2: heart.rate=9 Hz is 540 /min, outside of 40 /min to 120 /min.",
        "warning: mine.yaml:2: heart.blend_in=500 s is implausible, 500 times the scenario's 1 s.",
        "note: mine.yaml:2: member `hert` is connected to nothing. Did you mean `heart`?",
    ]
    for command in (("check", "mine.yaml"), ("run", "mine.yaml", "--backend", "interpreted", "--no-report")):
        shown = invoke(*command).output.splitlines()
        assert [line for line in lines if line not in shown] == []
    assert "mine.yaml: ok, 2 warnings (1 variant" in invoke("check", "mine.yaml").output
    assert invoke("check", "beats.yaml").output.startswith("beats.yaml: ok")


def test_a_warning_of_the_scenario_is_noted_if_it_lasts(beats):
    """As a line of its own, also without an operator."""
    text = SCENARIO.replace("LIMIT", "0 mm")
    Path("beats.yaml").write_text(
        text
        + "console: {warnings: [{signal: heart.position, above: 1 mm, text: far out}, {signal: heart.position, above: 1 m, text: gone}]}\n"
    )
    lines = invoke("run", "beats.yaml", "--backend", "interpreted", "--no-report").output.splitlines()
    (line,) = [line for line in lines if line.startswith("warning: ")]
    assert line.startswith("warning: base, seed 0: far out for 0.")
    assert line.endswith(" mm, limit 1 mm")


def test_values_of_shipped_scenarios_are_reviewed():
    """Also where they differ much from those that they extend."""
    assert load_scenario("contact_force").base_tree() is None
