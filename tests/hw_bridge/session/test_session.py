"""One case without a bus: when it advances, how it ends after an error, what it reports; cycles at half speed."""

import signal
from pathlib import Path
from types import SimpleNamespace

import pytest

from hw_bridge.hardware import HardwareKeys
from hw_bridge.master.late_cycle_policy import SLOW, LateCyclePolicy
from hw_bridge.session import Observers, Session
from tests.every_case import every_case
from tests.hw_bridge.axis import node as node_keys
from twin.errors import SimulationError

MS = 1_000_000
CYCLE = 5 * MS


def keys(late_cycle=None, simulated=True):
    bus = {"simulated": True} if simulated else {"interface": "virtual", "channel": "x"}
    root = {**bus, "cycle": "5 ms", "late_cycle": late_cycle or {}, "nodes": {"axis": node_keys()}}
    return HardwareKeys.model_validate(root)


class RecordedMaster:
    """A master that records its calls on a clock that only its waits advance."""

    def __init__(self, problems=()):
        self.network, self.calls, self.problems = SimpleNamespace(now=0), [], list(problems)
        node = SimpleNamespace(
            first_half_step=lambda: self.calls.append("first half"),
            second_half_step=lambda: self.calls.append("second half"),
        )
        self.nodes, self.notes, self.fault_texts, self.lead = {"axis": node}, ["from the master."], [], 100
        self.timing = SimpleNamespace(synced=lambda sent, due: self.calls.append(("synced", sent, due)))

    def check(self):
        return self.problems.pop(0) if self.problems else ""

    def exchange(self, planned):
        self.calls.append(("exchange", planned))
        return planned + 7

    def wait_until(self, time):
        self.calls.append(("wait", time))
        self.network.now = time

    def stop(self):
        self.calls.append("stop")

    def describe_failure(self, text):
        return f"{text} Described."

    def next_step(self):
        return "next: run again."


def session(master=None, late_cycle=None, simulated=True, started=True):
    """A case of one drive, as if it had begun at 20 ms of the scenario, which were 1000 ms of the network."""
    made = Session(keys(late_cycle, simulated), {}, Path(), Observers(None, None))
    made.orders.axes["axis"] = SimpleNamespace(views={})
    made.orders.set_targets = lambda *_: made.master.calls.append("targets")
    made.bench = SimpleNamespace(
        update_load=lambda: None,
        faults_at_rest=lambda failed, notes: [f"failed {failed}."],
        acted=lambda *_: [],
        report=lambda: {"bus_load": 0.5},
    )
    made.master, made.is_started, made.running = master or RecordedMaster(), started, started
    made.start, made.origin = 20 * MS, 980 * MS
    made.master.network.now = 1000 * MS
    return made


def test_a_case_advances_when_all_its_members_have_stepped():
    made = session()
    made.join_module("valves", SimpleNamespace(views={}))
    made.join("other", SimpleNamespace(views={}), forced=True)
    assert (made.members, made.orders.forced) == ({"axis", "other", "valves"}, {"other"})
    steps = []
    made.advance = lambda t, h: steps.append((t, h))
    for name in ("axis", "valves", "axis", "other", "other", "valves"):
        made.step(name, 0.02, 0.001)
    assert steps == [(20 * MS, MS)]
    made.step("axis", 0.021, 0.001)
    assert steps == [(20 * MS, MS), (21 * MS, MS)]


def test_targets_are_exchanged_once_per_cycle():
    made = session()
    shown = []
    made.outputs = [({...: 0.0}, lambda: shown.append(1) or 3.0)]
    for t in range(20, 26):
        made.advance(t * MS, MS)
    calls = made.master.calls
    assert calls[:4] == [
        "targets",
        ("exchange", 1000 * MS),
        ("synced", 1000 * MS + 7, 1000 * MS + 100),
        ("wait", 1001 * MS),
    ]
    assert calls[4:8] == [("wait", time * MS) for time in range(1002, 1006)]
    assert calls[8:10] == ["targets", ("exchange", 1005 * MS)]
    assert len(shown) == 6
    assert made.outputs[0][0][...] == 3.0


def test_observers_look_after_the_first_cycle():
    made = session()
    looks, loads = [], []
    made.observers = {"axis": SimpleNamespace(look=looks.append, update_load=lambda: loads.append(1))}
    for t in range(20, 31):
        made.advance(t * MS, MS)
    assert looks == [25 * MS, 30 * MS]
    assert len(loads) == 11


def test_a_late_cycle_delays_the_rest_of_the_scenario():
    made = session()
    made.master.network.now = 1007 * MS
    made.advance(20 * MS, MS)
    assert made.origin == 987 * MS
    assert made.master.calls[-1] == ("wait", 1008 * MS)


def test_at_half_speed_a_cycle_of_the_scenario_takes_two():
    made = session(late_cycle={"policy": "slow_down"})
    made.late_cycle_policy._slow_until = 10**12
    made.advance(20 * MS, MS)
    assert made.master.calls == [
        "targets",
        "first half",
        ("exchange", 1000 * MS),
        ("synced", 1000 * MS + 7, 1000 * MS + 100),
        ("wait", 1005 * MS),
        "second half",
        ("exchange", 1005 * MS),
        ("synced", 1005 * MS + 7, 1005 * MS + 100),
        ("wait", 1006 * MS),
    ]
    made = session(RecordedMaster(["", "too fast."]), late_cycle={"policy": "slow_down"})
    made.late_cycle_policy._slow_until = 10**12
    with pytest.raises(SimulationError, match=r"^too fast\. All drives stop\.$"):
        made.advance(20 * MS, MS)
    assert "second half" not in made.master.calls


@every_case(
    ("error", "running", "simulated", "stopped", "raised", "notes"),
    [
        (SimulationError("Too fast."), True, True, "Too fast. Described.", "Too fast. Described.", []),
        (
            SimulationError("Too fast."),
            True,
            False,
            "Too fast. Described.",
            "Too fast. Described.",
            ["next: run again."],
        ),
        (SimulationError("Not enabled."), False, True, None, "Not enabled. Described.", []),
        (KeyboardInterrupt(), True, True, None, "", []),
        (ZeroDivisionError("own"), True, False, None, "own", []),
    ],
)
def test_an_error_stops_all_drives(error, running, simulated, stopped, raised, notes):
    made = session(simulated=simulated)
    made.running = running
    made.before = SimpleNamespace(), 0
    made.master.timing.sent = []
    made.master.network.time_budget = SimpleNamespace(since=lambda *_: {"wait": 1.0})

    def fail(t, h):
        raise error

    made.advance = fail
    with pytest.raises(type(error)) as caught:
        made.step("axis", 0.5, 0.001)
    assert str(caught.value) == raised
    assert made.outcome.stopped == (None if stopped is None else (500 * MS, stopped))
    assert made.outcome.notes == ["from the master.", *notes]
    assert (made.failed, made.closed, made.outcome.unsafe) == (True, True, ["failed True."])
    assert made.cycle_times == ({"wait": 1.0} if running and not simulated else {})
    made.close()
    assert made.master.calls == ["stop"]


def test_a_bus_is_closed_again_where_its_trace_cannot_be_written():
    """Else the adapter, and the priority of this process, would stay taken as long as it runs."""
    made, closed = session(started=False), []
    network = made.bench.network = SimpleNamespace(close=lambda: closed.append(True))
    made.network, made.orders.begin, made.master = lambda: network, lambda: None, None

    def refuse(*_):
        raise SimulationError("run.xyz: no trace format.")

    made.observer_factories = Observers(refuse, None)
    with pytest.raises(SimulationError, match=r"^run\.xyz: no trace format\.$"):
        made.step("axis", 0.0, 0.001)
    assert closed == [True]


def test_a_signal_just_before_the_stop_does_not_skip_it():
    """A second Ctrl-C while a first one, or an error, is about to stop the drives."""
    own = session()
    stop = own.master.stop

    def interrupted():
        signal.raise_signal(signal.SIGINT)
        stop()

    own.master.stop = interrupted
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        own.close()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert own.master.calls[-1] == "stop"


def test_a_problem_of_the_master_ends_the_run():
    made = session(RecordedMaster(["axis: too fast."]))
    with pytest.raises(SimulationError, match=r"^axis: too fast\. All drives stop\. Described\.$"):
        made.step("axis", 0.02, 0.001)
    assert made.outcome.stopped == (20 * MS, "axis: too fast. All drives stop. Described.")


def test_the_report_of_a_case():
    made = session()
    made.master.report = lambda: {"nodes": {}}
    late = {"late_cycle": "hold", "overruns": 0, "longest_overrun": 0.0, "slow_cycles": 0}
    expected = {"nodes": {}, **late, "real_time_priority": False, "bus_load": 0.5}
    assert made.report() == expected
    made.observers = {"axis": SimpleNamespace(report=lambda: {"now": 1})}
    made.cycle_times = {"wait": 1.0}
    made.listener = SimpleNamespace(events=lambda origin: [f"{origin / 1e9:.1f} s: heard"], count=9)
    expected |= {"shadow": {"axis": {"now": 1}}, "spent": {"wait": 1.0}, "origin": 0.98, "seen": ["1.0 s: heard"]}
    assert made.report() == expected
    made.trace, made.closed, made.outcome.bus_events = Path("run.blf"), True, ["kept"]
    assert made.report() == expected | {"seen": ["kept"], "trace": "run.blf", "frames": 9}


@every_case(
    ("policy", "lateness", "delay", "overruns", "text"),
    [
        ("hold", 5 * MS, 0, 0, ""),
        ("hold", 5 * MS + 1, 5 * MS + 1, 1, ""),
        ("hold", 20 * MS, 20 * MS, 1, ""),
        (
            "hold",
            20 * MS + 1,
            0,
            1,
            "this program came 20.0 ms late, more than the 20 ms of late_cycle. All drives stop.",
        ),
        ("stop", 5 * MS, 0, 0, ""),
        ("stop", 6 * MS, 0, 1, "this program came 6.0 ms late, and late_cycle is stop. All drives stop."),
    ],
)
def test_what_is_tolerated_of_a_late_cycle(policy, lateness, delay, overruns, text):
    made = LateCyclePolicy(keys({"policy": policy, "at_most": "20 ms"}))
    if text:
        with pytest.raises(SimulationError) as caught:
            made.check(lateness, 0)
        assert str(caught.value) == text
    else:
        assert made.check(lateness, 0) == delay
    assert (made.overruns, made.longest) == (overruns, lateness if overruns else 0)


def test_a_second_at_half_speed():
    made = LateCyclePolicy(keys({"policy": "slow_down"}))
    assert made.slow(0) is False
    made.check(9 * MS, 100)
    made.check(8 * MS, 50)
    assert [made.slow(time) for time in (50, SLOW + 49, SLOW + 50, SLOW + 99)] == [True, True, False, False]
    assert made.report() == {"late_cycle": "slow_down", "overruns": 2, "longest_overrun": 9e-3, "slow_cycles": 2}
    made = LateCyclePolicy(keys())
    made.check(9 * MS, 100)
    assert made.slow(101) is False
