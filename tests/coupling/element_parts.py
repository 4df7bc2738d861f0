"""Components with arrays, for overrides of single elements."""

from twin.component import Boolean, Component, input, output


class Source(Component):
    """Counts its steps in three ways."""

    forces = output("N", "growing, each by its own factor", shape=(3,))
    valves = output("", "each open in its turn", shape=(3,), type=Boolean)

    def initialize(self):
        for i in range(3):
            self.forces[i] = 0.0
            self.valves[i] = i == 0

    def step(self, t, h):
        for i in range(3):
            self.forces[i] = (t + h) * 500.0 * (i + 1)
            self.valves[i] = int((t + h) * 1000.0 + 0.5) % 3 == i


class Mirror(Component):
    """Shows what it is given."""

    forces = input("N", "forces", shape=(3,))
    valves = input("", "valves", shape=(3,), type=Boolean)
    seen = output("N", "the forces", shape=(3,))
    count = output("", "open valves")

    def initialize(self):
        self.count = 0.0
        for i in range(3):
            self.seen[i] = self.forces[i]

    def step(self, t, h):
        self.count = 0.0
        for i in range(3):
            self.seen[i] = self.forces[i]
            if self.valves[i]:
                self.count += 1.0
