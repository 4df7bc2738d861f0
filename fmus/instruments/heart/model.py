"""Heart motion."""

from math import cos, floor, pi, sin, sqrt

from twin.component import Component, Int64, local, output, parameter, seed_stream, terminal, uniform

HARMONICS = 7
WAVES = 8
SLOWEST, FASTEST = 0.01, 0.08  # [Hz] of the rate's wander: below respiration
SWEEP = 0.1  # part of a beat in which an ectopic one ends the beat before


class Heart(Component):
    """Motion of the heart wall along the instrument: seven harmonics of the heart rate.

    Al-Ahmad et al. (RACS), eq. (4). As printed it moves 10.65 mm peak to peak, the text says about 12 mm.
    A wandering rate, respiration and ectopic beats are off unless asked for; all is known in closed form.
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
        source="paper, section IV.B: r_i; eight announced, seven printed",
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

    wave_rate = local(0.0, "Hz", "rates of the waves that make the wander", shape=(WAVES,))
    wave_phase = local(0.0, "rad", "their phases", shape=(WAVES,))
    stream = local(0, "", "state of the random numbers", type=Int64, shape=(6,))
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

    def derivatives(self, t: float) -> None:
        self.lead -= 2.0 * pi * (self.rate - self.last_rate) * t
        self.last_rate = self.rate
        get_ahead(self, t)

        self.beats = self.rate * t + self.ahead / (2.0 * pi)

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
        self.position = self.offset + self.scale * part * x + part * breath
        self.velocity = self.scale * (part * v + change * x) + part * breath_speed + change * breath


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
    if self.ectopic_every > 0:
        beats = self.rate * t + self.ahead / (2.0 * pi)
        u = beats - floor(beats / self.ectopic_every) * self.ectopic_every - self.ectopic_every + 2.0
        self.ahead += 2.0 * pi * early(u, self.ectopic_coupling)
        self.pace *= stretch(u, self.ectopic_coupling)


def early(u: float, coupling: float) -> float:
    """What two beats are ahead [beats] if the second comes early, and its pause makes up for it."""
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
