"""Wall position from the tracked tip in contact."""

from math import inf, isfinite

from fmus.tracked_tip import TrackedTip, changed

from twin.component import Int32, input, local, output, parameter, terminal

VALID, LOST = 0, 2


class WallTracking(TrackedTip):
    """Travel of the wall that the tip presses on: the tracked tip along the wall's normal, as long as there is contact.

    The gripper's own motion moves the tip along the wall or bends its free end, which leaves the distance from the wall as it is.
    So the wall is measured while the gripper moves, which the tip's bending alone does not tell.
    """

    period = 1e-3

    force = input("N", "measured contact force", start=0.2, nominal=0.1)

    position = output("m", "of the wall along its motion, in the universal frame", shape=(3,), display_unit="mm")
    status = output("", "0 valid, 1 degraded: as the tip; 2 lost: as the tip, or no contact", type=Int32)
    age = output("s", "age of the sample when it was published", display_unit="ms")

    wall = terminal("the tracked wall", rule="bus", position=position, status=status, age=age)

    motion = parameter((0.0, 0.0, 1.0), "", "direction of the wall's motion, positive away from the instrument",
                       source="chosen: z, as the instrument leaves its sheath")
    normal = parameter((0.0, 1.0, 1.0), "", "normal of the wall, of any length; not across `motion`",
                       source="estimate: a wall inclined by 45 deg, as in bench_wall; its free end yields across as far as the wall comes near")
    contact_force = parameter(0.03, "N", "least measured force that counts as contact", display_unit="mN", minimum=0.0,
                              source="ten deviations of the sensor's noise, which its zero error and drift do not reach in minutes")

    travel = local(0.0, "m", "of the wall along its motion", display_unit="mm")
    sample_age = local(0.0, "s", "age of that sample when it was published", display_unit="ms")

    def initialize(self) -> None:
        for i in range(3):
            self.last_position[i] = 0.0
        self.travel = 0.0
        self.sample_age = 0.0
        publish(self, LOST)

    def step(self, t: float, h: float) -> None:
        size = along = 0.0
        for i in range(3):
            size += self.normal[i] * self.motion[i]
            along += self.normal[i] * self.tip_position[i]
        travel = along / size if abs(size) > 1e-9 else inf
        usable = isfinite(travel) and self.force >= self.contact_force  # what is no number is no contact either
        if changed(self) and usable:
            self.travel = travel
            self.sample_age = self.tip_age + h
        publish(self, self.tip_status if usable else LOST)


def publish(self: WallTracking, status: int) -> None:
    """Publish the last sample and its status."""
    for i in range(3):
        self.position[i] = self.travel * self.motion[i]
    self.age = self.sample_age
    self.status = status
