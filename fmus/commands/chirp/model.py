"""Signal generator for the identification."""

from math import cos, pi, sin

from twin.component import Component, output, parameter


class Chirp(Component):
    """Sine of constant amplitude whose frequency rises linearly, zero before and after.

    Al-Ahmad et al. (RACS), eq. (3), with the integrand's missing factor t restored.
    """

    position = output("m", "target position", display_unit="mm")
    velocity = output("m/s", "its rate", display_unit="mm/s")
    frequency = output("Hz", "present frequency")

    amplitude = parameter(5e-3, "m", "amplitude A", display_unit="mm", source="paper, section IV.B")
    frequency_start = parameter(0.1, "Hz", "starting frequency f_s", minimum=0.0, source="paper, section IV.B")
    frequency_final = parameter(3.0, "Hz", "final frequency f_f", minimum=0.0, source="paper, section IV.B")
    total_time = parameter(80.0, "s", "duration t_tot", minimum=1e-3, source="paper, section IV.B")

    def derivatives(self, t: float) -> None:
        self.position = 0.0
        self.velocity = 0.0
        self.frequency = 0.0
        if 0.0 <= t < self.total_time:
            # frequency gained per time [Hz/s]
            sweep = (self.frequency_final - self.frequency_start) / self.total_time
            angle = 2.0 * pi * (self.frequency_start * t + 0.5 * sweep * t * t)
            self.frequency = self.frequency_start + sweep * t
            self.position = self.amplitude * sin(angle)
            self.velocity = self.amplitude * 2.0 * pi * self.frequency * cos(angle)
