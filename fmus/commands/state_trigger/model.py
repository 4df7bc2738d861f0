"""State trigger."""

from twin.component import Boolean, Component, Int32, Int64, input, local, output, parameter


class StateTrigger(Component):
    """Begins a trouble a while after a sequence has come into a state: an abort, a lost measurement, a push.

    A part of experiments. An event has a fixed time, and a sequence that waits for contact is never at the same place then:
    an abort that is meant for one state finds the one before or after it. Once begun, the trouble stays.
    """

    period = 10e-3
    former_names = (("begun", "is_active"),)

    state = input("", "state of the sequence", type=Int32)
    number = input("", "target of the sequence, from 1", type=Int64)

    is_active = output("", "whether the trouble has begun", type=Boolean)
    well = output("", "whether it has not", type=Boolean)
    level = output("", "1 if it has begun, else 0: for connections with a factor")

    at_state = parameter(5, "", "state in which it begins; negative: never", type=Int32,
                         source="chosen: while `injection_sequence` injects")
    at_number = parameter(1, "", "target at which it begins", type=Int64, source="chosen: the first")
    delay = parameter(0.1, "s", "time in that state before", minimum=0.0, source="chosen by the experiment")

    elapsed = local(0.0, "s", "time in that state")

    def initialize(self) -> None:
        self.elapsed = 0.0
        self.is_active = False
        self.well = True
        self.level = 0.0

    def step(self, t: float, h: float) -> None:
        there = self.state == self.at_state and self.number == self.at_number
        self.elapsed = self.elapsed + h if there else 0.0
        self.is_active = self.is_active or (there and self.elapsed > self.delay)
        self.well = not self.is_active
        self.level = 1.0 if self.is_active else 0.0
