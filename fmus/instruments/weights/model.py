"""Weights in a box on a cable."""

from fmus.noisy import Noisy, noise_seed
from twin.component import Boolean, Int32, input, local, normal, output, parameter, seed_stream

GRAVITY = 9.80665  # [m/s2]

# what the person does
WAITING, LOADING, DETECTED, LIFTED = 0, 1, 2, 3


class Weights(Noisy):
    """Weights added to a box until motion of the instrument is detected, then lifted off.

    Al-Ahmad et al. (RACS), sections III.A and III.B: a cable from the box runs over a pulley to the instrument's tip,
    or around a pulley on the instrument. Quasi-static: the inertia of the weights does not act on the instrument.
    """

    period = 10e-3
    former_names = (("seen_mass", "detected_mass"),)

    loading = input("", "whether weights are being added; each time it becomes true is one trial", start=True,
                    type=Boolean)
    position = input("m", "position of a mark on the instrument", display_unit="mm", nominal=1e-3)
    angle = input("rad", "angle of a mark on the instrument", display_unit="deg", nominal=0.1)

    load = output("N", "weight in the box")
    tip_force = output("N", "force on the tip, positive proximal: the cable pulls distally")
    tip_torque = output("N*m", "torque on the instrument by a cable around its pulley", display_unit="mN*m")
    held_load = output("N", "largest weight held, in this trial or the last one")
    slip_load = output("N", "weight when motion was last seen, 0 before")
    slip_torque = output("N*m", "torque of that weight, 0 before", display_unit="mN*m")
    state = output("", "0 waiting, 1 adding weights, 2 motion seen, 3 box lifted off or on the table", type=Int32)
    trial = output("", "number of trials in which motion was seen", type=Int32)

    first_mass = parameter(0.1, "kg", "box and first weight", minimum=0.0, source="estimate: a light cardboard box")
    increment = parameter(0.05, "kg", "weight added at a time", display_unit="g", minimum=1e-4,
                          source="estimate: the paper says gradually, 2 % of the slip load")
    increment_scatter = parameter(0.1, "", "relative standard deviation of a weight", minimum=0.0, maximum=0.3,
                                  source="estimate: usual small weights")
    pause = parameter(1.0, "s", "from the beginning of a trial to the first weight", minimum=0.0,
                      source="estimate: the sleeve has closed by then")
    interval = parameter(0.5, "s", "from weight to weight, longer than laying_time and settling_time", minimum=0.01,
                         source="estimate: shorter than a person's, to save time; the model is quasi-static")
    laying_time = parameter(0.2, "s", "in which a weight is let down", minimum=0.01, source="estimate: by hand")
    settling_time = parameter(50e-3, "s", "from letting go of a weight to looking at the mark", minimum=0.02,
                              display_unit="ms", source="chosen: elastic motion is over by then")
    visible_distance = parameter(0.3e-3, "m", "motion that a person sees", display_unit="mm", minimum=0.0,
                                 source="estimate: slight motion of a tape cut-out")
    visible_angle = parameter(0.05, "rad", "rotation that a person sees", display_unit="deg", minimum=0.0,
                              source="estimate: 3 deg of a tape cut-out")
    reaction_time = parameter(0.3, "s", "from seeing motion to lifting the box", minimum=0.0,
                              source="estimate: a person's")
    clearance = parameter(20e-3, "m", "way of the box to the table below it", display_unit="mm", minimum=1e-3,
                          source="estimate: kept small, so that nothing falls")
    pulley_loss = parameter(0.01, "", "part of the load that the pulley's bearing holds", minimum=0.0, maximum=0.5,
                            source="estimate: ball bearing")
    pulley_radius = parameter(0.02, "m", "radius of the pulley on the instrument", display_unit="mm", minimum=1e-3,
                              source="estimate: the paper gives the torque only")
    seed = noise_seed(12, "the weights")

    action = local(WAITING, "", "what the person does, as `state`", type=Int32)
    trials = local(0, "", "trials so far", type=Int32)
    detected_mass = local(0.0, "kg", "in the box when motion was last seen")
    held_mass = local(0.0, "kg", "largest mass held")
    mass = local(0.0, "kg", "in the box")
    previous_mass = local(0.0, "kg", "in the box before the last weight")
    waited = local(0.0, "s", "time since the last thing the person did")
    marked_position = local(0.0, "m", "position of the mark when the last weight had been laid", display_unit="mm")
    marked_angle = local(0.0, "rad", "angle of the mark then", display_unit="deg")

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        empty(self, WAITING)
        self.trials = 0
        self.waited = 0.0
        self.detected_mass = 0.0
        self.held_mass = 0.0
        publish(self)

    def step(self, t: float, h: float) -> None:
        self.waited += h
        if not self.loading:
            empty(self, WAITING)
        elif self.action == WAITING:
            begin(self)
        elif self.action == LOADING:
            watch(self, h)
        elif self.action == DETECTED and (self.waited >= self.reaction_time - 0.5 * h or landed(self)):
            empty(self, LIFTED)
        publish(self)


def publish(self: Weights) -> None:
    """What the cable carries: the last weight counts while it is being let down."""
    part = min(self.waited / self.laying_time, 1.0) if self.action == LOADING else 1.0
    mass = self.previous_mass + part * (self.mass - self.previous_mass)
    force = GRAVITY * mass * (1.0 - self.pulley_loss)
    self.load = GRAVITY * self.mass
    self.tip_force = -force
    self.tip_torque = force * self.pulley_radius
    self.held_load = GRAVITY * self.held_mass
    self.slip_load = GRAVITY * self.detected_mass
    self.slip_torque = self.slip_load * self.pulley_radius
    self.state = self.action
    self.trial = self.trials


def empty(self: Weights, action: int) -> None:
    """The box is taken off."""
    self.action = action
    self.mass = 0.0
    self.previous_mass = 0.0


def begin(self: Weights) -> None:
    """Begin a trial with an unloaded cable; the first weight follows after the pause."""
    self.action = LOADING
    self.held_mass = 0.0
    self.waited = self.interval - self.pause


def landed(self: Weights) -> bool:
    """Whether the instrument has slipped so far that the box stands on the table."""
    turned = abs(self.angle - self.marked_angle) * self.pulley_radius
    return max(abs(self.position - self.marked_position), turned) > self.clearance


def watch(self: Weights, h: float) -> None:
    """Look at the mark once the weight hangs: elastic motion is over then. Perhaps add another weight."""
    if self.waited <= self.laying_time + self.settling_time + 0.5 * h:
        self.marked_position = self.position
        self.marked_angle = self.angle
    moved = abs(self.position - self.marked_position) > self.visible_distance
    turned = abs(self.angle - self.marked_angle) > self.visible_angle
    if (moved or turned) and self.mass > 0.0:
        self.detected_mass = self.mass
        self.held_mass = self.previous_mass
        self.previous_mass = self.mass
        self.trials += 1
        self.action = DETECTED
        self.waited = 0.0
    elif self.waited >= self.interval - 0.5 * h:
        self.held_mass = self.mass
        self.previous_mass = self.mass
        added = self.increment * (1.0 + self.increment_scatter * min(max(normal(self.stream), -3.0), 3.0))
        self.mass += self.first_mass if self.mass == 0.0 else added
        self.waited = 0.0
