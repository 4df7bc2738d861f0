"""What commands do with what they are given: the work itself is replaced, its arguments and the printed lines are compared."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import click
import pytest
from click.testing import CliRunner

from twin.cli import build, check, progress, simulate, validate
from twin.cli.build import BuildResult
from twin.errors import CouplingError, SimulationError

MS = 1_000_000


class Terminal:
    """A stream that says it is a terminal."""

    def isatty(self):
        return True


def test_a_bar_on_a_terminal(monkeypatch):
    """A whole is 1; nothing happens where there is no terminal, or it is not wanted."""
    calls = []
    bar = SimpleNamespace(
        start=lambda: calls.append("start"),
        tasks=[SimpleNamespace()],
        stop=lambda: calls.append("stop"),
        add_task=lambda title, total: calls.append((title, total)),
        update=lambda task, description, completed: calls.append((description, completed)),
    )
    monkeypatch.setattr(progress, "make_bar", lambda err: bar)
    monkeypatch.setattr(sys, "stderr", Terminal())
    with progress.ProgressBar("title") as shown:
        assert calls == [("title", 1.0)]  # a refused value leaves no bar
        shown.show("text", 0.25)
    assert calls == [("title", 1.0), "start", ("text", 0.25), "stop"]
    with progress.ProgressBar("title") as shown:
        shown.show("writing the report", 1.0)
    assert bar.tasks[0].total is None  # it pulses without a percentage
    calls = calls[:4]
    with progress.ProgressBar("title", delay=60.0) as shown:
        shown.show("text", 0.25)  # a short task shows none
    assert calls[4:] == [("title", 1.0), "stop"]
    calls = calls[:4]
    with progress.ProgressBar("title", enabled=False) as shown:
        shown.show("text", 0.25)
    monkeypatch.setattr(sys, "stderr", SimpleNamespace(isatty=lambda: False))
    with progress.ProgressBar("title") as shown:
        shown.show("text", 0.25)
    assert len(calls) == 4


def test_lines_of_built_fmus(capsys):
    for result in (
        BuildResult(Path("build/2.0/a.fmu"), 1234, 2.5, True),
        BuildResult(Path("build/2.0/a.fmu"), 1234, 0.0, False),
        BuildResult(),
        BuildResult(problem="x"),
    ):
        build.report("a", "2.0", result)
    printed = capsys.readouterr()
    label = f"{'a':24} FMI 2.0  "
    assert printed.out.splitlines() == [
        f"{label}built       2.50 s    1.2 kB  build/2.0/a.fmu",
        f"{label}unchanged   0.00 s    1.2 kB  build/2.0/a.fmu",
        f"{label}Python-side component, not an FMU",
    ]
    assert printed.err == f"{label}failed\n"


def case(variant, step_ns=MS):
    return SimpleNamespace(variant=variant, algorithm="jacobi", step_ns=step_ns)


def test_stability_in_words(monkeypatch, capsys):
    """What cannot be linearized is a note; what grows is a problem with a remedy, or with none."""
    growth = SimpleNamespace(factor=1.23456, cycle=0.002, share=["a.x", "a.y", "b.z", "c.w"])
    results = {
        "stable": SimpleNamespace(is_stable=True),
        "bad": SimpleNamespace(
            is_stable=False, growth=growth, at=5 * MS, stable_settings=["step: 1 ms", "gauss_seidel"]
        ),
        "worse": SimpleNamespace(is_stable=False, growth=growth, at=0, stable_settings=[]),
    }

    def stability(case, variables, _):
        assert variables == f"of {case.variant}"
        if case.variant == "odd":
            raise CouplingError("cannot be linearized")
        return results[case.variant]

    names = ["stable", "odd", "bad", "worse"]
    seeds = []
    scenario = SimpleNamespace(
        seeds=(7, 8), cases=lambda _, chosen: seeds.append(chosen) or [case(name) for name in names]
    )
    monkeypatch.setattr("twin.run.check_stability", stability)
    monkeypatch.setattr("twin.run.resolve_catalogs", lambda _: {name: f"of {name}" for name in names})
    monkeypatch.setattr("twin.scenario.load_scenario", lambda *_: scenario)
    problems = check.check_stability("f.yaml", ())
    text = "a deviation grows 1.235 times in 2 ms, mostly a.x, a.y, b.z."
    assert problems == [
        f"f.yaml: bad: jacobi at 1 ms is unstable at t = 5 ms: {text} Use step: 1 ms or gauss_seidel.",
        f"f.yaml: worse: jacobi at 1 ms is unstable at t = 0 s: {text} No other step or algorithm tried is better.",
    ]
    assert capsys.readouterr().out.splitlines() == [
        "f.yaml: stable: jacobi at 1 ms is stable",
        "note: f.yaml: odd: cannot be linearized",
        *problems,
    ]
    assert seeds == [(7,)]


def test_the_extent_of_a_scenario():
    variants = [SimpleNamespace(members=[0] * m, connections=[0] * c) for m, c in ((2, 1), (1, 0))]
    assert (
        check.describe_extent(SimpleNamespace(variants=variants, seeds=[1]))
        == "2 variants, 1 seed, 2 members, 1 connection"
    )
    assert check.with_plural(0, "seed") == "0 seeds"


@pytest.mark.parametrize(
    ("options", "problems", "printed", "code"),
    [
        ([], [], ["f.yaml: ok (extent)"], 0),
        (["--no-import"], [], ["f.yaml: ok (extent; Python code was not checked)"], 0),
        ([], ["f.yaml:1: a", "f.yaml:2: b"], ["f.yaml:1: a", "f.yaml:2: b", "2 problems"], 1),
        (["--stability"], ["f.yaml:1: a"], ["f.yaml:1: a", "1 problem"], 1),
        (["--stability"], [], ["2 problems"], 1),
    ],
)
def test_checks_of_files(monkeypatch, options, problems, printed, code):
    """Stability is looked at where nothing else is wrong."""
    monkeypatch.setattr(check, "check_file", lambda *_: (problems, "extent"))
    monkeypatch.setattr(check, "check_stability", lambda *_: ["x", "y"])
    monkeypatch.setattr(check, "remarks_of", lambda *_: [])
    result = CliRunner().invoke(check.command, ["f.yaml", *options])
    assert (result.output.splitlines(), result.exit_code) == (printed, code)
    refused = CliRunner().invoke(check.command, ["f.yaml", "--no-import", "--hardware", "b.yaml"])
    assert "--hardware needs the imported components. Drop --no-import." in refused.output


def simulated(monkeypatch, **outcome):
    """Replace the simulation of an FMU; what it was given."""
    given = SimpleNamespace(closed=0, written=[])
    member = SimpleNamespace(log=["one", "two"], close=lambda: setattr(given, "closed", given.closed + 1))

    def plan(_, **options):
        given.plan = options
        return "planned"

    def run(_member, planned, inputs, progress, link):
        given.run = (planned, inputs, progress)
        values = {"results": SimpleNamespace(times=[0, 1000 * MS]), "notes": ["n"], "interrupted": False, "failure": ""}
        return SimpleNamespace(**values | outcome)

    def load(*arguments, **options):
        given.member = arguments, options
        return member

    monkeypatch.setattr(simulate, "supervise", lambda _: SimpleNamespace(attempt=0))
    for name, function in (("member", load), ("plan", plan), ("simulate", run)):
        monkeypatch.setattr(f"twin.fmi.{name}", function)
    monkeypatch.setattr("twin.fmi.csv_tables.check_output", lambda target: given.written.append(("checked", target)))
    monkeypatch.setattr("twin.fmi.csv_tables.write", lambda _, target: given.written.append(("written", target)))
    monkeypatch.setattr("twin.fmi.csv_tables.read_inputs", lambda path, _: f"inputs of {path}")
    return given


def test_an_fmu_alone(monkeypatch, tmp_path):
    """Results go beside the working directory, under the name of the FMU; a file that is named is not called replaced."""
    monkeypatch.chdir(tmp_path)
    given = simulated(monkeypatch)
    result = CliRunner().invoke(simulate.command, ["x/pump.fmu"])
    assert result.output.splitlines() == ["note: pump: n", "pump_out.csv: 2 rows, 0 s to 1 s"]
    assert (given.closed, given.run) == (1, ("planned", None, None))
    assert given.written == [(word, Path("pump_out.csv")) for word in ("checked", "written")]
    assert given.plan == {"start": None, "stop": None, "step": None, "interval": None, "record": ()}
    options = {"interface": "", "solver": "", "tolerance": None, "logging": False}
    assert given.member == (("pump", Path("x/pump.fmu"), {}), options)
    Path("pump_out.csv").touch()
    assert "1 s (replaced)" in CliRunner().invoke(simulate.command, ["x/pump.fmu"]).output
    arguments = [
        "x/pump.fmu",
        "-o",
        "pump_out.csv",
        "-s",
        "m=2",
        "--interface",
        "co_simulation",
        "--solver",
        "BDF",
        "--tolerance",
        "1e-3",
        "--log",
        "--start-time",
        "1",
        "--stop-time",
        "2",
        "--step-size",
        "1/30",
        "--output-interval",
        "0.1",
        "-r",
        "a*",
        "-i",
        "in.csv",
    ]
    result = CliRunner().invoke(simulate.command, arguments)
    assert result.output.splitlines() == ["log: one", "log: two", "note: pump: n", "pump_out.csv: 2 rows, 0 s to 1 s"]
    assert given.run == ("planned", "inputs of in.csv", None)
    assert given.plan == {"start": "1", "stop": "2", "step": "1/30", "interval": "0.1", "record": ("a*",)}
    options = {"interface": "co_simulation", "solver": "BDF", "tolerance": 1e-3, "logging": True}
    assert given.member == (("pump", Path("x/pump.fmu"), {"m": "2"}), options)


@pytest.mark.parametrize(
    ("outcome", "options", "error", "text"),
    [
        ({"failure": "it failed."}, [], SimulationError, "it failed. Results up to then are in pump_out.csv."),
        ({"failure": "it failed."}, ["--log"], SimulationError, "it failed. Results up to then are in pump_out.csv."),
        ({"interrupted": True, "failure": "x"}, [], click.Abort, ""),
    ],
)
def test_an_fmu_that_fails(monkeypatch, tmp_path, outcome, options, error, text):
    monkeypatch.chdir(tmp_path)
    given = simulated(monkeypatch, **outcome)
    with pytest.raises(error) as caught:
        simulate.command.main(["pump.fmu", *options], standalone_mode=False)
    assert (str(caught.value), len(given.written)) == (text, 2)
    silent = simulated(monkeypatch, failure="it failed.")
    monkeypatch.setattr("twin.fmi.member", lambda *_, **__: SimpleNamespace(log=[], close=lambda: None))
    with pytest.raises(SimulationError, match=r"Use --log to see the FMU's messages\."):
        simulate.command.main(["pump.fmu"], standalone_mode=False)
    assert silent.closed == 0


def test_predictions_of_several_files(monkeypatch, tmp_path):
    """A file that cannot be predicted is left out, and an error at the end."""
    monkeypatch.chdir(tmp_path)
    own = SimpleNamespace(title="Robot")
    seen = []

    def predict(_, patterns, window, show, refused):
        seen.append((patterns, window))
        refused |= {"c.mat": "c.mat: unknown."} if "c*" in patterns else {}
        return [SimpleNamespace(rows=[{"rmse": 1.0}])]

    monkeypatch.setattr("twin.scenario.scenario_paths.located", lambda name, kind: Path(f"{kind}/{name}.yaml"))
    monkeypatch.setattr("twin.validation.load", lambda *_: own)
    monkeypatch.setattr("twin.validation.validate", predict)
    monkeypatch.setattr("twin.validation.html", lambda *_: "page")
    monkeypatch.setattr(validate, "show", lambda title, predictions: print(title, len(predictions)))
    run = CliRunner()
    result = run.invoke(validate.command, ["robot", "--files", "a*", "--files", "c*", "--window", "0"])
    assert result.output.splitlines() == [
        "Robot 1",
        "robot_validation.html",
        "error: c.mat: unknown. The file was left out.",
    ]
    assert (result.exit_code, seen, Path("robot_validation.html").read_text()) == (1, [(("a*", "c*"), 0)], "page")
    refused = run.invoke(validate.command, ["robot"])
    assert "robot_validation.html exists. Use --force" in str(refused.exception)
    result = run.invoke(validate.command, ["robot", "--json"])
    assert (json.loads(result.output), result.exit_code) == ({"runs": [{"rmse": 1.0}], "refused": {}}, 0)
    result = run.invoke(validate.command, ["robot", "--no-report"])
    assert (result.output, result.exit_code) == ("Robot 1\n", 0)
