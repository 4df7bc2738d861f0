"""What a C-arm shows of a vessel and of the instruments in it."""

from math import cos, floor, sin, sqrt

from fmus.vessel_travel.model import CURVATURE_1, CURVATURE_2, LUMEN, POINTS, SPACING

from fmus.curves import advance_frame, set_frame
from twin.component import Component, input, local, output, parameter

CENTERLINE_POINTS = 2 * POINTS - 1  # of the center line that is drawn
PITCH = 0.5 * SPACING  # of these [m]
PARTS = 4  # pieces in which the way between two points of the table is bent
POINTS_OF_LINE = 51  # of each instrument


class Fluoroscope(Component):
    """Parallel projection of vessel, catheter and guidewire, in the isocenter's scale.

    The C-arm of Al-Ahmad et al. (RACS), section VI, Fig. 10. It draws the true tips and adds no noise: a picture for people.
    Instruments lie on the center line here, while real ones lean to the walls; breath and heart do not move it.
    """

    period = 80e-3
    former_names = (("place", "centerline"),)

    catheter_travel = input("m", "travel of the catheter's tip", display_unit="mm", nominal=0.1)
    wire_travel = input("m", "travel of the wire's tip", display_unit="mm", nominal=0.1)

    catheter = output("m", "the catheter from the entry to its tip, to the right and up", shape=(POINTS_OF_LINE, 2),
                      display_unit="mm")
    wire = output("m", "the guidewire", shape=(POINTS_OF_LINE, 2), display_unit="mm")
    vessel = output("m", "outline of the vessel, from the entry along one side and back along the other",
                    shape=(2 * CENTERLINE_POINTS, 2), display_unit="mm")
    catheter_tip = output("m", "the catheter's tip", shape=(2,), display_unit="mm")
    wire_tip = output("m", "the wire's tip", shape=(2,), display_unit="mm")
    catheter_location = output("m", "way from the entry to the catheter's tip", display_unit="mm")
    wire_location = output("m", "way from the entry to the wire's tip", display_unit="mm")

    curvature_1 = parameter(CURVATURE_1, "1/m", "curvature along the first direction, every 20 mm from the entry", fixed=True,
                            source="as vessel_travel")
    curvature_2 = parameter(CURVATURE_2, "1/m", "along the second", fixed=True, source="as vessel_travel")
    lumen = parameter(LUMEN, "m", "diameter of the vessel", display_unit="mm", minimum=1e-3, fixed=True,
                      source="as vessel_travel")
    catheter_start = parameter(0.02, "m", "where the catheter's tip is at first", display_unit="mm", fixed=True,
                               source="as tip_location of its vessel_travel")
    wire_start = parameter(0.06, "m", "where the wire's tip is at first", display_unit="mm", fixed=True,
                           source="as tip_location of its vessel_travel")
    view = parameter(2.2, "rad", "angle of the image's right about the vessel's first direction, from the first to the second",
                     display_unit="deg", fixed=True, source="chosen: across the plane of the sketch's arch")

    pixels = parameter(5000.0, "1/m", "pixels per length, at the isocenter", minimum=1.0, fixed=True,
                       source="estimate: detector of 0.31 mm binned pixels, magnified 1.5 times")

    frame = local(0.0, "", "directions and position of the curve", shape=(4, 3))
    centerline = local(0.0, "m", "center line in the image", shape=(CENTERLINE_POINTS, 2))

    def initialize(self) -> None:
        set_frame(self.frame)
        across, up = cos(self.view), sin(self.view)
        self.centerline[0, 0] = 0.0
        self.centerline[0, 1] = 0.0
        for j in range(POINTS - 1):
            for i in range(PARTS):
                part = (i + 0.5) / PARTS
                first = self.curvature_1[j] + part * (self.curvature_1[j + 1] - self.curvature_1[j])
                second = self.curvature_2[j] + part * (self.curvature_2[j + 1] - self.curvature_2[j])
                advance_frame(self.frame, first, second, SPACING / PARTS)
                if i % 2 == 1:
                    k = 2 * j + (i + 1) // 2
                    self.centerline[k, 0] = across * self.frame[3, 0] + up * self.frame[3, 1]
                    self.centerline[k, 1] = self.frame[3, 2]
        draw_vessel(self)
        draw(self)

    def step(self, t: float, h: float) -> None:
        draw_vessel(self)
        draw(self)


def draw_vessel(self: Fluoroscope) -> None:
    """Half a lumen to either side of the center line."""
    right, up = 1.0, 0.0
    for j in range(CENTERLINE_POINTS):
        along_0 = self.centerline[min(j + 1, CENTERLINE_POINTS - 1), 0] - self.centerline[max(j - 1, 0), 0]
        along_1 = self.centerline[min(j + 1, CENTERLINE_POINTS - 1), 1] - self.centerline[max(j - 1, 0), 1]
        length = sqrt(along_0 * along_0 + along_1 * along_1)
        if length > 1e-6:  # else it points at the beam, and the side before goes on
            right, up = along_1 / length, -along_0 / length
        half = 0.25 * (self.lumen[j // 2] + self.lumen[(j + 1) // 2])
        back = 2 * CENTERLINE_POINTS - 1 - j
        self.vessel[j, 0] = on_pixel(self, self.centerline[j, 0] - half * right)
        self.vessel[j, 1] = on_pixel(self, self.centerline[j, 1] - half * up)
        self.vessel[back, 0] = on_pixel(self, self.centerline[j, 0] + half * right)
        self.vessel[back, 1] = on_pixel(self, self.centerline[j, 1] + half * up)


def on_pixel(self: Fluoroscope, x: float) -> float:
    """Center of the pixel that shows a position [m]."""
    return floor(x * self.pixels + 0.5) / self.pixels


def draw(self: Fluoroscope) -> None:
    """Both instruments, and how far they are."""
    self.catheter_location = self.catheter_start + self.catheter_travel
    self.wire_location = self.wire_start + self.wire_travel
    for i in range(POINTS_OF_LINE):
        part = i / (POINTS_OF_LINE - 1.0)
        for c in range(2):
            self.catheter[i, c] = project(self, c, part * self.catheter_location)
            self.wire[i, c] = project(self, c, part * self.wire_location)
    for c in range(2):
        self.catheter_tip[c] = project(self, c, self.catheter_location)
        self.wire_tip[c] = project(self, c, self.wire_location)


def project(self: Fluoroscope, c: int, location: float) -> float:
    """Image coordinate [m] of a location along the vessel; extrapolated straight at both ends."""
    x = location / PITCH
    j = min(max(floor(x), 0), CENTERLINE_POINTS - 2)
    return on_pixel(self, self.centerline[j, c] + (x - j) * (self.centerline[j + 1, c] - self.centerline[j, c]))
