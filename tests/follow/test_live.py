"""Following a rig: late, repeated and shuffled values, clocks, bad input, and two processes over UDP."""

from __future__ import annotations

import json
import math
import random

import numpy as np
import pytest

from tests.follow.test_follow import VAN_DER_POL, recording
from twin.errors import ScenarioError, SimulationError
from twin.follow import follow, load, load_live
from twin.follow.live import MessageFollower
from twin.follow.live_problem import LiveSignal
from twin.follow.schema import RigKeys
from twin.follow.sensor_clock import RigClock, SensorClock
from twin.follow.signal_checks import Notes, SignalChecks
from twin.follow.sources import Message
from twin.follow.sources.messages import parse
from twin.follow.timeline import InputSamples

LIVE = VAN_DER_POL.replace("data: data.csv", "rig: {sources: {bench: {udp: 4710}}, max_delay: 500 ms}")
GAP = (5.0, 8.2)  # nothing is measured [s]


def messages_of(rows):
    """A force every 10 ms, and a position every 50 ms outside of the gap, as sent at their time."""
    times = np.arange(round(rows[-1][0] / 0.01) + 1) / 100
    messages = [Message("bench", time, time, {"force": 0.5 * math.sin(0.9 * time)}) for time in times.tolist()]
    messages += [
        Message("bench", time, time, {"position": position}) for time, _, position in rows if not GAP[0] < time < GAP[1]
    ]
    return sorted(messages, key=lambda message: message.stamp)


def followed(problem, build, messages):
    """Final estimates by time, and the notes, after messages with their arrivals."""
    estimates, notes, due = {}, Notes(lambda _line: None), 0.0
    with MessageFollower(problem, build, notes) as follower:
        for message in sorted(messages, key=lambda one: one.arrival):
            follower.receive(message)
            if message.arrival >= due:
                due = message.arrival + 0.02
                keep(estimates, follower.estimate(message.arrival))
        keep(estimates, follower.estimate(max(message.stamp for message in messages) % 3600.0 + 0.6))
        return estimates, notes, follower.counts


def keep(estimates, new):
    for time in [time for time in estimates if new and time >= new[0].time]:
        del estimates[time]
    estimates |= {estimate.time: estimate for estimate in new}


def assert_equal(one, other):
    assert list(one) == list(other)
    for time in one:
        for name in ("values", "covariance", "measured", "innovation"):
            np.testing.assert_array_equal(getattr(one[time], name), getattr(other[time], name), f"{name} at {time}")


@pytest.fixture
def problem(tmp_path):
    (tmp_path / "oscillator.yaml").write_text(LIVE)
    return load_live(tmp_path / "oscillator.yaml")


@pytest.mark.slow
@pytest.mark.parametrize("method", ["unscented", "{name: ensemble, size: 20, seed: 1}"])
def test_order_of_arrival_does_not_matter(tmp_path, build, method):
    """Shuffled, repeated and up to 0.45 s late: the estimates are those of the ordered stream, to the bit."""
    (tmp_path / "oscillator.yaml").write_text(f"{LIVE}method: {method}\n")
    problem = load_live(tmp_path / "oscillator.yaml")
    messages, chance = messages_of(recording(1, count=240)[0]), random.Random(1)
    ordered, notes, _ = followed(problem, build, messages)
    assert max(ordered) == 12.0
    assert [time for time in ordered if GAP[0] < time < GAP[1]] == [6.0, 7.0, 8.0]  # predictions in the gap
    first, *others = messages
    late = [
        Message(
            "bench", one.stamp + (chance.uniform(0.0, 0.45) if chance.random() < 0.4 else 0.0), one.stamp, one.values
        )
        for one in others
    ]
    late += [
        Message("bench", one.arrival + chance.uniform(0.0, 0.04), one.stamp, one.values)
        for one in late
        if chance.random() < 0.1
    ]
    shuffled, late_notes, counts = followed(problem, build, [first, *sorted(late, key=lambda one: one.arrival)])
    assert_equal(shuffled, ordered)
    assert notes.lines == late_notes.lines == []
    assert not counts


@pytest.mark.slow
def test_a_rig_and_its_recording_give_the_same_estimates(tmp_path, build, problem, monkeypatch):
    monkeypatch.setattr("tests.follow.test_live.GAP", (0.0, 0.0))
    messages = messages_of(recording(1, count=100)[0])
    live, _, _ = followed(problem, build, messages)
    for name, unit in (("force", "m/s2"), ("position", "mm")):
        lines = [f"{one.stamp!r},{one.values[name]!r}" for one in messages if name in one.values]
        (tmp_path / f"{name}.csv").write_text("\n".join([f"time [s],{name} [{unit}]", *lines]))
    text = VAN_DER_POL.replace("data: data.csv", "data: [force.csv, position.csv]")
    (tmp_path / "recorded.yaml").write_text(text)
    recorded = {estimate.time: estimate for estimate in follow(load(tmp_path / "recorded.yaml"), build)}
    assert_equal(live, recorded)


@pytest.mark.slow
def test_what_is_too_late_is_told_and_left_out(build, problem):
    messages = messages_of(recording(1, count=60)[0])
    late = next(one for one in messages if "position" in one.values and one.stamp >= 1.0)
    others = [one for one in messages if one is not late]
    without, _, _ = followed(problem, build, others)
    again = Message("bench", late.stamp + 0.499, late.stamp, late.values)  # the model is ahead by what it waits
    estimates, notes, counts = followed(problem, build, [*others, Message("bench", 2.0, late.stamp, late.values)])
    assert_equal(estimates, without)
    assert counts == {"outside": 1}
    assert notes.lines == ["bench: a message came 1 s late, or its stamp is wrong; max_delay is 0.5 s: left out."]
    estimates, _, _ = followed(problem, build, [*others, again])
    assert late.stamp in estimates


@pytest.mark.slow
@pytest.mark.parametrize("reaction", ["continue", "stop"])
def test_a_clock_that_jumps_by_an_hour(tmp_path, build, reaction):
    (tmp_path / "oscillator.yaml").write_text(LIVE.replace("500 ms}", f"500 ms, on_jump: {reaction}}}"))
    problem = load_live(tmp_path / "oscillator.yaml")
    messages = messages_of(recording(1, count=100)[0])
    jumping = [
        Message("bench", one.arrival, one.stamp + (3600.0 if one.stamp > 2.0 else 0.0), one.values) for one in messages
    ]
    if reaction == "stop":
        with pytest.raises(SimulationError, match=r"bench: its clock has jumped by \+3600.000 s"):
            followed(problem, build, jumping)
        return
    estimates, notes, counts = followed(problem, build, jumping)
    assert notes.lines == ["bench: its clock has jumped by +3600.000 s. The model goes on with a new offset."]
    assert counts["outside"] == pytest.approx(120, abs=2)  # of one second, until the jump was certain
    assert max(estimates) == pytest.approx(5.0)
    assert abs(estimates[max(estimates)].values[0] - recording_state(5.0)) < 0.1


def recording_state(time):
    return recording(1, count=100)[1][round(time / 0.05)][0]


def test_offset_and_drift_are_those_below_all_delays():
    chance, clock = random.Random(2), SensorClock(tolerance=0.5)
    for k in range(6000):
        stamp = 0.01 * k
        arrival = stamp + 1234.5 + 40e-6 * stamp + 2e-3 + chance.expovariate(1 / 4e-3)
        assert clock.add(stamp, arrival) == 0.0
    assert clock.drift == pytest.approx(40e-6, abs=3e-6)
    assert clock.at(60.0) == pytest.approx(1234.5 + 40e-6 * 60.0 + 2e-3, abs=1e-4)  # the least delay stays in it


@pytest.mark.parametrize("jump", [3600.0, -3600.0])
def test_a_jump_is_told_from_a_burst_of_delayed_messages(jump):
    clock = SensorClock(tolerance=0.5)
    for k in range(500):
        clock.add(0.01 * k, 100.0 + 0.01 * k)
    burst = [clock.add(5.0 + 0.01 * k, 107.0 + 1e-4 * k) for k in range(200)]
    assert set(burst) == {None, 0.0}  # those that are more than 0.5 s late, then the rest
    results = [clock.add(7.0 + jump + 0.01 * k, 107.0 + 0.01 * k) for k in range(200)]
    (told,) = [result for result in results if result]
    assert told == pytest.approx(jump, abs=1e-6)
    assert results.index(told) == 100
    assert clock.at(7.0 + jump) == pytest.approx(100.0 - jump)


def test_clocks_of_several_sources_meet_in_the_time_of_the_model():
    keys = RigKeys.model_validate({"sources": {"a": {"udp": 1}, "b": {"udp": 2}, "c": {"udp": 3, "clock": "arrival"}}})
    rig = RigClock(keys, begin=0.0)
    rig.origin = 5.0  # on the clock of a, which is 100 s behind the host's; b is 7 s ahead of it
    for k in range(3000):
        host = 105.0 + 0.01 * k
        rig.add("a", host - 100.0, host, was_lost=False)
        rig.add("b", host + 7.0, host, was_lost=False)
    assert rig.time("a", 6.25) == 1.25
    assert rig.time("b", 113.25) == pytest.approx(1.25)
    assert rig.time("c", 106.25) == pytest.approx(1.25)
    assert rig.at(106.25) == pytest.approx(1.25)


def test_inputs_are_linear_and_held_in_gaps():
    samples = InputSamples(gap=0.5)
    assert samples.insert(0.0, 0.0) == -np.inf
    assert samples.insert(0.4, 4.0) == 0.0
    assert samples.insert(2.0, 6.0) == np.nextafter(2.0, 0.0)
    assert samples.insert(0.2, 3.0) == 0.0
    assert samples.insert(0.2, 9.0) is None
    np.testing.assert_allclose(samples.at(np.array([-1.0, 0.1, 0.3, 1.9, 2.0, 3.0])), [0.0, 1.5, 3.5, 4.0, 6.0, 6.0])


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"{", "a message is no JSON"),
        (b"[1]", "a message is no JSON object"),
        (b'{"time": "now", "tip": 1}', "`time` of a message is no number of seconds"),
        (b'{"time": 1, "tip": "far"}', "`tip` of a message is no number"),
    ],
)
def test_malformed_datagrams_are_told(data, problem):
    assert parse("bench", data, 0.0, "time").problem.startswith(problem)


def test_datagrams_have_nested_names_units_and_missing_values():
    data = json.dumps({"stamp": 1.5, "arm": {"tip": 2, "off": None}, "on": True, "units": {"arm.tip": "mm"}}).encode()
    message = parse("bench", data, 3.0, "stamp")
    assert message == Message("bench", 3.0, 1.5, {"arm.tip": 2.0, "on": 1.0}, {"arm.tip": "mm"})
    assert math.isnan(parse("bench", b'{"tip": NaN}', 0.0, "time").values["tip"])


SIGNAL = LiveSignal("tip", "mm", "sheath.tip_position", "m", offset=1.0)


def checked(on_bad, values, unit="", every=0.01):
    lines = []
    checks = SignalChecks([SIGNAL], Notes(lines.append), on_bad)
    return [checks.checked(SIGNAL, value, unit, every * k) for k, value in enumerate(values)], lines


def test_bad_values_are_left_out_with_one_line_each():
    nan = float("nan")
    values, lines = checked("continue", [1.0, nan, nan, 2.0])
    assert values == [1.001, None, None, 1.002]
    assert lines == ["tip is nan: left out until it is a number."]
    values, lines = checked("continue", [1.0, 2.0], "N")
    assert values == [None, None]
    assert lines == [
        "tip arrives in N, sheath.tip_position is in m: left out. Correct the sender, or the signal in the follow file."
    ]
    assert checked("continue", [0.5], "m") == ([1.5], [])  # the unit that is sent counts
    values, lines = checked("continue", [1.0] * 250 + [2.0])
    assert values.count(None) == 50
    assert values[-1] == 1.002
    assert lines == ["tip is constant (1 mm) for 2 s: its sensor does not measure. Left out until it changes."]


@pytest.mark.parametrize(("values", "unit"), [([float("inf")], ""), ([1.0], "N"), ([1.0] * 250, "")])
def test_bad_values_stop_if_the_file_says_so(values, unit):
    with pytest.raises(SimulationError, match=r"^tip "):
        checked("stop", values, unit)


def test_a_signal_that_no_source_sends_is_told():
    lines = []
    checks = SignalChecks([SIGNAL], Notes(lines.append), "continue")
    checks.note_names("bench", ["tipp", "force"], 10.0)
    checks.check_names(["tip", "force"], {"bench": None}, 11.9)
    assert lines == []
    checks.check_names(["tip", "force"], {"bench": None}, 12.1)
    checks.check_names(["tip", "force"], {"bench": None}, 13.0)
    assert lines == ["tip: bench does not send it. Did you mean 'tipp'?"]


@pytest.mark.parametrize(
    ("rig", "expected"),
    [
        ("rig: {sources: {bench: {udp: 4710, hardware: a.yaml}}}", "expected one of udp"),
        ("rig: udp://here", "expected a port such as 4710"),
        ("rig: {sources: {}}", "rig.sources"),
        ("rig: {sources: {bench: {udp: 1}}, on_loss: wait}", "rig.on_loss"),
        ("", "`rig` is missing. Add it, such as `rig: udp://127.0.0.1:4710`."),
    ],
)
def test_bad_rigs_are_told_in_one_line(tmp_path, rig, expected):
    text = "\n".join(rig if line.startswith("rig") else line for line in LIVE.splitlines())
    (tmp_path / "oscillator.yaml").write_text(text)
    with pytest.raises(ScenarioError) as error:
        load_live(tmp_path / "oscillator.yaml")
    assert len(error.value.problems) == 1, error.value.problems
    assert expected in error.value.problems[0]
