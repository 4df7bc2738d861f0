"""Steps of FMI 3.0 that the importer takes part in: ticks as events, substeps in sight, and early return."""

import ctypes

import numpy as np
import pytest
from fmpy import extract, simulate_fmu
from fmpy.fmi1 import FMICallException

from tests.fmi.loaded import Fmu, reference_outputs
from tests.fmi.parts import Failing, Masses, Sampler, Stiff
from twin.component import OK, Component, Int32, catalog, input, output
from twin.component.solver import DISCARD
from twin.fmi.exporting import exporter

PERIOD = Sampler.period


def unpacked(part, build, folder):
    """A further component as the fixture `fmus` has its parts."""
    path = exporter.build(part, "3.0", build / "tests")
    extract(str(path), str(folder))
    return {(part, "3.0"): (path, folder)}


# --------------------------------------------------------------------------------------------------------- Event Mode


def eventful(fmus, part=Sampler, early=True, start=0.0):
    """An instance in the Event Mode that follows initialization."""
    return Fmu(fmus, part, "3.0", eventModeUsed=True, earlyReturnAllowed=early).begin(start)


def leave_event(fmu):
    """End an event; returns the time of the next one [s]."""
    *wishes, defined, instant = fmu.slave.updateDiscreteStates()
    assert (wishes, defined) == ([False] * 4, True)
    fmu.slave.enterStepMode()
    return instant


def reference_values(count, start, value):
    """Outputs at each of the first events of the interpreted component, stepped from event to event."""
    reference = Sampler(enable=True)
    reference.start(start)
    found = [reference_outputs(reference)]
    for n in range(count):
        reference.u = value(n)
        reference.advance(start + n * PERIOD, PERIOD)
        found.append(reference_outputs(reference))
    return found


@pytest.mark.parametrize("start", [0.0, 123.456])
@pytest.mark.parametrize("h", [0.0037, 0.01, 0.025])
def test_steps_end_at_events_and_outputs_change_there_only(fmus, h, start):
    expected = reference_values(20, start, np.sin)
    fmu = Fmu(fmus, Sampler, "3.0", eventModeUsed=True, earlyReturnAllowed=True)
    fmu.set("enable", True)
    fmu.begin(start)
    t = start
    for n in range(20):
        assert fmu.outputs() == expected[n]
        fmu.set("u", np.sin(n))
        instant = leave_event(fmu)
        assert instant == pytest.approx(start + (n + 1) * PERIOD, rel=1e-15)
        needed = False
        while not needed:
            needed, terminates, early, reached = fmu.slave.doStep(t, h)
            assert fmu.outputs() == expected[n]
            assert not terminates
            assert reached == pytest.approx(min(t + h, instant), abs=1e-12)
            assert (early, needed) == (t + h > instant + 1e-12, t + h > instant - 1e-12)
            t = reached
        fmu.slave.enterEventMode()
    assert fmu.outputs() == expected[20]


def test_without_early_return_only_events_at_communication_points_are_left_to_the_importer(fmus):
    plain, fmu = Fmu(fmus, Sampler, "3.0").begin(), eventful(fmus, early=False)
    needed, seen = True, []
    for n in range(8):
        t = n * 0.025
        for one in (plain, fmu):
            one.set("u", np.cos(n))
        if needed:
            leave_event(fmu)
        plain.step(t, 0.025)
        needed, _, early, reached = fmu.slave.doStep(t, 0.025)
        assert (early, reached) == (False, t + 0.025)
        assert (fmu.outputs() != plain.outputs()) == needed
        if needed:
            fmu.slave.enterEventMode()
        assert fmu.outputs() == plain.outputs()
        seen.append(needed)
    assert seen == [False, True] * 4


def test_inputs_count_as_they_are_when_the_event_ends(fmus):
    fmu = eventful(fmus)
    for value in (1.0, 2.0, 3.0):  # an iteration with other FMUs
        fmu.set("u", value)
        fmu.slave.updateDiscreteStates()
    fmu.slave.enterStepMode()
    fmu.set("u", 9.0)  # too late
    fmu.slave.doStep(0.0, 1.0)
    fmu.slave.enterEventMode()
    assert fmu.get("delay")[0] == 3.0
    assert fmu.get("u")[0] == 9.0


def test_an_event_of_the_importer_between_ticks_changes_nothing(fmus):
    fmu = eventful(fmus)
    fmu.set("u", 1.0)
    leave_event(fmu)
    fmu.slave.doStep(0.0, 0.004)
    before = fmu.outputs()
    fmu.slave.enterEventMode()
    fmu.set("u", 5.0)
    assert leave_event(fmu) == PERIOD
    assert fmu.outputs() == before
    assert fmu.slave.doStep(0.004, 1.0) == (True, False, True, PERIOD)
    fmu.slave.enterEventMode()
    assert fmu.get("delay")[0] == 1.0


def test_an_event_cannot_be_passed_over(fmus):
    fmu = eventful(fmus)
    leave_event(fmu)
    fmu.slave.doStep(0.0, PERIOD)
    with pytest.raises(FMICallException):
        fmu.slave.doStep(PERIOD, PERIOD)
    assert b"Enter Event Mode first" in fmu.log[-1][-1]


def test_a_state_saved_in_event_mode_replays(fmus):
    fmu = eventful(fmus)
    state = fmu.slave.getFMUState()

    def run():
        found = []
        for n in range(5):
            fmu.set("u", float(n))
            leave_event(fmu)
            fmu.slave.doStep(n * PERIOD, 1.0)
            fmu.slave.enterEventMode()
            found.append(fmu.outputs())
        return found

    first = run()
    fmu.slave.setFMUState(state)
    assert run() == first
    plain = Fmu(fmus, Sampler, "3.0").begin()
    with pytest.raises(FMICallException):
        plain.slave.setFMUState(state)
    assert b"Co-Simulation with Event Mode" in plain.log[-1][-1]


@pytest.mark.parametrize("early", [False, True])
@pytest.mark.parametrize("interval", [PERIOD, 0.5 * PERIOD])
def test_fmpy_simulates_it_with_and_without_event_mode_alike(fmus, early, interval):
    path = str(fmus[Sampler, "3.0"][0])
    options = {"stop_time": 0.3, "output_interval": interval, "start_values": {"u": 0.7, "enable": True}}
    plain = simulate_fmu(path, **options)
    events = simulate_fmu(path, use_event_mode=True, early_return_allowed=early, **options)
    last = np.append(np.diff(events["time"]) > 1e-9, True)  # after the event, where there is one
    assert np.count_nonzero(~last) == 30
    for name in ("y", "count", "wide", "active"):
        assert events[name][last].tolist() == plain[name].tolist()


class Clock(Component):
    """Counts without inputs; refuses the fourth tick."""

    period = 0.1

    y = output("", "ticks so far", start=0, type=Int32)

    def step(self, t, h) -> int:
        if self.y == 3:
            return DISCARD
        self.y += 1
        return OK


@pytest.mark.slow
def test_a_component_without_inputs_has_events_too_and_a_failing_tick_is_an_error(build, tmp_path):
    fmu = eventful(unpacked(Clock, build, tmp_path), Clock)
    for n in range(4):
        assert fmu.get("y")[0] == n
        leave_event(fmu)
        t = fmu.slave.doStep(0.1 * n, 0.3)[3]
        assert t == pytest.approx(0.1 * (n + 1))
        if n < 3:
            fmu.slave.enterEventMode()
    with pytest.raises(FMICallException) as caught:
        fmu.slave.enterEventMode()
    assert caught.value.status == 3


@pytest.mark.parametrize("part", [Masses, Failing])
def test_components_without_ticks_have_no_event_mode(fmus, part):
    with pytest.raises(Exception, match="instantiate"):
        Fmu(fmus, part, "3.0", eventModeUsed=True)


# -------------------------------------------------------------------------------------------- Intermediate Update Mode

REQUIRED = ("push", "pushes", "total", "acceleration")


class Watched:
    """An instance whose importer is called back: `act` sees the instance and the arguments of the callback."""

    def __init__(self, fmus, part, required, act, early=True):
        self.seen = []
        numbers = {v.name: i for i, v in enumerate(part.variables, 1)}

        def update(_, t, set_requested, get_allowed, finished, can_return, requested, at):
            self.seen.append((t, set_requested, get_allowed, finished, can_return))
            wanted = act(self.fmu, t)
            if wanted is not None:
                requested[0], at[0] = True, wanted

        self.fmu = Fmu(
            fmus,
            part,
            "3.0",
            earlyReturnAllowed=early,
            intermediateUpdate=update,
            requiredIntermediateVariables=[numbers[name] for name in required],
        ).begin()


def test_every_substep_is_shown_and_the_result_is_the_same_to_the_bit(fmus):
    plain, values = Fmu(fmus, Stiff, "3.0").begin(), []
    watched = Watched(fmus, Stiff, ["u", "y"], lambda fmu, t: values.append(fmu.get("y")[0]))
    for n, h in enumerate((0.0037, 0.001, 0.0004)):
        t = n * 0.0037 - (n == 2) * 0.0027
        for fmu in (plain, watched.fmu):
            fmu.set("u", 1.0 + n)
            fmu.step(t, h)
        assert watched.fmu.outputs() == plain.outputs()
        assert values[-1] == plain.get("y")[0]
    times, *rest = zip(*watched.seen, strict=True)
    assert times == pytest.approx([0.0037 / 4 * i for i in range(1, 5)] + [0.0047, 0.0051])
    assert rest[0] == (True, True, True, False, False, False)  # nothing is left to be set for
    assert rest[1] == rest[2] == (True,) * 6
    assert rest[3] == rest[0]
    assert len(set(values)) == 6


def test_inputs_set_in_between_hold_from_there(fmus):
    watched = Watched(fmus, Masses, REQUIRED, lambda fmu, t: fmu.set("push", 100.0 * t))
    watched.fmu.step(0.0, 0.0037)
    reference, part = Masses(), 0.0037 / 4
    reference.start()
    for i in range(4):
        reference.advance(i * part, part)
        reference.push = 100.0 * (i * part + part if i < 3 else 0.0037)
    reference.derivatives(0.0037)
    assert watched.fmu.outputs() == reference_outputs(reference)


def test_outputs_follow_inputs_set_in_between(fmus):
    def act(fmu, t):
        before = fmu.get("acceleration")[0]
        fmu.set("push", 7.0)
        found.append(fmu.get("acceleration")[0] - before)

    found = []
    watched = Watched(fmus, Masses, REQUIRED, act)
    watched.fmu.step(0.0, 0.002)
    assert found == pytest.approx([7.0 / 0.5, 0.0])


@pytest.mark.parametrize(("wanted", "reached"), [(0.0, 0.002), (0.002, 0.002), (0.0053, 0.0053), (0.02, 0.01)])
def test_a_step_ends_early_when_the_importer_wants_it(fmus, wanted, reached):
    watched = Watched(fmus, Masses, REQUIRED, lambda _, t: wanted if t > 0.0015 else None)
    found = watched.fmu.slave.doStep(0.0, 0.01)
    assert found == (False, False, reached < 0.01, pytest.approx(reached, abs=1e-15))
    assert watched.seen[-1][0] == found[-1]
    plain = Fmu(fmus, Masses, "3.0").begin()
    plain.step(0.0, found[-1])
    assert np.frombuffer(watched.fmu.outputs()) == pytest.approx(np.frombuffer(plain.outputs()), rel=1e-12)
    watched.fmu.step(found[-1], 0.001)


def test_it_does_not_end_early_unless_that_is_allowed(fmus):
    watched = Watched(fmus, Masses, REQUIRED, lambda _, t: t, early=False)
    assert watched.fmu.slave.doStep(0.0, 0.003) == (False, False, False, 0.003)
    assert len(watched.seen) == 3
    assert not any(can_return for *_, can_return in watched.seen)


def test_only_what_was_required_is_within_reach(fmus):
    def act(fmu, t):
        tries = [
            lambda: fmu.get("acceleration"),
            lambda: fmu.get("x"),
            lambda: fmu.set("stiffness", 1.0),
            lambda: fmu.set("total", 1.0),
            lambda: fmu.step(t, 0.1),
            fmu.slave.terminate,
            fmu.slave.reset,
            fmu.slave.getFMUState,
            fmu.slave.enterEventMode,
        ]
        for each in tries:
            with pytest.raises(FMICallException):
                each()
            refused.append(fmu.log[-1][-1])
        values.append(fmu.get("total")[0])

    refused, values = [], []
    watched = Watched(fmus, Masses, ["total"], act)
    watched.fmu.step(0.0, 0.001)
    assert len(values) == 1
    assert len(refused) == 9
    assert b"required at instantiation" in refused[0]
    assert b"Intermediate Update Mode" in refused[4]


def test_only_continuous_inputs_and_outputs_can_be_required(fmus):
    for part, name in ((Masses, "stiffness"), (Masses, "x"), (Sampler, "u"), (Failing, "y")):
        number = [v.name for v in part.variables].index(name) + 1
        with pytest.raises(Exception, match="instantiate"):
            Fmu(fmus, part, "3.0", requiredIntermediateVariables=[number])
    with pytest.raises(Exception, match="instantiate"):
        Fmu(fmus, Masses, "3.0", requiredIntermediateVariables=[99])


def test_what_follows_from_time_alone_is_shown_at_the_end(build, tmp_path):
    heart = catalog.component("heart")
    found = []

    def look(fmu, t):
        found.append((t, fmu.outputs()))

    watched = Watched(unpacked(heart, build, tmp_path), heart, ["position", "velocity", "beats"], look)
    reference = heart()
    reference.start()
    watched.fmu.step(0.0, 0.35)
    reference.advance(0.0, 0.35)
    assert found == [(0.35, reference_outputs(reference))]


class Gain(Component):
    """Passes its input on."""

    u = input("", "input")
    y = output("", "output")

    def derivatives(self, t):
        self.y = self.u


def test_the_importer_is_called_with_its_environment(build, tmp_path):
    """FMPy passes none, so the function is called by hand."""
    fmu = Fmu(unpacked(Gain, build, tmp_path), Gain, "3.0")
    kinds = [ctypes.c_void_p, ctypes.c_double, *[ctypes.c_bool] * 4, ctypes.c_void_p, ctypes.c_void_p]
    seen = []
    update = ctypes.CFUNCTYPE(None, *kinds)(lambda environment, *_: seen.append(environment))
    make = fmu.slave.dll["fmi3InstantiateCoSimulation"]
    make.restype = ctypes.c_void_p
    token = ctypes.c_char_p(fmu.slave.guid.encode())
    no = ctypes.c_bool(False)
    me = make(b"it", token, None, no, no, no, no, None, ctypes.c_size_t(0), ctypes.c_void_p(42), None, update)
    fmu.slave.component = me
    fmu.begin().step(0.0, 0.1)
    assert seen == [42]
