"""A member with a variable of each kind, for catalogs."""

from twin.component import Boolean, Int32, PythonComponent, input, local, output, parameter


class Plant(PythonComponent):
    """One of each."""

    period = 2e-3

    speed = input("m/s", "speed of the hand", display_unit="mm/s", start=0.001)
    free = input("N", "a free input", minimum=-1.0, maximum=2.0)
    fed = input("m", "connected")
    pressed = input("", "a truth", type=Boolean, start=False)
    gain = parameter(2.0, "1/s", "tunable")
    size = parameter(3, "", "fixed", type=Int32, fixed=True)
    y = output("m", "position", display_unit="mm", shape=(2,))
    z = output("m", "its first part")
    inner = local(0.0, "m", "memory")

    def initialize(self):
        self.y = [0.0, 0.0]
        self.z = 0.0

    def step(self, t, h):
        self.y = [self.y[0] + h * self.speed, 0.0]
        self.z = self.y[0]
