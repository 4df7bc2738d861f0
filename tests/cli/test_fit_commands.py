"""`twin calibrate`, `identify`, `study` and `follow`: what they ask of the packages below, what they write, how they end.

Over 400 lines: four commands with the same replaced packages below.
"""

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import click
import pytest
from click.testing import CliRunner

from tests.cli.replaced import Calls, replace
from tests.every_case import every_case
from twin.cli import calibrate, follow, identify, study, validate
from twin.errors import SimulationError, TwinError
from twin.study import percent


class Study(NamedTuple):
    name: str
    title: str


@pytest.fixture
def calls(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return Calls()


def run(command, *words):
    """Exit code, stdout and stderr as lines; an expected error is raised."""
    done = CliRunner().invoke(command, words)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.exit_code, done.stdout.splitlines(), done.stderr.splitlines()


@pytest.fixture
def calibration(calls, monkeypatch):
    result = SimpleNamespace(parameters={"a": 1.0, "b": 2.0}, fits={"line": 1})
    tables = {"linear": {"handle": "handle [m]", "tip": "tip [m]"}, "empty": {}}
    package = "twin.results.calibration."
    monkeypatch.setattr("twin.component.catalog.component", lambda name: f"class {name}")
    monkeypatch.setattr(package + "calibration_module", lambda cls, name: SimpleNamespace(TABLES=tables))
    monkeypatch.setattr(package + "calibrate", calls("calibrate", result))
    package = "twin.results.calibration_report."
    monkeypatch.setattr(package + "fit_cells", lambda fit: ("good", "0.1", "9", "-", "2 of 3", "0.5"))
    monkeypatch.setattr(package + "parameter_rows", lambda result: [("a", "1", "0.1")])
    monkeypatch.setattr(package + "warnings", lambda result: ["few points"])
    monkeypatch.setattr(package + "to_yaml", calls("yaml", "a: 1\n"))
    monkeypatch.setattr(package + "to_svg", lambda result: "<svg>")
    monkeypatch.setattr(calibrate, "read_aliases", lambda path: f"aliases of {path}")
    return result


def test_calibration_lists_the_tables_of_a_component(calibration):
    assert run(calibrate.command, "part")[1] == [
        "part is calibrated from these tables; name one or more as TABLE=FILE.csv:",
        "",
        "linear",
        "  handle        handle [m]",
        "  tip           tip [m]",
        "",
        "empty",
    ]


def test_a_calibration(calibration, calls):
    files = {"linear": Path("a=b.csv"), "empty": Path("c.csv")}
    words = ("part", "linear=a=b.csv", "empty=c.csv")
    end = "4 parameters. Copy them to `parameters:` of the member."
    code, lines, errors = run(calibrate.command, *words)
    assert (code, errors) == (0, ["few points"])
    assert [line.split() for line in lines if line.split()[:1] in (["line"], ["a"])] == [
        ["line", "good", "0.1", "9", "-", "2", "of", "3", "0.5"],
        ["a", "1", "0.1"],
    ]
    assert lines[-2:] == [f"part.yaml: {end.replace('4', '2')}", "part.svg: measured over fitted values."]
    assert calls == [
        ("calibrate", "class part", "part", files, {}),
        ("yaml", "part", files, calibration),
    ]
    assert Path("part.yaml").read_text() == "a: 1\n"
    with pytest.raises(TwinError, match=r"part\.yaml exists\. Use --force"):
        run(calibrate.command, *words)
    assert run(calibrate.command, *words, "--force", "--columns", "c.yaml")[0] == 0
    assert calls[2][-1] == "aliases of c.yaml"
    assert run(calibrate.command, *words, "-o", "x.yaml")[1][-2].startswith("x.yaml: 2 parameters.")


def test_a_calibration_is_written_before_it_is_printed(calibration, monkeypatch):
    """`twin calibrate ... | head -1` closes the pipe early; the files exist nevertheless."""

    def show(result):
        raise BrokenPipeError

    monkeypatch.setattr(calibrate, "show", show)
    with pytest.raises(BrokenPipeError):
        run(calibrate.command, "part", "linear=a.csv")
    assert Path("part.yaml").read_text() == "a: 1\n"
    assert Path("part.svg").read_text() == "<svg>"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["linear"], "linear: expected TABLE=FILE.csv, such as linear=moves.csv."),
        (["linear="], "linear=: expected TABLE=FILE.csv, such as linear=moves.csv."),
        (["a=b.csv", "a=c.csv"], "a=c.csv: table a is given twice. Merge its measurements into one file."),
    ],
)
def test_tables_of_a_calibration_are_named_once_with_a_file(calibration, words, message):
    with pytest.raises(TwinError) as caught:
        run(calibrate.command, "part", *words)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("passed", "interrupted", "code"), [(True, False, 0), (False, False, 1), (True, True, 130), (False, True, 130)]
)
def test_an_identification(calls, monkeypatch, passed, interrupted, code):
    """Parameter set and report have the same name; they are written however it ended."""
    result = SimpleNamespace(
        text=lambda folder: f"set for {folder}", fit=SimpleNamespace(interrupted=interrupted), passed=passed
    )
    replace(
        monkeypatch,
        "twin.identify",
        load=lambda file: SimpleNamespace(title=f"problem of {file}"),
        identify=calls("identify", result),
        html=lambda _: "page",
        command_line=lambda words: " ".join(["twin identify", *words]),
    )
    monkeypatch.setattr(identify, "show", lambda shown: click.echo("shown" * (shown is result)))
    monkeypatch.setattr(sys, "argv", ["twin", "identify", "mass.yaml"])
    Path("mass_parameters.yaml").mkdir()
    with pytest.raises(TwinError, match=r"mass_parameters\.yaml exists"):
        run(identify.command, "mass.yaml")
    Path("mass_parameters.yaml").rmdir()
    line = "list it last in `parameter_sets` of a scenario to use it for all members of its components."
    printed = ["shown", f"mass_parameters.yaml: {line}", "mass_parameters.html"]
    assert run(identify.command, "mass.yaml")[:2] == (code, printed)
    (_, problem, options), *_ = calls
    assert problem.title == "problem of mass.yaml"
    options.pop("progress")
    given = {"starts": 8, "seed": 0, "intervals": "jacobian", "build": Path("build")}
    assert options == {**given, "command": "twin identify mass.yaml"}
    assert Path("mass_parameters.yaml").read_text() == "set for ."
    assert Path("mass_parameters.html").read_text() == "page"

    Path("sub").mkdir()
    Path("sub/x.html").touch()  # of an earlier run: not in the way where no report is wanted
    words = ("--starts", "10000", "--seed", "2147483647", "--intervals", "profile", "-o", "sub/x.yaml", "--no-report")
    assert run(identify.command, "mass.yaml", *words)[:2] == (code, ["shown", f"sub/x.yaml: {line}"])
    assert {"starts": 10_000, "seed": 2**31 - 1, "intervals": "profile"}.items() <= calls[1][2].items()
    assert (Path("sub/x.yaml").read_text(), Path("sub/x.html").read_text()) == ("set for sub", "")


@pytest.mark.parametrize(
    "words", [("--starts", "0"), ("--starts", "10001"), ("--seed", "-1"), ("--seed", "2147483648")]
)
def test_limits_of_restarts_and_seeds(words):
    assert run(identify.command, "mass.yaml", *words)[0] == 2
    assert "is not in the range" in CliRunner().invoke(identify.command, ["mass.yaml", *words]).stderr


@pytest.fixture
def studied(calls, monkeypatch):
    """Run `twin study a.yaml` with this number of cases, of which `failed` did not finish."""

    def study_with(status, cases, failed, *words, parts=()):
        folder = Path("runs/a/time")
        outcome = SimpleNamespace(cases=SimpleNamespace(rows=[0] * cases), status=status, folder=folder)
        replace(
            monkeypatch,
            "twin.study",
            load_study=lambda file: Study(file.stem, "Title"),
            is_complete=lambda *_: status == "complete before",
            latest=lambda runs, name: Path(f"latest {name} in {runs}"),
            run_study=calls("study", outcome),
            Answers=lambda _: SimpleNamespace(
                failed=failed, shares=[SimpleNamespace(name=f"R{part}", variant="A", part=part) for part in parts]
            ),
            percent=percent,
        )
        monkeypatch.setattr(study, "show", lambda *_: click.echo("shown"))
        monkeypatch.setattr(
            study, "show_verdict", lambda outcome, _, file, *__, **___: click.echo(f"DONE {outcome.folder}/{file}")
        )
        monkeypatch.setattr(sys, "argv", ["twin", "study", "a b.yaml"])
        return run(study.command, "a.yaml", *words)

    return study_with


@pytest.mark.parametrize(
    ("status", "cases", "failed", "result"),
    [
        ("completed", 3, 0, (0, ["shown", "DONE runs/a/time/report.html"], [])),
        ("completed", 3, 1, (1, ["shown", "DONE runs/a/time/report.html"], [])),
        (
            "interrupted",
            1,
            1,
            (
                130,
                ["shown", "DONE runs/a/time/report.html"],
                ["interrupted: 1 finished case is kept. Continue: twin study 'a b.yaml' --resume"],
            ),
        ),
        (
            "interrupted",
            0,
            0,
            (130, [], ["interrupted: no case is finished. Continue: twin study 'a b.yaml' --resume"]),
        ),
    ],
)
def test_how_a_study_ends(studied, status, cases, failed, result):
    code, printed, errors = result
    begin = ["reading a.yaml ...", "Title"]
    assert studied(status, cases, failed) == (code, printed, [*begin, *errors])


@every_case(
    ("words", "parts", "code", "printed"),
    [
        (["--require-pass"], (1.0,), 0, []),
        (["--require-pass"], (1.0, 0.96), 1, ["below: R0.96 (A): pass rate 96 %, required 100 %"]),
        (["--require-pass", "95 %"], (1.0, 0.96), 0, []),
        (["--require-pass=0.97"], (0.96,), 1, ["below: R0.96 (A): pass rate 96 %, required 97 %"]),
        (["--require-pass"], (), 1, ["below: no requirement is judged, so that none can pass"]),
    ],
)
def test_a_study_is_a_gate(studied, words, parts, code, printed):
    assert studied("completed", 3, 0, *words, parts=parts)[:2] == (
        code,
        ["shown", *printed, "DONE runs/a/time/report.html"],
    )


def test_a_gate_needs_a_rate(studied):
    code, _, errors = studied("completed", 3, 0, "--require-pass", "95")
    assert (code, "'95' is no pass rate. Give one such as '95 %', after the study." in errors[-1]) == (2, True)


def test_a_complete_study_is_a_gate(studied, tmp_path):
    answers = {"expectations": [{"name": "near", "variant": "A", "part": 0.5}]}
    (tmp_path / "latest a in runs").mkdir()
    (tmp_path / "latest a in runs/answers.json").write_text(json.dumps(answers))
    code, printed, _ = studied("complete before", 3, 0, "--resume", "--require-pass")
    assert (code, printed[1:]) == (1, ["below: near (A): pass rate 50 %, required 100 %"])


def test_a_complete_study_is_not_run_again(studied, calls):
    lines = ["Title: already complete, nothing run. Results: latest a in runs"]
    assert studied("complete before", 3, 0, "--resume") == (0, lines, ["reading a.yaml ..."])
    assert not calls


def test_options_of_a_study(studied, calls):
    studied("completed", 1, 0)
    words = ("--workers", "1024", "--scheduler", "tcp://h:1", "--resume", "--timeout", "2.5", "--memory", "1.5")
    printed = studied("completed", 1, 0, *words, "--runs", "r", "--build", "b", "--no-report")[1]
    assert printed == ["shown", "DONE runs/a/time/cases.parquet"]
    (_, first, defaults), (_, _, given) = calls
    assert first == Study("a", "Title")
    for key in ("listen", "notify"):
        assert (defaults.pop(key), given.pop(key)) != (None, None)
    common = {"command": "twin study 'a b.yaml'"}
    assert defaults == common | {
        "root": Path("runs"),
        "build": Path("build"),
        "workers": 0,
        "scheduler": "",
        "timeout": 0.0,
        "memory": 0,
        "resume": None,
        "report": True,
    }
    assert given == common | {
        "root": Path("r"),
        "build": Path("b"),
        "workers": 1024,
        "scheduler": "tcp://h:1",
        "timeout": 2.5,
        "memory": 1_500_000_000,
        "resume": Path("latest a in r"),
        "report": False,
    }


def fake_follow(calls, monkeypatch, *measured):
    """Replace following: these estimates come, or an error is raised."""
    case = SimpleNamespace(start_ns=1_000_000_000, stop_ns=5_000_000_000, variant="base")
    problem = SimpleNamespace(title="Mass", experiment=SimpleNamespace(case=case))

    def estimates(*_):
        for one in measured:
            if isinstance(one, BaseException):
                raise one
            yield SimpleNamespace(time=one, alarm=None)

    replace(
        monkeypatch,
        "twin.follow",
        has_rig=lambda file: file.stem == "rig",
        load=calls("load", problem),
        follow=estimates,
        in_band=lambda _: 0.25,
        write_run=calls("write", Path("runs/mass/1")),
    )
    monkeypatch.setattr("twin.results.link_latest", calls("latest"))
    monkeypatch.setattr(follow, "show", lambda _, made, *rest: calls.append(("show", len(made), *rest)))
    monkeypatch.setattr("twin.cli.follow_live.follow_live", calls("live"))
    return problem


@pytest.mark.parametrize(
    ("measured", "code", "status", "failure"),
    [
        ((2.0, 3.0), 0, "completed", ""),
        ((2.0, SimulationError("left the range")), 1, "failed", "left the range"),
        ((2.0, 3.0, KeyboardInterrupt()), 130, "interrupted", "interrupted after 2 measurements"),
    ],
)
def test_a_recording_is_followed(calls, monkeypatch, measured, code, status, failure):
    """Whatever ends it, the estimates up to then are written and shown."""
    problem = fake_follow(calls, monkeypatch, *measured)
    shown = []
    monkeypatch.setattr(follow.ProgressBar, "show", lambda _, *shares: shown.append(shares))
    done = run(follow.command, "mass.yaml", "--recording", "bench.csv", "--runs", "r")
    count, folder = sum(isinstance(one, float) for one in measured), Path("runs/mass/1")
    assert done == (code, [], [f"{status}: {failure}"] if failure else [])
    assert shown == [("base", (one - 1.0) / 4.0) for one in measured if isinstance(one, float)]
    loaded, (_, written, estimates, root, seconds, *outcome), *rest = calls
    assert loaded == ("load", Path("mass.yaml"), Path("bench.csv"))
    assert (written is problem, len(estimates), root, outcome) == (True, count, Path("r"), [failure, status])
    assert 0.0 <= seconds < 60.0
    assert rest == [("latest", folder), ("show", count, [], f"{count} times with measurements", 0.25, folder)]


@pytest.mark.parametrize(
    ("measured", "message"),
    [
        ((), r"mass\.yaml: no measured value lies after the start of the model\. Check its times\."),
        ((SimulationError("left the range"),), "left the range"),
    ],
)
def test_nothing_is_written_without_an_estimate(calls, monkeypatch, measured, message):
    fake_follow(calls, monkeypatch, *measured)
    with pytest.raises(SimulationError, match=message):
        run(follow.command, "mass.yaml")
    assert [call[0] for call in calls] == ["load"]


@pytest.mark.parametrize(
    ("words", "code", "followed"),
    [
        (["rig.yaml"], 0, ("live", Path("rig.yaml"), None, 0)),
        (
            ["mass.yaml", "--rig", "udp://h:1", "--duration", "2s"],
            0,
            ("live", Path("mass.yaml"), "udp://h:1", 2 * 10**9),
        ),
        (["rig.yaml", "--recording", "b.csv"], 0, ("load", Path("rig.yaml"), Path("b.csv"))),
        (["mass.yaml", "--rig", "udp://h:1", "--recording", "b.csv"], 2, "--rig and --recording exclude each other."),
        (["mass.yaml", "--duration", "2s"], 2, "--duration is for a rig. A recording has its own end."),
        (["mass.yaml", "--port", "9000"], 2, "--port and --no-open are for a page. Add --console."),
        (["mass.yaml", "--no-open"], 2, "--port and --no-open are for a page. Add --console."),
    ],
)
def test_what_is_followed(calls, monkeypatch, words, code, followed):
    fake_follow(calls, monkeypatch, 2.0)
    done = run(follow.command, *words)
    assert done[0] == code
    assert (calls[0][: len(followed)] == followed) if code == 0 else (followed in done[2][-1])


def test_the_page_of_a_recording_is_served_at_the_end(calls, monkeypatch):
    fake_follow(calls, monkeypatch, 2.0)
    monkeypatch.setattr(follow, "serve", calls("serve"))
    assert run(follow.command, "mass.yaml", "--console", "--port", "9000")[0] == 0
    name, folder, port, _, options = calls[-1]
    assert (name, folder, port, options) == ("serve", Path("runs/mass/1"), 9000, {"open_browser": True})


@pytest.fixture
def validated(calls, monkeypatch):
    """Replace validation; a file that cannot be predicted is `b.mat` where all files are asked for."""
    own = SimpleNamespace(title="Robot")

    def predict(_, patterns, window, progress, refused):
        refused |= {} if patterns else {"b.mat": "b.mat: unknown."}
        return calls("validate", [])(own, patterns, window, progress)

    replace(
        monkeypatch,
        "twin.validation",
        load=calls("load", own),
        fit_and_freeze=calls("fit", "frozen"),
        frozen_path=lambda path: path.with_name("robot.parameters.yaml"),
        frozen_text=lambda title, frozen: f"{title}: {frozen}",
        html=lambda *_: "page",
        validate=predict,
    )
    monkeypatch.setattr("twin.scenario.scenario_paths.located", lambda name, kind: Path(f"{name}.yaml"))
    monkeypatch.setattr(validate, "show", lambda *_: click.echo("shown"))
    monkeypatch.setattr(validate, "show_fit", lambda title, frozen: click.echo(f"fitted {title} {frozen}"))
    return calls


def test_parameters_are_fitted_and_frozen(validated):
    """Without a report; an earlier file is not replaced."""
    words = ("robot", "--data", "measured", "--fit", "--only", "sine", "--starts", "3", "--seed", "5")
    printed = ["fitted Robot frozen", "robot.parameters.yaml: frozen."]
    assert run(validate.command, *words) == (0, printed, [])
    (_, path, data, folder), (_, own, only, options) = validated
    assert (path, data, folder, own.title, only) == (
        Path("robot.yaml"),
        Path("measured"),
        Path("build"),
        "Robot",
        ("sine",),
    )
    options.pop("progress")
    assert options == {"starts": 3, "seed": 5}
    assert [file.name for file in Path().iterdir()] == ["robot.parameters.yaml"]
    assert Path("robot.parameters.yaml").read_text() == "Robot: frozen"
    with pytest.raises(TwinError, match=r"robot\.parameters\.yaml exists\. Use --force"):
        run(validate.command, *words)
    assert run(validate.command, *words, "--force", "-o", "x.html")[0] == 0
    Path("x.html").touch()
    with pytest.raises(TwinError, match=r"x\.html exists\. Use --force"):
        run(validate.command, "robot", "-o", "x.html")


@pytest.mark.parametrize(
    ("words", "page", "code"),
    [
        ((), "robot_validation.html", 1),
        (("--files", "a*"), "robot_validation.html", 0),
        (("--no-report",), None, 1),
        (("--json",), None, 1),
        (("--json", "-o", "x.html"), "x.html", 1),
        (("--no-report", "-o", "x.html"), "x.html", 1),
    ],
)
def test_where_a_prediction_is_written(validated, words, page, code):
    """A report that is named is written in any case. A file that is refused is an error, after all else."""
    done = run(validate.command, "robot", *words)
    assert [file.name for file in Path().iterdir()] == ([page] if page else [])
    assert done[0] == code
    assert done[2] == ["error: b.mat: unknown. The file was left out."] * code
    if "--json" not in words:
        assert done[1] == ["shown", *([page] if page else [])]
    assert validated[1][2:4] == (words[1:] if words[:1] == ("--files",) else (), None)
