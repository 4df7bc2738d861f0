"""Linear servomotor with its drive."""

from math import copysign, exp, floor, sqrt

from fmus.servo import CYCLIC_SYNCHRONOUS_POSITION, CYCLIC_SYNCHRONOUS_TORQUE, driven, follow_velocity, hold_current

from fmus.dead_zone import dead_zone
from twin.component import ERROR, OK, Boolean, Component, Int32, input, local, output, parameter, terminal

# voltage amplitude between two phases for one ampere (rms) through one ohm between them; the same factor is between the
# force constant [N/A] and the amplitude of the back-EMF [V*s/m], since electrical and mechanical power are the same
AMPLITUDE = 0.5 * sqrt(6.0)


class Servomotor(Component):
    """Linear servomotor LM 2070-080-11 that moves a gripper, with cascaded position, velocity and current loops.

    Loop structure of FAULHABER Motion Control; sources of the numbers stand with the parameters.
    The drive samples at `drive_period`; a step that is not a multiple of it ends with ERROR.
    """

    samples_at = "drive_period"

    target_position = input("m", "607Ah, followed in csp", display_unit="mm", nominal=5e-3)
    target_velocity = input("m/s", "60FFh, followed in csv", display_unit="mm/s", nominal=0.05)
    target_force = input("N", "6071h as a force on the rod, followed in cst", nominal=5.0)
    load_force = input("N", "force of the load on the rod, positive distal", nominal=3.0)
    recoil_force = input("N", "force of what moves on the carriage, such as a piston, positive distal", nominal=10.0)
    mode_of_operation = input("", "6060h: 8 csp, 9 csv, 10 cst", start=9, type=Int32, minimum=8, maximum=10)

    position_actual_value = output("m", "6064h, what the Hall sensors measure", display_unit="mm")
    velocity_actual_value = output("m/s", "606Ch, filtered difference of the measured position", display_unit="mm/s")
    position = output("m", "true position of rod and gripper, positive distal", display_unit="mm")
    velocity = output("m/s", "true speed of rod and gripper", display_unit="mm/s")
    current = output("A", "motor current, positive pushes distally")
    force = output("N", "motor force on the rod, positive distal")
    overload = output("", "I2t: mean square of the current over that of the continuous current; 1 is the limit")
    limited = output("", "the current is limited to the continuous current", type=Boolean)

    rod = terminal("mechanical side: the end of the rod", position=position, force=load_force)
    carriage = terminal("the gripper on the rod, also moving", position=position, velocity=velocity, force=load_force)
    drive = terminal(
        "electrical side: what a master on the field bus sees, by CiA 402", rule="bus",
        mode_of_operation=mode_of_operation, target_position=target_position, target_velocity=target_velocity,
        target_force=target_force, position_actual_value=position_actual_value,
        velocity_actual_value=velocity_actual_value, current=current, limited=limited,
    )

    mass = parameter(0.65, "kg", "moved mass", minimum=1e-3,
                     source="estimate: rod 0.15 kg, gripper carriage with cylinder and piston 0.5 kg")
    force_constant = parameter(
        11.64, "N/A", "force per current (rms); the back-EMF follows from it", minimum=1e-6,
        source="LM 2070 datasheet, recalled",
    )
    resistance = parameter(10.83, "ohm", "resistance between two phases", minimum=1e-6,
                           source="LM 2070 datasheet, recalled")
    supply_voltage = parameter(
        24.0, "V", "supply of the power stage", minimum=0.0,
        source="assumed: the paper names neither controllers nor supply; all of FAULHABER's take 24 V",
    )
    current_maximum = parameter(2.37, "A", "peak current", minimum=0.0, source="LM 2070 datasheet, recalled")
    current_continuous = parameter(0.79, "A", "continuous current", minimum=1e-3, source="LM 2070 datasheet, recalled")
    thermal_time = parameter(15.0, "s", "time constant of I2t, that of the winding", minimum=1e-3,
                             source="estimate: 10 to 20 s; peak current lasts 1.8 s")
    overload_release = parameter(0.9, "", "overload below which the peak current is allowed again", minimum=0.0,
                                 maximum=1.0, source="estimate: a setting of the drive")
    current_lag = parameter(
        0.5e-3, "s", "time constant of the closed current loop", display_unit="ms", minimum=1e-6,
        source="estimate: electrical time constant is 0.1 ms",
    )
    friction_coulomb = parameter(
        1.5, "N", "dry friction of sleeve bearing and guide", minimum=0.0,
        source="estimate: 0.3 to 0.6 N bearing, 1 to 2 N guide",
    )
    friction_viscous = parameter(2.0, "N*s/m", "viscous friction", minimum=0.0, source="estimate: 1 to 3 N s/m")
    stroke = parameter(0.08, "m", "travel between the end stops, about zero", display_unit="mm", minimum=0.0,
                       source="type code -080-")
    position_resolution = parameter(
        8e-6, "m", "smallest step of the Hall sensors", display_unit="um", minimum=1e-9,
        source="3000 increments per pitch of 24 mm",
    )
    drive_period = parameter(0.5e-3, "s", "sampling time of the loops", display_unit="ms", minimum=1e-5, fixed=True,
                             source="estimate: a setting of the drive")
    velocity_lag = parameter(2e-3, "s", "time constant of the velocity filter", display_unit="ms", minimum=0.0,
                             source="estimate: a setting of the drive")
    velocity_gain = parameter(14.0, "A*s/m", "proportional gain of the velocity loop", minimum=0.0,
                              source="chosen: mass * 250 rad/s / force_constant, a 40 Hz loop")
    velocity_integral = parameter(875.0, "A/m", "integral gain of the velocity loop", minimum=0.0,
                                  source="chosen: velocity_gain * 250 rad/s / 4")
    position_gain = parameter(50.0, "1/s", "gain of the position loop", minimum=0.0,
                              source="chosen: 250 rad/s / 5")
    velocity_maximum = parameter(1.0, "m/s", "limit of the velocity demand", minimum=0.0, display_unit="mm/s",
                                 source="estimate: a setting of the drive")

    rod_position = local(0.0, "m", "position of the rod", display_unit="mm")
    rod_velocity = local(0.0, "m/s", "speed of the rod", display_unit="mm/s")
    winding_current = local(0.0, "A", "current in the winding")
    measured_position = local(0.0, "m", "position of the last sample", display_unit="mm")
    measured_velocity = local(0.0, "m/s", "filtered speed of the last sample", display_unit="mm/s")
    heating = local(0.0, "", "I2t: mean square of the current over that of the continuous current")
    cut = local(False, "", "the limit is the continuous current")
    current_integral = local(0.0, "A", "integral part of the current demand")

    def initialize(self) -> None:
        # at rest at the target, so that csp does not begin with a jump
        self.rod_position = self.target_position
        self.rod_velocity = 0.0
        self.winding_current = 0.0
        self.measured_position = counted(self.target_position, self.position_resolution)
        self.measured_velocity = 0.0
        self.current_integral = 0.0
        self.heating = 0.0
        self.cut = False
        publish(self)

    def step(self, t: float, h: float) -> int:
        samples = floor(h / self.drive_period + 0.5)
        if samples < 1 or abs(samples * self.drive_period - h) > 1e-6 * self.drive_period:
            return ERROR
        if not CYCLIC_SYNCHRONOUS_POSITION <= self.mode_of_operation <= CYCLIC_SYNCHRONOUS_TORQUE:
            return ERROR
        for _ in range(samples):
            move(self, sample(self))
        publish(self)
        return OK


def publish(self: Servomotor) -> None:
    """Copy the state to the outputs, so that overriding an output does not move the rod."""
    self.position = self.rod_position
    self.velocity = self.rod_velocity
    self.position_actual_value = self.measured_position
    self.velocity_actual_value = self.measured_velocity
    self.current = self.winding_current
    self.force = self.force_constant * self.winding_current
    self.overload = min(self.heating, 1.0)
    self.limited = self.cut


def counted(position: float, resolution: float) -> float:
    """Position as whole increments of the sensor [m]."""
    return resolution * floor(position / resolution + 0.5)


def sample(self: Servomotor) -> float:
    """One sample of the drive: measure, then the loops of the mode; returns the current demand [A]."""
    period = self.drive_period
    measured = counted(self.rod_position, self.position_resolution)
    rate = (measured - self.measured_position) / period
    self.measured_velocity += period / (period + self.velocity_lag) * (rate - self.measured_velocity)
    self.measured_position = measured

    limit = current_limit(self)
    top, back = stall_current(self), back_current(self) * self.rod_velocity
    if self.mode_of_operation == CYCLIC_SYNCHRONOUS_TORQUE:
        return hold_current(self, self.target_force / self.force_constant, limit, top, back)
    velocity = self.target_velocity
    if self.mode_of_operation == CYCLIC_SYNCHRONOUS_POSITION:
        velocity = self.position_gain * (self.target_position - measured)
    return follow_velocity(self, velocity, limit, top, back)


def stall_current(self: Servomotor) -> float:
    """Current that the supply drives through two phases at standstill [A]."""
    return self.supply_voltage / (AMPLITUDE * self.resistance)


def back_current(self: Servomotor) -> float:
    """Current that the back-EMF of one meter per second drives through two phases [A*s/m]."""
    return self.force_constant / (AMPLITUDE * AMPLITUDE * self.resistance)


def current_limit(self: Servomotor) -> float:
    """I2t: peak current until the winding is as warm as continuous current makes it, then that, until it has cooled."""
    share = self.winding_current / self.current_continuous
    load = share * share
    self.heating += self.drive_period / self.thermal_time * (load - self.heating)
    if self.heating >= 1.0:
        self.cut = True
    elif self.heating < self.overload_release:
        self.cut = False
    return min(self.current_continuous, self.current_maximum) if self.cut else self.current_maximum


def move(self: Servomotor, demand: float) -> None:
    """Current and rod over one drive sample: 5 substeps, semi-implicit, with an exact test for sticking."""
    substeps = 5
    dt = self.drive_period / substeps
    decay = exp(-dt / self.current_lag)

    # speed that a newton gives in a substep [m/s], what viscous friction leaves of it, and what dry friction takes at most
    push = dt / self.mass
    left = 1.0 / (1.0 + push * self.friction_viscous)
    braking = push * self.friction_coulomb
    end = 0.5 * self.stroke
    top, back = stall_current(self), back_current(self)
    for _ in range(substeps):
        current = demand + (self.winding_current - demand) * decay
        self.winding_current = driven(current, top, back * self.rod_velocity)
        force = self.force_constant * self.winding_current + self.load_force + self.recoil_force
        v = dead_zone(left * (self.rod_velocity + push * force), braking)
        x = self.rod_position + dt * v
        if abs(x) > end:
            x = copysign(end, x)
            v = 0.0
        self.rod_velocity = v
        self.rod_position = x
