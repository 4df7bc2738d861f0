"""A case of a run, with its co-simulation, recording and drives replaced: what counts as complete, what is noted and kept."""

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from twin.errors import ScenarioError, SimulationError, TwinError
from twin.process import Stop
from twin.results import HardwareTermination
from twin.results.recording.run_folder import RunInfo
from twin.run import executor
from twin.run.cases import RunResult
from twin.run.executor import RunExecutor, refuse_interval, refuse_unknown_members
from twin.run.options import RunCallbacks, RunOptions

MS = 1_000_000


@dataclass(frozen=True)
class Case:
    variant: str = "PI"
    seed: int = 1
    step_ns: int = 2 * MS
    members: tuple = ("plant", "control")
    conditions: tuple = ()

    @property
    def name(self):
        return f"{self.variant}, seed {self.seed}"


ONE_CASE = Case()


@dataclass(frozen=True)
class Recorded:
    complete: bool
    last: object

    def parts(self):
        return []


class Setting:
    """A run of some cases; `fails`: what a case raises while it runs."""

    def __init__(self, monkeypatch, cases=(ONE_CASE,), *, hardware=None, expects=(), fails=None, **simulation):
        self.lines, self.shut, self.calls = [], [], []
        self.member = SimpleNamespace(log=["before"], crash_text="", logs=False, identity={"kind": "fmu"})
        self.spell = ""
        values = {"members": {"plant": self.member}, "notes": [], "failure": "", "last": (3, 7)}
        self.simulation = SimpleNamespace(
            **values | simulation,
            terminate=lambda: self.calls.append("terminate"),
            watch=SimpleNamespace(spell=lambda parts: self.spell),
        )
        self.channel = SimpleNamespace(
            keep=lambda **kept: self.calls.append(kept),
            note=lambda _: None,
            shut=lambda: self.shut.append(1),
            trouble=None,
            stopped=False,
        )
        journal = SimpleNamespace(
            start_case=lambda number: self.calls.append(("start", number)),
            append_line=lambda **line: self.lines.append(line),
            folder=Path("journal"),
            layout={},
        )
        expectations = [SimpleNamespace(ends=ends, variants=()) for ends in expects]
        scenario = SimpleNamespace(expectations=expectations, analyses=())
        self.result = RunResult(scenario, {}, RunInfo("run"))
        self.result.add_signals = lambda variant, seed, signals: self.result.tables.__setitem__(
            (variant, seed), signals
        )

        def run_case(case, simulation, progress):
            self.calls.append(("run", case.name))
            if fails is not None:
                raise fails

        self.executor = RunExecutor(
            self.result,
            list(cases),
            RunOptions(),
            RunCallbacks(run_case=run_case),
            hardware,
            self.channel,
            journal,
            Stop(),
        )
        self.created = lambda number, case: self.simulation
        monkeypatch.setattr(RunExecutor, "create_simulation", lambda _, number, case: self.created(number, case))
        monkeypatch.setattr(executor.streams, "read_case_signals", lambda *words: Recorded(words[3], words[4]))
        monkeypatch.setattr(executor, "occurrences", lambda case, simulation: [{"when": "x"}])

    def execute(self):
        return self.executor.execute_case(0, self.executor.cases[0])

    @property
    def outcome(self):
        info = self.result.run
        return info.status, info.reason, info.extra.get("notes", [])


def test_a_complete_case(monkeypatch):
    """Notes are those of this case: of the loop, and what members say while they end."""
    one = Setting(monkeypatch, notes=["late by 3 us"], failure="the plant ended it.")
    one.result.run.extra = {"notes": ["earlier"]}
    terminate = one.simulation.terminate
    one.simulation.terminate = lambda: (terminate(), one.member.log.append("bye"))
    assert one.execute()
    notes = ["PI, seed 1: the plant ended it.", "PI, seed 1: plant: bye", "PI, seed 1: late by 3 us"]
    assert one.outcome == ("completed", "", ["earlier", *notes])
    assert one.calls == [{"begun": True}, ("start", 0), ("run", "PI, seed 1"), "terminate"]
    assert one.result.tables == {("PI", 1): Recorded(True, (3, 7))}
    (line,) = one.lines
    took = line.pop("took")
    assert 0.0 <= took == one.result.run.wall_time < 10.0
    assert line.pop("ending") == {"time_ns": None, "reason": "", "unsafe": "", "log": []}
    assert line == {
        "end": 0,
        "complete": True,
        "failure": "",
        "interrupted": False,
        "last": (3, 7),
        "notes": notes,
        "occurrences": [{"when": "x"}],
        "members": {},
    }
    assert (one.shut, one.result.run.extra["conditions"]) == ([1], [{"when": "x"}])


@pytest.mark.parametrize(
    ("changes", "complete", "status", "reason"),
    [
        ({"fails": SimulationError("it broke.")}, False, "failed", "PI, seed 1: it broke."),
        ({"fails": KeyboardInterrupt()}, False, "interrupted", "interrupted in PI, seed 1"),
        ({"crash": "plant crashed."}, False, "failed", "PI, seed 1: plant crashed."),
        ({"fails": SimulationError("it broke."), "crash": "plant crashed."}, False, "failed", "PI, seed 1: it broke."),
        ({"trouble": OSError(28, "no room")}, False, "failed", "PI, seed 1: the recording cannot go on (no room)."),
        ({"spell": "plant.x is not finite."}, False, "failed", "PI, seed 1: plant.x is not finite."),
        ({"fails": SimulationError("it broke."), "spell": "x"}, False, "failed", "PI, seed 1: it broke."),
    ],
)
def test_a_case_that_does_not_end_well(monkeypatch, changes, complete, status, reason):
    """What was recorded up to then is kept, as incomplete; the first cause counts."""
    one = Setting(monkeypatch, fails=changes.get("fails"))
    one.member.crash_text, one.spell = changes.get("crash", ""), changes.get("spell", "")
    one.channel.trouble = changes.get("trouble")
    assert one.execute() is complete
    assert one.outcome[:2] == (status, reason)
    assert not one.result.tables["PI", 1].complete
    (line,) = one.lines
    failure = "" if status == "interrupted" else reason
    assert (line["complete"], line["failure"], line["interrupted"]) == (False, failure, status == "interrupted")
    assert "terminate" in one.calls


def test_a_killed_supervisor_is_the_cause(monkeypatch):
    one = Setting(monkeypatch, fails=KeyboardInterrupt())
    one.channel.stopped = True
    one.execute()
    assert one.outcome[1] == "interrupted in PI, seed 1 because its supervisor was killed"


def test_an_error_of_the_engine_ends_the_members_and_is_raised(monkeypatch):
    one = Setting(monkeypatch, fails=ZeroDivisionError("x"))
    with pytest.raises(ZeroDivisionError):
        one.execute()
    assert (one.calls[-1], one.lines) == ("terminate", [])


def test_a_case_that_cannot_be_created(monkeypatch):
    one = Setting(monkeypatch)

    def refuse(number, case):
        raise TwinError("no such FMU.")

    one.created = refuse
    assert not one.execute()
    assert one.outcome[:2] == ("failed", "PI, seed 1: no such FMU.")
    (line,) = one.lines
    assert (line["last"], line["occurrences"], line["took"], one.result.tables) == (None, [], 0.0, {})


@pytest.mark.parametrize(
    ("expects", "time", "complete"),
    [((), 5, False), (("stopped",), 5, True), (("stopped",), None, False), (("completed",), 5, False)],
)
def test_drives_that_stop_as_expected_complete_a_case(monkeypatch, expects, time, complete):
    hardware = SimpleNamespace(termination=lambda: HardwareTermination(time, "limit"))
    one = Setting(monkeypatch, hardware=hardware, expects=expects, fails=SimulationError("stopped."))
    assert one.execute() is complete
    assert one.outcome[0] == ("completed" if complete else "failed")
    assert (one.result.terminations["PI", 1].time_ns, one.lines[0]["ending"]["time_ns"]) == (time, time)


@pytest.mark.parametrize(
    ("hardware", "trouble", "complete", "count"),
    [(None, None, False, 3), ("drives", None, False, 1), (None, "full", False, 1), ("drives", "full", True, 3)],
)
def test_cases_after_one_that_failed(monkeypatch, hardware, trouble, complete, count):
    """They are run, unless drives have failed or nothing can be recorded."""
    cases = [Case(seed=seed) for seed in (1, 2, 3, 4)]
    one, run = Setting(monkeypatch, cases, hardware=hardware), []
    one.channel.trouble = trouble
    monkeypatch.setattr(
        RunExecutor, "execute_case", lambda _, number, case: run.append((number, case.seed)) or complete
    )
    one.executor.run(cases[1:])
    assert run == [(1, 2), (2, 3), (3, 4)][:count]


def test_an_interruption_ends_the_run(monkeypatch):
    cases = [Case(seed=seed) for seed in (1, 2)]
    one, run = Setting(monkeypatch, cases), []
    monkeypatch.setattr(RunExecutor, "execute_case", lambda _, number, case: run.append(case.seed) or True)
    one.executor.stop.number = 15
    one.executor.run(cases)
    assert (run, one.outcome[:2]) == ([], ("interrupted", "interrupted before PI, seed 1"))
    one.executor.stop.number = 0
    one.executor.run(cases)
    assert (run, one.outcome[1]) == ([], "interrupted before PI, seed 1")


def test_half_steps_of_the_first_case_of_each_variant(monkeypatch):
    """What is incomplete is left out; an error is a note; an interruption ends it."""
    names = [("PI", 1), ("PI", 2), ("FF", 1), ("BW", 1), ("no", 1)]
    cases = [Case(variant, seed) for variant, seed in names]
    one, refined = Setting(monkeypatch, cases), []
    one.result.tables = {name: Recorded(name != ("BW", 1), None) for name in names[:4]}

    def refine_step(result, case, signals, *_):
        refined.append(case.name)
        if case.variant == "FF":
            raise TwinError("FF cannot.")
        return [SimpleNamespace(to_dict=lambda: {"variant": case.variant})]

    monkeypatch.setattr("twin.run.step_refinement.refine_step", refine_step)
    monkeypatch.setattr("twin.run.step_refinement.summarize_refinements", lambda rows: f"{len(rows)} rows")
    one.executor.refine_steps()
    assert refined == ["PI, seed 1", "FF, seed 1"]
    assert one.outcome[2] == ["FF cannot.", "1 rows"]
    assert one.result.run.extra["half_step"] == [{"variant": "PI"}]

    def interrupted(*_):
        raise KeyboardInterrupt

    again = Setting(monkeypatch, cases)
    again.result.tables = one.result.tables
    monkeypatch.setattr("twin.run.step_refinement.refine_step", interrupted)
    again.executor.refine_steps()
    assert again.outcome == ("completed", "", ["PI, seed 1 at half the step: interrupted"])


def test_identities_of_members_of_several_variants():
    own = object.__new__(RunExecutor)
    own.result = RunResult(None, {}, RunInfo("run"))

    def record(variant, **identities):
        members = {name: SimpleNamespace(identity=identity) for name, identity in identities.items()}
        own.record_identities(Case(variant), SimpleNamespace(members=members))

    record("PI", a=1, b=2)
    record("FF", a=3, c=4)
    record("FF", a=9)
    assert own.result.run.members == {"a": 1, "b": 2, "FF: a": 3, "c": 4}


def test_options_that_do_not_fit_the_cases():
    cases = [Case(members=("plant", "control")), Case("FF", members=("plant", "feed"))]
    refuse_unknown_members(("pl*", "feed", "*"), cases)
    with pytest.raises(ScenarioError, match=r"--log plan: there is no member `plan`\. Did you mean 'plant'\?"):
        refuse_unknown_members(("plan", "plant"), cases)
    for interval in (0, 2 * MS, 8 * MS):
        refuse_interval(interval, cases)
    for interval, text in ((3 * MS, "4 ms"), (MS // 2, "2 ms"), (9 * MS // 2, "4 ms")):
        with pytest.raises(ScenarioError, match=rf"is no multiple of .* 2 ms of variant `PI`\. Use {text}\."):
            refuse_interval(interval, cases)
