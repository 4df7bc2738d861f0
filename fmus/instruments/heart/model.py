"""Heart motion."""

from math import cos, floor, pi, sin, sqrt

from fmus.noisy import Noisy
from twin.component import Boolean, Int64, local, output, parameter, seed_stream, terminal, uniform

HARMONICS = 7
WAVES = 8
SLOWEST, FASTEST = 0.01, 0.08  # [Hz] of the rate's wander: below respiration
PRIME = 2147483647
QS2, QS2_SLOPE = 0.546, 0.126  # [s], [s^2]: electromechanical systole 546 ms - 2.1 ms per beat/min, Weissler 1968, recalled
SYSTOLE = 0.71  # middle of systole in the beat of eq. (4)
SHORTEST = 0.225  # part of a beat that is systole below 0.46 Hz: with less the beat would run backward in diastole
SWEEP = 0.1  # part of a beat in which an ectopic one ends the beat before


class Heart(Noisy):
    """Motion of the heart wall along the instrument: seven harmonics of the heart rate.

    Al-Ahmad et al. (RACS), eq. (4). As printed it moves 10.65 mm peak to peak, the text says about 12 mm.
    Whatever makes it alive, a rate that wanders, respiration, beats out of time, is off unless asked for.
    """

    position = output("m", "wall position, positive away from the instrument", display_unit="mm")
    velocity = output("m/s", "wall speed", display_unit="mm/s")

    beats = output("", "beats since the start, with their parts: the R wave of the electrocardiogram is at whole numbers")

    wall = terminal("the wall that it moves", position=position)

    rate = parameter(1.0, "Hz", "heart rate; a change keeps the phase", minimum=0.0,
                     source="paper, section IV.B: omega = 2 pi rad/s")
    scale = parameter(1.0, "", "factor on all amplitudes", source="1: the paper's motion")
    amplitude = parameter(
        (4e-3, 2e-3, 0.4e-3, 0.1e-3, 5e-6, 1e-6, 0.5e-6), "m", "amplitude of each harmonic", display_unit="mm",
        minimum=0.0, maximum=0.1, source="paper, section IV.B: r_i; eight announced, seven printed",
    )
    phase = parameter((0.0, 2.8, 2.8, 0.0, 3.7, 1.2, 5.6), "rad", "phase of each harmonic",
                      source="paper, section IV.B: theta_i, the first seven")
    offset = parameter(0.0, "m", "mean position", display_unit="mm", source="paper, section IV.B: c")
    blend_in = parameter(1.0, "s", "time from rest to full motion; 0: at once", minimum=0.0,
                         source="chosen: no jump at the start")
    begin = parameter(0.0, "s", "time at which it begins to move", source="0: at once")

    wander = parameter(0.0, "", "standard deviation of the rate as part of the rate", minimum=0.0, fixed=True,
                       source="0: the paper's; at rest about 0.05, Task Force on HRV, Circulation 93, 1996, recalled")
    seed = parameter(21, "", "seed of the wander", type=Int64, fixed=True, source="arbitrary")
    sinus_arrhythmia = parameter(0.0, "", "change of the rate with respiration as part of the rate", minimum=0.0,
                                 maximum=0.5, fixed=True, source="0: the paper's; 0.05 at rest, estimate")
    respiration = parameter(0.0, "m", "amplitude of the motion by respiration", display_unit="mm", minimum=0.0,
                            source="0: the paper's; heart 2 to 5 mm at quiet breathing, Shechter et al., IEEE TMI 23(9), "
                            "2004, recalled")
    respiration_rate = parameter(0.25, "Hz", "rate of respiration", minimum=0.01, fixed=True,
                                 source="12 to 18 breaths a minute")
    ectopic_every = parameter(0, "", "beats from one ectopic beat to the next; 0: none", type=Int64, minimum=0,
                              fixed=True, source="0: the paper's")
    ectopic_coupling = parameter(0.65, "", "part of a beat after which an ectopic one comes", minimum=0.3, maximum=0.8,
                                 fixed=True, source="estimate: 0.5 to 0.8; a full compensatory pause follows")

    ectopic_share = parameter(0.0, "", "part of the beats that are ectopic, at random", minimum=0.0, maximum=0.3, fixed=True,
                              source="0: the paper's; 0.001 in the healthy, to 0.1 with heart disease, estimate")
    irregularity = parameter(0.0, "", "standard deviation of a beat's length as part of it, from beat to beat", minimum=0.0,
                             maximum=0.25, fixed=True,
                             source="0: the paper's; at rest about 0.03, in atrial fibrillation about 0.2, estimate")
    ramp = parameter(0.0, "Hz", "change of the rate over `ramp_time`", fixed=True, source="0: the paper's")
    ramp_begin = parameter(0.0, "s", "time at which it begins", fixed=True, source="chosen by the experiment")
    ramp_time = parameter(10.0, "s", "time that it takes", minimum=0.1, fixed=True, source="chosen by the experiment")
    drift = parameter(0.0, "m/s", "speed at which the patient moves on the table", display_unit="mm/min",
                      source="0: the paper's; a few mm in a procedure, estimate")
    drift_begin = parameter(0.0, "s", "time at which that begins", fixed=True, source="chosen by the experiment")
    drift_time = parameter(1e6, "s", "for which it lasts", minimum=0.0, fixed=True, source="chosen: on and on")
    systole_by_rate = parameter(False, "", "whether systole takes its own time: a larger part of a faster beat", type=Boolean,
                                fixed=True, source="false: the paper's")

    beat = local(0, "", "beat for which the stretch below is", type=Int64)
    systole_stretch = local(0.0, "", "by how much systole is faster in this beat than in one of 1 Hz")
    wave_rate = local(0.0, "Hz", "rates of the waves that make the wander", shape=(WAVES,))
    wave_phase = local(0.0, "rad", "their phases", shape=(WAVES,))
    last_rate = local(0.0, "Hz", "rate that the lead below is for")
    lead = local(0.0, "rad", "phase by which changes of the rate are ahead of rate times time")
    ahead = local(0.0, "rad", "phase by which the beat is, with wander and all")
    pace = local(1.0, "", "speed of the beat over the rate's")

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        for k in range(WAVES):
            self.wave_rate[k] = SLOWEST + (FASTEST - SLOWEST) * (k + uniform(self.stream)) / WAVES
            self.wave_phase[k] = 2.0 * pi * uniform(self.stream)
        self.last_rate = self.rate
        self.lead = 0.0
        self.beat = -1

    def derivatives(self, t: float) -> None:
        if self.rate != self.last_rate:
            self.lead -= 2.0 * pi * (self.rate - self.last_rate) * wandered(self, t)
            self.last_rate = self.rate
        get_ahead(self, t)
        self.beats = self.rate * t + self.ahead / (2.0 * pi)
        if self.systole_by_rate:
            shape(self)

        x = 0.0
        v = 0.0
        for i in range(HARMONICS):
            omega = 2.0 * pi * self.rate * (i + 1)
            angle = omega * t + self.phase[i] + (i + 1) * self.ahead
            x += self.amplitude[i] * sin(angle)
            v += self.amplitude[i] * omega * cos(angle)
        v *= self.pace

        # raised cosine
        part = 1.0
        change = 0.0
        since = t - self.begin
        if since < 0.0:
            part = 0.0
        elif since < self.blend_in:
            angle = pi * since / self.blend_in
            part = 0.5 - 0.5 * cos(angle)
            change = 0.5 * pi / self.blend_in * sin(angle)
        turn = 2.0 * pi * self.respiration_rate
        breath = self.respiration * sin(turn * t)
        breath_speed = self.respiration * turn * cos(turn * t)
        drifting = min(max(t - self.drift_begin, 0.0), self.drift_time)
        self.position = self.offset + self.scale * part * x + part * breath + self.drift * drifting
        self.velocity = self.scale * (part * v + change * x) + part * breath_speed + change * breath
        if 0.0 <= t - self.drift_begin < self.drift_time:
            self.velocity += self.drift


def wandered(self: Heart, t: float) -> float:
    """Time by which the beat would be where it is if it did not wander [s]: a change of the rate counts from it on."""
    turn = 2.0 * pi * self.respiration_rate
    total = t + self.sinus_arrhythmia / turn * sin(turn * t)
    if self.wander > 0.0:
        size = self.wander * sqrt(2.0 / WAVES)
        for k in range(WAVES):
            w = 2.0 * pi * self.wave_rate[k]
            total += size / w * (sin(w * t + self.wave_phase[k]) - sin(self.wave_phase[k]))
    return total


def get_ahead(self: Heart, t: float) -> None:
    """Phase by which the beat is ahead of rate times time, and its pace."""
    self.ahead = self.lead
    self.pace = 1.0
    turn = 2.0 * pi * self.respiration_rate
    if self.wander > 0.0:
        size = self.wander * sqrt(2.0 / WAVES)
        for k in range(WAVES):
            w = 2.0 * pi * self.wave_rate[k]
            self.pace += size * cos(w * t + self.wave_phase[k])
            self.ahead += 2.0 * pi * self.rate * size / w * (sin(w * t + self.wave_phase[k]) - sin(self.wave_phase[k]))
    if self.sinus_arrhythmia > 0.0:
        self.pace += self.sinus_arrhythmia * cos(turn * t)
        self.ahead += 2.0 * pi * self.rate * self.sinus_arrhythmia / turn * sin(turn * t)
    if self.ramp != 0.0:
        s = min(max((t - self.ramp_begin) / self.ramp_time, 0.0), 1.0)
        after = max(t - self.ramp_begin - self.ramp_time, 0.0)
        self.pace += self.ramp * s / max(self.rate, 1e-6)
        self.ahead += 2.0 * pi * self.ramp * (0.5 * self.ramp_time * s * s + after)
    if self.ectopic_share > 0.0:
        # of three beats the second may be early, and the third makes up for it
        beats = self.rate * t + self.ahead / (2.0 * pi)
        block = floor(beats / 3.0)
        if chance(self.seed, block) < 3.0 * self.ectopic_share:
            u = beats - 3.0 * block - 1.0
            self.ahead += 2.0 * pi * early(u, self.ectopic_coupling)
            self.pace *= stretch(u, self.ectopic_coupling)
    if self.irregularity > 0.0:
        jolt(self, self.rate * t + self.ahead / (2.0 * pi))
    if self.ectopic_every > 0:
        beats = self.rate * t + self.ahead / (2.0 * pi)
        u = beats - floor(beats / self.ectopic_every) * self.ectopic_every - self.ectopic_every + 2.0
        self.ahead += 2.0 * pi * early(u, self.ectopic_coupling)
        self.pace *= stretch(u, self.ectopic_coupling)


def chance(seed: int, n: int) -> float:
    """A number from 0 to 1 that belongs to the n-th beat: known without those before it."""
    x = (seed % PRIME + (n % PRIME) * 69069) % PRIME
    x = (x * x + n % PRIME) % PRIME
    x = (x * 48271 + seed % PRIME) % PRIME
    x = (x * x + 12345) % PRIME
    return x / PRIME


def jolt(self: Heart, beats: float) -> None:
    """Move each R wave by chance, and stretch the beats between them; at the waves the pace is the mean one."""
    size = sqrt(6.0) * self.irregularity  # uniform shifts of both ends
    n = floor(beats)
    if beats < n + size * (chance(self.seed, n) - 0.5):
        n -= 1
    elif beats >= n + 1 + size * (chance(self.seed, n + 1) - 0.5):
        n += 1
    begin = n + size * (chance(self.seed, n) - 0.5)
    duration = n + 1 + size * (chance(self.seed, n + 1) - 0.5) - begin
    s = (beats - begin) / duration
    bent = s * (duration + s * ((3.0 - 3.0 * duration) + s * (2.0 * duration - 2.0)))
    self.ahead += 2.0 * pi * (n + bent - beats)
    self.pace *= 1.0 + s * ((6.0 - 6.0 * duration) + s * (6.0 * duration - 6.0)) / duration


def shape(self: Heart) -> None:
    """Keep systole's duration: a faster beat shortens diastole. Each beat keeps the stretch it began with."""
    n = floor(self.beats)
    if n != self.beat:
        rate = max(self.rate * self.pace, 0.1)
        part = min(max((QS2 - QS2_SLOPE * rate) * rate, SHORTEST), 0.8)
        self.systole_stretch = pi * ((QS2 - QS2_SLOPE) - part) / sin(pi * part)
        self.beat = n
    angle = 2.0 * pi * (self.beats - n - SYSTOLE)
    self.ahead += self.systole_stretch * (sin(angle) + sin(2.0 * pi * SYSTOLE))
    self.pace *= 1.0 + self.systole_stretch * cos(angle)


def early(u: float, coupling: float) -> float:
    """Phase advance [beats] of two beats if the second comes early, with a compensatory pause."""
    begin = coupling + SWEEP
    if u <= coupling:
        return 0.0
    if u < begin:
        s = (u - coupling) / SWEEP
        return (1.0 - begin) * s * s * (3.0 - 2.0 * s)
    return 1.0 + (u - begin) / (2.0 - begin) - u


def stretch(u: float, coupling: float) -> float:
    """The speed of those beats: the first ends in a smooth sweep."""
    begin = coupling + SWEEP
    if u <= coupling:
        return 1.0
    if u < begin:
        s = (u - coupling) / SWEEP
        return 1.0 + (1.0 - begin) * 6.0 * s * (1.0 - s) / SWEEP
    return 1.0 / (2.0 - begin)
