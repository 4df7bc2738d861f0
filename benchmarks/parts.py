"""Components of benchmarks: the cheap one of the ring, and one that tells the time of the wall clock."""

import time

from twin.component import Component, Int64, PythonComponent, input, local, output, parameter


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


class Drift(Component):
    """The same with a sum that grows: no iteration is over before it begins."""

    u = input("", "what the neighbor gives")
    y = output("", "what the next one gets")
    gain = parameter(-0.9, "", "gain, of a ring that converges slowly", source="assumed")

    def step(self, t, h):
        self.y = self.gain * self.u + (t + h) * (t + h)


class Late(Component):
    """What comes in, some milliseconds later: for scenarios that are broken on purpose."""

    period = 1e-3

    u = input("", "what comes in")
    y = output("", "the same, late")
    steps = parameter(50, "", "delay, in periods", minimum=1, maximum=100, type=Int64, source="assumed")
    line = local(0.0, "", "values that wait, a ring", shape=(100,))
    place = local(0, "", "of the oldest", type=Int64)

    def initialize(self):
        self.place = 0
        for i in range(100):
            self.line[i] = self.u
        self.y = self.u

    def step(self, t, h):
        self.y = self.line[self.place]
        self.line[self.place] = self.u
        self.place = (self.place + 1) % self.steps
