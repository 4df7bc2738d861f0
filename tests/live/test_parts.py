"""Parts of a session by themselves: schedule, messages, log, checks of values, rows of a recording."""

import os
import socket
import threading
from fractions import Fraction
from math import inf, nan
from types import SimpleNamespace

import numpy as np
import pytest

from tests.every_case import every_case
from twin.component import Component, output, parameter, solver
from twin.live import RefusedError
from twin.live.catalog_builder import signals_of, space_data, spaces_of
from twin.live.channel import Channel, ClosedError
from twin.live.operator import operation_log
from twin.live.operator.command_checks import MAX_ITEMS, MAX_LETTERS, check_value
from twin.live.operator.dead_man_switch import DeadManSwitch
from twin.live.pacing import DELAY_COUNT, Pace
from twin.live.recording_reader import RecordingReader
from twin.run.recorded_views import member_class
from twin.scenario import EventSpec, MemberSpec, parse_scenario, resolve_variables


def test_a_schedule_of_blocks():
    """A 30th of a second at twice real time is 67 steps of a millisecond."""
    pace = Pace(2.0, 1e-3)
    pace.begin(100.0, 5.0)
    assert (pace.due(5.0), pace.due(7.0)) == (100.0, 101.0)
    assert (pace.achieved, pace.jitter, pace.lag) == (0.0, 0.0, 0.0)
    assert pace.count() == 4  # its computing time is not known yet
    pace.record_block(100.0, 100.001, 5.0, 5.004, 4)
    assert pace.count() == 67
    pace.record_block(100.1, 100.2, 5.01, 5.014, 4)  # 25 ms a step: one fits; due at 100.005 s
    assert pace.count() == 1
    assert (pace.lag, pace.jitter) == (pytest.approx(0.095), pytest.approx(0.095))
    assert pace.due(5.01) == pytest.approx(100.005)
    assert pace.achieved == pytest.approx((5.014 - 5.004) / (100.2 - 100.001))
    pace.record_block(100.265, 100.3, 5.01, 5.02, 1)  # 0.26 s late: that much is not caught up
    assert pace.lag == pytest.approx(0.26)
    assert pace.due(5.01) == pytest.approx(100.265)
    pace.record_block(100.2, 100.3, 5.01, 5.02, 1)  # early is not behind
    assert (pace.lag, len(pace.delays)) == (0.0, 4)
    pace.begin(0.0, 0.0)
    assert (list(pace.delays), pace.achieved) == ([], 0.0)
    for k in range(2 * DELAY_COUNT):
        pace.record_block(float(k), k + 0.5, 2.0 * k, 2.0 * k + 1.0, 1000)
    assert (len(pace.delays), pace.jitter, pace.achieved) == (DELAY_COUNT, 0.0, 2.0)
    fast = Pace(inf, 1e-3)
    assert fast.count() == 4
    fast.record_block(0.0, 0.0, 0.0, 0.004, 4)
    assert (fast.count(), list(fast.delays)) == (16, [])


def test_the_rate_that_was_achieved_is_that_of_the_last_second():
    """Of the last two blocks, if these are further apart."""
    pace = Pace(inf, 1e-3)
    rates = []
    for end, time in ((0.0, 0.0), (0.4, 0.4), (0.8, 1.6), (1.3, 2.1), (3.3, 5.1), (8.3, 6.1)):
        pace.record_block(end, end, time, time, 4)
        rates.append(pace.achieved)
    assert rates == pytest.approx([0.0, 1.0, 2.0, 1.7 / 0.9, 1.5, 0.2])


def test_the_99th_percentile_of_the_delays():
    pace = Pace(1.0, 1e-3)
    for delay in range(100):
        pace.delays.append(-1e-3 * delay)
    assert pace.jitter == pytest.approx(0.099)
    pace.delays.clear()
    pace.delays.extend([1e-3] * 200 + [1.0])
    assert pace.jitter == pytest.approx(1e-3)


def test_messages_in_order():
    """Whole lines only, in order; a message that a later one replaces is dropped while others wait."""
    one, other = socket.socketpair()
    sender, receiver = Channel(one), Channel(other)
    assert receiver.receive(0.0) == []
    sender.send(a=1)
    assert sender.send_droppable(b="ü")
    one.send(b'[1]\n{"c": ')
    assert receiver.receive(1.0) == [{"a": 1}, {"b": "ü"}]  # a list is no message
    one.send(b"3}\n")
    assert receiver.receive(1.0) == [{"c": 3}]
    sender.send(text="x" * 3_000_000)  # more than the socket takes
    assert not sender.send_droppable(d=1)
    found = []
    while not found:
        found = receiver.receive(0.0)
        sender.flush()
    assert [len(message["text"]) for message in found] == [3_000_000]
    assert sender.send_droppable(e=1)
    one.close()
    assert receiver.receive(1.0) == [{"e": 1}]  # what was sent before the end
    with pytest.raises(ClosedError):
        receiver.receive(1.0)
    with pytest.raises(ClosedError):
        receiver.send(f=1)
    other.close()


@every_case(
    ("time", "text"),
    [
        (0, "0 s"),
        (1_500_000_000, "1.5 s"),
        (-1_500_000_000, "-1.5 s"),
        (10_000_000_000, "10 s"),
        (1, "0.000000001 s"),
        (Fraction(301 * 10**9, 30), "301/30 s"),
    ],
)
def test_times_of_a_log_are_exact(time, text):
    assert operation_log.time_text(time) == text


def test_a_log_is_a_scenario_at_any_moment(tmp_path):
    """What is added is in the file with the next time, and not before."""
    path = tmp_path / "operated.yaml"
    log = operation_log.OperationLog(path, "step: 1 ms\n", 5_000_000)
    head = f"stop_time: {'0.005 s':<32}\nstep: 1 ms\nevents:\n"
    assert (path.read_text(), log.is_full) == (head, False)
    lines = [
        log.add(EventSpec(1_000_000, kind, name, value, ""))
        for kind, name, value in (("set", "a.b", 1.5), ("override", "a.c[1,2]", [1, 2]), ("release", "a.d", None))
    ]
    assert lines == [
        "- {at: 0.001 s, set: {a.b: 1.5}}",
        "- {at: 0.001 s, override: {'a.c[1,2]': [1, 2]}}",
        "- {at: 0.001 s, release: [a.d]}",
    ]
    assert path.read_text() == head
    log.commit(12_345_000_000)
    text = head.replace(f"{'0.005 s':<32}", f"{'12.345 s':<32}") + "".join(f"{line}\n" for line in lines)
    assert path.read_text() == text
    log.commit(12_345_000_000)
    log.add(EventSpec(1, "release", "a.e", None, ""))
    log.close()
    assert path.read_text() == text
    for name, limit in (("_end", operation_log.MAX_BYTES), ("_values", operation_log.MAX_VALUES)):
        full = operation_log.OperationLog(path, "", 0)
        setattr(full, name, limit)
        assert not full.is_full
        setattr(full, name, limit + 1)
        assert full.is_full
        full.close()


@every_case(
    ("value", "is_valid"),
    [
        (True, True),
        (2**63 - 1, True),
        (2**63, False),
        (-(2**63), False),
        (0.5, True),
        (inf, False),
        (nan, False),
        (None, False),
        ("x" * MAX_LETTERS, True),
        ("x" * (MAX_LETTERS + 1), False),
        ([[[1]]], True),
        ([[[[1]]]], False),
        ([1, None], False),
        ([0] * MAX_ITEMS, True),
        ([0] * (MAX_ITEMS + 1), False),
        ({"a": 1}, False),
    ],
)
def test_values_that_a_page_may_send(value, is_valid):
    if is_valid:
        assert check_value(value, "a.b") == value
    else:
        with pytest.raises(RefusedError, match=r"is not a value\. Use a finite number, true, false or a quantity\."):
            check_value(value, "a.b")


def test_the_last_moment_of_a_hold():
    """It ends at its deadline, not after it; a renewal as old as the longest hold is too old."""
    switch = DeadManSwitch(longest=0.5)
    assert switch.deadline == inf
    assert switch.hold("a", 1.0, 0.0, 0, 0.25, now=1.0)
    assert switch.hold("b", 1.0, 0.0, 5, 0.0, now=1.0)
    assert switch.deadline == 1.25
    assert switch.expire(1.2499) == []
    assert switch.expire(1.25) == ["a"]
    assert not switch.hold("a", 1.0, 0.0, 0, 0.0, now=1.3)
    assert switch.hold("a", 1.0, 0.0, 1, 0.4999, now=1.3)
    assert not switch.hold("a", 1.0, 0.0, 2, 0.5, now=1.3)
    switch.release_hold("b")
    assert (switch.inputs["b"].over, switch.inputs["a"].over, switch.inputs["a"].moves) == (5, 0, True)
    switch.inputs["b"].press = 3
    switch.release_hold()
    assert {name: (held.over, held.value, held.until) for name, held in switch.inputs.items()} == {
        "a": (1, 0.0, inf),
        "b": (5, 0.0, inf),
    }


@pytest.fixture
def reader(tmp_path):
    """Rows of a tick, a number, an array of 2 x 3 numbers, a truth and a count; from 1 s, each millisecond."""
    table = np.zeros((4, 10), np.int64)
    table[:, 0] = np.arange(4)
    table[:, 1:8] = (np.arange(4)[:, None] + np.arange(7) / 10).view(np.int64)
    table[:, 8], table[:, 9] = [0, 1, 0, 7], [5, -6, 7, -8]
    (tmp_path / "1.rows").write_bytes(table.tobytes() + b"part of a row")
    reader = object.__new__(RecordingReader)
    reader.epoch, reader.width, reader._words, reader._lock = 3, 10, np.zeros((0, 10), np.int64), threading.RLock()
    reader.begin, reader.step, reader.per_second = 1000, 1, 1000
    reader.columns = {"a.x": (1, (), "f"), "a.m": (2, (2, 3), "f"), "a.t": (8, (), "b"), "a.n": (9, (), "i")}
    reader._file = os.open(tmp_path / "1.rows", os.O_RDONLY)
    yield reader
    reader.close()
    reader.close()


def test_a_reader_that_another_thread_closes_keeps_its_rows(reader, monkeypatch):
    """Between the check of the file and its size: a tick of the console failed, and the page stayed gray."""
    size = os.fstat

    def close_first(file):
        closing = threading.Thread(target=reader.close)
        closing.start()
        closing.join(0.2)
        return size(file)

    monkeypatch.setattr(os, "fstat", close_first)
    assert reader.latest(["a.n"]).values["a.n"].tolist() == [-8]


def test_rows_of_a_recording(reader):
    samples = reader.read(["a.x", "a.t", "a.n", "a.m[2,1]"], None, None)
    assert (samples.epoch, samples.time.tolist()) == (3, [1.0, 1.001, 1.002, 1.003])
    assert {name: values.tolist() for name, values in samples.values.items()} == {
        "a.x": [0.0, 1.0, 2.0, 3.0],
        "a.t": [False, True, False, True],
        "a.n": [5, -6, 7, -8],
        "a.m[2,1]": pytest.approx([0.4, 1.4, 2.4, 3.4]),
    }
    matrix = reader.read(["a.m"], None, None).values["a.m"]
    np.testing.assert_allclose(matrix[1], [[1.1, 1.2, 1.3], [1.4, 1.5, 1.6]])
    for since, until, times in (
        (1.0, None, [1.001, 1.002, 1.003]),
        (0.9, 1.001, [1.0, 1.001]),
        (1.0005, 1.0025, [1.001, 1.002]),
        (1.003, 9.0, []),
    ):
        assert reader.read([], since, until).time.tolist() == times
    assert reader.latest(["a.n"]).values["a.n"].tolist() == [-8]
    for name, message in (
        ("a.m[0,1]", "there is no such element. The array has 2 x 3, counted from 1."),
        ("a.m[3,1]", "there is no such element."),
        ("a.m[1]", "there is no such element."),
        ("a.m[x]", "there is no such element."),
        ("a.z", "is not recorded."),
    ):
        with pytest.raises(RefusedError) as caught:
            reader.read([name], None, None)
        assert str(caught.value).startswith(f"{name}: {message}")
    reader.close()
    assert reader.latest(["a.n"]).values["a.n"].tolist() == [-8]


@every_case(
    ("component", "name"),
    [
        ("heart", "Heart"),
        ("/models/chamber.fmu", "chamber.fmu"),
        ("/data/motion.csv", "motion.csv"),
        ("/scenarios/rig.yaml#chain", "rig.yaml#chain"),
    ],
)
def test_a_member_shows_the_class_or_the_file_of_its_component(component, name):
    assert member_class(MemberSpec(component)) == name
    assert member_class(MemberSpec(component, made=object)) == (name if "." in component else "object")


SPACE = """
stop_time: 10 ms
step: 1 ms
members: {a: {component: "tests.live.test_parts:Vessel", parameters: {gain: 3, d: [4 mm, 5 mm, 6 mm]}}}
scenes:
  - title: vessel
    signals: [{signal: a.s, label: wire}]
    unit: mm
    axes: [z, y]
    space:
      path: {curvature: [a.k1, a.k2], spacing: 20 mm, diameter: a.d, label: vessel}
      points: [{along: a.s, label: tip}]
"""


class Vessel(Component):
    """A path in units other than SI."""

    k1 = parameter((0.0, 0.0, 0.0), "1/mm", "curvature")
    k2 = parameter((0.01, 0.02, 0.03), "1/mm", "curvature")
    d = parameter((8.0, 10.0, 12.0), "mm", "diameter")
    gain = parameter(1.0, "", "gain")
    s = output("mm", "place")

    def step(self, t: float, h: float) -> int:
        self.s = self.gain
        return solver.OK


def test_the_path_of_a_scene_in_space_is_in_si_with_all_values_of_the_file():
    scenario = parse_scenario(SPACE)
    (case,) = scenario.cases()
    variables = resolve_variables(scenario)[0][case.variant]
    data = space_data(scenario.scenes[0], case, variables)
    assert data["curvature"] == [[0.0, 0.0, 0.0], pytest.approx([10.0, 20.0, 30.0])]
    assert data["diameter"] == pytest.approx([4e-3, 5e-3, 6e-3])


def test_start_values_are_those_of_the_file_also_where_it_sets_several():
    """Numbers and arrays in the units of their variables, as a page shows them."""
    (case,) = parse_scenario(SPACE).cases()
    variables = resolve_variables(parse_scenario(SPACE))[0][case.variant]["a"]
    simulated = SimpleNamespace(members={"a": SimpleNamespace(variables=variables)}, recorded=[])
    signals = signals_of(case, simulated, set(), wall_clock=False)
    starts = {name: signals[f"a.{name}"].start for name in ("gain", "d", "k2")}
    assert starts == {"gain": 3.0, "d": [4.0, 5.0, 6.0], "k2": [0.01, 0.02, 0.03]}


def test_a_variant_has_the_scenes_in_space_that_are_for_it_and_whose_signals_it_has():
    drawable = SimpleNamespace(path=None, names=(), expressions=())
    missing = SimpleNamespace(path=None, names=("tip.position",), expressions=())
    scenes = {
        "of all": SimpleNamespace(variants=(), space=drawable),
        "of one": SimpleNamespace(variants=("PI",), space=drawable),
        "of another": SimpleNamespace(variants=("FF",), space=drawable),
        "without its signal": SimpleNamespace(variants=(), space=missing),
        "in a plane": SimpleNamespace(variants=(), space=None),
    }
    found = spaces_of(SimpleNamespace(scenes=tuple(scenes.values())), "PI", {})
    assert [name for name, scene in scenes.items() if scene in found] == ["of all", "of one"]
