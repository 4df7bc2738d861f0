"""Command of an operator for two rigs, recorded or live."""

from math import isfinite

from twin.component import Boolean, Component, Int32, input, local, output, parameter, terminal

ROWS = 96  # room for rows of a recording
AXES = 4  # catheter and wire along themselves, catheter and wire about themselves

# axis: index of its speed, and of the instrument that it moves
CATHETER, WIRE, CATHETER_TURN, WIRE_TURN = 0, 1, 2, 3

# which instrument is held: the interlock stops both of its axes
FREE, CATHETER_HELD, WIRE_HELD, BOTH_HELD = 0, 1, 2, 3

# where the command comes from
RECORDING, LIVE, STOPPED, OVER = 0, 1, 2, 3

# recording of a component that is given none: the wire leads, the catheter follows, both come back
TIMES = (0.0, 0.5, 1.0, 2.0, 2.5, 3.0, 3.5, 4.5, 5.0, 5.5, 6.0, 7.0, 7.5)
CATHETER_SPEEDS = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02, 0.02, 0.0, 0.0, -0.02, -0.02, 0.0)
WIRE_SPEEDS = (0.0, 0.0, 0.03, 0.03, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.02, -0.02, 0.0)
WIRE_TURNS = (0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
HELD = (3, 1, 1, 1, 1, 2, 2, 2, 3, 0, 0, 0, 0)
REST = (0.0,) * (ROWS - len(TIMES))


class OperatorCommand(Component):
    """Operator's speed commands for a catheter and a guidewire: a recording or live input.

    Teleoperation of Al-Ahmad et al. (RACS), section VI, by joystick. Live speeds count while the dead-man switch is pressed
    and they are fresh; else both come to rest at `acceleration`. The recording waits meanwhile, it does not catch up.
    """

    former_names = (("way", "integral"),)

    live = input("", "follow the live command; the recording waits", type=Boolean)
    pressed = input("", "the dead-man switch is pressed", type=Boolean)
    live_speed = input("m/s", "catheter's and wire's speed commanded live, positive distal", shape=(2,), display_unit="mm/s",
                       nominal=0.02)
    live_turn = input("rad/s", "catheter's and wire's rotation speed commanded live", shape=(2,), display_unit="deg/s", nominal=0.5)
    live_held = input("", "held: 0 none, 1 catheter, 2 wire, 3 both", type=Int32, minimum=0, maximum=3)
    live_age = input("s", "age of the live command", display_unit="ms", nominal=0.05)

    catheter_velocity = output("m/s", "wanted speed of the catheter, positive distal", display_unit="mm/s")
    wire_velocity = output("m/s", "wanted speed of the guidewire, positive distal", display_unit="mm/s")
    catheter_reference = output("m", "integral of the catheter's", display_unit="mm")
    wire_reference = output("m", "integral of the wire's", display_unit="mm")
    catheter_angle = output("rad", "wanted angle of the catheter's rig", display_unit="deg")
    wire_angle = output("rad", "wanted angle of the wire's rig", display_unit="deg")
    held = output("", "held: 0 none, 1 catheter, 2 wire, 3 both", type=Int32)
    origin = output("", "0 recording, 1 live, 2 stopped: no live command, 3 the recording is over", type=Int32)
    played = output("s", "time of the recording that has come")

    console = terminal("an operator's console", rule="bus", live=live, pressed=pressed, speed=live_speed, turn=live_turn,
                       held=live_held, age=live_age)

    instant = parameter(TIMES + REST, "s", "of each row, rising", minimum=0.0, source="chosen: recording.py writes others")
    catheter_speed = parameter(CATHETER_SPEEDS + REST, "m/s", "of the catheter at each row, straight between",
                               display_unit="mm/s", source="chosen: below the paper's 40 mm/s")
    wire_speed = parameter(WIRE_SPEEDS + REST, "m/s", "of the wire", display_unit="mm/s", source="as catheter_speed")
    catheter_turn = parameter((0.0,) * ROWS, "rad/s", "turning of the catheter's rig", display_unit="deg/s",
                              source="chosen: none")
    wire_turn = parameter(WIRE_TURNS + REST, "rad/s", "turning of the wire's rig", display_unit="deg/s",
                          source="chosen: below the paper's 72 deg/s")
    hold = parameter(HELD + (0,) * (ROWS - len(HELD)), "", "held from each row to the next: 0 none, 1 catheter, 2 wire, 3 both",
                     type=Int32, minimum=0, maximum=3, source="chosen: an instrument that does not move is held")
    rows = parameter(len(TIMES), "", "rows in use", type=Int32, fixed=True, minimum=2, maximum=ROWS)
    speed_maximum = parameter(0.04, "m/s", "largest speed that is passed on", display_unit="mm/s", minimum=0.0,
                              source="paper, section II.A: insertion at up to 40 mm/s")
    turn_maximum = parameter(1.2566, "rad/s", "largest turning that is passed on", display_unit="deg/s", minimum=0.0,
                             source="paper, section III.D: 14.4 to 72 deg/s")
    acceleration = parameter(0.1, "m/s^2", "at which speed changes: from 40 mm/s it stops within 8 mm", minimum=1e-6,
                             source="chosen: as coaxial_command")
    turn_acceleration = parameter(5.0, "rad/s^2", "the same of turning", display_unit="deg/s^2", minimum=1e-6,
                                  source="as rotation_command")
    timeout = parameter(0.2, "s", "age from which on a live command is none", display_unit="ms", minimum=0.0,
                        source="chosen: ten samples of a joystick at 50 Hz; 8 mm more at 40 mm/s")

    row = local(0, "", "row that has begun last", type=Int32)
    come = local(0.0, "s", "time of the recording that has come")
    wanted = local(0.0, "", "commanded speed of each axis [m/s, rad/s]", shape=(AXES,))
    speed = local(0.0, "", "speed of each axis [m/s, rad/s]", shape=(AXES,))
    integral = local(0.0, "", "its integral [m, rad]", shape=(AXES,))

    def initialize(self) -> None:
        self.row = 0
        self.come = 0.0
        for axis in range(AXES):
            self.wanted[axis] = 0.0
            self.speed[axis] = 0.0
            self.integral[axis] = 0.0
        self.held = self.hold[0]
        self.origin = LIVE if self.live else RECORDING
        publish(self)

    def step(self, t: float, h: float) -> None:
        if self.live:
            listen(self)
        else:
            self.come += h
            play(self)
        follow(self, CATHETER, self.speed_maximum, self.acceleration * h, h)
        follow(self, WIRE, self.speed_maximum, self.acceleration * h, h)
        follow(self, CATHETER_TURN, self.turn_maximum, self.turn_acceleration * h, h)
        follow(self, WIRE_TURN, self.turn_maximum, self.turn_acceleration * h, h)
        publish(self)


def listen(self: OperatorCommand) -> None:
    """Read the live command; zero if the operator releases the dead-man switch, is silent, or sends NaN."""
    for k in range(2):
        self.wanted[CATHETER + k] = self.live_speed[k]
        self.wanted[CATHETER_TURN + k] = self.live_turn[k]
    good = self.pressed and self.live_age <= self.timeout
    for axis in range(AXES):
        good = good and isfinite(self.wanted[axis])
    self.origin = LIVE if good else STOPPED
    self.held = self.live_held if good else BOTH_HELD
    if not good:
        for axis in range(AXES):
            self.wanted[axis] = 0.0


def play(self: OperatorCommand) -> None:
    """Rows of the recording, straight between them; rest behind the last."""
    last = max(min(self.rows, ROWS), 2) - 1
    while self.row < last and self.instant[self.row + 1] <= self.come:
        self.row += 1
    self.held = self.hold[self.row]
    self.origin = RECORDING
    if self.row == last:
        self.origin = OVER
        self.held = BOTH_HELD
        for axis in range(AXES):
            self.wanted[axis] = 0.0
        return
    i = self.row
    length = self.instant[i + 1] - self.instant[i]
    part = min(max((self.come - self.instant[i]) / length, 0.0), 1.0) if length > 0.0 else 0.0
    self.wanted[CATHETER] = self.catheter_speed[i] + part * (self.catheter_speed[i + 1] - self.catheter_speed[i])
    self.wanted[WIRE] = self.wire_speed[i] + part * (self.wire_speed[i + 1] - self.wire_speed[i])
    self.wanted[CATHETER_TURN] = self.catheter_turn[i] + part * (self.catheter_turn[i + 1] - self.catheter_turn[i])
    self.wanted[WIRE_TURN] = self.wire_turn[i] + part * (self.wire_turn[i + 1] - self.wire_turn[i])


def is_held(self: OperatorCommand, axis: int) -> bool:
    """The instrument that an axis moves is held."""
    return self.held == BOTH_HELD or self.held == (CATHETER_HELD if axis in (CATHETER, CATHETER_TURN) else WIRE_HELD)


def follow(self: OperatorCommand, axis: int, most: float, change: float, h: float) -> None:
    """Move the speed of an axis by one step toward its command."""
    goal = 0.0 if is_held(self, axis) else min(max(self.wanted[axis], -most), most)
    before = self.speed[axis]
    self.speed[axis] = before + min(max(goal - before, -change), change)
    self.integral[axis] += 0.5 * h * (before + self.speed[axis])


def publish(self: OperatorCommand) -> None:
    """Outputs from the memory."""
    self.catheter_velocity = self.speed[CATHETER]
    self.wire_velocity = self.speed[WIRE]
    self.catheter_reference = self.integral[CATHETER]
    self.wire_reference = self.integral[WIRE]
    self.catheter_angle = self.integral[CATHETER_TURN]
    self.wire_angle = self.integral[WIRE_TURN]
    self.played = self.come
