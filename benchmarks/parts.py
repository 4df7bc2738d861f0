"""The cheap component of the ring benchmark."""

from twin.component import Component, input, output, parameter


class Relay(Component):
    """Half of what comes in, and a little more: as cheap as a component can be."""

    u = input("", "what the neighbor gives")
    y = output("", "what the next one gets")
    gain = parameter(0.5, "", "gain", source="assumed")
    offset = parameter(1.0, "", "offset", source="assumed")

    def initialize(self):
        self.y = self.offset

    def step(self, t, h):
        self.y = self.gain * self.u + self.offset
