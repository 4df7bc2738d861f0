"""Joystick guidance of an injection catheter's target coordinate."""

from twin.component import Boolean, Component, input, local, output, parameter, terminal


class CoordinateGuidance(Component):
    """Target coordinate inside the workspace, moved by the operator's speed commands; it stays where the input is released.

    Cheng and Law (paper B) typed coordinates in; a stick in their place is ours. The tip does not move while the needle is
    out or on its way in: a press on the needle takes the stick's place.
    """

    period = 10e-3

    speed_y = input("m/s", "commanded lateral speed, positive away from straight", display_unit="mm/s", nominal=2e-3)
    speed_z = input("m/s", "commanded axial speed, positive distal", display_unit="mm/s", nominal=2e-3)
    needle_out = input("", "whether the needle is to be out", type=Boolean)

    target_y = output("m", "wanted tip position across", display_unit="mm")
    target_z = output("m", "wanted tip position along", display_unit="mm")
    target_needle_length = output("m", "wanted needle length", display_unit="mm")

    target = terminal("wanted coordinate", y=target_y, z=target_z, needle_length=target_needle_length)

    start_y = parameter(0.0, "m", "where it begins across", display_unit="mm", fixed=True, minimum=0.0, source="chosen: straight")
    start_z = parameter(0.0, "m", "where it begins along", display_unit="mm", fixed=True, minimum=0.0, source="chosen: drawn back")
    y_maximum = parameter(15e-3, "m", "largest y; the least is 0", display_unit="mm", minimum=0.0,
                          source="paper, calibration method")
    z_maximum = parameter(13.5e-3, "m", "largest z; the least is 0", display_unit="mm", minimum=0.0,
                          source="paper: 20 mm of advance, less what the largest deflection takes of it")
    speed_maximum = parameter(3e-3, "m/s", "largest speed that is passed on", display_unit="mm/s", minimum=0.0,
                              source="estimate: a third of what the slides go at 2000 Hz")
    needle_length = parameter(4e-3, "m", "needle length while it is out", display_unit="mm", minimum=0.0, maximum=6e-3,
                              source="paper, Table 2: 3 to 5 mm")
    retraction = parameter(0.8, "s", "time from letting the needle go until the tip may move", minimum=0.0,
                           source="estimate: 4 mm at 9.6 mm/s, and a rest")

    left = local(0.0, "s", "until the tip may move")
    y = local(0.0, "m", "where it is wanted across", display_unit="mm")
    z = local(0.0, "m", "where it is wanted along", display_unit="mm")

    def initialize(self) -> None:
        self.left = 0.0
        self.y = min(self.start_y, self.y_maximum)
        self.z = min(self.start_z, self.z_maximum)
        publish(self)

    def step(self, t: float, h: float) -> None:
        if self.needle_out:
            self.left = self.retraction
        elif self.left > 0.0:
            self.left -= h
        if self.left <= 0.0:
            most = self.speed_maximum
            self.y = min(max(self.y + h * min(max(self.speed_y, -most), most), 0.0), self.y_maximum)
            self.z = min(max(self.z + h * min(max(self.speed_z, -most), most), 0.0), self.z_maximum)
        publish(self)


def publish(self: CoordinateGuidance) -> None:
    """Outputs from the memory."""
    self.target_y = self.y
    self.target_z = self.z
    self.target_needle_length = self.needle_length if self.needle_out else 0.0
