"""Instrument between two grippers, in its guiding sheath."""

from math import ceil, exp, pi, sqrt

from fmus.dead_zone import beyond
from twin.component import Component, input, local, output, parameter

GRIPPERS = 2

# nodes: at the grippers, at the sheath's valve, at the end of bend 1, at the end of bend 2 (the tip)
NODES = 4
TIP = NODES - 1
SECTIONS = NODES - 1

SUBSTEP = 1e-4  # longest substep [s]
SWEEPS = 40  # most sweeps in a substep
FORCE_TOLERANCE = 1e-4  # what a node may be off balance [N]
TORQUE_TOLERANCE = 1e-8  # the same in torsion [N*m]
LEAST = 1e-9  # limit of force [N] or torque [N*m] below which there is no grip


class Instrument(Component):
    """Catheter or guidewire: axial and torsional chains of overdamped nodes, gripped by two sleeves, in a sheath.

    Geometry of Al-Ahmad et al. (RACS), Fig. 3E: a straight part, then two opposite bends of 90 deg, radius 50 mm.
    Friction, play and drag of a section switch on as the tip passes it. Defaults are the 8 Fr catheter.
    Each substep is implicit and minimizes its energy node by node: stable and passive at any stiffness, exact in sticking.
    """

    gripper_position = input("m", "positions of the grippers from mid-stroke, positive distal", shape=(GRIPPERS,),
                             display_unit="mm", nominal=0.01)  # fmt: skip
    gripper_velocity = input("m/s", "speeds of the grippers", shape=(GRIPPERS,), display_unit="mm/s", nominal=0.05)
    limit_distal = input("N", "largest distal force of a gripper on the instrument", shape=(GRIPPERS,), minimum=0.0,
                         nominal=10.0)  # fmt: skip
    limit_proximal = input("N", "largest proximal force of a gripper on the instrument", shape=(GRIPPERS,), minimum=0.0,
                           nominal=10.0)  # fmt: skip
    torque_limit = input("N*m", "largest torque of a gripper on the instrument", shape=(GRIPPERS,), minimum=0.0,
                         display_unit="mN*m", nominal=0.02)  # fmt: skip
    grip_stiffness = input("N/m", "stiffness between carriage and instrument, 0 if open", shape=(GRIPPERS,),
                           minimum=0.0, display_unit="N/mm", nominal=4.4e3)  # fmt: skip
    grip_torsional_stiffness = input("N*m/rad", "torsional stiffness between carriage and instrument, 0 if open",
                                     shape=(GRIPPERS,), minimum=0.0, nominal=0.1)  # fmt: skip
    gripper_angle = input("rad", "angle of the frame with both grippers", display_unit="deg", nominal=1.0)
    gripper_angular_velocity = input("rad/s", "its speed", display_unit="deg/s", nominal=1.0)
    tip_force = input("N", "force on the tip, positive proximal: pushes the instrument back", nominal=0.5)
    tip_torque = input("N*m", "torque on the tip, positive against positive angles", display_unit="mN*m", nominal=1e-3)

    gripper_force = output("N", "force of the instrument on each gripper, positive distal", shape=(GRIPPERS,))
    gripper_torque = output("N*m", "torque of the instrument on the frame", display_unit="mN*m")
    proximal_position = output("m", "position of the instrument at the grippers, 0 at the start", display_unit="mm")
    tip_position = output("m", "position of the tip along the path, 0 at the start", display_unit="mm")
    tip_velocity = output("m/s", "speed of the tip", display_unit="mm/s")
    proximal_angle = output("rad", "angle of the instrument at the grippers", display_unit="deg")
    tip_angle = output("rad", "angle of the tip", display_unit="deg")
    insertion_depth = output("m", "length of the instrument beyond the sheath's valve", display_unit="mm")
    slip_distance = output("m", "slip of the instrument in each gripper, positive distal", shape=(GRIPPERS,),
                           display_unit="mm")  # fmt: skip
    slip_angle = output("rad", "slip of the instrument in each gripper", shape=(GRIPPERS,), display_unit="deg")
    slipping = output("", "whether it slipped in a gripper during the last step", start=(False,) * GRIPPERS)
    free_length = output("m", "unsupported length that buckles first", display_unit="mm")
    free_length_force = output("N", "compression between gripper and sheath, negative: tension")
    buckling_load = output("N", "compression at which the free length buckles")
    buckled = output("", "whether the free length has buckled: compression is at the buckling load", start=False)

    stiffness = parameter(
        (4.4e3, 12.0e3, 12.0e3), "N/m", "axial stiffness up to each node beyond the grippers", display_unit="N/mm",
        minimum=1.0,
        source="sheath: 4.4 N/mm of shaft and 4.4 of the grip in series are its identified 2.2 N/mm; bends as there",
    )  # fmt: skip
    play = parameter(
        (0.0, 0.3e-3, 0.3e-3), "m", "axial play of each section", display_unit="mm", minimum=0.0,
        source="clearance 0.19 mm (8 Fr in 2.86 mm) times pi/2 per bend",
    )  # fmt: skip
    friction = parameter(
        (0.6, 0.8, 0.8), "N", "friction of the valve and of each bend without thrust", minimum=0.0,
        source="as sheath, estimate: sum an order of magnitude above the contact force, as the paper says",
    )  # fmt: skip
    wrap = parameter((0.0, pi / 2, pi / 2), "rad", "angle a section is bent by", display_unit="deg", minimum=0.0,
                     source="paper, section II.C: sheath path")  # fmt: skip
    friction_coefficient = parameter(0.15, "", "friction per normal force in the bends", minimum=0.0,
                                     source="estimate: 0.05 to 0.2")  # fmt: skip
    drag = parameter(
        (6.0, 3.0, 3.0), "N*s/m", "viscous friction of each section", minimum=0.0,
        source="as sheath, estimate: a fifth of the dry friction at 40 mm/s",
    )  # fmt: skip
    drag_free = parameter(0.5, "N*s/m", "viscous friction of each node outside of the sheath", minimum=1e-3,
                          source="estimate: small beside `drag`; sets how fast an overloaded instrument slips")  # fmt: skip
    radius = parameter(1.335e-3, "m", "radius of the instrument", display_unit="mm", minimum=0.0,
                       source="8 Fr is 2.67 mm")  # fmt: skip
    torsional_stiffness = parameter(
        (8.7e-3, 46.5e-3, 46.5e-3), "N*m/rad", "torsional stiffness up to each node", minimum=1e-9,
        source="GJ 3.65e-3 N m2 over 0.42 m and 78.5 mm; GJ identified from the paper's 25 deg, given that dry friction "
        "acts at the radius; plausible without braid: 0.3 to 3e-3 N m2",
    )  # fmt: skip
    torsional_drag = parameter(2e-6, "N*m*s/rad", "viscous friction torque of each node", minimum=1e-12,
                               source="estimate: a hundredth of the dry friction at 72 deg/s")  # fmt: skip
    section_length = parameter(
        (0.343, 78.5e-3, 78.5e-3), "m", "straight part and bends of the sheath; 0: there is no such section",
        display_unit="mm", minimum=0.0, source="paper: radius 50 mm, 90 deg; straight part: estimate, 500 mm in all",
    )  # fmt: skip
    valve_length = parameter(5e-3, "m", "depth over which the valve closes on the tip", display_unit="mm", minimum=1e-6,
                             source="estimate: hemostasis valve")  # fmt: skip
    initial_insertion = parameter(0.5, "m", "insertion depth at the start", display_unit="mm", fixed=True,
                                  source="chosen: fully inserted, as in the paper's section III.D")  # fmt: skip
    bending_stiffness = parameter(2e-3, "N*m^2", "bending stiffness EI of the free length", minimum=0.0,
                                  source="estimate: 1 to 3e-3 for an 8 Fr shaft")  # fmt: skip
    end_factor = parameter(
        (0.5, 0.7), "", "buckling length per free length: between the sleeves, from the second sleeve to the sheath",
        minimum=0.1, source="estimate: 0.5 both ends clamped, as sleeves do; the valve guides but does not clamp: 0.7",
    )  # fmt: skip
    entry_distance = parameter(
        (0.17, 0.04), "m", "from the distal end of each sleeve at mid-stroke to the sheath", display_unit="mm",
        source="estimate: half a stroke and 15 mm; carriages 130 mm apart, as in the regripping sequencer",
    )  # fmt: skip
    sleeve_length = parameter(0.06, "m", "length that the second sleeve supports also when open", display_unit="mm",
                              minimum=0.0, source="estimate: as braided sleeve")  # fmt: skip
    grip_least = parameter(0.5, "N", "limit below which a gripper is open, and moving in it is no slip", minimum=0.0,
                           source="chosen: a tenth of the force that the paper requires")  # fmt: skip

    position = local(0.0, "m", "displacement of each node", shape=(NODES,), display_unit="mm")
    angle = local(0.0, "rad", "angle of each node", shape=(NODES,), display_unit="deg")
    position_last = local(0.0, "m", "displacement before the substep", shape=(NODES,), display_unit="mm")
    angle_last = local(0.0, "rad", "angle before the substep", shape=(NODES,), display_unit="deg")
    thrust = local(0.0, "N", "compression before each node, last: at the tip", shape=(NODES + 1,))
    twist_torque = local(0.0, "N*m", "torque passed on to each node, last: to the load", shape=(NODES + 1,))
    engagement = local(0.0, "", "part of each section that the tip has passed", shape=(SECTIONS,))
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
        for left in range(count, 0, -1):
            # gripper inputs are those of t: the speeds tell where the grippers will be at t + h
            for g in range(GRIPPERS):
                end = self.gripper_position[g] + h * self.gripper_velocity[g]
                move = (end - self.carriage_position[g]) / left
                self.carriage_position[g] += move
                self.deflection[g] += move
            turn = (self.gripper_angle + h * self.gripper_angular_velocity - self.frame_angle) / left
            self.frame_angle += turn
            for g in range(GRIPPERS):
                self.twist[g] += turn
            substep(self, dt)
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


def holds(self: Instrument, g: int) -> bool:
    """Whether a gripper counts as closed."""
    return max(self.limit_distal[g], self.limit_proximal[g]) > self.grip_least


def begin_grips(self: Instrument) -> None:
    """A grip that stiffens keeps its force, one that softens its deflection: neither makes energy."""
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


def substep(self: Instrument, dt: float) -> None:
    """One implicit Euler step of both chains: sweeps forth and back until they rest, then slip becomes permanent."""
    for i in range(NODES):
        # beginning where steady motion would lead
        ahead = 2.0 * self.position[i] - self.position_last[i]
        self.position_last[i] = self.position[i]
        self.position[i] = ahead
        ahead = 2.0 * self.angle[i] - self.angle_last[i]
        self.angle_last[i] = self.angle[i]
        self.angle[i] = ahead
    for _ in range(SWEEPS):
        unrest = 0.0
        for i in range(NODES):
            unrest = max(unrest, relax(self, i, dt))
        for i in range(NODES - 2, -1, -1):
            unrest = max(unrest, relax(self, i, dt))
        if unrest < 1.0:
            break
    for g in range(GRIPPERS):
        settle_grip(self, g)
    for i in range(1, NODES + 1):
        load_section(self, i)


def relax(self: Instrument, i: int, dt: float) -> float:
    """Move node i to where the energy of the substep is least, all others held; it sticks exactly within its friction.

    Returns what it was off balance, relative to what is allowed.
    """
    load_section(self, i)
    load_section(self, i + 1)
    force = self.thrust[i] - self.thrust[i + 1]
    torque = self.twist_torque[i] - self.twist_torque[i + 1]
    drag = self.drag_free
    limit = torque_limit = stiffness = torsional_stiffness = 0.0
    if i <= 0:
        for g in range(GRIPPERS):
            load_grip(self, g)
            force += self.grip_force[g]
            torque += self.grip_torque[g]
            stiffness += self.grip_stiffness[g]
            torsional_stiffness += self.grip_torsional_stiffness[g]
    else:
        j = i - 1
        stiffness += self.stiffness[j]
        torsional_stiffness += self.torsional_stiffness[j]
        drag += self.engagement[j] * self.drag[j]

        # thrust presses on the bend's wall: the ratio of thrusts that slides is that of a capstan, with one element too
        ratio = exp(self.friction_coefficient * self.engagement[j] * self.wrap[j])
        limit = (ratio - 1.0) / (ratio + 1.0) * (abs(self.thrust[i]) + abs(self.thrust[i + 1]))
        closed = self.valve_closure if i == 1 else self.engagement[j]
        limit += closed * self.friction[j]
        torque_limit = self.radius * limit
    if i < TIP:
        stiffness += self.stiffness[i]
        torsional_stiffness += self.torsional_stiffness[i]

    rigidity = stiffness + drag / dt
    moved = self.position[i] - self.position_last[i]
    change = beyond(force + stiffness * moved, limit) / rigidity - moved
    self.position[i] += change
    torsional_rigidity = torsional_stiffness + self.torsional_drag / dt
    turned = self.angle[i] - self.angle_last[i]
    turn = beyond(torque + torsional_stiffness * turned, torque_limit) / torsional_rigidity - turned
    self.angle[i] += turn
    return max(rigidity * abs(change) / FORCE_TOLERANCE, torsional_rigidity * abs(turn) / TORQUE_TOLERANCE)


def load_section(self: Instrument, i: int) -> None:
    """Thrust and torque that node i gets from the one before it; beyond the tip: the loads."""
    if i <= 0:
        return
    if i == NODES:
        self.thrust[i] = self.tip_force
        self.twist_torque[i] = self.tip_torque
        return
    j = i - 1
    play = 0.5 * self.engagement[j] * self.play[j]
    thrust = self.stiffness[j] * beyond(self.position[j] - self.position[i], play)
    if i == 1:
        thrust = min(thrust, self.buckling_load)
    self.thrust[i] = thrust
    self.twist_torque[i] = self.torsional_stiffness[j] * (self.angle[j] - self.angle[i])


def load_grip(self: Instrument, g: int) -> None:
    """Force and torque of a gripper: elastic within an ellipse of its limits, else the nearest point on the ellipse.

    Nearest in elastic energy, so that slip follows the ellipse's normal: force and torque fade where the other one slips.
    """
    stiffness = self.grip_stiffness[g]
    torsional_stiffness = self.grip_torsional_stiffness[g]
    force = stiffness * (self.deflection[g] - (self.position[0] - self.position_last[0]))
    torque = torsional_stiffness * (self.twist[g] - (self.angle[0] - self.angle_last[0]))
    limit = self.limit_distal[g] if force > 0.0 else self.limit_proximal[g]
    torque_limit = self.torque_limit[g]
    a = b = p = q = 0.0
    if limit > LEAST:
        a = abs(force) / limit
        p = stiffness / (limit * limit)
    else:
        force = 0.0
    if torque_limit > LEAST:
        b = abs(torque) / torque_limit
        q = torsional_stiffness / (torque_limit * torque_limit)
    else:
        torque = 0.0
    self.grip_force[g] = force
    self.grip_torque[g] = torque
    if a * a + b * b <= 1.0:
        return

    # multiplier m of (a / (1 + m p))^2 + (b / (1 + m q))^2 = 1, by Newton's method from a lower bound
    m = (sqrt(a * a + b * b) - 1.0) / max(p, q)
    if a > 1.0:
        m = max(m, (a - 1.0) / p)
    if b > 1.0:
        m = max(m, (b - 1.0) / q)
    for _ in range(30):
        along, about = a / (1.0 + m * p), b / (1.0 + m * q)
        excess = along * along + about * about - 1.0
        if excess <= 1e-14:
            break
        m += 0.5 * excess / (along * along * p / (1.0 + m * p) + about * about * q / (1.0 + m * q))
    self.grip_force[g] = force / (1.0 + m * p)
    self.grip_torque[g] = torque / (1.0 + m * q)


def settle_grip(self: Instrument, g: int) -> None:
    """Take over the deflection that is left of a substep's motion; the rest has slipped."""
    load_grip(self, g)
    trial = self.deflection[g] - (self.position[0] - self.position_last[0])
    trial_twist = self.twist[g] - (self.angle[0] - self.angle_last[0])
    stiffness, torsional_stiffness = self.grip_stiffness[g], self.grip_torsional_stiffness[g]
    left = self.grip_force[g] / stiffness if stiffness > 0.0 else 0.0
    twist_left = self.grip_torque[g] / torsional_stiffness if torsional_stiffness > 0.0 else 0.0
    self.deflection[g] = left
    self.twist[g] = twist_left

    # rounding is no slip
    if holds(self, g) and (abs(trial - left) > 1e-12 or abs(trial_twist - twist_left) > 1e-9):
        self.slipped[g] -= trial - left
        self.slipped_angle[g] -= trial_twist - twist_left
        self.slipping[g] = True


def publish(self: Instrument, tip_velocity: float) -> None:
    """Outputs are copies: whoever overrides one does not move the instrument."""
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
