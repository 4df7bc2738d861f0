"""Components that compute what is no finite number, and those that get it."""

from math import isfinite

from twin.component import ERROR, Component, Int32, PythonComponent, input, local, output, parameter


class Spoiled(Component):
    """Its local variable becomes infinite at a time, its output some steps later."""

    y = output("m", "out")
    at = parameter(0.05, "s", "when `inner` becomes infinite", fixed=True)
    delay = parameter(1.0, "s", "how much later the output does", fixed=True)
    inner = local(0.0, "", "memory")
    numbers = local((1.0, 2.0, 3.0), "", "memory", shape=(3,))
    count = output("", "steps", type=Int32, start=0)

    def initialize(self) -> None:
        self.y = 1.0

    def step(self, t: float, h: float) -> None:
        large = 1e308
        self.count += 1
        if t + h > self.at - 1e-9:
            self.inner = large * 10.0
        if t + h > self.at + self.delay - 1e-9:
            self.y = self.inner


class Blink(Component):
    """Its output is infinite for one step."""

    y = output("m", "out")
    at = parameter(0.05, "s", "when", fixed=True)

    def step(self, t: float, h: float) -> None:
        large = 1e308
        self.y = 0.0
        if abs(t + h - self.at) < 0.5 * h:
            self.y = large * 10.0


class Sum(Component):
    """Passes on what comes in; fails if it is not finite and that is asked for."""

    u = input("m", "in", minimum=-1.0, maximum=2e-3, display_unit="mm")
    mode = input("", "one of two", type=Int32, start=1, minimum=1, maximum=2)
    y = output("m", "out")
    picky = parameter(False, "", "fail on what is not finite", fixed=True)

    def step(self, t: float, h: float) -> int:
        self.y = self.u + 1.0
        return ERROR if self.picky and not isfinite(self.u) else 0


class Ramp(Component):
    """1 mm per step, and the number of the step."""

    y = output("m", "out")
    count = output("", "steps", type=Int32, start=1)

    def step(self, t: float, h: float) -> None:
        self.y += 1e-3
        self.count += 1


class Aside(PythonComponent):
    """Cannot go back to what it was."""

    y = output("m", "out")
    steps = 0

    def step(self, t: float, h: float) -> None:
        self.steps += 1
        self.y = 1.0
