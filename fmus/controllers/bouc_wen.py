"""Bouc-Wen hysteresis, eqs. (1) and (2) of Al-Ahmad et al. (RACS), and its inverse.

    x_out = alpha_x x_in - h
    dh = alpha dx_in - beta |dx_in| h |h|^(gamma - 1) - delta dx_in |h|^gamma

Positions and h are in mm here, as in the paper: beta and delta have a unit that depends on gamma, and converting them
would hide the paper's numbers. Variables of the components are in m; the factor 1e3 stands where they meet.
"""

from __future__ import annotations

from twin.component import Component, local, parameter

MILLIMETER = 1e-3

# steps of the inverse per sample; heart motion changes by 0.2 mm in 5 ms
SUBSTEPS = 10

IDENTIFIED = "identified with the chirp on the sheath of this twin; the paper's are in identify.py"


class BoucWenInverse(Component):
    """Constants and memory of the inverse hysteresis.

    The slope dx_out/dx_in is kept at `slope_minimum` or above inside the model. So the modeled hysteresis is monotone
    and has an exact inverse, also for the paper's constants, whose slope is negative after a reversal.
    """

    alpha_x = parameter(1.076, "", "output per input, for positions in mm", minimum=0.0, source=IDENTIFIED)
    alpha = parameter(1.087, "", "rate of h after a reversal, for positions in mm", source=IDENTIFIED)
    beta = parameter(0.0368, "", "saturation of h, odd in the direction, for positions in mm", source=IDENTIFIED)
    delta = parameter(0.0261, "", "saturation of h, even in the direction, for positions in mm", source=IDENTIFIED)
    gamma = parameter(3.60, "", "sharpness of the saturation", minimum=0.0, source=IDENTIFIED)
    slope_minimum = parameter(
        0.2,
        "",
        "least slope of output over input",
        minimum=1e-3,
        source="chosen: the compensated speed is at most 5 times the wanted one",
    )

    hysteresis = local(0.0, "", "h, for positions in mm")
    position_out = local(0.0, "m", "wanted tip position of the last sample", display_unit="mm")
    position_in = local(0.0, "m", "gripper position that should lead there", display_unit="mm")


def initialize_inverse(self: BoucWenInverse, position: float) -> None:
    """Begin at a wanted position [m] without any hysteresis."""
    self.hysteresis = 0.0
    self.position_out = position
    self.position_in = position / self.alpha_x


def advance_inverse(self: BoucWenInverse, position: float) -> None:
    """Follow the wanted position [m].

    h is integrated with the limited slope, so alpha_x x_in = x_out + h holds always; h saturates, so x_in cannot drift.
    """
    change = (position - self.position_out) / MILLIMETER / SUBSTEPS
    direction = 1.0
    if change < 0.0:
        direction = -1.0
    for _ in range(SUBSTEPS):
        sign = 1.0
        if self.hysteresis < 0.0:
            sign = -1.0
        rate = self.alpha - (self.beta * direction * sign + self.delta) * abs(self.hysteresis) ** self.gamma
        slope = max(self.alpha_x - rate, self.slope_minimum)
        self.hysteresis += (self.alpha_x - slope) * change / slope
    self.position_out = position
    self.position_in = (position + MILLIMETER * self.hysteresis) / self.alpha_x
