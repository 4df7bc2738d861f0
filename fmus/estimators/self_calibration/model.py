"""Self-calibration of the omnidirectional catheter from images."""

from math import hypot, sqrt

from fmus.kalman import project, update

from fmus.injection import MILLIMETER, Deflection, bend
from fmus.omnidirectional import WIRES, pair, radial, single_pull
from twin.component import Boolean, Int64, input, local, output, parameter, terminal

STATES = 5  # gain x, gain y, offset x, y, z
DIFFERENCE = 1e-4  # of a gain, for the slope of the model
LONGEST = 9.0  # pull [mm] that eqs. (4) and (5) hold for


class SelfCalibration(Deflection):
    """Extended Kalman filter for gains of the pull wires and a shift of the tip, from a slow and noisy position.

    Answers the wish of Cheng and Law (paper B), discussion. Frames count only when the slides have been at rest for longer
    than a frame's latency, so the position and the model are those of the same place. Coefficients are for mm.
    """

    period = 20e-3
    former_names = (("gain_walk", "gain_process_noise"), ("offset_walk", "offset_process_noise"))

    measured_x = input("m", "tip position of the latest frame", display_unit="mm", nominal=8e-3)
    measured_y = input("m", "tip position of the latest frame", display_unit="mm", nominal=8e-3)
    measured_z = input("m", "tip position of the latest frame", display_unit="mm", nominal=8e-3)
    frame = input("", "number of the latest frame; one is used once", type=Int64)
    wire_position = input("m", "where the controller sent the wires' slides", shape=(WIRES,), display_unit="mm",
                          nominal=6e-3)
    tip_advance = input("m", "advance of the tip without deflection, by the controller's model", display_unit="mm",
                        nominal=10e-3)
    tension_share = input("", "last direction of the controller: 0 pushed, 1 pulled", minimum=0.0, maximum=1.0)
    moving = input("", "whether a slide moves, wherever else that is known", type=Boolean)

    gain_x = output("", "part of a pull that arrives at the tip, plane x")
    gain_y = output("", "part of a pull that arrives at the tip, plane y")
    offset_x = output("m", "shift of the tip", display_unit="mm")
    offset_y = output("m", "shift of the tip", display_unit="mm")
    offset_z = output("m", "shift of the tip", display_unit="mm")
    deviation_x = output("", "standard deviation of the gain in plane x, as the filter sees it")
    deviation_y = output("", "standard deviation of the gain in plane y, as the filter sees it")
    innovation = output("m", "distance of the last used frame from the model", display_unit="mm")
    used = output("", "frames used", type=Int64)

    image = terminal("latest frame", x=measured_x, y=measured_y, z=measured_z, frame=frame)
    controller = terminal(
        "what it did, and what was learned from it", wire_position=wire_position, tip_advance=tip_advance,
        tension_share=tension_share, gain_x=gain_x, gain_y=gain_y, offset_x=offset_x, offset_y=offset_y,
        offset_z=offset_z,
    )

    rest = parameter(0.4, "s", "time at rest before a frame counts; longer than the images' latency", minimum=0.0,
                     source="latency of image_position 0.3 s, and its period")
    noise = parameter(0.5, "", "standard deviation [mm] of a frame", minimum=1e-3, source="image_position")
    own_noise = parameter(0.15, "", "standard deviation [mm] of the catheter about its model", minimum=0.0,
                          source="paper: calibrated RMS of y and z")
    gain_start = parameter(0.05, "", "standard deviation of the gains at the start", minimum=0.0,
                           source="estimate: calibrated on the bench before")
    offset_start = parameter(0.5, "", "standard deviation [mm] of the shift at the start", minimum=0.0,
                             source="estimate: images registered to the guide")
    gain_process_noise = parameter(0.003, "", "growth of the gains' deviation per root of a frame", minimum=0.0,
                                   source="chosen: a few ten frames follow 20 %, and are averaged")
    offset_process_noise = parameter(0.01, "", "growth [mm] of the shift's deviation per root of a frame", minimum=0.0,
                                     source="chosen: a guide that shifts slowly")
    gain_minimum = parameter(
        0.5, "", "least gain that is learned", minimum=0.1, source="chosen: below, a wire is broken"
    )
    gain_maximum = parameter(1.5, "", "largest gain that is learned", source="chosen: as far above")
    stiffness_ratio = parameter(0.571, "", "bending stiffness over wire stiffness", minimum=0.0,
                                source="as omnidirectional_feedforward")

    estimate = local(0.0, "", "gain x, gain y, shift x, y, z [mm]", shape=(STATES,))
    covariance = local(0.0, "", "of the estimate", shape=(STATES, STATES))
    slope = local(0.0, "", "of one coordinate by the estimate", shape=(STATES,))
    kalman = local(0.0, "", "covariance times slope", shape=(STATES,))
    last_wire = local(0.0, "m", "where the wires were sent at the last sample", shape=(WIRES,))
    last_advance = local(0.0, "m", "advance at the last sample")
    last_frame = local(0, "", "number of the last frame", type=Int64)
    distance = local(0.0, "", "distance [mm] of the last used frame from the model")
    rested = local(0.0, "s", "time since the slides were sent away")

    def initialize(self) -> None:
        for i in range(STATES):
            for j in range(STATES):
                self.covariance[i, j] = 0.0
            start = self.gain_start if i < 2 else self.offset_start
            self.covariance[i, i] = start * start
            self.estimate[i] = 1.0 if i < 2 else 0.0
        for i in range(WIRES):
            self.last_wire[i] = 0.0
        self.last_advance = 0.0
        self.last_frame = 0
        self.rested = 0.0
        self.distance = 0.0
        self.used = 0
        publish(self)

    def step(self, t: float, h: float) -> None:
        sent = self.tip_advance != self.last_advance
        self.last_advance = self.tip_advance
        for i in range(WIRES):
            sent = sent or self.wire_position[i] != self.last_wire[i]
            self.last_wire[i] = self.wire_position[i]
        self.rested = 0.0 if sent or self.moving else self.rested + h

        if self.frame != self.last_frame:
            self.last_frame = self.frame
            if self.rested >= self.rest:
                learn(self)
        publish(self)


def learn(self: SelfCalibration) -> None:
    """One frame: the covariance grows, then x, y and z are taken in one after the other."""
    for i in range(STATES):
        walk = self.gain_process_noise if i < 2 else self.offset_process_noise
        self.covariance[i, i] += walk * walk
    measured = (self.measured_x / MILLIMETER, self.measured_y / MILLIMETER, self.measured_z / MILLIMETER)
    predicted = tip(self, self.estimate[0], self.estimate[1])
    distance = 0.0
    for axis in range(3):
        off = measured[axis] - predicted[axis] - self.estimate[2 + axis]
        distance += off * off
    self.distance = sqrt(distance)
    self.used += 1
    for axis in range(3):
        take(self, axis, measured[axis])
    for i in range(2):
        self.estimate[i] = min(max(self.estimate[i], self.gain_minimum), self.gain_maximum)


def take(self: SelfCalibration, axis: int, measured: float) -> None:
    """Scalar update with one coordinate [mm]."""
    here = tip(self, self.estimate[0], self.estimate[1])[axis]
    self.slope[0] = (tip(self, self.estimate[0] + DIFFERENCE, self.estimate[1])[axis] - here) / DIFFERENCE
    self.slope[1] = (tip(self, self.estimate[0], self.estimate[1] + DIFFERENCE)[axis] - here) / DIFFERENCE
    for i in range(2, STATES):
        self.slope[i] = 1.0 if i == 2 + axis else 0.0

    noise = self.noise * self.noise + self.own_noise * self.own_noise
    variance = project(self.covariance, self.slope, self.kalman, noise, STATES)
    error = measured - here - self.estimate[2 + axis]
    update(self.estimate, self.covariance, self.kalman, error, variance, STATES)


def tip(self: SelfCalibration, gain_x: float, gain_y: float) -> tuple[float, float, float]:
    """The model's tip [mm] with these gains, without a shift."""
    wires = self.wire_position
    x = pair(wires[0] / MILLIMETER, wires[2] / MILLIMETER, self.dead_band, gain_x, self.stiffness_ratio)
    y = pair(wires[1] / MILLIMETER, wires[3] / MILLIMETER, self.dead_band, gain_y, self.stiffness_ratio)
    pull = min(single_pull(x, y, self.dead_band, self.stiffness_ratio), LONGEST)
    advance = self.tip_advance / MILLIMETER
    radius = radial(self.bend_y, self.compression, self.tension, self.dead_band, pull, advance, self.tension_share)
    size = max(hypot(x, y), 1e-9)
    return radius * x / size, radius * y / size, advance - bend(self.bend_z, self.dead_band, pull)


def publish(self: SelfCalibration) -> None:
    """Outputs from the memory."""
    self.gain_x = self.estimate[0]
    self.gain_y = self.estimate[1]
    self.offset_x = MILLIMETER * self.estimate[2]
    self.offset_y = MILLIMETER * self.estimate[3]
    self.offset_z = MILLIMETER * self.estimate[4]
    self.innovation = MILLIMETER * self.distance
    self.deviation_x = sqrt(max(self.covariance[0, 0], 0.0))
    self.deviation_y = sqrt(max(self.covariance[1, 1], 0.0))
