"""Components for the tests of the Python face: values of every type, and one that fails."""

from twin.component import Boolean, Component, Int32, PythonComponent, input, output, parameter


class Types(Component):
    """Counts, tells whether it counts, and an array."""

    push = input("N", "force")
    place = output("m", "place", display_unit="mm")
    count = output("1", "steps", start=0, type=Int32)
    odd = output("1", "whether the count is odd", start=False, type=Boolean)
    row = output("m", "three places", shape=(3,))
    gain = parameter(2.0, "m/N", "gain", display_unit="mm/N")
    mass = parameter(1.0, "kg", "mass", fixed=True)

    def step(self, t, h):
        self.count = self.count + 1
        self.odd = self.count % 2 == 1
        self.place = self.gain * self.push
        for i in range(3):
            self.row[i] = i + self.place


class Slow(Component):
    """Publishes what it computes when its period is over."""

    period = 0.01
    value = output("N", "number of steps")
    gain = parameter(1.0, "N", "of each step")

    def step(self, t, h):
        self.value = self.value + self.gain


class Fails(PythonComponent):
    """Fails at its third step, and knows whether it was closed."""

    value = output("1", "time")
    closed = 0

    def step(self, t, h):
        self.value = t
        if t > 0.0025:
            raise RuntimeError("worn out")

    def close(self):
        Fails.closed += 1


SCENARIO = """
title: Pushed
stop_time: 50 ms
seeds: [1, 2]
members:
  part: {component: "tests.face.parts:Types"}
variants:
  plain: {title: as it is}
  strong: {members: {part: {parameters: {gain: 5}}}}
  more: {members: {wave: {component: chirp}}, stop_time: 40 ms}
events:
  - {at: 10 ms, set: {part.push: 2 N}}
record: ["*.*"]
metrics:
  reached: {signal: part.place, reduce: final, unit: mm, reference: {plain: 4000 mm}, tolerance: 1 %}
expect:
  - {signal: part.place, at_most: 20 m}
plots:
  - {title: Places, signals: [part.place]}
"""
