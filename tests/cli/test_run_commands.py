"""`twin run`, `resume`, `recover` and `compare`: what they ask of the packages below, what they print, how they end."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from tests.cli.replaced import Calls, replace
from tests.cli.test_checks import RUN
from tests.cli.test_fit_commands import run as run_command
from tests.every_case import every_case
from twin.cli import compare, recover, resume
from twin.cli import run as run_module
from twin.cli.run import HardwareOptions
from twin.results.comparison import Comparison, Difference, MetricChange, Missing, VerdictChange


@pytest.fixture
def calls(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return Calls()


class Options(SimpleNamespace):
    """Takes any options."""


@pytest.fixture
def executed(calls, monkeypatch):
    """`execute` with everything below it replaced; what `RunOptions` and `RunCallbacks` get is kept."""
    replace(
        monkeypatch,
        "twin.run",
        RunOptions=Options,
        RunCallbacks=Options,
        resume=calls("resume", "resumed"),
        run_scenario=calls("run", "ran"),
        load_hardware=calls("hardware", "drives"),
    )
    single = SimpleNamespace(
        file=Path("of_case.yaml"),
        options=("a=1",),
        variant="PI",
        seed=7,
        applied_to=lambda scenario: scenario,
        about=None,
        compared=lambda outcome: f"{outcome} as before",
    )
    replace(monkeypatch, "twin.study", resolve_case=lambda text, runs: (text, runs), single=lambda *_: single)
    monkeypatch.setattr(run_module, "recover_interrupted", calls("recover"))
    monkeypatch.setattr(run_module, "read", calls("read", SimpleNamespace(title="Title", cases=lambda *_: [])))

    def execute(link=None, hardware=None, **options):
        from dataclasses import replace as with_changes

        link = link or SimpleNamespace(attempt=0)
        return run_module.execute(with_changes(RUN, **options), hardware or HardwareOptions(), link)

    return execute


def test_a_run(executed, calls):
    """Interrupted runs are recovered first, then the scenario is read."""
    assert executed(file=Path("x/rig.yaml"), overrides=("a=1",), seeds=(0,), variants=("PI",)) == "ran"
    recovered, read, (_, scenario, options, given) = calls
    assert (recovered, read) == (("recover", Path("runs")), ("read", Path("x/rig.yaml"), ("a=1",), Path("build")))
    assert scenario.title == "Title"
    assert (options.backend.value, options.variants, options.seeds) == ("fmu", ("PI",), (0,))
    assert (options.root, options.build) == (Path("runs"), Path("build"))
    assert (options.report, options.refine_steps, options.log_patterns, options.checkpoint_ns) == (True, False, (), 0)
    assert (given["hardware"], given["channel"].attempt) == (None, 0)
    display = given["callbacks"].progress.__self__
    assert (display.title, display.enabled) == ("Title", True)

    options = {"no_report": True, "step_refinement": True, "log_members": ("*",), "checkpoint": 5, "as_json": True}
    hardware = HardwareOptions(hardware_file=Path("b.yaml"), trace=Path("t"), replay="r", arm=True, dry_run=True)
    executed(hardware=hardware, backend="compiled", **options)
    _, _, hardware_call, (_, _, options, given) = calls[3:]
    assert hardware_call == ("hardware", Path("b.yaml"), True, Path("build"), Path("t"), "r", True)
    assert given["hardware"] == "drives"
    assert (options.report, options.refine_steps, options.log_patterns, options.checkpoint_ns) == (
        False,
        True,
        ("*",),
        5,
    )
    assert options.backend.value == "compiled"
    assert not given["callbacks"].progress.__self__.enabled


def test_a_case_of_a_study(executed, calls, capsys):
    """It names file, variant, seed and values; overrides of the command come last."""
    executed(file=None, study_case="study:7", overrides=("b=2",))
    _, read, (_, _, options, _) = calls
    assert read == ("read", Path("of_case.yaml"), ("a=1", "b=2"), Path("build"))
    assert (options.variants, options.seeds) == (("PI",), (7,))
    assert capsys.readouterr().err == "ran as before\n"


@pytest.mark.parametrize(("file", "run_remaining"), [(None, True), (Path("b.yaml"), False)])
@pytest.mark.parametrize("step_refinement", [False, True])
def test_the_run_of_a_process_that_died_is_resumed(executed, calls, capsys, file, run_remaining, step_refinement):
    """On drives its remaining cases are not run: the rig may stand anywhere."""
    link = SimpleNamespace(attempt=1, successor_values={"resume": "runs/rig/1"})
    assert executed(link, HardwareOptions(hardware_file=file), step_refinement=step_refinement) == "resumed"
    ((name, folder, _, given),) = calls
    assert (name, folder, given["run_remaining"], given["channel"]) == (
        "resume",
        Path("runs/rig/1"),
        run_remaining,
        link,
    )
    note = "note: --step-refinement was left out, since the process that ran the scenario had died\n"
    assert capsys.readouterr().err == note * step_refinement


@pytest.mark.parametrize("attempt", [0, 1])
def test_a_run_is_continued(calls, monkeypatch, attempt):
    """By the process itself, or by the successor of one that died while it continued it."""
    link = SimpleNamespace(attempt=attempt, successor_values={"resume": "runs/rig/2"})
    monkeypatch.setattr("twin.process.supervise", calls("supervise", link))
    monkeypatch.setattr(run_module, "report_outcome", calls("report"))
    monkeypatch.setattr("twin.results.resolve_latest", lambda folder: folder.parent / "1")
    functions = {"continue_run": calls("continue", "outcome"), "resume": calls("resume", "outcome")}
    replace(monkeypatch, "twin.run", RunOptions=Options, RunCallbacks=Options, **functions)
    arguments = (Path("runs/rig/latest"), Path("r"), Path("b"), False, True, 2.5)
    resume.continue_from(*arguments, at=5, overrides=("a=1",))
    supervised, (name, folder, *rest, given), reported = calls
    assert (supervised, reported) == (("supervise", 2.5), ("report", "outcome", False, False, False))
    assert (name, folder) == (("resume", Path("runs/rig/2")) if attempt else ("continue", Path("runs/rig/1")))
    assert vars(rest[0]) == {"root": Path("r"), "build": Path("b"), "report": False}
    assert given.pop("channel") is link
    display = given.pop("callbacks").progress.__self__
    assert (display.title, display.enabled) == ("rig", True)
    assert given == ({} if attempt else {"at_ns": 5, "overrides": ("a=1",)})
    del calls[:]
    resume.continue_from(*arguments[:3], True, False, 0.0, True, at=None, overrides=())
    assert calls[-1] == ("report", "outcome", True, True, True)
    assert calls[1][2].report
    assert not calls[1][-1]["callbacks"].progress.__self__.enabled


def test_a_recovered_run_is_shown_with_its_report_if_there_is_one(calls, monkeypatch):
    monkeypatch.setattr(run_module, "show", calls("show"))
    replace(monkeypatch, "twin.run", recover=calls("recover", "outcome"))
    Path("r").mkdir()
    assert run_command(recover.command, "r", "--no-report")[0] == 0
    Path("r/report.html").touch()
    assert run_command(recover.command, "r", "--verbose")[0] == 0
    assert calls == [
        ("recover", Path("r"), {"report": False}),
        ("show", "outcome", False, False),
        ("recover", Path("r"), {"report": True}),
        ("show", "outcome", True, True),
    ]


def differences(count, *, seeds=(1,), part=0.5):
    return tuple(
        Difference(f"s{i:02}", "PI", seed, 2e-3, part, 1.25 * (i + 1), "N") for i in range(count) for seed in seeds
    )


SAME = {"a": "x", "b": "x"}


@pytest.fixture
def compared(calls, monkeypatch):
    """Run `twin compare a b` with this result."""

    def with_result(signals, *words, problems=(), notes=(), overrides=(), names=SAME, **others):
        given = {"a": [], "b": list(overrides)}
        summaries = {run: {**SUMMARY, "overrides": given[run], "scenario": {"name": names[run]}} for run in "ab"}
        opened = {name: SimpleNamespace(folder=Path(name), summary=summaries[name]) for name in "ab"}
        for name in "ab":
            Path(name).mkdir(exist_ok=True)
            Path(name, "summary.json").write_text(json.dumps(summaries[name]))
        result = lambda tolerance: Comparison(tuple(signals), tuple(problems), tuple(notes), tolerance, **others)  # noqa: E731
        replace(monkeypatch, "twin.face", open_run=lambda path: opened[str(path)])

        def compare_runs(*arguments):
            calls.append(arguments)
            return result(arguments[2])

        monkeypatch.setitem(vars(sys.modules["twin.results"]), "compare_runs", compare_runs)
        code, printed, _ = run_command(compare.command, "a", "b", *words)
        lines = [" ".join(line.split()) for line in printed if line.strip() and "─" not in line]
        assert lines[0] == "first: a, 2026-01-02 10:00; PASS 1 of 1"
        assert lines[1].startswith("second: b, 2026-01-02 10:00; PASS 1 of 1")
        return code, lines[1:] if overrides else lines[2:]

    return with_result


SUMMARY = {
    "overrides": [],
    "scenario": {"name": "x"},
    "started": "2026-01-02T10:00:09",
    "status": "completed",
    "passed": True,
    "cases": [],
    "metrics": {},
    "expectations": [{"verdict": "pass"}],
}


def test_equal_runs(compared, calls):
    """Signals within the tolerance count as equal, to the limit itself."""
    same = (Difference("x", "PI", 1, 0.0, 0.0), Difference("y", "PI", 1, 1e-12, 1e-9))
    text = "The runs agree: 2 signals, 1 equal to the bit, 1 within 1e-09."
    assert compared(same, notes=["steps differ"]) == (0, [text, "note: steps differ"])
    assert calls == [((Path("a"), Path("b")), (SUMMARY, SUMMARY), 1e-9, (), ())]
    names = {"a": "x", "b": "y"}
    one_sentence = "The runs are of two scenarios, x and y: 2 signals and 0 metrics have the same name and case (--all compares them)."
    others = [Missing("signal", "first", ("a", "b"))]
    assert compared(same, names=names, missing=others) == (1, [one_sentence])
    code, lines = compared(same, names=names)  # all is in both, as where one scenario extends the other
    assert (code, lines) == (0, [one_sentence.replace(" (--all compares them)", ""), text])
    assert compared(()) == (1, ["Nothing is compared: no signal in common."])  # e.g. of a run that was interrupted
    assert compared(same, "--all", names=names)[0] == 0
    differ = "The runs differ: 0 of 2 signals (1 equal to the bit, 1 within 1e-09)"
    assert compared(same, problems=["metric m differs"]) == (1, [f"{differ}, 1 metric.", "metric m differs"])
    lines = compared(same, problems=[f"p{i}" for i in range(22)])[1]
    assert lines[0] == f"{differ}, 22 other differences."
    assert lines[-2:] == ["p19", "and 2 more: use --all"]
    assert compared(same, "--signal", "heart.*", "--tolerance", "0", "--variant", "PI")[0] == 1
    assert calls[-1][2:] == (0.0, ("heart.*",), ("PI",))
    changed = compared(same, overrides=["heart.rate=1.4 Hz", "seeds=[1]"])[1][0]
    assert changed.endswith("PASS 1 of 1; set heart.rate=1.4 Hz, seeds=[1]")


def test_differing_runs(compared):
    """The largest relative difference is on top; a row for each signal, with --all for each case; a long list is cut."""
    assert compared(differences(2)) == (
        1,
        [
            "The runs differ: 2 of 2 signals (0 equal to the bit, 0 within 1e-09).",
            compare.SIGNALS,
            "signal difference at from relative",
            "s00 0.002 N 0 s 1.25 s 0.5",
            "s01 0.002 N 0 s 2.5 s 0.5",
        ],
    )
    several = differences(2, seeds=(1, 2))
    assert compared(several)[1][2:4] == ["signal difference at from relative", "s00 0.002 N 0 s 1.25 s 0.5"]
    assert compared([each for each in several if (each.name, each.seed) != ("s01", 2)])[1][2:] == [
        "signal difference at from relative cases",
        "s00 0.002 N 0 s 1.25 s 0.5 all",
        "s01 0.002 N 0 s 2.5 s 0.5 1",
    ]
    assert compared(differences(1, seeds=(1, 2)), "--all")[1][2:] == [
        "signal difference at from relative case",
        "s00 0.002 N 0 s 1.25 s 0.5 PI, seed 1",
        "s00 0.002 N 0 s 1.25 s 0.5 PI, seed 2",
    ]
    lines = compared(differences(compare.MAX_SIGNALS))[1]
    assert (len(lines), lines[-1][:3]) == (compare.MAX_SIGNALS + 3, f"s{compare.MAX_SIGNALS - 1:02}")
    lines = compared(differences(compare.MAX_SIGNALS + 2))[1]
    assert (len(lines), lines[-1]) == (compare.MAX_SIGNALS + 4, "and 2 more: use --all")
    lines = compared(differences(compare.MAX_SIGNALS + 2), "--all")[1]
    assert (len(lines), lines[-1][:3]) == (compare.MAX_SIGNALS + 5, f"s{compare.MAX_SIGNALS + 1:02}")
    connected = [Difference(name, "PI", 1, 0.1, 0.5, 1.0, "N", 1.5) for name in ("a", "b", "c")]
    assert compared(connected)[1][-1] == "a and 2 equal 0.1 N 1.5 s 1 s 0.5"


def test_a_mean_around_zero_has_a_difference_instead_of_a_percentage(compared, monkeypatch):
    """The scale that sorts it is the largest metric of the same signal."""
    metrics = {name: {"signal": "force - setpoint", "variants": {}} for name in ("mean", "most")} | {
        "rate": {"signal": "rate", "variants": {}},
        "offset": {"signal": "offset", "variants": {}},
    }
    monkeypatch.setitem(SUMMARY, "metrics", metrics)
    values = {"mean": (8e-5, 1.2e-3), "most": (7e-2, 7.1e-2), "rate": (1.0, 1.5), "offset": (-9.0, -7.0)}
    lines = compared((), changes=[MetricChange(name, "PI", "N", *pair, 1e-6) for name, pair in values.items()])[1]
    assert [(line.split()[0], *line.split()[-2:]) for line in lines[2:6]] == [
        ("rate", "+50", "%"),
        ("offset", "+2", "N"),
        ("mean", "+0.00112", "N"),
        ("most", "+1.4", "%"),
    ]


def test_a_setting_changed_in_a_file_is_named(tmp_path, capsys):
    """Also between two variants of one run, with their names."""
    base = "stop_time: 1 s\nmembers: {heart: {component: heart}}\nvariants: {A: {}, B: {members: {heart: {parameters: {amplitude: 2 mm}}}}}\n"
    folders = tmp_path / "a", tmp_path / "b"
    for folder, rate in zip(folders, ("1 Hz", "90 /min"), strict=True):
        folder.mkdir()
        (folder / "scenario.yaml").write_text(
            base.replace("component: heart}", f"component: heart, parameters: {{rate: {rate}}}}}")
        )
    summary = {"cases": [{"variant": name} for name in "AB"]}
    compare.show_settings(folders, (summary, summary), (), False)
    compare.show_settings((folders[0], folders[0]), (summary, summary), ("A=B",), False)
    lines = [line.split() for line in capsys.readouterr().out.splitlines() if line.strip() and "─" not in line]
    assert lines[1:3] == [["setting", "first", "second"], ["heart.rate", "1", "Hz", "1.5", "Hz"]]
    assert lines[4] == ["setting", "A", "B"]
    assert [row[0] for row in lines[5:]] == ["heart.amplitude"]


def test_an_input_that_only_one_run_sets_has_its_default_in_the_other(tmp_path, capsys):
    folders = tmp_path / "a", tmp_path / "b"
    for folder, parameters in zip(folders, ("", ", parameters: {setpoint: 0.3 N}"), strict=True):
        folder.mkdir()
        text = f"stop_time: 1 s\nmembers: {{controller: {{component: pi_feedforward_control{parameters}}}}}\n"
        (folder / "scenario.yaml").write_text(text)
    summary = {"cases": [{"variant": "base"}]}
    compare.show_settings(folders, (summary, summary), (), False)
    assert capsys.readouterr().out.splitlines()[-2].split() == ["controller.setpoint", "0.2", "N", "0.3", "N"]


def test_the_answer_of_a_comparison_is_on_top(compared):
    """Changed verdicts, new failures first; then metrics in one unit a quantity, without noise around zero."""
    verdicts = (
        VerdictChange("safe", "pass", "fail"),
        VerdictChange("paper's rate", "pass", "skipped"),
        VerdictChange("paper's force", "pass", "skipped"),
    )
    changes = (
        MetricChange("force", "PI", "N", 0.01, 0.015, 0.0001),
        MetricChange("limit", "PI", "mN", 200.0, 200.0, 0.1),
        MetricChange("mean", "PI", "N", -1e-6, 3e-5, 1e-4),
    )
    problems = ["metric force of PI: 10 mN and 15 mN.", "status: completed and failed."]
    code, lines = compared((), problems=problems, verdicts=verdicts, changes=changes)
    assert code == 1
    assert lines == [
        "pass -> fail: safe",
        'pass -> skipped: 2 verdicts: "paper\'s rate" and 1 more',
        "Metrics, by relative change; a difference near or below zero:",
        "metric variant first second change",
        "force PI 10 mN 15 mN +50 %",
        "and 1 more, smaller: use --all",
        "The runs differ: no signal in common, 1 metric, 1 other difference.",
        "status: completed and failed.",
    ]
    lines = compared((), "--all", problems=problems, verdicts=verdicts, changes=changes)[1]
    assert len([line for line in lines if "force" in line and "mN" in line]) == 1  # not in the table and in words


@every_case(
    ("part", "text"),
    [
        (0.5, "+50 %"),
        (-0.997, "-100 %"),
        (-0.0287, "-2.9 %"),
        (0.0004, "+0.04 %"),
        (82.9, "83.9 times"),
        (None, "+0.00 %"),
    ],
)
def test_a_relative_change_in_words(part, text):
    assert compare.percent(part) == text


def test_runs_of_unequal_cases(compared):
    """The missing cases come first; requirements that only one run can judge are a number."""
    missing = [
        Missing("case", "second", tuple(f"PI, seed {i}" for i in range(2, 9))),
        Missing("signal", "first", ("a.x",)),
    ]
    verdicts = [VerdictChange(name, "skipped", "pass") for name in "abc"] + [
        VerdictChange("rate", "other", "pass"),
        VerdictChange("size", "pass", "cut"),
    ]
    changes = [MetricChange("slow", "PI", "N", 1.0, 1.1), MetricChange("fast", "PI", "N", 0.01, 0.5)]
    lines = compared((), missing=missing, verdicts=verdicts, changes=changes)[1]
    assert lines[0].startswith("7 cases only in the second run: PI, seed 2;")
    assert lines[1:4] == [
        'other settings -> pass: 1 verdict: "rate"',
        'pass -> run too short: 1 verdict: "size"',
        "3 requirements are judged in one run only.",
    ]
    assert [line.split()[0] for line in lines[6:8]] == ["fast", "slow"]  # by relative change
    assert lines[-1] == "1 signal only in the first run: a.x"


def test_exit_codes_reach_the_command(calls, monkeypatch):
    monkeypatch.setattr(run_module, "supervise", calls("supervise", "link"))
    monkeypatch.setattr(run_module, "execute", lambda *words: calls.append(("execute", *words)) or "outcome")
    monkeypatch.setattr(run_module, "report_outcome", calls("report"))
    words = ["a.yaml", "--hardware", "b.yaml", "--arm", "--timeout", "2", "--no-report", "--verbose"]
    assert CliRunner().invoke(run_module.command, words).exit_code == 0
    supervised, (_, options, hardware, link), (*reported, took) = calls
    assert took >= 0.0
    assert (supervised, link, tuple(reported)) == (
        ("supervise", 2.0),
        "link",
        ("report", "outcome", False, False, True),
    )
    assert (options.file, options.backend, options.checkpoint) == (Path("a.yaml"), "fmu", 0)
    assert hardware == HardwareOptions(hardware_file=Path("b.yaml"), arm=True)
    refused = CliRunner().invoke(run_module.command, ["a.yaml", "--dry-run"])
    assert (refused.exit_code, len(calls)) == (2, 3)
