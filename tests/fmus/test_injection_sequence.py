"""The injection sequence: its table, and what must hold whatever happens."""

from itertools import pairwise

import numpy as np
import pytest
from fmus.injection_sequence import model
from fmus.injection_sequence.model import ACTIONS, InjectionSequence
from fmus.injection_site.dose import entries, profile
from fmus.injection_site.model import InjectionSite
from fmus.state_trigger.model import StateTrigger
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.every_case import every_case
from tests.matrix import some

FAST = {"settle": 0.1, "speed_inject": 3e-3, "home_time": 0.6, "target_count": 3}
HOME = -2e-3


class Bench:
    """A needle that follows, a wall, a tip that is where it was wanted; and everything that was commanded."""

    def __init__(self, **values):
        self.sequence = InjectionSequence(**{**FAST, **values})
        self.sequence.start()
        self.sequence.enable = True
        self.slide = HOME
        self.surface = 10e-3
        self.jammed = False
        self.t = 0.0
        self.record = []

    def step(self, **inputs):
        sequence = self.sequence
        command = HOME if sequence.target_needle_length < 0.0 else (sequence.target_needle_length + 1.1e-3) / 0.4428
        if not self.jammed:
            self.slide += min(max(command - self.slide, -0.3e-3), 0.3e-3)
        sequence.needle_slide, sequence.needle_command = self.slide, command
        sequence.measured_force = max(0.0, 80.0 * (sequence.target_z - self.surface))
        sequence.measured_x, sequence.measured_y = sequence.target_x, sequence.target_y
        for name, value in {"abort": False, "force_valid": True, "position_valid": True, **inputs}.items():
            setattr(sequence, name, value)
        assert sequence.advance(self.t, 0.01) == 0
        self.t += 0.01
        now = {
            name: sequence.record[name].item()
            for name in (
                "target_x",
                "target_y",
                "target_z",
                "target_needle_length",
                "hold",
                "flow",
                "volume",
                "state",
                "reason",
            )
        }
        self.record.append({**now, "slide": self.slide})

    def run(self, limit=6000, until=(model.DONE, model.ABORTED)):
        for _ in range(limit):
            self.step()
            if self.sequence.state in until:
                break


def check(record, home=-1.8e-3):
    """The invariants of a run."""
    for before, after in pairwise(record):
        moved = any(before[name] != after[name] for name in ("target_x", "target_y", "target_z"))
        assert not (moved and after["slide"] > home), "moves with the needle out"
        if before["hold"] and not after["hold"]:
            assert after["slide"] <= home, "lets go with the needle out"
        if after["target_needle_length"] >= 0.0:
            assert after["hold"], "needle out without hold"
        assert after["flow"] >= 0.0
        if after["flow"] > 0.0:
            assert after["state"] == model.INJECT
        if after["state"] == model.ABORT_NEEDLE:
            assert after["target_needle_length"] < 0.0
            assert after["hold"]
            assert after["flow"] == 0.0
            assert not moved, "something else moves before the needle is in"
        if after["state"] == model.ABORT_WITHDRAW:
            assert after["target_z"] <= before["target_z"] or after["target_z"] <= 6e-3


def test_every_row_of_the_table_moves_either_the_needle_or_the_catheter():
    assert len(ACTIONS) == model.ABORTED + 1
    for state, (across, along, needle, hold, flow, _) in enumerate(ACTIONS):
        if needle != model.HOME:
            assert (across, along, hold) == (model.NO, model.STAY, model.YES)
        if hold == model.YES:
            assert (across, along) == (model.NO, model.STAY)
        assert (flow == model.YES) == (state == model.INJECT)
        for column, entry in zip(("ACROSS", "ALONG", "NEEDLE", "HOLD", "FLOW", "WATCHED"), ACTIONS[state], strict=True):
            assert model.does(state, getattr(model, column)) == entry


@pytest.mark.slow
def test_all_targets_get_the_dose():
    bench = Bench()
    bench.run()
    assert bench.sequence.state == model.DONE
    assert bench.sequence.injected == 3
    assert bench.sequence.volume == pytest.approx(3e-7, rel=1e-9)
    check(bench.record)
    order = [bench.record[0]["state"]] + [b["state"] for a, b in pairwise(bench.record) if a["state"] != b["state"]]
    assert order[-9:] == [7, 1, 2, 3, 4, 5, 6, 7, 8]


@pytest.mark.slow
@every_case("state", range(model.POSITION, model.DONE))
def test_an_abort_in_every_state_first_draws_the_needle_in(state):
    bench = Bench()
    bench.run(until=(state,))
    assert bench.sequence.state == state
    bench.step(abort=True)
    assert bench.sequence.state == model.ABORT_NEEDLE
    bench.run()
    assert bench.sequence.state == model.ABORTED
    assert bench.sequence.reason == model.ABORT_REQUESTED
    assert bench.slide <= -1.8e-3
    check(bench.record)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ({"measured_force": 0.5}, model.FORCE_HIGH),
        ({"measured_force": float("nan")}, model.FORCE_HIGH),
        ({"force_valid": False}, model.FORCE_LOST),
        ({"position_valid": False}, model.POSITION_LOST),
    ],
)
def test_a_fault_aborts_and_says_why(fault, reason):
    bench = Bench(settle=3.0)
    bench.run(until=(model.PROTRUDE,))
    for _ in range(300):
        bench.step(**fault)
        if bench.sequence.state >= model.ABORT_NEEDLE:
            break
    bench.run()
    assert bench.sequence.reason == reason
    check(bench.record)


@pytest.mark.slow
def test_a_needle_that_jams_keeps_everything_at_rest():
    bench = Bench()
    bench.run(until=(model.INJECT,))
    bench.jammed = True
    bench.run(limit=1000)
    assert bench.sequence.state == model.ABORT_NEEDLE
    assert bench.sequence.reason == model.NEEDLE_STUCK
    assert bench.sequence.hold
    bench.jammed = False
    bench.run()
    assert bench.sequence.state == model.ABORTED
    check(bench.record)


@pytest.mark.slow
def test_without_a_wall_no_needle_comes_out():
    bench = Bench()
    bench.surface = 1.0
    bench.run()
    assert bench.sequence.missed == 3
    assert max(row["target_needle_length"] for row in bench.record) < 0.0


@pytest.mark.slow
def test_a_target_that_is_not_reached_is_left_out():
    bench = Bench()
    for _ in range(4000):
        bench.step(measured_x=bench.sequence.target_x + 5e-3)
    assert bench.sequence.state == model.DONE
    assert (bench.sequence.missed, bench.sequence.injected) == (3, 0)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("phase", "goes"),
    some(
        [(2.3, True), (2.7, True), (1.9, True), (2.9, False), (1.7, False), (-4.0, True)],
        [(2.7, True), (2.9, False), (1.7, False), (-4.0, True)],
    ),
)
def test_the_needle_goes_out_at_the_phase_of_the_gate_alone(phase, goes):
    bench = Bench(gate_center=2.3, gate_width=0.9, gate_time=1.0, target_count=1)
    for _ in range(6000):
        bench.step(gate_phase=phase)
    assert bench.sequence.injected == goes
    assert bench.sequence.missed == (not goes)
    check(bench.record)


@pytest.mark.slow
def test_a_phase_that_is_not_valid_opens_no_gate():
    bench = Bench(gate_center=2.3, gate_width=0.9, gate_time=1.0)
    for _ in range(6000):
        bench.step(gate_phase=2.3, gate_valid=False)
    assert (bench.sequence.injected, bench.sequence.missed, bench.sequence.state) == (0, 3, model.DONE)
    assert max(row["target_needle_length"] for row in bench.record) < 0.0


def test_a_trouble_begins_in_its_state_and_stays():
    trigger = StateTrigger(at_state=4, at_number=2, delay=0.025)
    trigger.start()
    begun = []
    for k, (state, number) in enumerate(
        [(4, 1)] * 9 + [(3, 2)] * 3 + [(4, 2)] * 2 + [(3, 2)] + [(4, 2)] * 5 + [(9, 2)] * 3
    ):
        trigger.state, trigger.number = state, number
        trigger.advance(0.01 * k, 0.01)
        begun.append(bool(trigger.is_active))
        assert (trigger.well, trigger.level) == (not begun[-1], float(begun[-1]))
    assert begun == [False] * 17 + [True] * 6


def test_entries_are_told_by_their_part_of_a_beat_and_the_speed_of_the_wall():
    time = np.linspace(0.0, 10.0, 1001)
    depth = np.where((time > 2.3) & (time < 3.0) | (time > 6.4) & (time < 7.0), 1e-3, -1e-3)
    velocity = 4e-3 * np.sin(2.0 * np.pi * time)
    velocity[505] = 0.4  # one jump is not the usual peak
    listening = (time < 2.0).astype(float)
    found = entries(depth, 1.0 * time, velocity, listening)
    assert found["count"] == 2
    assert (found["earliest"], found["latest"]) == pytest.approx((0.31, 0.41), abs=0.011)
    speeds = np.abs(np.sin(2.0 * np.pi * np.array([0.31, 0.41])))
    assert (found["middle"], found["fastest"]) == pytest.approx((speeds.mean(), speeds.max()), abs=0.03)
    assert found["resting"] == 0
    assert found["waited"] == pytest.approx(2.0, abs=0.011)
    nothing = entries(0.0 * depth, time, velocity, listening)
    assert np.isnan(nothing["latest"])
    assert np.isnan(nothing["fastest"])


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("gate", [True, False])
def test_the_needle_goes_out_when_the_estimate_of_the_rest_says_so(gate):
    bench = Bench(gate_time=1.0, target_count=1)
    for _ in range(3000):
        bench.step(gate=gate)
        assert bench.sequence.listening == (bench.sequence.state == model.CONTACT)
        assert bench.sequence.hold or not bench.sequence.listening  # what is listened to is the wall's motion alone
    assert bench.sequence.injected == gate
    assert bench.sequence.missed == (not gate)
    check(bench.record)


EVENTS = st.lists(
    st.tuples(
        st.integers(1, 120),  # how long [periods]
        st.sampled_from(["none", "none", "abort", "force_lost", "position_lost", "force", "jam", "needle", "disable"]),
        st.floats(0.0, 0.6),
    ),
    min_size=1,
    max_size=25,
)


@pytest.mark.slow
@given(EVENTS)
@settings(max_examples=150, deadline=None)
def test_nothing_moves_with_the_needle_out_whatever_happens(events):
    bench = Bench(settle=0.05)
    for length, kind, value in events:
        for k in range(length):
            inputs = {
                "abort": {"abort": k == 0},
                "force_lost": {"force_valid": False, "measured_force": value},
                "position_lost": {"position_valid": False},
                "force": {"measured_force": value},
                "disable": {"enable": False},
            }.get(kind, {})
            bench.jammed = kind == "jam"
            if kind == "needle" and k == 0 and value > 0.4:
                bench.slide = 4e-3  # the needle is pushed out by hand
            bench.step(**{"enable": True, **inputs})
    check(bench.record)
    assert bench.sequence.volume <= 1e-7 * (3 + len(events))


@given(st.floats(0.2, 0.9), st.floats(2e-3, 5e-3))
@settings(max_examples=30, deadline=None)
def test_the_wall_gets_what_the_syringe_gives(angle, length):
    site = InjectionSite(tip_angle=angle, tip_z=10.5e-3, needle_length=length, flow=2e-8)
    site.start()
    for k in range(100):
        site.needle_length = length * (1.0 - k / 100)
        site.advance(0.05 * k, 0.05)
    assert site.given + site.lost == pytest.approx(100 * 0.05 * 2e-8, rel=1e-9)
    assert site.given > 0.5 * (site.given + site.lost)
    assert site.dose.sum() == pytest.approx(site.given, rel=1e-12)


def test_the_profile_of_an_even_dose_is_even():
    layers = {
        f"layer_{k}": np.array([0.0, 0.0, amount]) for k, amount in enumerate((0.5, 1.0, 1.0, 1.0, 0.2, 0.0), start=1)
    }
    layers = {name: np.repeat(values, 5) for name, values in layers.items()}
    result = profile(**layers)
    assert result["spread"] == 0.0
    assert result["amount"][:6].tolist() == [0.5, 1.0, 1.0, 1.0, 0.2, 0.0]
    assert result["depth"][1] == pytest.approx(0.375e-3)
