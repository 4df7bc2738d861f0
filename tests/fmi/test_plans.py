"""Times of a simulation of one FMU, what is recorded of it, and its steps, without an FMU."""

import ctypes
from types import SimpleNamespace

import pytest

from tests.every_case import every_case
from tests.fmi.linear_member import real
from twin.compiler import machine
from twin.errors import FMUError, SimulationError
from twin.fmi.simulation import SimulationPlan, Stepping, choose, dividing_step, exact, plan
from twin.fmi.variables import Experiment

MS = 1_000_000


def fmu(experiment=(), period=0, fixed=None, varies=True, **causalities):
    """What a plan asks an FMU; `causalities` of its variables."""
    return SimpleNamespace(
        name="a",
        default_experiment=Experiment(*experiment),
        period_ns=period,
        fixed_step=fixed,
        capabilities={"canHandleVariableCommunicationStepSize": varies},
        identity={"file": "a.fmu"},
        variables={
            name: real(name, causality, i, 1)
            for i, (name, causality) in enumerate(causalities.items() or [("y", "output")])
        },
    )


@every_case(
    ("member", "arguments", "expected"),
    [
        # start, stop, step [ms], steps between two rows
        (fmu(), {}, (0, 1000, 2, 1)),
        (fmu((1.0, 4.0)), {}, (1000, 4000, 5, 1)),
        (fmu((1.0, None)), {}, (1000, 2000, 2, 1)),
        (fmu((1.0, 4.0)), {"start": 2, "stop": "3"}, (2000, 3000, 2, 1)),
        (fmu((None, None, None, 0.004)), {}, (0, 1000, 4, 1)),
        (fmu((None, None, None, 0.004), fixed=0.01), {}, (0, 1000, 4, 1)),
        (fmu(fixed=0.01), {}, (0, 1000, 10, 1)),
        (fmu((None, None, None, 0.004)), {"step": 0.003}, (0, 1000, 3, 1)),
        (fmu((None, float("inf"), None, float("nan"))), {}, (0, 1000, 2, 1)),
        (fmu(), {"interval": 0.1}, (0, 1000, 100, 1)),
        (fmu(), {"interval": 0.1, "step": 0.05}, (0, 1000, 50, 2)),
        (fmu((None, None, None, 0.03)), {"interval": 0.1}, (0, 1000, 25, 4)),  # divides the interval, and is not longer
        (fmu(period=10 * MS, varies=False, fixed=0.01), {}, (0, 1000, 10, 1)),
        (fmu(period=10 * MS, varies=False, fixed=0.01), {"step": 0.02, "interval": 0.04}, (0, 1000, 20, 2)),
        (fmu(period=10 * MS, varies=False), {"step": 0.02}, (0, 1000, 20, 1)),
    ],
)
def test_times(member, arguments, expected):
    """What is given, else what the FMU suggests, else a second in at least 500 round steps."""
    found = plan(member, **arguments)
    assert (found.start / MS, found.stop / MS, found.step / MS, found.every) == expected
    is_divided = expected[2:] == (25, 4)
    assert found.notes == (("step size 25 ms, of which the output interval is a multiple",) if is_divided else ())


@every_case(
    ("member", "arguments", "words"),
    [
        (fmu(), {"start": 1, "stop": 1}, r"a.fmu: stops at 1 s, not after its start 1 s\. Use --stop-time\."),
        (fmu(), {"step": 0}, r"a.fmu: step size 0 s is not positive\. Use --step-size\."),
        (fmu(), {"interval": 0}, r"a.fmu: output interval 0 s is not positive\. Use --output-interval\."),
        (
            fmu(),
            {"step": 0.03, "interval": 0.1},
            r"a.fmu: output interval 100 ms is not a multiple of the step 30 ms\. Use --step-size 0\.025 or another interval\.",
        ),
        (
            fmu(period=10 * MS, varies=False, fixed=0.01),
            {"step": 0.025},
            r"a.fmu: steps of 25 ms are no multiple of its 10 ms\. Use 20 ms or 30 ms\.",
        ),
        (
            fmu(period=10 * MS, varies=False, fixed=0.01),
            {"step": 0.004},
            r"a.fmu: steps of 4 ms are no multiple of its 10 ms\. Use 10 ms\.",
        ),
        (
            fmu(period=10 * MS, varies=False, fixed=0.01),
            {"stop": 0.105},
            r"a.fmu: cannot shorten its last step of 10 ms to stop at 105 ms\. Use --stop-time 100 ms or 110 ms\.",
        ),
    ],
)
def test_times_that_do_not_fit(member, arguments, words):
    with pytest.raises(FMUError, match=f"^{words}$"):
        plan(member, **arguments)


@every_case(
    ("interval", "longest", "expected"),
    [(10, 10, 10), (10, 4, 2), (10, 3, 2), (100, 30, 25), (7, 2, 1), (7, 7, 7), (9, 100, 9)],
)
def test_the_longest_step_that_divides_an_interval(interval, longest, expected):
    assert dividing_step(interval, longest) == expected


def test_a_suggested_time_that_is_none_is_left_out():
    assert [exact(None, suggested, 7, "x") for suggested in (None, float("nan"), float("inf"), 0.5)] == [
        7,
        7,
        7,
        500 * MS,
    ]
    assert exact(0, 0.5, 7, "x") == 0


def test_what_is_recorded():
    member, notes = fmu(y="output", yy="output", u="input", x="local"), []
    assert choose(member, (), notes) == ("y", "yy")
    assert choose(member, ("x", "y*", "y"), notes) == ("x", "y", "yy")
    assert choose(member, ("?",), notes) == ("y", "u", "x")
    assert notes == []
    assert choose(fmu(x="local", p="parameter"), (), notes) == ("x",)
    assert notes == ["has no outputs: its local variables are recorded"]
    notes.clear()
    assert choose(fmu(p="parameter"), (), notes) == ()
    assert notes == ["has no outputs and no local variables: only time is recorded; --record names more"]
    with pytest.raises(FMUError, match=r"^a.fmu: has no variable 'yyz' to record\. Did you mean 'yy'\?"):
        choose(member, ("yyz",), notes)


class Stepped:
    """A member whose step function is written in Python; `ends`: what it does in the step that reaches this time [s]."""

    name, instance, step_signature = "a", 0, machine.FMI3

    def __init__(self, ends=None, status=0, terminate=False, early=False, reached=0.0, reason=""):
        self.steps, self.times, self.last = [], [], [0, 0.0]
        self.reason, self.rows = reason, []

        def step(_instance, t, h, is_final, _event, stop, stopped_early, last):
            self.steps.append((t, h, is_final))
            if ends is None or t + h < ends:
                return 0
            machine.write8(stop, terminate)
            machine.write8(stopped_early, early)
            machine.write_float(last, reached)
            return status

        self._step = machine.STEP(step)
        self.step_function = ctypes.cast(self._step, ctypes.c_void_p).value

    def __call__(self, time):  # as the sampler
        self.times.append(time)

    def finish_reason(self):
        return self.reason

    def check(self, status, what):
        raise SimulationError(f"{what} {status}")

    def last_successful_time(self, reached):
        return reached

    def run(self, stop=10, step=4, every=1):
        """The notes of a run from 2 ms on; times in ms."""
        own = SimulationPlan(2 * MS, stop * MS, step * MS, every, ())
        outcome = SimpleNamespace(notes=[])
        self.fed, self.progress = [], []
        self.times = [own.start]
        Stepping(self, own, self.fed.append).run(self, outcome, self.progress.append)
        return outcome.notes


def test_steps_and_rows():
    """The last step is shorter; inputs are set before each step, rows recorded after every so many and at the end."""
    member = Stepped()
    assert member.run(stop=9, step=4, every=3) == []
    assert member.steps == [(0.002, 0.004, True), (0.006, 0.003, True)]
    assert member.fed == [0.002, 0.006]
    assert member.times == [2 * MS, 9 * MS]
    assert member.last[1] == 0.006
    assert member.progress == [0.0]
    member = Stepped()
    member.run(stop=10, step=2, every=2)
    assert member.times == [2 * MS, 6 * MS, 10 * MS]
    assert len(member.steps) == 4


@every_case(
    ("settings", "note", "times"),
    [
        ({"terminate": True, "reached": 0.006}, "its terminate flag is set", [2, 6]),
        ({"terminate": True, "reached": 0.005}, "its terminate flag is set", [2, 5]),
        ({"terminate": True, "reached": 0.002}, "its terminate flag is set", [2]),
        ({"terminate": True, "reached": 0.009}, "its terminate flag is set", [2]),
        ({"terminate": True, "reached": 0.006, "status": 1}, "its terminate flag is set", [2, 6]),
        ({"status": 2, "reason": "it set fmi2Terminated.", "reached": 0.004}, "it set fmi2Terminated.", [2, 4]),
    ],
)
def test_an_end_that_the_fmu_wants(settings, note, times):
    """A row at the time that it reached, if that is in the step."""
    member = Stepped(ends=0.006, **settings)
    assert member.run() == [f"ended the simulation in the step from 2 ms: {note}"]
    assert member.times == [time * MS for time in times]


def test_failures():
    for status in (2, 3, 4):
        with pytest.raises(SimulationError, match=f"^doStep {status}$"):
            Stepped(ends=0.006, status=status).run()
    assert Stepped(ends=0.006, status=1).run() == []  # a warning
    with pytest.raises(SimulationError, match=r"^a: returned early at 0\.005 s, though not allowed to\.$"):
        Stepped(ends=0.006, early=True, reached=0.005).run()
