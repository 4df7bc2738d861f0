"""Rotary drive of the frame."""

from math import exp, floor, pi

from fmus.servo import CYCLIC_SYNCHRONOUS_POSITION, CYCLIC_SYNCHRONOUS_TORQUE, driven, follow_velocity, hold_current

from fmus.dead_zone import dead_zone
from twin.component import ERROR, OK, Component, Int32, input, local, output, parameter, terminal

# substeps of the mechanics per sample of the drive
SUBSTEPS = 10


class RotaryDrive(Component):
    """Brushless motor EC-i 40 that turns the whole rig through a spur gear, with cascaded loops like an EPOS4's.

    Motor and frame are two bodies with the gear's backlash between them; the encoder sits on the motor, so what the drive
    calls its position is the frame's only to within the backlash. Angles of the drive are in units of the frame, torques
    of the drive those of the motor.
    A step that is not a multiple of `drive_period` ends with ERROR.
    """

    samples_at = "drive_period"

    target_position = input("rad", "607Ah, followed in csp", display_unit="deg", nominal=0.5)
    target_velocity = input("rad/s", "60FFh, followed in csv", display_unit="deg/s", nominal=1.0)
    target_torque = input("N*m", "6071h as a torque of the motor, before the gear, followed in cst", nominal=0.2)
    load_torque = input("N*m", "torque of the load on the frame", nominal=3e-3)
    mode_of_operation = input("", "6060h: 8 csp, 9 csv, 10 cst", start=8, type=Int32, minimum=8, maximum=10)

    position_actual_value = output("rad", "6064h, the encoder's angle over the gear ratio", display_unit="deg")
    velocity_actual_value = output("rad/s", "606Ch, filtered difference of the measured angle", display_unit="deg/s")
    motor_angle = output("rad", "true angle of the motor", display_unit="deg")
    angle = output("rad", "true angle of the frame", display_unit="deg")
    angular_velocity = output("rad/s", "true speed of the frame", display_unit="deg/s")
    current = output("A", "motor current")
    torque = output("N*m", "torque of the motor")

    frame = terminal(
        "the frame that it turns", angle=angle, angular_velocity=angular_velocity, torque=load_torque,
    )

    motor_inertia = parameter(
        2.4e-5, "kg*m^2", "inertia of rotor and pinion", minimum=1e-9,
        source="rotor 44 g cm2, maxon 488607, public model list; pinion 0.1 kg, radius 20 mm: estimate",
    )
    frame_inertia = parameter(
        0.0125, "kg*m^2", "inertia of the frame with all that it carries", minimum=1e-9,
        source="estimate: 5 kg (two servomotors, two carriages, guide, plate) at a radius of 50 mm",
    )
    gear_ratio = parameter(5.0, "", "motor turns per turn of the frame", minimum=1e-3,
                           source="estimate: not published")
    backlash = parameter(
        2e-3, "rad", "backlash of the gear, at the frame", display_unit="deg", minimum=0.0,
        source="estimate: 0.15 mm at a ring of 80 mm radius, polymer teeth",
    )
    mesh_stiffness = parameter(640.0, "N*m/rad", "stiffness of the teeth in contact, at the frame", minimum=0.0,
                               source="estimate: 0.1 N/um at a radius of 80 mm")
    mesh_damping = parameter(0.15, "N*m*s/rad", "damping of the teeth in contact, at the frame", minimum=0.0,
                             source="estimate: a tenth of critical with the motor, polymer")
    friction_coulomb = parameter(
        0.5, "N*m", "dry friction of the slewing ring", minimum=0.0,
        source="estimate: 5 kg on a polymer ring, 0.2 at a radius of 50 mm",
    )
    friction_viscous = parameter(0.02, "N*m*s/rad", "viscous friction of the frame", minimum=0.0,
                                 source="estimate: small beside dry friction")
    motor_friction = parameter(14e-3, "N*m", "dry friction of the motor", minimum=0.0,
                               source="no-load current 0.15 A, maxon 488607, public model list")
    torque_constant = parameter(
        0.091, "N*m/A", "torque per current; in V*s/rad the back-EMF constant", minimum=1e-6,
        source="maxon 488607 (48 V) in place of the 130 W motor, public model list",
    )
    resistance = parameter(0.994, "ohm", "resistance between two phases", minimum=1e-6,
                           source="maxon 488607, public model list")
    supply_voltage = parameter(
        24.0, "V", "supply of the power stage", minimum=0.0,
        source="assumed: that of the servomotors; the motor's nominal voltage is 48 V, an EPOS4 50/5 takes 10 to 50 V",
    )
    current_maximum = parameter(5.0, "A", "limit of the current demand", minimum=0.0,
                                source="chosen: nominal output of an EPOS4 50/5, twice the motor's 2.41 A")
    current_lag = parameter(0.3e-3, "s", "time constant of the closed current loop", display_unit="ms", minimum=1e-6,
                            source="estimate: loop at 25 kHz, winding 1 ms")
    encoder_counts = parameter(4096.0, "", "increments per turn of the motor", minimum=1.0,
                               source="estimate: encoder of 1024 pulses")
    drive_period = parameter(0.5e-3, "s", "sampling time of the loops", display_unit="ms", minimum=1e-5, fixed=True,
                             source="EPOS4 samples at 0.4 ms, recalled; 0.5 divides a step")
    velocity_lag = parameter(5e-3, "s", "time constant of the velocity filter", display_unit="ms", minimum=0.0,
                             source="chosen: a count per sample is 3 rad/s of the motor")
    velocity_gain = parameter(
        1.5, "A*s/rad", "proportional gain of the velocity loop, at the frame", minimum=0.0,
        source="chosen: 50 rad/s with the frame; the motor alone, in the backlash, stays stable",
    )
    velocity_integral = parameter(20.0, "A/rad", "integral gain of the velocity loop, at the frame", minimum=0.0,
                                  source="chosen: velocity_gain * 50 rad/s / 4")
    position_gain = parameter(12.0, "1/s", "gain of the position loop", minimum=0.0,
                              source="chosen: 50 rad/s / 4")
    feedforward = parameter(1.0, "", "part of the target's speed that is fed forward in csp", minimum=0.0,
                            source="chosen: all of it")
    velocity_maximum = parameter(10.0, "rad/s", "limit of the velocity demand", display_unit="deg/s", minimum=0.0,
                                 source="chosen: eight times the paper's largest speed")

    rotor_angle = local(0.0, "rad", "angle of the motor", display_unit="deg")
    rotor_velocity = local(0.0, "rad/s", "speed of the motor", display_unit="deg/s")
    frame_angle = local(0.0, "rad", "angle of the frame", display_unit="deg")
    frame_velocity = local(0.0, "rad/s", "speed of the frame", display_unit="deg/s")
    winding_current = local(0.0, "A", "current in the winding")
    measured_angle = local(0.0, "rad", "angle of the last sample, at the frame", display_unit="deg")
    measured_velocity = local(0.0, "rad/s", "filtered speed of the last sample", display_unit="deg/s")
    current_integral = local(0.0, "A", "integral part of the current demand")
    target_last = local(0.0, "rad", "target of the step before", display_unit="deg")
    following = local(False, "", "the step before followed its target position")

    def initialize(self) -> None:
        # at rest at the target, in the middle of the backlash
        self.rotor_angle = self.gear_ratio * self.target_position
        self.rotor_velocity = 0.0
        self.frame_angle = self.target_position
        self.frame_velocity = 0.0
        self.winding_current = 0.0
        self.measured_angle = counted(self)
        self.measured_velocity = 0.0
        self.current_integral = 0.0
        self.target_last = self.target_position
        self.following = True
        publish(self)

    def step(self, t: float, h: float) -> int:
        samples = floor(h / self.drive_period + 0.5)
        if samples < 1 or abs(samples * self.drive_period - h) > 1e-6 * self.drive_period:
            return ERROR
        if not CYCLIC_SYNCHRONOUS_POSITION <= self.mode_of_operation <= CYCLIC_SYNCHRONOUS_TORQUE:
            return ERROR
        # a target that was not followed has no speed
        speed = (self.target_position - self.target_last) / h if self.following else 0.0
        self.target_last = self.target_position
        self.following = self.mode_of_operation == CYCLIC_SYNCHRONOUS_POSITION
        for _ in range(samples):
            move(self, sample(self, speed))
        publish(self)
        return OK


def publish(self: RotaryDrive) -> None:
    """Copy the state to the outputs, so that overriding an output does not turn the frame."""
    self.position_actual_value = self.measured_angle
    self.velocity_actual_value = self.measured_velocity
    self.motor_angle = self.rotor_angle
    self.angle = self.frame_angle
    self.angular_velocity = self.frame_velocity
    self.current = self.winding_current
    self.torque = self.torque_constant * self.winding_current


def counted(self: RotaryDrive) -> float:
    """Return the frame angle [rad] measured by the motor encoder."""
    increment = 2.0 * pi / self.encoder_counts
    return increment * floor(self.rotor_angle / increment + 0.5) / self.gear_ratio


def sample(self: RotaryDrive, target_speed: float) -> float:
    """One sample of the drive: measure, then the loops of the mode; returns the current demand [A]."""
    period = self.drive_period
    measured = counted(self)
    rate = (measured - self.measured_angle) / period
    self.measured_velocity += period / (period + self.velocity_lag) * (rate - self.measured_velocity)
    self.measured_angle = measured

    limit = self.current_maximum
    top, back = self.supply_voltage / self.resistance, self.torque_constant / self.resistance * self.rotor_velocity
    if self.mode_of_operation == CYCLIC_SYNCHRONOUS_TORQUE:
        return hold_current(self, self.target_torque / self.torque_constant, limit, top, back)
    velocity = self.target_velocity
    if self.mode_of_operation == CYCLIC_SYNCHRONOUS_POSITION:
        velocity = self.position_gain * (self.target_position - measured) + self.feedforward * target_speed
    return follow_velocity(self, velocity, limit, top, back)


def mesh_torque(self: RotaryDrive) -> float:
    """Torque of the pinion on the frame [N*m]: teeth press, they do not pull."""
    gearing = 1.0 / self.gear_ratio
    gap = gearing * self.rotor_angle - self.frame_angle
    rate = gearing * self.rotor_velocity - self.frame_velocity
    half = 0.5 * self.backlash
    if gap > half:
        return max(self.mesh_stiffness * (gap - half) + self.mesh_damping * rate, 0.0)
    if gap < -half:
        return min(self.mesh_stiffness * (gap + half) + self.mesh_damping * rate, 0.0)
    return 0.0


def move(self: RotaryDrive, demand: float) -> None:
    """Current, motor and frame over one drive sample: semi-implicit substeps with an exact test for sticking."""
    dt = self.drive_period / SUBSTEPS
    decay = exp(-dt / self.current_lag)
    top, back = self.supply_voltage / self.resistance, self.torque_constant / self.resistance

    # speed that a newton meter gives in a substep [rad/s], what viscous friction leaves, and what dry friction takes at most
    push, frame_push = dt / self.motor_inertia, dt / self.frame_inertia
    left = 1.0 / (1.0 + frame_push * self.friction_viscous)
    braking, frame_braking = push * self.motor_friction, frame_push * self.friction_coulomb
    gearing = 1.0 / self.gear_ratio
    for _ in range(SUBSTEPS):
        current = demand + (self.winding_current - demand) * decay
        self.winding_current = driven(current, top, back * self.rotor_velocity)
        mesh = mesh_torque(self)
        drive = self.torque_constant * self.winding_current - gearing * mesh
        self.rotor_velocity = dead_zone(self.rotor_velocity + push * drive, braking)
        speed = left * (self.frame_velocity + frame_push * (mesh + self.load_torque))
        self.frame_velocity = dead_zone(speed, frame_braking)
        self.rotor_angle += dt * self.rotor_velocity
        self.frame_angle += dt * self.frame_velocity
