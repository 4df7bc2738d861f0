"""Phase of the heartbeat from the R wave of the electrocardiogram."""

from math import floor, pi

from twin.component import Component, Int64, input, local, normal, output, parameter, seed_stream


class HeartPhase(Component):
    """Phase of the heartbeat for gating: counted from the last R wave with the period of the beats before.

    The wave itself is not simulated: it is where the phase of `heart` is 0, found with jitter and a delay.
    """

    period = 5e-3

    rate = input("Hz", "true heart rate, as `heart` has it", start=1.0, minimum=0.1, nominal=0.3)

    phase = output("rad", "phase of the heartbeat, ahead by `lead`, from 0 to 2 pi")
    beats = output("", "R waves found", type=Int64)

    jitter = parameter(4e-3, "s", "standard deviation of the time at which a wave is found", display_unit="ms",
                       minimum=0.0, source="estimate: detectors on a noisy electrocardiogram, 2 to 10 ms")
    delay = parameter(20e-3, "s", "time until a wave is found, known and made up for", display_unit="ms", minimum=0.0,
                      source="estimate: filters of a detector in real time, 10 to 40 ms")
    lead = parameter(90e-3, "s", "time by which the phase is ahead", display_unit="ms", minimum=0.0,
                     source="chosen: half of the time in which the handle's stepper crosses the play, 0.18 s")
    seed = parameter(18, "", "seed of the jitter; give every noisy member its own", type=Int64, fixed=True,
                     source="arbitrary")

    true_phase = local(0.0, "", "phase of the heart in beats")
    last_wave = local(0.0, "s", "when the last wave was, as far as was found")
    beat = local(1.0, "s", "period of the beats before")
    pending = local(0.0, "s", "when the next wave will be reported; negative: none")
    pending_wave = local(0.0, "s", "its time")
    stream = local(0, "", "state of the random numbers", type=Int64, shape=(6,))

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.true_phase = 0.0
        self.last_wave = 0.0
        self.beat = 1.0 / max(self.rate, 0.1)
        self.pending = -1.0
        self.pending_wave = 0.0
        self.beats = 0
        self.phase = 0.0

    def step(self, t: float, h: float) -> None:
        before = floor(self.true_phase)
        self.true_phase += h * max(self.rate, 0.1)
        if floor(self.true_phase) > before:
            late = (self.true_phase - floor(self.true_phase)) / max(self.rate, 0.1)
            self.pending_wave = t + h - late + self.jitter * normal(self.stream)
            self.pending = t + h - late + self.delay
        if 0.0 <= self.pending <= t + h:
            # half of the news: a jitter of one wave moves the phase less
            predicted = self.last_wave + self.beat
            self.beat += 0.2 * (self.pending_wave - self.last_wave - self.beat)
            self.last_wave = predicted + 0.5 * (self.pending_wave - predicted)
            self.pending = -1.0
            self.beats += 1
        part = (t + h + self.lead - self.last_wave) / self.beat
        self.phase = 2.0 * pi * (part - floor(part))
