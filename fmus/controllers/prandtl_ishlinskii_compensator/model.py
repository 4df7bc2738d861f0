"""Compensation of the hysteresis in a position by play operators."""

from twin.component import Component, input, local, output, parameter

PLAYS = 8
THRESHOLDS = (0.0, 0.4e-3, 0.8e-3, 1.2e-3, 1.6e-3, 2.0e-3, 2.4e-3, 2.8e-3)  # [m]
WEIGHTS = (0.0, 0.0, 0.0, 0.0, 0.185, 0.731, 0.0, 0.179)


class PrandtlIshlinskiiCompensator(Component):
    """From the wanted tip position to the gripper position that should lead there, by the inverse of a sum of plays.

    Kuhnen, European Journal of Control 9(4), 2003, recalled; `identify.py` finds the weights. Rate-independent, and
    monotone for any weights that are not negative. Thresholds must rise from 0: with others the inverse is none.
    """

    period = 1e-3

    position = input("m", "wanted tip position", display_unit="mm", nominal=5e-3)
    scale = input("", "width of the hysteresis over that of the plays, such as an estimator follows it", start=1.0, minimum=0.0)
    compensated_position = output("m", "target position for the gripper", display_unit="mm")

    threshold = parameter(THRESHOLDS, "m", "half widths of the plays, rising from 0", display_unit="mm", minimum=0.0,
                          source="chosen: evenly over more than the loop's half width of 1.8 mm")
    weight = parameter(WEIGHTS, "", "weights of the plays", minimum=0.0,
                       source="identified with seed 1 of scenarios/hysteresis_models.yaml")
    slope_minimum = parameter(0.2, "", "least slope of output over input", minimum=1e-3,
                              source="chosen: the compensated speed is at most 5 times the wanted one, as bouc_wen_compensator")

    inverse_threshold = local(0.0, "m", "half widths of the plays of the inverse", shape=(PLAYS,), display_unit="mm")
    inverse_weight = local(0.0, "", "their weights", shape=(PLAYS,))
    memory = local(0.0, "m", "what each of them is at", shape=(PLAYS,), display_unit="mm")

    def initialize(self) -> None:
        total = invert(self)
        for i in range(PLAYS):
            self.memory[i] = self.position
        self.compensated_position = self.position / total

    def step(self, t: float, h: float) -> None:
        x = 0.0
        for i in range(PLAYS):
            half = self.scale * self.inverse_threshold[i]
            self.memory[i] = min(max(self.memory[i], self.position - half), self.position + half)
            x += self.inverse_weight[i] * self.memory[i]
        self.compensated_position = x


def invert(self: PrandtlIshlinskiiCompensator) -> float:
    """Thresholds and weights of the inverse; returns the slope with all plays moving.

    A first weight below `slope_minimum` is raised to it, at the cost of the others, whose thresholds grow as their
    weights shrink: the loop keeps its slope and its width, and only its corners change.
    """
    rest = 0.0
    for i in range(1, PLAYS):
        rest += self.weight[i]
    first = max(self.weight[0], self.slope_minimum)
    share = 1.0
    if rest > 0.0:
        share = max((rest + self.weight[0] - first) / rest, 1e-3)

    slope = first
    passed = 0.0  # sum of weight times threshold so far [m]
    self.inverse_threshold[0] = 0.0
    self.inverse_weight[0] = 1.0 / slope
    for i in range(1, PLAYS):
        weight = share * self.weight[i]
        half = self.threshold[i] / share
        self.inverse_threshold[i] = slope * half - passed
        self.inverse_weight[i] = 1.0 / (slope + weight) - 1.0 / slope
        slope += weight
        passed += weight * half
    return slope
