"""Supervisor of the rig."""

from twin.component import Boolean, Component, Int32, input, local, output, parameter, terminal

GRIPPERS = 2

# what the instrument may still do
FREE, BACK_ONLY, HOLD = 0, 1, 2

# bits of `cause`
AIR, DRIVE_1, DRIVE_2, OVERLOAD, SLIP, BUCKLED = 1, 2, 4, 8, 16, 32

# drive that is reported as lost to the sequencer: it stops, and the other gripper closes too
NONE, FIRST, SECOND, CARRYING = 0, 1, 2, 3

# cause      motion     air is told lost  drive that is told lost
REACTIONS = (
    (AIR,       HOLD,      1,                NONE),
    (DRIVE_1,   HOLD,      0,                FIRST),
    (DRIVE_2,   HOLD,      0,                SECOND),
    (OVERLOAD,  HOLD,      0,                NONE),
    (SLIP,      HOLD,      0,                CARRYING),
    (BUCKLED,   BACK_ONLY, 0,                NONE),
)

# step of the sequencer from which one gripper carries the instrument
CARRIED = 3


class Supervisor(Component):
    """Stands between the wanted speed and the regripping sequencer: watches the rig, and holds it when something fails.

    A cause is kept until it is over and the operator has let go (wanted speed zero). It never opens a gripper.
    """

    period = 5e-3
    former_names = (("kept", "latched"),)

    target_velocity = input("m/s", "speed that the operator wants, positive distal", display_unit="mm/s", nominal=0.03)
    air_ok = input("", "pressure switch", start=True, type=Boolean)
    leading = input("", "gripper that carries the instrument, 1 or 2", start=1, type=Int32, minimum=1, maximum=2)
    step_number = input("", "step of the sequencer, 1 to 9", start=1, type=Int32, minimum=1, maximum=9)
    gripper_position = input("m", "position_actual_value of each drive", shape=(GRIPPERS,), display_unit="mm",
                             nominal=0.01)
    gripper_velocity = input("m/s", "velocity_actual_value of each drive", shape=(GRIPPERS,), display_unit="mm/s",
                             nominal=0.03)
    gripper_target_velocity = input("m/s", "60FFh of each drive", shape=(GRIPPERS,), display_unit="mm/s", nominal=0.03)
    limited = input("", "each drive has limited its current (I2t)", shape=(GRIPPERS,), type=Boolean)
    instrument_position = input("m", "of the instrument at the grippers, from an optical sensor", display_unit="mm",
                                nominal=0.01)
    buckled = input("", "the free length has bowed out, from a light barrier next to it", type=Boolean)

    velocity = output("m/s", "speed command to the sequencer", display_unit="mm/s")
    pressure_ok = output("", "air state sent to the sequencer", type=Boolean)
    drive_ok = output("", "state of each drive sent to the sequencer", shape=(GRIPPERS,), type=Boolean)
    state = output("", "0 free, 1 back only, 2 hold", type=Int32)
    cause = output("", "bits: 1 air, 2 and 4 a drive, 8 overload, 16 slip, 32 buckled", type=Int32)
    slip = output("m", "motion of the instrument in the gripper that carries it, positive distal", display_unit="mm")

    sequencer = terminal(
        "the sequencer that it watches", pressure_ok=pressure_ok, drive_ok=drive_ok, leading=leading,
        step_number=step_number, gripper_target_velocity=gripper_target_velocity,
    )
    drive = terminal(
        "drives of the grippers, by CiA 402", position_actual_value=gripper_position,
        velocity_actual_value=gripper_velocity, limited=limited,
    )

    slip_maximum = parameter(3.5e-3, "m", "slip between two changes of the lead that holds the rig", display_unit="mm",
                             minimum=0.0, source="chosen: 15 N on 4.4 N/mm of a grip are no slip")
    slippage_window = parameter(4e-3, "m/s", "60F8h: difference of speeds that a drive may have", display_unit="mm/s",
                                minimum=0.0, source="chosen: below the paper's 5 mm/s")
    slippage_time = parameter(0.3, "s", "time for which it may have more", display_unit="ms", minimum=0.0,
                              source="chosen: its integral makes up for 13 N by then")

    latched = local(0, "", "bits of latched causes", type=Int32)
    anchor = local(0.0, "m", "instrument minus gripper when the lead changed", display_unit="mm")
    leading_last = local(0, "", "gripper that carried", type=Int32)
    slipped = local(0, "", "gripper in which the instrument slipped, 1 or 2", type=Int32)
    astray = local(0.0, "s", "since each drive has been beyond the window", shape=(GRIPPERS,))

    def initialize(self) -> None:
        self.latched = 0
        self.leading_last = 0
        self.slipped = 0
        self.slip = 0.0
        for k in range(GRIPPERS):
            self.astray[k] = 0.0
        publish(self)

    def step(self, t: float, h: float) -> None:
        causes = detect_causes(self, h)
        let_go = self.target_velocity == 0.0
        self.latched = causes | (0 if let_go else self.latched)
        publish(self)


def detect_causes(self: Supervisor, h: float) -> int:
    """Bits of the causes that are there now."""
    relative = self.instrument_position - self.gripper_position[self.leading - 1]
    let_go = self.target_velocity == 0.0 and self.latched & SLIP
    if self.leading != self.leading_last or self.step_number < CARRIED or let_go:
        self.anchor = relative
    self.leading_last = self.leading
    self.slip = relative - self.anchor

    causes = 0
    if not self.air_ok:
        causes |= AIR
    if abs(self.slip) > self.slip_maximum:
        causes |= SLIP
        self.slipped = self.leading
    if self.buckled:
        causes |= BUCKLED
    for k in range(GRIPPERS):
        if self.limited[k]:
            causes |= OVERLOAD
        away = abs(self.gripper_target_velocity[k] - self.gripper_velocity[k]) > self.slippage_window
        self.astray[k] = self.astray[k] + h if away else 0.0
        if self.astray[k] > self.slippage_time:
            causes |= DRIVE_1 if k == 0 else DRIVE_2
    return causes


def publish(self: Supervisor) -> None:
    """Publish the reaction to the latched causes by the table; the strictest of several."""
    self.state = FREE
    self.pressure_ok = True
    self.drive_ok[0] = True
    self.drive_ok[1] = True
    for cause, motion, air, drive in REACTIONS:
        if self.latched & cause:
            self.state = max(self.state, motion)
            self.pressure_ok = self.pressure_ok and air == 0
            gripper = self.slipped if drive == CARRYING else drive
            if gripper != NONE:
                self.drive_ok[gripper - 1] = False
    self.cause = self.latched
    self.velocity = self.target_velocity
    if self.state == HOLD:
        self.velocity = 0.0
    elif self.state == BACK_ONLY:
        self.velocity = min(self.target_velocity, 0.0)
