"""What the rig needs to hold a force on a beating wall: the sequence of a contact, strokes with a reserve, hand-overs."""

import numpy as np
import pytest
from fmus.coaxial_friction.model import CoaxialFriction
from fmus.contact_sequence.model import APPROACH, HOLD, LEARN, OVER, PHASES, REST, RETREAT, SETTLE, ContactSequence
from fmus.heart.model import Heart
from fmus.regripping_sequencer.evaluate import smoothness

from tests.fmus.rails import make

H = 1e-3


def sequence(native, forces, seconds, **parameters):
    """Phase, speed and flags of a sequence that is shown forces (time from which on: value); the controller asks 7 mm/s."""
    times = {"begin": 0.1, "settle_time": 0.2, "learn_time": 0.3, "hold_time": 0.4, "retreat_distance": 6e-3}
    part = native(ContactSequence, control_velocity=7e-3, **(times | parameters))
    part.start(0.0)
    rows = []
    for step in range(round(seconds / H)):
        part.force = next(force for begin, force in reversed(forces) if step * H >= begin)
        assert part.advance(step * H, H) == 0
        rows.append((part.phase, part.target_velocity, part.learn, part.feed_forward, part.relieved))
    return np.array(rows, float)


def test_phases_follow_each_other_and_each_does_what_its_row_says(native):
    rows = sequence(native, [(0.0, 0.0), (0.5, 0.2)], 2.5)
    phases = rows[:, 0].astype(int)
    first = {phase: int(np.argmax(phases == phase)) * H for phase in range(OVER + 1)}
    assert (np.diff(phases) >= 0).all()
    assert first[APPROACH] == pytest.approx(0.1, abs=3 * H)
    assert first[SETTLE] == pytest.approx(0.52, abs=3 * H)  # felt for contact_time
    assert first[LEARN] - first[SETTLE] == pytest.approx(0.2, abs=3 * H)
    assert first[HOLD] - first[LEARN] == pytest.approx(0.3, abs=3 * H)
    assert first[RETREAT] - first[HOLD] == pytest.approx(0.4, abs=3 * H)
    assert first[OVER] - first[RETREAT] == pytest.approx(0.3, abs=3 * H)  # 6 mm at 20 mm/s
    speeds = {REST: 0.0, APPROACH: 0.01, SETTLE: 7e-3, LEARN: 7e-3, HOLD: 7e-3, RETREAT: -0.02, OVER: 0.0}
    for phase, _, learns, feeds in PHASES:
        shown = rows[phases == phase]
        assert (shown[:, 1] == speeds[phase]).all(), phase
        assert (shown[:, 2] == learns).all(), phase
        assert (shown[:, 3] == feeds).all(), phase
    assert not rows[:, 4].any()


def test_a_touch_that_is_too_short_is_none(native):
    touches = [(0.2 + 0.03 * k + d, f) for k in range(20) for d, f in ((0.0, 0.2), (0.015, 0.0))]
    rows = sequence(native, [(0.0, 0.0), *touches], 1.0)
    assert rows[-1, 0] == APPROACH


@pytest.mark.parametrize("at", [0.3, 0.6, 0.9, 1.1])
def test_a_force_too_high_leads_back_from_any_phase(native, at):
    rows = sequence(native, [(0.0, 0.0), (0.25, 0.2), (at, 0.6)], at + 0.1)
    assert rows[-1, 0] == RETREAT
    assert rows[-1, 1] == -0.02
    assert rows[-1, 4]
    assert rows[round((at - 0.01) / H), 0] < RETREAT


def beaten(rig, seconds, drift, amplitude=6e-3, rate=1.0):
    """Ask the rig for a beat on top of a drift; the largest difference between the speeds asked and commanded [m/s]."""
    missed = 0.0
    for step in range(round(seconds * 100)):
        omega = 2 * np.pi * rate
        speed = drift + amplitude * omega * np.cos(omega * step / 100)
        rig.run(0.01, speed)
        missed = max(missed, abs(rig.places["instrument_target_velocity"][0] - speed))
    return missed


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("drift", [5e-3, -5e-3])
def test_with_a_reserve_a_beat_needs_no_hand_over_and_a_drift_few(native, drift):
    rig = make(native, seed=11, reserve=10e-3, instrument_acceleration=3.0)
    rig.run(3.0, 4.0 * drift)
    beaten(rig, 3.0, 0.0)
    before = int(rig.sequencer.regrip_count)
    assert beaten(rig, 6.0, 0.0) < 3e-3
    assert rig.sequencer.regrip_count == before
    assert beaten(rig, 12.0, drift) < 3e-3
    assert 2 <= rig.sequencer.regrip_count - before <= 5
    assert rig.sequencer.violation == 0
    assert not rig.judge.seen


def test_without_a_reserve_the_same_drift_is_held_up(native):
    rig = make(native, seed=11, instrument_acceleration=3.0)
    rig.run(3.0, 0.02)
    beaten(rig, 3.0, 0.0)
    assert beaten(rig, 12.0, 5e-3) > 10e-3
    assert not rig.judge.seen


def test_a_drift_against_the_last_travel_holds_it_up_once(native):
    """The free gripper waits at the wrong end of its stroke: the instrument stands until it has crossed."""
    rig = make(native, seed=11, reserve=10e-3, instrument_acceleration=3.0)
    rig.run(3.0, 0.02)
    beaten(rig, 3.0, 0.0)
    begin = rig.instrument
    beaten(rig, 12.0, -5e-3)
    assert rig.instrument - begin == pytest.approx(-0.06, abs=0.02)
    assert rig.sequencer.violation == 0
    assert not rig.judge.seen


def test_an_instrument_that_goes_back_for_good_turns_the_strategy(native):
    rig = make(native, seed=12, reserve=10e-3)
    rig.run(6.0, 0.02)
    begin = rig.instrument
    rig.run(6.0, -0.02)
    assert rig.instrument - begin < -0.1
    assert rig.sequencer.violation == 0
    assert not rig.judge.seen


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("seed", range(4))
def test_any_motion_with_a_reserve_breaks_no_rule(native, seed):
    random = np.random.default_rng(seed)
    rig = make(native, seed=seed, reserve=float(random.uniform(1e-3, 12e-3)), instrument_acceleration=3.0)
    for _ in range(60):
        rig.run(float(random.uniform(0.02, 0.8)), float(random.uniform(-0.1, 0.1)))
    assert rig.sequencer.violation == 0
    assert not rig.judge.seen


def test_smoothness_sees_a_stop_and_leaves_the_ends_out():
    commanded = np.concatenate((np.linspace(0.0, 0.02, 50), np.full(400, 0.02), np.linspace(0.02, 0.0, 50)))
    smooth = smoothness(np.concatenate((np.zeros(80), commanded[80:])), commanded)  # play is run through first
    assert smooth["lowest"] == pytest.approx(1.0)
    assert smooth["standing"] == 0.0
    stopping = commanded.copy()
    stopping[200:220] = 0.0
    found = smoothness(stopping, commanded)
    assert found["lowest"] == 0.0
    assert found["standing"] == pytest.approx(20 / 400, abs=2e-3)


def test_a_load_is_added_to_the_catheter_and_not_to_the_wire(native):
    part = native(CoaxialFriction, wire_position=0.3, catheter_position=0.3)
    part.start(0.0)
    part.wire_position, part.catheter_load = 0.3005, 0.2
    assert part.advance(0.0, H) == 0
    assert part.wire_force == pytest.approx(0.25)
    assert part.catheter_force == pytest.approx(0.2 - 0.25)


def test_a_drift_begins_and_ends_without_a_jump(native):
    part = native(Heart, scale=0.0, drift=5e-3, drift_begin=1.0, drift_time=2.0)
    part.start(0.0)
    places = []
    for step in range(4000):
        assert part.advance(step * H, H) == 0
        places.append(part.position)
    places = np.array(places)
    assert places[998] == 0.0
    assert np.abs(np.diff(places)).max() == pytest.approx(5e-6)
    assert places[-1] == pytest.approx(10e-3)
