import numpy as np
import pytest
from fmus.heart.model import Heart

from tests.matrix import some

R = np.array([4, 2, 0.4, 0.1, 0.005, 0.001, 0.0005]) * 1e-3
THETA = np.array([0, 2.8, 2.8, 0, 3.7, 1.2, 5.6])


def at(heart, times):
    values = []
    for t in times:
        heart.start(t)
        values.append((float(heart.position), float(heart.velocity)))
    return np.array(values).T


def test_is_equation_4(native):
    times = np.linspace(1.0, 3.0, 400)
    position, velocity = at(native(Heart), times)
    i = np.arange(1, 8)
    angle = 2 * np.pi * np.outer(times, i)
    np.testing.assert_allclose(position, np.sin(angle + THETA) @ R, atol=1e-15)
    np.testing.assert_allclose(velocity, np.cos(angle + THETA) @ (2 * np.pi * i * R), atol=1e-14)
    assert np.ptp(position) == pytest.approx(10.65e-3, rel=1e-3)


def test_velocity_is_the_rate_of_position_also_while_blending_in(native):
    times = np.arange(0.0, 1.5, 1e-4)
    position, velocity = at(native(Heart, rate=1.3, scale=0.7, offset=2e-3), times)
    assert position[0] == 2e-3
    assert velocity[0] == 0.0
    np.testing.assert_allclose(np.gradient(position, times)[1:-1], velocity[1:-1], atol=1e-5)


def test_blend_in_can_be_left_out(native):
    position, _ = at(native(Heart, blend_in=0.0), [0.0])
    assert position[0] == pytest.approx(np.sin(THETA) @ R)


def test_advance_gives_the_end_of_the_step(native):
    heart, other = native(Heart), native(Heart)
    heart.start(0.0)
    heart.advance(0.4, 0.1)
    other.start(0.5)
    assert heart.position == other.position


ALIVE = {"wander": 0.05, "sinus_arrhythmia": 0.05, "respiration": 3e-3, "ectopic_every": 6}
IRREGULAR = {"irregularity": 0.2, "ectopic_share": 0.1, "drift": 1e-4, "ramp": 0.6, "ramp_begin": 3.0, "ramp_time": 8.0}


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("rate", "alive"),
    some(
        [(0.8, ALIVE), (1.3, ALIVE), (2.0, ALIVE), (0.8, IRREGULAR), (1.2, IRREGULAR)],
        [(2.0, ALIVE), (0.8, IRREGULAR)],
    ),
)
def test_velocity_is_the_rate_of_position_of_a_heart_that_is_alive(native, rate, alive):
    times = np.arange(0.0, 12.0, 1e-4)
    position, velocity = at(native(Heart, rate=rate, **alive), times)
    off = np.abs(np.gradient(position, times)[1:-1] - velocity[1:-1])  # of 0.4 m/s
    assert np.mean(off > 1e-3) < 1e-4  # it bends where the sweep of an ectopic beat ends
    assert off.max() < 0.02


@pytest.mark.slow
def test_a_change_of_the_rate_keeps_the_phase():
    heart = Heart(blend_in=0.0)
    heart.start(0.0)
    before = []
    for step in range(4000):
        if step in (1234, 2345):
            heart.rate += 0.4
        heart.advance(step * 1e-3, 1e-3)
        before.append(float(heart.position))
    assert np.abs(np.diff(before)).max() < 1.8 * 42e-3 * 1e-3  # speeds grow with the rate, no more


@pytest.mark.slow
def test_the_rate_wanders_as_far_as_it_is_told_and_by_the_seed_alone(native):
    times = np.arange(0.0, 600.0, 0.01)
    plain, sine = (1e-3, *(0.0,) * 6), (0.0,) * 7
    first, _ = at(native(Heart, amplitude=plain, phase=sine, wander=0.05, blend_in=0.0), times)
    again, _ = at(native(Heart, amplitude=plain, phase=sine, wander=0.05, blend_in=0.0), times)
    other, _ = at(native(Heart, amplitude=plain, phase=sine, wander=0.05, blend_in=0.0, seed=22), times)
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    up = np.flatnonzero((first[:-1] < 0.0) & (first[1:] >= 0.0))
    part = first[up] / (first[up] - first[up + 1])
    beats = np.diff(times[up] + 0.01 * part)
    assert np.std(1.0 / beats) == pytest.approx(0.05, rel=0.1)


def test_an_ectopic_beat_comes_early_and_its_pause_makes_up_for_it(native):
    times = np.arange(0.0, 12.0, 1e-3)
    usual, _ = at(native(Heart), times)
    early, _ = at(native(Heart, ectopic_every=6, ectopic_coupling=0.65), times)
    off = times[np.abs(early - usual) > 1e-6]
    assert off.min() == pytest.approx(4.65, abs=0.02)  # beats 4 and 5 of each six
    assert {int(t) for t in off} == {4, 5, 10, 11}


def test_respiration_is_added(native):
    times = np.arange(1.0, 9.0, 1e-2)
    position, _ = at(native(Heart, respiration=3e-3), times)
    usual, _ = at(native(Heart), times)
    np.testing.assert_allclose(position - usual, 3e-3 * np.sin(2 * np.pi * 0.25 * times), atol=1e-12)


def run(heart, stop, events=()):
    """Position and beats at each millisecond; events: (time, variable, value)."""
    heart.start(0.0)
    found = []
    for step in range(round(stop * 1e3)):
        for when, name, value in events:
            if step == round(when * 1e3):
                setattr(heart, name, value)
        heart.advance(step * 1e-3, 1e-3)
        found.append((float(heart.position), float(heart.beats)))
    return np.array(found).T


@pytest.mark.slow
def test_a_change_of_the_rate_keeps_the_phase_of_a_heart_that_wanders(native):
    living = {**ALIVE, "respiration": 0.0, "irregularity": 0.05, "systole_by_rate": True}
    position, beats = run(native(Heart, blend_in=0.0, **living), 40.0, [(17.234, "rate", 1.9), (31.345, "rate", 0.8)])
    assert np.abs(np.diff(position)).max() < 0.4e-3  # 0.4 m/s in the sweep of an ectopic beat at 1.9 Hz
    assert np.diff(beats).min() > 0.0
    assert np.diff(beats).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("irregularity", [0.03, 0.2])
def test_beats_differ_as_much_as_they_are_told(native, irregularity):
    _, beats = run(native(Heart, irregularity=irregularity), 400.0)
    waves = np.interp(np.arange(1, 390), beats, 1e-3 * (np.arange(len(beats)) + 1))
    lengths = np.diff(waves)
    assert np.std(lengths) == pytest.approx(irregularity, rel=0.1)
    assert lengths.min() > 0.35
    shifts = waves - np.arange(1, 390)
    assert abs(np.corrcoef(shifts[1:], shifts[:-1])[0, 1]) < 0.12  # by chance, each for itself


def test_the_rate_rises_from_0_8_to_2_hertz(native):
    _, beats = run(native(Heart, rate=0.8, ramp=1.2, ramp_begin=5.0, ramp_time=10.0), 20.0)
    rate = np.gradient(beats, 1e-3)
    assert rate[[4900, 9999, 15100]] == pytest.approx([0.8, 1.4, 2.0], abs=1e-3)


@pytest.mark.slow
def test_ectopic_beats_come_as_often_as_they_are_told(native):
    _, beats = run(native(Heart, ectopic_share=0.1), 600.0)
    lengths = np.diff(np.interp(np.arange(1, 590), beats, 1e-3 * (np.arange(len(beats)) + 1)))
    early = np.flatnonzero(lengths < 0.9)
    assert len(early) / 590 == pytest.approx(0.1, abs=0.02)
    assert lengths[early] + lengths[early + 1] == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("rate", [0.2, 0.45, 0.5, 3.0])
def test_a_beat_with_its_own_systole_never_runs_backward(rate):
    heart = Heart(rate=rate, blend_in=0.0, systole_by_rate=True)
    heart.initialize()
    paces = []
    for k in range(300):
        heart.derivatives(k / 100 / rate)
        paces.append(heart.pace)
    assert min(paces) > 0.05


@pytest.mark.parametrize(("rate", "part"), [(0.8, 0.356), (1.0, 0.42), (2.0, 0.588)])
def test_systole_takes_its_own_time(native, rate, part):
    """The part of a beat in which the position runs through what is systole at 1 Hz."""
    one = {"amplitude": (1e-3, *(0.0,) * 6), "phase": (0.0,) * 7, "blend_in": 0.0, "systole_by_rate": True}
    position, beats = run(native(Heart, rate=rate, **one), 10.0)
    inside = position < np.sin(2 * np.pi * (0.75 - 0.21)) * 1e-3  # 0.42 of the beat around its lowest place
    assert inside[beats > 1.0].mean() == pytest.approx(part, abs=0.03)
