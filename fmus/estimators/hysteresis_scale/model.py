"""Width of the hysteresis between gripper and tip, followed from tracked pairs."""

from math import isfinite

from fmus.prandtl_ishlinskii_compensator.model import PLAYS, THRESHOLDS, WEIGHTS

from fmus.gratings import VALID
from twin.component import Component, Int32, input, local, output, parameter, terminal


class HysteresisScale(Component):
    """Extended Kalman filter for the width of a sum of plays and the offset of the tip's frame.

    All half widths grow in proportion: friction of a sheath, by which the instrument stretches, does that. The derivative of the
    plays with the width is carried along, since a play remembers the width with which it was last pushed.
    """

    period = 25e-3

    gripper_position = input("m", "gripper position, sampled with the tip", display_unit="mm", nominal=5e-3)
    tip_position = input("m", "tracked tip position", display_unit="mm", nominal=5e-3)
    tip_status = input("", "of the tracked tip: 0 valid, 1 degraded, 2 lost; only valid samples count", type=Int32,
                       minimum=0, maximum=2)

    scale = output("", "width over that of the identified plays")
    deviation = output("", "standard deviation of the scale")
    nis = output("", "normalized innovation squared of the last sample")

    hysteresis = terminal("width for a compensator", rule="bus", scale=scale)

    threshold = parameter(THRESHOLDS, "m", "half widths of the plays, rising from 0", display_unit="mm", minimum=0.0,
                          source="as prandtl_ishlinskii_compensator")
    weight = parameter(WEIGHTS, "", "weights of the plays", minimum=0.0, source="as prandtl_ishlinskii_compensator")
    noise = parameter(0.25e-3, "m", "standard deviation of tracker and plays together", display_unit="mm", minimum=1e-9,
                      source="residual of the fit in scenarios/hysteresis_models.yaml, 0.23 mm")
    scale_deviation = parameter(0.1, "", "standard deviation of the scale at the start", minimum=0.0,
                                source="chosen: the plays were identified on this sheath")
    scale_walk = parameter(0.02, "", "standard deviation of the change of the scale in a second", minimum=0.0,
                           source="chosen before results: half the width more within ten minutes")
    offset_deviation = parameter(0.5e-3, "m", "standard deviation of the offset at the start", display_unit="mm", minimum=0.0,
                                 source="estimate: registration of a tracker")
    scale_minimum = parameter(0.2, "", "least scale", minimum=0.0, source="chosen")
    scale_maximum = parameter(3.0, "", "largest scale", minimum=0.0, source="chosen")

    memory = local(0.0, "m", "position of each play", shape=(PLAYS,), display_unit="mm")
    slope = local(0.0, "m", "its derivative with the scale", shape=(PLAYS,), display_unit="mm")
    offset = local(0.0, "m", "of the tip's frame", display_unit="mm")
    width = local(1.0, "", "scale")
    variance = local(0.0, "", "of the scale")
    covariance = local(0.0, "m", "of scale and offset")
    offset_variance = local(0.0, "m^2", "of the offset")

    def initialize(self) -> None:
        for i in range(PLAYS):
            self.memory[i] = self.gripper_position
            self.slope[i] = 0.0
        self.width = 1.0
        self.offset = self.covariance = 0.0
        self.variance = self.scale_deviation * self.scale_deviation
        self.offset_variance = self.offset_deviation * self.offset_deviation
        self.scale = self.width
        self.deviation = self.scale_deviation
        self.nis = 0.0

    def step(self, t: float, h: float) -> None:
        self.variance += self.scale_walk * self.scale_walk * h
        if isfinite(self.gripper_position):
            push(self)
            if self.tip_status == VALID and isfinite(self.tip_position):
                correct(self)
        self.scale = self.width
        self.deviation = self.variance**0.5


def push(self: HysteresisScale) -> None:
    """Move the plays with the gripper, and the derivatives of those that it pushes."""
    for i in range(PLAYS):
        half = self.width * self.threshold[i]
        if self.memory[i] > self.gripper_position + half:
            self.memory[i] = self.gripper_position + half
            self.slope[i] = self.threshold[i]
        elif self.memory[i] < self.gripper_position - half:
            self.memory[i] = self.gripper_position - half
            self.slope[i] = -self.threshold[i]


def correct(self: HysteresisScale) -> None:
    """Measurement update of scale and offset; plays move with the scale by their derivatives."""
    predicted = self.offset
    slope = 0.0
    for i in range(PLAYS):
        predicted += self.weight[i] * self.memory[i]
        slope += self.weight[i] * self.slope[i]
    with_scale = self.variance * slope + self.covariance
    with_offset = self.covariance * slope + self.offset_variance
    variance = slope * with_scale + with_offset + self.noise * self.noise
    innovation = self.tip_position - predicted
    self.nis = innovation * innovation / variance

    wanted = self.width + with_scale / variance * innovation
    corrected = min(max(wanted, self.scale_minimum), self.scale_maximum)
    for i in range(PLAYS):
        self.memory[i] += self.slope[i] * (corrected - self.width)
    self.width = corrected
    self.offset += with_offset / variance * innovation
    self.variance -= with_scale * with_scale / variance
    self.covariance -= with_scale * with_offset / variance
    self.offset_variance -= with_offset * with_offset / variance
