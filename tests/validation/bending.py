"""A small component for the tests: bending angle of a tendon robot with play, and a driven oscillator."""

from twin.component import DISCARD, OK, WARNING, Component, input, local, output, parameter, solver, state


class Bending(Component):
    """Angle = rest + gain * tendon behind a play."""

    period = 10e-3

    tendon = input("m", "pull of the tendon", display_unit="mm")
    angle = output("rad", "bending angle", display_unit="deg")
    height = output("m", "height of the tip", display_unit="mm")
    rest = parameter(0.5, "rad", "angle at rest", display_unit="deg", source="chosen")
    gain = parameter(100.0, "rad/m", "angle per pull", source="chosen")
    play = parameter(0.5e-3, "m", "half width of the play", minimum=0.0, source="chosen")
    length = parameter(0.1, "m", "length of the bending part", source="chosen")
    memory = local(0.0, "m", "output of the play")

    def initialize(self):
        self.memory = self.tendon
        self.angle = self.rest + self.gain * self.memory
        self.height = self.length * self.angle

    def step(self, t, h):
        self.memory = min(max(self.memory, self.tendon - self.play), self.tendon + self.play)
        self.angle = self.rest + self.gain * self.memory
        self.height = self.length * self.angle


class Oscillator(Component):
    """First bending mode: x'' + 2 d w x' + w^2 x = w^2 gain q."""

    method = solver.rk4(1e-3)

    q = input("m", "displacement of the tendon")
    x = output("m", "position of the tip")
    frequency = parameter(20.0, "rad/s", "natural frequency", minimum=1.0, source="chosen")
    damping = parameter(0.3, "", "damping ratio", minimum=0.0, source="chosen")
    gain = parameter(5.0, "", "position per displacement", source="chosen")
    first_position = parameter(0.0, "m", "position at the beginning", source="measured")
    first_velocity = parameter(0.0, "m/s", "velocity at the beginning", source="measured")
    position = state(0.0, "m", "position")
    velocity = state(0.0, "m/s", "velocity")

    def initialize(self):
        self.position = self.first_position
        self.velocity = self.first_velocity

    def derivatives(self, t):
        self.der_position = self.velocity
        force = self.frequency * self.frequency * (self.gain * self.q - self.position)
        self.der_velocity = force - 2.0 * self.damping * self.frequency * self.velocity
        self.x = self.position


class Counter(Component):
    """Counts its steps and adds its inputs; a step fails as `left` is 100 and warns as it is 50."""

    period = 10e-3

    left = input("", "a number")
    right = input("", "numbers", shape=(2,))
    total = output("", "left + 10 right[1] + 100 right[2] + 1000 count")
    both = output("", "left, the time at the end of a step", shape=(2,))
    count = local(0.0, "", "number of steps")

    def initialize(self):
        self.total = self.left + 10.0 * self.right[0] + 100.0 * self.right[1] + 1000.0 * self.count
        self.both[0] = self.left
        self.both[1] = -1.0

    def step(self, t: float, h: float) -> int:
        self.count += 1.0
        self.total = self.left + 10.0 * self.right[0] + 100.0 * self.right[1] + 1000.0 * self.count
        self.both[0] = self.left
        self.both[1] = t + h
        if self.left == 50.0:
            return WARNING
        if self.left == 100.0:
            return DISCARD
        return OK
