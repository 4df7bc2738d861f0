"""Force control by model predictive control with preview of the wall."""

from __future__ import annotations

from fmus.bouc_wen import BoucWenInverse, advance_inverse, initialize_inverse
from fmus.control import NominalPlant, VelocityControl, delayed_value, limit_velocity
from fmus.dense import cholesky, solve

from twin.component import Int64, input, local, output, parameter

AHEAD = 3  # periods of the receding horizon
ROWS = 2 * AHEAD  # limits: change of the velocity, then velocity
SWEEPS = 40  # of Hildreth's method
LARGEST = 100.0  # [N]: no force is larger; what is no number is not smaller either
LINE = 64  # periods that demand and reference are remembered


class PreviewControl(VelocityControl, NominalPlant, BoucWenInverse):
    """Model predictive force controller: integrator with dead time, the inverse hysteresis of the previewed wall as reference.

    Quadratic program of three velocity changes with limits on velocity and acceleration, solved by Hildreth's method
    (Naval Res. Logist. Quart. 4, 1957; for MPC: Wang, Model Predictive Control System Design, 2009). Equations in the README.
    `heart_position` must be ahead by the horizon, 15 ms, beyond what pi_bouc_wen_control gets.
    """

    buffers = (("delay", LINE - AHEAD - 2),)

    heart_position = input("m", "estimated wall position, ahead by the horizon", display_unit="mm", nominal=5e-3)

    feedforward = output("m/s", "velocity of the reference now", display_unit="mm/s")
    limited = output("", "steps so far in which a limit was active", type=Int64)

    correction = parameter(0.11, "", "part of the force error that is taken for lasting", minimum=0.0, maximum=1.0,
                           source="tuned, see the README")
    weight = parameter(0.41, "", "weight of the squared change of the demand in a period over that of the squared error",
                       minimum=1e-3, fixed=True, source="tuned, see the README")

    limited_steps = local(0, "", "steps so far in which a limit was active", type=Int64)
    line = local(0.0, "m", "its last values, a ring", shape=(LINE,))
    reference = local(0.0, "m", "where the gripper should be, a ring whose latest is `AHEAD` periods ahead", shape=(LINE,))
    line_head = local(0, "", "place of the latest in both", type=Int64)
    hessian = local(0.0, "", "of the cost over the changes", shape=(AHEAD, AHEAD))
    lower = local(0.0, "", "its Cholesky factor", shape=(AHEAD, AHEAD))
    inverse = local(0.0, "", "its inverse", shape=(AHEAD, AHEAD))
    directions = local(0.0, "", "inverse times the gradient of each limit", shape=(ROWS, AHEAD))
    curvature = local(0.0, "", "gradient times that", shape=(ROWS,))
    unit = local(0.0, "", "a column", shape=(AHEAD,))
    error = local(0.0, "m", "predicted errors if the velocity stays", shape=(AHEAD,), display_unit="mm")
    change = local(0.0, "m/s", "of the velocity in each period", shape=(AHEAD,))
    multiplier = local(0.0, "", "of each limit", shape=(ROWS,))

    def initialize(self) -> None:
        self.target_velocity = 0.0
        self.feedforward = 0.0
        self.limited = 0
        self.limited_steps = 0
        self.velocity = 0.0
        self.demand = 0.0
        self.line_head = 0
        initialize_inverse(self, self.heart_position)
        for k in range(LINE):
            self.line[k] = 0.0
            self.reference[k] = self.position_in
        factorize(self)

    def step(self, t: float, h: float) -> None:
        advance_inverse(self, self.heart_position)
        self.line_head = (self.line_head + 1) % LINE
        self.line[self.line_head] = self.demand
        self.reference[self.line_head] = self.position_in
        now = self.reference[(self.line_head - AHEAD + LINE) % LINE]
        self.feedforward = (self.reference[(self.line_head - AHEAD + 1 + LINE) % LINE] - now) / h

        # dead time: the error that will be there when the demand of now acts, from the error of `delay` ago
        error = self.setpoint - self.force
        left = self.correction * error / self.stiffness if abs(error) < LARGEST else 0.0
        periods = self.delay / h
        left += (
            now
            - delayed_value(self.reference, self.line_head - AHEAD, periods, LINE)
            - (self.demand - delayed_value(self.line, self.line_head, periods, LINE))
        )
        for j in range(AHEAD):
            goal = self.reference[(self.line_head - AHEAD + 1 + j + LINE) % LINE]
            self.error[j] = (left + goal - now) / h - (j + 1) * self.velocity
        if solve_program(self, h):
            self.limited_steps += 1
        self.limited = self.limited_steps
        limit_velocity(self, self.velocity + self.change[0], h)


def factorize(self: PreviewControl) -> None:
    """Compute the Hessian, its inverse, and for each limit the inverse times its gradient; in units of a period."""
    for i in range(AHEAD):
        for k in range(AHEAD):
            self.hessian[i, k] = self.weight if i == k else 0.0
            for j in range(max(i, k), AHEAD):
                self.hessian[i, k] += (j - i + 1.0) * (j - k + 1.0)
    cholesky(self.hessian, self.lower, AHEAD)
    for i in range(AHEAD):
        for k in range(AHEAD):
            self.unit[k] = 1.0 if i == k else 0.0
        solve(self.lower, self.unit, AHEAD)
        for k in range(AHEAD):
            self.inverse[i, k] = self.unit[k]
    for i in range(ROWS):
        first = i if i < AHEAD else 0
        last = i % AHEAD
        for k in range(AHEAD):
            self.directions[i, k] = 0.0
            for j in range(first, last + 1):
                self.directions[i, k] += self.inverse[j, k]
        self.curvature[i] = 0.0
        for j in range(first, last + 1):
            self.curvature[i] += self.directions[i, j]


def solve_program(self: PreviewControl, h: float) -> bool:
    """Solve the quadratic program for the changes of the velocity [m/s]; return whether a limit is active."""
    for i in range(AHEAD):
        self.change[i] = 0.0
        for k in range(AHEAD):
            for j in range(k, AHEAD):
                self.change[i] += self.inverse[i, k] * (j - k + 1.0) * self.error[j]
    for i in range(ROWS):
        self.multiplier[i] = 0.0
    active = False
    for _ in range(SWEEPS):
        moved = False
        for i in range(ROWS):
            moved = update_multiplier(self, i, h) or moved
        active = active or moved
        if not moved:
            break
    return active


def update_multiplier(self: PreviewControl, i: int, h: float) -> bool:
    """Update the multiplier of one limit by Hildreth's rule, and the changes with it; whether it moved."""
    value = 0.0
    limit = h * self.acceleration_maximum
    for j in range(i if i < AHEAD else 0, i % AHEAD + 1):
        value += self.change[j]
    if i >= AHEAD:
        value += self.velocity
        limit = self.velocity_maximum
    above = self.multiplier[i] + (value - limit) / self.curvature[i]
    below = self.multiplier[i] + (value + limit) / self.curvature[i]
    new = max(above, 0.0) + min(below, 0.0)
    step = new - self.multiplier[i]
    self.multiplier[i] = new
    for k in range(AHEAD):
        self.change[k] -= step * self.directions[i, k]
    return abs(step) > 1e-12
