"""Force controllers that learn the beat, on a heart that is a formula, and behind faults of their sensor."""

import numpy as np
import pytest
from fmus.learned_control import BLIND, DISTURBED, LOCKED, PI_ALONE, WALL_ALONE, WORSE
from fmus.phase_filter import BINS
from fmus.phase_locked_control.model import PhaseDomainRepetitiveControl
from fmus.quasi_periodic_control.model import QuasiPeriodicControl

PERIOD, STIFFNESS = 5e-3, 11.2
LATE = 3  # periods from a demand until the sensor's value shows it: a plant that is nothing else
DELAY = LATE * PERIOD
KNOWN = {
    PhaseDomainRepetitiveControl: {"delay": DELAY, "play": 0.0},
    QuasiPeriodicControl: {"delay": DELAY},
}  # of this plant
ACCELERATION = {PhaseDomainRepetitiveControl: 10.0, QuasiPeriodicControl: 8.0}  # [m/s2]


def beat(t, rate=1.2):
    """A heart [m] without a sharp edge."""
    return 4e-3 * np.sin(2 * np.pi * rate * t) + 2e-3 * np.sin(4 * np.pi * rate * t + 2.8)


class Loop:
    """A controller, and a tip that is where it was asked to be `late` periods ago; a sensor that holds its value for some."""

    def __init__(self, control, heart=beat, noise=1e-3, stiffness=STIFFNESS, late=LATE, hold=1, wall=False):
        self.control, self.heart, self.stiffness, self.late, self.hold, self.wall = (
            control,
            heart,
            stiffness,
            late,
            hold,
            wall,
        )
        self.noise = noise * np.random.default_rng(1).standard_normal(20000)
        self.places, self.forces, self.velocities, self.states = [0.0] * late, [], [], []
        self.measured = 0.2
        control.start(0.0)

    def run(self, until, sensor=lambda force: force):
        """Go on; the true force of each tick is kept."""
        while len(self.forces) * PERIOD < until:
            k = len(self.forces)
            force = 0.2 + self.stiffness * (self.places[-self.late] - self.heart(k * PERIOD))
            if k % self.hold == 0:
                self.measured = force + self.noise[k]
            self.control.force = sensor(self.measured)
            if self.wall:
                self.control.heart_position = self.heart(k * PERIOD)
                self.control.heart_status = 0
            self.control.advance(k * PERIOD, PERIOD)
            velocity = float(self.control.target_velocity)
            self.places.append(self.places[-1] + PERIOD * velocity)
            self.forces.append(force)
            self.velocities.append(velocity)
            self.states.append(int(self.control.state))
        return self

    def error(self, begin):
        return np.array(self.forces[round(begin / PERIOD) :]) - 0.2


@pytest.fixture(params=[PhaseDomainRepetitiveControl, QuasiPeriodicControl], ids=lambda cls: cls.__name__)
def cls(request):
    return request.param


@pytest.fixture
def loop(native, cls):
    """Locked after nine seconds."""
    return Loop(native(cls, **KNOWN[cls])).run(9.0)


@pytest.mark.slow
def test_what_repeats_is_learned_and_the_rate_found(loop):
    alone = np.std(loop.error(3.0)[:400])
    loop.run(16.0)
    assert loop.states[-1] == LOCKED
    assert loop.control.rate == pytest.approx(1.2, abs=0.01)
    assert np.std(loop.error(12.0)) < 0.1 * alone


@pytest.mark.slow
def test_compiled_and_interpreted_are_one_once_it_follows(loop, cls):
    plain = cls(**KNOWN[cls])
    plain.record[...] = loop.control.record
    for k in range(1800, 1860):
        for control in (loop.control, plain):
            control.force = 0.2 + 0.01 * np.sin(0.3 * k)
            control.advance(k * PERIOD, PERIOD)
    assert plain.target_velocity == loop.control.target_velocity
    learned = "profile" if cls is PhaseDomainRepetitiveControl else "past"
    assert np.array_equal(getattr(plain, learned), getattr(loop.control, learned))


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("value", [0.0, 0.21, 5.0, np.nan, np.inf], ids=str)
def test_a_sensor_that_drops_out_moves_nothing(loop, value):
    loop.run(9.2, sensor=lambda _: value)
    assert loop.states[-1] == BLIND
    loop.run(14.0)
    assert np.abs(loop.error(9.0)).max() < 0.05
    assert loop.states[-1] == LOCKED


def test_a_sensor_that_stays_away_ends_in_pi_without_a_jump(loop):
    loop.run(13.0, sensor=lambda _: np.nan)
    assert loop.states[-1] == PI_ALONE
    assert abs(loop.velocities[-1]) < 1e-9
    steps = np.abs(np.diff(loop.velocities))
    assert steps[1800:].max() <= 1.1 * steps[1400:1800].max()  # no more than the beat asked for before
    loop.run(24.0)
    assert loop.states[-1] == LOCKED


@pytest.mark.slow
def test_what_does_not_repeat_is_left_to_pi(native, cls):
    rng = np.random.default_rng(2)
    steps = np.cumsum(rng.standard_normal(8000))
    drift = np.convolve(steps, np.ones(40) / 40, mode="same")
    drift *= 4e-3 / drift.std()

    def heart(t):
        return drift[round(t / PERIOD)]

    alone = Loop(native(cls, **KNOWN[cls], enable=False), heart).run(30.0)
    loop = Loop(native(cls, **KNOWN[cls]), heart).run(30.0)
    assert np.std(loop.error(6.0)) < 1.3 * np.std(alone.error(6.0))


def test_the_demand_changes_no_faster_than_the_motor_may(native, cls):
    wild = np.random.default_rng(3).normal(0.2, 0.2, 4000)
    loop = Loop(native(cls, **KNOWN[cls])).run(9.0, sensor=lambda force: wild[round(1e3 * abs(force)) % 4000])
    steps = np.abs(np.diff(loop.velocities))
    assert steps.max() == pytest.approx(ACCELERATION[cls] * PERIOD)


def test_a_large_error_is_gone_sooner_than_by_pi_and_without_swinging(native, cls):
    def heart(t):
        return beat(t) + (5e-3 if t > 12.0 else 0.0)

    rests = []
    for beyond in (0.0, 1.5):
        loop = Loop(native(cls, **KNOWN[cls], proportional_beyond=beyond), heart, noise=0.0).run(12.15)
        error = loop.error(12.0 + 2 * DELAY)
        rests.append(np.sum(error**2))
        assert error.max() < 0.012
    assert rests[1] < 0.8 * rests[0]


def test_it_fades_out_when_it_is_told(loop):
    loop.control.enable = False
    loop.run(10.5)
    assert loop.states[-1] == PI_ALONE
    assert loop.control.feedforward == 0.0
    assert np.abs(np.diff(loop.velocities[1800:])).max() < 0.02


def test_a_beat_that_stops_is_given_up(native, cls):
    loop = Loop(native(cls, **KNOWN[cls]), heart=lambda t: beat(min(t, 12.0)))
    loop.run(13.5)
    assert np.abs(loop.error(13.0)).max() < 0.1
    loop.run(22.0)
    assert np.abs(loop.error(21.0)).max() < 0.02


def early(t):
    """One beat in the eighteenth comes 0.3 of a beat early, within 0.1 of one; a full compensatory pause makes up for it."""
    u = 1.2 * t - 18.0
    ahead = np.interp(u, [0.6, 0.7, 2.0], [0.0, 0.3, 0.0], left=0.0, right=0.0)
    return beat(t + ahead / 1.2)


@pytest.mark.parametrize("cls", [PhaseDomainRepetitiveControl], indirect=True)
def test_a_beat_that_comes_early_is_found_again_and_its_pause_followed(native, cls):
    loop = Loop(native(cls, **KNOWN[cls]), early).run(15.65)
    assert np.abs(loop.error(15.6)).max() < 0.02  # the sweep is over at 15.58 s
    loop.run(16.6)
    assert loop.control.rate < 1.1  # the pause is slower by a quarter of a beat
    loop.run(19.0)
    assert loop.control.rate == pytest.approx(1.2, rel=0.02)
    assert np.abs(loop.error(15.7)).max() < 0.02


def test_a_play_that_is_not_there_leaves_less_than_the_fallback(native):
    """Told 2.1 mm of play: stiffness and delay are estimated wrongly too."""
    loop = Loop(native(PhaseDomainRepetitiveControl, delay=DELAY), early).run(20.0)
    alone = Loop(native(PhaseDomainRepetitiveControl, delay=DELAY, enable=False), early).run(20.0)
    assert np.std(loop.error(12.0)[:600]) < 0.8 * np.std(alone.error(12.0)[:600])
    assert np.abs(loop.error(16.0)).max() < 0.08


def breathing(rate, begin=0.0):
    """The heart, moved by 3 mm with respiration at a rate [Hz] from some time on."""
    return lambda t: beat(t) + (3e-3 * np.sin(2 * np.pi * rate * (t - begin)) if t > begin else 0.0)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("rate", [0.1, 0.35, 0.5])
def test_the_rate_of_respiration_is_found(native, rate):
    loop = Loop(native(PhaseDomainRepetitiveControl, **KNOWN[PhaseDomainRepetitiveControl]), breathing(rate)).run(25.0)
    assert loop.states[-1] == LOCKED
    assert loop.control.breath_rate_estimate == pytest.approx(rate, abs=0.02)
    assert np.std(loop.error(15.0)) < 1.5e-3


@pytest.mark.slow
def test_respiration_may_begin_late(native):
    loop = Loop(native(PhaseDomainRepetitiveControl, **KNOWN[PhaseDomainRepetitiveControl]), breathing(0.4, 15.0)).run(
        30.0
    )
    assert set(loop.states[2400:]) <= {LOCKED, DISTURBED}
    assert loop.states[-1] == LOCKED
    assert loop.control.breath_rate_estimate == pytest.approx(0.4, abs=0.02)
    assert np.std(loop.error(22.0)) < 1.5e-3


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("ratio", "late"), [(0.5, LATE), (2.0, LATE), (1.0, LATE + 4)])
def test_stiffness_and_delay_are_measured_while_it_fades_in(native, ratio, late):
    """At least a third of what they differ by from what is told; in the frictionless plant of these tests more is not seen."""
    known = KNOWN[PhaseDomainRepetitiveControl]
    loop = Loop(native(PhaseDomainRepetitiveControl, **known), noise=3e-3, stiffness=ratio * STIFFNESS, late=late).run(
        25.0
    )
    if ratio != 1.0:
        assert 0.33 < (float(loop.control.stiffness_estimate) / STIFFNESS - 1.0) / (ratio - 1.0) < 1.3
    else:
        assert 0.33 < (float(loop.control.delay_estimate) - DELAY) / (late * PERIOD - DELAY) < 1.3
    assert loop.states[-1] == LOCKED
    alone = Loop(
        native(PhaseDomainRepetitiveControl, **known, enable=False), noise=3e-3, stiffness=ratio * STIFFNESS, late=late
    ).run(25.0)
    assert np.std(loop.error(15.0)) < 0.5 * np.std(alone.error(15.0))


@pytest.mark.slow
def test_a_noisy_sensor_is_noticed_and_learned_from_slowly(native):
    loop = Loop(native(PhaseDomainRepetitiveControl, **KNOWN[PhaseDomainRepetitiveControl]), noise=12e-3).run(30.0)
    assert np.mean(np.array(loop.states[2400:]) == LOCKED) > 0.95
    alone = Loop(
        native(PhaseDomainRepetitiveControl, **KNOWN[PhaseDomainRepetitiveControl], enable=False), noise=12e-3
    ).run(30.0)
    assert np.std(loop.error(12.0)) < 0.4 * np.std(alone.error(12.0))


@pytest.mark.slow
def test_a_slow_sensor_is_noticed(native):
    loop = Loop(
        native(PhaseDomainRepetitiveControl, **KNOWN[PhaseDomainRepetitiveControl]), hold=10, late=LATE + 9
    ).run(40.0)
    assert loop.control.hold_periods == 10
    assert np.std(loop.error(20.0)) < 8e-3  # PI leaves 30 mN


def test_a_fast_heart_is_followed_at_once(native):
    loop = Loop(
        native(PhaseDomainRepetitiveControl, **KNOWN[PhaseDomainRepetitiveControl]), heart=lambda t: beat(t, 2.5)
    ).run(12.0)
    assert loop.control.rate == pytest.approx(2.5, rel=0.02)
    assert np.std(loop.error(8.0)) < 5e-3  # PI leaves 40 mN


@pytest.mark.slow
def test_where_the_measured_wall_leaves_less_that_is_used_and_told(native):
    """The learned motion is given up when it leaves more than a ten-thousandth of what the wall's feedforward left: always."""
    known = KNOWN[PhaseDomainRepetitiveControl] | {"worse": 1e-4}
    sees = Loop(native(PhaseDomainRepetitiveControl, **known), wall=True).run(60.0)
    blind = Loop(native(PhaseDomainRepetitiveControl, **known)).run(60.0)
    assert WALL_ALONE in sees.states
    assert WALL_ALONE not in blind.states
    given_up = [np.array(loop.states) == WORSE for loop in (sees, blind)]
    assert all(np.any(states) for states in given_up)
    errors = [np.std(loop.error(0.0)[states]) for loop, states in zip((sees, blind), given_up, strict=True)]
    assert errors[0] < 0.7 * errors[1]


def test_what_was_worse_waits_longer_each_time(native):
    """The learned motion is given up when it leaves more than a hundredth of what PI left: always."""
    loop = Loop(native(PhaseDomainRepetitiveControl, **KNOWN[PhaseDomainRepetitiveControl], worse=1e-4)).run(60.0)
    states = np.array(loop.states)
    waits = np.diff(np.flatnonzero(np.diff((states == WORSE).astype(int))))[::2] * PERIOD
    assert len(waits) >= 2
    assert np.all(np.diff(waits) > 3.0)


@pytest.mark.parametrize("cls", [PhaseDomainRepetitiveControl], indirect=True)
def test_the_bins_meet_at_the_whole_turn(loop):
    assert len(loop.control.profile) == BINS
    loop.run(16.0)
    steps = np.diff(np.append(loop.control.profile, loop.control.profile[0]))
    assert abs(steps[-1]) < 4 * np.abs(steps[:-1]).max()


@pytest.mark.parametrize("cls", [QuasiPeriodicControl], indirect=True)
def test_the_length_of_the_beat_is_followed(native, cls):
    """From 1.1 to 1.3 Hz within ten seconds."""
    loop = Loop(native(cls, **KNOWN[cls]), heart=lambda t: beat(t * (1.1 + 0.01 * max(min(t, 20.0) - 10.0, 0.0)), 1.0))
    loop.run(10.0)
    before = float(loop.control.rate)
    loop.run(19.0)
    assert before == pytest.approx(1.1, abs=0.03)
    assert loop.control.rate > 1.2
    assert np.std(loop.error(15.0)) < 0.02
