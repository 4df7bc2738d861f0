"""Where the needle enters the wall, and where its dose goes."""

from math import cos, floor

from fmus.injection import length
from twin.component import Boolean, Component, input, local, output, parameter, terminal

BINS = 12


class InjectionSite(Component):
    """Depth of the needle's tip in the wall, the dose by depth, and how far the catheter moves across meanwhile.

    Geometry alone: a plane wall, a straight needle in the direction of the tip, a dose that stays where it is given.
    """

    former_names = (("beside", "outside_dose"),)

    tip_x = input("m", "tip across", display_unit="mm", nominal=8e-3)
    tip_y = input("m", "tip across", display_unit="mm", nominal=8e-3)
    tip_z = input("m", "tip along, as if there were no wall", display_unit="mm", nominal=10e-3)
    tip_angle = input("rad", "angle of the tip to the normal of the wall", display_unit="deg", nominal=0.7)
    needle_length = input("m", "needle outside of the tip", display_unit="mm", nominal=4e-3)
    heart_position = input("m", "wall position, positive away", display_unit="mm", nominal=1e-3)
    flow = input("m^3/s", "flow of the syringe", display_unit="mL/s", minimum=0.0, nominal=1e-8)

    depth = output("m", "needle's tip under the surface; negative: before it", display_unit="mm")
    needle_outside = output("", "whether the needle is outside of the catheter", type=Boolean)
    across = output("m", "largest way of the catheter across with the needle outside", display_unit="mm")
    given = output("m^3", "dose in the wall", display_unit="mL")
    lost = output("m^3", "dose that was given before the surface or deeper than the last layer", display_unit="mL")
    dose = output("m^3", "dose by depth, layers from the surface", shape=(BINS,), display_unit="mL")

    tip = terminal("the tip and the needle", x=tip_x, y=tip_y, z=tip_z, angle=tip_angle, needle_length=needle_length)

    surface_position = parameter(10e-3, "m", "wall surface at heart position zero", display_unit="mm",
                                 source="chosen: as the wall of the scenario")
    layer = parameter(0.25e-3, "m", "thickness of a layer", display_unit="mm", minimum=1e-6, source="chosen: for plots")

    start_x = local(0.0, "m", "tip when the needle came out", display_unit="mm")
    start_y = local(0.0, "m", "tip when the needle came out", display_unit="mm")

    layers = local(0.0, "m^3", "dose by depth", shape=(BINS,), display_unit="mL")
    outside_dose = local(0.0, "m^3", "dose that no layer got", display_unit="mL")
    farthest = local(0.0, "m", "largest way across with the needle outside", display_unit="mm")

    def initialize(self) -> None:
        for i in range(BINS):
            self.layers[i] = 0.0
        self.outside_dose = 0.0
        self.farthest = 0.0
        self.start_x = self.tip_x
        self.start_y = self.tip_y
        publish(self)

    def step(self, t: float, h: float) -> None:
        if self.needle_length <= 0.0:
            self.start_x = self.tip_x
            self.start_y = self.tip_y
        else:
            self.farthest = max(self.farthest, length(self.tip_x - self.start_x, self.tip_y - self.start_y))

        volume = self.flow * h
        index = floor(depth_now(self) / self.layer)
        if index < 0 or index >= BINS:
            self.outside_dose += volume
        else:
            self.layers[index] += volume
        publish(self)


def depth_now(self: InjectionSite) -> float:
    """Depth of the needle's tip below the surface [m]. A catheter tip beyond the surface rests on it and bends."""
    gap = max(self.surface_position + self.heart_position - self.tip_z, 0.0)
    return self.needle_length * cos(self.tip_angle) - gap


def publish(self: InjectionSite) -> None:
    """Outputs from the memory."""
    self.depth = depth_now(self)
    self.needle_outside = self.needle_length > 0.0
    self.across = self.farthest
    self.lost = self.outside_dose
    total = 0.0
    for i in range(BINS):
        self.dose[i] = self.layers[i]
        total += self.layers[i]
    self.given = total
