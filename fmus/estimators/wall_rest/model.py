"""Wall rest: one sentence that says what it is."""

from twin.component import Component, input, output, parameter, rk4, state


class WallRest(Component):
    """Wall rest: a first-order lag between its input and its output; put your equations in its place.

    Where the equations come from (author, journal, year), and the one thing that will hurt whoever uses this.
    """

    method = rk4(1e-3)

    u = input("m", "what comes in, positive distal", nominal=1e-2)
    y = output("m", "what goes out, positive distal")
    time_constant = parameter(0.05, "s", "time constant", display_unit="ms", minimum=1e-3, source="assumed")
    x = state(0.0, "m", "lagged input", nominal=1e-2)

    def initialize(self):
        self.x = self.u

    def derivatives(self, t):
        self.der_x = (self.u - self.x) / self.time_constant
        self.y = self.x
