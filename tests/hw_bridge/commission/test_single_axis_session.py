"""One drive moved by set-points: what each cycle does, in its order, and how a session begins and ends. Without a bus."""

import signal
import sys
from types import SimpleNamespace

import pytest

from hw_bridge.commission import single_axis_session
from hw_bridge.commission.ramp import Ramp
from hw_bridge.commission.single_axis_session import (
    Operator,
    Sample,
    SingleAxisSession,
    check_bounded,
    hangup_as_interrupt,
    restrict_to_node,
)
from hw_bridge.dictionary import Mode
from hw_bridge.hardware import HardwareKeys
from tests.every_case import every_case
from tests.hw_bridge.axis import node as node_keys
from tests.hw_bridge.unconnected import unconnected_node
from twin.errors import SimulationError
from twin.process import SIGNALS

MS = 1_000_000
LIMITS = {"position": ["-20 mm", "30 mm"], "velocity": "100 mm/s", "acceleration": "4 m/s^2"}


class Cycles:
    """A master whose drive follows at once; each of its calls is recorded. `late`: how late cycles end [ns]."""

    def __init__(self, node):
        self.node, self.calls, self.late = node, [], []
        self.network = SimpleNamespace(now=0, wall_clock=False)
        self.attend, self.problem, self.nodes = None, "", {"axis": node}
        self.notes, self.fault_texts = [], []

    def check(self):
        self.calls.append("check")
        return self.problem

    def exchange(self):
        self.calls.append("exchange")
        if self.node.mode is Mode.CSP:
            self.node.raw_position = round(self.node.target_position / self.node.units.position)

    def wait_until(self, time):
        self.network.now = time + (self.late.pop(0) if self.late else 0)

    def begin(self, start):
        self.calls.append(("begin", start))

    def stop(self):
        self.calls.append("stop")
        self.fault_texts = ["axis: is in Fault."]  # an error while it is stopped

    def describe_failure(self, text):
        return f"described: {text}"


@pytest.fixture
def session(monkeypatch):
    node = unconnected_node(limits=LIMITS, homing={"method": 37, "at": "4 mm"})
    keys = HardwareKeys.model_validate({"simulated": True, "cycle": "5 ms", "nodes": {"axis": node_keys()}})
    monkeypatch.setattr(single_axis_session, "Operator", lambda *given: Cycles(node))
    made = SingleAxisSession(keys, "axis", SimpleNamespace(now=0, wall_clock=False))
    made.network = made.master.network
    return made


def test_a_cycle_checks_looks_exchanges_and_waits(session):
    session.master.attend = lambda: session.master.calls.append("attend")
    session.go(0.001)
    assert session.master.calls == ["check", "attend", "exchange"]
    assert session.samples == [Sample(0.005, 0.001, pytest.approx(0.001), 0.0)]
    assert (session.node.mode, session.h, session.cycle) == (Mode.CSP, 0.005, 5 * MS)
    session.push(-1.5)
    assert (session.node.mode, session.node.target_force) == (Mode.CST, -1.5)
    session.master.problem = "axis: too hot."
    with pytest.raises(SimulationError, match=r"^axis: too hot\. It stops\.$"):
        session.go(0.002)
    assert len(session.samples) == 2


def test_a_slow_velocity_is_that_of_the_positions(session):
    """606Ch counts in mm/s: it is shown at first, and where the origin has moved meanwhile."""
    node = session.node
    node.raw_velocity = 6
    assert session.mean_velocity() == pytest.approx(0.006)
    session.network.now, node.raw_position = 100 * MS, node.raw_position + 149
    assert session.mean_velocity() == pytest.approx(0.00149)
    assert session.mean_velocity() == pytest.approx(0.006)  # no time has passed
    session.network.now, node.origin = 200 * MS, 0.02
    assert session.mean_velocity() == pytest.approx(0.006)


@pytest.mark.parametrize(
    ("homed", "homes", "origin"), [(False, False, "start"), (True, False, "reference"), (False, True, "reference")]
)
def test_positions_count_from_the_start_or_from_the_reference(session, homed, homes, origin):
    keys = session.keys
    if not homes:
        session.node.keys = keys.model_copy(update={"homing": None})
    assert session.origin == "in the drive"  # until it is enabled
    with session.enabled(homed=keys if homed else None):
        assert session.origin == f"from {origin}"


def test_a_late_cycle_is_not_caught_up_with(session):
    session.master.late = [0, 12 * MS, 0]
    for _ in range(3):
        session.go(0.0)
    assert [sample.time for sample in session.samples] == pytest.approx([0.005, 0.022, 0.022])
    session.go(0.0)
    assert session.samples[-1].time == pytest.approx(0.027)


@every_case(
    ("late_cycle", "lateness", "text"),
    [
        ({}, 61, r"^this program came 61\.0 ms late, more than the 60 ms of late_cycle\. All drives stop\.$"),
        ({"at_most": "20 ms"}, 21, r"more than the 20 ms of late_cycle"),
        ({"policy": "stop"}, 6, r"^this program came 6\.0 ms late, and late_cycle is stop"),
    ],
)
def test_a_cycle_that_is_later_than_late_cycle_allows_moves_nothing(monkeypatch, late_cycle, lateness, text):
    """As in a run: a suspended program does not go on with its last set-point."""
    node = unconnected_node(limits=LIMITS)
    keys = HardwareKeys.model_validate({"simulated": True, "late_cycle": late_cycle, "nodes": {"axis": node_keys()}})
    monkeypatch.setattr(single_axis_session, "Operator", lambda *given: Cycles(node))
    made = SingleAxisSession(keys, "axis", Cycles(node).network)
    made.go(0.0)
    made.network.now = made.due + (lateness - 1) * MS
    if "policy" not in late_cycle:
        made.go(0.001)
    made.network.now = made.due + lateness * MS
    made.master.calls.clear()
    with pytest.raises(SimulationError, match=text):
        made.go(0.002)
    assert made.master.calls == []


@pytest.mark.parametrize(
    ("paced", "wall_clock", "sleeps"), [(True, False, [0.005]), (True, True, []), (False, False, [])]
)
def test_a_bus_in_simulated_time_waits_for_the_keys_of_a_person(session, monkeypatch, paced, wall_clock, sleeps):
    slept = []
    monkeypatch.setattr(single_axis_session.time, "sleep", slept.append)
    session.paced, session.network.wall_clock = paced, wall_clock
    session.go(0.0)
    assert slept == sleeps


def test_a_move_ends_at_its_goal_and_rests(session):
    """1 mm at 20 mm/s and 4 m/s2, then 200 ms at its place."""
    assert session.move(0.001, 0.02, 4.0) == pytest.approx(0.001)
    targets = [sample.target for sample in session.samples]
    moving = [target for target in targets if target < 0.001]
    assert len(targets) - len(moving) == 41
    assert max(abs(after - before) for before, after in zip([0.0, *targets], targets, strict=False)) <= 1.001e-4
    assert session.ramp.position == 0.001
    count = len(session.samples)
    session.rest(12 * MS)
    assert len(session.samples) == count + 3


def test_a_session_begins_with_its_limits_and_is_stopped_in_any_case(session):
    session.network.now = 7
    with session.enabled(0.003):
        assert session.master.calls == [("begin", {"axis": 0.003})]
        assert session.ramp == Ramp(session.node.position, 4.0, 4.0)
        assert session.due == 7
    assert session.master.calls[1:] == ["stop"]
    assert session.master.notes == ["axis: is in Fault."]
    with pytest.raises(SimulationError, match=r"^described: jammed$"), session.enabled():
        raise SimulationError("jammed")
    assert session.master.calls[3:] == ["stop", "stop"]
    assert len(session.master.notes) == 1, "the failure names it"
    with pytest.raises(KeyboardInterrupt), session.enabled():
        raise KeyboardInterrupt
    assert session.master.calls[6:] == ["stop"]
    assert len(session.master.notes) == 2


@pytest.mark.parametrize(("homing", "origin"), [(True, -0.004), (False, 0.0)])
def test_positions_count_from_the_reference_of_a_homed_drive(session, monkeypatch, homing, origin):
    limited = []
    monkeypatch.setattr(single_axis_session.setup, "limit_positions", limited.append)
    session.node.raw_position = 9000
    keys = session.keys if homing else session.keys.model_copy(update={"homing": None})
    with session.enabled(homed=keys):
        assert session.node.origin == origin
        assert session.node.position == pytest.approx(0.009 - origin)
        assert session.node.target_position == session.node.entered_from == session.node.position
        assert session.ramp.position == session.node.position
    assert limited == [session.node]


def test_an_operator_is_looked_for_in_every_cycle_while_it_runs(monkeypatch):
    calls = []
    monkeypatch.setattr("hw_bridge.master.Master.run_cycle", lambda self: calls.append("cycle"))
    operator = object.__new__(Operator)
    operator.running = True
    operator.run_cycle()
    operator.attend = lambda: calls.append("attend")
    operator.run_cycle()
    operator.running = False
    operator.run_cycle()
    assert calls == ["cycle", "cycle", "attend", "cycle"]


def test_a_closed_terminal_interrupts_a_session_once():
    """The shell of a closed terminal sends SIGHUP, too: a second interrupt would end the stop of the first."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    with hangup_as_interrupt():
        assert signal.getsignal(signal.SIGHUP) is not before[signal.SIGHUP]
    assert signal.getsignal(signal.SIGHUP) is before[signal.SIGHUP]
    with pytest.raises(ValueError, match="x"), hangup_as_interrupt():
        raise ValueError("x")
    assert signal.getsignal(signal.SIGHUP) is before[signal.SIGHUP]
    steps, hook = [], sys.unraisablehook
    try:
        with pytest.raises(KeyboardInterrupt):
            with hangup_as_interrupt():
                try:
                    signal.raise_signal(signal.SIGHUP)
                    steps.append("moves on")
                finally:
                    signal.raise_signal(signal.SIGHUP)
                    steps.append("stopped")
            steps.append("after it")
        signal.raise_signal(signal.SIGHUP)  # nor does a late one interrupt the restoration
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)
    assert steps == ["stopped"]


def test_a_hardware_file_is_restricted_to_one_drive():
    nodes = {"a": node_keys(homing={"method": 37}), "b": node_keys(number=2)}
    modules = {"valves": {"node": 9, "outputs": {0: "a.b"}, "safe_outputs": 0}}
    faults = [{"at": "1 s", "node": "a", "fault": "heartbeat"}]
    keys = HardwareKeys.model_validate({"simulated": True, "nodes": nodes, "modules": modules, "faults": faults})
    for homes in (False, True):
        own = restrict_to_node(keys, "a", homes)
        assert (list(own.nodes), own.modules, own.faults) == (["a"], {}, [])
        assert (own.nodes["a"].homing is not None) is homes
    assert keys.nodes["a"].homing is not None


@every_case(("value", "fits"), [(1e-9, True), (2.0, True), (2.001, False), (0.0, False), (-1.0, False)])
def test_a_speed_is_above_zero_and_at_most_its_limit(value, fits):
    if fits:
        assert check_bounded(value, 2.0, "--velocity", "limits.velocity", str) == value
        return
    with pytest.raises(SimulationError) as caught:
        check_bounded(value, 2.0, "--velocity", "limits.velocity", str)
    assert str(caught.value) == (
        f"--velocity {value}: must be above 0 and at most 2.0, limits.velocity of the hardware file."
    )
