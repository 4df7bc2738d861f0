"""A member whose signals may switch outputs of a drive."""

from twin.component import Boolean, Int32, PythonComponent, input, output


class OutputSignals(PythonComponent):
    """Signals of several types."""

    u = input("", "in")
    on = output("", "one", type=Boolean, start=False)
    pair = output("", "two", type=Boolean, start=False, shape=(2,))
    count = output("", "number", type=Int32, start=0)

    def step(self, t, h):
        """Change nothing."""
