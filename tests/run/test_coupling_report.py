"""Stability, computing times, rollback and half steps of a case, with its co-simulation replaced."""

from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.component import Component, PythonComponent
from twin.coupling import Algorithm, Growth
from twin.errors import CouplingError, DeclarationError, SimulationError, TwinError
from twin.results import Signals
from twin.run import cases, coupling_report, rollback, step_refinement
from twin.run.cases import RunResult
from twin.run.coupling_report import StabilityVerdict

MS = 1_000_000
BUILD = Path("build")


@dataclass(frozen=True)
class Case:
    """What these functions read of a case."""

    step_ns: int = 2 * MS
    start_ns: int = 10 * MS
    stop_ns: int = 110 * MS
    algorithm: Algorithm = field(default_factory=lambda: Algorithm("jacobi"))
    variant: str = "base"
    name: str = "base, seed 1"
    seed: int = 1
    members: tuple = ()
    events: tuple = ()


def growing(rate, cycle=2e-3):
    return Growth(float(np.exp(rate * cycle)), cycle, ("a.x",))


@pytest.fixture
def linearized(monkeypatch):
    """Replace linearization: growth by case and time; what is None cannot be linearized."""

    def replace_by(rate):
        seen = []

        def linearize_case(case, catalog, build, at):
            seen.append((case.step_ns, str(case.algorithm), at))
            found = rate(case, at)
            if found is None:
                raise SimulationError("it cannot")
            return growing(found)

        monkeypatch.setattr(coupling_report, "linearize_case", linearize_case)
        return seen

    return replace_by


def test_a_stable_case_is_looked_at_twice(linearized):
    """At its start and at the communication point in the middle; the worse of both counts."""
    seen = linearized(lambda case, at: -1.0 if at == 10 * MS else -0.5)
    told = []
    verdict = coupling_report.check_stability(Case(stop_ns=112 * MS), {}, BUILD, lambda *words: told.append(words))
    assert (verdict.is_stable, verdict.at, verdict.stable_settings) == (True, 60 * MS, ())
    assert verdict.growth.rate == pytest.approx(-0.5)
    assert [step for step in seen if step[0] == 2 * MS] == [(2 * MS, "jacobi", 10 * MS), (2 * MS, "jacobi", 60 * MS)]
    assert told == [("base: linearized at 10 ms", 0.0), ("base: linearized at 60 ms", 0.5)]
    seen.clear()
    coupling_report.check_stability(Case(stop_ns=12 * MS), {}, BUILD)
    assert [at for step, _, at in seen if step == 2 * MS] == [10 * MS]  # its start is its middle


def test_an_unstable_case_gets_settings_that_are_stable(linearized):
    """The first of half, quarter ... steps, and other algorithms; a member may refuse a step."""

    def rate(case, at):
        if case.algorithm.name == "iterative":
            return -1.0 if case.algorithm.order == 2 else 50.0
        if case.step_ns == MS:
            return None
        # grows with the step alone: the model itself decays
        return (
            -1.0 + 30.0 * case.step_ns / (2 * MS) if case.step_ns > 250_000 or case.algorithm.name != "jacobi" else -1.0
        )

    linearized(rate)
    verdict = coupling_report.check_stability(Case(), {}, BUILD)
    assert not verdict.is_stable
    assert verdict.at == 10 * MS
    assert verdict.stable_settings == ("step: 250 us", "algorithm: {name: iterative, order: 2}")


def test_where_no_setting_is_stable_none_is_named(linearized):
    linearized(lambda case, at: 50.0 if case.step_ns == 2 * MS else None)
    verdict = coupling_report.check_stability(Case(), {}, BUILD)
    assert (verdict.is_stable, verdict.stable_settings, verdict.model.factor) == (False, (), 1.0)


@every_case(
    ("coupled", "model", "stable"),
    [
        (0.0, 0.0, True),
        (0.049, 0.0, True),  # over a cycle of 2 ms: below 1e-4
        (0.051, 0.0, False),
        (2.04, 1.0, True),  # up to twice the growth of the model
        (2.06, 1.0, False),
        (0.051, -1.0, False),  # a model that decays allows no growth
    ],
)
def test_growth_that_counts(coupled, model, stable):
    assert StabilityVerdict(growing(coupled), growing(model), 0, 1.0).is_stable == stable


@pytest.fixture
def simulated(monkeypatch):
    """A co-simulation whose calls are kept."""
    calls, finished = [], []

    def call(name):
        return lambda *words: calls.append((name, *words))

    def advance(until, progress=None):
        calls.append(("advance", until))
        if progress:
            progress(until)

    class Own(SimpleNamespace):
        @property
        def finished(self):
            return bool(finished)

    own = Own(members={"m": SimpleNamespace(variables="of m")}, terminate=call("terminate"))
    own.initialize, own.advance = call("initialize"), advance
    for module in (coupling_report, step_refinement):
        monkeypatch.setattr(module, "build_simulation", lambda *words: calls.append(("build", *words)) or own)
    return SimpleNamespace(calls=calls, finished=finished, own=own)


def test_a_case_is_linearized_where_its_time_is(simulated, monkeypatch):
    """An algorithm that iterates does so to the last digit."""
    monkeypatch.setattr(coupling_report, "growth", lambda own: "growth")
    case = Case()
    for at in (case.start_ns, case.start_ns + 1):
        assert coupling_report.linearize_case(case, {}, BUILD, at) == "growth"
    names = [call[0] for call in simulated.calls]
    assert names == ["build", "initialize", "terminate", "build", "initialize", "advance", "terminate"]
    assert simulated.calls[1] == ("initialize", 10 * MS, 110 * MS)
    assert simulated.calls[5] == ("advance", case.start_ns + 1)
    assert simulated.calls[0][1] == case
    coupling_report.linearize_case(Case(algorithm=Algorithm("iterative")), {}, BUILD, 0)
    algorithm = next(call[1] for call in simulated.calls[7:] if call[0] == "build").algorithm
    assert (algorithm.agreement, algorithm.iterations) == (1e-13, 200)


def test_a_profile_runs_the_case_with_its_events(simulated, monkeypatch):
    """To the end, unless a member ends it before."""
    events = [SimpleNamespace(time_ns=30 * MS), SimpleNamespace(time_ns=60 * MS)]
    monkeypatch.setattr(
        coupling_report.members, "prebuild", lambda *words: simulated.calls.append(("prebuild", *words[1:3]))
    )
    monkeypatch.setattr(coupling_report, "Stopwatch", lambda own: "watch")
    monkeypatch.setattr(coupling_report, "profiled", lambda watch, own, names, step: (watch, names, step))
    monkeypatch.setattr(
        coupling_report, "apply_event", lambda event, *_: simulated.calls.append(("event", event.time_ns))
    )
    case, told = Case(members={}, events=events), []
    found = coupling_report.measure_profile(case, {}, "compiled", BUILD, lambda *words: told.append(words))
    assert found == ("watch", {}, 0.002)
    steps = [call for call in simulated.calls if call[0] not in ("build", "prebuild")]
    assert steps == [
        ("initialize", 10 * MS, 110 * MS),
        ("advance", 30 * MS),
        ("event", 30 * MS),
        ("advance", 60 * MS),
        ("event", 60 * MS),
        ("advance", 110 * MS),
        ("terminate",),
    ]
    assert told == [("base, seed 1", part) for part in (0.2, 0.5, 1.0)]
    assert ("prebuild", "compiled", BUILD) in simulated.calls
    simulated.finished.append(True)
    del simulated.calls[:]
    coupling_report.measure_profile(case, {}, "compiled", BUILD)
    assert [call[0] for call in simulated.calls] == ["prebuild", "build", "initialize", "advance", "terminate"]


def test_names_of_components_have_no_folders():
    names = {"a": "heart", "b": "x/rig.yaml#rig/inner@fast", "c": "x/y.fmu", "d": "mod:Class"}
    case = SimpleNamespace(members={name: SimpleNamespace(component=text) for name, text in names.items()})
    assert coupling_report.component_names(case) == {
        "a": "heart",
        "b": "rig.yaml#rig/inner@fast",
        "c": "y.fmu",
        "d": "mod:Class",
    }


class Slow(PythonComponent):
    period = 0.01


class Plain(PythonComponent):
    """Of the communication step."""


class Native(Component):
    """Of the communication step."""


def test_members_without_rollback_are_named_where_it_is_needed(monkeypatch):
    """Python-side components cannot; those with a period of their own need not."""
    monkeypatch.setattr(rollback.members, "component_of", lambda spec: spec.component)
    monkeypatch.setattr(rollback.members, "communication", lambda spec: spec.step)
    monkeypatch.setattr(rollback, "check_fmu", lambda name, *_: f"{name} of an FMU" * (name != "fine"))
    monkeypatch.setattr(rollback, "cannot_go_back", lambda name, algorithm: f"{name} cannot with {algorithm}")

    def spec(component, step=None):
        return SimpleNamespace(component=component, step=step, where="f.yaml:3")

    specs = {
        "python": spec(Plain),
        "own": spec(Slow),
        "native": spec(Native),
        "fmu": spec("a.fmu"),
        "fine": spec("a.fmu"),
    }
    specs |= {"same": spec(Plain, 2 * MS), "longer": spec(Plain, 4 * MS), "slow_fmu": spec("a.fmu", 4 * MS)}
    case = SimpleNamespace(members=specs, step_ns=2 * MS, algorithm=Algorithm("iterative"))
    problems = rollback.rollback_check(case, {})
    assert problems == [
        "f.yaml:3: python cannot with iterative",
        "f.yaml:3: fmu of an FMU",
        "f.yaml:3: same cannot with iterative",
    ]
    case.algorithm = Algorithm("jacobi")
    assert rollback.rollback_check(case, {}) == []


@pytest.mark.parametrize(
    ("member", "trials", "problem"),
    [
        ({"period_ns": MS}, [], ""),
        ({"has_fmu_state": False}, [], "m: cannot go back"),
        ({}, ["", ""], ""),
        ({}, ["differs"], "m: says that it can go back to the begin of a step, and cannot: differs."),
        ({}, ["", "differs"], "m: says that it can go back to the begin of a step, and cannot: differs."),
        ({}, [TwinError("it fails.")], "it fails."),
    ],
)
def test_an_fmu_goes_back_by_trial(monkeypatch, member, trials, problem):
    """Twice: at rest, and after its inputs have moved. It is closed whatever comes."""
    calls, left = [], list(trials)
    own = SimpleNamespace(**{"period_ns": 0, "has_fmu_state": True} | member)
    for name in ("instantiate", "enter_initialization", "exit_initialization", "close"):
        setattr(own, name, lambda *words, name=name: calls.append((name, *words)))

    def verify(_, t, h, moved=False):
        calls.append(("trial", t, h, moved))
        result = left.pop(0)
        if isinstance(result, Exception):
            raise result
        return result

    monkeypatch.setattr(rollback, "made_of", lambda *words: own)
    monkeypatch.setattr(rollback, "verify_rollback", verify)
    case = SimpleNamespace(
        values=lambda name, variables: {}, algorithm=Algorithm("iterative"), start_ns=MS, stop_ns=3 * MS, step_ns=2 * MS
    )
    found = rollback.check_fmu("m", "a.fmu", case, {"m": {}})
    assert (found[: len(problem)], bool(found)) == (problem, bool(problem))
    assert (left, calls[-1]) == ([], ("close",))
    if trials:
        assert calls[:3] == [("instantiate",), ("enter_initialization", 0.001, 0.003), ("exit_initialization",)]
        assert calls[3:-1] == [("trial", 0.001, 0.002, moved) for moved in (False, True)][: len(trials)]


@every_case(
    ("expectations", "expected"),
    [
        ([], False),
        ([("completed", ())], False),
        ([("stopped", ())], True),
        ([("stopped", ("base",))], True),
        ([("stopped", ("other",))], False),
        ([("stopped", ("other",)), ("stopped", ("base", "other"))], True),
    ],
)
def test_whether_a_case_is_expected_to_be_stopped(expectations, expected):
    scenario = SimpleNamespace(
        expectations=[SimpleNamespace(ends=ends, variants=variants) for ends, variants in expectations]
    )
    assert RunResult(scenario, {}, None).expects_stop(Case()) == expected


def test_analyses_of_a_complete_case():
    """In their order, each of its variants; an incomplete case has none."""
    told = []

    def analysis(name, variants):
        return SimpleNamespace(name=name, variants=variants, apply=lambda signals: signals.with_name(name))

    @dataclass
    class Recorded:
        complete: bool
        names: tuple = ()

        def with_name(self, name):
            return Recorded(self.complete, (*self.names, name))

    scenario = SimpleNamespace(analyses=[analysis("a", ()), analysis("b", ("other",)), analysis("c", ("base",))])
    done = cases.apply_analyses(scenario, "base", Recorded(True), lambda *words: told.append(words))
    assert (done.names, told) == (("a", "c"), [("base: analysis a", 1.0), ("base: analysis c", 1.0)])
    assert cases.apply_analyses(scenario, "base", Recorded(False)).names == ()


def test_drives_come_from_a_package_above_the_engine(monkeypatch):
    points = {}
    monkeypatch.setattr(cases.installed, "entry_points", lambda group: points if group == "twin.hardware" else None)
    with pytest.raises(DeclarationError, match=r"b\.yaml: no package for drives is installed\."):
        cases.load_hardware(Path("b.yaml"), False, BUILD)
    points["x"] = SimpleNamespace(load=lambda: lambda *words: words)
    assert cases.load_hardware(Path("b.yaml"), True, BUILD, 1, 2) == (Path("b.yaml"), True, BUILD, 1, 2)


@dataclass(frozen=True)
class Record:
    every_ns: int = 0


@dataclass(frozen=True)
class Recorded(Case):
    record: Record = Record()


@pytest.mark.parametrize(("every", "expected"), [(0, 2 * MS), (10 * MS, 10 * MS)])
def test_half_the_step_is_recorded_at_the_same_times(simulated, monkeypatch, every, expected):
    """A metric is compared if the coarse run has it, on the larger scale of both."""
    built, metrics = [], {}
    for name, variants in (("all", ()), ("other", ("other",)), ("own", ("base",)), ("none", ())):
        metrics[name] = SimpleNamespace(name=name, variants=variants)

    @dataclass(frozen=True)
    class Result:
        metric: object
        values: tuple
        mean: float
        scale: float

    def compute(metric, variant, recorded):
        ((key, which),) = recorded.items()
        assert (variant, key) == ("base", ("base", 1))
        values = () if metric.name == "none" else (1.0,)
        return Result(metric, values, 3.0 if which == "coarse" else 3.5, 1.0 if which == "coarse" else 2.0)

    monkeypatch.setattr(
        step_refinement, "run_case", lambda case, own, progress: built.append(case) or progress("x", 0.5)
    )
    monkeypatch.setattr(step_refinement, "recorded_signals", lambda own, complete: "fine" if complete else None)
    monkeypatch.setattr(step_refinement, "apply_analyses", lambda scenario, variant, signals: signals)
    monkeypatch.setattr(step_refinement, "compute_metric", compute)
    result, told = RunResult(SimpleNamespace(metrics=metrics), {"base": {}}, None), []
    rows = step_refinement.refine_step(
        result, Recorded(record=Record(every)), "coarse", "fmu", BUILD, lambda *words: told.append(words)
    )
    ((case,), (call, *_)) = built, simulated.calls
    assert (case.step_ns, case.record.every_ns, call[:2]) == (MS, expected, ("build", case))
    assert (told, simulated.calls[-1]) == ([("x, half the step", 0.5)], ("terminate",))
    found = [(row.metric_result.metric.name, row.step, row.value, row.half, row.metric_result.scale) for row in rows]
    assert found == [("all", MS, 3.0, 3.5, 2.0), ("own", MS, 3.0, 3.5, 2.0)]
    assert rows[0].difference == 0.5

    def fail(*_):
        raise CouplingError(["no"])

    monkeypatch.setattr(step_refinement, "run_case", fail)
    with pytest.raises(TwinError, match="base, seed 1 at half the step, 1 ms: no"):
        step_refinement.refine_step(result, Recorded(), "coarse", "fmu", BUILD)
    assert simulated.calls[-1] == ("terminate",)


def test_the_duration_of_a_run_counts_cases_with_rows():
    result = RunResult(None, {}, SimpleNamespace(simulated_time=1.0))
    table = Signals(np.array([0.5, 2.0]), {}, {})
    result.add_signals("a", 1, table)
    result.add_signals("a", 2, table, timed=False)
    result.add_signals("a", 3, Signals(np.empty(0), {}, {}))
    assert (result.run.simulated_time, list(result.tables)) == (2.5, [("a", 1), ("a", 2), ("a", 3)])
