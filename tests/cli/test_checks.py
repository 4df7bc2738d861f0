"""Options that exclude each other, and how a command ends: every combination as a table."""

import errno
import os
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import click
import numpy as np
import pytest
from click.testing import CliRunner

from tests.every_case import every_case
from twin.cli import error_lines, options, view
from twin.cli.export import ExportOptions, component
from twin.cli.options import PLATFORMS
from twin.cli.run import HardwareOptions, RunArguments, RunProgress, recover_interrupted, report_outcome, show_verdict
from twin.coupling import MemberVariable
from twin.errors import TwinError
from twin.run import with_unit

FILE = Path("bench.yaml")
RUN = RunArguments(
    file=Path("a.yaml"),
    study_case="",
    overrides=(),
    variants=(),
    seeds=(),
    backend="fmu",
    runs=Path("runs"),
    build=Path("build"),
    as_json=False,
    no_report=False,
    verbose=False,
    log_members=(),
    step_refinement=False,
    timeout=0.0,
    checkpoint=0,
    publish=None,
)


@every_case(
    ("arguments", "hardware", "refused"),
    [
        ({}, {}, ""),
        ({"file": None}, {}, "Name a SCENARIO, or a case of a study with --case."),
        ({"study_case": "a:1"}, {}, "Name a SCENARIO, or a case of a study with --case."),
        ({"file": None, "study_case": "a:1"}, {}, ""),
        (
            {"file": None, "study_case": "a:1", "seeds": (1,)},
            {},
            "--case sets variant and seed. Drop --variant and --seed.",
        ),
        ({"file": None, "study_case": "a:1", "variants": ("PI",)}, {}, "--case sets variant and seed."),
        ({"variants": ("PI",), "seeds": (1,)}, {}, ""),
        ({"step_refinement": True}, {}, ""),
        ({"step_refinement": True}, {"hardware_file": FILE}, "--step-refinement repeats a run"),
        ({"checkpoint": 10}, {}, ""),
        ({"checkpoint": 10}, {"hardware_file": FILE}, "--checkpoint saves what can be restored"),
        ({"publish": "udp://a"}, {"hardware_file": FILE}, ""),
        ({"publish": "udp://a", "checkpoint": 1}, {}, "--publish runs in real time."),
        ({"publish": "udp://a", "step_refinement": True}, {}, "--publish runs in real time."),
        ({}, {"dry_run": True}, "--dry-run needs --hardware FILE, and excludes --replay."),
        ({}, {"dry_run": True, "hardware_file": FILE}, ""),
        ({}, {"dry_run": True, "hardware_file": FILE, "replay": "a.blf"}, "--dry-run needs --hardware FILE"),
        ({}, {"trace": FILE}, "--trace and --replay need --hardware FILE."),
        ({}, {"replay": "a.blf"}, "--trace and --replay need --hardware FILE."),
        ({}, {"trace": FILE, "hardware_file": FILE}, ""),
        ({}, {"replay": "a.blf", "hardware_file": FILE}, ""),
        ({}, {"replay": "a.blf", "trace": FILE, "hardware_file": FILE}, "--trace and --replay exclude each other"),
    ],
)
def test_arguments_of_a_run(arguments, hardware, refused):
    try:
        replace(RUN, **arguments).check(HardwareOptions(**hardware))
    except click.UsageError as error:
        found = error.message
    else:
        found = ""
    assert found.startswith(refused)
    assert bool(found) == bool(refused)


EXPORT = ExportOptions(
    members="",
    group=None,
    variant=None,
    as_ssp=False,
    fmi=None,
    platforms=(),
    target="fmu",
    sources=False,
    clock=False,
    line_directives=False,
    needs_python=False,
    output=None,
    force=False,
    build=Path("build"),
)
ONE_SCENARIO = "--ssp exports a whole scenario."
WITH_PYTHON = "--needs-python writes an FMU with Python."


@every_case(
    ("given", "refused"),
    [
        ({}, ""),
        ({"as_ssp": True, "platforms": ("all",), "needs_python": True}, ""),
        ({"as_ssp": True, "members": "a"}, ONE_SCENARIO),
        ({"as_ssp": True, "group": "a"}, ONE_SCENARIO),
        ({"as_ssp": True, "target": "c"}, ONE_SCENARIO),
        ({"as_ssp": True, "sources": True}, ONE_SCENARIO),
        ({"as_ssp": True, "clock": True}, ONE_SCENARIO),
        ({"as_ssp": True, "line_directives": True}, ONE_SCENARIO),
        ({"sources": True, "clock": True, "platforms": ("all",)}, ""),
        ({"target": "c"}, ""),
        ({"target": "c", "line_directives": True}, ""),
        ({"target": "c", "sources": True}, "--sources is an option of FMUs"),
        ({"target": "c", "clock": True}, "--clock is an option of FMUs"),
        ({"target": "c", "platforms": ("x86_64-windows",)}, "--platform is an option of FMUs"),
        ({"line_directives": True}, "--line-directives needs --target c."),
        ({"needs_python": True}, ""),
        ({"needs_python": True, "target": "c"}, WITH_PYTHON),
        ({"needs_python": True, "sources": True}, WITH_PYTHON),
        ({"needs_python": True, "clock": True}, WITH_PYTHON),
        ({"needs_python": True, "platforms": ("all",)}, WITH_PYTHON),
    ],
)
def test_options_of_an_export(given, refused):
    try:
        replace(EXPORT, **given).check()
    except TwinError as error:
        found = str(error)
    else:
        found = ""
    assert found.startswith(refused)
    assert bool(found) == bool(refused)


def test_what_an_export_names():
    assert [
        replace(EXPORT, members=members, group=group).is_part for members, group in (("", None), ("a", None), ("", "g"))
    ] == [
        False,
        True,
        True,
    ]
    assert replace(EXPORT, platforms=("x86_64-linux", "all")).target_platforms == PLATFORMS
    assert replace(EXPORT, platforms=("x86_64-linux",)).target_platforms == ("x86_64-linux",)
    assert component("heart", EXPORT).__name__ == "Heart"
    for given in ({"members": "a"}, {"group": "g"}, {"variant": "v"}):
        with pytest.raises(TwinError, match="--members, --group and --variant need a scenario"):
            component("heart", replace(EXPORT, **given))


@click.command()
@options.duration_option("--time", "help")
@options.picture_option
@options.timeout_option("help", 2.5)
def timed(time, output, timeout):
    click.echo(f"{time} {output} {timeout}")


@every_case(
    ("arguments", "printed"),
    [
        ("", "0 None 2.5"),
        ("--time 10ms -o a.svg --timeout 0", "10000000 a.svg 0.0"),
        ("--time 1/3s", "1000000000/3 None 2.5"),
        ("--time 0s", "--time 0s: is not positive. Give a time such as 10s."),
        ("--time -1s", "--time -1s: is not positive."),
        ("--time 3kg", "--time 3kg: "),
        ("-o a.png", "-o a.png: only SVG can be written. Use -o a.svg."),
        ("--timeout -1", "Invalid value for '--timeout'"),
    ],
)
def test_shared_options(arguments, printed):
    result = CliRunner().invoke(timed, arguments.split())
    assert printed in result.output
    assert (result.exit_code == 0) == printed[0].isdigit()


@every_case(
    ("error", "line"),
    [
        (TwinError("one"), "one"),
        (MemoryError(), "not enough memory. Record less, or raise the limit (ulimit -v)."),
        (MemoryError("x"), "not enough memory (x). Record less, or raise the limit (ulimit -v)."),
        (OSError(errno.ENOMEM, "no"), "not enough memory. Record less, or raise the limit (ulimit -v)."),
        (OSError(errno.ENOSPC, "no", "f"), "f: the disk is full. Free some space; files written before are complete."),
        (OSError(errno.ENOSPC, "no"), "the disk is full. Free some space; files written before are complete."),
        (OSError(errno.EACCES, "denied", "f"), "f: denied. Check the path, its permissions and the disk."),
        (OSError("odd"), "odd. Check the path, its permissions and the disk."),
    ],
)
def test_an_expected_failure_is_a_line(error, line):
    assert error_lines(error) == [line]


def outcome(**attributes):
    """A run that is done."""
    values = {
        "status": "completed",
        "passed": True,
        "met": 2,
        "judged": 3,
        "factor": 12.34,
        "folder": "runs/a/1",
        **attributes,
    }
    verdicts = ["pass"] * values["met"] + ["fail"] * (values["judged"] - values["met"])
    expectations = [{"verdict": verdict} for verdict in verdicts + ["skipped"] * attributes.get("skipped", 0)]
    return SimpleNamespace(
        run=SimpleNamespace(
            status=values["status"],
            real_time_factor=values["factor"],
            wall_time=values.get("took", 1.2345),
            simulated_time=values.get("simulated", 9.0),
            reason="",
        ),
        phases=values.get("phases", {}),
        tables={("A", 0): SimpleNamespace(time=[0.0, 6.7]), ("A", 1): SimpleNamespace(time=[])},
        summary={"status": values["status"], "passed": values["passed"], "expectations": expectations, "metrics": {}},
        passed=values["passed"],
        folder=Path(values["folder"]),
    )


@pytest.mark.parametrize(
    ("attributes", "report", "line"),
    [
        ({}, True, "PASS 2 of 3 in 1.23 s (12x real time). Report: runs/a/1/report.html  Look: twin view latest"),
        (
            {"passed": False},
            False,
            "FAIL: 1 failed · 2 passed, in 1.23 s (12x real time). Results: runs/a/1/summary.json  Look: twin view latest",
        ),
        (
            {"met": 0, "judged": 0, "factor": 9.94},
            True,
            "DONE in 1.23 s (9.9x real time). Report: runs/a/1/report.html",
        ),
        ({"factor": 10.0}, True, "PASS 2 of 3 in 1.23 s (10x real time)."),
        ({"duration": 6.2}, True, "PASS 2 of 3 in 1.23 s (12x real time)."),
        ({"duration": 97.1}, True, "PASS 2 of 3 in 97.1 s (simulated in 1.23 s, 12x real time)."),
        ({"duration": 97.1, "factor": None}, True, "PASS 2 of 3 in 97.1 s (simulated in 1.23 s)."),
        (
            {"duration": 97.1, "phases": {"building": 51.23, "report": 4.0, "results": 12.0}},
            True,
            "PASS 2 of 3 in 97.1 s (simulated in 1.23 s, 12x real time; building 51.2 s, results 12 s).",
        ),
        ({"skipped": 11}, True, "PASS 2 of 3, 11 not judged in 1.23 s (12x real time)."),
        ({"skipped": 1, "passed": False}, True, "FAIL: 1 failed · 2 passed · 1 not judged, in 1.23 s"),
        ({"factor": None}, True, "PASS 2 of 3 in 1.23 s. Report:"),
        ({"status": "failed"}, True, "FAILED: 1 failed · 2 passed, in 1.23 s"),
        ({"status": "interrupted", "met": 3}, True, "INTERRUPTED in 1.23 s"),
        (
            {"status": "interrupted", "met": 3, "took": 0.0, "simulated": 0.0},
            True,
            "INTERRUPTED after 6.7 s of simulated time. Report",
        ),
        (
            {"folder": "other/a/1"},
            True,
            "PASS 2 of 3 in 1.23 s (12x real time). Report: other/a/1/report.html  Look: twin view other/a/1",
        ),
    ],
)
def test_the_verdict_of_a_run(capsys, attributes, report, line):
    show_verdict(outcome(**attributes), report, attributes.get("duration", 0.0))
    assert capsys.readouterr().out.startswith(line)


@every_case(
    ("option", "shown"),
    [
        ("heart.rate=1.2", "heart.rate=1.2 Hz (72 /min)"),
        ("heart.amplitude=12 mm", "heart.amplitude=12 mm (all 7 elements)"),
        ("heart.amplitude=2", "heart.amplitude=2 m (all 7 elements)"),
        ("heart.amplitude[1]=12 mm", "heart.amplitude[1]=12 mm"),
        ("heart.rate='72 /min'", "heart.rate='72 /min'"),
        ("variants.PI.heart.rate = 1e0", "variants.PI.heart.rate=1e0 Hz (60 /min)"),
        ("heart.offset[2]=0.1", "heart.offset[2]=0.1 m"),
        ("heart.offset=0.1, 0.2", "heart.offset=0.1, 0.2 (m)"),
        ("heart.gain=2", "heart.gain=2"),
        ("stop_time=5", "stop_time=5 s"),
        ("heart.period=0.1", "heart.period=0.1 s"),
        ("seeds=[1, 2]", "seeds=[1, 2]"),
        ("title=Beats", "title=Beats"),
    ],
)
def test_an_override_names_its_unit_and_how_many_elements_it_sets(option, shown):
    units = {"rate": "Hz", "offset": "m", "gain": "", "amplitude": "m"}
    shapes = {"offset": (2,), "amplitude": (7,)}
    heart = {
        name: MemberVariable(
            name, "parameter", "fixed", "Float64", np.dtype(float), shapes.get(name, ()), unit, start=1.0
        )
        for name, unit in units.items()
    }
    scenario = SimpleNamespace(console_parameters={"heart.rate": ("40 /min", "120 /min")})
    text, notes = with_unit(option, scenario, {"PI": {"heart": heart}})
    assert (f"{text} ({', '.join(notes)})" if notes else text) == shown


@pytest.mark.parametrize(
    ("attributes", "code"),
    [({}, None), ({"passed": False}, 1), ({"status": "interrupted"}, 130), ({"status": "failed", "passed": False}, 1)],
)
def test_the_exit_code_of_a_run(capsys, tmp_path, attributes, code):
    """As JSON, the summary is all that is printed."""
    (tmp_path / "summary.json").write_text('{"a": 1}')
    with nullcontext() if code is None else pytest.raises(SystemExit) as caught:
        report_outcome(outcome(folder=tmp_path, **attributes), as_json=True, report=True)
        assert code is None
    assert caught is None or caught.value.code == code
    assert capsys.readouterr().out == '{"a": 1}'


def test_a_line_for_each_variant(capsys):
    shown = RunProgress("a")
    shown.cases = ["A, seed 1", "A, seed 2", "B, C, seed 1"]
    building = ("building x (1 of 2)", "building y (2 of 2)")
    for case in (*building, "A, seed 1", "A: analysis b", *shown.cases[1:], "writing the report"):
        shown.update(case, 0.5)
    shown.show_line("log: x")
    assert capsys.readouterr().err.splitlines() == [
        "building x (1 of 2)",
        "running A (case 1 of 3)",
        "running B, C (case 3 of 3)",
        "writing the report",
        "log: x",
    ]
    quiet = RunProgress("a", enabled=False)
    quiet.update("b", 0.5)
    quiet.show_line("c")
    assert capsys.readouterr().err == ""


def test_a_run_continues_after_the_reader_of_its_progress_has_ended(monkeypatch):
    """Such as `head`: the run ended, and the next one said that it had been killed."""

    def fail(*_):
        raise BrokenPipeError

    monkeypatch.setattr("twin.cli.run.show_error", fail)
    shown = RunProgress("a")
    shown.update("A, seed 1", 0.5)
    shown.show_line("log: x")
    assert not shown.enabled


def test_the_clock_of_a_bar_runs_on_after_a_case(monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with RunProgress("a") as shown:
        shown.update("base, seed 1", 1.0)
        assert not shown.bar.finished


def test_interrupted_runs_are_recovered_first(capsys, monkeypatch):
    def recover(folder):
        if folder == "bad":
            raise TwinError("another process recovers it")
        return SimpleNamespace(run=SimpleNamespace(status="recovered", reason="it was killed"))

    monkeypatch.setattr("twin.results.find_unfinished_runs", lambda _: ["good", "bad"])
    monkeypatch.setattr("twin.run.recover", recover)
    recover_interrupted(Path("runs"))
    assert capsys.readouterr().err.splitlines() == [
        "note: good: recovered; recovered: it was killed",
        "note: another process recovers it",
    ]


def test_what_is_a_run(tmp_path, monkeypatch):
    """A folder, `latest`, what is below `runs`, and a case of a study; not an environment."""
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("a:7").touch()
    names = ("folder", "latest", "x/latest", "runs/a", "study:713", "a:7", "study:x", "two_bends", "a.svg", os.sep)
    assert [view.is_run(name) for name in names] == [True, True, True, True, True, False, False, False, False, True]
    assert view.single_run([Path("a")], "x") == Path("a")
    with pytest.raises(click.UsageError, match=r"--scene animates one run, not 2\. Name one\."):
        view.single_run([Path("a"), Path("b")], "--scene animates")


def test_an_interruption_before_the_first_step_has_no_time(capsys):
    done = outcome(status="interrupted", met=3)
    done.run.wall_time, done.run.simulated_time, done.tables = 1.47e-5, 0.0, {}
    show_verdict(done, report=False)
    assert capsys.readouterr().out.startswith("INTERRUPTED: nothing was simulated. Results:")
