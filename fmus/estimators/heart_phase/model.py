"""Phase of the heartbeat from the R wave of the electrocardiogram."""

from math import floor, pi

from fmus.noisy import Noisy, noise_seed
from twin.component import Boolean, Int64, input, local, normal, output, parameter, seed_stream, uniform


class HeartPhase(Noisy):
    """Phase of the heartbeat for gating: counted from the last R wave with the period of the beats before.

    The wave itself is not simulated: it is where the phase of `heart` is 0, found with jitter and a delay.
    """

    period = 5e-3

    beats = input("", "true beats, as `heart` counts them: an R wave at each whole number", nominal=100.0)

    phase = output("rad", "phase of the heartbeat, ahead by `lead`, from 0 to 2 pi")
    beat_period = output("s", "period of the beats of late")
    waves = output("", "R waves found: a trigger for gating", type=Int64)
    valid = output("", "whether the last waves were found where they were expected, and lately", type=Boolean)

    jitter = parameter(4e-3, "s", "standard deviation of the time at which a wave is found", display_unit="ms",
                       minimum=0.0, source="estimate: detectors on a noisy electrocardiogram, 2 to 10 ms")
    delay = parameter(20e-3, "s", "time until a wave is found, known and made up for", display_unit="ms", minimum=0.0,
                      source="estimate: filters of a detector in real time, 10 to 40 ms")
    lead = parameter(90e-3, "s", "time by which the phase is ahead", display_unit="ms", minimum=0.0,
                     source="chosen: half of the time in which the handle's stepper crosses the play, 0.18 s")
    miss = parameter(0.0, "", "part of the waves that are not found", minimum=0.0, maximum=1.0,
                     source="0; detectors miss 0.002 to 0.05, by noise and motion, estimate")
    rate = parameter(1.0, "Hz", "rate that is taken before the first waves", minimum=0.1, source="rate of `heart`")
    lost_after = parameter(3.0, "", "beats without a wave after which the phase is not valid", minimum=1.0,
                           source="chosen: two misses in a row are bridged")
    tolerance = parameter(0.12, "", "part of a beat by which a regular wave may be early or late", minimum=0.0,
                          source="chosen: 5 % of variability and the jitter; ectopic beats are earlier by 0.2 to 0.5")
    regular_waves = parameter(3, "", "regular waves in a row before the phase is valid", type=Int64, minimum=1,
                              source="chosen: an ectopic beat and its pause are over then")
    seed = noise_seed(18, "the jitter")

    last_beats = local(0.0, "", "true beats at the last step")
    last_wave = local(0.0, "s", "when the last wave was, as far as was found")
    last_interval = local(0.0, "s", "between the last two waves")
    beat = local(1.0, "s", "period of the beats before")
    pending = local(0.0, "s", "when the next wave will be reported; negative: none")
    pending_wave = local(0.0, "s", "its time")
    regular = local(0, "", "regular waves in a row", type=Int64)
    last_passed = local(1.0, "", "beats between the last two waves")
    skipped = local(0, "", "waves in a row with as many beats between them, more than one", type=Int64)

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.last_beats = self.beats
        self.last_wave = -(self.beats - floor(self.beats)) / self.rate
        self.beat = 1.0 / self.rate
        self.last_interval = 0.0
        self.pending = -1.0
        self.pending_wave = 0.0
        self.waves = 0
        self.regular = 0
        self.last_passed = 1.0
        self.skipped = 0
        self.valid = False
        part = self.beats + self.lead / self.beat
        self.phase = 2.0 * pi * (part - floor(part))
        self.beat_period = self.beat

    def step(self, t: float, h: float) -> None:
        # the value at t: a wave lies between the last step and this one
        went = self.beats - self.last_beats
        if floor(self.beats) > floor(self.last_beats):
            overshoot = h * (self.beats - floor(self.beats)) / went
            is_detected = uniform(self.stream) >= self.miss
            self.pending_wave = t - overshoot + self.jitter * normal(self.stream)
            self.pending = t - overshoot + self.delay if is_detected else -1.0
        self.last_beats = self.beats
        if 0.0 <= self.pending <= t + h:
            take_wave(self)
        part = (t + h + self.lead - self.last_wave) / self.beat
        self.phase = 2.0 * pi * (part - floor(part))
        self.beat_period = self.beat
        fresh = t + h - self.last_wave <= self.lost_after * self.beat
        self.valid = fresh and self.regular >= self.regular_waves


def take_wave(self: HeartPhase) -> None:
    """Half of the news, so that a jitter moves the phase less; a wave out of time is where a new count begins.

    Waves that were missed are counted in.
    """
    passed = max(floor((self.pending_wave - self.last_wave) / self.beat + 0.5), 1.0)

    # before the first intervals nothing is known of the rate; and waves are not missed at the same place each time
    self.skipped = self.skipped + 1 if passed == self.last_passed and passed > 1.0 else 0
    self.last_passed = passed
    if self.waves < 2 or self.skipped >= self.regular_waves:
        passed = 1.0
        self.skipped = 0
    interval = (self.pending_wave - self.last_wave) / passed
    news = 1.0 / (self.waves + 1.0)  # the first waves count for more: the mean of what there is
    allowed = self.tolerance * self.beat
    lateness = passed * (interval - self.beat)
    if abs(lateness) <= allowed:
        self.regular += 1
        self.beat += max(0.2, news) * (interval - self.beat)
        self.last_wave = self.pending_wave - (1.0 - max(0.5, news)) * lateness
    elif abs(interval - self.last_interval) <= allowed:
        # as long as the one before: the rate has changed
        self.regular += 1
        self.beat = interval
        self.last_wave = self.pending_wave
    else:
        self.regular = 0
        self.beat += news * (interval - self.beat)
        self.last_wave = self.pending_wave
    self.last_interval = interval
    self.pending = -1.0
    self.waves += 1
