"""Where in the beat the wall rests: found from the contact force, at any rate, and not made up."""

import math
from pathlib import Path

import numpy as np
import pytest
from fmus.heart.model import Heart
from fmus.heart_phase.model import HeartPhase
from fmus.wall_rest.model import WallRest

from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, load_scenario

H = 5e-3
ROOT = Path(__file__).parents[2]


def smooth(x):
    """From 0 to 1, slow at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def course(part, rest, width=0.3):
    """Force over a part of the beat: still for `width` from `rest` on, elsewhere out and back."""
    u = (part - rest - width) % 1.0 / (1.0 - width)
    return 0.0 if u > 1.0 else float(smooth(2.0 * u) if u < 0.5 else smooth(2.0 - 2.0 * u))


class Bench:
    """Beats of given lengths [s], their R waves and phase as a detector tells them, and a force that repeats with them."""

    def __init__(self, native, rest=0.6, stroke=0.03, level=0.11, noise=3e-3, seed=1, **values):
        self.part = native(WallRest, **values)
        self.rest, self.stroke, self.level, self.noise = rest, stroke, level, noise
        self.random = np.random.default_rng(seed)
        self.part.start()
        self.t = self.begun = 0.0
        self.waves = 0
        self.opened = []  # part of the beat at which it arrives

    def beat(self, length, listening=True, valid=True, found=True, force=None):
        part = self.part
        for _ in range(round(length / H)):
            place = (self.t - self.begun) / length
            clean = self.level + self.stroke * course(place, self.rest)
            part.measured_force = clean + self.noise * self.random.standard_normal() if force is None else force
            part.phase = 2.0 * math.pi * (place % 1.0)
            part.beat_period, part.listening, part.phase_valid, part.waves = length, listening, valid, self.waves
            part.advance(self.t, H)
            self.t += H
            if part.open:
                self.opened.append((place + part.lead / length) % 1.0)
        self.begun = self.t
        self.waves += int(found)
        return self


def slow(places, rest):
    """Whether the force changes slowly at all parts of a beat: in the rest, and where it turns."""
    grid = np.linspace(0.0, 1.0, 2001)
    slopes = np.abs(np.gradient([course(part, rest) for part in grid], grid))
    return bool(places) and all(np.interp(place, grid, slopes) <= 0.35 * slopes.max() for place in places)


def inside(places, rest, width=0.3):
    """Whether all parts of a beat are within the rest."""
    return bool(places) and all((place - rest) % 1.0 <= width for place in places)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("rate", [40, 60, 90, 120, 150])
@pytest.mark.parametrize("rest", [0.05, 0.6, 0.85])
@pytest.mark.parametrize(("stroke", "level"), [(0.03, 0.11), (-0.1, 0.3)])
def test_the_rest_is_found_whatever_the_rate_the_stiffness_and_the_level(native, rate, rest, stroke, level):
    bench = Bench(native, rest, stroke, level, wave_delay=0.0)
    for _ in range(12):
        bench.beat(60.0 / rate)
    assert bench.part.valid
    assert slow(bench.opened, rest)
    if rate >= 90:  # the turn is too short for a needle then
        assert inside(bench.opened, rest)
    assert bench.part.stroke == pytest.approx(abs(stroke), rel=0.25)


def test_a_wave_that_is_found_late_moves_nothing(native):
    for delay in (0.0, 0.04):
        bench = Bench(native, wave_delay=delay)
        for _ in range(10):
            part, length = bench.part, 0.8
            for _ in range(160):  # the count of the waves is late, the phase is made up for that
                place = (bench.t % length) / length
                part.measured_force = 0.11 + 0.03 * course(place, 0.6)
                part.phase, part.beat_period = 2.0 * math.pi * place, length
                part.listening = part.phase_valid = True
                part.waves = math.floor((bench.t - delay + 1e-9) / length) + 1
                part.advance(bench.t, H)
                bench.t += H
        assert part.rest_phase / (2.0 * math.pi) == pytest.approx(0.75, abs=0.04)


@pytest.mark.slow
def test_noise_alone_opens_no_gate(native):
    for seed in range(5):
        bench = Bench(native, stroke=0.0, seed=seed)
        for _ in range(60):
            bench.beat(1.0)
        assert not bench.opened
        assert not bench.part.valid


def test_a_wall_that_never_rests_opens_no_gate(native):
    bench = Bench(native, noise=1e-3)
    for _ in range(10):
        for k in range(200):  # a zigzag
            force = 0.11 + 0.03 * abs(2.0 * (k / 200.0) - 1.0)
            part = bench.part
            part.measured_force, part.phase = force, 2.0 * math.pi * k / 200.0
            part.beat_period, part.listening, part.phase_valid, part.waves = 1.0, True, True, bench.waves
            part.advance(bench.t, H)
            bench.t += H
            assert not part.open
        bench.waves += 1


def test_nothing_is_known_before_enough_beats_and_of_a_new_contact_before_one(native):
    bench = Bench(native)
    bench.beat(1.0).beat(1.0).beat(1.0)  # the first is not whole: it had no wave before it
    assert not bench.part.valid
    bench.beat(1.0).beat(1.0)
    assert bench.part.valid
    bench.beat(1.0, listening=False)
    assert not bench.part.valid
    bench.beat(1.0)
    assert not bench.part.valid
    bench.beat(1.0).beat(1.0)
    assert bench.part.valid
    assert bench.part.beats > 3  # what was learned before is not lost


def test_early_beats_and_missed_waves_are_not_learned(native):
    bench = Bench(native, wave_delay=0.0)
    for _ in range(6):
        bench.beat(1.0)
    learned = bench.part.course.copy()
    part = bench.part
    for length in (0.6, 2.0):  # while the detector's period is still 1 s
        for k in range(round(length / H)):
            part.measured_force, part.phase = 0.11 + 0.05 * math.sin(0.1 * k), 2.0 * math.pi * (k * H % 1.0)
            part.beat_period, part.waves = 1.0, bench.waves
            part.advance(bench.t, H)
            bench.t += H
        bench.waves += 1
    part.waves = bench.waves
    part.advance(bench.t, H)
    np.testing.assert_allclose(part.course, learned, atol=1e-3)


def test_a_phase_that_is_not_valid_opens_no_gate(native):
    bench = Bench(native)
    for _ in range(8):
        bench.beat(1.0)
    bench.opened.clear()
    for _ in range(3):
        bench.beat(1.0, valid=False)
    assert not bench.opened
    assert not bench.part.valid


def test_another_rate_is_learned_anew(native):
    bench = Bench(native, rest=0.6, wave_delay=0.0)
    for _ in range(8):
        bench.beat(1.0)
    bench.rest = 0.1
    bench.beat(0.6)
    bench.opened.clear()
    for _ in range(8):
        bench.beat(0.6)
    assert inside(bench.opened, 0.1)


@pytest.mark.parametrize("force", [math.nan, math.inf, -math.inf])
def test_a_force_that_is_no_number_is_not_learned(native, force):
    bench = Bench(native)
    for _ in range(6):
        bench.beat(1.0)
    bench.beat(1.0, force=force)  # at its start the beat before is learned
    learned = bench.part.course.copy()
    bench.beat(1.0, force=force).beat(1.0)
    np.testing.assert_array_equal(bench.part.course, learned)
    for name in ("rest_phase", "rest_width", "stroke"):
        assert math.isfinite(getattr(bench.part, name))


@pytest.mark.slow
def test_the_wall_of_the_heart_rests_where_its_speed_says(native):
    for rate in (0.8, 1.0, 1.8):
        heart = Heart(rate=rate, blend_in=0.0, systole_by_rate=True)
        heart.start(0.0)
        t = np.arange(0.0, 12.0, H)
        position, velocity, beats = np.empty(len(t)), np.empty(len(t)), np.empty(len(t))
        for k, now in enumerate(t):
            heart.advance(now, H)
            position[k], velocity[k], beats[k] = float(heart.position), float(heart.velocity), float(heart.beats)
        part = native(WallRest, lead=0.0, wave_delay=0.0)
        part.start()
        part.listening = part.phase_valid = True
        part.beat_period = 1.0 / rate
        speeds = []
        for k, now in enumerate(t):
            part.measured_force = 0.11 - 3.0 * position[k]
            part.phase, part.waves = 2.0 * math.pi * (beats[k] % 1.0), math.floor(beats[k])
            part.advance(now, H)
            if part.open:
                speeds.append(abs(velocity[k]))
        assert speeds
        assert max(speeds) <= 0.3 * np.abs(velocity).max()


@pytest.mark.slow
@pytest.mark.parametrize("rate", [48, pytest.param(110, marks=pytest.mark.slow)])
def test_each_needle_enters_while_the_wall_rests_at_other_rates(rate, tmp_path, build):
    # the window of phases that was there before: 0 of 3 at 110 /min, at 0.5 to 0.9 of the wall's largest speed
    options = [f"heart.rate={rate} /min", "heart.systole_by_rate=true", "sequence.target_count=3", "stop_time=80 s"]
    scenario = load_scenario(ROOT / "scenarios" / "injection_sequence.yaml", options)
    outcome = run_scenario(
        scenario,
        RunOptions(backend=Backend.compiled, variants=["normal"], seeds=[1], root=tmp_path, build=build, report=False),
    )
    metrics = outcome.summary["metrics"]
    values = {
        name: metrics[name]["variants"]["normal"]["mean"] for name in ("entries", "resting", "missed", "entry_speed")
    }
    assert values["entries"] == values["resting"] == 3
    assert values["missed"] == 0
    assert values["entry_speed"] <= 0.25


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("rate", [40, 48, 60, 85, 110, 150, 180])
@pytest.mark.parametrize("seed", range(1, 17))
def test_the_phase_of_the_beat_is_found_at_any_rate_without_being_told_one(native, rate, seed):
    period, begin = 60.0 / rate, 0.37 * (seed % 2)  # half of the first intervals are whole
    part = native(HeartPhase, lead=0.0, seed=seed)
    part.beats = begin
    part.start()
    wrong = []
    for k in range(round(20.0 / H)):
        t = k * H
        part.beats = begin + t / period
        part.advance(t, H)
        if part.valid and t > 10.0 * period:
            true = begin + (t + H) / period
            away = (float(part.phase) / (2.0 * math.pi) - true + 0.5) % 1.0 - 0.5
            wrong.append(abs(away))
    assert part.valid
    assert max(wrong) < 0.1
    assert part.beat_period == pytest.approx(period, rel=0.03)


@pytest.mark.slow
def test_waves_that_are_missed_do_not_change_the_period(native):
    part = native(HeartPhase, lead=0.0, miss=0.1, seed=4)
    part.start()
    for k in range(round(120.0 / H)):
        part.beats = k * H / 0.9
        part.advance(k * H, H)
        if k * H > 10.0:
            assert part.beat_period == pytest.approx(0.9, rel=0.12)
