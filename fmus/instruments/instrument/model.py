"""Instrument between two grippers, in its guiding sheath."""

from math import ceil, exp, pi

from fmus.gripped_instrument import GRIPPERS, GrippedInstrument
from fmus.instrument.elimination import begin, eliminate, update_active_set
from fmus.instrument.gauss_seidel import count_slip, holds, sweep

from twin.component import input, local, output, parameter, terminal

# nodes: at the grippers, at the sheath's valve, at the end of bend 1, at the end of bend 2 (the tip)
NODES = 4
TIP = NODES - 1
SECTIONS = NODES - 1

SUBSTEP = 1e-4  # longest substep [s]


class Instrument(GrippedInstrument):
    """Catheter or guidewire: axial and torsional chains of overdamped nodes, gripped by two sleeves, in a sheath.

    Geometry of Al-Ahmad et al. (RACS), Fig. 3E: a straight part, then two opposite bends of 90 deg, radius 50 mm.
    Friction, play and drag of a section switch on as the tip passes it. Defaults are the 8 Fr catheter.
    Each substep is implicit and minimizes its energy: stable and passive at any stiffness, exact in sticking.
    """

    tip_force = input("N", "force on the tip, positive proximal: pushes the instrument back", nominal=0.5)
    tip_torque = input("N*m", "torque on the tip, positive against positive angles", display_unit="mN*m", nominal=1e-3)

    proximal_position = output("m", "position of the instrument at the grippers, 0 at the start", display_unit="mm")
    tip_position = output("m", "position of the tip along the path, 0 at the start", display_unit="mm")
    tip_velocity = output("m/s", "speed of the tip", display_unit="mm/s")
    proximal_angle = output("rad", "angle of the instrument at the grippers", display_unit="deg")
    tip_angle = output("rad", "angle of the tip", display_unit="deg")
    insertion_depth = output("m", "length of the instrument beyond the sheath's valve", display_unit="mm")
    slip_distance = output("m", "slip of the instrument in each gripper, positive distal", shape=(GRIPPERS,),
                           display_unit="mm")
    slip_angle = output("rad", "slip of the instrument in each gripper", shape=(GRIPPERS,), display_unit="deg")
    slipping = output("", "whether it slipped in a gripper during the last step", start=(False,) * GRIPPERS)
    free_length = output("m", "unsupported length that buckles first", display_unit="mm")
    free_length_force = output("N", "compression between gripper and sheath, negative: tension")
    buckling_load = output("N", "compression at which the free length buckles")
    buckled = output("", "whether the free length has buckled: compression is at the buckling load", start=False)

    tip = terminal(
        "tip in the sheath", rule="bus", position=insertion_depth, angle=tip_angle, force=tip_force, torque=tip_torque,
    )

    stiffness = parameter(
        (4.4e3, 12.0e3, 12.0e3), "N/m", "axial stiffness up to each node beyond the grippers", display_unit="N/mm",
        minimum=1.0,
        source="sheath: 4.4 N/mm of shaft and 4.4 of the grip in series are its identified 2.2 N/mm; bends as there",
    )
    play = parameter(
        (0.0, 0.3e-3, 0.3e-3), "m", "axial play of each section", display_unit="mm", minimum=0.0,
        source="clearance 0.19 mm (8 Fr in 2.86 mm) times pi/2 per bend",
    )
    friction = parameter(
        (0.6, 0.8, 0.8), "N", "friction of the valve and of each bend without thrust", minimum=0.0,
        source="as sheath, estimate: sum an order of magnitude above the contact force, as the paper says",
    )
    wrap = parameter((0.0, pi / 2, pi / 2), "rad", "angle a section is bent by", display_unit="deg", minimum=0.0,
                     source="paper, section II.C: sheath path")
    friction_coefficient = parameter(0.15, "", "friction per normal force in the bends", minimum=0.0,
                                     source="estimate: 0.05 to 0.2")
    drag = parameter(
        (6.0, 3.0, 3.0), "N*s/m", "viscous friction of each section", minimum=0.0,
        source="as sheath, estimate: a fifth of the dry friction at 40 mm/s",
    )
    drag_free = parameter(0.5, "N*s/m", "viscous friction of each node outside of the sheath", minimum=1e-3,
                          source="estimate: small beside `drag`; sets how fast an overloaded instrument slips")
    radius = parameter(1.335e-3, "m", "radius of the instrument", display_unit="mm", minimum=0.0,
                       source="8 Fr is 2.67 mm")
    torsional_stiffness = parameter(
        (8.7e-3, 46.5e-3, 46.5e-3), "N*m/rad", "torsional stiffness up to each node", minimum=1e-9,
        source="GJ 3.65e-3 N m2 over 0.42 m and 78.5 mm; GJ identified from the paper's 25 deg, given that dry friction "
        "acts at the radius; plausible without braid: 0.3 to 3e-3 N m2",
    )
    torsional_drag = parameter(2e-6, "N*m*s/rad", "viscous friction torque of each node", minimum=1e-12,
                               source="estimate: a four-hundredth of the dry friction at 72 deg/s")
    section_length = parameter(
        (0.343, 78.5e-3, 78.5e-3), "m", "straight part and bends of the sheath; 0: there is no such section",
        display_unit="mm", minimum=0.0, source="paper: radius 50 mm, 90 deg; straight part: estimate, 500 mm in all",
    )
    valve_length = parameter(5e-3, "m", "depth over which the valve closes on the tip", display_unit="mm", minimum=1e-6,
                             source="estimate: hemostasis valve")
    initial_insertion = parameter(0.5, "m", "insertion depth at the start", display_unit="mm", fixed=True,
                                  source="chosen: fully inserted, as in the paper's section III.D")
    bending_stiffness = parameter(2e-3, "N*m^2", "bending stiffness EI of the free length", minimum=0.0,
                                  source="estimate: 1 to 3e-3 for an 8 Fr shaft")
    end_factor = parameter(
        (0.5, 0.7), "", "buckling length per free length: between the sleeves, from the second sleeve to the sheath",
        minimum=0.1, source="estimate: 0.5 both ends clamped, as sleeves do; the valve guides but does not clamp: 0.7",
    )
    entry_distance = parameter(
        (0.17, 0.04), "m", "from the distal end of each sleeve at mid-stroke to the sheath", display_unit="mm",
        source="estimate: half a stroke and 15 mm; carriages 130 mm apart, as in the regripping sequencer",
    )
    sleeve_length = parameter(0.06, "m", "length that the second sleeve supports also when open", display_unit="mm",
                              minimum=0.0, source="estimate: as braided sleeve")
    grip_least = parameter(0.5, "N", "limit below which a gripper is open, and moving in it is no slip", minimum=0.0,
                           source="chosen: a tenth of the force that the paper requires")

    position = local(0.0, "m", "displacement of each node", shape=(NODES,), display_unit="mm")
    angle = local(0.0, "rad", "angle of each node", shape=(NODES,), display_unit="deg")
    position_last = local(0.0, "m", "displacement before the substep", shape=(NODES,), display_unit="mm")
    angle_last = local(0.0, "rad", "angle before the substep", shape=(NODES,), display_unit="deg")
    thrust = local(0.0, "N", "compression before each node, last: at the tip", shape=(NODES + 1,))
    twist_torque = local(0.0, "N*m", "torque passed on to each node, last: to the load", shape=(NODES + 1,))
    engagement = local(0.0, "", "part of each section that the tip has passed", shape=(SECTIONS,))
    half_play = local(0.0, "m", "play to either side of each section", shape=(SECTIONS,), display_unit="mm")
    viscous = local(0.0, "N*s/m", "viscous friction of each section with its node", shape=(SECTIONS,))
    dry = local(0.0, "N", "dry friction of each section without thrust", shape=(SECTIONS,))
    capstan = local(0.0, "", "friction per sum of the thrusts on both sides", shape=(SECTIONS,))
    section_state = local(0.0, "", "-1 pulled, 0 within its play, 1 pressed, 2 buckled", shape=(SECTIONS,))
    slide = local(0.0, "", "which way the node behind each section slides, 0: it sticks", shape=(SECTIONS,))
    turn = local(0.0, "", "the same in torsion", shape=(SECTIONS,))
    spring = local(0.0, "N/m", "stiffness of each section as it is", shape=(SECTIONS,))
    per_thrust = local(0.0, "m/N", "motion of the node behind each section per thrust of it", shape=(SECTIONS,))
    per_load = local(0.0, "m/N", "the same per thrust behind the node, against it", shape=(SECTIONS,))
    per_friction = local(0.0, "m", "the same by dry friction, against it", shape=(SECTIONS,))
    along = local(0.0, "", "the same per motion of the node before the section", shape=(SECTIONS,))
    passed_load = local(0.0, "", "part of the thrust behind the node that acts on the section", shape=(SECTIONS,))
    passed_friction = local(0.0, "N", "the same of dry friction", shape=(SECTIONS,))
    per_torque = local(0.0, "rad/(N*m)", "the same in torsion, per torque", shape=(SECTIONS,))
    along_angle = local(0.0, "", "the same in torsion, per rotation of the node before the section", shape=(SECTIONS,))
    per_push = local(0.0, "m/N", "motion of the first node per force on it")
    per_turn = local(0.0, "rad/(N*m)", "the same in torsion")
    valve_closure = local(0.0, "", "part of the valve's friction that acts")
    carriage_position = local(0.0, "m", "gripper positions of the substep", shape=(GRIPPERS,), display_unit="mm")
    frame_angle = local(0.0, "rad", "frame angle of the substep", display_unit="deg")
    deflection = local(0.0, "m", "elastic deflection of each grip, positive pushes distally", shape=(GRIPPERS,))
    twist = local(0.0, "rad", "elastic twist of each grip", shape=(GRIPPERS,))
    stiffness_last = local(0.0, "N/m", "grip stiffness of the step before", shape=(GRIPPERS,))
    torsional_stiffness_last = local(0.0, "N*m/rad", "the same in torsion", shape=(GRIPPERS,))
    grip_force = local(0.0, "N", "force of each gripper on the instrument", shape=(GRIPPERS,))
    grip_torque = local(0.0, "N*m", "torque of each gripper on the instrument", shape=(GRIPPERS,))

    slipped = local(0.0, "m", "slip in each gripper so far", shape=(GRIPPERS,), display_unit="mm")
    slipped_angle = local(0.0, "rad", "the same in rotation", shape=(GRIPPERS,), display_unit="deg")

    def initialize(self) -> None:
        for g in range(GRIPPERS):
            self.carriage_position[g] = self.gripper_position[g]
            self.stiffness_last[g] = self.grip_stiffness[g]
            self.torsional_stiffness_last[g] = self.grip_torsional_stiffness[g]
            self.deflection[g] = 0.0
            self.twist[g] = 0.0
            self.grip_force[g] = 0.0
            self.grip_torque[g] = 0.0
            self.slipped[g] = 0.0
            self.slipped_angle[g] = 0.0
            self.slipping[g] = False
        self.frame_angle = self.gripper_angle
        for i in range(NODES):
            self.position[i] = 0.0
            self.angle[i] = self.gripper_angle
            self.position_last[i] = self.position[i]
            self.angle_last[i] = self.angle[i]
            self.thrust[i] = 0.0
            self.twist_torque[i] = 0.0
        for j in range(SECTIONS):
            self.section_state[j] = 0.0
            self.slide[j] = 0.0
            self.turn[j] = 0.0
        engage(self)
        support(self)
        publish(self, 0.0)

    def step(self, t: float, h: float) -> None:
        engage(self)
        support(self)
        begin_grips(self)
        count = max(1, ceil(h / SUBSTEP - 1e-6))
        dt = h / count
        before = self.position[TIP]

        # gripper inputs are those of t: the speeds give the grippers' positions at t + h
        end_0 = self.gripper_position[0] + h * self.gripper_velocity[0]
        end_1 = self.gripper_position[1] + h * self.gripper_velocity[1]
        end_angle = self.gripper_angle + h * self.gripper_angular_velocity
        move_0 = (end_0 - self.carriage_position[0]) / count
        move_1 = (end_1 - self.carriage_position[1]) / count
        turn = (end_angle - self.frame_angle) / count
        begin(self, 1.0 / dt)
        for _ in range(count):
            self.deflection[0] += move_0
            self.deflection[1] += move_1
            self.twist[0] += turn
            self.twist[1] += turn
            if not eliminate(self, 1.0 / dt):
                sweep(self, dt)
                update_active_set(self)
                begin(self, 1.0 / dt)
        let_go(self)
        self.carriage_position[0] = end_0
        self.carriage_position[1] = end_1
        self.frame_angle = end_angle
        publish(self, (self.position[TIP] - before) / h)


def engage(self: Instrument) -> None:
    """How far the tip has passed the valve and each section."""
    depth = self.initial_insertion + self.position[TIP]
    self.valve_closure = 0.0
    if self.section_length[0] > 0.0:
        self.valve_closure = min(max(depth / self.valve_length, 0.0), 1.0)
    for j in range(SECTIONS):
        self.engagement[j] = 0.0
        if self.section_length[j] > 0.0:
            self.engagement[j] = min(max(depth / self.section_length[j], 0.0), 1.0)
        depth -= self.section_length[j]
        self.half_play[j] = 0.5 * self.engagement[j] * self.play[j]
        self.viscous[j] = self.drag_free + self.engagement[j] * self.drag[j]
        self.dry[j] = (self.valve_closure if j == 0 else self.engagement[j]) * self.friction[j]

        # thrust presses on the bend's wall: the ratio of thrusts that slides is that of a capstan, with one element too
        ratio = exp(self.friction_coefficient * self.engagement[j] * self.wrap[j])
        self.capstan[j] = (ratio - 1.0) / (ratio + 1.0)


def support(self: Instrument) -> None:
    """The free length that is pushed and its Euler load; an open second sleeve still guides the instrument."""
    length = max(self.entry_distance[1] - self.gripper_position[1], 1e-3)
    factor = self.end_factor[1]
    if not holds(self, 1):
        between = self.entry_distance[0] - self.gripper_position[0] - length - self.sleeve_length
        if between * self.end_factor[0] > length * factor:
            length = between
            factor = self.end_factor[0]
    self.free_length = length

    # what is bowed out is longer than the distance: a buckled length keeps its load while its ends come together
    shortening = max(self.position[0] - self.position[1] - self.thrust[1] / self.stiffness[0], 0.0)
    effective = factor * (length + shortening)
    self.buckling_load = pi * pi * self.bending_stiffness / (effective * effective)


def begin_grips(self: Instrument) -> None:
    """Update the grips: a stiffening grip keeps its force, a softening one its deflection, so that neither creates energy."""
    for g in range(GRIPPERS):
        self.slipping[g] = False
        stiffness = self.grip_stiffness[g]
        if stiffness > self.stiffness_last[g]:
            self.deflection[g] *= self.stiffness_last[g] / stiffness
        self.stiffness_last[g] = stiffness
        stiffness = self.grip_torsional_stiffness[g]
        if stiffness > self.torsional_stiffness_last[g]:
            self.twist[g] *= self.torsional_stiffness_last[g] / stiffness
        self.torsional_stiffness_last[g] = stiffness


def let_go(self: Instrument) -> None:
    """Release a grip without stiffness: its deflection becomes slip."""
    for g in range(GRIPPERS):
        lost = self.deflection[g] if self.grip_stiffness[g] <= 0.0 else 0.0
        lost_twist = self.twist[g] if self.grip_torsional_stiffness[g] <= 0.0 else 0.0
        self.deflection[g] -= lost
        self.twist[g] -= lost_twist
        count_slip(self, g, lost, lost_twist)


def publish(self: Instrument, tip_velocity: float) -> None:
    """Copy the state to the outputs, so that overriding an output does not move the instrument."""
    self.gripper_torque = 0.0
    for g in range(GRIPPERS):
        self.gripper_force[g] = -self.grip_force[g]
        self.gripper_torque -= self.grip_torque[g]
        self.slip_distance[g] = self.slipped[g]
        self.slip_angle[g] = self.slipped_angle[g]
    self.proximal_position = self.position[0]
    self.tip_position = self.position[TIP]
    self.tip_velocity = tip_velocity
    self.proximal_angle = self.angle[0]
    self.tip_angle = self.angle[TIP]
    self.insertion_depth = self.initial_insertion + self.position[TIP]
    self.free_length_force = self.thrust[1]
    self.buckled = self.thrust[1] >= self.buckling_load
