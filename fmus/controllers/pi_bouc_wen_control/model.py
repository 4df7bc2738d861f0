"""PI force control with feedforward through the inverse hysteresis."""

from fmus.bouc_wen import BoucWenInverse, advance_inverse, initialize_inverse
from fmus.control import ForceControl, control_velocity


class PIBoucWenControl(ForceControl, BoucWenInverse):
    """PI force controller plus the heart velocity through the inverse Bouc-Wen model: the paper's third strategy.

    Al-Ahmad et al. (RACS), section V, Fig. 7. Constants are for positions in mm, see `fmus/controllers/bouc_wen.py`.
    Latency hurts most here: 5 ms more add a tenth to the error.
    """

    def initialize(self) -> None:
        self.integral_part = 0.0
        self.target_velocity = 0.0
        initialize_inverse(self, self.heart_position)

    def step(self, t: float, h: float) -> None:
        last = self.position_in
        advance_inverse(self, self.heart_position)
        self.target_velocity = control_velocity(self, (self.position_in - last) / h, h)
