"""Heart motion."""

from math import cos, pi, sin

from twin.component import Component, output, parameter, terminal

HARMONICS = 7


class Heart(Component):
    """Motion of the heart wall along the instrument: seven harmonics of the heart rate.

    Al-Ahmad et al. (RACS), eq. (4). As printed it moves 10.65 mm peak to peak, the text says about 12 mm.
    """

    position = output("m", "wall position, positive away from the instrument", display_unit="mm")
    velocity = output("m/s", "wall speed", display_unit="mm/s")

    wall = terminal("the wall that it moves", position=position)

    rate = parameter(1.0, "Hz", "heart rate", minimum=0.0, source="paper, section IV.B: omega = 2 pi rad/s")
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

    def derivatives(self, t: float) -> None:
        x = 0.0
        v = 0.0
        for i in range(HARMONICS):
            omega = 2.0 * pi * self.rate * (i + 1)
            x += self.amplitude[i] * sin(omega * t + self.phase[i])
            v += self.amplitude[i] * omega * cos(omega * t + self.phase[i])

        # raised cosine
        part = 1.0
        change = 0.0
        if t < self.blend_in:
            angle = pi * t / self.blend_in
            part = 0.5 - 0.5 * cos(angle)
            change = 0.5 * pi / self.blend_in * sin(angle)
        self.position = self.offset + self.scale * part * x
        self.velocity = self.scale * (part * v + change * x)
