"""Components of benchmarks: the cheap one of the ring, and one that tells the time of the wall clock."""

import time

from twin.component import Component, PythonComponent, input, output, parameter


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


class WallClock(PythonComponent):
    """The time of the wall clock when it is stepped; slow enough for a run that is to be killed."""

    period = 1e-3

    now = output("s", "time since 1970")
    pause = parameter(0.0005, "s", "wait in every step", source="assumed")

    def step(self, t, h):
        time.sleep(float(self.pause))
        self.now = time.time()
