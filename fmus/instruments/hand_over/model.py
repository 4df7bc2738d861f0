"""What a hand-over between grippers does to the instrument that they hold."""

from twin.component import Component, input, local, output, parameter


class HandOver(Component):
    """Gripped end of the instrument behind the gripper that carries it: it follows, and slips at a hand-over.

    Assumed, no measurement: each change of `slip` is gone through at `speed`. Forces play no part, see `braided_sleeve`.
    """

    period = 1e-3

    gripper_position = input("m", "position of the gripper, positive distal", display_unit="mm", nominal=5e-3)

    position = output("m", "position of the gripped end, positive distal", display_unit="mm")

    slip = parameter(0.0, "m", "what the instrument has slipped back, positive proximal; an event of the scenario is a hand-over",
                     display_unit="mm", source="0: none")
    speed = parameter(0.05, "m/s", "at which it slips", display_unit="mm/s", minimum=1e-4,
                      source="assumed: the pace of a carriage, 12 ms for 0.6 mm")

    slipped = local(0.0, "m", "slip so far", display_unit="mm")

    def initialize(self) -> None:
        self.slipped = self.slip
        self.position = self.gripper_position - self.slipped

    def step(self, t: float, h: float) -> None:
        most = self.speed * h
        self.slipped += min(max(self.slip - self.slipped, -most), most)
        self.position = self.gripper_position - self.slipped
