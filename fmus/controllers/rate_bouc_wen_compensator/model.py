"""Compensation of the hysteresis and of the lag in a position."""

from fmus.bouc_wen import BoucWenInverse, advance_inverse, initialize_inverse

from twin.component import input, local, output, parameter

IDENTIFIED = "identified with seed 1 of scenarios/hysteresis_models.yaml"


class RateBoucWenCompensator(BoucWenInverse):
    """From the wanted tip position to the gripper position that should lead there, ahead by the instrument's lag.

    Eqs. (1) and (2) of Al-Ahmad et al. (RACS), whose output a first-order lag follows: what drag between gripper and tip
    does. The inverse differentiates: noise of the wanted position grows by lag over period, 6 at 1 ms.
    """

    period = 1e-3

    position = input("m", "wanted tip position", display_unit="mm", nominal=5e-3)
    compensated_position = output("m", "target position for the gripper", display_unit="mm")

    alpha_x = parameter(1.022, "", "output per input, for positions in mm", minimum=0.0, source=IDENTIFIED)
    alpha = parameter(1.053, "", "rate of h after a reversal, for positions in mm", source=IDENTIFIED)
    beta = parameter(0.01159, "", "saturation of h, odd in the direction, for positions in mm", source=IDENTIFIED)
    delta = parameter(0.01425, "", "saturation of h, even in the direction, for positions in mm", source=IDENTIFIED)
    gamma = parameter(6.0, "", "sharpness of the saturation", minimum=0.0, source=f"{IDENTIFIED}: at its upper bound")
    lag = parameter(6.1e-3, "s", "time constant of the tip behind the hysteresis", display_unit="ms", minimum=0.0,
                    source=IDENTIFIED)

    last_position = local(0.0, "m", "wanted tip position of the last sample", display_unit="mm")

    def initialize(self) -> None:
        self.last_position = self.position
        initialize_inverse(self, self.position)
        self.compensated_position = self.position_in

    def step(self, t: float, h: float) -> None:
        lead = self.lag * (self.position - self.last_position) / h
        self.last_position = self.position
        advance_inverse(self, self.position + lead)
        self.compensated_position = self.position_in
