"""Members for tests of groups."""

from twin.component import Component, PythonComponent, input, output, parameter


class Gain(Component):
    """Passes its input on at once."""

    u = input("", "in", start=1.0)
    y = output("", "out")
    gain = parameter(1.0, "", "gain", source="assumed")

    def initialize(self):
        self.y = self.gain * self.u

    def step(self, t, h):
        self.y = self.gain * self.u


class Counter(Component):
    """Counts its steps of 3 ms."""

    period = 3e-3
    y = output("", "steps published")
    unread = output("", "the same, read by no member")

    def step(self, t, h):
        self.y = self.y + 1.0
        self.unread = self.y


class Watch(PythonComponent):
    """Lives in Python."""

    u = input("", "in")
    y = output("", "out")

    def step(self, t, h):
        self.y = self.u
