"""`twin build`, `test`, `new`, `export`, `profile` and `graph`: what they ask of the packages below, what they print, how they end."""

from pathlib import Path
from types import SimpleNamespace

import click
import pytest
from click.testing import CliRunner

from tests.cli.replaced import Calls, replace
from tests.cli.test_fit_commands import run
from twin.cli import build, export, graph, new, profile
from twin.cli import test as conformance
from twin.cli.build import BuildResult
from twin.component import Component, PythonComponent, catalog
from twin.errors import ScenarioError, TwinError
from twin.process import CrashReport, SupervisorChannel


@pytest.fixture
def calls(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return Calls()


@pytest.mark.parametrize(
    ("words", "versions", "components"),
    [
        ([], ("2.0", "3.0"), ["a", "b"]),
        (["c"], ("2.0", "3.0"), ["c"]),
        (["c", "a", "--fmi", "3.0"], ("3.0",), ["c", "a"]),
    ],
)
def test_builds_of_all_components_or_of_named_ones(monkeypatch, words, versions, components):
    monkeypatch.setattr(catalog, "names", lambda: ["a", "b"])
    tasks = []

    def build_versions(*task):
        tasks.append(task)
        return [BuildResult(Path(f"{task[0]}.fmu"), 1000, 1.0, True)] * len(task[1])

    monkeypatch.setattr(build, "build_versions", build_versions)
    code, printed, errors = run(build.command, *words, "--platform", "all")
    assert (code, errors, tasks) == (0, [], [(name, versions, Path("build"), ("all",)) for name in components])
    assert printed == [
        f"{name:24} FMI {fmi}  built       1.00 s    1.0 kB  {name}.fmu" for name in components for fmi in versions
    ]


def test_problems_of_a_build_are_printed_once_and_last(monkeypatch):
    results = {"a": [BuildResult(problem="x\ny")] * 2, "b": [BuildResult(), BuildResult(problem="z")]}
    monkeypatch.setattr(build, "build_versions", lambda name, *_: results[name])
    code, printed, errors = run(build.command, "a", "b")
    label = "{:24} FMI {}  {}"
    assert (code, printed) == (1, [label.format("b", "2.0", "Python-side component, not an FMU")])
    failed = [label.format(name, fmi, "failed") for name, fmi in (("a", "2.0"), ("a", "3.0"), ("b", "3.0"))]
    assert errors == [*failed, "x", "y", "z"]


def test_one_fmu(calls, monkeypatch):
    """The file is written unless it has that content already; a component may fail in any way."""
    cls, python_side = type("Part", (Component,), {}), type("Other", (PythonComponent,), {})

    def component(name):
        if name == "wrong":
            raise TwinError("there is no component")
        if name == "odd":
            raise ZeroDivisionError("by zero")
        return {"part": cls, "python": python_side}[name]

    built = Path("stored.fmu")
    built.write_bytes(b"content")
    monkeypatch.setattr(catalog, "component", component)
    monkeypatch.setattr("twin.compiler.model_name", lambda cls: cls.__name__)
    monkeypatch.setattr("twin.fmi.exporter.is_built", calls("is_built", False))
    monkeypatch.setattr("twin.fmi.exporter.build", calls("build", built))
    result = build.build_version("part", "3.0", Path("b"), ("x86_64-linux",))
    path = Path("b/3.0/Part.fmu")
    assert (result.path, result.size, result.is_new, result.problem) == (path, 7, True, "")
    assert 0.0 <= result.seconds < 60.0
    assert calls == [
        ("is_built", cls, Path("b"), "3.0", ("x86_64-linux",)),
        ("build", cls, "3.0", Path("b"), ("x86_64-linux",)),
    ]
    number = path.stat().st_ino
    monkeypatch.setattr("twin.fmi.exporter.is_built", calls("is_built", True))
    assert not build.build_version("part", "3.0", Path("b"), ("all", "x86_64-linux")).is_new
    assert path.stat().st_ino == number
    assert calls[-1][-1] == tuple(build_platforms())
    for content in (b"changed", b"other content"):
        built.write_bytes(content)
        build.build_version("part", "3.0", Path("b"), ())
        assert path.read_bytes() == content
    assert build.build_version("python", "3.0", Path("b"), ()) == BuildResult()
    assert build.build_version("wrong", "3.0", Path("b"), ()).problem == "there is no component"
    assert build.build_version("odd", "3.0", Path("b"), ()).problem == "odd: ZeroDivisionError: by zero"


def build_platforms():
    from twin import compiler

    return compiler.PLATFORMS


@pytest.fixture
def checked(calls, monkeypatch):
    """Run `twin test` on components a, b and c with two checks; `problems`: lines by component and check."""

    def check_all(link, problems, *words):
        def check(name):
            return lambda cls, folder: problems.get((cls, name), [])

        monkeypatch.setattr(conformance, "supervise", calls("supervise", link))
        monkeypatch.setattr(catalog, "names", lambda: ["a", "b", "c"])
        monkeypatch.setattr(catalog, "component", lambda name: name)
        checks = {name: check(name) for name in ("source", "fmi")}
        monkeypatch.setattr("twin.conformance.agreement.checks", lambda cls: checks)
        monkeypatch.setattr(conformance, "problems", lambda check, cls, folder: check(cls, folder))
        return CliRunner().invoke(conformance.command, words)

    return check_all


def test_checks_of_all_components(checked, calls):
    """A problem that blocks several checks is printed once, under the first."""
    done = checked(SupervisorChannel(), {("b", "source"): ["x"], ("b", "fmi"): ["x", "y"]})
    assert done.stdout.splitlines() == ["a: ok", "b: FAILED", "c: ok"]
    assert done.stderr.splitlines() == ["  source: x", "  fmi: y"]
    assert str(done.exception) == "1 component failed."
    assert calls == [("supervise", 60.0)]
    done = checked(SupervisorChannel(), {("a", "fmi"): ["x"], ("c", "fmi"): ["y"]}, "c", "a", "--timeout", "0")
    assert (done.stdout.splitlines(), str(done.exception)) == (["c: FAILED", "a: FAILED"], "2 components failed.")
    done = checked(SupervisorChannel(), {})
    assert done.exception is None
    assert done.stdout.splitlines()[-2:] == [
        "Checked: source, units, texts; all forms agree with expected.csv to the bit.",
        "Physics is not judged: write a scenario with requirements (`expect:`).",
    ]


def test_checks_go_on_after_one_that_ended_its_process(checked):
    """The successor reports what its predecessor had found of the component, and its end; then it checks the others."""
    kept, noted = [], []
    link = SimpleNamespace(
        successor_values={"failed": 1, "begin": 1},
        crash_report=CrashReport(signal=9, note="b: fmi", unresponsive_time=60.0, log={"b": ["  source: x"]}),
        keep=lambda **values: kept.append(values),
        note=noted.append,
        log=lambda *_: None,
    )
    done = checked(link, {})
    assert done.stdout.splitlines() == ["b: FAILED", "c: ok"]
    assert done.stderr.splitlines() == [
        "  source: x",
        "  fmi: did not return for 60 s. Correct it there, or raise --timeout.",
    ]
    assert str(done.exception) == "2 components failed."
    assert kept == [{"resume": True, "begun": True, "begin": 2, "failed": 2}]
    assert noted == ["c: source", "c: fmi", ""]


def test_a_component_that_cannot_be_imported_fails(checked, monkeypatch):
    def fail(name):
        raise TwinError("there is no component")

    checked(SupervisorChannel(), {})
    monkeypatch.setattr(conformance, "supervise", lambda _: SupervisorChannel())
    monkeypatch.setattr(catalog, "component", fail)
    done = CliRunner().invoke(conformance.command, ["a"])
    assert (done.stdout, done.stderr) == ("a: FAILED\n", "  there is no component\n")


@pytest.mark.parametrize(
    ("name", "words", "reference"),
    [
        ("mine", [], "mine"),
        ("mine", ["--in", "fmus/group"], "mine"),
        ("mine", ["--in", "parts/own"], "parts.own.mine.model:Mine"),
        ("mine", ["--in", "/tmp/parts"], "mine"),
        ("shipped", ["--in", "parts"], "parts.shipped.model:Mine"),
        ("shipped", ["--in", "/fmus"], "shipped"),
        ("shipped", [], None),
        ("shipped", ["--in", "fmus/group"], None),
    ],
)
def test_a_new_component(monkeypatch, name, words, reference):
    """Only in a relative folder `fmus`, or a group of it, would it hide a component that is there."""
    monkeypatch.setattr(new, "component_names", lambda: ["shipped"])
    monkeypatch.setattr(new, "new_component", lambda path: (path, "Mine"))
    if reference is None:
        with pytest.raises(TwinError, match="'shipped' is a component already, which the new one would hide"):
            run(new.command, name, *words)
        return
    path = Path(words[1] if words else "fmus") / name
    printed = f"{path}: written. Edit {path}/model.py, then: twin test {reference}"
    assert run(new.command, name, *words)[1] == [printed]


def test_a_folder_is_complete_or_not_there(calls):
    with new.all_or_nothing(Path("a/b")):
        Path("a/b/c").touch()
    assert Path("a/b/c").exists()
    with pytest.raises(KeyboardInterrupt), new.all_or_nothing(Path("a/d")):
        Path("a/d/c").touch()
        raise KeyboardInterrupt
    assert [path.name for path in Path("a").iterdir()] == ["b"]


@pytest.fixture
def exported(calls, monkeypatch):
    """Replace the exporters; every one writes 1500 bytes."""

    def writer(name):
        def write(*arguments, **options):
            calls.append((name, *arguments, options))
            target = next(one for one in arguments if isinstance(one, Path))
            target.write_bytes(bytes(1500))
            return {"c": [target], "ssp": ["a note"]}.get(name)

        return write

    monkeypatch.setattr(catalog, "component", lambda name: f"class {name}")
    monkeypatch.setattr("twin.compiler.model_name", lambda cls: "part")
    for place, name in (
        ("twin.fmi.exporter.export", "fmu"),
        ("twin.fmi.pythonfmu_export.export", "python"),
        ("twin.compiler.library.export", "c"),
        ("twin.scenario.pack", "ssp"),
    ):
        monkeypatch.setattr(place, writer(name))
    monkeypatch.setattr("twin.scenario.load_scenario", lambda what: f"scenario {what}")
    return calls


BUILD = Path("build")
FMU = {"sources": False, "has_clock": False}
SSP = {"variant": "", "version": "2.0", "platforms": (), "needs_python": False}


@pytest.mark.parametrize(
    ("words", "call", "printed"),
    [
        (["part"], ("fmu", "class part", "3.0", Path("part.fmu"), BUILD, (), FMU), "part.fmu: FMI 3.0, 2 kB, 0.0 s"),
        (
            ["part", "--fmi", "2.0", "--sources", "--clock", "-o", "x.fmu"],
            ("fmu", "class part", "2.0", Path("x.fmu"), BUILD, (), {"sources": True, "has_clock": True}),
            "x.fmu: FMI 2.0, 2 kB, 0.0 s",
        ),
        (
            ["part", "--needs-python"],
            ("python", "class part", "3.0", Path("part.fmu"), {}),
            "part.fmu: FMI 3.0, 2 kB. It needs Python with twin wherever it runs.",
        ),
        (
            ["rig.yaml", "--ssp"],
            ("ssp", "scenario rig.yaml", Path("rig.ssp"), BUILD, SSP),
            "rig.ssp: 2 kB, 0.0 s",
        ),
        (
            ["a/rig.yml", "--ssp", "--variant", "PI", "--fmi", "3.0", "--needs-python", "-o", "x.ssp"],
            (
                "ssp",
                "scenario a/rig.yml",
                Path("x.ssp"),
                BUILD,
                SSP | {"variant": "PI", "version": "3.0", "needs_python": True},
            ),
            "x.ssp: 2 kB, 0.0 s",
        ),
    ],
)
def test_exports(exported, words, call, printed):
    assert run(export.command, *words)[1] == [printed]
    assert exported == [call]
    with pytest.raises(TwinError, match=r"exists\. Use --force to replace it"):
        run(export.command, *words)
    assert run(export.command, *words, "--force")[1] == [printed]


def test_an_export_of_c(exported):
    assert run(export.command, "part", "--target", "c", "--line-directives")[1] == ["part: 2 kB"]
    ((_, cls, name, folder, build_folder, targets, force, options),) = exported
    assert (cls, name, folder, build_folder) == ("class part", "part", Path("part"), BUILD)
    assert (force, options) == (False, {"line_directives": True})
    assert targets == ("x86_64-linux", "aarch64-linux", "cortex-m7", "cortex-a53")
    run(export.command, "part", "--target", "c", "--force", "-o", "other")
    assert (exported[1][3], exported[1][6:]) == (Path("other"), (True, {"line_directives": False}))


def test_only_scenarios_become_an_ssp(exported):
    with pytest.raises(TwinError, match=r"servomotor: --ssp needs a scenario, e\.g\. SCENARIO\.yaml\."):
        run(export.command, "servomotor", "--ssp")
    assert exported == []
    done = run(export.command, "racs", "--ssp")
    assert (done[1], done[2]) == (["racs.ssp: 2 kB, 0.0 s"], ["note: a note"])


@pytest.mark.parametrize(
    ("variant", "chosen", "message"), [(None, "PI", ""), ("PI+FF", "PI+FF", ""), ("PJ", "", r"Known: PI, PI\+FF\.")]
)
def test_the_case_of_a_graph(monkeypatch, variant, chosen, message):
    """By default that of the first variant."""
    variants = [SimpleNamespace(variant=name) for name in ("PI", "PI+FF")]
    scenario = SimpleNamespace(
        variants=variants, cases=lambda names, seeds: [SimpleNamespace(variant=names[0], seeds=seeds)]
    )
    monkeypatch.setattr("twin.scenario.load_scenario", lambda path, overrides: scenario)
    replace(monkeypatch, "twin.run", resolve_catalogs=lambda _: {"PI": 1, "PI+FF": 2})
    if message:
        with pytest.raises(ScenarioError, match=r"f\.yaml: there is no variant `PJ`\. " + message):
            graph.load_case("f.yaml", (), variant)
        return
    case, variables = graph.load_case("f.yaml", (), variant)
    assert (case.variant, case.seeds, variables) == (chosen, (), {"PI": 1, "PI+FF": 2}[chosen])


def test_a_graph_is_printed_and_drawn(calls, monkeypatch):
    structure = SimpleNamespace(
        parts=[
            SimpleNamespace(name="plant", component="beam", rank=2, period=2_000_000, feedthrough=[]),
            SimpleNamespace(
                name="control", component="pi", rank=1, period=1_000_000, feedthrough=[("u", ["e", "r"]), ("v", ["e"])]
            ),
        ],
        wires=[SimpleNamespace(source="plant.x", target="control.e", values=3, delay="1 ms")],
        summary="1 loop",
        svg=lambda alone: f"<svg {alone}/>",
    )
    monkeypatch.setattr(graph, "load_case", lambda *words: ("case", words))
    monkeypatch.setattr(graph, "analyze", lambda case, catalog: structure if case == "case" else None)
    code, printed, _ = run(graph.command, "f.yaml", "--set", "a=1", "--variant", "PI", "-o", "x.svg")
    cells = [[cell.strip() for cell in line.split("  ") if cell.strip()] for line in printed if "─" not in line]
    assert code == 0
    assert [line for line in cells if line] == [
        ["member", "component", "order", "period", "direct feedthrough"],
        ["plant", "beam", "2", "2 ms"],
        ["control", "pi", "1", "1 ms", "u: e, r; v: e"],
        ["from", "to", "values", "delay"],
        ["plant.x", "control.e", "3", "1 ms"],
        ["1 loop"],
        ["x.svg"],
    ]
    assert Path("x.svg").read_text() == "<svg True/>\n"


def test_a_profile(calls, monkeypatch):
    """Of the chosen seed; the bars of its picture are microseconds."""
    from dataclasses import dataclass

    @dataclass
    class Case:
        name: str = "case"
        seed: int = 1

    result = SimpleNamespace(costs=[SimpleNamespace(name="plant", per_tick=2e-6)])
    monkeypatch.setattr(profile, "load_case", calls("load", (Case(), "catalog")))
    monkeypatch.setattr(profile, "show", lambda shown: click.echo("shown" * (shown is result)))
    replace(monkeypatch, "twin.run", measure_profile=calls("measure", result))
    monkeypatch.setattr("twin.results.plotting.bar_chart", calls("bars", "<svg/>"))
    assert run(profile.command, "f.yaml")[1] == ["shown"]
    assert run(profile.command, "f.yaml", "--seed", "0", "--backend", "compiled", "-o", "x.svg")[1] == [
        "shown",
        "x.svg",
    ]
    measured = [(case.seed, backend.value, folder) for name, case, _, backend, folder, _ in map(as_call, calls) if name]
    assert measured == [(1, "fmu", BUILD), (0, "compiled", BUILD)]
    assert (calls[-1], Path("x.svg").read_text()) == (
        ("bars", {"plant": 2.0}, "time of a communication step [us]"),
        "<svg/>\n",
    )


def as_call(call):
    """A measurement as it is, else a row that counts as none."""
    return call if call[0] == "measure" else ("", *[None] * 5)
