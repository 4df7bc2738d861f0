"""Repetitive force control: the last beat, filtered, is played back ahead by the delay."""

from math import exp, floor, pi

from fmus.beat_observer import (
    BREATH,
    BREATH_RATE,
    OFFSET,
    PHASE,
    QUADRATURE,
    RATE,
    BeatObserver,
    initialize_observer,
    publish_velocity,
    update_observer,
)
from fmus.control import control_velocity

from twin.component import Int64, local, parameter

MEMORY = 512  # periods that are remembered: a beat at 0.5 Hz, and its filter
REACH = 12  # periods to either side in the filter


class RepetitiveControl(BeatObserver):
    """Force controller with a delay line of one beat, whose length is that of the observer's phase.

    Hara, Yamamoto, Omata and Nakano, IEEE Trans. Autom. Control 33(7), 1988; the inverse of the loop as learning filter, as in
    Tomizuka, Tsao and Chew 1989. Equations in the README.
    What was learned is a beat old: a beat that differs from the last one is followed too late.
    """

    buffers = (*BeatObserver.buffers, ("rate_minimum", 0.8 * (MEMORY - 2 * REACH - 2)))  # 0.8: the slowest rate that is followed

    proportional = parameter(0.61, "m/(s*N)", "proportional gain", display_unit="mm/(s*N)", minimum=0.0,
                             source="tuned, see the README")
    lead = parameter(10.5e-3, "s", "by which what was learned is applied ahead, beyond the delay", display_unit="ms", minimum=0.0,
                     maximum=0.05, source="tuned, see the README")
    learning = parameter(0.32, "", "weight of a new beat in the playback", minimum=0.0, maximum=1.0,
                         source="tuned, see the README")
    width = parameter(0.85, "", "standard deviation of the low-pass filter Q in periods", minimum=0.3, maximum=5.0,
                      source="tuned, see the README")

    wanted = local(0.0, "m", "required position of the gripper, a ring", shape=(MEMORY,), display_unit="mm")
    phase_history = local(0.0, "rad", "phase of the beat at the same time, with whole turns", shape=(MEMORY,))
    sample_count = local(0, "", "periods since the start", type=Int64)
    innovation = local(0.0, "m", "what the last new value of the force left of the beat before", display_unit="mm")
    output_position = local(0.0, "m", "what was played back last", display_unit="mm")

    def initialize(self) -> None:
        for k in range(MEMORY):
            self.wanted[k] = 0.0
            self.phase_history[k] = 0.0
        self.sample_count = 0
        self.output_position = 0.0
        self.innovation = 0.0
        initialize_observer(self)

    def step(self, t: float, h: float) -> None:
        y = update_observer(self, t, h)
        velocity = 0.0
        if self.is_following:
            store_sample(self, y - self.mean[OFFSET] - self.mean[BREATH])
            lead = self.delay + self.lead
            last = self.output_position
            self.output_position = previous_beat(self, self.mean[RATE] * lead)
            velocity = (self.output_position - last) / h
            velocity += self.mean[BREATH_RATE] * (self.mean[QUADRATURE] - self.mean[BREATH_RATE] * lead * self.mean[BREATH])
        self.feedforward = self.trust * velocity
        publish_velocity(self, control_velocity(self, self.feedforward, h), h)


def store_sample(self: RepetitiveControl, wanted: float) -> None:
    """Blend the required position of now [m] with that of the previous beat, and store it."""
    last = self.phase_history[self.sample_count % MEMORY]
    turns = self.mean[PHASE] - last
    turns -= 2.0 * pi * floor(turns / (2.0 * pi) + 0.5)
    self.sample_count += 1
    self.phase_history[self.sample_count % MEMORY] = last + turns
    before = previous_beat(self, 0.0)
    if self.has_new_sample:
        self.innovation = wanted - before
    self.wanted[self.sample_count % MEMORY] = before + self.learning * self.innovation


def previous_beat(self: RepetitiveControl, ahead: float) -> float:
    """Required position [m] one turn before the phase of now plus `ahead` [rad], filtered by Q without lag."""
    goal = self.phase_history[self.sample_count % MEMORY] + ahead - 2.0 * pi
    oldest = max(self.sample_count - MEMORY + REACH + 2, 1)
    k = self.sample_count - REACH - 1
    while k > oldest and self.phase_history[k % MEMORY] > goal:
        k -= 1
    step = self.phase_history[(k + 1) % MEMORY] - self.phase_history[k % MEMORY]
    part = min(max((goal - self.phase_history[k % MEMORY]) / step, 0.0), 1.0) if step > 0.0 else 0.0
    total = weights = 0.0
    for i in range(-REACH, REACH + 1):
        away = (i - part) / self.width
        weight = exp(-0.5 * away * away)
        total += weight * self.wanted[(k + i + MEMORY) % MEMORY]
        weights += weight
    return total / weights
