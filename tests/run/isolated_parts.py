"""Components that tests isolate, in a module that is quickly imported: each isolated process imports it."""

import os

from twin.component import Component, PythonComponent, input, local, output, parameter


class Mixed(Component):
    """Variables of several types, an array among them."""

    period = 1e-3

    u = input("1", "what is weighed", start=0.5)
    count = input("1", "a whole number", type="Int32")
    gain = parameter(0.75, "1", "weight")
    y = output("1", "sum and product", shape=(3,))
    total = output("1", "sum of whole numbers", type="Int32")
    even = output("1", "whether that is even", type="Boolean")
    inner = local(0.0, "1", "mean")

    def step(self, t, h):
        self.inner = self.gain * self.inner + (1.0 - self.gain) * self.u
        self.y[0] = self.u + self.inner
        self.y[1] = self.u * self.inner
        self.y[2] = t + h
        self.total = self.total + self.count + 1
        self.even = self.total % 2 == 0


class Spoils(Component):
    """Is infinite from 20 ms on."""

    period = 1e-3

    y = output("1", "one, then infinite")

    def step(self, t, h):
        self.y = 1.0
        if t > 0.0195:
            self.y = 1e308 * 1e308


class Leaves(PythonComponent):
    """Ends its process where `when` says, or fails there; tells its process."""

    period = 1e-3

    when = parameter(0, "1", "1: initialization, 2: step, 3: termination, 4: an error in a step", type="Int32")
    pid = output("1", "process", type="Int64")

    def initialize(self):
        self.pid = os.getpid()
        if self.when == 1:
            os._exit(5)

    def step(self, t, h):
        self.pid = os.getpid()
        if t > 0.0025 and self.when == 2:
            os._exit(5)
        if t > 0.0025 and self.when == 4:
            raise ValueError("no more")

    def close(self):
        if self.when == 3:
            os._exit(5)
