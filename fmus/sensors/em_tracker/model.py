"""Electromagnetic tracker."""

from math import sqrt

from fmus.gratings import DEGRADED, LOST, VALID
from fmus.noisy import Noisy, noise_seed
from twin.component import (
    Boolean,
    Int32,
    input,
    local,
    normal,
    output,
    parameter,
    seed_stream,
    uniform,
)


class EMTracker(Noisy):
    """Electromagnetic tracker on the tip, along the line of motion, with a reference sampled at the same instant.

    NDI Aurora at 40 Hz. Both outputs are 25 ms old when published: compare them with each other, not with the present.
    """

    period = 25e-3
    former_names = (("seen_position", "last_position"), ("seen_reference", "last_reference"))

    position = input("m", "true position of the tracked sensor", display_unit="mm", nominal=5e-3)
    reference = input("m", "signal to sample with it, such as the gripper's position", display_unit="mm", nominal=5e-3)

    measured_position = output("m", "measured position", display_unit="mm")
    sampled_reference = output("m", "reference at the instant of the measurement", display_unit="mm")
    difference = output("m", "sampled reference minus measured position", display_unit="mm")

    status = output("", "0 valid, 1 degraded: the last sample is held, 2 lost", type=Int32)
    missed = output("", "samples lost in a row", type=Int32)

    noise = parameter(0.2e-3, "m", "standard deviation of the noise", display_unit="mm", minimum=0.0,
                      source="estimate: jitter 0.1 to 0.3 mm")
    seed = noise_seed(3, "the noise")

    distortion = parameter(0.0, "m", "largest error by metal near the field, where it is nearest", display_unit="mm",
                           source="0: free of metal; 1 to 5 mm beside a C-arm, estimate")
    metal_position = parameter(0.0, "m", "where on the line of motion the metal is nearest", display_unit="mm",
                               source="chosen: the middle of the motion")
    metal_distance = parameter(0.1, "m", "its distance from there", display_unit="mm", minimum=1e-3,
                               source="assumed: an instrument's table clamp")
    loss = parameter(0.0, "", "part of the samples that are lost", minimum=0.0, maximum=1.0, source="0: a bench")
    blind = parameter(False, "", "whether no sample arrives: the sensor is out of the field, or unplugged", type=Boolean,
                      source="false: a fault, set by an event")
    hold = parameter(0.1, "s", "how long the last sample is held before it is lost", display_unit="ms", minimum=0.0,
                     source="as fiber_shape")

    last_position = local(0.0, "m", "position measured last", display_unit="mm")
    last_reference = local(0.0, "m", "reference at that instant", display_unit="mm")
    misses = local(0, "", "samples lost in a row", type=Int32)

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.last_position = self.position + distorted(self)
        self.last_reference = self.reference
        self.misses = 0
        publish(self, 0.0)

    def step(self, t: float, h: float) -> None:
        noise = self.noise * normal(self.stream)
        lost = self.blind
        if self.loss > 0.0 and uniform(self.stream) < self.loss:  # no draw without loss: the noise stays what it was
            lost = True
        if lost:
            self.misses += 1
        else:
            self.misses = 0
            self.last_position = self.position + distorted(self) + noise
            self.last_reference = self.reference
        publish(self, h)


def distorted(self: EMTracker) -> float:
    """Error [m] by the field that a piece of metal sends back, which falls with the cube of its distance."""
    away = self.position - self.metal_position
    near = self.metal_distance / sqrt(self.metal_distance * self.metal_distance + away * away)
    return self.distortion * near * near * near


def publish(self: EMTracker, h: float) -> None:
    """Publish the last sample and its status."""
    self.measured_position = self.last_position
    self.sampled_reference = self.last_reference
    self.difference = self.sampled_reference - self.measured_position
    self.missed = self.misses
    self.status = VALID
    if self.misses > 0:
        self.status = DEGRADED if self.misses * h <= self.hold else LOST
