"""Compensation of the hysteresis in a position."""

from fmus.bouc_wen import BoucWenInverse, advance_inverse, initialize_inverse

from twin.component import input, output


class BoucWenCompensator(BoucWenInverse):
    """From the wanted tip position to the gripper position that should lead there.

    Al-Ahmad et al. (RACS), section IV.B. Constants are for positions in mm, see `fmus/controllers/bouc_wen.py`; `identify.py`
    finds them. At a reversal the output moves up to 1 / slope_minimum times faster than the input: the drive must follow.
    """

    period = 1e-3

    position = input("m", "wanted tip position", display_unit="mm", nominal=5e-3)
    compensated_position = output("m", "target position for the gripper", display_unit="mm")

    def initialize(self) -> None:
        initialize_inverse(self, self.position)
        self.compensated_position = self.position_in

    def step(self, t: float, h: float) -> None:
        advance_inverse(self, self.position)
        self.compensated_position = self.position_in
