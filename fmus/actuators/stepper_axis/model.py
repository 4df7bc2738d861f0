"""Stepper motor with driver and mechanical slide."""

from math import ceil, floor, pi, sin, sqrt

from fmus.injection import wander
from fmus.noisy import Noisy, noise_seed
from twin.component import Boolean, Int64, input, local, normal, output, parameter, seed_stream, terminal

SUBSTEP = 50e-6  # longest step of the rotor's motion [s]; it swings at about 300 Hz
FULL_STEPS = 200  # per revolution
PERIOD = 4  # full steps in one period of the torque


class StepperAxis(Noisy):
    """NEMA 17 stepper with TB6600 driver and pulse generator on a leadscrew slide; moves to `target_steps` autonomously.

    Cheng and Law (paper B), calibration of stepper motors. A step is a pulse, 1/1600 of a revolution. The rotor is held
    by a torque with a period of 4 full steps, so an overload loses steps in whole multiples of 4 full steps.
    """

    former_names = (("place", "slide_position"),)

    # a pull wire is paid out as far as the opposite one is pulled: 9 mm
    target_steps = input("", "position to go to, in pulses", start=0, type=Int64, minimum=-2000)
    step_rate = input("Hz", "programmed speed, pulses per second", start=1000.0, minimum=1.0, nominal=500.0)
    load_force = input("N", "force on the slide, positive in its positive direction", nominal=5.0)

    position = output("m", "position of the slide", display_unit="mm")
    velocity = output("m/s", "speed of the slide", display_unit="mm/s")
    step_count = output("", "pulses sent: the position by the step counter", type=Int64)
    lost_steps = output("", "pulses that the rotor did not follow, whole multiples of 4 full steps", type=Int64)
    moving = output("", "whether pulses are being sent", type=Boolean)

    slide = terminal("the slide", position=position, force=load_force)

    microsteps = parameter(8, "", "pulses per full step", type=Int64, fixed=True, minimum=1,
                           source="paper, assembly of the prototype")
    rate_maximum = parameter(4000.0, "Hz", "highest pulse rate of the program", minimum=1.0,
                             source="AccelStepper on a 16 MHz Arduino, recalled; the paper says only that speed falls short")
    acceleration = parameter(4.0e4, "Hz/s", "change of the pulse rate", minimum=1.0,
                             source="estimate: 0.1 s to the highest rate")
    lead = parameter(7.7e-3, "m", "travel per revolution", display_unit="mm", minimum=0.0,
                     source="paper, stepper motor speed and revolution distance; 8.0 mm nominal")
    lead_deviation = parameter(
        0.018e-3, "m", "standard deviation of the lead from run to run", display_unit="mm", minimum=0.0,
        source="paper: 0.081 mm over 10 speeds in 2 directions, so the mean of 20 is known to 0.081 / sqrt(20)",
    )
    position_deviation = parameter(
        0.052e-3, "m", "standard deviation of the slide about its lead", display_unit="mm", minimum=0.0,
        source="paper: 0.081 mm per revolution, of two ends, less 0.03 mm of the camera at each",
    )
    correlation_length = parameter(2e-3, "m", "travel over which that deviation changes", display_unit="mm", minimum=1e-6,
                                   source="estimate: a quarter of the thread's lead")
    torque_holding = parameter(0.4, "N*m", "largest torque of the standing motor", minimum=0.0,
                               source="estimate: NEMA 17 at 1.2 to 1.5 A, 0.28 to 0.45 N m")
    rate_corner = parameter(1.2e4, "Hz", "pulse rate above which the torque falls", minimum=1.0,
                            source="estimate: 450 rpm at 24 V, range 300 to 600")
    inertia = parameter(5e-6, "kg*m^2", "rotor, coupling, screw and slide", minimum=1e-9,
                        source="estimate: rotor 35 to 55 g cm2, slide 0.3 kg on a lead of 8 mm")
    damping = parameter(3e-3, "N*m*s", "torque per speed against the field", minimum=0.0,
                        source="estimate: a seventh of critical")
    friction = parameter(3.0, "N", "dry friction of the slide", minimum=0.0,
                         source="estimate: ball bearings and a spring-loaded nut")
    efficiency = parameter(0.4, "", "of the leadscrew", minimum=0.05, maximum=1.0,
                           source="estimate: steel on plastic, 8 mm lead")
    seed = noise_seed(12, "lead and deviation")

    pulse_rate = local(0.0, "Hz", "pulses per second, with the direction's sign")
    pulse_part = local(0.0, "", "part of the next pulse that is over")
    pulses = local(0, "", "pulses sent", type=Int64)
    slide_position = local(0.0, "m", "position of the slide", display_unit="mm")
    rotor = local(0.0, "rad", "angle of the rotor")
    rotor_speed = local(0.0, "rad/s", "speed of the rotor")
    own_lead = local(0.0, "m", "travel per revolution in this run", display_unit="mm")
    deviation = local(
        0.0, "", "position less what the lead gives, in standard deviations: last, behind a lag", shape=(2,)
    )

    def initialize(self) -> None:
        seed_stream(self.stream, self.seed)
        self.own_lead = self.lead + self.lead_deviation * normal(self.stream)
        self.pulses = self.target_steps
        self.step_count = self.pulses
        self.rotor = self.pulses * 2.0 * pi / (FULL_STEPS * self.microsteps)
        self.rotor_speed = 0.0
        self.pulse_rate = 0.0
        self.pulse_part = 0.0
        self.deviation[0] = 0.0
        self.deviation[1] = 0.0
        self.slide_position = self.own_lead * self.rotor / (2.0 * pi)
        self.position = self.slide_position
        self.velocity = 0.0
        self.lost_steps = 0
        self.moving = False

    def step(self, t: float, h: float) -> None:
        count = ceil(h / SUBSTEP - 1e-9)
        before = self.rotor
        for _ in range(count):
            send_pulses(self, h / count)
            turn_rotor(self, h / count)

        # the deviation changes with the way, not with time: a slide that stands keeps its own
        travel = self.own_lead * abs(self.rotor - before) / (2.0 * pi)
        wander(self.deviation, self.stream, travel, self.correlation_length)

        per_radian = self.own_lead / (2.0 * pi)
        slide_position = per_radian * self.rotor + self.position_deviation * self.deviation[1]
        self.velocity = (slide_position - self.slide_position) / h
        self.slide_position = slide_position
        self.position = slide_position
        self.step_count = self.pulses
        pulses_per_slip = PERIOD * self.microsteps
        behind = self.pulses - self.rotor * FULL_STEPS * self.microsteps / (2.0 * pi)
        self.lost_steps = pulses_per_slip * floor(behind / pulses_per_slip + 0.5)
        self.moving = self.pulses != self.target_steps


def send_pulses(self: StepperAxis, h: float) -> None:
    """The program: accelerate to the programmed rate, slow down for the target."""
    left = self.target_steps - self.pulses
    limit = min(self.step_rate, self.rate_maximum)
    wanted = min(limit, sqrt(2.0 * self.acceleration * abs(left)))
    if left < 0:
        wanted = -wanted
    change = self.acceleration * h
    self.pulse_rate += min(max(wanted - self.pulse_rate, -change), change)
    self.pulse_part += self.pulse_rate * h
    while self.pulse_part >= 1.0:
        self.pulse_part -= 1.0
        self.pulses += 1
    while self.pulse_part <= -1.0:
        self.pulse_part += 1.0
        self.pulses -= 1
    if self.pulses == self.target_steps and abs(self.pulse_rate) <= 2.0 * sqrt(2.0 * self.acceleration):
        self.pulse_rate = 0.0
        self.pulse_part = 0.0


def turn_rotor(self: StepperAxis, h: float) -> None:
    """The rotor between the field and its load, with exact sticking."""
    per_pulse = 2.0 * pi / (FULL_STEPS * self.microsteps)
    strength = self.torque_holding * min(1.0, self.rate_corner / max(abs(self.pulse_rate), 1.0))
    torque = strength * sin(0.25 * FULL_STEPS * (self.pulses * per_pulse - self.rotor))
    torque += self.damping * (self.pulse_rate * per_pulse - self.rotor_speed)

    per_radian = self.own_lead / (2.0 * pi)
    torque += self.load_force * per_radian
    friction = per_radian * (self.friction + abs(self.load_force) * (1.0 / self.efficiency - 1.0))
    speed = self.rotor_speed + h * torque / self.inertia
    lost = h * friction / self.inertia
    self.rotor_speed = max(speed - lost, 0.0) if speed > 0.0 else min(speed + lost, 0.0)
    self.rotor += h * self.rotor_speed
